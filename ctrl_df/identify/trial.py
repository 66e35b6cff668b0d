"""Many quick simulations of one block against records: what screening and confirmation of candidates run on.

A record is thinned once (the input by block means, which keeps its impulse; the output by picking samples, which
keeps the steps of an encoder), and a candidate is fitted by Levenberg-Marquardt on the free-run simulation error.
The start of every record (position, velocity, the slack in a gap) is fitted along with the parameters: an inertia
without a spring goes on from wherever it started.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..blocks.core import level
from ..blocks.effects import Stiction, Stribeck
from .derivatives import block_means
from .measurement import Measurement
from .simulator import Simulator, Windows, facts

RTOL = 1e-6
_FAILED = 1e6  # standardised residual of a simulation that did not reach the end


@dataclass(frozen=True, eq=False)
class Run:
    """One record, thinned; `use` marks the samples that count in a fit."""

    record: Measurement
    t: np.ndarray
    u: np.ndarray
    y: np.ndarray
    v: np.ndarray  # smoothed velocity of the measurement
    use: np.ndarray
    whole: Windows  # the record as one window

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
    zero = np.zeros(1)
    whole = Windows(np.array([0, len(record)]), zero, zero, zero, zero, zero)
    return Run(record, record.t, record.u, record.y, velocity, use, whole)


def thinning(records, samples: int) -> int:
    """Return the factor that leaves about `samples` samples a record on average."""
    return max(1, int(round(np.mean([len(r) for r in records]) / samples)))


# --- simulating -----------------------------------------------------------------------------------


def simulate(block, run: Run, start, rtol: float = RTOL) -> np.ndarray:
    """Return the simulated output at the run's samples.

    `start`: reported position [m], velocity [m/s], share of a gap taken up, at the first sample.
    """
    simulator = Simulator(block, run.record, rtol=rtol)
    given = dict(x=start[0], v=start[1], slack=start[2])
    begin = np.array([[given.get(name, 0.0) for name in simulator.nuisances]])
    return simulator.run(run.whole, None, begin, rounded=True)


def with_values(block, values):
    """`block.with_parameters` with static levels kept at or above the kinetic one."""
    values = dict(values)
    static = [k for k, e in zip(block._keys, block.effects, strict=True) if isinstance(e, Stiction | Stribeck)]
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

    block: object
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
    """Return starts read off the records."""
    starts = []
    for run in runs:
        n = max(min(len(run.t) // 200, 20), 1)
        at = float(np.mean(run.y[:n])) if run.rest else float(run.y[0])
        starts.append(np.array([at, 0.0 if run.rest else float(run.v[0]), 0.5]))
    return tuple(starts)


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
    coords = coordinates(block, free, scales)
    gap = block.core.gap > 0
    per = 3 if gap else 2
    sizes = np.array([0.02 * scales.position, 0.02 * scales.speed, 0.3][:per])
    z = np.array([c.z(block.parameters[c.name].value) for c in coords])
    z = np.concatenate([z, np.zeros(per * len(runs))])
    begin = [np.array(s[:per]) for s in starts]
    count = 0
    unit = np.sqrt(np.mean([np.var(r.y) for r in runs]))

    def unpack(z):
        values = {c.name: c.value(v) for c, v in zip(coords, z, strict=False)}
        moved = []
        for i, s in enumerate(begin):
            part = z[len(coords) + per * i : len(coords) + per * (i + 1)]
            new = s + sizes * part
            if gap:
                new[2] = min(max(new[2], 0.0), 1.0)
            moved.append(np.concatenate([new, starts[i][per:]]))
        return with_values(block, values), moved

    def outputs(z, only=None):
        nonlocal count
        try:
            model, moved = unpack(z)
        except ValueError:
            return [np.full(len(r.t), np.nan) for r in runs]
        result = []
        for i, run in enumerate(runs):
            if only is not None and i != only:
                result.append(None)
                continue
            count += 1
            result.append(simulate(model, run, moved[i], rtol))
        return result

    def errors(ys):
        parts = [np.where(np.isfinite(y), run.y - y, _FAILED * unit)[run.use] for y, run in zip(ys, runs, strict=True)]
        return np.concatenate(parts) / unit

    ys = outputs(z)
    e = errors(ys)
    cost, damping = float(e @ e), 1e-3
    jacobian = None
    for _ in range(iterations):
        columns = []
        for i in range(len(z)):
            step = np.zeros(len(z))
            step[i] = 2e-3 if i < len(coords) else 2e-2
            c = coords[i] if i < len(coords) else None
            if c is not None and c.value(z[i] + step[i]) == c.value(z[i]):
                step[i] = -step[i]
            only = None if i < len(coords) else (i - len(coords)) // per
            moved = outputs(z + step, only)
            moved = [old if new is None else new for old, new in zip(ys, moved, strict=True)]
            columns.append((errors(moved) - e) / step[i])
        jacobian = np.array(columns)
        jacobian[~np.isfinite(jacobian)] = 0.0
        normal, gradient = jacobian @ jacobian.T, jacobian @ e
        diagonal = np.diag(normal).copy()
        diagonal += 1e-12 * (diagonal.max() + 1e-300)
        better = False
        for _ in range(6):
            move = -np.linalg.solve(normal + damping * np.diag(diagonal), gradient)
            limit = np.where(np.arange(len(z)) < len(coords), 0.7, 10.0)
            move = move / max(1.0, float(np.max(np.abs(move) / limit)))
            trial_z = z + move
            trial_y = outputs(trial_z)
            trial = errors(trial_y)
            new = float(trial @ trial)
            if new < cost:
                better = True
                break
            damping = max(damping, 1e-6) * 8
            if damping > 1e4:
                break
        if not better:
            break
        gain = (cost - new) / cost
        z, ys, e, cost = trial_z, trial_y, trial, new
        damping = max(damping / 6, 1e-9)
        if gain < tolerance:
            break
    model, moved = unpack(z)
    residuals = tuple(np.where(np.isfinite(y), r.y - y, _FAILED * unit) for y, r in zip(ys, runs, strict=True))
    scaled = None if jacobian is None else jacobian * unit
    return Fitted(model, tuple(moved), tuple(ys), residuals, tuple(free), scaled, tuple(coords), count)


def keep(run: Run, use) -> Run:
    """Return the run with other samples counting."""
    return replace(run, use=use)
