"""A diagnosis in plain words: what, where, how sure, how large."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..estimation.segments import facts
from .diagnosis import certainty, rivals


def find_regions(tried, view):
    """Return the regions of error of a fitted candidate on its longest record."""
    from ..residuals.regions import error_regions

    i = max(range(len(view.records)), key=lambda k: len(view.records[k]))
    record, inside, residual = view.records[i], view.windows[i].samples, np.asarray(tried.train.residual[i])
    if not np.all(np.isfinite(residual)):
        return None
    colour = tried.train.colour
    if colour is not None:
        windows = view.windows[i].slices
        inside, residual = inside[colour.rows(windows)], colour.seen(residual, windows) / tried.train.unit
    return error_regions(
        record.t[inside], residual, position=record.y[inside], velocity=facts(record).velocity[inside],
        force=record.u[inside],
    )  # fmt: skip


def named(effect) -> str:
    """Return an effect's id as words."""
    return effect.id.replace("_", " ")


def values_of(candidate) -> str:
    """Return a candidate's fitted parameters as text, in the units of its machine."""
    table, key = candidate.model.parameters, candidate.model.newest
    fitted = ((k, table[f"{key}.{k}"]) for k in candidate.parameters if f"{key}.{k}" in table)
    return ", ".join(f"{k.replace('_', ' ')} {p.value:.4g} {p.unit}".rstrip() for k, p in fitted)


def remains(diagnosis, missed) -> str:
    """Return how much the library does not explain, what it acts like, and where it shows, in sentences."""
    d = diagnosis
    acts = f"It acts like {missed[0].sentence}. " if missed and missed[0].evidence > 0 else ""
    return (
        f"Of structure {d.structure:.2g} remains beside {d.noise:.2g} of noise (rms of the {d.measure}). "
        f"{acts}{_where(d)}".rstrip()
    )


def _where(d) -> str:
    return " ".join(r.sentence for r in (d.where.significant[:2] if d.where is not None else ()))


def explain(diagnosis, missed) -> str:
    """Return the verdict in sentences."""
    d = diagnosis
    first: Any = d.ranking[0] if d.ranking else None
    if d.verdict == "none":
        return (
            f"Nothing is missing: with its parameters refitted the model errs by {d.nrmse:.2%} (held out "
            f"{d.nrmse_holdout:.2%}), which is the noise of these data. "
            "No effect of the library improves on it beyond chance."
        )
    where = _where(d)
    if d.verdict == "unknown":
        tried = f"The best of the library, {named(first.effect)}, leaves {first.nrmse:.2%}. " if first else ""
        return (
            f"Something outside the library is missing. The refitted model errs by {d.nrmse:.2%}. {tried}"
            f"{remains(d, missed)}"
        )
    size = f"{d.nrmse:.2%} to {first.nrmse:.2%} (held out {d.nrmse_holdout:.2%} to {first.nrmse_holdout:.2%})"
    same = ""
    if first.equivalents:
        same = (
            " On these data the same map as "
            + ", ".join(e.replace("_", " ") for e in first.equivalents)
            + "."
        )
    if d.verdict == "effect":
        sure = certainty(d.ranking)
        return (
            f"Missing: {named(first.effect)} ({values_of(first)}). It shows as {first.effect.shows}. "
            f"With it the error falls from {size}; probability {sure:.1%}.{same}"
            + (f" Before, {where[0].lower() + where[1:]}" if where else "")
        )
    names = ", ".join(f"{named(c.effect)} ({c.probability:.0%})" for c in [first, *rivals(d.ranking)])
    return (
        f"An effect is missing, and these data do not tell which: {names}. The first reduces the error from "
        f"{size}."
        f"{same} next_experiment gives an input that would separate them."
    )
