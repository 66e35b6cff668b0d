"""Adding an effect to a block: whether it can change anything, and what the block then is."""

from __future__ import annotations

import dataclasses

from ...blocks.core import kinetic_level
from ...blocks.stated import static_levels


def applicable(cls, block) -> bool:
    """Whether adding an effect of this class to the block says anything new."""
    return not why_not(cls, block)


def why_not(cls, block) -> str:
    """Return why adding an effect of this class to the block says nothing new; empty where it does."""
    if cls.id in [e.id for e in block.effects] and not cls.repeatable:
        return "the model has it"
    if cls.side == "load" and block.core.bodies == 1:
        return "the model has no load of its own"  # on a rigid block it is one of the motor
    return "" if cls.applicable(block) else "it does not apply to this model"


def loaded(block, before):
    """Return a block with what usually acts on the load there; None where nothing moves.

    `before`: the block without its newest effect. Only where that has loosened a joint: of a machine that was
    rigid nobody has said on which side a weight hangs.
    """
    if before.core.loose or not block.core.loose:
        return None
    moved = [e.replace(side="load") if e.usual_side == "load" != e.side else e for e in block.effects]
    return None if moved == [*block.effects] else block.with_effects(moved)


def extended(block, effect):
    """Return the block with the effect added, or None where the two contradict each other.

    Static levels of the effect below the block's kinetic one are raised to it.
    """
    kinetic = kinetic_level(block.effects)
    low = {k: kinetic for k in static_levels(type(effect)) if getattr(effect, k) < kinetic}
    try:
        return block.with_effect(dataclasses.replace(effect, **low) if low else effect)
    except (ValueError, TypeError):
        return None
