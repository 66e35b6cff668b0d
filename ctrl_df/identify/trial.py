"""Many quick simulations of one block against records: what screening and confirmation of candidates run on.

A record is thinned once (the input by block means, which keeps its impulse; the output by picking samples, which
keeps the steps of an encoder), and a candidate is fitted by Levenberg-Marquardt on the free-run simulation error.
The start of every record (position, velocity, the slack in a gap) is fitted along with the parameters: an inertia
without a spring goes on from wherever it started.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..blocks.core import level
from ..blocks.effects import Stiction, Stribeck
from .derivatives import block_means
from .measurement import Measurement
from .simulator import Simulator, Windows, facts

RTOL = 1e-6


@dataclass(frozen=True, eq=False)
class Run:
    """One record, thinned; `use` marks the samples that count in a fit."""

    record: Measurement
    t: np.ndarray
    u: np.ndarray
    y: np.ndarray
    v: np.ndarray  # smoothed velocity of the measurement
    use: np.ndarray
    windows: Windows  # parts with a start of their own

    @property
    def rest(self) -> bool:
        """Whether the record begins with nothing applied."""
        return bool(abs(self.u[0]) < 1e-9 * np.max(np.abs(self.u)))


def as_run(record, thin: int = 1, use=None) -> Run:
    """Thin a `Measurement`; `use` marks samples of the record that count (all by default)."""
    use = np.ones(len(record), bool) if use is None else use
    velocity = facts(record).velocity
    if thin > 1 and record.regular:
        held = record.input_hold == "zoh"
        u = block_means(record.u, thin) if held else record.u[::thin]
        channels = {k: c[::thin] for k, c in record.channels.items()}
        speed = None if record.velocity is None else record.velocity[::thin]
        record = record._with(t=record.t[::thin], u=u, y=record.y[::thin], velocity=speed, channels=channels)
        use, velocity = use[::thin], velocity[::thin]
    return Run(record, record.t, record.u, record.y, velocity, use, _cut([0, len(record)]))


def _cut(edges) -> Windows:
    zero = np.zeros(len(edges) - 1)
    return Windows(np.asarray(edges), zero, zero, zero, zero, zero)


def windowed(run: Run, count: int | None = None) -> Run:
    """Cut a run into windows of about two to-and-fro motions, or into `count`, each with a start of its own."""
    n, span = len(run.t), run.t[-1] - run.t[0]
    count = count or int(min(max(round(span / max(2.5 * facts(run.record).swing, 60 * span / n)), 4), 40))
    return replace(run, windows=_cut(np.linspace(0, n, count + 1).astype(int)))


def thinning(records, samples: int) -> int:
    """Return the factor that leaves about `samples` samples a record on average."""
    return max(1, int(round(np.mean([len(r) for r in records]) / samples)))


# --- simulating -----------------------------------------------------------------------------------


def simulate(block, run: Run, starts, rtol: float = RTOL) -> np.ndarray:
    """Return the simulated output at the run's samples.

    `starts`, (windows, 3): reported position [m], velocity [m/s], share of a gap taken up, where each begins.
    """
    simulator = Simulator(block, run.record, rtol=rtol)
    begin = np.zeros((len(starts), len(simulator.nuisances)))
    for j, name in enumerate(simulator.nuisances):
        if name in _STARTS:
            begin[:, j] = starts[:, _STARTS.index(name)]
    return simulator.run(run.windows, None, begin, rounded=True)


_STARTS = ("x", "v", "slack")


def with_values(block, values):
    """`block.with_parameters` with static levels kept at or above the kinetic one."""
    values = dict(values)
    static = [
        k for k, e in zip(block._keys, block.effects, strict=True) if isinstance(e, Stiction | Stribeck)
    ]
    if static:
        # lift the static levels out of the way, read the kinetic one, then put them back above it
        table = block.parameters
        wanted = {k: values.get(f"{k}.level", table[f"{k}.level"].value) for k in static}
        block = block.with_parameters({**values, **{f"{k}.level": 1e30 for k in static}})
        base = [e for e in block.effects if e.role == "friction" and e.side == "motor" and e.rank == 0]
        kinetic = level(base, 1.0, 1.0, 0.0)
        return block.with_parameters({f"{k}.level": max(v, kinetic) for k, v in wanted.items()})
    return block.with_parameters(values) if values else block


# --- parameters in units of one -------------------------------------------------------------------


@dataclass(frozen=True)
class Scales:
    """Typical sizes of force [N], position [m], speed [m/s] and mass [kg] in the records."""

    force: float
    position: float
    speed: float
    mass: float

    def of(self, unit: str) -> float:
        """Return the typical size of a parameter of that unit."""
        f, x, v = self.force, self.position, self.speed
        table = {
            "N": f, "N s/m": f / v, "N s^2/m^2": f / v**2, "N/m": f / x, "N/m^3": f / x**3, "m": x, "m/s": v,
            "s": x / v, "kg": self.mass, "1/s": v / x, "rad/s": v / x, "N/m^2": f / x**2, "m/s^2": v * v / x,
        }  # fmt: skip
        return table.get(unit, 1.0)


def scales_of(block, runs) -> Scales:
    """Read the scales off the records."""
    force = math.sqrt(np.mean([np.mean(r.u**2) for r in runs]))
    position = math.sqrt(np.mean([np.var(r.y) for r in runs]))
    speed = math.sqrt(np.mean([np.mean(r.v**2) for r in runs]))
    mass = sum(p.value for k, p in block.parameters.items() if "." not in k)
    return Scales(max(force, 1e-300), max(position, 1e-300), max(speed, 1e-300), mass)


@dataclass(frozen=True)
class Coordinate:
    """One parameter as a number of order one: its logarithm where it is positive, else its multiple of a scale."""

    name: str
    logarithmic: bool
    scale: float
    lower: float
    upper: float

    def value(self, z: float) -> float:
        """Return the physical value."""
        if self.logarithmic:
            value = self.scale * math.exp(min(max(z, -50.0), 50.0))
        else:
            value = self.scale * z
        return float(min(max(value, self.lower), self.upper))

    def z(self, value: float) -> float:
        """Return the coordinate of a physical value."""
        return math.log(value / self.scale) if self.logarithmic else value / self.scale


def coordinates(block, names, scales: Scales) -> list[Coordinate]:
    """Return coordinates of the named parameters about the block's own values."""
    found = []
    for name in names:
        p = block.parameters[name]
        usual = scales.of(p.unit)
        positive = p.lower >= 0 and p.value > 1e-6 * usual and math.isinf(p.upper)
        lower = p.lower if not p.strict else max(p.lower, 1e-9 * usual)
        if p.upper < 1.0 and p.strict:
            lower = 0.02
        size = p.value if positive else max(abs(p.value), 0.02 * usual)
        found.append(Coordinate(name, positive, size, lower, p.upper))
    return found


