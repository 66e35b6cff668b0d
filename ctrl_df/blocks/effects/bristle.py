"""Presliding: friction that yields before it slides."""

import math
from dataclasses import dataclass
from typing import ClassVar

from ..core import is_kinetic
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
    table_starts: ClassVar[int] = 2
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

    @classmethod
    def applicable(cls, block):
        """Return whether there is a kinetic level under which they slip: without one they are a spring."""
        return any(map(is_kinetic, block.effects))

    @classmethod
    def suggest(cls, screen):
        """Return bristles that friction bends by shares of the stroke (presliding: by more), half damped."""
        s = screen.scales
        for bend in (0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0):
            k = max(screen.friction, 0.05 * s.force) / (bend * s.position)
            yield cls(k, 0.5 * math.sqrt(k * s.mass))

    @classmethod
    def suggest_on_plane(cls, plane):
        """Yield bristles that the friction bends by shares of the amplitudes."""
        for bend in plane.amplitude.over(6, 0.3, 0.3):
            stiffness = max(plane.friction, 0.02 * plane.force.high) / bend
            for ratio in (0.1, 0.6):
                yield cls(stiffness, ratio * math.sqrt(stiffness * plane.mass)), 1.0

    def ranges(self, seen):
        """Return what does not settle much faster than a sample: that is not seen, and a stiff equation."""
        stiffness = 2 * seen.force / (seen.speed * seen.dt)
        return {"stiffness": (0.0, stiffness), "damping": (0.0, 2 * seen.mass / seen.dt)}
