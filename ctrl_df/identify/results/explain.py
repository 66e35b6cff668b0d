"""A diagnosis in plain words: what, where, how sure, how large."""

from __future__ import annotations

from typing import Any

from ...numerals import certainty as sure
from ...numerals import digits, percent
from ...values.per_record import PerRecord
from .diagnosis import AMBIGUOUS, NONE, UNKNOWN, certainty, rivals
from .thresholds import SHOWN_PROBABILITY


def named(effect) -> str:
    """Return an effect's id as words, and the load where it acts on that unlike others of its class."""
    return _words(effect.id) + (f" on the {effect.side}" if effect.side != type(effect).side else "")


def _words(name: str) -> str:
    return name.replace("_", " ")


def values_of(candidate) -> str:
    """Return a candidate's fitted parameters as text, in the units of its machine."""
    table, key = candidate.model.parameters, candidate.model.newest
    fitted = ((k, table[f"{key}.{k}"]) for k in candidate.parameters if f"{key}.{k}" in table)
    return ", ".join(f"{k.replace('_', ' ')} {_value(p)}" for k, p in fitted)


def _value(p) -> str:
    if isinstance(p.value, PerRecord):
        return "a value for each record"
    return f"{digits(p.value, 4)} {p.unit}".rstrip()


def places(where) -> str:
    """Return the sentences of the two regions that stand out most; empty where none does."""
    return " ".join(r.sentence for r in (where.significant[:2] if where is not None else ()))


def unconfirmed(first) -> str:
    """Return that the held-out data do not confirm an effect that the fitted data favour."""
    return (
        f"The fitted data favour {named(first.effect)} (log-likelihood higher by "
        f"{first.evidence_fitted:.0f}), but the held-out data do not confirm it "
        f"({first.evidence_holdout:.1f}): it may not act in them. Hold out a record in which it acts."
    )


def contradict(first, rival) -> str:
    """Return that the fitted data favour the first effect, and the held-out data a rival."""
    fitted = first.evidence_fitted - rival.evidence_fitted
    held_out = rival.evidence_holdout - first.evidence_holdout
    return (
        f"The fitted data favour {named(first.effect)} (log-likelihood higher by {fitted:.0f}), the held-out "
        f"data {named(rival.effect)} (by {held_out:.0f}): possibly neither is all that is missing."
    )


def explain(d, words, refuted: str = "") -> str:
    """Return the verdict of a `Diagnosis` in sentences.

    `words`: those of its data (`Words`). `refuted`, of nothing missing: how the effect that short segments
    speak for fails in free prediction.
    """
    first: Any = d.ranking[0] if d.ranking else None
    if d.verdict == NONE:
        # more likely than nothing: how the sensor records, which is said with the noise
        likely = first is not None and 2 * first.probability > 1
        chance = "" if likely else "No effect of the library improves on it beyond chance."
        return (
            "Nothing is missing: with its parameters refitted the model errs by "
            f"{percent(d.nrmse)}{words.of} (held out {percent(d.nrmse_holdout)}), which is {words.noise}. "
            + (refuted or chance)
        ).rstrip()
    if d.verdict == UNKNOWN:
        tried = "No effect of the library lowers this error."
        if first is not None and first.nrmse < d.nrmse:
            tried = (
                f"With the best effect of the library, {named(first.effect)}, the error is "
                f"{percent(first.nrmse)}.{sensed_side(d, first)}"
            )
        return (
            "No single effect explains what is missing: it may be several effects, which improve adds one "
            "after the other, or something outside the library. The refitted model errs by "
            f"{percent(d.nrmse)}{words.of}. " + " ".join(filter(None, (tried, *d.doubts, d.remains)))
        )
    size = (
        f"{percent(d.nrmse)} to {percent(first.nrmse)}{words.of} (held out {percent(d.nrmse_holdout)} to "
        f"{percent(first.nrmse_holdout)})"
    )
    same = ""
    if first.equivalents:
        same = (
            " These data cannot distinguish it from "
            + ", ".join(e.replace("_", " ") for e in first.equivalents)
            + "."
        )
    same += sensed_side(d, first)
    if d.verdict == AMBIGUOUS:
        open_ones = [first, *rivals(d.ranking)]
        shared = [c for c in d.ranking if c not in open_ones and c.probability > SHOWN_PROBABILITY]
        names = ", ".join(f"{named(c.effect)} ({c.probability:.0%})" for c in [*open_ones, *shared])
        doubts = "".join(f" {s}" for s in d.doubts)
        alone = len(open_ones) + len(shared) == 1
        which, it, separate = (
            ("confirm it", "It", "decide") if alone else ("tell which", "The first", "separate them")
        )
        likely = 2 * sum(c.probability for c in [*open_ones, *shared]) > 1
        missing = "is missing, and" if likely else "may be missing, but"
        return (
            f"An effect {missing} these {words.data} do not {which}: {names}. {it} reduces the error "
            f"from {size}.{same}{doubts} next_experiment gives {words.separates} that would {separate}."
        )
    where, shows = places(d.where), words.shows.format(first.model.coordinates.text(first.effect.shows))
    doubts = "".join(f" {s}" for s in d.doubts)
    which = " of it and its equivalents" if first.equivalents else ""
    return (
        f"Missing: {named(first.effect)} ({values_of(first)}).{shows} With it the error falls from {size}; "
        f"probability {sure(certainty(d.ranking))}{which}."
        f"{same}{doubts}" + (f" Without it, {where[0].lower() + where[1:]}" if where else "")
    )


