"""Confirmation of the best candidates: refits at the full rate, over the longest segments possible."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...simulate.parallel import side_by_side
from ...thresholds import NOTHING
from ..estimation.fit import FitResult
from ..estimation.from_others import no_worse_than, started_from, with_starts_exchanged
from ..estimation.multistart import (
    all_restarted,
    beyond,
    own,
    restarted,
    thresholds_refined,
)
from ..estimation.segmented import CandidateFit, SegmentedData
from ..estimation.thresholds import RESTARTS_KEPT
from ..fits.rounds import distinct
from ..prediction.initial_states import CONTINUED
from ..prediction.values import with_values
from ..thresholds import GIVE_UP, GROWTH, ONLY_NOISE, SIGNIFICANT, STILL_POSSIBLE
from .equivalence import about_zero, best_of_each, restarted_from_better, validated_from
from .evidence import misses_lines, promising, ranked, rounds
from .reference import Reference
from .thresholds import (
    CONFIRMED_FORCED,
    EFFORT_CONFIRMED,
    EFFORT_ENDED,
    EXPLAINS_LITTLE,
    LITTLE_CHANCE,
    PROMISING,
    STEPS_LONGER,
    STOPPED_EARLY,
    TO_ITS_END,
)

Stages = list[list[FitResult | None]]
"""Fits in segments of every length, short ones first: the baseline's, then of candidates; None: given up."""


def confirmed(
    at: Reference, found: Sequence[CandidateFit], staged: Callable, report: Callable, stage: Callable
) -> tuple[Reference, list[CandidateFit]]:
    """Refit baseline and best candidates at the full rate; return their reference, and these, best first.

    Parameters
    ----------
    at : Reference
    found : sequence of CandidateFit
        From screening, best first.
    staged : callable
        ``staged(at, fits)``, such as `stages`.
    report, stage : callable
        See `Screening.run`.
    """
    while True:
        now, chosen = _confirmed(at, found, staged, report, stage)
        odd = {t.key for t in chosen if not distinct(t, at.stroke)}
        if not odd or chosen[0].key not in odd:
            break
        if chosen[0].evidence <= SIGNIFICANT:
            break  # where it explains no more than the model without it, no other was given up against it
        # the others were given up against one that is not what its name says
        found = [t for t in found if t.key not in odd]
    if odd:
        chosen, noise = ranked(now.base, [t for t in chosen if t.key not in odd])
        now = replace(now, noise=noise)
    return now, chosen


def _confirmed(
    at: Reference, found: Sequence[CandidateFit], staged: Callable, report: Callable, stage: Callable
) -> tuple[Reference, list[CandidateFit]]:
    """Do what `confirmed` does, whether or not effects are still what their names say."""
    stage("the best refitted over segments of every length")
    # under disturbance forces screening distinguishes little
    best = promising(found, CONFIRMED_FORCED, 0.0) if at.data.disturbed else promising(found)
    if at.leaves_only_noise:
        best = [t for t in best if t.evidence > PROMISING * SIGNIFICANT]
    fits, floor = staged(at, [at.base.train, *(t.train for t in best)])
    stage("the best refitted at the full rate, and validated on held-out data")
    data, validated = _at_suitable_length(at, (at.base, *best), fits)
    base, *others = [t for t in validated if t is not None]
    # a model that contains the baseline never errs more, where both fits are equally good
    base = started_from(base, others, data.fine)
    # candidates choose static levels within what fits leave open by validation, and so may the baseline
    base = thresholds_refined(base, data.fine)
    chosen, noise = ranked(base, others)
    least = min((f for f in fits[0] if f is not None), key=lambda f: f.rmse)
    longer = [f[0] for f in fits[1:]]
    at = replace(at, data=data, base=base, noise=noise, floor=floor, least=least, longer=longer)
    if at.grown_over is not None:
        nearer = [_restarted(f, d) for f, d in zip(fits[1:], at.segmentations[1:], strict=False)]
        at = replace(at, longer=nearer)
    if not chosen:
        return at, []
    report(at, chosen)
    stage("near equals restarted from the best fit")
    there = {t.key for t in chosen}
    chosen, noise = ranked(base, _converged(at, chosen, [t for t in found if t.key not in there]))
    return replace(at, noise=noise), chosen


