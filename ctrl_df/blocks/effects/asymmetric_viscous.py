"""Viscous friction that differs by direction."""

import math
from dataclasses import dataclass
from typing import ClassVar

from ..effect import Effect, register_effect
from ..parameter import parameter


@register_effect
@dataclass(frozen=True)
class AsymmetricViscous(Effect):
    """Viscous friction with unequal slopes: ``F = -(difference/2) |v|`` beside the mean slope of `Viscous`.

    Parameters
    ----------
    difference : float
        Slope for v > 0 minus slope for v < 0 [N s/m], either sign.

    Examples
    --------
    >>> axis = cdf.Mass(2.0).with_effect(cdf.Viscous(5.0)).with_effect(cdf.AsymmetricViscous(1.0))
    >>> [float(a) for a in axis.dynamics(0, [0.0, 0.2], [0.0])]
    [0.2, -0.55]
    """

    difference: float = parameter("N s/m", lower=-math.inf, meaning="slope forward minus slope backward")

    role: ClassVar[str] = "force"
    place_free: ClassVar[bool] = True
    proportional: ClassVar[bool] = True
    shows: ClassVar[str] = "error growing with speed, of the same sign in both directions"
    source: ClassVar[str] = "Janot, Gautier & Brunot (2019), asymmetric friction model"

    @staticmethod
    def law(t, x, v, z, p, dz):
        """Return the force [N]."""
        return -0.5 * p[0] * abs(v)
