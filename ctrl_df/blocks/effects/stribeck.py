"""Stribeck friction."""

import itertools
import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

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

    @classmethod
    def suggest(cls, screen):
        """Return levels above the kinetic one, over speeds that are seen, and over twice the usual speed.

        Of presliding most is slow, and the level that a fit then calls kinetic is nearly the static one.
        """
        low = max(screen.friction, 0.02 * screen.scales.force)
        grid = itertools.product((1.1, 1.35, 1.8, 2.4), (0.05, 0.12, 0.3, 0.8, 2.0))
        return [cls(low * a, screen.scales.speed * b) for a, b in grid]

    @classmethod
    def regress(cls, screen):
        """Yield the bump that explains most of the force, over speeds that are seen."""
        v, found = screen.motion.v, []
        for speed in screen.scales.speed * np.array([0.04, 0.08, 0.15, 0.3, 0.6]):
            found.append((screen.force_fit([np.sign(v) * np.exp(-np.square(v / speed))]), speed))
        best, speed = min(found, key=lambda x: x[0].left)
        if best.sensible and best.weights[0] > 0:
            yield cls(best.friction + best.weights[0], speed), best.values

    @classmethod
    def suggest_on_plane(cls, plane):
        """Yield bumps over speeds of the plane, that take over a part of the model's friction."""
        shapes = ((1.0, 1.3), (0.9, 1.6), (0.6, 2.5))
        for velocity in plane.speed.over(5, 0.5, 0.7):
            for share, over in shapes:
                yield cls(over * share * plane.friction, velocity), share