# --- fitting --------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Fitted:
    """A block fitted to runs: simulated outputs, residuals, starts, and the Jacobian of the last step."""

    block: Any
    starts: tuple[np.ndarray, ...]
    outputs: tuple[np.ndarray, ...]
    residuals: tuple[np.ndarray, ...]
    names: tuple[str, ...]
    jacobian: np.ndarray | None = None
    coordinates: tuple[Coordinate, ...] = ()
    simulations: int = 0

    @property
    def rms(self) -> float:
        """Root mean square residual over all runs."""
        return math.sqrt(float(np.mean(np.concatenate(self.residuals) ** 2)))


def first_starts(runs) -> tuple[np.ndarray, ...]:
    """Return starts read off the records, one row a window."""
    return tuple(np.array([_start_at(run, int(i)) for i in run.windows.edges[:-1]]) for run in runs)


def _start_at(run, i):
    n = max(min(len(run.t) // 200, 20), 4)
    part = slice(i, min(i + n, len(run.t)))
    if i == 0 and np.max(np.abs(run.u[part])) < 1e-9 * np.max(np.abs(run.u)):
        return float(np.mean(run.y[part])), 0.0, 0.5
    low = max(i - n, 0)
    t, y, v = run.t[low : part.stop], run.y[low : part.stop], run.v[low : part.stop]
    way = np.concatenate(([0.0], np.cumsum(np.diff(t) * 0.5 * (v[1:] + v[:-1]))))
    way -= way[i - low]
    return float(np.mean(y - way)), float(run.v[i]), 0.5


def fit(
    block, runs, free, scales: Scales, *, starts=None, iterations=12, rtol=RTOL, tolerance=1e-4, prior=None
) -> Fitted:
    """Fit the named parameters and the starts of all runs by damped least squares.

    Parameters
    ----------
    block : Mechanism
        With its start values.
    runs : sequence of Run
        Records; each counts by its samples marked `use`.
    free : sequence of str
        Parameters to move; an empty one fits the starts alone.
    scales : Scales
        For steps and parameters that begin at zero.
    starts : sequence of arrays or None
        Start of each run; None: read off the record.
    iterations : int
        Bound on the steps.
    """
    starts = first_starts(runs) if starts is None else starts
    problem = _Problem(block, runs, coordinates(block, free, scales), starts, scales, rtol)
    z, ys, e, jacobian = problem.solve(iterations, tolerance)
    model, moved = problem.unpack(z)
    residuals = tuple(r.y - y for y, r in zip(ys, runs, strict=True))
    return Fitted(
        model, tuple(moved), tuple(ys), residuals, tuple(free), jacobian, tuple(problem.coords), problem.simulations
    )  # fmt: skip


class _Problem:
    """Unknowns of one fit: coordinates of the free parameters, then the starts of all windows."""

    def __init__(self, block, runs, coords, starts, scales, rtol):
        self.block, self.runs, self.coords, self.starts, self.rtol = block, runs, coords, starts, rtol
        self.gap = block.core.gap > 0
        self.kinds = 3 if self.gap else 2
        self.sizes = np.array([0.02 * scales.position, 0.02 * scales.speed, 0.3])
        self.counts = [len(s) for s in starts]
        self.unit = scales.position
        self.simulations = 0
        names = [c.name for c in coords]
        self.z0 = np.array([c.z(block.parameters[n].value) for c, n in zip(coords, names, strict=True)])
        self.total = len(coords) + self.kinds * sum(self.counts)

    def unpack(self, z):
        values = {c.name: c.value(v) for c, v in zip(self.coords, z, strict=False)}
        at, moved = len(self.coords), []
        for s, n in zip(self.starts, self.counts, strict=True):
            new = s.copy()
            new[:, : self.kinds] += (
                z[at : at + self.kinds * n].reshape(n, self.kinds) * self.sizes[: self.kinds]
            )
            new[:, 2] = np.clip(new[:, 2], 0.0, 1.0)
            moved.append(new)
            at += self.kinds * n
        return with_values(self.block, values), moved

    def outputs(self, z):
        try:
            model, moved = self.unpack(z)
        except ValueError:
            return None
        self.simulations += 1
        return [simulate(model, run, s, self.rtol) for run, s in zip(self.runs, moved, strict=True)]

    def errors(self, ys):
        return np.concatenate([(r.y - y)[r.use] for y, r in zip(ys, self.runs, strict=True)]) / self.unit

    def jacobian(self, z, ys, e):
        rows = np.zeros((self.total, len(e)))
        p = len(self.coords)
        for i, c in enumerate(self.coords):
            step = 2e-3 if c.value(z[i] + 2e-3) != c.value(z[i]) else -2e-3
            trial = z.copy()
            trial[i] += step
            moved = self.outputs(trial)
            if moved is not None:
                rows[i] = (self.errors(moved) - e) / step
        # the starts of all windows at once: each moves its own window only
        windows = np.concatenate([
            np.repeat(np.arange(n) + sum(self.counts[:k]), np.diff(r.windows.edges))[r.use]
            for k, (r, n) in enumerate(zip(self.runs, self.counts, strict=True))
        ])  # fmt: skip
        for kind in range(self.kinds):
            trial = z.copy()
            step = 2e-2 if kind < 2 else 0.1
            trial[p + kind :: self.kinds] += step
            moved = self.outputs(trial)
            if moved is None:
                continue
            slope = (self.errors(moved) - e) / step
            rows[p + kind + self.kinds * windows, np.arange(len(e))] = slope
        rows[~np.isfinite(rows)] = 0.0
        return rows

    def solve(self, iterations, tolerance) -> tuple[Any, Any, Any, Any]:
        """Levenberg-Marquardt; returns unknowns, outputs, errors and the last Jacobian."""
        z = np.concatenate([self.z0, np.zeros(self.total - len(self.coords))])
        ys = self.outputs(z)
        e = self.errors(ys)
        cost, damping, jacobian = float(e @ e), 1e-3, np.zeros((0, len(e)))
        limit = np.where(np.arange(len(z)) < len(self.coords), 0.7, 30.0)
        for _ in range(iterations):
            jacobian = self.jacobian(z, ys, e)
            # A start that the data do not feel (at rest, friction holds) is kept near its estimate.
            ridge = np.where(np.arange(len(z)) < len(self.coords), 0.0, cost / len(e) / 100.0)
            normal, gradient = jacobian @ jacobian.T + np.diag(ridge), jacobian @ e + ridge * z
            diagonal = np.diag(normal) + 1e-12 * (np.max(np.diag(normal)) + 1e-300)
            accepted = None
            for _ in range(5):
                move = -np.linalg.solve(normal + damping * np.diag(diagonal), gradient)
                move = np.clip(move, -limit, limit)
                trial = self.outputs(z + move)
                if trial is not None:
                    errors = self.errors(trial)
                    new = float(errors @ errors)
                    if new < cost:
                        accepted = (z + move, trial, errors, new)
                        break
                damping = max(damping, 1e-6) * 10
            if accepted is None:
                break
            gain = (cost - accepted[3]) / cost
            z, ys, e, cost = accepted
            damping = max(damping / 8, 1e-9)
            if gain < tolerance:
                break
        return z, ys, e, jacobian
