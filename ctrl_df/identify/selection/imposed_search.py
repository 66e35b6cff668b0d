"""The search over records of an imposed motion: errors are of the force itself."""

from __future__ import annotations

from dataclasses import replace

from ...blocks.massless import without_answer
from .structure_search import StructureSearch


class ImposedSearch(StructureSearch):
    """The fits of one diagnosis in force.

    Whatever force is missing stands in the residual as it is: nothing integrates it, so that disturbance
    forces are noise like any other.
    """

    def _look_at(self, data, which):
        super()._look_at(replace(data, robust=True), which)

    def disturbs(self, error, data):
        """Whether disturbance forces make an error of the output that hides all else: none does here."""
        return False

    def candidates(self, classes, executor=None):
        """Return every effect that answers a motion with a force, fitted, that of most evidence first."""
        return super().candidates([c for c in classes if without_answer([c]) is None], executor)

    @property
    def measure(self) -> str:
        """What errors are of."""
        return "force"
