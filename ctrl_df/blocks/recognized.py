"""Common laws of friction, recognized by what they give: a copy under another name counts as they do."""

from __future__ import annotations

import numpy as np

from .core import is_kinetic, level
from .thresholds import PARAMETER_ASKED, SPEEDS_ALIKE


def unit_of(effect):
    """Return the effect with its first parameter at one."""
    return effect.replace(**{next(iter(effect.parameters)): 1.0})


def is_dry(effect) -> bool:
    """Whether an effect is plain dry friction of the motor: its first parameter at every speed, both ways."""
    if not is_kinetic(effect) or effect.asks or not effect.proportional:
        return False
    one = unit_of(effect)
    return all(level([one], 1.0, way, v) == 1.0 for v in SPEEDS_ALIKE for way in (1.0, -1.0))


def is_viscous(effect) -> bool:
    """Whether an effect is a force against the speed, of its first parameter a metre per second."""
    if effect.role != "force" or not effect.place_free or effect.states or not effect.proportional:
        return False
    law, p, none = type(effect).law, unit_of(effect).values, np.zeros(1)
    return all(
        law(0.0, 0.0, way * v, none, p, none.copy()) == -way * v for v in SPEEDS_ALIKE for way in (1, -1)
    )


def is_static(effect) -> bool:
    """Whether an effect is the level alone at which a motor at rest breaks away, no less than the kinetic."""
    if effect.role != "friction" or effect.side != "motor" or effect.asks or len(effect.values) != 1:
        return False
    law, static = type(effect).law, PARAMETER_ASKED
    return all(
        law(1.0, way, v, base, (static,)) == base and law(0.0, way, 0.0, base, (static,)) == max(base, static)
        for base in (static / 2, static, 2 * static)
        for v in SPEEDS_ALIKE
        for way in (1.0, -1.0)
    )
