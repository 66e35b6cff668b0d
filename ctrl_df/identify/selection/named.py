"""Models that may be named, refitted as `refit` does and ranked by that."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from ...simulate.parallel import side_by_side
from ..estimation.from_others import started_from
from ..estimation.refit_records import refit_records, undetermined
from ..estimation.segmented import CandidateFit
from ..prediction.values import with_values
from ..thresholds import DISTINGUISHED, GROWTH, ONLY_NOISE, REFIT_BUDGET, RULED_OUT
from .equivalence import best_of_each, validated_from
from .evidence import ranked
from .reference import Reference
from .thresholds import ON_LIMIT, REFIT_PROMISES


def refitted(
    at: Reference,
    chosen: Sequence[CandidateFit],
    significant: float,
    refit: Callable,
    clear: float = math.inf,
) -> tuple[Reference, list[CandidateFit]]:
    """Refit the first of confirmed candidates and those that the data hardly distinguish from it.

    Candidates are compared over segments that show what is missing, with the same effort for all. Parameters
    are estimated best over segments as long as the model can predict: those of candidates that may be named
    are fitted over these until they converge, and the evidence is that of these fits. One that can act as the
    first does is fitted from its values, too: the cost of impacts and of dry friction has many minima.

    Parameters
    ----------
    chosen : sequence of CandidateFit
        Best first.
    significant : float
        Evidence that an effect needs [nats].
    refit : callable
        Returns a candidate refitted, such as `whole_refit`.
    clear : float
        Evidence by which the first has to be ahead of the others, and beyond what is significant, for its
        parameters not to matter [nats]: then only the model without it is refitted.
    """
    if chosen and chosen[0].evidence > significant:
        at = _as_carefully(at, refit)
        chosen, noise = ranked(at.base, chosen)
        if chosen[0].evidence - max([significant, *(t.evidence for t in chosen[1:2])]) > clear:
            return replace(at, noise=noise), chosen
    chosen, known, noise = list(chosen), dict[str, CandidateFit](), at.noise
    while chosen and chosen[0].evidence > significant:
        least = chosen[0].evidence - RULED_OUT
        there = [t for t in chosen if t.evidence > least and t.key not in known]
        if not there:
            break
        known |= {t.key: f for t, f in zip(there, side_by_side(partial(refit, at), there), strict=True)}
        at = replace(at, base=started_from(at.base, [known[t.key] for t in there], at.data.fine))
        chosen, noise = ranked(at.base, [known.get(t.key, t) for t in chosen])
    for _ in known:
        first = chosen[0]
        behind = [t for t in chosen if t.key in known and first.evidence - t.evidence > DISTINGUISHED]
        started = validated_from([(t, first) for t in behind], at.data.fine, at.base.block)
        if not started:
            break
        again = side_by_side(lambda t: refit(at, t), started)
        chosen, noise = ranked(at.base, [*chosen, *again])
        chosen = best_of_each(chosen)
        if chosen[0].train is first.train:
            break
    return replace(at, noise=noise), chosen


def _as_carefully(at: Reference, refit: Callable) -> Reference:
    """Return the reference with its model refitted as candidates are to be.

    A model left in a wrong minimum, or fitted to segments whose initial states take slow noise away, seems to
    lack what others gain by the refit. One that errs far beyond the noise lacks something else.
    """
    if at.data.lacks_more(at.base.train.rmse):
        return at
    return replace(at, base=refit(at, at.base))


def whole_refit(at: Reference, tried: CandidateFit, prior, seen: bool) -> CandidateFit:
    """Return a candidate with the values that `refit` finds from its own.

    It stays as it is where the validation segments speak against these values, or determine parameters that
    the refit does not; and where disturbance forces outweigh the noise: then candidates are compared by
    accelerations, the refit is of outputs, and the best values of one may be far from those of the other.

    Parameters
    ----------
    prior : mapping or None
        Value and standard deviation of parameters known beforehand, by name.
    seen : bool
        Whether the held-out error may be that of this fit, which has seen the whole records. Where parts of
        them are held out it is that of the last fit that has not seen these.
    """
    data, names = at.data.fine, tried.train.names
    if data.disturbed:
        return tried

    def found_from(model, start):
        return refit_records(
            model, data.train.records, names, start, whole=False, mode="auto", window=None, robust=True,
            budget=REFIT_BUDGET, prior=prior, settled=at.leaves_only_noise,
        )[0]  # fmt: skip

    found = found_from(tried.block, {})
    if not at.leaves_only_noise and found.rmse > ONLY_NOISE * at.floor and not data.lacks_more(found.rmse):
        # a wrong minimum near the right one: short segments lead out of it
        found = min(found, found_from(found.model, None), key=lambda f: f.rmse)
    # a static level is found by trying, as single samples pass it: it has no sensitivity
    levels = {k for k in names if tried.block.parameters[k].threshold}
    if undetermined(found) - undetermined(tried.train) - levels:
        return tried
    there = data.as_it_is(found, tried.train)
    there = replace(there, covariance=found.covariance, at_bound=found.at_bound, null=found.null)
    other = data.validate(replace(tried, train=there))
    if other.size > GROWTH**2 * tried.size:
        return tried
    if seen:
        return other
    return replace(other, validation=tried.validation, linear=tried.linear, unseen=tried.validated)


def beyond_range(at: Reference, best: CandidateFit, refit: Callable):
    """Return the model without an effect, refitted without limits, where that explains more than the best.

    Fits keep the model's own parameters within a range of what they were stated to be. Where one ends at a
    limit, with the best effect or without, or a regression puts it beyond, wrong units of record or model are
    as likely as a missing effect: a drive gain far from one does what other values of all parameters do, with
    one more.

    Returns
    -------
    tuple of (CandidateFit, tuple of str) or None
        With the parameters that left their range; None: all are within, or it explains no more.
    """
    spans = {k: span for k, span in at.data.limits.items() if k in at.base.train.names}
    fitted = [{k: p.value for k, p in tried.block.parameters.items()} for tried in (at.base, best)]
    tables = (*fitted, at.regressed)
    if all(a * ON_LIMIT < t[k] < b / ON_LIMIT for t in tables for k, (a, b) in spans.items() if k in t):
        return None
    free = replace(at, data=replace(at.data, limits={}))
    regressed = with_values(at.base.block, at.regressed)
    every = at.base, replace(at.base, train=free.data.fine.fit(regressed, at.base.train.names))
    starts = [t for t in every if t.train.rmse < REFIT_PROMISES * best.train.rmse]
    if not starts:
        return None
    other = min((refit(free, trial, seen=True) for trial in starts), key=lambda f: f.train.rmse)
    values = {k: p.value for k, p in other.block.parameters.items()}
    left = tuple(k for k, (a, b) in spans.items() if not a <= values[k] <= b)
    (again,), _ = ranked(at.base, [other])
    return (other, left) if left and again.evidence > best.evidence else None
