"""Simulation-error least squares by multiple shooting.

Each segment of each record starts from a state of its own. Those states enter linearly near the solution;
they are eliminated segment by segment from the normal equations (variable projection), so that the work grows
with the number of parameters only. Steps are Levenberg-Marquardt, bounds are kept by projection, outliers are
bent to Huber's loss once the fit is near. Derivatives are differences of a size that moves the output by
about the noise: far above the roughness that events leave in the cost.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...simulate.crew import check
from ..prediction.initial_states import FREE
from ..prediction.segments import Segments, facts_of
from ..prediction.sensed import sensed
from ..prediction.simulator import Simulator, feasible
from ..prediction.simulators import simulator_of
from ..thresholds import GOOD, RTOL
from .elimination import products_of, states_for
from .noise_model import power
from .restarts import restart_segments, scan_gap_state
from .sensitivity import OutputSensitivity
from .states import descend, find_states
from .variables import beforehand, step_of_sensor, variables_of

Signals = list[np.ndarray]


class Problem:
    """Records, segments and free parameters of one fit.

    Call `stage` to set the segments, then `solve`; afterwards `last` holds the residuals, `nuisance` the
    initial states, `slopes` the derivatives of the last step. `followed`: tries of where a segment begins
    that are followed to their end; with none the best is taken where it errs far less as it is.
    """

    def __init__(
        self,
        model,
        records,
        names,
        budget,
        limits=None,
        error_filter=None,
        begins=FREE,
        hopeless=(math.inf, 0),
        about=None,
        followed=0,
    ):
        self.model, self.records, self.names, self.budget = model, list(records), tuple(names), budget
        self.error_filter, self.begins = error_filter, begins
        self.hopeless, self.outlook = hopeless
        self.followed = followed
        self.block = simulator_of(model, records[0]).block
        self.known = [facts_of(self.block, r) for r in records]
        self.variables = variables_of(self.block, names, self.records, self.known[0], limits)
        self.about, self.precision = beforehand(self.variables, about or {})
        self.steps = np.full(len(names), 1e-3)
        self.nfev = 0
        self.converged = False
        self.simulators: list[Simulator] = []
        self.segments: list[Segments] = []
        self.measured: Signals = []
        self.nuisance: list[np.ndarray] = []
        self.priors: list[np.ndarray] = []
        self.widest: list[np.ndarray] = []
        self.last: Signals = []
        self.slopes: tuple[list, list] | None = None
        self.noise = math.sqrt(float(np.mean([k.noise**2 for k in self.known])))

    def start(self) -> np.ndarray:
        """Return the scaled parameters of the model as it is."""
        return np.array([v.clip(v.q(self.block.parameters[v.name].value)) for v in self.variables])

    def values(self, theta):
        """Return the parameters by name, static levels kept above the kinetic one."""
        given = {v.name: v.p(q) for v, q in zip(self.variables, theta, strict=True)}
        return feasible(self.block, given) if given else None

    def stage(self, segments: list[Segments], thin, starts=None, rtol=RTOL):
        """Set the segments; initial states begin at `starts` (corrections) or at what the data say."""
        self.simulators = [
            simulator_of(self.model, r, thin=thin, begins=self.begins, rtol=rtol) for r in self.records
        ]
        self.segments, self.thin, self.rtol = segments, thin, rtol
        self.measured = [sensed(r).within(w.samples) for r, w in zip(self.records, segments, strict=True)]
        self.priors = [s.priors(w) for s, w in zip(self.simulators, segments, strict=True)]
        if starts is not None:
            # those of a fit of more states: the first of them are the same
            starts = [a[:, : p.shape[1]] for a, p in zip(starts, self.priors, strict=True)]
        self.fresh = starts is None or any(
            a.shape != p.shape for a, p in zip(starts, self.priors, strict=True)
        )
        if self.fresh:
            self.nuisance = [np.zeros_like(p) for p in self.priors]
        else:
            self.nuisance = [np.array(a) for a in starts]  # type: ignore[union-attr]
            # Starts that a fit before has found stay within reach.
            self.priors = [np.maximum(p, np.abs(a)) for p, a in zip(self.priors, self.nuisance, strict=True)]
        self.widest = [3 * p for p in self.priors]  # where a start was far off

    def simulate(self, theta, nuisance) -> Signals:
        """Return the outputs within the segments."""
        check()
        self.nfev += 1
        values = self.values(theta)
        return [s.run(w, values, a) for s, w, a in zip(self.simulators, self.segments, nuisance, strict=True)]

    def round(self, theta):
        """Let an encoder of the model round the solution's outputs (fits leave it out: it has no slope)."""
        if step_of_sensor(self.block) is None:
            return
        values = self.values(theta)
        runs = zip(self.simulators, self.segments, self.nuisance, self.measured, strict=True)
        self.last = [m - s.run(w, values, a, rounded=True) for s, w, a, m in runs]

    def residual(self, theta, nuisance) -> Signals:
        """Return measured minus simulated."""
        return [m - y for m, y in zip(self.measured, self.simulate(theta, nuisance), strict=True)]

    def cost(self, residual, nuisance, weights) -> float:
        """Return half the weighted sum of squares, initial states weighed by what is known of them."""
        if self.error_filter is not None:
            return 0.5 * power([self.weighed(k, r) for k, r in enumerate(residual)])
        total = sum(float(np.sum(w * r * r)) for r, w in zip(residual, weights, strict=True))
        known = sum(
            float(np.sum((a - m) ** 2 / p**2))
            for a, m, p in zip(nuisance, self.means(), self.priors, strict=True)
        )
        # What is known beforehand counts as much as one sample off by the noise.
        return 0.5 * (total + self.noise**2 * known)

    def weighed(self, k, x) -> np.ndarray:
        """Return what the cost sees of signals (n,) or (n, m) of one record."""
        return x if self.error_filter is None else self.error_filter.filtered(x, self.segments[k].slices)

    def power(self, signals: Signals) -> tuple[float, int]:
        """Return the sum of squares of what the cost sees of signals, and of how many values."""
        seen = [self.weighed(k, x) for k, x in enumerate(signals)]
        return power(seen) / self.unit**2, sum(map(len, seen))

    @property
    def unit(self) -> float:
        """Unit of what the cost sees: accelerations make second differences of their step squared."""
        if self.error_filter is None:
            return 1.0
        return (self.error_filter.step * self.known[0].dt) ** self.error_filter.order

    def means(self):
        """Return the expected corrections of the initial states: none, but half the slack of a gap."""
        means = [np.zeros_like(p) for p in self.priors]
        for mean, simulator in zip(means, self.simulators, strict=True):
            if "slack" in simulator.nuisances:
                mean[:, simulator.nuisances.index("slack")] = 0.5
        return means

    def sensitivity(self) -> OutputSensitivity:
        """Return the linear map about the last step of `solve`."""
        assert self.slopes is not None
        ridge = [self.noise**2 / p**2 for p in self.priors]
        return OutputSensitivity(*self.slopes, self.segments, ridge, self.error_filter)

    # --- solving --------------------------------------------------------------------------------------

    def solve(self, theta, iterations, tolerance, robust, restarts=True):
        """Levenberg-Marquardt from `theta`; the initial states go along.

        `restarts`: whether segments that err far more than others are begun anew.
        """
        if self.fresh:
            scan_gap_state(self, theta)
            if self.followed and self.names and self.error_filter is None:
                self._states_first(theta)
            self.fresh = False
        theta = self._descend(theta, iterations, tolerance, robust)
        if not restarts:
            return theta
        again = max(iterations // 2, 3)
        # without parameters a segment found lets the next one go on where it ends
        for _ in range(1 if self.names else 4):
            if not self._worth_restarting() or not restart_segments(self, theta):
                break
            theta = self._descend(theta, again, tolerance, robust)
        if (
            self._nonsmooth
            and not self.outlook
            and self._worth_restarting()
            and self.nfev < self.budget
            and any(t.min() < 0.5 for t in self._trusts())
        ):
            theta = self._without_outliers(theta, again, tolerance, robust)
        return theta

    @property
    def _nonsmooth(self) -> bool:
        """Whether events of the model come and go as its parameters move."""
        effects = getattr(self.block, "effects", ())
        return bool(self.names) and self.error_filter is None and any(e.nonsmooth for e in effects)

    def _states_first(self, theta):
        """Find the initial states alone: parameters would bend to make up for them, past events."""
        alone = self.alone(theta)
        self.nuisance = find_states(alone, self.segments, self.thin, self.rtol, self.nuisance)
        self.priors = [np.maximum(p, np.abs(a)) for p, a in zip(self.priors, self.nuisance, strict=True)]
        self.count(alone.nfev)

    def _followed_states(self, theta, nuisance):
        """Return the initial states after a few steps from `nuisance`, and what is left of the outputs."""
        alone = self.alone(theta)
        alone.stage(self.segments, self.thin, nuisance, self.rtol)
        alone.solve(np.zeros(0), 2, 1e-2, False, restarts=False)
        self.nfev += alone.nfev
        return alone.nuisance, alone.last

    def alone(self, theta, which=slice(None)) -> Problem:
        """Return the problem of the initial states alone, for some of the records."""
        model = self.simulators[0].with_values(self.values(theta) or {})
        hopeless, records = (self.hopeless, self.outlook), self.records[which]
        return Problem(
            model, records, (), self.budget, None, self.error_filter, self.begins, hopeless,
            followed=self.followed,
        )  # fmt: skip

    def _without_outliers(self, theta, iterations, tolerance, robust):
        """Let the segments that fit decide the parameters, then find where the others begin.

        A segment whose start lies in a wrong minimum pulls the parameters to where it can never leave that
        minimum. What is better is kept.
        """
        kept = theta, self.nuisance, self.last, self.slopes, self.converged
        trial = self._descend(theta, iterations, tolerance, robust, self._trusts())
        restart_segments(self, trial)
        trial = self._descend(trial, iterations, tolerance, robust)
        if power(self.last) < power(kept[2]):
            return trial
        theta, self.nuisance, self.last, self.slopes, self.converged = kept
        return theta

    def _worth_restarting(self) -> bool:
        """Whether the error could come below what is hopeless if all segments erred like the good ones."""
        if self.error_filter is not None or math.isinf(self.hopeless):
            return True
        rms = [np.sqrt(w.means(e**2)) for w, e in zip(self.segments, self.last, strict=True)]
        return float(np.quantile(np.concatenate(rms), GOOD)) < self.hopeless

    def _trusts(self) -> Signals:
        """Return weights of the samples (n,): 1 in segments that err like the rest, less in worse ones."""
        trusts = []
        for segments, e in zip(self.segments, self.last, strict=True):
            power = segments.means(e**2)
            usual = max(float(np.median(power)), self.noise**2)
            trusts.append(segments.spread(np.minimum(1.0, (2 * usual / np.maximum(power, usual)) ** 2)))
        return trusts

    def _descend(self, theta, iterations, tolerance, robust, trusts=None):
        if self.followed and not self.names and not any(s.continued for s in self.simulators):
            self.last = self.residual(theta, self.nuisance)
            descend(self, iterations, tolerance)
            return theta
        damping, before, self.converged = 1e-3, 0.0, False
        nuisance = self.nuisance
        residual = self.residual(theta, nuisance)
        if not self.names and not any(a.size for a in nuisance):
            iterations = 0
        for iteration in range(iterations):
            if self.nfev >= self.budget:
                break
            weights = self._weights(residual, robust and iteration > 0)
            if trusts is not None:
                weights = [w * t for w, t in zip(weights, trusts, strict=True)]
            cost = self.cost(residual, nuisance, weights)
            # counts as much as one sample off by the error there is: parameters that the data leave open stay
            known = self.precision * 2 * cost / sum(map(len, residual))
            cost += 0.5 * float(known @ (theta - self.about) ** 2)
            base = [m - e for m, e in zip(self.measured, residual, strict=True)]
            self.slopes = jp, js = self.jacobian(theta, nuisance, base)
            gain, accepted = 0.0, False
            for _attempt in range(6):
                h, g, back = self.normal(jp, js, residual, weights, nuisance, damping)
                step = self._step(h + np.diag(known), g - known * (theta - self.about), theta, damping)
                trial_theta = np.array([v.clip(q) for v, q in zip(self.variables, theta + step, strict=True)])
                trial_nuisance = back(trial_theta - theta)
                trial = self.residual(trial_theta, trial_nuisance)
                away = 0.5 * float(known @ (trial_theta - self.about) ** 2)
                trial_cost = away + self.cost(trial, trial_nuisance, weights)
                if trial_cost >= cost and self.followed and self._nonsmooth:
                    # of some segments the begin may have to follow past an event
                    trial_nuisance, trial = self._followed_states(trial_theta, trial_nuisance)
                    trial_cost = away + self.cost(trial, trial_nuisance, weights)
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
            left = iterations - iteration - 1 + self.outlook
            self.nuisance, self.last = nuisance, residual
            if self.too_far(1 - max(gain, before), left):
                break
            before = gain
        self.nuisance, self.last = nuisance, residual
        return theta

    def too_far(self, pace: float, left: int) -> bool:
        """Whether the error is hopeless still after so many steps more, its square falling at this pace."""
        if math.isinf(self.hopeless):
            return False
        total, count = self.power(self.last)
        return total / count * pace**left > self.hopeless**2

    def count(self, runs):
        """Count simulations that seek initial states: bounded by themselves, outside the descent's budget."""
        self.nfev += runs
        self.budget += runs

    def jacobian(self, theta, nuisance, base, central=False):
        """Return per record (n, p) and (n, ns) derivatives of the output, scaled parameters."""
        pairs = [self._ends(i, theta, central) for i in range(len(self.variables))]
        thetas = [end for pair in pairs for end in pair if end is not None]
        moved: list[Signals] = [[] for _ in thetas]
        by_start = []
        for k, simulator in enumerate(self.simulators):
            asked = [(self.segments[k], self.values(q), nuisance[k]) for q in thetas]
            starts, widths = self._moved_starts(k, nuisance[k], self.segments[k], self.priors[k])
            values = self.values(theta)
            asked += [(self.segments[k], values, start) for start in starts if start is not None]
            signals = simulator.run_all(asked)
            for found, y in zip(moved, signals, strict=False):
                found.append(y)
            by_start.append(_by_start(starts, widths, signals[len(thetas) :], base[k], self._by_place(k)))
            self.nfev += len(starts) / len(self.simulators)
        self.nfev += len(thetas)
        columns: list[Signals] = [[] for _ in self.records]
        ready = iter(moved)
        for i, pair in enumerate(pairs):
            above, below = (base if end is None else next(ready) for end in pair)
            width = float(pair[0][i] - (theta if pair[1] is None else pair[1])[i])
            for k, column in enumerate(self._column(i, above, below, width)):
                columns[k].append(column)
        by_parameter = [
            np.array(c).T.reshape(len(m), -1) for c, m in zip(columns, self.measured, strict=True)
        ]
        return by_parameter, by_start

    def _ends(self, i, theta, central):
        """Return the parameters between which variable `i` is differenced; None for those there are."""
        h, variable = self.steps[i], self.variables[i]
        up = theta.copy()
        up[i] = variable.clip(theta[i] + h)
        if up[i] == theta[i]:
            h = -h
            up[i] = theta[i] + h
        if not central:
            return up, None
        down = theta.copy()
        down[i] = variable.clip(theta[i] - h)
        return up, (None if down[i] == theta[i] else down)

    def _column(self, i, moved, other, width) -> Signals:
        """Return the derivatives by variable `i`, and choose its next step."""
        variable, h = self.variables[i], self.steps[i]
        change = math.sqrt(float(np.mean([np.mean((a - b) ** 2) for a, b in zip(moved, other, strict=True)])))
        # Next time the output shall move by a third of the noise.
        wanted = abs(h) * 0.3 * self.noise / change if change > 0 else 10 * abs(h)
        self.steps[i] = min(max(wanted, 1e-6, 0.05 * abs(h)), 0.02 if variable.log else 0.05)
        return [(a - b) / width for a, b in zip(moved, other, strict=True)]

    def state_products(self, k, which, seen) -> np.ndarray:
        """Return Z' Z, (nr, ns + 1, ns + 1), of some segments, Z = [derivatives by states, residual].

        `which`, `seen`: of the segments (nw,) and the samples (n,) of a signal, booleans.
        """
        segments, simulator = self.segments[k], self.simulators[k]
        some = segments.only(which)
        starts, widths = self._moved_starts(k, self.nuisance[k][which], some, self.priors[k][which])
        signals = simulator.run_all([(some, None, start) for start in starts if start is not None])
        self.nfev += len(starts) * len(some) / len(segments) / len(self.segments)
        base = (self.measured[k] - self.last[k])[seen]
        js = _by_start(starts, widths, signals, base, self._by_place(k)[seen])
        return products_of(js, self.last[k][seen], None, some)

    def _moved_starts(self, k, nuisance, segments, priors):
        """Move each initial state of one record: states (nw, ns), None where the derivative is 1; how far."""
        simulator = self.simulators[k]
        starts, widths = [], []
        for j, name in enumerate(simulator.nuisances):
            if name == "x" and not simulator.position_dependent:
                starts.append(None)
                widths.append(None)
                continue
            size = {"x": 1.0, "v": 1.0}.get(name, 0.1) * np.minimum(
                priors[:, j],
                {"x": 0.003 * self.known[k].position, "v": 0.003 * self.known[k].speed}.get(name, np.inf),
            )
            moved = nuisance.copy()
            sign = np.where(moved[:, j] > 0.8, -1.0, 1.0) if name == "slack" else np.ones(len(size))
            moved[:, j] += sign * size
            starts.append(moved)
            widths.append(segments.spread(sign * size))
        return starts, widths

    def _by_place(self, k) -> np.ndarray:
        """Return the derivatives by the place where no law knows it."""
        return sensed(self.records[k]).of_place(len(self.segments[k].samples))

    def within_reach(self, k, states, rows=slice(None)) -> np.ndarray:
        """Return initial states (nr, ns) of some segments, none farther off than it can be.

        The data say where a segment begins: its start must not hide the faults of the model.
        """
        means, limit = self.means()[k][rows], 3 * self.priors[k][rows]
        states = np.clip(states, means - limit, means + limit)
        names = self.simulators[k].nuisances
        if "slack" in names:
            j = names.index("slack")
            states[:, j] = np.clip(states[:, j], 0.0, 1.0)
        return states

    def normal(self, jp, js, residual, weights, nuisance, damping=0.0):
        """Eliminate the initial states; return (H, g, back) with ``back(step)`` their own step."""
        p = len(self.names)
        h, g, pieces = np.zeros((p, p)), np.zeros(p), []
        prior, means = self.noise**2, self.means()
        for k, segments in enumerate(self.segments):
            if self.error_filter is not None:
                a, r = self.weighed(k, jp[k]), self.weighed(k, residual[k])
                h += a.T @ a
                g += a.T @ r
                continue
            others = np.column_stack((jp[k], residual[k]))
            products, ns = products_of(js[k], others, weights[k], segments), js[k].shape[1]
            h += products[:, ns:-1, ns:-1].sum(axis=0)
            g += products[:, ns:-1, -1].sum(axis=0)
            if ns:
                precision = prior / self.priors[k] ** 2
                off = nuisance[k] - means[k]
                solved = states_for(products, precision, damping, off)
                coupled = products[:, :ns, ns:-1]
                h -= np.einsum("wsi,wsj->ij", coupled, solved[:, :, :p])
                g -= np.einsum("wsi,ws->i", coupled, solved[:, :, p])
                pieces.append((k, solved))

        def back(step):
            moved = [a.copy() for a in nuisance]
            for k, solved in pieces:
                there = nuisance[k] + solved[:, :, p] - solved[:, :, :p] @ step
                moved[k] = self.within_reach(k, there)
            return moved

        return h, g, back

    def _weights(self, residual, robust):
        if not robust:
            return [np.ones(len(r)) for r in residual]
        everything = np.concatenate(residual)
        sigma = max(1.4826 * float(np.median(np.abs(everything))), self.noise)
        return [np.minimum(1.0, 4 * sigma / np.maximum(np.abs(r), 1e-300)) for r in residual]

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


def _by_start(starts, widths, signals, base, by_place) -> np.ndarray:
    """Return derivatives (n, ns) of one record's output by its initial states, all segments at once."""
    moved = iter(signals)
    rows = [
        by_place if start is None else (next(moved) - base) / width
        for start, width in zip(starts, widths, strict=True)
    ]
    return np.array(rows).T.reshape(len(base), len(rows))
