"""The ladder: one effect at a time while held-out error falls beyond noise."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

from .diagnose import HELD, SIGNIFICANT, block_of, effect_classes, free_names, verdict_of
from .evidence import ranked
from .ladder import Found, Study, climb, last_diagnosis, outcome
from .records import as_records, has_tables
from .study import Study as Fits
from .trial import Trial


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
    """
    if keywords:
        raise TypeError(f"unrecognized keyword(s): {', '.join(keywords)}")
    if has_tables(train):
        from .frequency_improve import improve_frequency

        return improve_frequency(
            model, train, holdout, max_effects, candidates=candidates, free=free, executor=executor
        )
    began = time.perf_counter()
    records = as_records(train, "train")
    held = as_records(holdout, "holdout") if holdout is not None else ()
    start, classes = block_of(model), effect_classes(candidates)
    last: Any = None

    def ask(block, names, search):
        nonlocal last
        asked = time.perf_counter()
        last = fits = Fits(block, records, held, names)
        found = verdict_of(fits, fits.candidates(classes, executor) if search else [], asked)
        best = found.ranking[0] if found.ranking else None
        worth = best is not None and best.evidence_fitted >= SIGNIFICANT and best.evidence_holdout >= HELD
        return Found(found, worth, lambda block, ids: _without_idle(block, ids, fits, names))

    steps = climb(start, free, max_effects, ask)
    # The windows of a diagnosis are as long as its best model bears: steps are compared over those of the
    # last.
    common = last.data.fine
    errors = [common.errors(step.model) for step in steps]
    steps = tuple(replace(s, nrmse=e, nrmse_holdout=h) for s, (e, h) in zip(steps, errors, strict=True))
    base = last.base.train
    noise = last_diagnosis(steps).noise * base.nrmse / base.rmse
    return Study(
        steps, steps[-1].model, outcome(steps), noise, start, records, held, time.perf_counter() - began
    )


def _without_idle(block, added, fits, names):
    """Drop effects added earlier that the last one made idle: without them the error stays as it is."""
    dropped: list[str] = []
    data = fits.data
    for key in added:
        less = block.without_effect(key)
        free = [k for k in free_names(less) if k in set(names) or k.startswith(less._keys[-1] + ".")]
        fits.base = data.judged(Trial("", data.fit(less, free, iterations=8)))
        full_free = [k for k in free_names(block) if k in set(names) or k.startswith(block._keys[-1] + ".")]
        whole = data.judged(
            Trial(key, data.fit(block, full_free, iterations=4), extra=len(full_free) - len(free))
        )
        if ranked(fits.base, [whole], data.block)[0][0].evidence < SIGNIFICANT:
            block = fits.base.block
            dropped.append(key)
    return block, tuple(dropped)
