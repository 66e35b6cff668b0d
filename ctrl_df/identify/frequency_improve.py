"""The ladder on measured tables N(A, omega): one effect at a time while held-out error falls beyond scatter."""

from __future__ import annotations

import time

from .diagnose import block_of, effect_classes, free_names
from .diagnosis import NONE, UNKNOWN
from .frequency_compare import as_tables
from .frequency_diagnosis import SIGNIFICANT, FrequencyStudy
from .frequency_fit import fit_table

_LESS = 0.98  # the held-out error a step must reach, relative to the one before


def improve_frequency(
    model, train, holdout=None, max_effects=5, *, candidates=None, free=None, executor=None, **keywords
):
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
    from .improve import Step, Study

    if keywords:
        raise TypeError(f"unrecognized keyword(s): {', '.join(keywords)}")
    if int(max_effects) != max_effects or max_effects < 0:
        raise ValueError(f"improve needs max_effects as an integer >= 0; got {max_effects!r}.")
    began = time.perf_counter()
    records = as_tables(train, "train")
    held = as_tables(holdout, "holdout") if holdout is not None else ()
    start = block_of(model)
    fixed = set(start.parameters) - set(free_names(start, free))
    block, steps, effect, evidence, dropped, same = start, [], "", 0.0, (), ()
    while True:
        study = FrequencyStudy(block, records, held, [k for k in free_names(block) if k not in fixed])
        if len(steps) < max_effects:
            study.screen(effect_classes(candidates), executor)
        found = study.verdict(time.perf_counter(), None)
        block = found.model
        values = {k: p.value for k, p in block.parameters.items()}
        steps.append(
            Step(effect, dropped, block, found.nrmse, found.nrmse_holdout, evidence, values, same, found)
        )
        best = found.ranking[0] if found.ranking else None
        if best is None or best.evidence < SIGNIFICANT or best.nrmse_holdout > _LESS * found.nrmse_holdout:
            break
        effect, evidence, same = best.id, best.evidence, best.equivalents
        block, dropped = _without_idle(best.model, start, study)
    verdict = UNKNOWN if found.verdict == UNKNOWN else NONE if len(steps) == 1 else "effect"
    return Study(
        tuple(steps), steps[-1].model, verdict, found.noise, start, records, held, time.perf_counter() - began
    )


def _without_idle(block, start, study):
    """Drop effects added earlier without which, all else refitted, the error stays as it is."""
    inside = study.points.take(study.train)
    dropped: list[str] = []
    own = len(start.effects)
    for old in block.effects[own:-1]:
        less = block.without_effect(old.id)
        names = [k for k in study.free if k in less.parameters]
        names += [k for k in less.parameters if k not in study.free and less.parameters[k].free and "." in k]
        fitted = fit_table(less, inside, dict.fromkeys(names), study.scales, iterations=12)
        full = study._tried("", fit_table(block, inside, (), study.scales), ())
        without = study._tried("", fitted, ())
        gain = len(study.points) * 2 * _log_ratio(study._power(without), study._power(full))
        if 0.5 * gain < SIGNIFICANT:
            block = fitted.block
            dropped.append(old.id)
    return block, tuple(dropped)


def _log_ratio(worse, better) -> float:
    import math

    return math.log(max(worse, 1e-300) / max(better, 1e-300))
