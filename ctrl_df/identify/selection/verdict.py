"""The steps of a diagnosis over any data: candidates confirmed, the verdict, where the error is."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...simulate.parallel import side_by_side
from ..monitor import COMPLETE, UNDER_WAY, Monitor
from ..results.diagnosis import (
    AMBIGUOUS,
    EFFECT,
    NONE,
    UNKNOWN,
    Baseline,
    CandidateEffect,
    Diagnosis,
    rivals,
)
from ..results.explain import (
    contradict,
    displaces,
    explain,
    explain_so_far,
    falls_behind,
    leaves,
    left_out,
    unconfirmed,
    undetermined,
)
from ..thresholds import EXPONENT, FLOOR
from .long_prediction import LongPrediction, compared, long_prediction
from .search import Remainder, Search
from .thresholds import REFUTED, REFUTED_MOST


@dataclass(frozen=True, eq=False)
class Diagnosed:
    """The diagnosis of a search, and the search after it."""

    diagnosis: Diagnosis
    search: Search


def diagnosed(
    search: Search,
    classes,
    executor=None,
    monitor: Monitor | None = None,
    limits=None,
    search_with: Callable[[Any], Search] | None = None,
) -> Diagnosed:
    """Screen effects, confirm the best candidates, and return the verdict.

    Parameters
    ----------
    search : Search
    classes : sequence of effect classes
        Candidates; with none the model alone is diagnosed.
    executor : concurrent.futures.Executor or None
        Runs fits in parallel; None: threads of this process do.
    monitor : Monitor or None
        Receives the diagnosis as it stands.
    limits : mapping or None
        What the next experiment may do to the machine.
    search_with : callable or None
        ``search_with(block)``: the search for what the model with the best candidate still misses, where its
        residual is more than noise; None: that is not examined here.
    """
    began, limits = time.perf_counter(), dict(limits or {})

    def so_far(known) -> Diagnosed:
        return _Question(known[0], began, limits).so_far(known[1])

    def diagnose_rest(block, part: Monitor) -> Diagnosis:
        assert search_with is not None
        return diagnosed(search_with(block), classes, executor, part).diagnosis

    monitor = (monitor or Monitor()).within(so_far)
    first: Diagnosed | None = None
    refuted: tuple[tuple[str, str], ...] = ()
    while True:
        left = [c for c in classes if c.id not in dict(refuted)]
        after, found = search.candidates(left, executor, monitor)
        after, chosen = after.confirm(found, monitor)
        monitor.stage("verdict")
        known, refutation = _Question(after, began, limits, refuted).answer(
            chosen, found, monitor, diagnose_rest if search_with else None
        )
        ranking = known.diagnosis.ranking
        if first is not None and not (ranking and is_significant(ranking[0], after)):
            return first  # without what was refuted nothing is explained
        if refutation is None or len(refuted) == REFUTED_MOST:
            return known
        first = first or known
        monitor.known((after, found))
        monitor.stage(
            f"the search repeated without {refutation[0].replace('_', ' ')}, which long horizons refute"
        )
        refuted = (*refuted, refutation)


class _Question:
    """Which effect the model of a search misses."""

    def __init__(self, search: Search, began: float, limits, refuted: Sequence[tuple[str, str]] = ()):
        self.search, self.began, self.limits, self.refuted = search, began, limits, refuted

    def so_far(self, found: Sequence) -> Diagnosed:
        """Return the diagnosis as it stands with these candidates, best first; it names no effect."""
        search = self.search
        chosen = [t for t in found if t.confirmed]
        # what screening leaves unfinished has no likelihood to be compared
        weights = dict(zip((t.key for t in chosen), _probabilities(chosen, search), strict=True))
        ranking = [_entry(t, search, weights.get(t.key, 0.0), ()) for t in found]
        significant = bool(ranking) and ranking[0].evidence > search.significant
        verdict = NONE if search.exact() else AMBIGUOUS if significant else UNKNOWN
        best = chosen[0] if chosen else search.base
        result, _ = self._diagnosis(verdict, ranking, search.so_far(best), best, self._base(), UNDER_WAY)
        return Diagnosed(replace(result, explanation=explain_so_far(result, search.words)), search)

    def answer(
        self,
        chosen: Sequence,
        found: Sequence,
        monitor: Monitor,
        diagnose_rest: Callable[..., Diagnosis] | None,
    ) -> tuple[Diagnosed, tuple[str, str] | None]:
        """Return the diagnosis, and the refutation of the first candidate (id, reason) if there is one.

        `found`: all candidates. One that fits short segments only by its hidden states, re-estimated in
        each, set the error above which fits of others were given up: the search is then repeated without it.

        Where the residual with the first is more than noise, a second effect is missing or it stands in for
        one outside the library: `diagnose_rest(block, monitor)` is the diagnosis of the model with the first;
        None: that is not examined here.
        """
        search = self.search
        best = chosen[0] if chosen else search.base
        keys = {c.key for c in chosen}
        same: dict[str, tuple[str, ...]] = dict.fromkeys((c.key for c in chosen), ())
        for a, b in itertools.combinations(chosen, 2):
            if search.equivalent(a, b):
                same[a.key] += (b.key,)
                same[b.key] += (a.key,)
        weights = _probabilities(chosen, search)
        ranking = [_entry(t, search, w, same[t.key]) for t, w in zip(chosen, weights, strict=True)]
        ranking += [_entry(t, search, 0.0, ()) for t in found if t.key not in keys]
        recorded = search.as_recorded(chosen[0]) if chosen else ""
        # what is not confirmed is no answer
        examined = bool(chosen) and not recorded and not search.exact()
        inconclusive = examined and inconclusive_on_holdout(ranking[0], search)
        base = self._base()
        if inconclusive:
            verdict = AMBIGUOUS
        elif not examined or not is_significant(ranking[0], search):
            verdict = NONE
        elif all(c.id in ranking[0].equivalents for c in rivals(ranking)):
            verdict = EFFECT
        else:
            verdict = AMBIGUOUS
        if verdict == NONE and not recorded:
            best = search.base
        long_run: list = []
        if verdict == EFFECT or (verdict == AMBIGUOUS and not inconclusive):
            monitor.stage("free prediction over long horizons")
            long_run = [base, *compared(ranking, search.significant)]
        # independent of each other; the longest first
        significant = verdict != NONE
        jobs = [
            lambda: search.remainder(best, significant),
            *(lambda m=m: m.error_by_horizon for m in long_run),
        ]
        remainder, *_ = side_by_side(lambda job: job(), jobs)
        long = long_prediction(ranking, base, search.significant) if long_run else None
        refuted = long is not None and long.refuted
        refutation = (ranking[0].id, left_out(ranking[0], long)) if refuted else None
        if remainder.unexplained and not search.exact():
            verdict = UNKNOWN
        doubts = (remainder.doubt,) if verdict != NONE and remainder.doubt else ()
        doubts = (unconfirmed(ranking[0]), *doubts) if inconclusive else doubts
        failure = ""
        if long_run and verdict != AMBIGUOUS:
            outcome, ranking, further = after_long_prediction(
                ranking, long, favoured_held_out(ranking, search)
            )
            doubts = further if outcome == UNKNOWN else (*further, *doubts)
            if outcome == UNKNOWN:
                # refuted: what is missing is what the model without it leaves
                best, remainder = search.base, search.remainder(search.base, False)
                if long is not None and "" in long.better and not remainder.unexplained:
                    # nothing: by states re-estimated in every segment the first took slow noise away
                    verdict, refutation, failure = NONE, None, falls_behind(ranking[0], long)
                    ranking = [replace(c, probability=0.0) for c in ranking]
            verdict = outcome if verdict == EFFECT else verdict
        if (
            diagnose_rest is not None
            and verdict in (EFFECT, AMBIGUOUS)
            and remainder.more
            and not inconclusive
        ):
            monitor.stage(f"the residual with {ranking[0].id.replace('_', ' ')}")
            second = diagnose_rest(best.block, monitor.within(lambda _: (search, chosen)))
            verdict = UNKNOWN if second.verdict == UNKNOWN else verdict
            doubts = (*doubts, leaves(ranking[0], second))
        doubts = (*doubts, *(why for _, why in self.refuted), *search.open_directions())
        doubts = (*doubts, *(search.record_faults() if verdict in (UNKNOWN, AMBIGUOUS) else ()))
        result, note = self._diagnosis(verdict, ranking, remainder, best, base, COMPLETE, doubts)
        words = replace(search.words, noise=search.words.noise + recorded)
        text = explain(result, words, failure) + note
        return Diagnosed(replace(result, explanation=text), search), refutation

    def _base(self) -> Baseline:
        search = self.search
        errors, predicted = search.errors(search.base), search.predicted(search.base)
        return Baseline(search.base.block, *errors, predicted=predicted)

    def _diagnosis(
        self, verdict, ranking, remainder: Remainder, best, base: Baseline, status, doubts=()
    ) -> tuple[Diagnosis, str]:
        search = self.search
        located = search.located(best, remainder, verdict == UNKNOWN and status == COMPLETE)
        fitted, validation = search.records
        result = search.kind(
            verdict, tuple(ranking), base.model, base, base.nrmse, base.nrmse_holdout, remainder.noise,
            remainder.structure, "", located.kinds, located.where, fitted, validation,
            time.perf_counter() - self.began, self.limits, search.measure, located.remains, status,
            doubts, verdict == UNKNOWN and remainder.held_out_only, **search.answer(best),
        )  # fmt: skip
        return result, located.note


def after_long_prediction(ranking, long: LongPrediction | None, favoured: Sequence[CandidateEffect]):
    """Return the verdict on the first of a ranking after free prediction, with the reasons.

    It is confirmed where it predicts the motion over long horizons as well as any rival, and better than
    the model without it, where the held-out data favour no rival, where the data determine the effect's
    size, its first parameter, and where the parameters of the model itself stay within their ranges with it.

    Parameters
    ----------
    ranking : list of CandidateEffect
    long : LongPrediction or None
    favoured : sequence of CandidateEffect
        Rivals that the held-out data favour (`favoured_held_out`).

    Returns
    -------
    verdict : str
    ranking : list of CandidateEffect
        Those that predict better share the probability with the first: two criteria contradict each other.
    doubts : tuple of str
    """
    first = ranking[0]
    if long is not None and not long.ahead:
        doubts, named = (falls_behind(first, long),), [c for c in ranking if c.id in long.better]
        return (AMBIGUOUS if named else UNKNOWN), _shared(ranking, named), doubts
    if favoured:
        return AMBIGUOUS, _shared(ranking, favoured), (contradict(first, favoured[0]),)
    if next(iter(first.parameters), None) in first.undetermined:
        return AMBIGUOUS, ranking, (undetermined(first),)
    if first.displaced:
        return AMBIGUOUS, ranking, (displaces(first),)
    return EFFECT, ranking, ()


def favoured_held_out(ranking, search: Search) -> list[CandidateEffect]:
    """Return the rivals that the held-out data favour over the first of a ranking, the most likely first.

    If the first is right the expected log-likelihood ratio is positive on every record. That the fitted data
    favour one effect and the held-out data another refutes both, unless a fit has ended in a wrong minimum:
    what the first can represent is no rival. (Of 121 rigs of the second generator with an effect of the
    library hidden one had such a rival behind the right effect, of 28 with something else three behind
    whatever came first.)
    """
    first, *others = ranking
    ahead = {c.id: c.evidence_holdout - first.evidence_holdout for c in others if c.confirmed}
    found = [
        c
        for c in others
        if ahead.get(c.id, 0.0) > search.significant_validation
        and c.id not in first.equivalents
        and search.acting_as(first.effect, c.effect) is None
    ]
    return sorted(found, key=lambda c: -ahead[c.id])


def _shared(ranking, others) -> list[CandidateEffect]:
    """Return a ranking in which the first shares its probability with these."""
    share = ranking[0].probability / (1 + len(others))
    return [replace(c, probability=share) if c is ranking[0] or c in others else c for c in ranking]


def is_significant(first: CandidateEffect, search: Search) -> bool:
    """Whether an effect is significant on the data fitted, and on those held out alone.

    On held-out data the errors of all parameters show, and a superfluous effect may reduce them by chance:
    the data fitted have to be significant by themselves. Whitened residuals may favour an effect that makes
    slow errors larger: the plain error on held-out data must not grow.
    """
    if _errs_more(first, search):
        return False
    return (
        first.evidence_fitted > search.significant and first.evidence_holdout > search.significant_validation
    )


def inconclusive_on_holdout(first: CandidateEffect, search: Search) -> bool:
    """Whether an effect is significant on the data fitted, while those held out say nothing about it.

    It may not act in them at all: a stop that is not reached, for instance.
    """
    quiet = abs(first.evidence_holdout) <= search.significant_validation
    return first.evidence_fitted > search.significant and quiet and not _errs_more(first, search)


def _errs_more(first: CandidateEffect, search: Search) -> bool:
    """Whether held-out data err more with an effect than without it."""
    return errs_more(first.effect, first.nrmse_holdout, search.errors(search.base)[1])


def errs_more(tried, held_out: float, before: float) -> bool:
    """Whether data err more with an effect or a model: by `held_out`, by `before` without or with another.

    Of a sensor that rounds that says nothing: a model right to a tenth of a step errs by a whole one in a
    tenth of the samples, which is more than the 1/sqrt(12) of one that knows no steps. Its evidence is
    the likelihood of the recorded values.
    """
    return not any(p.stepped for p in tried.parameters.values()) and held_out > FLOOR * before


def _probabilities(chosen, search: Search) -> list[float]:
    """Return those of candidates, "nothing missing" being one more, the candidates equal before the data.

    Prior odds for nothing are those at which chance makes an effect significant: what is not is less likely
    than nothing. What the held-out data speak against has none.
    """
    if not chosen:
        return []
    log_odds = [t.evidence if t.evidence_validation > -REFUTED else -math.inf for t in chosen]
    log_odds.append(search.significant)
    weights = np.exp(np.clip(np.array(log_odds) - max(log_odds), -EXPONENT, 0))
    return (weights / weights.sum())[:-1].tolist()


def _entry(candidate, search: Search, probability: float, same) -> CandidateEffect:
    effect, key = candidate.block.effects[-1], candidate.block.newest
    values = {k: p.value for k, p in effect.parameters.items()}
    known = search.standard_errors(candidate)
    nrmse, held_out = search.errors(candidate)
    return CandidateEffect(
        candidate.block, predicted=search.predicted(candidate), effect=effect, id=effect.id, nrmse=nrmse,
        nrmse_holdout=held_out, evidence=candidate.evidence, probability=probability, parameters=values,
        equivalents=same, confirmed=candidate.confirmed,
        errors={k: known[f"{key}.{k}"] for k in values if f"{key}.{k}" in known},
        evidence_fitted=candidate.evidence_fitted, evidence_holdout=candidate.evidence_validation,
        undetermined=search.undetermined(candidate), displaced=search.displaced(candidate),
    )  # fmt: skip
