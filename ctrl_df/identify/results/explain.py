"""A diagnosis in plain words: what, where, how sure, how large."""

from __future__ import annotations

from typing import Any

from .diagnosis import AMBIGUOUS, NONE, UNKNOWN, certainty, rivals


def named(effect) -> str:
    """Return an effect's id as words."""
    return effect.id.replace("_", " ")


def values_of(candidate) -> str:
    """Return a candidate's fitted parameters as text, in the units of its machine."""
    table, key = candidate.model.parameters, candidate.model.newest
    fitted = ((k, table[f"{key}.{k}"]) for k in candidate.parameters if f"{key}.{k}" in table)
    return ", ".join(f"{k.replace('_', ' ')} {p.value:.4g} {p.unit}".rstrip() for k, p in fitted)


def places(where) -> str:
    """Return the sentences of the two regions that stand out most; empty where none does."""
    return " ".join(r.sentence for r in (where.significant[:2] if where is not None else ()))


def explain(d, words) -> str:
    """Return the verdict of a `Diagnosis` in sentences; `words`: those of its data (`Words`)."""
    first: Any = d.ranking[0] if d.ranking else None
    if d.verdict == NONE:
        return (
            f"Nothing is missing: with its parameters refitted the model errs by {d.nrmse:.2%}{words.of} "
            f"(held out {d.nrmse_holdout:.2%}), which is {words.noise}. "
            "No effect of the library improves on it beyond chance."
        )
    if d.verdict == UNKNOWN:
        tried = f"The best of the library, {named(first.effect)}, leaves {first.nrmse:.2%}. " if first else ""
        return (
            f"Something outside the library is missing. The refitted model errs by {d.nrmse:.2%}{words.of}. "
            f"{tried}{d.remains}"
        )
    size = (
        f"{d.nrmse:.2%} to {first.nrmse:.2%}{words.of} (held out {d.nrmse_holdout:.2%} to "
        f"{first.nrmse_holdout:.2%})"
    )
    same = ""
    if first.equivalents:
        same = (
            " On these data the same map as "
            + ", ".join(e.replace("_", " ") for e in first.equivalents)
            + "."
        )
    if d.verdict == AMBIGUOUS:
        names = ", ".join(f"{named(c.effect)} ({c.probability:.0%})" for c in [first, *rivals(d.ranking)])
        return (
            f"An effect is missing, and these {words.data} do not tell which: {names}. The first reduces the "
            f"error from {size}.{same} next_experiment gives {words.separates} that would separate them."
        )
    where, shows = places(d.where), words.shows.format(first.effect.shows)
    return (
        f"Missing: {named(first.effect)} ({values_of(first)}).{shows} With it the error falls from {size}; "
        f"probability {certainty(d.ranking):.1%}.{same}"
        + (f" Before, {where[0].lower() + where[1:]}" if where else "")
    )


def explain_so_far(d, words) -> str:
    """Return what a `Diagnosis` under way knows."""
    size = f"So far: with its parameters refitted the model errs by {d.nrmse:.2%}{words.of}"
    if d.verdict == NONE:
        return f"{size}; nothing is missing, as far as is known."
    if d.verdict == UNKNOWN:
        return f"{size}; no effect tried yet explains that."
    first, *others = d.ranking[:4]
    behind = f", ahead of {', '.join(named(c.effect) for c in others)}" if others else ""
    how = "It is refitted and tried on what is held out" if first.confirmed else "None of them is confirmed"
    return (
        f"{size}; {named(first.effect)} explains most of that (it leaves {first.nrmse:.2%}){behind}. {how}; "
        "the diagnosis is not complete."
    )