def sensed_side(d, first) -> str:
    """Return what a candidate that adds a joint takes for the side of the sensor, and of effects."""
    there = f"With {named(first.model.effects[-1])}"
    moved = f" {sentence}" if (sentence := moved_to_load(first.model, d.model, there)) else ""
    if first.model.core.bodies == d.model.core.bodies:
        return moved
    side = first.model.measured
    other = "motor" if side == "load" else "load"
    return (
        f" The sensor is assumed to measure the {side}; if it measures the {other}, give the model "
        f'measured="{other}".{moved}'
    )


def moved_to_load(model, given, there: str) -> str:
    """Return which effects of a model given act on the load in another, in a sentence; or an empty one."""
    before = given.named_effects
    moved = [_words(k) for k, e in model.named_effects.items() if k in before and e.side != before[k].side]
    acts = "acts" if len(moved) == 1 else "act"
    return f"{there} {' and '.join(moved)} {acts} on the load." if moved else ""


def falls_behind(first, long) -> str:
    """Return how the first of a ranking predicts over long horizons (`LongPrediction`)."""
    if long.horizon == 0:
        return (
            "In free prediction, with internal states continued from segment to segment, neither "
            f"{named(first.effect)} nor any other candidate follows the motion: with it the error is "
            f"{long.errors[first.id]:.0%} already over the shortest horizon."
        )
    who = [(f"with {_words(n)}" if n else "without it", long.errors[n]) for n in long.better]
    others = " and ".join(f"{percent(error)} {name}" for name, error in who)
    return (
        f"In free prediction over {long.horizon:.3g} s, with internal states continued from segment to "
        f"segment, the error is {percent(long.errors[first.id])} with {named(first.effect)}, but {others}: "
        "its agreement over short segments proves nothing."
    )


def left_out(first, long) -> str:
    """Return why the search was repeated without the first of a ranking (`LongPrediction`)."""
    return f"{falls_behind(first, long)} The search was therefore repeated without {named(first.effect)}."


def leaves(first, second) -> str:
    """Return what the diagnosis `second` of the model with the first effect says of what that leaves."""
    left = f"The residual with {named(first.effect)} is more than noise"
    if second.verdict == UNKNOWN or not second.ranking:
        return f"{left}, and no second effect of the library explains it."
    also = named(second.ranking[0].effect)
    return f"{left}: {also} is missing as well. improve() adds effects one after the other."


