"""Presliding: friction that yields before it slides."""

import math
from dataclasses import dataclass
from typing import ClassVar

from ..effect import Effect, register_effect
from ..parameter import parameter


@register_effect
@dataclass(frozen=True)
class Bristle(Effect):
    """LuGre bristles carry the block's dry friction, and `level` more: they bend before they slip.

    ``dz/dt = v - stiffness |v| z / g(v)``, ``F = -(stiffness z + damping dz/dt)``, with g(v) the kinetic
    level of all the block's dry friction (Coulomb, Stribeck, ...) plus `level`. The set-valued sticking is
    replaced by the bristle's own spring. Where g = 0 the bristle never slips: a plain spring and damper.

    Parameters
    ----------
    stiffness : float
        Bristle stiffness sigma0 [N/m], > 0.
    damping : float
        Bristle damping sigma1 [N s/m], >= 0.
    level : float
        Level in addition to the block's dry friction [N], >= 0.

    Examples
    --------
    >>> axis = cdf.Mass(2.0).with_effect(cdf.Coulomb(3.0)).with_effect(cdf.Bristle(5e4, damping=300))
    >>> axis.nstates  # position, speed, bend of the bristles
    3
    """

    stiffness: float = parameter("N/m", strict=True, meaning="bristle stiffness")
    damping: float = parameter("N s/m", default=0.0, meaning="bristle damping")
    level: float = parameter("N", default=0.0, free=False, meaning="level beyond the block's dry friction")

    role: ClassVar[str] = "presliding"
    multimodal: ClassVar[bool] = True
    states: ClassVar[int] = 1
    shows: ClassVar[str] = (
        "error around every reversal, where the real friction builds up over a small stroke"
    )
    source: ClassVar[str] = "Canudas de Wit, Olsson, Astrom & Lischinsky (1995), eqs. (1)-(4)"

    @staticmethod
    def rate(v, z, g, p):
        """Return dz/dt [m/s] for velocity `v`, deflection `z`, level `g` [N]."""
        if g <= 0.0 or math.isinf(g):
            return v
        return v - p[0] * abs(v) * z / g
