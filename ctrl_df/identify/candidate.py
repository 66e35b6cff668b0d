"""Simulation-error least squares by multiple shooting: the fast inner fit behind `refit` and the diagnosis.

Each window of each record starts from a state of its own. Those states enter linearly near the solution; they
are eliminated window by window from the normal equations (variable projection), so that the work grows with
the number of parameters only. Steps are Levenberg-Marquardt, bounds are kept by projection, outliers are
bent to Huber's loss once the fit is near. Derivatives are differences of a size that moves the output by
about the noise: far above the roughness that events leave in the cost.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .measurement import Measurement
from .residual_tests import noise_model
from .simulator import Simulator, Windows, facts, feasible, make_windows, usual_window

MODES = ("auto", "free", "windows")


@dataclass
class Candidate:
    """Outcome of `fit_candidate`.

    Attributes
    ----------
    model : block
        With the parameters found.
    names, values : tuple of str, (p,) array
        The free parameters.
    covariance : (p, p) array
        Of `values`, for residuals of the colour seen.
    jacobian : list of (n, p) array
        Per record the derivative of the output by the parameters, initial states eliminated.
    residual, simulated : list of (n,) array
        Per record, measured minus simulated.
    cost : float
        Half the sum of squared residuals.
    rmse, nrmse : float
        Over all records; nrmse over the rms of the centred outputs.
    nfev : int
        Simulations of all records together.
    converged : bool
        Whether the last step promised less than a thousandth of the cost.
    at_bound : tuple of bool
        Per parameter.
    null : list of (float, array)
        Relative singular value and direction (in scaled parameters) the data do not determine.
    scale : (p,) array
        Natural scale of each parameter.
    starts : list of (nw, ns) array
        Initial states, as corrections (see `Simulator.run`).
    windows : list of Windows
        Where the model was started anew.
    """

    model: Any
    names: tuple[str, ...]
    values: np.ndarray
    covariance: np.ndarray
    jacobian: list
    residual: list
    simulated: list
    cost: float
    rmse: float
    nrmse: float
    nfev: int
    converged: bool
    at_bound: tuple[bool, ...]
    null: list
    scale: np.ndarray
    starts: list
    windows: list
    simulators: list = field(repr=False, default_factory=list)

    @property
    def parameters(self) -> dict[str, float]:
        """Free parameters by name."""
        return dict(zip(self.names, map(float, self.values), strict=True))

    @property
    def standard_errors(self) -> dict[str, float]:
        """Standard errors by name."""
        return dict(
            zip(self.names, map(float, np.sqrt(np.maximum(np.diag(self.covariance), 0))), strict=True)
        )


def default_free(block) -> tuple[str, ...]:
    """Return the parameters that a refit moves unless told otherwise."""
    return tuple(k for k, p in block.parameters.items() if p.free and k != "sensor_quantization.step")


def window_lengths(model, records: Sequence[Measurement], mode="auto", window=None) -> list[float | None]:
    """Return per record the length of window [s] that `mode` means; None: the whole record."""
    if mode not in MODES:
        raise ValueError(f"mode must be one of {', '.join(MODES)}; got {mode!r}.")
    if window is not None and not window > 0:
        raise ValueError(
            f"window needs a length > 0 [s]; got {window!r}. Leave it out for one that fits the motion."
        )
    lengths: list[float | None] = []
    for record in records:
        simulator = Simulator(model, record)
        usual = float(window) if window is not None else usual_window(record)
        free = mode == "free" or simulator.closed
        if mode == "auto" and window is None:
            free = free or simulator.anchored or record.duration < 1.5 * usual
        lengths.append(None if free else usual)
    return lengths


def fit_candidate(
    model,
    records: Sequence[Measurement],
    start: Mapping[str, float] | None = None,
    free: Sequence[str] | None = None,
    *,
    budget: int = 120,
    mode: str = "auto",
    window: float | None = None,
    thin: int = 4,
    polish: int = 2,
    coarse: bool | None = None,
    robust: bool = True,
    starts: Sequence[np.ndarray] | None = None,
    tolerance: float = 1e-3,
    central: bool = False,
    iterations: int = 12,
) -> Candidate:
    """Fit a model to records, fast.

    Parameters
    ----------
    model : block or loop
        Structure and start values.
    records : sequence of Measurement
    start : mapping or None
        Parameters that start elsewhere than the model's own values (all others keep theirs).
    free : sequence of str or None
        Parameters to move; None: `default_free`.
    budget : int
        Bound on the simulations of all records.
    mode, window
        As for `compare`.
    thin : int
        Samples a step of the input in all but the last iterations; 1: never thinned.
    polish : int
        Iterations at full rate at the end; 0 leaves the fit at the thinned input.
    coarse : bool or None
        Whether to begin with short windows, which converge from far off; None: unless `start` is given.
    robust : bool
        Huber's loss beyond four times the median deviation.
    starts : sequence of arrays or None
        Initial states of an earlier fit with the same windows, to begin with.
    tolerance : float
        Relative decrease of the cost that is not worth another iteration.
    central : bool
        Whether the last Jacobian is by central differences.
    iterations : int
        Bound on the iterations over the full windows.
    """
    records = list(records)
    first = Simulator(model, records[0])
    model = first.with_values(dict(start)) if start else model
    block = first.block if not start else Simulator(model, records[0]).block
    names = tuple(default_free(block) if free is None else free)
    table = block.parameters
    for name in names:
        if name not in table:
            raise ValueError(f"a free parameter must be one of {', '.join(table)}; got {name!r}.")
    lengths = window_lengths(model, records, mode, window)
    problem = _Problem(model, records, names, budget)
    theta = problem.start()
    if coarse is None:
        coarse = start is None
    if coarse and names and not first.closed:
        for short in _short_windows(first, records, lengths):
            problem.stage(short, thin)
            theta = problem.solve(theta, iterations=6, tolerance=0.02, robust=False)
    problem.stage(lengths, thin if polish else max(thin, 1), starts)
    theta = problem.solve(theta, iterations=iterations, tolerance=tolerance, robust=robust)
    if polish and thin > 1:
        problem.stage(lengths, 1, problem.nuisance)
        theta = problem.solve(theta, iterations=polish, tolerance=tolerance, robust=robust)
    return problem.result(theta, central)


def _short_windows(simulator, records, lengths) -> list[list[float | None]]:
    """Return the lengths of windows of the stages before the last, shortest first.

    Over half a stroke an error of a parameter has not grown beyond what its slope tells. An elastic joint
    rings faster than the drive turns: there a few periods of it come first, then more of them.
    """
    spans = [r.duration if n is None else n for r, n in zip(records, lengths, strict=True)]
    first = [0.5 * facts(r).swing for r in records]
    core = simulator.block.core if simulator.mechanism else None
    if core is not None and core.stiffness > 0:
        mass = core.masses[0] * core.masses[-1] / sum(core.masses)
        first = [min(f, 4 * 2 * math.pi * math.sqrt(mass / core.stiffness)) for f in first]
    first = [max(f, 40 * facts(r).dt) for f, r in zip(first, records, strict=True)]
    stages: list[list[float | None]] = []
    factor = 1.0
    while any(1.5 * factor * f < span for f, span in zip(first, spans, strict=True)) and len(stages) < 4:
        stages.append([min(factor * f, span) for f, span in zip(first, spans, strict=True)])
        if core is None or core.stiffness == 0:
            break
        factor *= 4
    return stages


# --- parameters as the solver sees them ---------------------------------------------------------------


class _Variable:
    """One parameter: physical value p, scaled value q; strictly positive ones on a logarithmic scale."""

    def __init__(self, name, parameter, natural):
        self.name = name
        self.lower, self.upper = parameter.lower, parameter.upper
        # Bounded on both sides (a share, a restitution): linear. Strictly positive: logarithmic.
        self.log = parameter.strict and parameter.lower == 0 and math.isinf(parameter.upper)
        self.scale = abs(parameter.value) if parameter.value != 0 else natural
        self.natural = natural
        if parameter.strict and not self.log:
            self.lower = parameter.lower + 1e-3

    def q(self, p):
        return math.log(p / self.scale) if self.log else p / self.scale

    def p(self, q):
        return self.scale * math.exp(min(max(q, -40.0), 40.0)) if self.log else q * self.scale

    def clip(self, q):
        if self.log:
            return q
        return min(max(q, self.lower / self.scale), self.upper / self.scale)

    def slope(self, q):
        """Return dp/dq."""
        return self.p(q) if self.log else self.scale

    def step(self, q):
        """Largest move of one iteration."""
        return 1.0 if self.log else 1.0 * max(abs(q), 1.0)


def natural_scale(unit: str, known) -> float:
    """Return the size a parameter of this unit has when it matters on a record with these facts."""
    length, speed, force = known.spread, known.speed, known.force
    return {
        "N": 0.1 * force, "m": 0.1 * length, "m/s": 0.1 * speed, "s": 5 * known.dt,
        "N/m": 0.1 * force / length,
        "N s/m": 0.1 * force / speed, "N s^2/m^2": 0.1 * force / speed**2, "N/m^3": 0.1 * force / length**3,
        "kg": force * length / speed**2, "rad": 1.0,
    }.get(unit, 1.0)  # fmt: skip


class _Problem:
    """Records, windows and free parameters of one fit."""

    def __init__(self, model, records, names, budget):
        self.model, self.records, self.names, self.budget = model, records, names, budget
        self.known = [facts(r) for r in records]
        block = Simulator(model, records[0]).block
        table = block.parameters if names else {}
        self.block = block
        self.variables = [_Variable(k, table[k], natural_scale(table[k].unit, self.known[0])) for k in names]
        for variable in self.variables:
            if (
                variable.name == "hard_stop.limit"
                and "sensor_offset" not in block._keys
                and "drift" not in block._keys
            ):
                # No body has been where a stop would not let it.
                reach = max(
                    float(np.max(np.abs(r.y))) - 4 * k.noise for r, k in zip(records, self.known, strict=True)
                )
                variable.lower = max(variable.lower, reach)
        self.steps = np.full(len(names), 1e-3)
        self.nfev = 0
        self.converged = False
        self.simulators: list[Simulator] = []
        self.windows: list[Windows] = []
        self.nuisance: list[np.ndarray] = []
        self.priors: list[np.ndarray] = []
        self.noise = math.sqrt(float(np.mean([k.noise**2 for k in self.known])))

    def start(self):
        return np.array([v.clip(v.q(self.block.parameters[v.name].value)) for v in self.variables])

    def values(self, theta):
        given = {v.name: v.p(q) for v, q in zip(self.variables, theta, strict=True)}
        return feasible(self.block, given) if given else None

    def stage(self, lengths, thin, starts=None):
        """Set the windows; initial states begin at `starts` or at what the data say."""
        self.simulators = [Simulator(self.model, r, thin=thin) for r in self.records]
        self.windows = [make_windows(r, length) for r, length in zip(self.records, lengths, strict=True)]
        self.priors = [s.priors(w) for s, w in zip(self.simulators, self.windows, strict=True)]
        fresh = starts is None or any(a.shape != p.shape for a, p in zip(starts, self.priors, strict=True))
        self.nuisance = [np.zeros_like(p) for p in self.priors] if fresh else [np.array(a) for a in starts]  # type: ignore[union-attr]
        self.fresh = fresh

    def simulate(self, theta, nuisance):
        self.nfev += 1
        values = self.values(theta)
        return [s.run(w, values, a) for s, w, a in zip(self.simulators, self.windows, nuisance, strict=True)]

    def residual(self, theta, nuisance):
        return [r.y - y for r, y in zip(self.records, self.simulate(theta, nuisance), strict=True)]

    def cost(self, residual, nuisance, weights):
        total = sum(float(np.sum(w * r * r)) for r, w in zip(residual, weights, strict=True))
        return 0.5 * (total + self._prior_weight() * sum(
            float(np.sum((a - m) ** 2 / p**2))
            for a, m, p in zip(nuisance, self.means(), self.priors, strict=True)
        ))  # fmt: skip

    def _prior_weight(self):
        # A prior counts as much as one sample off by the noise.
        return self.noise**2

    def means(self):
        means = [np.zeros_like(p) for p in self.priors]
        for mean, simulator in zip(means, self.simulators, strict=True):
            if "slack" in simulator.nuisances:
                mean[:, simulator.nuisances.index("slack")] = 0.5
        return means

    # --- solving --------------------------------------------------------------------------------------

    def scan_slack(self, theta):
        """Find where in its gap each window begins, by trying five places (the cost has several minima)."""
        for k, simulator in enumerate(self.simulators):
            if "slack" not in simulator.nuisances:
                continue
            column = simulator.nuisances.index("slack")
            values, best, chosen = self.values(theta), None, None
            for place in (0.02, 0.25, 0.5, 0.75, 0.98):
                trial = self.nuisance[k].copy()
                trial[:, column] = place
                e = self.records[k].y - simulator.run(self.windows[k], values, trial)
                errors = np.array([np.sum((e[w] - e[w].mean()) ** 2) for w in self.windows[k].slices])
                if best is None:
                    best, chosen = errors, np.full(len(errors), place)
                else:
                    chosen = np.where(errors < best, place, chosen)  # type: ignore[arg-type]
                    best = np.minimum(best, errors)
            self.nuisance[k][:, column] = chosen
            self.nfev += 5

    def jacobian(self, theta, nuisance, base, central=False):
        """Return per record (n, p) and (n, ns) derivatives of the output, scaled parameters."""
        columns: list[list[np.ndarray]] = [[] for _ in self.records]
        for i, variable in enumerate(self.variables):
            h = self.steps[i]
            up = theta.copy()
            up[i] = variable.clip(theta[i] + h)
            if up[i] == theta[i]:
                h = -h
                up[i] = theta[i] + h
            moved = self.simulate(up, nuisance)
            width = up[i] - theta[i]
            other = base
            if central:
                down = theta.copy()
                down[i] = variable.clip(theta[i] - h)
                if down[i] != theta[i]:
                    other = self.simulate(down, nuisance)
                    width = up[i] - down[i]
            change = math.sqrt(
                float(np.mean([np.mean((a - b) ** 2) for a, b in zip(moved, other, strict=True)]))
            )
            for k, (a, b) in enumerate(zip(moved, other, strict=True)):
                columns[k].append((a - b) / width)
            # Next time the output shall move by a third of the noise.
            wanted = abs(h) * 0.3 * self.noise / change if change > 0 else 10 * abs(h)
            self.steps[i] = min(max(wanted, 1e-6, 0.05 * abs(h)), 0.02 if variable.log else 0.05)
        by_start = []
        for k, simulator in enumerate(self.simulators):
            rows = []
            values = self.values(theta)
            for j, name in enumerate(simulator.nuisances):
                if name == "x" and not simulator.tied:
                    rows.append(np.ones(len(self.records[k])))
                    continue
                size = {"x": 1.0, "v": 1.0}.get(name, 0.1) * np.minimum(
                    self.priors[k][:, j],
                    {"x": 0.003 * self.known[k].spread, "v": 0.003 * self.known[k].speed}.get(name, np.inf),
                )
                moved_start = nuisance[k].copy()
                sign = np.where(moved_start[:, j] > 0.8, -1.0, 1.0) if name == "slack" else np.ones(len(size))
                moved_start[:, j] += sign * size
                moved = simulator.run(self.windows[k], values, moved_start)
                width = np.concatenate(
                    [
                        np.full(w.stop - w.start, c)
                        for w, c in zip(self.windows[k].slices, sign * size, strict=True)
                    ]
                )
                rows.append((moved - base[k]) / width)
            self.nfev += len(rows) / len(self.simulators)
            by_start.append(np.array(rows).T.reshape(len(self.records[k]), len(rows)))
        return [
            np.array(c).T.reshape(len(r), len(self.names)) for c, r in zip(columns, self.records, strict=True)
        ], by_start

    def normal(self, jp, js, residual, weights, nuisance, damping=0.0):
        """Eliminate the initial states; return (H, g, back) with ``back(step)`` their own step."""
        p = len(self.names)
        h, g, pieces = np.zeros((p, p)), np.zeros(p), []
        prior, means = self._prior_weight(), self.means()
        for k, windows in enumerate(self.windows):
            for w, where in enumerate(windows.slices):
                a, s, r, c = jp[k][where], js[k][where], residual[k][where], weights[k][where]
                ac = a * c[:, None]
                h += ac.T @ a
                g += ac.T @ r
                if s.shape[1]:
                    sc = s * c[:, None]
                    precision = prior / self.priors[k][w] ** 2
                    ss = sc.T @ s + np.diag(precision)
                    ss += damping * np.diag(np.diag(ss))
                    sa, sr = sc.T @ a, sc.T @ r - precision * (nuisance[k][w] - means[k][w])
                    solved = np.linalg.solve(ss, np.column_stack((sa, sr)))
                    h -= sa.T @ solved[:, :p]
                    g -= sa.T @ solved[:, p]
                    pieces.append((k, w, solved))

        def back(step):
            moved = [a.copy() for a in nuisance]
            for k, w, solved in pieces:
                limit = 3 * self.priors[k][w]
                there = moved[k][w] + solved[:, p] - solved[:, :p] @ step
                # The data say where a window begins: the start is no parameter to hide the model's faults in.
                moved[k][w] = np.clip(there, means[k][w] - limit, means[k][w] + limit)
            for k, simulator in enumerate(self.simulators):
                if "slack" in simulator.nuisances:
                    j = simulator.nuisances.index("slack")
                    moved[k][:, j] = np.clip(moved[k][:, j], 0.0, 1.0)
            return moved

        return h, g, back

    def weights(self, residual, robust):
        if not robust:
            return [np.ones(len(r)) for r in residual]
        everything = np.concatenate(residual)
        sigma = max(1.4826 * float(np.median(np.abs(everything))), self.noise)
        return [np.minimum(1.0, 4 * sigma / np.maximum(np.abs(r), 1e-300)) for r in residual]

    def solve(self, theta, iterations, tolerance, robust):
        """Levenberg-Marquardt from `theta`; the initial states go along."""
        if self.fresh:
            self.scan_slack(theta)
            self.fresh = False
        damping, self.converged = 1e-3, False
        nuisance = self.nuisance
        residual = self.residual(theta, nuisance)
        for iteration in range(iterations):
            if self.nfev >= self.budget:
                break
            weights = self.weights(residual, robust and iteration > 0)
            cost = self.cost(residual, nuisance, weights)
            base = [r.y - e for r, e in zip(self.records, residual, strict=True)]
            jp, js = self.jacobian(theta, nuisance, base)
            gain, accepted = 0.0, False
            for _attempt in range(6):
                h, g, back = self.normal(jp, js, residual, weights, nuisance, damping)
                step = self._step(h, g, theta, damping)
                trial_theta = np.array([v.clip(q) for v, q in zip(self.variables, theta + step, strict=True)])
                trial_nuisance = back(trial_theta - theta)
                trial = self.residual(trial_theta, trial_nuisance)
                trial_cost = self.cost(trial, trial_nuisance, weights)
                if trial_cost < cost:
                    gain, accepted = 1 - trial_cost / cost, True
                    theta, nuisance, residual = trial_theta, trial_nuisance, trial
                    damping = max(damping / 10, 1e-7)
                    break
                damping *= 10
                if self.nfev >= self.budget or damping > 1e4:
                    break
            if not accepted or gain < tolerance:
                self.converged = True
                break
        self.nuisance, self.last = nuisance, residual
        return theta

    def _step(self, h, g, theta, damping):
        """Solve the damped equations; parameters held by a bound stay there."""
        p = len(g)
        if p == 0:
            return np.zeros(0)
        size = np.diag(h).copy()
        size = np.maximum(size, 1e-12 * max(float(size.max()), 1e-300))
        held = np.zeros(p, bool)
        step = np.zeros(p)
        for _ in range(p):
            free: Any = ~held
            step[:] = 0.0
            if not free.any():
                break
            matrix = h[np.ix_(free, free)] + np.diag(damping * size[free])
            root = np.sqrt(size[free])
            step[free] = np.linalg.lstsq(matrix / np.outer(root, root), g[free] / root, rcond=1e-12)[0] / root
            blocked = [
                i
                for i in np.flatnonzero(free)
                if self.variables[i].clip(theta[i] + np.sign(step[i]) * 1e-9) == theta[i] and step[i] != 0
            ]
            if not blocked:
                break
            held[blocked] = True
        limits = np.array([v.step(q) for v, q in zip(self.variables, theta, strict=True)])
        largest = float(np.max(np.abs(step) / limits)) if p else 0.0
        return step / max(largest, 1.0)

    # --- the answer -----------------------------------------------------------------------------------

    def result(self, theta, central) -> Candidate:
        nuisance, residual = self.nuisance, self.last
        base = [r.y - e for r, e in zip(self.records, residual, strict=True)]
        values = self.values(theta) or {}
        p = len(self.names)
        jp, js = (
            self.jacobian(theta, nuisance, base, central)
            if p
            else ([np.zeros((len(r), 0)) for r in residual], None)
        )
        covariance, null, projected = np.zeros((0, 0)), [], jp
        slopes = np.array([v.slope(q) for v, q in zip(self.variables, theta, strict=True)])
        if p:
            projected, covariance, null = self._uncertainty(jp, js, residual, nuisance)
            covariance = covariance * np.outer(slopes, slopes)
            projected = [j / slopes for j in projected]
        vector = np.array([values[k] for k in self.names])
        at_bound = tuple(
            bool(
                v.clip(q + 1e-6) == q
                or v.clip(q - 1e-6) == q
                or abs(values[v.name] - v.p(q)) > 1e-9 * v.scale
            )
            for v, q in zip(self.variables, theta, strict=True)
        )
        total = sum(float(e @ e) for e in residual)
        spread = sum(float(np.sum((r.y - r.y.mean()) ** 2)) for r in self.records)
        count = sum(len(e) for e in residual)
        return Candidate(
            self.simulators[0].with_values(values), self.names, vector, covariance, projected, residual,
            base,
            0.5 * total, math.sqrt(total / count), math.sqrt(total / spread), round(self.nfev),
            self.converged,
            at_bound, null, np.array([max(v.scale, v.natural) for v in self.variables]), nuisance,
            self.windows,
            self.simulators,
        )  # fmt: skip

    def _uncertainty(self, jp, js, residual, nuisance):
        """Covariance of the scaled parameters by the sandwich rule, the noise's colour from the residual.

        cov = H^-1 (sum over records J' Omega J) H^-1, with Omega the covariance of a stationary residual
        whose spectrum an autoregressive model gives; lost degrees of freedom are given back.
        """
        ones = [np.ones(len(r)) for r in residual]
        projected = [j.copy() for j in jp]
        prior = self._prior_weight()
        for k, windows in enumerate(self.windows):
            for w, where in enumerate(windows.slices):
                s = js[k][where]
                if s.shape[1]:
                    ss = s.T @ s + np.diag(prior / self.priors[k][w] ** 2)
                    projected[k][where] -= s @ np.linalg.solve(ss, s.T @ jp[k][where])
        h, _, _ = self.normal(jp, js, residual, ones, nuisance)
        size = np.sqrt(np.maximum(np.diag(h), 1e-300))
        dead = size <= 1e-9 * max(float(size.max()), 1e-300)
        size[dead] = 1.0
        scaled = h / np.outer(size, size)
        eigen, vectors = np.linalg.eigh(scaled)
        top = max(float(eigen[-1]), 1e-300)
        null = [
            (math.sqrt(max(e, 0.0) / top), v / size / max(float(np.max(np.abs(v / size))), 1e-300))
            for e, v in zip(eigen, vectors.T, strict=True)
            if e < 1e-7 * top
        ]
        inverse = (vectors / np.maximum(eigen, 1e-12 * top)) @ vectors.T / np.outer(size, size)
        middle = np.zeros_like(h)
        for k, e in enumerate(residual):
            n = len(e)
            lost = len(self.names) / len(residual) + js[k].shape[1] * len(self.windows[k])
            length = 1 << (n - 1).bit_length()
            transform = np.fft.rfft(projected[k], length, axis=0)
            omega = np.linspace(0, math.pi, transform.shape[0])
            density = noise_model(e).spectrum(omega) + 1e-6 * self.noise**2
            double = np.full(len(omega), 2.0)
            double[0] = double[-1] = 1.0
            middle += n / max(n - lost, 0.1 * n) * np.real(
                (transform.conj() * (density * double / length)[:, None]).T @ transform
            )  # fmt: skip
        return projected, inverse @ middle @ inverse, null