def grows(short: float, error: float, seconds: float, effect=None) -> str:
    """Return that a model which follows short segments does not follow long ones, refitted to these.

    `effect`: what it was given, and what is therefore not all that is missing.
    """
    who = "The refitted model" if effect is None else f"With {named(effect)} the model"
    more = "" if effect is None else ": something else is missing, too"
    return (
        f"{who} follows short segments with an error of {percent(short)}, but not long ones: refitted to "
        f"segments of {seconds:.3g} s its error is {percent(error)}{more}."
    )


def explains_nothing() -> str:
    """Return that a model explains nothing of the motion, whatever its parameters."""
    return f"The model explains nothing of this motion. {_UNITS}"


def followed_when_fitted(tried) -> str:
    """Return that a fitted model errs by noise on the data fitted, and by more on those held out."""
    return (
        f"The model follows the fitted data to their noise ({percent(tried.train.nrmse)}), but not the "
        f"held-out data ({percent(tried.validation.nrmse)}): what is missing acts in the latter. Fit these, "
        "and hold out the others or a further record."
    )


def far_off(fitted, names, stated) -> str:
    """Return that the model without an effect explains more with parameters far from those stated."""
    now, before = fitted.block.parameters, stated.parameters
    values = ", ".join(
        f"{k} {digits(now[k].value)} {now[k].unit} in place of {digits(before[k].value)}" for k in names
    )
    return f"Without any effect, but with {values}, the model errs by {percent(fitted.train.nrmse)}. {_UNITS}"


def runs_ahead(seconds: float) -> str:
    """Return that the motion comes before the force that would explain it."""
    return (
        f"A force recorded {digits(seconds)} s earlier would explain more of the motion: check whether force "
        "and motion were recorded by one clock."
    )


_UNITS = "Check the units of record and model."


def undetermined(first) -> str:
    """Return which parameters of an effect the data do not determine."""
    names = " and ".join(k.replace("_", " ") for k in first.undetermined)
    return f"These data do not determine the {names} of {named(first.effect)}."


def displaces(first) -> str:
    """Return which parameters of the model an effect drives to a bound."""
    return (
        f"With {named(first.effect)}, parameters of the model itself reach a bound of their range "
        f"({_values(first.model, first.displaced)}): {named(first.effect)} may stand in for wrong values of "
        "these."
    )


def driven_to_bounds(model, start) -> str:
    """Return which parameters of the model that a ladder began with ended at a bound; empty: none."""
    inside = {k for k, p in start.parameters.items() if not _stands_at_bound(p)}
    ended = [k for k, p in model.parameters.items() if k in inside and _stands_at_bound(p)]
    if not ended:
        return ""
    return (
        f"Parameters of the initial model ended at a bound of their range ({_values(model, ended)}): the "
        "effects added stand in for them, and the values of these effects mean little by themselves."
    )


def _stands_at_bound(p) -> bool:
    return p.value in (p.lower, p.upper)


def _values(model, names) -> str:
    """Return the values of parameters in a line."""
    table = model.parameters
    return " and ".join(f"{k} at {digits(table[k].value)} {table[k].unit}".strip() for k in names)


def explain_so_far(d, words) -> str:
    """Return what a `Diagnosis` under way knows."""
    size = f"So far: with its parameters refitted the model errs by {percent(d.nrmse)}{words.of}"
    if d.verdict == NONE:
        return f"{size}; so far nothing seems to be missing."
    if d.verdict == UNKNOWN and 0 < d.noise >= d.structure:
        return f"{size}, most of which may be noise; whether anything is missing is not known yet."
    if d.verdict == UNKNOWN:
        return f"{size}; no effect tried so far explains this error."
    first, *others = d.ranking[:4]
    behind = f" (next: {', '.join(named(c.effect) for c in others)})" if others else ""
    # what is only screened errs over some of the segments: no error to be compared with that of the model
    refitted = f"With it the error is {percent(first.nrmse)}, validated on held-out data"
    how = refitted if first.confirmed else "None of them is confirmed yet"
    best = f"{named(first.effect)} explains more of it than other effects{behind}"
    return f"{size}; {best}. {how}; the diagnosis is not complete."