def _restarted(fits: Sequence[FitResult | None], data: SegmentedData) -> FitResult:
    """Return the baseline over some segments, restarted from the models that come nearer there."""
    base, *others = [CandidateFit("", f) for f in fits if f is not None]
    return started_from(base, others, data).train


def _at_suitable_length(
    at: Reference, tried: Sequence[CandidateFit], stages: Stages
) -> tuple[SegmentedData, list[CandidateFit | None]]:
    """Return the data in segments of the most suitable length, and the models validated there.

    `tried`: the baseline and the candidates, best first.
    """
    levels, best = list(at.segmentations), _longest_coherent(stages)
    if best == 0 and not at.data.disturbed:
        levels, stages = _with_states_going_on(levels, stages)
        best = _longest_coherent(stages)
    # An error of whole steps of the sensor is averaged out by long segments, followed by short ones.
    averaged = len(tried) > 1 and rounds(tried[1]) and not at.data.disturbed
    if averaged:
        best = len(stages) - 1
    validated = _validated(levels[best], tried, stages[best])
    best, validated = _longer_if_needed(levels, tried, stages, best, validated)
    # Over long ones parameters fitted to small motions may err by steps in large ones.
    while averaged and best and validated[1] is not None and misses_lines(validated[1]):
        best -= 1
        validated = _validated(levels[best], tried, stages[best])
    while best and not averaged and not _shows_less(*_least(stages), best - 1, best):
        if not _validated_by_chance(validated, levels[best], levels[best - 1], stages[best - 1]):
            break
        best -= 1
        if not best:
            levels, stages = _with_states_going_on(levels, stages)
        validated = _validated(levels[best], tried, stages[best])
    return levels[best], validated


def _longer_if_needed(levels, tried, stages: Stages, best: int, validated):
    """Return the longest length, and the models validated there, where shorter held-out segments show little.

    What acts slowly shows over short segments of the data fitted, by evidence alone, and not over those of a
    smaller motion. `best`, `validated`: the length so far, and the models there.
    """
    last, errors = len(stages) - 1, _least(stages)
    shows_more = _explained(last, *errors) < _explained(best, *errors)
    if not shows_more or _explained_held_out(validated) <= EXPLAINS_LITTLE:
        return best, validated
    longer = _validated(levels[last], tried, stages[last])
    return (last, longer) if _explained_held_out(longer) <= EXPLAINS_LITTLE else (best, validated)


def _with_states_going_on(levels, stages) -> tuple[list[SegmentedData], Stages]:
    """Return the same with hidden states that go on from each of the shortest segments into the next.

    Longer segments show what no candidate explains, or what held-out data alone do not: hidden states,
    re-estimated in many short ones, would pass for it.
    """
    if levels[0].initial == CONTINUED:
        return levels, stages
    short = levels[0].continued
    again = side_by_side(
        lambda f: short.moved(f) if f is not None and short.continues(f.model) else f, stages[0]
    )
    return [short, *levels[1:]], [again, *stages[1:]]


