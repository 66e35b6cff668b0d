"""Initial states alone, of a `least_squares.Stage` without parameters.

Segments that share nothing are problems of their own: each has its own Levenberg-Marquardt damping, and takes
or refuses a step by its own error, so that one that begins badly holds up no other.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...thresholds import NOTHING
from .elimination import rounded_moves, states_for
from .noise_model import power
from .segmented_records import SegmentedRecords
from .thresholds import (
    CLEARLY,
    DAMPED,
    DAMPED_BY,
    DAMPING,
    DAMPING_LEAST,
    EFFORT_ALONE,
    EFFORT_BEGUN,
    NUDGE_FINER,
    NUDGE_FINEST,
    OUTLYING_NOISE,
    OUTLYING_SEGMENT,
    RIGHT_SHARE,
)


def find_states(stage) -> list[np.ndarray]:
    """Return the initial states of a stage: found at once, or over the beginnings of its segments first.

    Each way can end in a wrong minimum: the better counts.
    """
    found, grown = stage.solve(np.zeros(0), *EFFORT_ALONE, robust=False), over_beginnings(stage)
    if grown is not None and power(grown.residual) < CLEARLY * power(found.residual):
        found = grown
    return found.states.values


def over_beginnings(stage, restarts=True):
    """Return what a stage comes to over the beginnings of its segments first; None: they are too short.

    The longer a segment, the more minima its error has over the state it begins in; a short beginning
    hardly has any. `restarts`: as for `least_squares.Stage.solve`.
    """
    none, starts = np.zeros(0), None
    for part in SegmentedRecords(tuple(stage.problem.records), tuple(stage.segments)).beginnings():
        found = stage.over(part.segments, starts).solve(none, *EFFORT_BEGUN, False, restarts)
        starts = found.states.values
    if starts is None:
        return None
    return stage.over(stage.segments, starts).solve(none, *EFFORT_ALONE, False, restarts)


def descend(stage, start, iterations: int, tolerance: float):
    """Take steps of every segment by itself, until none gains more than `tolerance` of its cost.

    `start`, and what is returned: `least_squares.Solution`.
    """
    problem = stage.problem
    records = [_Record(stage, start, k) for k in range(len(stage.segments))]
    residual = [r.residual for r in records]
    for i in range(iterations):
        if problem.spent or not any(r.open.any() for r in records):
            break
        before = power(residual)
        for r in records:
            r.step(tolerance)
        pace = power(residual) / max(before, NOTHING)
        if stage.too_far(residual, pace, iterations - i - 1 + problem.settings.steps_left):
            break
    states = start.states.at([r.starts for r in records])
    converged = not any(r.open.any() for r in records)
    return replace(start, states=states, residual=residual, converged=converged)


class _Record:
    """The segments of one record on their way; those that have not come to their end are `open`."""

    def __init__(self, stage, start, k):
        self.stage, self.k = stage, k
        self.simulator, self.segments = stage.simulators[k], stage.segments[k]
        self.starts, self.residual = start.states.values[k].copy(), start.residual[k].copy()
        self.reach, self.means = start.states.reach[k], stage.means()[k]
        self.precision = stage.precision(start.states)[k]
        self.cost = self._cost(self.segments, self.residual, self.starts, slice(None))
        self.damping = np.full(len(self.segments), DAMPING)
        self.finer = np.ones(len(self.segments))
        self.open = np.full(len(self.segments), self.starts.shape[1] > 0)
        every = np.full(len(self.segments), True)
        self.part = every, self.segments, self.segments.spread(every)  # those asked for last

    def _cost(self, segments, residual, starts, rows):
        known = (starts - self.means[rows]) ** 2 * self.precision[rows]
        return segments.sums(residual**2) + known.sum(axis=1)

    def _part(self, rows):
        """Return the segments of these rows, and which samples of a signal are theirs (booleans)."""
        which = np.zeros(len(self.segments), bool)
        which[rows] = True
        if not np.array_equal(which, self.part[0]):
            self.part = which, self.segments.only(which), self.segments.spread(which)
        return self.part[1:]

    def step(self, tolerance):
        """Take a step in every open segment, damped until its cost falls."""
        stage, k = self.stage, self.k
        rows = np.flatnonzero(self.open)
        if not rows.size:
            return
        some, samples = self._part(rows)
        products = stage.state_products(
            k, some, samples, self.starts[rows], self.reach[rows], self.residual[samples], self.finer[rows]
        )
        for _ in range(DAMPED):
            some, starts = self._part(rows)[0], self.starts[rows]
            off = starts - self.means[rows]
            moves = states_for(products, self.precision[rows], self.damping[rows], off)[:, :, 0]
            curvature = np.einsum("wii->wi", products)[:, :-1] + self.precision[rows]
            error = products[:, -1, -1] / (some.outputs * some.counts)
            moves = rounded_moves(moves, self.reach[rows], curvature, error[:, None])
            trial = stage.within_reach(k, starts + moves, self.reach[rows])
            better = np.any(trial != starts, axis=1)
            if better.any():  # what rounds to no move at all would give the same again
                better[better] = self._taken(rows[better], trial[better], tolerance)
            rows, products = rows[~better], products[~better]
            self.damping[rows] *= DAMPED_BY
            if not rows.size:
                return
        self._end(rows)

    def _end(self, rows):
        """Close segments, or go on with finer derivatives in those that err more than others and the noise.

        Close to where a motion comes to rest before a ridge or goes on beyond it, to where it breaks away or
        not, its end changes the faster with its start, and the usual difference reaches across.
        """
        self.open[rows] = False
        problem = self.stage.problem
        if not (rows.size and problem.settings.followed):
            return
        rms = np.sqrt(self.segments.means(self.residual**2))
        usual = max(OUTLYING_SEGMENT * np.quantile(rms, RIGHT_SHARE), OUTLYING_NOISE * problem.noise)
        again = rows[(rms[rows] > usual) & (self.finer[rows] > NUDGE_FINEST)]
        self.open[again] = True
        self.finer[again] *= NUDGE_FINER
        self.damping[again] = DAMPING

    def _taken(self, rows, trial, tolerance):
        """Take the states tried where they lower the cost; return in which of the segments (booleans)."""
        stage, k = self.stage, self.k
        some, samples = self._part(rows)
        residual = stage.measured[k][samples] - self.simulator.run(some, None, trial)
        stage.problem.count(len(rows) / len(self.segments) / len(stage.segments))
        cost = self._cost(some, residual, trial, rows)
        better = cost < self.cost[rows]
        gained = rows[better]
        ended = gained[cost[better] > (1 - tolerance) * self.cost[gained]]
        self.cost[gained], self.starts[gained] = cost[better], trial[better]
        taken = some.spread(better)
        self.residual[np.flatnonzero(samples)[taken]] = residual[taken]
        self.damping[gained] = np.maximum(self.damping[gained] / DAMPED_BY, DAMPING_LEAST)
        self._end(ended)
        return better
