"""Adding an effect to a block: whether it can change anything, and what the block then is."""

from __future__ import annotations

import dataclasses

from ...blocks.core import kinetic_level
from ...blocks.effect import SIDED
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


def divisions(block):
    """Yield a rigid block with what acts on it divided otherwise between motor and load; they move alike.

    Of a rigid machine nobody has said on which side of a joint a weight hangs, or a bearing drags. Weights go
    to the load; beside them every friction alone, and all.
    """
    movable = [e for e in block.effects if e.role in SIDED and e.side == "motor"]
    weights = {e.id for e in movable if e.usual_side == "load"}
    friction = [e.id for e in movable if e.id not in weights and (e.role == "friction" or e.place_free)]
    found: list[set] = []
    for more in (set(), *({key} for key in friction), set(friction)):
        if (there := weights | more) and there not in found:
            found.append(there)
            yield block.with_effects([e.replace(side="load") if e.id in there else e for e in block.effects])


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
