"""What the laws of a model make of a motion: the columns of a regression of the force."""

from __future__ import annotations

import numpy as np

from ...blocks.core import level
from ...blocks.recognized import unit_of
from ..estimation.common_friction import dry_level, viscous_slope

Columns = tuple[tuple[str, np.ndarray], ...]
"""Force [N] that a law takes, each with the parameter that it is proportional to; "" where there is none."""


def own_columns(block, u, x, v) -> Columns:
    """Return what a block's laws take of the force besides plain dry and viscous friction.

    A law that is proportional to its first parameter is taken for a parameter of one. Laws with states of
    their own, joints and contacts are left out: the motion alone does not determine them.

    Parameters
    ----------
    block : Mechanism
    u, x, v : (n,) arrays
        Force of the drive, place, speed.
    """
    found = []
    plain = (dry_level(block), viscous_slope(block))
    load = -sum((force_of(e, x, v) for e in block.effects if tells(e)), np.zeros(len(v)))
    chain = sorted((e for e in block.effects if e.role == "friction"), key=lambda e: e.rank)
    for key, effect in block.named_effects.items():
        name = f"{key}.{next(iter(effect.parameters), '')}"
        if name in plain:
            continue
        one = unit_of(effect) if effect.proportional else effect
        if tells(effect):
            column = -force_of(one, x, v)
        elif effect.role == "friction":
            before = chain[: chain.index(effect)]
            column = np.sign(v) * (_level([*before, one], u, x, v, load) - _level(before, u, x, v, load))
        else:
            continue
        if np.any(column):
            found.append((name if effect.proportional else "", column))
    return tuple(found)


def allowed(block, columns: Columns, weights) -> dict[str, float]:
    """Return the parameters that weights of `own_columns` stand for, where they lie in their ranges."""
    table, values = block.parameters, {}
    for (name, _), weight in zip(columns, weights, strict=True):
        if name and table[name].lower <= weight <= table[name].upper and weight != 0:
            values[name] = float(weight)
    return values


def tells(effect) -> bool:
    """Whether the force of an effect is a function of the motion alone."""
    return effect.role == "force" and effect.states == 0


def force_of(effect, x, v) -> np.ndarray:
    """Return the force of an effect along +x, (n,)."""
    law, p, none = type(effect).law, effect.values, np.zeros(1)
    return np.array([law(0.0, *at, none, p, none) for at in zip(x.tolist(), v.tolist(), strict=True)])


def acts_along(effect) -> bool:
    """Whether what an effect does to a body that moves is a function of place and speed."""
    return tells(effect) or (effect.role == "friction" and set(effect.asks) <= {"x"})


def force_along(effect, x, v) -> np.ndarray:
    """Return the force along +x of an effect that `acts_along`, (n,); of friction, with none beside it."""
    if effect.role != "friction":
        return force_of(effect, x, v)
    none = np.zeros(len(v))
    return -np.sign(v) * _level([effect], none, x, v, none)


def _level(chain, u, x, v, load) -> np.ndarray:
    """Return the level of friction effects that slip, (n,)."""
    signals = (np.sign(v), np.abs(v), x, u, load)
    rows = zip(*(s.tolist() for s in signals), strict=True)
    return np.array([level(chain, 1.0, *row) for row in rows])
