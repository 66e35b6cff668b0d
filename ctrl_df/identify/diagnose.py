"""Which effect is missing: the library screened, the best confirmed by refitting and by held-out data."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np

from ..blocks.mechanism import Mechanism
from ..checks import executor as checked_executor
from ..checks import unknown_keywords
from .arguments import check_held_out, check_limits, effect_classes
from .arguments import free_parameters as free_names
from .data.records import as_records, has_tables
from .estimation.segments import EXACT, facts
from .estimation.trial import Trial
from .residuals.missing_forces import lacks
from .results.diagnosis import AMBIGUOUS, EFFECT, NONE, UNKNOWN, CandidateEffect, Diagnosis, rivals
from .results.explain import explain, find_regions, remains
from .selection.evidence import rounds
from .selection.structure_search import Study

SIGNIFICANT = 20.0
"""Evidence [nats] an effect needs: e^20 to 1, ample for the few hundred shapes that screening tries."""

HELD = 5.0
"""Evidence [nats] it needs on held-out data alone.

To these are fitted initial states, and what the others leave open: a threshold within a range, the phase of
a ripple.
"""

_LEFT = 0.2  # share of the structure (rms) that the best candidate may leave
_NOISIER = 1.4  # error on held-out windows over that on fitted ones that may be chance
_GROWN = 2.0  # error over the least that the shortest windows leave, up to which it may be noise


def diagnose(
    model, data, *, holdout=None, candidates=None, free=None, executor=None, limits=None, **keywords
) -> Diagnosis:
    """Find the effect that a model misses.

    The model is refitted first: an effect counts only beyond what better parameters of the model explain.
    Every effect of the library (user-registered ones included) is then screened, refitted from start values
    read off the residual, and the best are confirmed at the full rate and on held-out data.

    Parameters
    ----------
    model : block or closed loop
        The model in use. Of a loop its block is diagnosed, driven by the recorded force.
    data : Measurement or sequence of Measurement
        Training records.
    holdout : Measurement, sequence or None
        Records to confirm on; None: every third part of the training records is held out.
    candidates : sequence of str or None
        Effect ids to consider; None: the whole library.
    free : sequence of str or None
        Parameters of the model that may be refitted, by name or by effect id, as for `refit`; None: all that
        are free.
    executor : concurrent.futures.Executor or None
        Runs candidates side by side; None: threads of this process do.
    limits : mapping or None
        ``force`` [N] and ``stroke`` [m] for `next_experiment`.

    Returns
    -------
    Diagnosis

    Raises
    ------
    TypeError, ValueError
        Data that are no measurements, an unknown effect id, a model that is no block.
    """
    unknown_keywords(keywords)
    checked_executor("diagnose", executor)
    check_limits(limits)
    candidates = effect_classes(candidates)
    began = time.perf_counter()
    if has_tables(data):
        from .tables.diagnosis import diagnose_frequency

        return diagnose_frequency(
            model, data, holdout=holdout, candidates=candidates, free=free, executor=executor, limits=limits
        )
    records = as_records(data, "data")
    held = as_records(holdout, "holdout") if holdout is not None else ()
    block = block_of(model)
    free = free_names(block, free)
    check_held_out(records, held)
    study = Study(block, records, held, free)
    found = study.candidates(candidates, executor)
    return verdict_of(study, found, began, limits)


def block_of(model) -> Mechanism:
    """Return the mechanism of a block or of a closed loop."""
    if isinstance(model, Mechanism):
        return model
    part = getattr(getattr(model, "parts", None), "block", None)
    if isinstance(part, Mechanism):
        return part
    raise TypeError(
        "diagnose needs a block made of an inertia and effects, or a closed_loop of one; got "
        f"{type(model).__name__}. "
        "Effects can only be added to ctrl_df.Mass and ctrl_df.TwoMass."
    )


def verdict_of(study: Study, found: list[Trial], began: float, limits=None) -> Diagnosis:
    """Confirm the best candidates and say what they amount to."""
    chosen = study.confirm(found)
    base = study.base
    best = chosen[0] if chosen else base
    # Where an encoder rounds, the errors of single samples are whole steps: free forces show in what is not
    # rounded.
    rounded = rounds(best)
    missed = lacks(base if rounded else best, study.data, study.noise)
    base_errors = _errors(base)
    keys = {c.key for c in chosen}
    weights = np.exp(
        np.clip([t.evidence - max(best.evidence, 0.0) for t in chosen] + [-max(best.evidence, 0.0)], -700, 0)
    )
    weights /= weights.sum()
    ranking = []
    for t, weight in zip(chosen, weights[:-1], strict=True):
        same = tuple(o.key for o in chosen if o is not t and study.alike(t, o))
        ranking.append(_entry(t, study, float(weight), same))
    ranking += [_entry(t, study, 0.0, ()) for t in found if t.key not in keys]
    first = ranking[0] if ranking else None
    # On records held out the errors of all parameters show, and an idle effect may make up for them by
    # chance: those fitted have to speak for themselves.
    significant = first is not None and first.evidence_fitted > SIGNIFICANT and first.evidence_holdout > HELD
    noise, structure, share = _left(best, base, missed, study)
    if rounded:
        share = 1.0 if missed and missed[0].evidence > SIGNIFICANT else 0.0
    if base_errors[0] < EXACT and not study.data.forced:
        verdict = NONE
    elif share > _LEFT:
        verdict = UNKNOWN
    elif first is None or not significant:
        verdict = NONE
    else:
        verdict = EFFECT if all(c.id in first.equivalents for c in rivals(ranking)) else AMBIGUOUS
    shown = base
    if verdict == UNKNOWN:
        # An effect that stands in for the one missing bends what it leaves: look where least remains.
        before = lacks(base, study.data, study.noise)
        if not before or (missed and missed[0].left < before[0].left):
            shown = best
        else:
            missed = before
    where = find_regions(shown, study.data.train)
    kinds = tuple(where.kinds) if where is not None else ()
    if verdict == UNKNOWN:
        kinds = tuple(m.kind for m in missed if m.evidence > 0.98 * missed[0].evidence - SIGNIFICANT)
    held = () if study.data.held.records is study.data.train.records else study.data.held.records
    result = Diagnosis(
        verdict, tuple(ranking), base.block, base.block, *base_errors, noise, structure, "", kinds, where,
        study.data.train.records, held, time.perf_counter() - began, dict(limits or {}),
        "acceleration" if study.data.forced else "output",
    )  # fmt: skip
    left = remains(result, missed) if verdict == UNKNOWN else ""
    return replace(result, explanation=explain(result, missed), remains=left)


def _left(best: Trial, base: Trial, missed, study: Study) -> tuple[float, float, float]:
    """Return the noise, the structure that the best candidate leaves (rms), and its share of what was there.

    Structure shows on the windows fitted by what free forces explain, and on those held out by an error
    beyond the noise: that of the fitted windows, times what the records' own noise floors say of the two.
    """
    structure = missed[0].rms if missed and missed[0].evidence > SIGNIFICANT else 0.0
    if not rounds(best) and not study.data.forced:
        # what the right model misses over long windows it misses over short ones
        structure = max(structure, math.sqrt(max(best.train.rmse**2 - (_GROWN * study.floor) ** 2, 0.0)))
    noise = math.sqrt(max(best.train.rmse**2 - structure**2, 0.0))
    there = math.sqrt(max(base.train.rmse**2 - noise**2, structure**2, 1e-300))
    assert best.held is not None and base.held is not None
    data = study.data
    floors = [
        math.sqrt(float(np.mean([facts(r).noise ** 2 for r in v.records]))) for v in (data.train, data.held)
    ]
    # the floors see what is fast: of two records with slow noise neither counts as the quieter one
    expected = _NOISIER * noise * max(1.0, floors[1] / floors[0])
    outside = math.sqrt(max(best.held.rmse**2 - expected**2, 0.0))
    there_outside = math.sqrt(max(base.held.rmse**2 - expected**2, outside**2, 1e-300))
    return noise, max(structure, outside), max(structure / there, outside / there_outside)


def _errors(tried: Trial) -> tuple[float, float]:
    """Return nrmse over the windows to learn from and over those to be judged by."""
    return tried.train.nrmse, tried.held.nrmse if tried.held is not None else math.nan


def _entry(t: Trial, study: Study, probability, same) -> CandidateEffect:
    effect = t.block.effects[-1]
    values = {k: p.value for k, p in effect.parameters.items()}
    key = t.block.newest
    known = t.train.standard_errors if len(t.train.covariance) else {}
    return CandidateEffect(
        effect, effect.id, *_errors(t), t.evidence, probability, values, same, t.block, t.confirmed,
        errors={k: known[f"{key}.{k}"] for k in values if f"{key}.{k}" in known},
        evidence_holdout=t.evidence_held,
    )  # fmt: skip
