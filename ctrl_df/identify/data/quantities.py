"""What a recorded channel is of: quantities, the words for them, and their units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...checks import choice, shown
from ...units import dimension, si_unit

UNITS: Mapping[str, tuple[str, ...]] = {
    "position": ("m", "rad"),
    "velocity": ("m/s", "rad/s"),
    "acceleration": ("m/s^2", "rad/s^2"),
    "force": ("N", "N m"),
    "voltage": ("V",),
    "current": ("A",),
}
"""Quantities, and the units each may have: on a line, about an axis."""

OTHER = "signal"
"""What a channel is of whose unit tells none of these."""

_OF_MOTOR = "_motor"  # ends the names of outputs of the motor, where a block has a load, too
_MOTION = ("position", "velocity", "acceleration")
_WORDS: Mapping[str, tuple[tuple[str, ...], str]] = {
    "position": (("position",), "m"), "x": (("position",), "m"), "angle": (("position",), "rad"),
    "velocity": (("velocity",), "m/s"), "v": (("velocity",), "m/s"), "speed": (("velocity",), "rad/s"),
    "acceleration": (("acceleration",), "m/s^2"),
    "force": (("force",), "N"), "F": (("force",), "N"), "torque": (("force",), "N m"),
    "voltage": (("voltage",), "V"), "current": (("current",), "A"), "motion": (_MOTION, "m"),
}  # fmt: skip


def quantity_of(unit: str) -> str:
    """Return the quantity that has this unit; `OTHER` where none has."""
    powers = dimension(unit)
    return next((q for q, units in UNITS.items() if any(dimension(u) == powers for u in units)), OTHER)


def word_of(unit: str, usual: str = "output") -> str:
    """Return what a channel in this unit is called: a velocity, or a speed where something turns."""
    return next((word for word, (_, own) in _WORDS.items() if own == unit), usual)


def stated(keyword: str, word: str | None, unit: str | None, usual: str) -> tuple[str, float, str]:
    """Return quantity, factor to SI and SI unit of a channel.

    Parameters
    ----------
    keyword : str
        What the message calls the channel: ``output``, ``input``.
    word : str or None
        The quantity, by any of its names; None: the unit decides.
    unit : str or None
        None: the usual one of the quantity, `usual` where that is not named either.
    usual : str
    """
    if word is None:
        unit = usual if unit is None else unit
        return quantity_of(unit), *si_unit(unit)
    if isinstance(word, str) and word.endswith(_OF_MOTOR):
        raise ValueError(
            f"a record holds the motion of one body; got {keyword} {word!r}. Give the motor's sensor a "
            f"record of its own, as {word.removesuffix(_OF_MOTOR)!r}, and the model measured='motor'; the "
            "load's sensor belongs to another record, for the model with measured='load'."
        )
    choice("Measurement", keyword, word, _WORDS)
    meant, own = _WORDS[word]
    unit = own if unit is None else unit
    found = quantity_of(unit)
    if found not in meant:
        units = " or ".join(u for q in meant for u in UNITS[q])
        raise ValueError(
            f"{keyword}={word!r} needs a unit such as {units}; got {keyword}_unit={shown(unit)}. "
            "State the unit as it was recorded, or another quantity."
        )
    return found, *si_unit(unit)


def between_samples(into: str, out: str, hold: str) -> str:
    """Return what an input in unit `into` does between samples, `hold` being stated, as a word or a few.

    What is imposed, or moves a base, is a motion and smooth; a place or a speed may be the reference of a
    loop, too.
    """
    given = quantity_of(into)
    if given not in _MOTION:
        return hold
    if given == "acceleration" or quantity_of(out) not in _MOTION:
        return "smooth"
    return f"{hold} as a reference, smooth as the motion of a base"


def with_unit(channel) -> tuple[Any, str | None]:
    """Return array and unit of a channel given as an array or as a pair of both."""
    if isinstance(channel, tuple | list) and len(channel) == 2 and isinstance(channel[1], str):
        return channel[0], channel[1]
    return channel, None


def leading(outputs: Mapping[str, object]) -> str:
    """Return the quantity of several that stands for the record: the position, or the first."""
    return "position" if "position" in outputs else next(iter(outputs))