def _validated(data: SegmentedData, tried, fits) -> list[CandidateFit | None]:
    """Return models at the full rate, from their fits in some segments, and validated on held-out data.

    The baseline and the best first: the others need no last step if they err far more. None stands for those
    that have no fit there.
    """
    fine = data.fine

    def at_full_rate(i, fitted=math.inf, held_out=math.inf):
        train = fine.moved(fits[i], *EFFORT_CONFIRMED, fitted)
        there = replace(tried[i], train=train, confirmed=True)
        return fine.validate(about_zero(there, fine) if i else there, held_out)

    there = sorted((i for i, f in enumerate(fits) if f is not None), key=lambda i: fits[i].rmse)
    first = list(dict.fromkeys([0, *(i for i in there if i)][:2]))
    found: list[CandidateFit | None] = [None] * len(fits)
    for i, t in zip(first, side_by_side(at_full_rate, first), strict=True):
        found[i] = t
    known = [t for t in found if t is not None]
    bounds = (
        GIVE_UP * min(t.train.rmse for t in known),
        GIVE_UP * min(t.validation_rmse for t in known),
    )
    rest = [i for i in there if i not in first]
    for i, t in zip(rest, side_by_side(lambda i: at_full_rate(i, *bounds), rest), strict=True):
        found[i] = t
    validations = [t and t.validation for t in found]
    exchanged = with_starts_exchanged(validations, fine, held_out=True)
    return [
        fine.validated_as(t, v) if t is not None and v is not None and v is not t.validation else t
        for t, v in zip(found, exchanged, strict=True)
    ]


def _validated_by_chance(validated, data: SegmentedData, shorter: SegmentedData, fits) -> bool:
    """Whether the validation error of the best models grows with the segments, but not the error fitted.

    Motion that is sensitive to its initial state is predicted where initial state and parameters are fitted
    to it; on held-out data it is then a matter of chance whether a model predicts it. Where one of the best
    fits predicts all held-out data as well, it is not.

    Where that model leaves a small share of the baseline's error, chance decides nothing. Static levels are
    chosen first, within what fits leave open.

    `validated`: models in these segments, `data`, the baseline first; `shorter`, `fits`: the next shorter
    ones, and the fits there.
    """
    pairs = [(t, f) for t, f in zip(validated, fits, strict=True) if t is not None]
    least = min(t.train.rmse for t, _ in pairs)
    near = [(t, f) for t, f in pairs if t.train.rmse <= GROWTH * least]
    refined = side_by_side(lambda pair: thresholds_refined(pair[0], data.fine), near)
    nearest, fit = min(
        zip(refined, (f for _, f in near), strict=True), key=lambda pair: pair[0].validation_rmse
    )
    if nearest.validation_rmse <= LITTLE_CHANCE * validated[0].validation_rmse:
        return False
    fitted = max(nearest.train.rmse / max(fit.rmse, NOTHING), 1.0)
    return nearest.validation_rmse > GROWTH * fitted * shorter.fine.validate(nearest).validation_rmse


# --- segments of every length -------------------------------------------------------------------------


def stages(at: Reference, fits: Sequence[FitResult]) -> tuple[Stages, float]:
    """Return the fits in segments of every length that serve for validation, and their floor.

    The floor is the least error that a fit can reach: over short segments nearly every model
    fits. Effects that are not what their names say there are given up. Where disturbance forces prevail only
    the shortest segments serve.
    """
    shortest, middle, longest = at.segmentations
    base, *others = side_by_side(shortest.reached, fits)
    others = no_worse_than(base, others, shortest)
    short = [base, *(f if distinct(CandidateFit("", f), at.stroke) else None for f in others)]
    short = with_starts_exchanged(short, shortest)
    floor = ONLY_NOISE * min(f.rmse for f in short if f is not None)
    if at.data.disturbed:
        return [short], floor
    # a model that leaves only noise is in its right minimum, and so are those that contain it
    enough = math.inf if at.leaves_only_noise else floor
    near = _from_better(over(middle, fits, short, enough), middle, at.base.block)
    near = with_starts_exchanged(near, middle)
    far = _from_better(over(longest, near, near, enough), longest, at.base.block)
    far = with_starts_exchanged(far, longest)
    likely = 0.0 if at.leaves_only_noise else STILL_POSSIBLE * min(f.rmse for f in far if f is not None)
    both = side_by_side(
        lambda pair: _reconciled(middle, longest, pair[0], pair[1], likely), zip(near, far, strict=True)
    )
    return [short, [n for n, _ in both], [f for _, f in both]], floor


