"""The ladder: one effect at a time while held-out error falls beyond noise."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

from ..checks import count, unknown_keywords
from ..checks import executor as checked_executor
from .arguments import check_held_out
from .data.records import as_records, has_tables
from .diagnose import HELD, SIGNIFICANT, block_of, effect_classes, free_names, verdict_of
from .estimation.trial import Trial
from .results.diagnosis import NONE
from .results.ladder import Found, Step, Study, climb, last_diagnosis, outcome
from .selection.evidence import ranked
from .selection.structure_search import Study as Fits
from .starting.attach import attach

RIVALS = 2
"""Candidates of a step that are tried again when a later step is taken."""


def improve(
    model, train, holdout=None, max_effects=5, *, candidates=None, free=None, executor=None, **keywords
) -> Study:
    """Add the effects a model misses, one at a time, as long as held-out error falls beyond noise.

    Parameters
    ----------
    model : block or closed loop
        Where to begin.
    train : Measurement or sequence
        Records to fit.
    holdout : Measurement, sequence or None
        Records to confirm on; None: every third part of the training records.
    max_effects : int
        Longest ladder, >= 0.
    candidates, free, executor
        As for `diagnose`.

    Returns
    -------
    Study

    Examples
    --------
    >>> names = ["constant_force", "quadratic_drag"]
    >>> t = np.arange(0, 4, 0.01)
    >>> F = 9 * np.sin(3 * t) + 5 * np.sin(8 * t)
    >>> machine = cdf.friction_mass(2.2, 3.0, 6.0).with_effect(cdf.ConstantForce(1.0))
    >>> x = np.asarray(cdf.event_response(machine, t, F, input_hold="zoh").outputs)[0]
    >>> record = cdf.Measurement(t, F, x + 1e-4 * np.random.default_rng(1).standard_normal(t.size))
    >>> study = cdf.improve(cdf.friction_mass(2.0, 2.5, 5.0), record, candidates=names)
    >>> study.verdict, study.effects
    ('effect', ('constant_force',))
    """
    unknown_keywords(keywords)
    max_effects = count("improve", "max_effects", max_effects, least=0, meaning="longest ladder")
    checked_executor("improve", executor)
    if has_tables(train):
        from .tables.improve import improve_frequency

        return improve_frequency(
            model, train, holdout, max_effects, candidates=candidates, free=free, executor=executor
        )
    began = time.perf_counter()
    records = as_records(train, "train")
    held = as_records(holdout, "holdout") if holdout is not None else ()
    check_held_out(records, held)
    start, classes = block_of(model), effect_classes(candidates)
    last: Any = None
    rivals: dict[str, list] = {}

    def ask(block, names, search):
        nonlocal last
        asked = time.perf_counter()
        last = fits = Fits(block, records, held, names)
        found = verdict_of(fits, fits.candidates(classes, executor) if search else [], asked)
        best = found.ranking[0] if found.ranking else None
        worth = (
            best is not None
            and found.verdict != NONE
            and best.evidence_fitted >= SIGNIFICANT
            and best.evidence_holdout >= HELD
        )
        known = set(found.model.parameters) - set(names)
        if best is not None and worth:
            confirmed = [c.effect for c in found.ranking[1:] if c.confirmed and c.evidence > SIGNIFICANT]
            rivals[best.model.newest] = confirmed[:RIVALS]
        return Found(found, worth, lambda block, ids: _revised(block, ids, fits, known, rivals))

    steps = climb(start, free, max_effects, ask)
    # The windows of a diagnosis are as long as its best model bears: steps are compared over those of the
    # last.
    common = last.data.fine
    if common.forced:
        known = set(start.parameters) - set(free_names(start, free))
        steps = [_sharpened(s, common, known) for s in steps]
    errors = [common.errors(step.model) for step in steps]
    steps = tuple(replace(s, nrmse=e, nrmse_holdout=h) for s, (e, h) in zip(steps, errors, strict=True))
    base = last.base.train
    noise = last_diagnosis(steps).noise * base.nrmse / base.rmse
    return Study(
        steps, steps[-1].model, outcome(steps), noise, start, records, held, time.perf_counter() - began
    )


def _sharpened(step: Step, data, known) -> Step:
    """Return a step with parameters that wandering forces blur least; `known` ones stay as they are."""
    if data.carries(step.model):
        return step
    names = [k for k in free_names(step.model) if k not in known]
    model = data.brief.fit(step.model, names).model
    return replace(step, model=model, parameters={k: p.value for k, p in model.parameters.items()})


def _revised(block, added, fits, known, rivals):
    """Look again at effects added earlier, beside the last one of the block.

    Those without which the error stays as it is are dropped. Those that stood in for something else, too,
    give way to another candidate of their own step that does better now, or as well with fewer parameters:
    `rivals`, effects by the id chosen. `known`: parameters that are not to be refitted.
    """
    dropped: list[str] = []
    instead: list[str] = []
    data = fits.data

    def fitted(model, iterations):
        free = [k for k in free_names(model) if k not in known]
        found = data.fit(model, free, iterations=iterations)
        return data.judged(Trial(model.newest, found, extra=len(free)))

    for key in added:
        less = fitted(block.without_effect(key), 8)
        tried = [fitted(block, 4)]
        for effect in rivals.get(key, ()):
            other = attach(less.block, effect)
            if other is not None:
                tried.append(fitted(other, 8))
        tried = [replace(t, extra=t.extra - less.extra) for t in tried]
        judged, _ = ranked(less, tried)
        kept = next(t for t in judged if t.block is tried[0].block)
        if judged[0].evidence < SIGNIFICANT:
            block = less.block
            dropped.append(key)
        elif judged[0].evidence > kept.evidence + (0.0 if judged[0].extra < kept.extra else SIGNIFICANT):
            block = judged[0].block
            dropped.append(key)
            instead.append(block.newest)
        if key in dropped:
            fits.base = less
    return block, tuple(dropped), tuple(instead)
