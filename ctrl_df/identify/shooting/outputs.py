"""What a model puts out over segments of records, how that changes with what moves, and how far it is off."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...simulate.parallel import check
from ..prediction.segments import Segments
from ..prediction.sensed import sensed
from .elimination import products_of, rounded_moves, states_for
from .noise_model import power
from .problem import Problem
from .thresholds import (
    HIDDEN_NUDGE,
    NUDGE_FALLS,
    NUDGE_LEAST,
    NUDGE_MOST,
    OUTPUT_MOVES,
    OUTPUT_ROUNDED,
    SLACK_TURNED,
    STATE_NUDGE,
    WIDEST,
)

Signals = list[np.ndarray]


@dataclass(frozen=True)
class States:
    """Initial states of the segments, (nw, ns) a record: corrections, and how far off each may be."""

    values: Signals
    reach: Signals

    def at(self, values) -> States:
        """Return others within the same reach."""
        return replace(self, values=values)

    def same(self, other: States) -> bool:
        """Whether others have the same values, to the last digit."""
        return all(np.array_equal(a, b) for a, b in zip(self.values, other.values, strict=True))

    @property
    def widened(self) -> States:
        """The same, what was found farther off being within reach."""
        pairs = zip(self.reach, self.values, strict=True)
        return replace(self, reach=[np.maximum(p, np.abs(a)) for p, a in pairs])


class SegmentOutputs:
    """A model over segments of records.

    Parameters
    ----------
    problem : Problem
    segments : list of Segments
    decimation : int
        Samples a step of the input.
    starts : list of (nw, ns) arrays or None
        Initial states to begin with; None: what the data say.
    """

    def __init__(self, problem: Problem, segments: list[Segments], decimation, starts=None):
        self.problem, self.segments, self.decimation = problem, list(segments), decimation
        self.simulators = problem.simulators(decimation)
        self.measured = [sensed(r).within(w.samples) for r, w in zip(problem.records, segments, strict=True)]
        reach = [s.beginnings.priors(w) for s, w in zip(self.simulators, segments, strict=True)]
        if starts is not None:
            # those of a fit of more states: the first of them are the same
            starts = [a[:, : p.shape[1]] for a, p in zip(starts, reach, strict=True)]
        self.fresh = starts is None or any(a.shape != p.shape for a, p in zip(starts, reach, strict=True))
        values = [np.zeros_like(p) for p in reach] if self.fresh else [np.array(a) for a in starts or ()]
        for value, simulator, some in zip(values, self.simulators, self.segments, strict=True):
            for j, name in enumerate(simulator.free_states):
                value[~simulator.beginnings.acts(name, some), j] = 0.0
        self.initial_states = States(values, reach).widened
        self.widest = [WIDEST * p for p in self.initial_states.reach]  # where a start was far off

    # --- how far it is off ----------------------------------------------------------------------------

    def simulate(self, theta, starts) -> Signals:
        """Return the outputs within the segments."""
        check()
        self.problem.count(1)
        runs = zip(self.simulators, self.segments, starts, strict=True)
        return [s.run(w, self.problem.values(theta, k), a) for k, (s, w, a) in enumerate(runs)]

    def residual(self, theta, starts) -> Signals:
        """Return measured minus simulated."""
        return [m - y for m, y in zip(self.measured, self.simulate(theta, starts), strict=True)]

    def rounded(self, theta, starts) -> Signals:
        """Return the residual of what an encoder of the model rounds (fits leave it out: it has no slope)."""
        runs = zip(self.simulators, self.segments, starts, self.measured, strict=True)
        return [
            m - s.run(w, self.problem.values(theta, k), a, rounded=True)
            for k, (s, w, a, m) in enumerate(runs)
        ]

    def cost(self, residual, states: States, weights) -> float:
        """Return half the weighted sum of squares, initial states weighed by what is known of them."""
        if self.problem.settings.error_filter is not None:
            return 0.5 * power([self.weighed(k, r) for k, r in enumerate(residual)])
        total = sum(float(np.sum(w * r * r)) for r, w in zip(residual, weights, strict=True))
        known = sum(
            float(np.sum((a - m) ** 2 / p**2))
            for a, m, p in zip(states.values, self.means(), states.reach, strict=True)
        )
        # What is known beforehand counts as much as one sample off by the noise.
        return 0.5 * (total + self.problem.noise**2 * known)

    def weighed(self, k, x) -> np.ndarray:
        """Return what the cost sees of signals (n,) or (n, m) of one record."""
        error_filter = self.problem.settings.error_filter
        return x if error_filter is None else error_filter.filtered(x, self.segments[k].slices)

    def power(self, signals: Signals) -> tuple[float, int]:
        """Return the sum of squares of what the cost sees of signals, and of how many values."""
        filtered = [self.weighed(k, x) for k, x in enumerate(signals)]
        return power(filtered) / self.problem.unit**2, sum(map(len, filtered))

    def error(self, residual: Signals) -> float:
        """Return the rms of what the cost sees of a residual, in the unit of the problem."""
        total, count = self.power(residual)
        return math.sqrt(total / count)

    def means(self) -> Signals:
        """Return the expected corrections of the initial states: none, but half the slack of a gap."""
        means = [np.zeros_like(a) for a in self.initial_states.values]
        for mean, simulator in zip(means, self.simulators, strict=True):
            if "slack" in simulator.free_states:
                mean[:, simulator.free_states.index("slack")] = 0.5
        return means

    def precision(self, states: States) -> Signals:
        """Return what is known of the initial states beforehand, in units of one sample."""
        return [self.problem.noise**2 / p**2 for p in states.reach]

    def within_reach(self, k, values, reach) -> np.ndarray:
        """Return initial states (nr, ns) of segments, none farther off than it can be.

        The data say where a segment begins: its start must not hide the faults of the model.
        """
        names = self.simulators[k].free_states
        means = np.array([0.5 if name == "slack" else 0.0 for name in names])
        values = np.clip(values, means - WIDEST * reach, means + WIDEST * reach)
        if "slack" in names:
            j = names.index("slack")
            values[:, j] = np.clip(values[:, j], 0.0, 1.0)
        return values

    # --- how it changes -------------------------------------------------------------------------------

    def jacobian(self, theta, states: States, base, central=False) -> tuple[Signals, Signals]:
        """Return per record (n, names) and (n, ns) derivatives of the output, scaled parameters.

        What the records have for themselves moves in all of them at once.
        """
        problem = self.problem
        moves = [np.unique([of[j] for of in problem.of_record]) for j in range(len(problem.names))]
        pairs = [self._ends(variables, theta, central) for variables in moves]
        thetas = [end for pair in pairs for end in pair if end is not None]
        moved: list[Signals] = [[] for _ in thetas]
        by_start = []
        for k, simulator in enumerate(self.simulators):
            initial = states.values[k]
            asked = [(self.segments[k], problem.values(q, k), initial) for q in thetas]
            moves = self._moves(k, initial, self.segments[k], states.reach[k])
            asked += _requests(moves, problem.values(theta, k))
            signals = simulator.run_all(asked)
            for found, y in zip(moved, signals, strict=False):
                found.append(y)
            by_start.append(_by_start(moves, signals[len(thetas) :], base[k], self._by_place(k)))
            problem.count(_share_run(moves, self.segments[k]) / len(self.simulators))
        problem.count(len(thetas))
        columns: list[Signals] = [[] for _ in self.segments]
        outputs = iter(moved)
        for j, pair in enumerate(pairs):
            above, below = (base if end is None else next(outputs) for end in pair)
            widths = pair[0] - (theta if pair[1] is None else pair[1])
            for k, column in enumerate(self._columns(j, above, below, widths)):
                columns[k].append(column)
        by_parameter = [
            np.array(c).T.reshape(len(m), -1) for c, m in zip(columns, self.measured, strict=True)
        ]
        return by_parameter, by_start

    def _ends(self, variables, theta, central):
        """Return the parameters between which some variables are differenced; None for those there are."""
        up, down = theta.copy(), theta.copy()
        for i in variables:
            h, variable = self.problem.steps[i], self.problem.variables[i]
            up[i] = variable.clip(theta[i] + h)
            if not variable.has_room(theta[i], h):
                h = -h
                up[i] = theta[i] + h
            down[i] = variable.clip(theta[i] - h)
        return up, (down if central and np.any(down != theta) else None)

    def _columns(self, j, moved, other, widths) -> Signals:
        """Return the derivatives by parameter `j` in each record, and choose the next steps of its variables.

        `widths`: by how much all variables were moved.
        """
        problem, power = self.problem, {}
        which = [of[j] for of in problem.of_record]
        changes = [_beyond_rounding(a, b) for a, b in zip(moved, other, strict=True)]
        for i, change in zip(which, changes, strict=True):
            power.setdefault(i, []).append(np.mean(change**2))
        for i, squares in power.items():
            change, h = math.sqrt(float(np.mean(squares))), abs(problem.steps[i])
            wanted = h * OUTPUT_MOVES * problem.noise / change if change > 0 else math.inf
            most = NUDGE_MOST[problem.variables[i].log]
            problem.steps[i] = min(max(wanted, NUDGE_LEAST, NUDGE_FALLS * h), most)
        return [change / float(widths[i]) for i, change in zip(which, changes, strict=True)]

    def state_products(self, k, some, samples, starts, reach, residual, finer) -> np.ndarray:
        """Return Z' Z, (nr, ns + 1, ns + 1), of `some` segments, Z = [derivatives by states, residual].

        `samples`: which of a signal (n,) are theirs, booleans; `starts`, `reach`: of these segments,
        `residual`: at these samples; `finer`: shares (nr,) of the usual differences for derivatives.
        """
        segments, simulator = self.segments[k], self.simulators[k]
        moves = self._moves(k, starts, some, reach, finer)
        signals = simulator.run_all(_requests(moves, None))
        self.problem.count(_share_run(moves, some) * len(some) / len(segments) / len(self.segments))
        base = self.measured[k][samples] - residual
        js = _by_start(moves, signals, base, self._by_place(k)[samples])
        return products_of(js, residual, None, some)

    def _moves(self, k, starts, segments, reach, finer=1.0) -> list[_Move | None]:
        """Move each initial state (nw, ns) of one record; None where the derivative is 1.

        `finer`: shares (nw,) of the usual moves.
        """
        simulator, known = self.simulators[k], self.problem.known[k]
        moves: list[_Move | None] = []
        for j, name in enumerate(simulator.free_states):
            if name == "x" and not simulator.position_dependent:
                moves.append(None)
                continue
            typical = {"x": known.position, "v": known.speed}.get(name)
            size = HIDDEN_NUDGE * reach[:, j]
            if typical is not None:
                size = np.minimum(reach[:, j], STATE_NUDGE * typical)
            size = finer * size
            trial = starts.copy()
            sign = np.where(trial[:, j] > SLACK_TURNED, -1.0, 1.0) if name == "slack" else np.ones(len(size))
            trial[:, j] += sign * size
            widths, which = segments.spread(sign * size), simulator.beginnings.acts(name, segments)
            if not np.all(which):
                samples = segments.spread(which)
                moves.append(_Move(segments.only(which), trial[which], widths[samples], samples))
            else:
                moves.append(_Move(segments, trial, widths, slice(None)))
        return moves

    def _by_place(self, k) -> np.ndarray:
        """Return the derivatives by the place where no law knows it."""
        return sensed(self.problem.records[k]).of_place(len(self.segments[k].samples))

    def products(self, jp, js, residual, weights) -> Signals:
        """Return the products, (nw, q, q), of derivatives by states, by parameters, and residual, per record.

        Where the cost sees filtered outputs, which no segment has for itself, (1, p + 1, p + 1).
        """
        found = []
        for k, segments in enumerate(self.segments):
            if self.problem.settings.error_filter is not None:
                a, r = self.weighed(k, jp[k]), self.weighed(k, residual[k])[:, None]
                found.append(np.block([[a.T @ a, a.T @ r], [r.T @ a, r.T @ r]])[None])
            else:
                found.append(products_of(js[k], np.column_stack((jp[k], residual[k])), weights[k], segments))
        return found

    def normal(self, products: Signals, states: States, damping=0.0):
        """Eliminate the initial states; return (H, g, back) with ``back(step)`` those of a step.

        `products`: of `products`, whatever the damping.
        """
        p, n = len(self.problem.variables), len(self.problem.names)
        h, g, pieces = np.zeros((p, p)), np.zeros(p), []
        means, precision = self.means(), self.precision(states)
        for k, z in enumerate(products):
            of: Any = self.problem.of_record[k]
            here, ns = np.ix_(of, of), z.shape[1] - n - 1
            h[here] += z[:, ns:-1, ns:-1].sum(axis=0)
            g[of] += z[:, ns:-1, -1].sum(axis=0)
            if ns:
                solved = states_for(z, precision[k], damping, states.values[k] - means[k])
                i = np.arange(ns)
                curvature = z[:, i, i] + precision[k]
                error = z[:, -1, -1].sum() / len(self.measured[k])
                coupled = z[:, :ns, ns:-1]
                h[here] -= np.einsum("wsi,wsj->ij", coupled, solved[:, :, :n])
                g[of] -= np.einsum("wsi,ws->i", coupled, solved[:, :, n])
                pieces.append((k, of, solved, curvature, error))

        def back(step) -> States:
            moved = [a.copy() for a in states.values]
            for k, of, solved, curvature, error in pieces:
                moves = solved[:, :, n] - solved[:, :, :n] @ step[of]
                moves = rounded_moves(moves, states.reach[k], curvature, error)
                moved[k] = self.within_reach(k, states.values[k] + moves, states.reach[k])
            return states.at(moved)

        return h, g, back


@dataclass(frozen=True)
class _Move:
    """An initial state that is moved: in which segments, states (nw, ns), how far and where in the signal."""

    segments: Segments
    starts: np.ndarray
    widths: np.ndarray
    samples: Any


def _beyond_rounding(moved, other) -> np.ndarray:
    """Return by how much an output has moved; 0 where only rounding has: it would point the next step."""
    change = moved - other
    largest = float(np.max(np.abs(other), initial=0.0))
    return change if np.max(np.abs(change), initial=0.0) > OUTPUT_ROUNDED * largest else np.zeros_like(change)


def _requests(moves, values) -> list:
    """Return what a simulator is asked for."""
    return [(m.segments, values, m.starts) for m in moves if m is not None and len(m.segments)]


def _share_run(moves, segments) -> float:
    """Return how often segments are simulated; a derivative that is known counts as one."""
    return sum(1.0 if m is None else len(m.segments) / len(segments) for m in moves)


def _by_start(moves, signals, base, by_place) -> np.ndarray:
    """Return derivatives (n, ns) of one record's output by its initial states, all segments at once."""
    moved, columns = iter(signals), np.zeros((len(base), len(moves)))
    for j, move in enumerate(moves):
        if move is None:
            columns[:, j] = by_place
        elif len(move.segments):
            columns[move.samples, j] = (next(moved) - base[move.samples]) / move.widths
    return columns
