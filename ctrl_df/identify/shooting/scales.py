"""Typical sizes of what records hold, and of parameters by their unit."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...thresholds import NOTHING
from ..prediction.segments import facts, free_force, load_of
from ..prediction.sensed import force_scale
from .variables import typical, typical_mass


@dataclass(frozen=True)
class Scales:
    """Typical sizes of force [N], position [m], speed [m/s], mass [kg], input [N, V, A] in the records."""

    force: float
    position: float
    speed: float
    mass: float
    drive: float

    def of(self, unit: str) -> float:
        """Return the typical size of a parameter of that unit (of a machine on a line)."""
        time = self.position / self.speed
        return typical(unit, self.force, self.position, time, self.mass, self.drive)


def scales_of(block, records) -> Scales:
    """Return the typical sizes in records of a machine."""
    known = [facts(r) for r in records]
    free = max(free_force(block, r) for r in records)
    force = max(math.sqrt(np.mean([np.mean(load_of(block, r) ** 2) for r in records])), free, NOTHING)
    position = max(math.sqrt(np.mean([np.var(k.place) for k in known])), NOTHING)
    speed = max(math.sqrt(np.mean([np.mean(k.velocity**2) for k in known])), NOTHING)
    drive = math.sqrt(np.mean([np.mean(r.u**2) for r in records]))
    drive = max(drive, free / abs(force_scale(block)), NOTHING)
    return Scales(force, position, speed, typical_mass(block, force, position, speed), drive)
