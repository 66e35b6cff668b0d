"""Initial states alone, of a `multiple_shooting.Problem` without parameters.

Segments that share nothing are problems of their own: each has its own Levenberg-Marquardt damping, and takes
or refuses a step by its own error, so that one that begins badly holds up no other.
"""

from __future__ import annotations

import numpy as np

from ..prediction.segments import split
from ..thresholds import BEGINNINGS, DAMPED, SEGMENT_LEAST
from .elimination import states_for
from .noise_model import power


def find_states(problem, segments, thin, rtol, starts=None) -> list[np.ndarray]:
    """Return the initial states of segments: found at once, or over their beginnings first.

    The longer a segment, the more minima its error has over the state it begins in; a short beginning
    hardly has any. Each way can end in a wrong one: the better counts.

    Parameters
    ----------
    problem : multiple_shooting.Problem
    segments : list of Segments
    thin, rtol, starts
        As for `Problem.stage`; `starts` is where the first way begins.
    """
    found = []
    for shares in ((), BEGINNINGS):
        states = None if shares else starts
        for share in shares:
            pairs = list(zip(problem.records, segments, strict=True))
            parts = [split(r, w, share, SEGMENT_LEAST) for r, w in pairs]
            first = [p.only(np.isin(p.begins, w.begins)) for p, w in zip(parts, segments, strict=True)]
            problem.stage(first, thin, states, rtol)
            problem.solve(np.zeros(0), iterations=5, tolerance=1e-2, robust=False)
            states = problem.nuisance
        problem.stage(segments, thin, states, rtol)
        problem.solve(np.zeros(0), iterations=8, tolerance=1e-4, robust=False)
        found.append((power(problem.last), len(found), problem.nuisance))
    return min(found, key=lambda f: f[:2])[2]


def descend(problem, iterations: int, tolerance: float) -> None:
    """Take steps of every segment by itself, until none gains more than `tolerance` of its cost."""
    left = [_Record(problem, k) for k in range(len(problem.segments))]
    for i in range(iterations):
        if problem.nfev >= problem.budget or not any(r.open.any() for r in left):
            break
        before = power(problem.last)
        for r in left:
            r.step(tolerance)
        if problem.too_far(power(problem.last) / max(before, 1e-300), iterations - i - 1 + problem.outlook):
            break
    problem.converged = not any(r.open.any() for r in left)


class _Record:
    """The segments of one record on their way; those that have not come to their end are `open`."""

    def __init__(self, problem, k):
        self.problem, self.k = problem, k
        self.simulator, self.segments = problem.simulators[k], problem.segments[k]
        self.precision, self.means = problem.noise**2 / problem.priors[k] ** 2, problem.means()[k]
        residual = problem.last[k]
        self.cost = self._cost(self.segments, residual, problem.nuisance[k], slice(None))
        self.damping = np.full(len(self.segments), 1e-3)
        self.open = np.full(len(self.segments), problem.nuisance[k].shape[1] > 0)

    def _cost(self, segments, residual, starts, rows):
        known = (starts - self.means[rows]) ** 2 * self.precision[rows]
        return segments.sums(residual**2) + known.sum(axis=1)

    def _signal(self, rows):
        """Return which segments these rows are, and which samples of a signal theirs (booleans)."""
        which = np.isin(np.arange(len(self.segments)), rows)
        return which, self.segments.spread(which)

    def step(self, tolerance):
        """Take a step in every open segment, damped until its cost falls."""
        problem, k = self.problem, self.k
        rows = np.flatnonzero(self.open)
        if not rows.size:
            return
        products = problem.state_products(k, *self._signal(rows))
        for _ in range(DAMPED):
            which, seen = self._signal(rows)
            some, starts = self.segments.only(which), problem.nuisance[k]
            off = starts[rows] - self.means[rows]
            moves = states_for(products, self.precision[rows], self.damping[rows], off)[:, :, 0]
            trial = problem.within_reach(k, starts[rows] + moves, rows)
            residual = problem.measured[k][seen] - self.simulator.run(some, None, trial)
            problem.nfev += len(rows) / len(self.segments) / len(problem.segments)
            cost = self._cost(some, residual, trial, rows)
            better = cost < self.cost[rows]
            gained = rows[better]
            self.open[gained[cost[better] > (1 - tolerance) * self.cost[gained]]] = False
            self.cost[gained], starts[gained] = cost[better], trial[better]
            problem.last[k][self._signal(gained)[1]] = residual[some.spread(better)]
            self.damping[gained] = np.maximum(self.damping[gained] / 10, 1e-7)
            rows, products = rows[~better], products[~better]
            self.damping[rows] *= 10
            if not rows.size:
                return
        self.open[rows] = False
