"""Where segments begin: tries of initial states that a descent from the estimate does not reach.

`stage` is a `least_squares.Stage`, `found` the `Solution` that it has come to.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...thresholds import NOTHING
from ..prediction.sensed import sensed
from .outputs import States
from .states import over_beginnings
from .thresholds import (
    BETTER_MINIMUM,
    CLEARLY,
    EFFORT_BEGUN,
    GAP_PLACES,
    GAP_RATES,
    OUTLYING_NOISE,
    OUTLYING_SEGMENT,
    RESTART_SPEEDS,
    RIGHT_SHARE,
    UNFOLLOWED,
)


def restarted_segments(stage, found):
    """Try other starts where single segments err far more than the rest; whether any was better.

    Stick and slip make the error of a segment a nonsmooth function of the speed it begins with, and so does a
    gap of where in it and how fast the other body is: a start that is estimated badly may lie in another
    minimum. What the segment before ends with is tried first.

    Returns
    -------
    States, bool
        These may be farther off in the segments tried.
    """
    problem, better_found = stage.problem, False
    all_starts = [a.copy() for a in found.states.values]
    all_reach = [p.copy() for p in found.states.reach]
    for k, simulator in enumerate(stage.simulators):
        if "v" not in simulator.free_states or simulator.continued:
            continue
        column, segments, starts = simulator.free_states.index("v"), stage.segments[k], all_starts[k]
        values = problem.values(found.theta, k)
        rms = np.sqrt(segments.means(found.residual[k] ** 2))
        usual, noise = 0.0, problem.noise
        if _comparable(problem, segments):
            # what most of them err by holds the noise: jumps of the output may pass for it
            usual, noise = OUTLYING_SEGMENT * np.quantile(rms, RIGHT_SHARE), min(noise, np.median(rms))
        bad = rms > max(usual, OUTLYING_NOISE * noise)
        if not bad.any():
            continue
        some = segments.only(bad)
        least = (BETTER_MINIMUM**2 if problem.settings.followed else UNFOLLOWED) * rms[bad] ** 2
        all_reach[k][bad, column] = stage.widest[k][bad, column]
        reach, chosen = all_reach[k][bad, column], starts[bad].copy()
        before = simulator.continued_from(segments, values, starts)[bad]
        before = np.where(np.isfinite(before), before, starts[bad])
        tries: list[tuple[Any, Any]] = [
            (slice(None), before),
            (slice(None), simulator.beginnings.at_rest(some, values)),
        ]
        tries += [(column, f * reach) for f in RESTART_SPEEDS]
        tries += _across_gap(simulator, some, values, all_reach[k][bad])
        trials = np.stack([starts[bad]] * len(tries))
        for trial, (which, value) in zip(trials, tries, strict=True):
            trial[:, which] = value
        powers, shifts = _tried(stage, k, some, values, trials)
        trials[:, :, 0] += shifts
        for start, ended in _ends(stage, found.theta, k, some, trials, powers):
            better = ended < least
            chosen[better], least = start[better], np.where(better, CLEARLY * ended, least)
            better_found = better_found or bool(better.any())
        starts[bad] = chosen
        problem.count_beside(len(tries) * len(some) / len(segments))
    return States(all_starts, all_reach), better_found


def _comparable(problem, segments) -> bool:
    """Return whether segments tell which of them err: a free run alone, of a wrong model, says nothing."""
    return bool(problem.names) or not problem.settings.followed or RIGHT_SHARE * len(segments) >= 1


def _ends(stage, theta, k, some, trials, powers):
    """Yield where segments `some` of a record may begin, the best tries first, and their mean squared errors.

    `powers`: (tries, nw), those of the tries as they are. Followed to their end where the problem says so.
    """
    problem = stage.problem
    # in whole steps of what counts as less, so that rounding puts none before its equals
    steps = np.round(np.log(np.maximum(powers, NOTHING)) / -np.log(CLEARLY))
    order = np.argsort(steps, axis=0, kind="stable")
    best = np.take_along_axis(trials, order[: max(problem.settings.followed, 1), :, None], axis=0)
    if not problem.settings.followed:
        yield best[0], powers.min(axis=0)
        return
    # segments share nothing: those of all tries go their ways in the same simulations
    alone, every = stage.alone(theta, None, slice(k, k + 1)), some.repeated(len(best))
    begun = alone.over([every], [np.concatenate(best)])
    found = begun.solve(np.zeros(0), *EFFORT_BEGUN, robust=False, restarts=False)
    problem.count_beside(len(best) * alone.problem.nfev)
    powers = every.means(found.residual[0] ** 2).reshape(len(best), -1)
    yield from zip(found.states.values[0].reshape(best.shape), powers, strict=True)
    grown = _grown(stage, theta, k, alone, some)
    if grown is not None:
        yield grown.states.values[0], some.means(grown.residual[0] ** 2)


def _grown(stage, theta, k, alone, some):
    """Return what `over_beginnings` gives of segments of a record; every round of restarts asks the same."""
    key = k, theta.tobytes(), some.first.tobytes()
    if key not in stage.grown:
        alone.problem.nfev = 0.0  # counted
        stage.grown[key] = over_beginnings(alone.over([some], None), restarts=False)
        stage.problem.count_beside(alone.problem.nfev)
    return stage.grown[key]


def scanned_gap_states(stage, theta, states):
    """Find where in its gap each segment begins, and how fast it crosses it (the cost has several minima)."""
    found, problem = list(states.values), stage.problem
    for k, simulator in enumerate(stage.simulators):
        segments, values = stage.segments[k], problem.values(theta, k)
        tries = _across_gap(simulator, segments, values, states.reach[k])
        if not tries:
            continue
        least, chosen = np.full(len(segments), np.inf), found[k].copy()
        trials = np.stack([chosen] * (1 + len(tries)))
        for trial, (which, value) in zip(trials[1:], tries, strict=True):
            trial[:, which] = value
        for trial, errors in zip(trials, _tried(stage, k, segments, values, trials)[0], strict=True):
            better = errors < CLEARLY * least
            chosen[better], least = trial[better], np.minimum(least, errors)
        found[k] = chosen
        problem.count_beside(len(trials) / len(stage.simulators))
    return states.at(found)


def _tried(stage, k, segments, values, trials) -> tuple[np.ndarray, np.ndarray]:
    """Return what segments leave that begin with each of the trials (tries, nw, ns), at a place of their own.

    Mean squares, and how far that place is off, both (tries, nw).
    """
    every, signals = segments.repeated(len(trials)), sensed(stage.problem.records[k])
    simulator = stage.simulators[k]
    e = signals.within(every.samples) - simulator.run(every, values, np.concatenate(trials))
    shift, gain = _shift(signals, every, e, simulator.position_dependent)
    powers = every.means(e**2) - gain
    return powers.reshape(len(trials), -1), shift.reshape(len(trials), -1)


def _shift(signals, segments, e, placed=False) -> tuple[np.ndarray, np.ndarray]:
    """Return the place (nw,) that explains most of a residual, and what its mean square loses by it.

    None where the place is `placed`: known to a law.
    """
    by_place = signals.of_place(len(segments.samples))
    if placed or not np.any(by_place):
        return np.zeros(len(segments)), np.zeros(len(segments))
    count = segments.sums(by_place)
    shift = segments.sums(e * by_place) / count
    return shift, shift**2 * (count / (segments.outputs * segments.counts))


def _across_gap(simulator, segments, values, reach) -> list[tuple[slice, np.ndarray]]:
    """Return places in a gap, and rates of crossing it, to begin segments with: columns, (nw, 2)."""
    known = simulator.beginnings.in_gap(segments, values, GAP_PLACES)
    if known is None:
        return []
    (at, places), one = known, np.ones(len(segments))
    return [
        (slice(at, at + 2), np.column_stack((place * one, rate * reach[:, at + 1])))
        for place in places
        for rate in GAP_RATES
    ]
