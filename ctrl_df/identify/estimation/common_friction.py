"""What nearly every model has, recognized by its laws: an inertia, a dry friction level, a viscous slope."""

from __future__ import annotations

import numpy as np

from ...blocks.core import is_kinetic, level

_SPEEDS = (0.5, 1.0, 3.0)


def inertia(block) -> str | None:
    """Return the name of a block's only inertia; None where it has two."""
    found = [name for name in block.parameters if "." not in name]
    return found[0] if len(found) == 1 else None


def dry_level(block) -> str | None:
    """Return the name of the level of a block's plain dry friction: the same at every speed, both ways."""
    return _first(block, _is_dry)


def viscous_slope(block) -> str | None:
    """Return the name of the slope of a block's friction that is linear in speed."""
    return _first(block, _is_viscous)


def _first(block, kind) -> str | None:
    for key, effect in block.named_effects.items():
        if effect.proportional and kind(effect):
            return f"{key}.{next(iter(effect.parameters))}"
    return None


def unit_of(effect):
    """Return the effect with its first parameter at one."""
    return effect.replace(**{next(iter(effect.parameters)): 1.0})


def _is_dry(effect) -> bool:
    if not is_kinetic(effect):
        return False
    one = unit_of(effect)
    return all(level([one], 1.0, way, v) == 1.0 for v in _SPEEDS for way in (1.0, -1.0))


def _is_viscous(effect) -> bool:
    if effect.role != "force" or not effect.place_free or effect.states:
        return False
    law, p, none = type(effect).law, unit_of(effect).values, np.zeros(1)
    return all(law(0.0, 0.0, way * v, none, p, none.copy()) == -way * v for v in _SPEEDS for way in (1, -1))
