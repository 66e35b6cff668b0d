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
from ..thresholds import EXPONENT, ONLY_NOISE
from .long_prediction import LongPrediction, compared, long_prediction
from .search import Remainder, Search
from .thresholds import REFUTED, REFUTED_MOST


@dataclass(frozen=True, eq=False)
class Diagnosed:
    """The diagnosis of a search, the search after it, and what long horizons refuted before (ids)."""

    diagnosis: Diagnosis
    search: Search
    refuted: tuple[str, ...] = ()


def diagnosed(
    search: Search,
    classes,
    executor=None,
    monitor: Monitor | None = None,
    limits=None,
    search_with: Callable[[Any], Search] | None = None,
    clear: float = math.inf,
) -> Diagnosed:
    """Screen effects, confirm the best candidates, and return the verdict.

    Where what is missing acts in held-out parts of the records alone (a current limit in one move) no fit of
    the others finds it: the search is then repeated with other parts held out. Its effect is not confirmed
    by these, but it is named.

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
    clear : float
        Evidence by which the first candidate has to be ahead of all others for its parameters not to matter
        (`Search.confirm`).
    """
    monitor = monitor or Monitor()
    rest = (executor, monitor, dict(limits or {}), search_with, clear, time.perf_counter())
    found = _diagnosed(search, classes, *rest)
    other = search.divided_otherwise() if found.diagnosis.held_out_only and classes else None
    if other is None:
        return found
    monitor.stage("the search repeated with other parts held out")
    again = _diagnosed(other, classes, *rest)
    return again if again.diagnosis.verdict in (EFFECT, AMBIGUOUS) else found


def _diagnosed(
    search: Search, classes, executor, monitor: Monitor, limits, search_with, clear: float, began: float
) -> Diagnosed:
    """Do what `diagnosed` does, with the same parts held out."""

    def so_far(known) -> Diagnosed:
        return _Question(known[0], began, limits).so_far(known[1])

    def diagnose_rest(block, part: Monitor) -> Diagnosis:
        assert search_with is not None
        return diagnosed(search_with(block).following(after), classes, executor, part).diagnosis

    monitor = monitor.within(so_far)
    first: Diagnosed | None = None
    refuted: tuple[tuple[str, str], ...] = ()
    while True:
        left = [c for c in classes if c.id not in dict(refuted)]
        after, found = search.candidates(left, executor, monitor)
        search = search.following(after)
        after, chosen = after.confirm(found, monitor, clear)
        monitor.stage("verdict")
        known, refutation = _Question(after, began, limits, refuted).answer(
            chosen, found, monitor, diagnose_rest if search_with else None
        )
        ranking = known.diagnosis.ranking
        if first is not None and not (ranking and is_significant(ranking[0], after)):
            return first  # without what was refuted nothing is explained
        if refutation is None or len(refuted) == REFUTED_MOST:
            return replace(known, refuted=tuple(key for key, _ in refuted))
        first = first or known
        monitor.known((after, found))
        monitor.stage(
            f"the search repeated without {refutation[0].replace('_', ' ')}, which long horizons refute"
        )
        refuted = (*refuted, refutation)


