"""A constant force."""

import math
from dataclasses import dataclass
from typing import ClassVar

from ..effect import Effect, register_effect
from ..parameter import parameter


@register_effect
@dataclass(frozen=True)
class ConstantForce(Effect):
    """A force that is always there: gravity, an amplifier's offset.

    Parameters
    ----------
    force : float
        [N], positive along +x.

    Examples
    --------
    >>> axis = cdf.Mass(2.0).with_effect(cdf.ConstantForce(-19.6))
    >>> float(axis.dynamics(0, [0.0, 0.0], [0.0])[1])
    -9.8
    """

    force: float = parameter("N", lower=-math.inf, meaning="constant force in the positive direction")

    role: ClassVar[str] = "force"
    usual_side: ClassVar[str] = "load"
    place_free: ClassVar[bool] = True
    proportional: ClassVar[bool] = True
    affine: ClassVar[bool] = True
    shows: ClassVar[str] = "an error of constant sign, in motion and at rest"
    source: ClassVar[str] = "Newton"

    @staticmethod
    def law(t, x, v, z, p, dz):
        """Return the force [N]."""
        return p[0]

    @classmethod
    def suggest_on_plane(cls, plane):
        """Yield shares of the friction, of either sign."""
        size = plane.friction or 0.3 * plane.force.low
        for f in (0.1, 0.4, 0.8, -0.1, -0.4, -0.8):
            yield cls(f * size), 1.0
