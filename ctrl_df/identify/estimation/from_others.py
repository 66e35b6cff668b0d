"""Fits started from those of other models, which differ from them by one effect.

Where a body begins in a gap, or whether it sticks, makes the error of a segment jump, and an impact more or
less that of all: minima are many, and one descent finds what another does not reach. Models that differ by
one effect share parameters of the machine, and where segments begin.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...simulate.parallel import side_by_side
from ..prediction.values import with_values
from ..thresholds import GIVE_UP, GROWTH
from .fit import FitResult
from .multistart import started
from .segmented import CandidateFit, SegmentedData
from .starts import better_initial_states
from .thresholds import NEXT_TO_NOTHING, STEPS_NEAR, STEPS_NEAR_STATES


def with_values_of(block, other, like: Any = None):
    """Return a model with what it has in common with another one, or None: their effects have nothing.

    Both end with the effect that was added. `like`: that of the model such that it acts like the other one's
    (see `like_another`); None: it cannot.
    """
    table, mine, its = block.parameters, block.newest, other.newest
    values = {}
    for name, p in other.parameters.items():
        name = f"{mine}.{name.partition('.')[2]}" if name.partition(".")[0] == its else name
        if name in table and table[name].unit == p.unit:
            values[name] = p.value
    frictions = {m.effects[-1].role for m in (block, other)} == {"friction"}
    if like is not None:
        values |= {f"{mine}.{k}": p.value for k, p in like.parameters.items()}
    elif not frictions or not any(name.startswith(f"{mine}.") for name in values):
        return None
    return with_values(block, values)


def cross_started(
    tried: CandidateFit, best: CandidateFit, data: SegmentedData, like: Any = None
) -> FitResult | None:
    """Fit a candidate again from where the best one ended, of which it may be a limit.

    Stiction is that of a narrow Stribeck bump. The cost of stick and slip is nonsmooth: of two fits of one
    law each may end in its own minimum. `like`: the effect of the candidate such that it acts like the best
    one's (see `like_another`); None: it cannot.
    """
    block = with_values_of(tried.block, best.block, like)
    if block is None:
        return None
    near = data.fit(block, (), starts=best.train.starts, iterations=STEPS_NEAR_STATES)
    if near.rmse > GIVE_UP * best.train.rmse:
        return None
    return data.fit(block, tried.train.names, starts=near.starts, iterations=STEPS_NEAR)


def started_from(tried: CandidateFit, others: Sequence[CandidateFit], data: SegmentedData) -> CandidateFit:
    """Fit a model again with what it has in common with those that come nearer; return the best fit.

    Parameters of the machine and where segments begin hardly hang on the effect that is added to a model: it
    may not fall behind for having started elsewhere. Where events make the minima many each of several models
    ends in one of its own, and the best of them comes nearer than one fit alone by chance.
    """
    nearer = [t for t in others if t.train.rmse < tried.train.rmse]
    found = min(
        [tried.train, *side_by_side(lambda t: _started_from(tried.train, t.train, data), nearer)],
        key=lambda f: f.rmse,
    )
    return tried if found is tried.train else data.validate(replace(tried, train=found))


def _started_from(found: FitResult, nearer: FitResult, data: SegmentedData) -> FitResult:
    known = nearer.parameters
    model = with_values(found.model, {name: known[name] for name in found.names if name in known})
    starts = data.starts_as(model, data.train.records, nearer)
    return data.fit(model, found.names, starts=starts, iterations=STEPS_NEAR, give_up=found.rmse)


def no_worse_than(base: FitResult, fits: Sequence[FitResult | None], data: SegmentedData) -> list:
    """Return models that have an effect more than another, none of them left in a minimum that errs more.

    With the effect next to nothing a model is the one without it: what errs clearly more has lost its minimum
    (a fit that has not come to its end may err a little more). It is restarted from the other one, where it
    can be with so little of the effect, and else with as much of it as was found; not where the other one is
    so far behind the best that nothing started there catches up.
    """
    least = min((f.rmse for f in fits if f), default=math.inf)
    return side_by_side(lambda f: f and _from_base(f, base, data, GIVE_UP * least), fits)


def _from_base(found: FitResult, base: FitResult, data: SegmentedData, give_up: float) -> FitResult:
    if found.rmse <= GROWTH * base.rmse or base.rmse > give_up:
        return found
    model, key = found.model, found.model.newest
    values = {k: v for k, v in base.parameters.items() if k in found.names}
    effect = model.effects[-1]
    if effect.proportional:
        size = next(iter(effect.parameters))
        values[f"{key}.{size}"] = NEXT_TO_NOTHING * effect.values[0]
    model = with_values(model, values)
    starts = data.starts_as(model, data.train.records, base)
    again = started(model, found.names, starts, data, found.rmse)
    return min(found, again, key=lambda f: f.rmse)


def with_starts_exchanged(
    fits: Sequence[FitResult | None], data: SegmentedData, held_out: bool = False
) -> list[FitResult | None]:
    """Return fits over the same segments, those started again of which segments err less as others begin.

    Where a model errs by more than chance beside the one that errs least there. Of models without events
    initial states have one minimum, and accelerations have no segments.

    Parameters
    ----------
    fits : sequence of FitResult or None
        Of several models, over the segments fitted or those held out.
    data : SegmentedData
    held_out : bool
        Over which of the two.
    """
    view = data.validation if held_out else data.train
    there = [f for f in fits if f is not None]
    powers = np.array([_powers(f) for f in there])
    first, least = powers.argmin(axis=0), np.maximum(powers.min(axis=0), data.noise**2)

    def exchanged(k: int) -> FitResult:
        found, behind = there[k], powers[k] > GROWTH**2 * least
        if not (found.model.nonsmooth and data.error_filter is None and np.any(behind)):
            return found
        nearest = np.where(behind, first, k)
        starts = _mixed(found, there, nearest, data, view.records)
        tried = data.fit(found.model, (), view=view, starts=starts, iterations=STEPS_NEAR_STATES)
        if not np.any(_powers(tried)[behind] * GROWTH**2 < powers[k][behind]):
            return found
        starts = better_initial_states(found, tried)
        again = data.fit(found.model, found.names, view=view, starts=starts, iterations=STEPS_NEAR)
        return min(found, again, key=lambda f: f.rmse)

    ended = iter(side_by_side(exchanged, range(len(there))))
    return [f if f is None else next(ended) for f in fits]


def _powers(found: FitResult) -> np.ndarray:
    return np.concatenate(found.segment_powers)


def _mixed(found: FitResult, fits, nearest, data: SegmentedData, records) -> list[np.ndarray]:
    """Return initial states of a model, in each segment those of the fit of that number."""
    starts = [np.array(rows) for rows in found.starts]
    bounds = np.cumsum([len(rows) for rows in starts])[:-1]
    for k in set(nearest.tolist()):
        if fits[k] is found:
            continue
        for rows, other, which in zip(
            starts, data.starts_as(found.model, records, fits[k]), np.split(nearest == k, bounds), strict=True
        ):
            rows[which] = other[which]
    return starts