@dataclass(frozen=True)
class _Judged:
    """A verdict: the candidates ranked, the best model and what it leaves, and what speaks against it.

    `failure`: why the first of the ranking is no answer although it was significant.
    """

    verdict: str
    ranking: list[CandidateEffect]
    best: Any
    remainder: Remainder
    doubts: tuple[str, ...] = ()
    failure: str = ""


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
        judged = _Judged(verdict, ranking, best, search.so_far(best))
        result, _ = self._diagnosis(judged, self._base(), UNDER_WAY)
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
        search, base = self.search, self._base()
        ranking = self._ranking(chosen, found)
        recorded = search.as_recorded(chosen[0]) if chosen else ""
        # what is not confirmed is no answer
        examined = bool(chosen) and not recorded and not search.exact()
        inconclusive = examined and inconclusive_on_holdout(ranking[0], search)
        verdict = AMBIGUOUS if inconclusive else _by_evidence(ranking, search) if examined else NONE
        best = chosen[0] if chosen and (recorded or verdict != NONE) else search.base
        predicted = verdict != NONE and not inconclusive
        if predicted:
            monitor.stage("free prediction over long horizons")
        judged, long = self._examined(verdict, ranking, best, base, predicted)
        if inconclusive:
            judged = replace(judged, doubts=(unconfirmed(ranking[0]), *judged.doubts))
        if predicted and judged.verdict != AMBIGUOUS:
            judged = self._after_long_prediction(judged, long)
        if (
            diagnose_rest is not None
            and judged.verdict in (EFFECT, AMBIGUOUS)
            and judged.remainder.more
            and not inconclusive
        ):
            first = judged.ranking[0]
            monitor.stage(f"the residual with {first.id.replace('_', ' ')}")
            second = diagnose_rest(judged.best.block, monitor.within(lambda _: (search, chosen)))
            verdict = UNKNOWN if second.verdict == UNKNOWN else judged.verdict
            judged = replace(judged, verdict=verdict, doubts=(*judged.doubts, leaves(first, second)))
        # what a candidate explains to the noise is no fault of the records
        unsolved = judged.verdict == UNKNOWN or (judged.verdict == AMBIGUOUS and judged.remainder.more)
        faults = search.record_faults() if unsolved else ()
        known = (*(why for _, why in self.refuted), *search.open_directions(judged.best), *faults)
        judged = replace(judged, doubts=(*judged.doubts, *known))
        result, note = self._diagnosis(judged, base, COMPLETE)
        words = replace(search.words, noise=search.words.noise + recorded)
        text = explain(result, words, judged.failure) + note
        refuted = long is not None and long.refuted and not judged.failure
        refutation = (ranking[0].id, left_out(ranking[0], long)) if refuted else None
        return Diagnosed(replace(result, explanation=text), search), refutation

    def _ranking(self, chosen: Sequence, found: Sequence) -> list[CandidateEffect]:
        """Return confirmed candidates with their probabilities, and behind them all others."""
        search, keys = self.search, {c.key for c in chosen}
        same: dict[str, tuple[str, ...]] = dict.fromkeys((c.key for c in chosen), ())
        for a, b in itertools.combinations(chosen, 2):
            if search.equivalent(a, b):
                same[a.key] += (b.key,)
                same[b.key] += (a.key,)
        weights = _probabilities(chosen, search)
        ranking = [_entry(t, search, w, same[t.key]) for t, w in zip(chosen, weights, strict=True)]
        return ranking + [_entry(t, search, 0.0, ()) for t in found if t.key not in keys]

    def _examined(
        self, verdict, ranking, best, base: Baseline, predicted: bool
    ) -> tuple[_Judged, LongPrediction | None]:
        """Return the verdict after what the best model leaves, and how far ahead it predicts if asked."""
        search = self.search
        models = [base, *compared(ranking, search.significant)] if predicted else []
        # independent of each other; the longest first
        jobs = [
            lambda: search.remainder(best, verdict != NONE),
            *(lambda m=m: m.error_by_horizon for m in models),
        ]
        remainder, *_ = side_by_side(lambda job: job(), jobs)
        long = long_prediction(ranking, base, search.significant) if predicted else None
        told = UNKNOWN if remainder.unexplained and not search.exact() else verdict
        doubts = (remainder.doubt,) if told != NONE and remainder.doubt else ()
        return _Judged(told, ranking, best, remainder, doubts), long

    def _after_long_prediction(self, judged: _Judged, long: LongPrediction | None) -> _Judged:
        """Return the verdict after long horizons: they confirm the best model, or refute it."""
        search = self.search
        outcome, ranking, doubts = after_long_prediction(
            judged.ranking, long, favoured_held_out(judged.ranking, search)
        )
        if outcome != UNKNOWN:
            verdict = outcome if judged.verdict == EFFECT else judged.verdict
            return replace(judged, verdict=verdict, ranking=ranking, doubts=(*doubts, *judged.doubts))
        # what is missing is what the model without it leaves
        left = search.remainder(search.base, False)
        refuted = _Judged(UNKNOWN, ranking, search.base, left, doubts)
        if long is None or "" not in long.better or left.unexplained:
            return refuted
        if not search.takes_only_noise(judged.best):  # it is right, or near it, and ended in a wrong minimum
            return refuted
        # nothing: by states re-estimated in every segment the first took slow noise away
        ranking = [replace(c, probability=0.0) for c in ranking]
        return replace(refuted, verdict=NONE, ranking=ranking, failure=falls_behind(ranking[0], long))

    def _base(self) -> Baseline:
        search = self.search
        errors, predicted = search.errors(search.base), search.predicted(search.base)
        return Baseline(search.base.block, *errors, predicted=predicted)

    def _diagnosis(self, judged: _Judged, base: Baseline, status) -> tuple[Diagnosis, str]:
        search, verdict, best, remainder = self.search, judged.verdict, judged.best, judged.remainder
        located = search.located(best, remainder, verdict == UNKNOWN and status == COMPLETE)
        fitted, validation = search.records
        result = search.kind(
            verdict=verdict, status=status, doubts=judged.doubts, ranking=tuple(judged.ranking),
            model=base.model, baseline=base, nrmse=base.nrmse, nrmse_holdout=base.nrmse_holdout,
            noise=remainder.noise, structure=remainder.structure, measure=search.measure, explanation="",
            regions=located.kinds, where=located.where, remains=located.remains,
            held_out_only=verdict == UNKNOWN and remainder.held_out_only, train=fitted, holdout=validation,
            seconds=time.perf_counter() - self.began, limits=self.limits, **search.answer(best),
        )  # fmt: skip
        return result, located.note


