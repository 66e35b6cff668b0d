"""What compare, refit, diagnose and improve may be asked, checked before any work begins."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ..blocks.effect import Effect, effect_class, effect_library
from ..blocks.massless import Massless
from ..blocks.mechanism import Mechanism
from ..blocks.stated import stated_parameters
from ..checks import count, flag, known_name, mapping, names, number, positive, shown
from ..simulate.imposed_response import imposable
from ..units import dimension
from .data.imposed import imposes_motion
from .data.measurement import Measurement
from .data.quantities import quantity_of, word_of
from .prediction.sensed import OUTPUT_COLUMNS
from .shooting.variables import default_free
from .starting.extend import why_not
from .thresholds import ON_SAMPLE, SEGMENT_SAMPLES

MODES = ("auto", "free", "windows")


def free_parameters(block, free=None) -> tuple[str, ...]:
    """Return the parameters that a fit moves: those named, all of an effect named by its id, or the usual."""
    return default_free(block) if free is None else _parameters(block, "free", free)


def own_parameters(block, own) -> tuple[str, ...]:
    """Return the parameters that every record has for itself, named as `free` names them."""
    return () if own is None else _parameters(block, "own", own)


def known_beforehand(block, moved, prior, *, grows=True) -> dict[str, tuple[float, float]]:
    """Return value and standard deviation of parameters of a model, or of effects that it may be given.

    `moved`: its parameters that are estimated; `grows`: whether it may be given effects.
    """
    found = {}
    for name, stated in ({} if prior is None else mapping("prior", "prior", prior, _PRIOR)).items():
        effect = effect_library().get(str(name).partition(".")[0])
        may_be = [f"{effect.id}.{k}" for k, _ in stated_parameters(effect)] if effect and grows else []
        if name not in block.parameters and name not in may_be:
            others = ", or of a parameter of an effect that may be added, such as 'stribeck.level'"
            remedy = "Correct it." if grows else "Add its effect to the model, or leave it out."
            raise ValueError(
                f"prior needs names out of {', '.join(block.parameters)}{others if grows else ''}; got "
                f"{shown(name)}. {remedy}"
            )
        if name in block.parameters and name not in moved:
            raise ValueError(
                f"prior needs parameters that are estimated, here {', '.join(moved)}; got {shown(name)}, "
                "which keeps its value. Name it in free as well, or leave it out."
            )
        pair = tuple(stated) if isinstance(stated, Sequence) and not isinstance(stated, str) else (stated,)
        if len(pair) != 2:
            raise ValueError(
                f"prior needs a value and its standard deviation; got {shown(stated)} for {name}. Write "
                f"prior={_PRIOR}."
            )
        value = number("prior", f"the value of {name}", pair[0])
        found[name] = (value, positive("prior", f"the standard deviation of {name}", pair[1]))
    return found


_PRIOR = "{'mass': (2.0, 0.05)}"


def with_those(free, own) -> tuple[str, ...]:
    """Return all parameters that a fit moves: shared ones, and those that every record has for itself."""
    return tuple(dict.fromkeys((*free, *own)))


def _parameters(block, argument, given) -> tuple[str, ...]:
    table, chosen = block.parameters, []
    for name in names("a fit", argument, given):
        group = [k for k in table if k.startswith(f"{name}.")] if name not in table else [name]
        group = [k for k in group if table[k].free or k == name]
        if not group:
            raise ValueError(
                f"{argument} needs names out of {', '.join(table)}, or ids of the model's effects; got "
                f"{name!r}."
            )
        chosen += [k for k in group if k not in chosen]
    return tuple(chosen)


def parametric(block):
    """Return a block whose parameters have names; TypeError for others."""
    if hasattr(block, "with_parameters") and hasattr(block, "parameters"):
        return block
    raise TypeError(
        f"refit needs a block with named parameters (ctrl_df.Mass, Inertia, ...); got "
        f"{type(block).__name__}. Build it from an inertia and effects."
    )


def mechanism_of(model) -> Mechanism:
    """Return the mechanism of a block or of a closed loop."""
    if isinstance(model, Mechanism):
        return model
    part = getattr(getattr(model, "parts", None), "block", None)
    if isinstance(part, Mechanism):
        return part
    raise TypeError(
        "diagnose needs a block made of an inertia and effects, or a closed_loop of one; got "
        f"{type(model).__name__}. Effects can only be added to ctrl_df.Mass, TwoMass, Inertia, TwoInertias "
        "and Massless."
    )


def effect_classes(candidates: Any) -> list[Any]:
    """Return effect classes by id or as given; None: the whole library."""
    if candidates is None:
        return list(effect_library().values())
    several = isinstance(candidates, Iterable) and not isinstance(candidates, str | Mapping)
    given: list[Any] = list(candidates) if several else [candidates]
    if not given:
        raise ValueError("candidates needs one effect id at least; got none. Leave it out for the library.")
    return [
        c if isinstance(c, type) and issubclass(c, Effect) else effect_class(c)  # pyright: ignore[reportArgumentType]
        for c in given
    ]


def check_candidates(classes: Sequence[Any], block) -> None:
    """Check that one of the candidates at least can be added to the model."""
    reasons = {cls.id: why_not(cls, block) for cls in classes}
    if all(reasons.values()):
        listed = ", ".join(f"{id} ({reason})" for id, reason in reasons.items())
        raise ValueError(
            f"candidates needs an effect that can be added to the model; got {listed}. Name others, leave it "
            "out for the library, or refit the effects that the model has."
        )


def check_mode(mode) -> None:
    """Check whether and how records are divided into segments."""
    if not isinstance(mode, str) or mode not in MODES:
        raise (ValueError if isinstance(mode, str) else TypeError)(
            f"mode must be one of {', '.join(MODES)}; got {shown(mode)}. Leave it out for auto."
        )


def check_segment_length(records: Sequence[Measurement], mode, window) -> None:
    """Check how records are divided into segments: the mode, and a length that holds samples enough."""
    check_mode(mode)
    if window is None:
        return
    length = number(
        "a comparison", "window", window, "s", remedy="Leave it out for one that fits the motion."
    )
    for record in records:
        if not length >= SEGMENT_SAMPLES * record.dt * (1 - ON_SAMPLE):
            raise ValueError(
                f"window needs a length >= {SEGMENT_SAMPLES * record.dt:g} s ({SEGMENT_SAMPLES} samples of "
                f"{record.name!r}); got window={window!r}. Leave it out for one that fits the motion."
            )
    longest = max(records, key=lambda record: record.duration)
    if length > longest.duration * (1 + ON_SAMPLE):
        raise ValueError(
            f"window needs a length <= {longest.duration:g} s, the duration of {longest.name!r}; got "
            f"window={window!r}. Take mode='free' for whole records."
        )


def check_fit(block, start, robust, budget) -> None:
    """Check start values, and how a fit is to be done."""
    flag("refit", "robust", robust)
    count("refit", "budget", budget, meaning="bound on the simulations")
    if start is not None:
        block.with_parameters(mapping("refit", "start", start, "{'coulomb.level': 5.0}"))


def check_quantities(model, records) -> None:
    """Check that records hold what the model takes, and outputs of it; all of them the same outputs.

    A loop may be driven by the reference, in the unit of its position.
    """
    closed = getattr(model, "parts", None) is not None
    block = model.parts.block if closed else model
    if not isinstance(block, Mechanism):
        return  # nothing is known of its signals
    _check_motions(records)
    if isinstance(block, Massless) or any(imposes_motion(r) for r in records):
        return _check_imposed(block, records, closed)
    given = block.signals
    label = block.input_labels[0]
    taken = [given[label], *([block.coordinates.unit] if closed else [])]
    said = _words(block)
    for record in records:
        units = _units(record)
        for quantity, unit in units.items():
            known = said.get(quantity)
            if known is None or dimension(unit) != dimension(known[1]):
                gives = " and ".join(f"{_article(word)} [{u}]" for word, u in said.values())
                raise ValueError(
                    f"this model gives {gives}; the output of {record.name!r} is in {unit or 'no unit'}. "
                    f"State output_unit= as it was recorded (such as m{block.coordinates.unit}), or keep "
                    "what a model does not give in channels=."
                )
        if all(dimension(record.input_unit) != dimension(unit) for unit in taken):
            raise ValueError(
                f"this model takes {_article(_driven_by(block))} [{given[label]}]; the input of "
                f"{record.name!r} is in {record.input_unit or 'no unit'}. State input_unit= as it was "
                f"recorded, convert it to {given[label]} first, or give a model driven by voltage or current "
                "its motor constant (TorqueConstant)."
            )
        if units.keys() != _units(records[0]).keys():
            raise ValueError(
                f"records that are fitted together need the same outputs; {records[0].name!r} has "
                f"{', '.join(_units(records[0]))} and {record.name!r} {', '.join(units)}. Treat them "
                "separately."
            )


def _units(record) -> Mapping[str, str]:
    """Return the unit of each output, by quantity; of a table of its one."""
    return getattr(record, "units", None) or {quantity_of(record.output_unit): record.output_unit}


def _words(block: Mechanism) -> dict[str, tuple[str, str]]:
    """Return what a record may hold of a mechanism: word and unit by quantity."""
    moves = block.coordinates
    words = (moves.position, moves.velocity)
    return {quantity: (words[column], list(block.signals.values())[1:][column])
            for quantity, column in OUTPUT_COLUMNS.items()}  # fmt: skip


def _driven_by(block: Mechanism) -> str:
    """Return the word for the input of a mechanism."""
    quantity = quantity_of(block.signals[block.input_labels[0]])
    return block.coordinates.force if quantity == "force" else quantity


def _check_motions(records) -> None:
    """Check that a motion that is imposed was recorded as a place: laws may know it."""
    for record in records:
        given = quantity_of(record.input_unit)
        if quantity_of(record.output_unit) == "force" and given in _INTEGRALS:
            place = "rad" if "rad" in record.input_unit else "m"
            raise ValueError(
                f"record {record.name!r} has an imposed {given} [{record.input_unit}] as input and the "
                f"{word_of(record.output_unit)} that it took as output; a motion is imposed as a position. "
                f"{_INTEGRALS[given]} (scipy.integrate.cumulative_trapezoid(u, t, initial=0)), without the "
                f'drift of an offset, and give that as u with input_unit="{place}"; a velocity that was '
                "measured goes along as velocity=."
            )


_INTEGRALS: Mapping[str, str] = {"velocity": "Integrate it once", "acceleration": "Integrate it twice"}


def _check_imposed(block, records, closed) -> None:
    """Check that records hold the motion that is imposed on a block, and the force that it took."""
    moves = block.coordinates
    if closed:
        raise ValueError(
            "a loop is driven by its reference; got a record of an imposed motion. Give the block alone."
        )
    imposable(block)
    for record in records:
        for what, unit, there in (
            ("input", moves.unit, record.input_unit),
            ("output", moves.force_unit, record.output_unit),
        ):
            if dimension(there) != dimension(unit):
                raise ValueError(
                    f"under an imposed motion this model takes {_article(moves.position)} [{moves.unit}] and "
                    f"gives {_article(moves.force)} [{moves.force_unit}]; the {what} of {record.name!r} is "
                    f"in {there or 'no unit'}. State {what}_unit= as it was recorded; "
                    + moves.text("for a record of force in, motion out give the block a mass.")
                )


def _article(word: str) -> str:
    return f"an {word}" if word[0] in "aeiou" else f"a {word}"


def limit_units(block: Mechanism) -> dict[str, str]:
    """Return the unit of each limit of an experiment: of the input, of the distance from the start."""
    moves = block.coordinates
    return {_driven_by(block): block.signals[block.input_labels[0]], moves.reach: moves.unit}


def check_limits(owner: str, block: Mechanism, limits) -> dict[str, float]:
    """Return what the next experiment may do to the machine, in the words of its motion."""
    units = limit_units(block)
    example = str(dict.fromkeys(units, 1.0))
    return {
        known_name(owner, "limits", name, units): positive(owner, name, value, units[name])
        for name, value in mapping(owner, "limits", {} if limits is None else limits, example).items()
    }


def check_held_out(records, validation) -> None:
    """Check that no record is both fitted and held out."""
    for record in validation:
        if any(record is other for other in records):
            raise ValueError(
                f"holdout needs records that are not fitted; got {shown(record.name)} in both. "
                "Leave holdout out to hold out every third part."
            )
