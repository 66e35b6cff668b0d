"""The ladder: one effect at a time while held-out error falls beyond noise."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from .diagnose import HELD, SIGNIFICANT, as_records, block_of, effect_classes, free_names, verdict_of
from .diagnosis import NONE, UNKNOWN, Diagnosis
from .evidence import ranked
from .study import Study as Fits
from .trial import Trial


@dataclass(frozen=True, eq=False)
class Step:
    """One model of the ladder.

    Attributes
    ----------
    effect : str
        Id of the effect added; empty for the refitted start.
    dropped : tuple of str
        Ids that this effect made idle.
    model : block
    nrmse, nrmse_holdout : float
        Over windows with fitted starts.
    evidence : float
        Log likelihood ratio over the step before [nats].
    parameters : dict
        All parameters of the model.
    equivalents : tuple of str
        Ids that would have done the same.
    diagnosis : Diagnosis
        What was asked of the model of this step.
    """

    effect: str
    dropped: tuple[str, ...]
    model: Any
    nrmse: float
    nrmse_holdout: float
    evidence: float
    parameters: Mapping[str, float]
    equivalents: tuple[str, ...] = ()
    diagnosis: Diagnosis | None = None


@dataclass(frozen=True, eq=False)
class Study:
    """Outcome of `improve`.

    Attributes
    ----------
    steps : tuple of Step
        The refitted start first.
    model : block
        The improved one.
    verdict : {'none', 'effect', 'unknown'}
        Nothing was missing; what was missing is found; something remains that the library does not explain.
    noise : float
        Noise over the rms of the centred output: the floor no model gets below.
    """

    steps: tuple[Step, ...]
    model: Any
    verdict: str
    noise: float
    start: Any
    train: tuple
    holdout: tuple
    seconds: float = 0.0

    @property
    def effects(self) -> tuple[str, ...]:
        """Ids of the effects that were added and kept."""
        before = list(self.start._keys)
        return tuple(k for k in self.model._keys if k not in before)

    def table(self) -> str:
        """Return one line a step."""
        lines = [f"{'step':<30} {'nrmse':>9} {'held out':>9} {'evidence':>10}"]
        for step in self.steps:
            name = f"+ {step.effect}" if step.effect else "refitted"
            name += "".join(f" - {d}" for d in step.dropped)
            lines.append(f"{name:<30} {step.nrmse:>9.3g} {step.nrmse_holdout:>9.3g} {step.evidence:>10.1f}")
        lines.append(f"{'noise floor':<30} {self.noise:>9.3g}")
        return "\n".join(lines)

    def summary(self) -> str:
        """Return the outcome in plain words."""
        first, last = self.steps[0], self.steps[-1]
        if self.verdict == NONE:
            head = (
                f"Nothing is missing: with refitted parameters the model errs by {first.nrmse:.2%}, "
                "the noise of these data."
            )
        else:
            added = ", ".join(e.replace("_", " ") for e in self.effects) or "nothing"
            head = (
                f"Added: {added}. The error falls from {first.nrmse:.2%} to {last.nrmse:.2%}, on held-out data from "
                f"{first.nrmse_holdout:.2%} to {last.nrmse_holdout:.2%} (noise {self.noise:.2%})."
            )
        if self.verdict == UNKNOWN and last.diagnosis is not None:
            head += " " + last.diagnosis.explanation
        lines = [head, "", self.table(), ""]
        for name, p in self.model.parameters.items():
            lines.append(f"  {name:<30} {p.value:>12.6g} {p.unit}")
        return "\n".join(lines)

    def plot(self, **keywords):
        """Draw the error of every step beside the noise; returns a ``ct.ControlPlot``."""
        from ..plot.ladder import plot_ladder

        return plot_ladder(self, **keywords)

    def report(self, path) -> str:
        """Write one self-contained HTML file and return its path."""
        from .report import write_report

        return write_report(self, path)

    def __str__(self) -> str:
        return self.summary()


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
    import time

    if keywords:
        raise TypeError(f"unrecognized keyword(s): {', '.join(keywords)}")
    from .frequency_compare import has_tables

    if has_tables(train):
        from .frequency_improve import improve_frequency

        return improve_frequency(
            model, train, holdout, max_effects, candidates=candidates, free=free, executor=executor
        )
    if int(max_effects) != max_effects or max_effects < 0:
        raise ValueError(f"improve needs max_effects as an integer >= 0; got {max_effects!r}.")
    began = time.perf_counter()
    records = as_records(train, "train")
    held = as_records(holdout, "holdout") if holdout is not None else ()
    start = block_of(model)
    kept = set(start.parameters) - set(free_names(start, free))
    block, steps, effect, evidence, dropped, same = start, [], "", 0.0, (), ()
    diagnosis = None
    while True:
        names = tuple(k for k in free_names(block) if k not in kept)
        fits = Fits(block, records, held, names)
        found = fits.candidates(effect_classes(candidates), executor) if len(steps) < max_effects else []
        diagnosis = verdict_of(fits, found, time.perf_counter())
        block = diagnosis.model
        values = {k: p.value for k, p in block.parameters.items()}
        steps.append(
            Step(
                effect,
                dropped,
                block,
                diagnosis.nrmse,
                diagnosis.nrmse_holdout,
                evidence,
                values,
                same,
                diagnosis,
            )
        )
        best = diagnosis.ranking[0] if diagnosis.ranking else None
        if best is None or best.evidence_fitted < SIGNIFICANT or best.evidence_holdout < HELD:
            break
        effect, evidence, same = best.id, best.evidence, best.equivalents
        block, dropped = _without_idle(best.model, start, fits, names)
    # The windows of a diagnosis are as long as its best model bears: steps are compared over those of the last.
    common = fits.data.fine
    errors = [common.errors(step.model) for step in steps]
    steps = [replace(s, nrmse=e, nrmse_holdout=h) for s, (e, h) in zip(steps, errors, strict=True)]
    spread = math.sqrt(
        sum(float((r.y - r.y.mean()) @ (r.y - r.y.mean())) for r in records) / sum(map(len, records))
    )
    verdict = UNKNOWN if diagnosis.verdict == UNKNOWN else NONE if len(steps) == 1 else "effect"
    return Study(
        tuple(steps),
        steps[-1].model,
        verdict,
        diagnosis.noise / spread,
        start,
        records,
        held,
        time.perf_counter() - began,
    )


def _without_idle(block, start, fits, names):
    """Drop effects added earlier that the last one made idle: without them the error stays as it is."""
    dropped: list[str] = []
    data, own = fits.data, set(start._keys)
    for key in [k for k in block._keys[:-1] if k not in own]:
        less = block.without_effect(key)
        free = [k for k in free_names(less) if k in set(names) or k.startswith(less._keys[-1] + ".")]
        fits.base = data.judged(Trial("", data.fit(less, free, iterations=8)))
        full_free = [k for k in free_names(block) if k in set(names) or k.startswith(block._keys[-1] + ".")]
        whole = data.judged(
            Trial(key, data.fit(block, full_free, iterations=4), extra=len(full_free) - len(free))
        )
        if ranked(fits.base, [whole])[0][0].evidence < SIGNIFICANT:
            block = fits.base.block
            dropped.append(key)
    return block, tuple(dropped)
