"""Searches over records of kinematic excitation: a motion that is imposed, or a base that moves."""

from __future__ import annotations

import math
from dataclasses import replace

from ...blocks.massless import without_answer
from ..thresholds import ONLY_NOISE
from .confirmation import over
from .structure_search import StructureSearch


class ImposedSearch(StructureSearch):
    """The fits of one diagnosis in force.

    Whatever force is missing stands in the residual as it is: nothing integrates it, so that disturbance
    forces are noise like any other. What is hidden goes on over the whole record: segments tell which samples
    count, nothing is restarted in them, and their length makes no difference.
    """

    def segmentations(self, data):
        """Return the data in segments of one length; errors far beyond the usual one count linearly only."""
        return 3 * [replace(data, robust=True).segmentations[1]]

    def disturbs(self, error, data):
        """Whether disturbance forces make an error of the output that hides all else: none does here."""
        return False

    def applies(self, effect) -> bool:
        """Whether an effect answers a motion with a force."""
        return super().applies(effect) and without_answer([effect]) is None

    @property
    def measure(self) -> str:
        """What errors are of."""
        return "force"

    def stages(self, at, fits):
        """Return the fits over all segments, once."""
        there = over(at.data, fits, fits, math.inf)
        return [there], ONLY_NOISE * min(f.rmse for f in there if f is not None)


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
