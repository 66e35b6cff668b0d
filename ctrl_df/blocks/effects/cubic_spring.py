"""A spring to ground that hardens or softens."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..effect import register_effect
from ..parameter import parameter
from .spring import Spring


@register_effect
@dataclass(frozen=True)
class CubicSpring(Spring):
    """A spring that hardens, or softens, with the cube of the stroke, ``F = -k3 (x - center)^3``.

    Parameters
    ----------
    stiffness : float
        k3 [N/m^3]; negative: beside a linear spring one that softens.
    center : float
        Position of zero force [m].

    Examples
    --------
    >>> axis = cdf.Mass(2.0).with_effect(cdf.CubicSpring(1000.0))
    >>> float(axis.dynamics(0, [0.1, 0.0], [0.0])[1])
    -0.5
    """

    stiffness: float = parameter("N/m^3", lower=-math.inf, meaning="cubic stiffness")
    center: float = parameter(
        "m", lower=-math.inf, default=0.0, free=False, origin=True, meaning="position of zero force"
    )

    role: ClassVar[str] = "force"
    proportional: ClassVar[bool] = True
    shows: ClassVar[str] = "error near the ends of the stroke, growing faster than the position"
    source: ClassVar[str] = "Duffing (1918)"

    @classmethod
    def regress(cls, screen):
        """Yield the springs that a cubic polynomial of the place says, about zero and about a center."""
        x, middle = screen.motion.x, float(np.mean(screen.motion.x))
        s = x - middle
        about_zero, anywhere = screen.force_fit([x**3]), screen.force_fit([s**3, s**2, s, np.ones(len(s))])
        if about_zero.sensible and about_zero.weights[0]:
            yield cls(about_zero.weights[0]), about_zero.values
        stiffness, even = anywhere.weights[:2]
        if anywhere.sensible and stiffness:
            yield cls(stiffness, middle - even / (3.0 * stiffness)), anywhere.values

    @staticmethod
    def law(t, x, v, z, p, dz):
        """Return the force [N]."""
        d = x - p[1]
        return -p[0] * d * d * d
