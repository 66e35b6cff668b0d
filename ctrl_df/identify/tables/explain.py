"""A diagnosis of measured tables in plain words."""

from __future__ import annotations

import numpy as np

from ..results.diagnosis import EFFECT, NONE, UNKNOWN, Diagnosis, certainty, rivals
from ..results.explain import named, values_of
from .fit import counted, outlying


def explain_tables(d, shown) -> str:
    """Return a `FrequencyDiagnosis` in plain words; `shown` is the comparison its figures are about."""
    errors = np.concatenate([r.relative[counted(r.record)] for r in shown.records])
    far = np.count_nonzero(outlying(errors))
    text = _verdict(d)
    if far:
        text += (
            f" {far} of {len(errors)} points err by more than ten times the usual and are left out of these "
            "figures: another motion that coexists, or a bad measurement."
        )
    return text


def _verdict(d: Diagnosis) -> str:
    first = d.ranking[0] if d.ranking else None
    if d.verdict == NONE:
        return (
            f"Nothing is missing: with its parameters refitted the model errs by {d.nrmse:.2%} of |N| "
            f"(held out {d.nrmse_holdout:.2%}), which is scatter. No effect of the library improves on it "
            "beyond chance."
        )
    places = " ".join(r.sentence for r in d.where.significant[:2])
    if d.verdict == UNKNOWN or first is None:
        tried = f"The best of the library, {named(first.effect)}, leaves {first.nrmse:.2%}. " if first else ""
        return (
            f"Something outside the library is missing. The refitted model errs by {d.nrmse:.2%} of |N|; "
            f"{tried}"
            f"Neighbouring points err alike: {d.structure:.2%} beside {d.noise:.2%} of scatter. "
            f"Look here: {places or 'the error is spread over the whole plane.'}"
        )
    size = (
        f"{d.nrmse:.2%} to {first.nrmse:.2%} of |N| "
        f"(held out {d.nrmse_holdout:.2%} to {first.nrmse_holdout:.2%})"
    )
    same = ""
    if first.equivalents:
        names = ", ".join(e.replace("_", " ") for e in first.equivalents)
        same = f" On these data the same map as {names}."
    if d.verdict == EFFECT:
        sure = certainty(d.ranking)
        return (
            f"Missing: {named(first.effect)} ({values_of(first)}). With it the error falls from "
            f"{size}; "
            f"probability {sure:.1%}.{same}" + (f" Before, {places}" if places else "")
        )
    names = ", ".join(f"{named(c.effect)} ({c.probability:.0%})" for c in [first, *rivals(d.ranking)])
    return (
        f"An effect is missing, and these tables do not tell which: {names}. The first reduces the error "
        f"from {size}."
        f"{same} next_experiment gives the points of the plane that would separate them."
    )
