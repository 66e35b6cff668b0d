"""The search over records of a base that moves, seen from the base."""

from __future__ import annotations

from .structure_search import StructureSearch


class MovingBaseSearch(StructureSearch):
    """The fits of one diagnosis of a mass on a base that moves.

    The input is inertia: no drive makes it, and where the mass is divided it acts on every part. A sensor in
    space (`in_space`) saw another motion than the one relative to the base.
    """

    def __init__(self, *arguments, in_space: bool):
        super().__init__(*arguments)
        self.in_space = in_space

    def applies(self, effect) -> bool:
        """Whether an effect acts between the base and one body, or is of a sensor on the base."""
        elsewhere = ("input", "coupling", *(["output"] if self.in_space else []))
        return super().applies(effect) and effect.role not in elsewhere and not effect.divides
