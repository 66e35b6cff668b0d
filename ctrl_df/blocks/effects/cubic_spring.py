"""A hardening spring to ground."""

import math
from dataclasses import dataclass
from typing import ClassVar

from ..effect import Effect, register_effect
from ..parameter import parameter


@register_effect
@dataclass(frozen=True)
class CubicSpring(Effect):
    """A spring that hardens with the cube of the stroke, ``F = -k3 (x - center)^3``.

    Parameters
    ----------
    stiffness : float
        k3 [N/m^3], >= 0.
    center : float
        Position of zero force [m].

    Examples
    --------
    >>> axis = cdf.Mass(2.0).with_effect(cdf.CubicSpring(1000.0))
    >>> float(axis.dynamics(0, [0.1, 0.0], [0.0])[1])
    -0.5
    """

    stiffness: float = parameter("N/m^3", meaning="cubic stiffness")
    center: float = parameter("m", lower=-math.inf, default=0.0, free=False, meaning="position of zero force")

    role: ClassVar[str] = "force"
    proportional: ClassVar[bool] = True
    shows: ClassVar[str] = "error near the ends of the stroke, growing faster than the position"
    source: ClassVar[str] = "Duffing (1918)"

    @staticmethod
    def law(t, x, v, z, p, dz):
        """Return the force [N]."""
        d = x - p[1]
        return -p[0] * d * d * d
