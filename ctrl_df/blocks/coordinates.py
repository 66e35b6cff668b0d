"""How a machine moves, on a line or about an axis: what its quantities are called, and their units."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import lru_cache

from ..units import dimension, turning


@dataclass(frozen=True)
class Coordinates:
    """Words, signal names and units of one kind of motion.

    Attributes
    ----------
    position, velocity, force, inertia, stroke : str
        What the quantities are called.
    reach : str
        What a limit of the distance from the start is called.
    unit : str
        Of the position.
    names : dict
        Signal of a machine on a line (``x``, ``v``, ``F``) to that of this one.
    """

    position: str
    velocity: str
    force: str
    inertia: str
    stroke: str
    reach: str
    unit: str
    names: dict[str, str] = field(default_factory=dict, hash=False)

    def name(self, signal: str) -> str:
        """Return what a signal of a machine on a line is called here: ``angle_motor`` for ``x_motor``."""
        stem, _, rest = signal.partition("_")
        return self.names.get(stem, stem) + (f"_{rest}" if rest else "")

    def unit_of(self, unit: str) -> str:
        """Return the unit that stands for one of a machine on a line, such as N m/rad for N/m."""
        return unit if self is LINE else turning(unit)

    def text(self, words: str) -> str:
        """Return words about a machine on a line as those about this one: ``a torque`` for ``a force``."""
        return words if self is LINE else _SAID.sub(self._said, words)

    def _said(self, found: re.Match) -> str:
        article, word, plural = found["article"] or "", found["word"], found["plural"]
        other = getattr(self, _QUANTITIES[word.lower()])
        other = other.capitalize() if word[0].isupper() else other
        if article:
            article = article[0] + ("n " if other[0] in "aeiou" else " ")
        if not plural:
            return article + other
        return article + (f"{other[:-1]}ies" if other.endswith("y") else f"{other}s")

    @property
    def force_unit(self) -> str:
        """Unit of the input."""
        return self.unit_of("N")


_QUANTITIES = {
    "position": "position", "velocity": "velocity", "velocitie": "velocity", "force": "force",
    "mass": "inertia", "stroke": "stroke",
}  # fmt: skip
_SAID = re.compile(
    rf"\b(?P<article>[Aa]n? )?(?P<word>{'|'.join(_QUANTITIES)})(?P<plural>e?s)?\b", re.IGNORECASE
)


@lru_cache(maxsize=256)
def either(unit: str, turns: bool) -> str:
    """Return the unit of what may belong to a machine of either kind; `turns`: to one that turns alone."""
    other = turning(unit)
    return unit if unit == other else (other if turns else f"{unit} on a line, {other} about an axis")


LINE = Coordinates("position", "velocity", "force", "mass", "stroke", "stroke", "m")
AXIS = Coordinates(
    "angle", "speed", "torque", "inertia", "travel", "angle", "rad",
    {"x": "angle", "v": "speed", "F": "torque"},
)  # fmt: skip


def moving_in(unit: str) -> Coordinates:
    """Return how what has a position in this unit moves; for records, which say it by their units."""
    return AXIS if "rad" in dimension(unit) else LINE
