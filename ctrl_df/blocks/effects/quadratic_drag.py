"""Drag of a fluid or fan."""

from dataclasses import dataclass
from typing import ClassVar

from ..effect import Effect, register_effect
from ..parameter import parameter


@register_effect
@dataclass(frozen=True)
class QuadraticDrag(Effect):
    """Drag proportional to the square of speed, ``F = -c v |v|``.

    Parameters
    ----------
    coefficient : float
        c [N s^2/m^2], >= 0.

    Examples
    --------
    >>> axis = cdf.Mass(2.0).with_effect(cdf.QuadraticDrag(4.0))
    >>> [float(axis.dynamics(0, [0.0, v], [0.0])[1]) for v in (0.5, -0.5)]
    [-0.5, 0.5]
    """

    coefficient: float = parameter("N s^2/m^2", meaning="drag coefficient")

    role: ClassVar[str] = "force"
    place_free: ClassVar[bool] = True
    proportional: ClassVar[bool] = True
    shows: ClassVar[str] = "error at high speed that grows faster than the speed itself"
    source: ClassVar[str] = "Rayleigh's drag law"

    @staticmethod
    def law(t, x, v, z, p, dz):
        """Return the force [N]."""
        return -p[0] * v * abs(v)
