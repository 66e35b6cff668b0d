"""What nearly every model has, recognized by its laws: an inertia, a dry friction level, a viscous slope."""

from __future__ import annotations

from ...blocks.recognized import is_dry, is_viscous


def inertia(block) -> str | None:
    """Return the name of a block's only inertia; None where it has two."""
    found = [name for name in block.parameters if "." not in name]
    return found[0] if len(found) == 1 else None


def dry_level(block) -> str | None:
    """Return the name of the level of a block's plain dry friction: the same at every speed, both ways."""
    return _first(block, is_dry)


def viscous_slope(block) -> str | None:
    """Return the name of the slope of a block's friction that is linear in speed."""
    return _first(block, is_viscous)


def _first(block, kind) -> str | None:
    for key, effect in block.named_effects.items():
        if kind(effect):
            return f"{key}.{next(iter(effect.parameters))}"
    return None
