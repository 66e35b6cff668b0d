"""Laws with events make the cost nonsmooth: a fit is started again from either side of where it ended.

An impact more or less, a mass that sticks or breaks away: each changes the output by a jump, so that the
cost over a gap, a restitution or a static level has many minima side by side. The next ones are a step
away.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...simulate.parallel import side_by_side
from ..prediction.values import block_of, with_values
from ..shooting.thresholds import BETTER_MINIMUM, EFFORT_ALONE
from ..thresholds import GIVE_UP, ONLY_NOISE, STILL_POSSIBLE
from .common_friction import dry_level
from .fit import FitResult
from .segmented import CandidateFit, SegmentedData
from .starts import matching_initial_states
from .static_levels import common_levels
from .thresholds import (
    BREAKAWAY_ROUNDS,
    BREAKAWAYS_BETWEEN,
    GLANCE,
    GLANCED_ON,
    KEPT_IN_VAIN,
    MOTOR_LEAST,
    OPEN_HALVED,
    OPEN_RANGE,
    RESTART_FACTORS,
    RESTARTED_AGAIN,
    RESTARTS_KEPT,
    SAME_ERROR,
    SEGMENTS_KEPT,
    STATIC_FACTORS,
    STEPS_NEAR,
    STEPS_NEAR_STATES,
)


def nonsmooth_names(found: FitResult) -> list[str]:
    """Return the free parameters over which the cost has many minima; of a loop none."""
    effects = getattr(found.model, "named_effects", {})
    nonsmooth = {key for key, effect in effects.items() if effect.nonsmooth}
    return [n for n in found.names if n.partition(".")[0] in nonsmooth]


def own(found: FitResult) -> list[str]:
    """Return those parameters of the last effect of a model."""
    last = found.model.newest + "."
    return [name for name in nonsmooth_names(found) if name.startswith(last)]


def restarted(
    found: FitResult, fit: Callable[..., FitResult], names: list[str], give_up: float = math.inf
) -> FitResult:
    """Return the best of the fits that begin beside `found`, one such parameter moved at a time; or itself.

    Parameters
    ----------
    found : FitResult
    fit : callable
        ``fit(model, names, starts=, iterations=, give_up=)`` over the segments of `found`.
    names : list of str
        Parameters to move.
    give_up : float
        Error above which a minimum is of no use.
    """
    queue = [(name, 0) for name in names]
    for name, times in queue:
        at, best = found.parameters[name], found
        moved = [
            _moved(found.model, name, _within(found, name, factor * at))
            for factor in (STATIC_FACTORS if found.model.parameters[name].threshold else RESTART_FACTORS)
        ]
        starts_only = functools.partial(
            fit, names=(), starts=found.starts, iterations=GLANCE, give_up=give_up
        )
        started = sorted(side_by_side(starts_only, moved), key=lambda f: f.rmse)[:RESTARTS_KEPT]
        on = functools.partial(_on, fit=fit, give_up=give_up, names=found.names)
        for tried in side_by_side(on, started):
            if tried.rmse < BETTER_MINIMUM * best.rmse:
                best = tried
        if best is not found and times < RESTARTED_AGAIN:
            queue.append((name, times + 1))
        found = best
    return found


def trimmed(found: FitResult, data: SegmentedData) -> FitResult:
    """Return the best fit on a path on which the segments that err most are left out, or itself.

    An impact more or less in a few segments bends the parameters. Those that follow the record without it
    lead on, and from there others err most: least trimmed squares (Rousseeuw & Van Driessen 1999). The path
    ends where several steps in turn have come to no better minimum, or where the model lacks more than that.
    """
    fit = functools.partial(data.fit, names=found.names, followed=RESTARTS_KEPT)
    at, best, least, vain = found, found, found.rmse, 0
    while vain < KEPT_IN_VAIN and best.rmse > ONLY_NOISE * data.noise and not data.lacks_more(best.rmse):
        kept = fit(at.model, view=replace(data.train, segments=_least(at)))
        at = fit(kept.model)
        vain, least = (0, at.rmse) if at.rmse < BETTER_MINIMUM * least else (vain + 1, least)
        best = min(best, at, key=lambda f: f.rmse)
    return best


def _least(found: FitResult) -> list:
    """Return the segments of each record that err least."""
    parts = zip(found.segments, found.segment_powers, strict=True)
    return [w.only(p <= np.quantile(p, SEGMENTS_KEPT)) for w, p in parts]


def beyond(found: FitResult, least: float) -> float:
    """Return the error above which other minima of a fit are of no use; `least`: that of the best fit.

    The best one itself tries all of them to their end.
    """
    return STILL_POSSIBLE * least if found.rmse > least else math.inf


def _on(start: FitResult, fit, names, give_up) -> FitResult:
    return fit(start.model, names, starts=start.starts, iterations=GLANCED_ON, give_up=give_up)


def all_restarted(fits, data: SegmentedData, floor: float) -> list:
    """Return fits in their best minima: those neither at the floor nor far from the noise or the best.

    The first is the baseline. If it was in its best minimum, so are the others in what they share with it.
    """
    least = min(f.rmse for f in fits)
    if least <= floor:
        return list(fits)
    restart = [floor < f.rmse < GIVE_UP * least and not data.lacks_more(f.rmse) for f in fits]
    base = (
        restarted(fits[0], data.fit, nonsmooth_names(fits[0]), beyond(fits[0], least))
        if restart[0]
        else fits[0]
    )
    values = {k: base.parameters[k] for k in nonsmooth_names(base)} if base is not fits[0] else {}
    others = side_by_side(
        lambda pair: _other(pair[0], data, values, beyond(pair[0], least)) if pair[1] else pair[0],
        zip(fits[1:], restart[1:], strict=True),
    )
    return [base, *others]


def _other(found: FitResult, data: SegmentedData, values, give_up: float) -> FitResult:
    """Return a fit in its best minimum; `values`: of what it shares with a baseline that was restarted."""
    table = found.model.parameters
    shared = {k: v for k, v in values.items() if k in table}
    if shared:
        model = with_values(found.model, shared)
        again = started(model, found.names, found.starts, data, give_up)
        found = min(found, again, key=lambda f: f.rmse)
    return restarted(found, data.fit, own(found), give_up)


def started(model, names, starts, data: SegmentedData, give_up: float) -> FitResult:
    """Fit a model with values of another, its initial states first."""
    near = data.fit(model, (), starts=starts, iterations=STEPS_NEAR_STATES, give_up=give_up)
    return data.fit(model, names, starts=near.starts, iterations=STEPS_NEAR, give_up=give_up)


def thresholds_refined(tried: CandidateFit, data: SegmentedData) -> CandidateFit:
    """Choose thresholds by the segments to validate on, within what the segments fitted leave open."""
    table = tried.block.parameters
    for name in [n for n in tried.train.names if table[n].threshold]:
        low, high = left_open = _open_range(tried.train, data.fit, name)
        best = tried
        for _ in range(BREAKAWAY_ROUNDS if high > low else 0):
            values = np.geomspace(low, high, BREAKAWAYS_BETWEEN)
            runs = side_by_side(functools.partial(_with_level, tried, name, data=data), values)
            i = min(range(len(runs)), key=lambda k: runs[k].validation_rmse)
            best = min(best, runs[i], key=lambda t: t.validation_rmse)
            low, high = values[max(i - 1, 0)], values[min(i + 1, len(values) - 1)]
        if best is not tried:
            tried = min(tried, data.validate(best), key=lambda t: t.validation_rmse)
        train = data.fit(tried.block, tried.train.names, starts=tried.train.starts, iterations=1)
        error = _uniform(tried.block.parameters[name].value, *left_open)
        tried = replace(tried, train=train.with_errors({name: error}))
    return tried


def thresholds_known(found: FitResult, fit: Callable[..., FitResult]) -> FitResult:
    """Return a fit with the standard errors of its thresholds: single samples pass them, slopes know nothing.

    `fit`: as for `restarted`, over the segments of `found`.
    """
    table = block_of(found.model).parameters
    ranges = {name: _open_range(found, fit, name) for name in common_levels(found)}
    known = found.with_errors({k: _uniform(table[k].value, *ends) for k, ends in ranges.items()})
    if not known.null:
        return known
    null = [(size, _with_thresholds(parts, known, ranges, fit)) for size, parts in known.null]
    return replace(known, null=null)


def _with_thresholds(parts, found: FitResult, ranges, fit: Callable[..., FitResult]):
    """Return a null direction with the thresholds that move with it, of which slopes do not tell.

    Static levels, for one, where the gain of the drive is free. `ranges`: in which they leave all as it is;
    steps go beyond.
    """
    if len(found.slopes) != len(found.names):
        return parts  # records have some for themselves
    slopes, added = dict(zip(found.names, found.slopes, strict=True)), []
    for name in sorted(set(ranges) - {k for k, *_ in parts}):
        at, (low, high) = found.parameters[name], ranges[name]
        step = OPEN_RANGE[0] + 2 * max(high - at, at - low) / at
        moved = {k: _within(found, k, found.parameters[k] + step * d * slopes[k]) for k, _, d in parts}
        errors = {}
        for sign in (0, 1, -1):
            model = with_values(found.model, moved | {name: (1 + sign * step) * at})
            errors[sign] = fit(model, (), starts=found.starts, iterations=GLANCE).rmse
        sign = min(errors, key=lambda s: errors[s])
        if errors[sign] <= SAME_ERROR * found.rmse < errors[0]:
            added.append((name, None, float(sign)))
    return [*parts, *added]


def _uniform(value: float, low: float, high: float) -> float:
    """Return the rms distance of a value from one anywhere between two, or as near as any other was tried."""
    tried = OPEN_RANGE[0] * value
    low, high = min(low, value - tried), max(high, value + tried)
    return math.hypot((high - low) / math.sqrt(12), 0.5 * (low + high) - value)


def _with_level(tried: CandidateFit, name, value, data: SegmentedData) -> CandidateFit:
    """Return a validated model with another level, run over the same segments from where that one begins."""
    validation = tried.validation
    assert validation is not None
    near = data.states_of(
        _moved(validation.model, name, value), view=data.validation,
        starts=matching_initial_states(validation, data.validation.segments), effort=EFFORT_ALONE,
    )  # fmt: skip
    train = replace(tried.train, model=_moved(tried.block, name, value))
    return replace(tried, train=train, validation=near, unseen=None)


def _open_range(found: FitResult, fit: Callable[..., FitResult], name: str) -> tuple[float, float]:
    """Return the least and the largest value of a threshold for which the segments fitted are the same."""
    at = found.parameters[name]

    def moved(share):
        return _moved(found.model, name, (1 + share) * at)

    def same(share):
        return fit(moved(share), (), starts=found.starts, iterations=GLANCE).rmse <= SAME_ERROR * found.rmse

    edges = []
    for sign in (-1, 1):
        last = first = 0.0  # reach of the same, and of others
        for reach in OPEN_RANGE:
            if not same(sign * reach):
                first = reach
                break
            last = reach
        for _ in range(OPEN_HALVED if first else 0):
            middle = 0.5 * (last + first)
            last, first = (middle, first) if same(sign * middle) else (last, middle)
        edges.append(block_of(moved(sign * last)).parameters[name].value if last else at)
    return edges[0], edges[1]


def _moved(model, name, value):
    block = block_of(model)
    values, table, shared = {name: value}, block.parameters, dry_level(block)
    effect = block.named_effects.get(name.partition(".")[0])
    if shared is not None and effect is not None and effect.role == "friction" and effect.side == "load":
        # the sum of both shows best: what the load gains the motor loses
        motor, more = table[shared].value, value - table[name].value
        values[shared] = max(motor - more, MOTOR_LEAST * motor)
    return with_values(model, values)


def _within(found, name, value):
    p = block_of(found.model).parameters[name]
    return min(max(value, p.lower), p.upper)
