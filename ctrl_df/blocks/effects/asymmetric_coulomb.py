"""Dry friction that differs by direction."""

import math
from dataclasses import dataclass
from typing import ClassVar

from ..core import is_kinetic
from ..effect import Effect, register_effect
from ..parameter import parameter


@register_effect
@dataclass(frozen=True)
class AsymmetricCoulomb(Effect):
    """Dry friction with unequal levels: half of `difference` more for v > 0, half of it less for v < 0.

    Together with a Coulomb level this is the same map as a constant force of ``-difference/2``; alone, the
    level it would make negative is zero.

    Parameters
    ----------
    difference : float
        Level for v > 0 minus level for v < 0 [N], either sign.

    Examples
    --------
    >>> axis = cdf.Mass(2.0).with_effect(cdf.Coulomb(3.0)).with_effect(cdf.AsymmetricCoulomb(1.0))
    >>> axis.parameters["asymmetric_coulomb.difference"].unit
    'N'
    """

    difference: float = parameter("N", lower=-math.inf, meaning="level forward minus level backward")

    role: ClassVar[str] = "friction"
    proportional: ClassVar[bool] = True
    affine: ClassVar[bool] = True
    rank: ClassVar[int] = 1
    shows: ClassVar[str] = "a constant error whose two directions of motion do not mirror each other"
    source: ClassVar[str] = "Janot, Gautier & Brunot (2019), asymmetric friction model"

    @staticmethod
    def law(moving, direction, speed, base, p):
        """Return the level [N]."""
        return max(base + 0.5 * direction * p[0], 0.0)

    @classmethod
    def applicable(cls, block):
        """Return whether there is a kinetic level that differs.

        Without one it is friction in one direction alone: the map of a Coulomb level and a constant force.
        """
        return any(map(is_kinetic, block.effects))

    @classmethod
    def suggest_on_plane(cls, plane):
        """Yield shares of the friction, of either sign."""
        size = plane.friction or 0.3 * plane.force.low
        for f in (0.1, 0.4, 0.8, -0.1, -0.4, -0.8):
            yield cls(f * size), 1.0
