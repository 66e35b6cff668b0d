"""Which simulator runs a model on a record: driven by a force, or moved."""

from __future__ import annotations

from ..data.imposed import imposes_motion
from ..thresholds import RTOL_COARSE, RTOL_FINEST
from .imposed import ImposedSimulator
from .segments import facts
from .simulator import Simulator
from .thresholds import RTOL_OVER_NOISE


def simulator_of(model, record, **keywords) -> Simulator:
    """Return a model on a record, ready to be run; `keywords` as of `Simulator`."""
    kind = ImposedSimulator if imposes_motion(record) else Simulator
    return kind(model, record, **keywords)


def tolerance(record, accelerations: bool = False) -> float:
    """Return the relative tolerance of simulations whose distance from a record is minimized.

    `accelerations`: whether that of its second differences is, which magnify what simulations err by.
    """
    if accelerations:
        return RTOL_FINEST
    known = facts(record)
    return min(max(RTOL_OVER_NOISE * known.noise / known.spread, RTOL_FINEST), RTOL_COARSE)