def _from_better(fits: list[FitResult | None], data: SegmentedData, block) -> list[FitResult | None]:
    """Start candidates that fall behind over longer segments from the best one, if their laws can act as its.

    Short segments leave a static level open by what single samples pass; over long ones a level that is off
    by so little errs far more.
    """
    there = [CandidateFit(str(i), f) for i, f in enumerate(fits) if i and f is not None]
    if not there:
        return fits
    best = min(there, key=lambda t: t.train.rmse)
    behind = [t for t in there if t.train.rmse > GROWTH * best.train.rmse]
    again = {t.key: t.train for t in restarted_from_better([best, *behind], data, block, 1)}
    return [again.get(str(i), f) for i, f in enumerate(fits)]


def _reconciled(
    shorter: SegmentedData,
    longer: SegmentedData,
    near: FitResult | None,
    far: FitResult | None,
    likely: float,
):
    """Return the fits of a model in shorter and longer segments, restarted from each other if they differ.

    The cost of laws with events has many minima over long segments, the right one within the uncertainty of
    the fit over shorter ones; if it is not there that fit is in a wrong minimum, and the one over long
    segments may be nearer. Where long segments show no more error than short ones both are right, and where
    they show far less the fit over short ones has missed the minimum. What errs far beyond the noise over
    short ones lacks something else.

    `likely`: the error over long ones beyond which a model is worse for other reasons.
    """
    if near is None or far is None:
        return near, far
    if near.rmse > GROWTH * far.rmse:
        near = min(near, shorter.moved(far), key=lambda f: f.rmse)
    if not far.model.many_minima or shorter.lacks_more(near.rmse):
        return near, far
    if ONLY_NOISE * near.rmse < far.rmse <= likely:
        far = _best_started_about(near.sigma_points, near, longer, far)
    if ONLY_NOISE * near.rmse < far.rmse <= likely:
        back = shorter.fit(far.model, far.names, followed=RESTARTS_KEPT)
        points = [back.parameters, *back.sigma_points]
        near, far = min(near, back, key=lambda f: f.rmse), _best_started_about(points, back, longer, far)
    return near, far


def _best_started_about(points, near: FitResult, longer: SegmentedData, far: FitResult) -> FitResult:
    """Return the best of a fit in longer segments and of those started about one in shorter segments."""
    models = [with_values(near.model, values) for values in points]
    started = side_by_side(
        lambda model: longer.moved(replace(near, model=model), iterations=2, give_up=GIVE_UP * far.rmse),
        models,
    )
    started = sorted(started, key=lambda f: f.rmse)[:RESTARTS_KEPT]
    ended = side_by_side(
        lambda f: longer.fit(f.model, f.names, starts=f.starts, iterations=STEPS_LONGER, give_up=far.rmse),
        started,
    )
    return min([far, *ended], key=lambda f: f.rmse)


def over(data: SegmentedData, fits, before, floor: float) -> list[FitResult | None]:
    """Refit the baseline and the best candidate over other segments, then those not far behind.

    `before`: the fits in segments that these are made of: no fit over longer ones can err less than that
    over the parts of them.
    """
    errors = [math.inf if f is None else f.rmse for f in before]
    ahead = [0, *([1 + int(np.argmin(errors[1:]))] if len(errors) > 1 else [])]
    found: list[Any] = [None] * len(fits)
    for i, f in zip(ahead, side_by_side(data.reached, [fits[i] for i in ahead]), strict=True):
        found[i] = f
    give_up = GIVE_UP * min(found[i].rmse for i in ahead)
    others = [i for i, e in enumerate(errors) if i not in ahead and e < give_up]
    moved = side_by_side(lambda i: data.moved(fits[i], give_up=give_up), others)
    for i, f in zip(others, moved, strict=True):
        found[i] = f
    there = [i for i, f in enumerate(found) if f is not None]
    for i, f in zip(there, all_restarted([found[i] for i in there], data, floor), strict=True):
        found[i] = f
    return [found[0], *no_worse_than(found[0], found[1:], data)]


