"""Stribeck friction."""

import math
from dataclasses import dataclass
from typing import ClassVar

from ..effect import Effect, register_effect
from ..parameter import parameter


@register_effect
@dataclass(frozen=True)
class Stribeck(Effect):
    """Kinetic friction that falls from the static level as the film builds up.

    ``level(v) = Fc + (Fs - Fc) exp(-(v/vs)^2)`` with Fc the Coulomb level of the block.

    Parameters
    ----------
    level : float
        Static level Fs [N], >= the Coulomb level of the block.
    velocity : float
        Stribeck velocity vs [m/s], > 0.

    Examples
    --------
    >>> axis = cdf.Mass(2.0).with_effect(cdf.Coulomb(3.0)).with_effect(cdf.Stribeck(5.0, velocity=0.05))
    >>> [round(-2 * float(axis.dynamics(0, [0.0, v], [0.0])[1]), 3) for v in (0.001, 0.05, 0.5)]  # [N]
    [4.999, 3.736, 3.0]
    """

    level: float = parameter("N", meaning="static level", threshold=True)
    velocity: float = parameter("m/s", strict=True, default=0.01, meaning="Stribeck velocity")

    role: ClassVar[str] = "friction"
    nonsmooth: ClassVar[bool] = True
    multimodal: ClassVar[bool] = True
    rank: ClassVar[int] = 1
    shows: ClassVar[str] = "error concentrated at low speed: more friction there than at full speed"
    source: ClassVar[str] = "Armstrong-Helouvry, Dupont & Canudas de Wit (1994), eq. (2)"

    @staticmethod
    def law(moving, direction, speed, base, p):
        """Return the level [N]."""
        ratio = speed / p[1]
        return base + max(p[0] - base, 0.0) * math.exp(-ratio * ratio)
