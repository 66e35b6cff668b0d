"""The course of a diagnosis over any data: the best confirmed, what they amount to, where the error is."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from ..results.diagnosis import AMBIGUOUS, EFFECT, NONE, UNKNOWN, CandidateEffect, Diagnosis, rivals
from ..results.explain import explain
from .search import Search


def verdict_of(search: Search, found, began: float, limits=None) -> Diagnosis:
    """Confirm the best candidates and say what they amount to.

    Parameters
    ----------
    search : Search
    found : list
        Of its `candidates`.
    began : float
        When the diagnosis did (``time.perf_counter()``).
    limits : mapping or None
        What the next experiment may do to the machine.
    """
    chosen = search.confirm(found)
    base, best = search.base, chosen[0] if chosen else search.base
    keys = {c.key for c in chosen}
    ranking = []
    for judged, weight in zip(chosen, _probabilities(chosen), strict=True):
        same = tuple(o.key for o in chosen if o is not judged and search.alike(judged, o))
        ranking.append(_entry(judged, search, weight, same))
    ranking += [_entry(t, search, 0.0, ()) for t in found if t.key not in keys]
    significant = bool(ranking) and worth(ranking[0], search)
    remainder = search.remainder(best, significant)
    if search.exact():
        verdict = NONE
    elif remainder.unexplained:
        verdict = UNKNOWN
    elif not significant:
        verdict = NONE
    else:
        open_ones = rivals(ranking)
        verdict = EFFECT if all(c.id in ranking[0].equivalents for c in open_ones) else AMBIGUOUS
    located = search.located(best, remainder, verdict == UNKNOWN)
    fitted, validation = search.records
    result = search.kind(
        verdict, tuple(ranking), base.block, base.block, *search.errors(base), remainder.noise,
        remainder.structure, "", located.kinds, located.where, fitted, validation,
        time.perf_counter() - began, dict(limits or {}), search.measure, located.remains,
        **search.answer(best),
    )  # fmt: skip
    return replace(result, explanation=explain(result, search.words) + located.note)


def worth(first: CandidateEffect, search: Search) -> bool:
    """Whether the data fitted speak for an effect, and those held out by themselves too.

    On data held out the errors of all parameters show, and an idle effect may make up for them by chance:
    those fitted have to speak for themselves.
    """
    return (
        first.evidence_fitted > search.significant and first.evidence_holdout > search.significant_validation
    )


def _probabilities(chosen) -> list[float]:
    """Return those of confirmed candidates, "nothing missing" being one more, all equal before the data."""
    if not chosen:
        return []
    top = max(chosen[0].evidence, 0.0)
    weights = np.exp(np.clip([*(t.evidence - top for t in chosen), -top], -700, 0))
    return (weights / weights.sum())[:-1].tolist()


def _entry(judged, search: Search, probability: float, same) -> CandidateEffect:
    effect, key = judged.block.effects[-1], judged.block.newest
    values = {k: p.value for k, p in effect.parameters.items()}
    known = search.standard_errors(judged)
    return CandidateEffect(
        effect, effect.id, *search.errors(judged), judged.evidence, probability, values, same, judged.block,
        judged.confirmed, errors={k: known[f"{key}.{k}"] for k in values if f"{key}.{k}" in known},
        evidence_holdout=judged.evidence_validation,
    )  # fmt: skip
