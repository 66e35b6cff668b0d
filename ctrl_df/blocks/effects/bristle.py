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
    def law(v, level, z, p, dz):
        """Return the force [N] of bristles bent by z[0], under a dry friction of `level` [N]."""
        g = level + p[2]
        rate = v
        if g > 0.0 and not math.isinf(g):
            rate -= p[0] * abs(v) * z[0] / g
        dz[0] = rate
        return -(p[0] * z[0] + p[1] * rate)

    def steady(self, level):
        """Return how far they are bent where they slip [m]."""
        return ((level + self.level) / self.stiffness,)
