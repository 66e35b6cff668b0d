"""The ladder on measured tables N(A, omega): one effect at a time while points held out speak for it."""

from __future__ import annotations

import time

from ..data.records import as_tables
from ..diagnose import block_of, effect_classes
from ..results.ladder import Found, Study, climb, last_diagnosis, outcome
from .diagnosis import SIGNIFICANT, FrequencyStudy, worth


def improve_frequency(
    model, train, holdout=None, max_effects=5, *, candidates=None, free=None, executor=None, **keywords
) -> Study:
    """Add effects to a model one at a time, from tables; see `ctrl_df.improve`.

    Parameters
    ----------
    model : block or closed loop
    train : FrequencyMeasurement or sequence of them
    holdout : FrequencyMeasurement, sequence or None
        None: every third point is held out.
    max_effects : int
        Longest ladder, >= 0.
    candidates, free, executor
        As for `ctrl_df.diagnose`.

    Returns
    -------
    Study
        Errors are relative to ``|N|``.
    """
    if keywords:
        raise TypeError(f"unrecognized keyword(s): {', '.join(keywords)}")
    began = time.perf_counter()
    records = as_tables(train, "train")
    held = as_tables(holdout, "holdout") if holdout is not None else ()
    start, classes = block_of(model), effect_classes(candidates)

    def ask(block, names, search):
        asked = time.perf_counter()
        study = FrequencyStudy(block, records, held, names)
        if search:
            study.screen(classes, executor)
        found = study.verdict(asked, None)
        return Found(
            found,
            bool(found.ranking) and worth(found.ranking[0]),
            lambda b, ids: _without_idle(b, ids, study),
        )

    steps = climb(start, free, max_effects, ask)
    noise = last_diagnosis(steps).noise
    return Study(
        steps, steps[-1].model, outcome(steps), noise, start, records, held, time.perf_counter() - began
    )


def _without_idle(block, added, study):
    """Drop effects added earlier without which, all else refitted, the error stays as it is."""
    dropped: list[str] = []
    for key in added:
        less = block.without_effect(key)
        last = less.newest + "."
        names = [k for k, p in less.parameters.items() if k in study.free or (k.startswith(last) and p.free)]
        without = study.refitted(less, names)
        if study.evidence(study.refitted(block, ()), without) < SIGNIFICANT:
            block = without.fitted.block
            dropped.append(key)
    return block, tuple(dropped), ()
