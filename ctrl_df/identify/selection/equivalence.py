"""Candidates that are equivalent.

On these data: their outputs agree within noise. By their laws: where one can represent the other, a fit of
one may have missed the minimum that the other has found.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from ...blocks.core import level
from ...blocks.stated import static_levels
from ...simulate.parallel import side_by_side
from ..estimation.from_others import cross_started, with_values_of
from ..estimation.multistart import thresholds_refined
from ..estimation.segmented import CandidateFit, SegmentedData
from ..fits.compared import indistinguishable, penalized
from ..shooting.noise_model import NoiseModel
from ..shooting.thresholds import BETTER_MINIMUM
from ..starting.like_another import like_another
from ..starting.regression import motion_of
from ..thresholds import ONLY_NOISE
from .thresholds import BUMP_LEFT, CONFIRMED, EFFORT_CONFIRMED, PASSED


def matching_along(data: SegmentedData, block) -> Callable:
    """Return ``matching(effect, other)``: an effect with values that make it act as another; or None.

    `data`, `block`: the motion, and the model that is driven along it.
    """
    motion = motion_of(data.train, data.decimation, block)
    return lambda effect, other: like_another(effect, other, motion.x, motion.v)


def restarted_from_better(
    found: Sequence[CandidateFit], data: SegmentedData, block, best_ones: int = CONFIRMED
) -> list[CandidateFit]:
    """Start candidates from the fit of a better one whose law theirs can represent.

    A spring is a pendulum over a small angle; what breaks away is the limit of a narrow bump over speed: no
    force along the motion tells that.

    Parameters
    ----------
    found : sequence of CandidateFit
        Best first.
    data : SegmentedData
        The data that they are fitted to.
    block : Mechanism
        The model without them.
    best_ones : int
        How many of the first others may start from.

    Returns
    -------
    list of CandidateFit
        In the same order.
    """
    pairs = [(t, best) for i, best in enumerate(found[:best_ones]) for t in found[i + 1 :]]
    nearest = {t.key: t for t in found}
    for again in fitted_from(pairs, data, block):
        if again.train.rmse < BETTER_MINIMUM * nearest[again.key].train.rmse:
            nearest[again.key] = again
    return list(nearest.values())


def fitted_from(
    pairs: Sequence[tuple[CandidateFit, CandidateFit]], data: SegmentedData, block
) -> list[CandidateFit]:
    """Return those candidates whose law can represent another's, fitted from that one's fit.

    `pairs`: a candidate, and the other; `data`, `block`: see `matching_along`.
    """
    matching = matching_along(data, block)

    def started_there(pair):
        tried, other = pair
        fit = cross_started(tried, other, data, matching(tried.block.effects[-1], other.block.effects[-1]))
        return fit and tried.with_fit(fit)

    return [t for t in side_by_side(started_there, pairs) if t is not None]


def validated_from(
    pairs: Sequence[tuple[CandidateFit, CandidateFit]], data: SegmentedData, block
) -> list[CandidateFit]:
    """Return what `fitted_from` does, validated."""
    found = fitted_from(pairs, data, block)
    return side_by_side(lambda t: thresholds_refined(data.validate(t), data), found)


def told_by_held_out(tried: CandidateFit, data: SegmentedData) -> CandidateFit:
    """Return the fit of an effect that predicts best, of those that the segments fitted do not tell apart."""
    best = replace(tried, beside=())
    if not tried.beside:
        return best
    least = data.validate(best).validation_rmse
    for other in tried.beside:
        error = data.validate(other, least).validation_rmse
        if error < least:
            best, least = other, error
    return best


def about_zero(tried: CandidateFit, data: SegmentedData) -> CandidateFit:
    """Return a candidate with its effect counted from zero, where the data do not tell from where.

    A stop at one end of the stroke stands there wherever the other one does, which other data may reach.
    """
    fit, (*others, effect) = tried.train, tried.block.effects
    iterations, tolerance = EFFORT_CONFIRMED
    found = [tried]
    for plain in effect.about_zero():
        block = tried.block.with_effects((*others, plain))
        fixed = {f"{block.newest}.{k}" for k, p in plain.parameters.items() if not p.estimated}
        names = tuple(k for k in fit.names if k not in fixed)
        there = data.fit(block, names, starts=fit.starts, iterations=iterations, tolerance=tolerance)
        found.append(replace(tried, train=there, extra=tried.extra + len(names) - len(fit.names)))
    return min(found, key=penalized)


def best_of_each(fits: Sequence[CandidateFit]) -> list[CandidateFit]:
    """Return the first fit of every candidate, in their order."""
    first: dict[str, CandidateFit] = {}
    for fit in fits:
        first.setdefault(fit.key, fit)
    return list(first.values())


def with_level_sought(found: Sequence[CandidateFit], data: SegmentedData) -> list[CandidateFit]:
    """Seek the static level of a candidate where none explains the data to the noise.

    A descent keeps the level that it begins with, and bends all else to it. Of several laws with a level the
    simplest is enough: the others can start from it (`restarted_from_better`).
    """
    least = min((t.train.rmse for t in found), default=0.0)
    simplest = min(filter(_breaks_away, found), key=lambda t: t.extra, default=None)
    if simplest is None or least <= ONLY_NOISE * data.noise:
        return list(found)
    sought = simplest.with_fit(data.with_levels(simplest.train))
    return [sought if t is simplest else t for t in found]


def _breaks_away(tried: CandidateFit) -> bool:
    """Whether the newest effect of a candidate is friction with a static level."""
    effect = tried.block.effects[-1]
    return effect.role == "friction" and bool(static_levels(type(effect)))


def acts_as(tried: CandidateFit, other: CandidateFit, data: SegmentedData, block, noise: NoiseModel) -> bool:
    """Whether a candidate, with values that make it act as another, has the output of that one within noise.

    Two fits of laws that do the same along a motion may have ended in minima of their own, as impacts and dry
    friction have many.

    Parameters
    ----------
    tried, other : CandidateFit
        Confirmed.
    data : SegmentedData
        The data that they are fitted to.
    block : Mechanism
        The model without them.
    noise : NoiseModel
        Of the other one's residual.
    """
    like = matching_along(data, block)(tried.block.effects[-1], other.block.effects[-1])
    if like is None:
        return False
    pieces = []
    for view, fit in ((data.train, other.train), (data.validation, other.validation)):
        if fit is not None:
            model = with_values_of(tried.block, fit.model, like)
            pieces += data.fit(model, (), view=view, starts=fit.starts, iterations=0).simulated_pieces
    return indistinguishable(pieces, other.outputs, noise)


def breaks_away_only(tried: CandidateFit, speed: float) -> bool:
    """Whether a candidate is a static level whose bump over speed is passed within a sample.

    `speed`: typical of the records [m/s].
    """
    if not _breaks_away(tried):
        return False
    effect = tried.block.effects[-1]
    beside = [e for e in tried.block.effects if e.role == "friction" and e.side == effect.side]
    beside.sort(key=lambda e: e.rank)
    without, passed = [e for e in beside if e is not effect], PASSED * speed
    kinetic = level(without, 1.0, 1.0, passed)
    bump = level(beside, 1.0, 1.0, passed) - kinetic
    return bump <= BUMP_LEFT * (level(beside, 0.0, 1.0, 0.0) - kinetic)