def _longest_coherent(stages: Stages) -> int:
    """Return the level to validate at: the longest segments over which the best model's error does not grow.

    Where the best grows with the length (motion that is sensitive to its start, force noise in a real
    machine, an effect outside the library) short segments are clearer, provided that they show what is
    missing as well as long ones do.
    """
    base, best = _least(stages)
    at = 0
    while at + 1 < len(stages) and best[at + 1] <= GROWTH * best[at]:
        at += 1
    last = len(stages) - 1
    return last if at < last and _shows_less(base, best, at, last) else at


def _least(stages: Stages) -> tuple[list[float], list[float]]:
    """Return the errors of the baseline and of the best model in segments of every length."""
    errors = [[math.inf if f is None else f.rmse for f in stage] for stage in stages]
    return [e[0] for e in errors], [min(e) for e in errors]


def _shows_less(base, best, at, than) -> bool:
    """Whether segments of one length show little of what is missing, and less than those of another."""
    return _explained(at, base, best) > max(EXPLAINS_LITTLE, _explained(than, base, best))


def _explained(at: int, base, best) -> float:
    """Return the error of the best model over the baseline's, in segments of one length."""
    return best[at] / max(base[at], NOTHING)


def _explained_held_out(validated) -> float:
    """Return the same for held-out data."""
    errors = [math.inf if t is None else t.validation_rmse for t in validated]
    return _explained(0, errors[:1], [min(errors[1:], default=math.inf)])


# --- convergence --------------------------------------------------------------------------------------


def _converged(at: Reference, chosen: list[CandidateFit], left: Sequence[CandidateFit]) -> list[CandidateFit]:
    """Iterate near equals until they have converged, in the right minimum.

    `left`: candidates given up on the way, which may have been in a wrong one: those whose laws can act as
    the best one's are started from it as well.
    """
    if at.leaves_only_noise and chosen[0].evidence <= 0:
        return chosen
    beside = [replace(t, confirmed=True) for t in left]
    chosen = _cross_started(at, chosen, chosen[:1], beside)
    near = [t for t in chosen if chosen[0].evidence - t.evidence < STOPPED_EARLY]
    least = min(t.train.rmse for t in chosen)
    close = [t for t in chosen if t in near or t.evidence > TO_ITS_END * chosen[0].evidence]
    close = [t for t in close if t.train.rmse < GIVE_UP * least]
    ended = side_by_side(lambda t: _in_best_minimum(at, t, t in near and len(near) > 1, least), close)
    if any(a is not b for a, b in zip(ended, close, strict=True)):
        chosen = _cross_started(at, [*ended, *(t for t in chosen if t not in close)], ended)
    return chosen


def _in_best_minimum(at: Reference, tried: CandidateFit, exactly: bool, least: float) -> CandidateFit:
    """Return a candidate in its best minimum, unless nothing better is possible.

    `exactly`: iterated to the end first. `least`: error of the best of all.
    """
    fine, fit = at.data.fine, tried.train
    if exactly:
        fit = fine.moved(fit, *EFFORT_ENDED)
    restarts = own(fit) and min(fit.rmse, least) > at.floor and not (fine.disturbed or at.leaves_only_noise)
    if restarts and not fine.lacks_more(fit.rmse):
        fit = restarted(fit, fine.fit, own(fit), beyond(fit, least))
    return thresholds_refined(tried if fit is tried.train else fine.validate(replace(tried, train=fit)), fine)


def _cross_started(at: Reference, chosen, those, beside=()) -> list[CandidateFit]:
    """Restart candidates from the fit of each of `those`; keep the best of every effect, best first.

    `beside`: further ones to restart.
    """
    pairs = [(t, best) for best in those for t in [*chosen, *beside] if t is not best]
    started = validated_from(pairs, at.data.fine, at.base.block)
    return best_of_each(ranked(at.base, [*chosen, *started])[0])
