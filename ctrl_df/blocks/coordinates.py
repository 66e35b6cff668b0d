"""How a machine moves, on a line or about an axis: what its quantities are called, and their units."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..units import turning


@dataclass(frozen=True)
class Coordinates:
    """Words, signal names and units of one kind of motion.

    Attributes
    ----------
    position, velocity, force, inertia : str
        What the quantities are called.
    unit : str
        Of the position.
    names : dict
        Signal of a machine on a line (``x``, ``v``, ``F``) to that of this one.
    """

    position: str
    velocity: str
    force: str
    inertia: str
    unit: str
    names: dict[str, str] = field(default_factory=dict, hash=False)

    def name(self, signal: str) -> str:
        """Return what a signal of a machine on a line is called here: ``angle_motor`` for ``x_motor``."""
        stem, _, rest = signal.partition("_")
        return self.names.get(stem, stem) + (f"_{rest}" if rest else "")

    def unit_of(self, unit: str) -> str:
        """Return the unit that stands for one of a machine on a line, such as N m/rad for N/m."""
        return unit if self is LINE else turning(unit)

    @property
    def force_unit(self) -> str:
        """Unit of the input."""
        return self.unit_of("N")


LINE = Coordinates("position", "velocity", "force", "mass", "m")
AXIS = Coordinates("angle", "speed", "torque", "inertia", "rad", {"x": "angle", "v": "speed", "F": "torque"})
