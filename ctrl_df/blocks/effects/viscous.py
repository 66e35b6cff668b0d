"""Viscous friction."""

from dataclasses import dataclass
from typing import ClassVar

from ..effect import Effect, register_effect
from ..parameter import parameter


@register_effect
@dataclass(frozen=True)
class Viscous(Effect):
    """Friction force proportional to velocity, ``F = -B v``.

    Parameters
    ----------
    coefficient : float
        B [N s/m], >= 0.

    Examples
    --------
    >>> axis = cdf.Mass(2.0).with_effect(cdf.Viscous(4.0))
    >>> float(axis.dynamics(0, [0.0, 0.5], [0.0])[1])
    -1.0
    """

    coefficient: float = parameter("N s/m", meaning="viscous coefficient")

    role: ClassVar[str] = "force"
    place_free: ClassVar[bool] = True
    proportional: ClassVar[bool] = True
    affine: ClassVar[bool] = True
    shows: ClassVar[str] = "error proportional to velocity, the same in both directions"
    source: ClassVar[str] = "Azenha & Machado (1997), eq. (6)"

    @staticmethod
    def law(t, x, v, z, p, dz):
        """Return the force [N]."""
        return -p[0] * v
