"""Which simulator runs a model on a record: driven by a force, or moved."""

from __future__ import annotations

from ..data.imposed import imposes_motion
from .imposed import ImposedSimulator
from .simulator import Simulator


def simulator_of(model, record, **keywords) -> Simulator:
    """Return a model on a record, ready to be run; `keywords` as of `Simulator`."""
    kind = ImposedSimulator if imposes_motion(record) else Simulator
    return kind(model, record, **keywords)
