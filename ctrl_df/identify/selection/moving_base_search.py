"""The search over records of a base that moves, seen from the base."""

from __future__ import annotations

from .structure_search import StructureSearch


class MovingBaseSearch(StructureSearch):
    """The fits of one diagnosis of a mass on a base that moves.

    The input is inertia: no drive makes it, and where the mass is divided it acts on every part.
    """

    def applies(self, effect) -> bool:
        """Whether an effect acts between the base and one body, or is of its sensor."""
        return super().applies(effect) and effect.role not in ("input", "coupling") and not effect.divides