def _by_evidence(ranking: Sequence[CandidateEffect], search: Search) -> str:
    """Return the verdict on the first of a ranking by evidence alone."""
    if not is_significant(ranking[0], search):
        return NONE
    alone = all(c.id in ranking[0].equivalents for c in rivals(ranking))
    return EFFECT if alone else AMBIGUOUS


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
    if first.size_undetermined:
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
    if _errs_more(first.effect, first.nrmse_holdout, search):
        return False
    return (
        first.evidence_fitted > search.significant and first.evidence_holdout > search.significant_validation
    )


def inconclusive_on_holdout(first: CandidateEffect, search: Search) -> bool:
    """Whether an effect is significant on the data fitted, while those held out say nothing about it.

    It may not act in them at all: a stop that is not reached, for instance.
    """
    quiet = abs(first.evidence_holdout) <= search.significant_validation
    return (
        first.evidence_fitted > search.significant
        and quiet
        and not _errs_more(first.effect, first.nrmse_holdout, search)
    )


def _errs_more(effect, held_out: float, search: Search) -> bool:
    """Whether held-out data err more with an effect, by `held_out`, than without it."""
    return errs_more(effect, held_out, search.errors(search.base)[1])


def errs_more(tried, held_out: float, before: float) -> bool:
    """Whether data err more with an effect or a model: by `held_out`, by `before` without or with another.

    Of a sensor that rounds that says nothing: a model right to a tenth of a step errs by a whole one in a
    tenth of the samples, which is more than the 1/sqrt(12) of one that knows no steps. Its evidence is
    the likelihood of the recorded values.
    """
    return not any(p.stepped for p in tried.parameters.values()) and held_out > ONLY_NOISE * before


def _probabilities(chosen, search: Search) -> list[float]:
    """Return those of candidates, "nothing missing" being one more, the candidates equal before the data.

    Prior odds for nothing are those at which chance makes an effect significant: what is not is less likely
    than nothing. What the held-out data speak against has none.
    """
    if not chosen:
        return []

    def likely(t) -> float:
        errs = _errs_more(t.block.effects[-1], search.errors(t)[1], search)
        return -math.inf if errs or t.evidence_validation <= -REFUTED else t.evidence

    log_odds = [*map(likely, chosen), search.significant]
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
