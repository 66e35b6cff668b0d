"""Adding an effect to a block: whether it can change anything, and what the block then is."""

from __future__ import annotations

import dataclasses

from ...blocks.core import is_kinetic, kinetic_level
from ..estimation.simulator import feasible, tied


def applicable(cls, block) -> bool:
    """Whether adding an effect of this class to the block can change anything."""
    ids = [e.id for e in block.effects]
    if cls.id in ids and not cls.repeatable:
        return False
    two = block.core.bodies == 2
    if not cls.applicable(block):
        return False
    if cls.id == "load_friction":
        return two  # on a rigid block it is Coulomb friction
    if cls.id == "sensor_offset":
        return tied(block)  # elsewhere it is where windows begin
    if cls.id == "bristle":
        # they slip under a kinetic level: without one they are a spring
        return any(map(is_kinetic, block.effects))
    if cls.id == "backlash":
        return "compliance" not in ids or cls.id not in ids
    return not (cls.role == "coupling" and two and "compliance" in ids)


def attach(block, effect):
    """Return the block with the effect added, or None where the two contradict each other."""
    try:
        grown = block.with_effect(effect)
    except (ValueError, TypeError):
        if not hasattr(effect, "level"):
            return None
        try:
            lifted = dataclasses.replace(effect, level=max(effect.level, kinetic_level(block.effects)))
            grown = block.with_effect(lifted)
        except (ValueError, TypeError):
            return None
    if effect.id == "coulomb":
        # a static level must stay above the new kinetic one
        grown = grown.with_parameters(feasible(grown, {}))
    return grown
