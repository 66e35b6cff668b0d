"""Dry friction that depends on the place."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..effect import Effect, register_effect
from ..parameter import parameter


@register_effect
@dataclass(frozen=True)
class PositionDependentFriction(Effect):
    """Dry friction that rises and falls over the place, ``amplitude sin(2 pi x / wavelength + phase)``.

    A bent screw or an eccentric gear: once a turn. A wave longer than the stroke is a tight end, or a tight
    spot in the middle. Where it would make the level negative, the level is zero.

    Parameters
    ----------
    amplitude : float
        By how much the level rises and falls [N], >= 0.
    wavelength : float
        Period over position [m], > 0.
    phase : float
        Phase at x = 0 [rad].
    """

    amplitude: float = parameter("N", meaning="by how much the level rises and falls")
    wavelength: float = parameter("m", strict=True, default=0.1, meaning="period over position")
    phase: float = parameter("rad", lower=-math.inf, default=0.0, meaning="phase at x = 0", per_record=True)

    role: ClassVar[str] = "friction"
    asks: ClassVar[tuple[str, ...]] = ("x",)
    rank: ClassVar[int] = 1
    multimodal: ClassVar[bool] = True
    repeatable: ClassVar[bool] = True
    shows: ClassVar[str] = "friction that differs from place to place: an error that reverses with the motion"
    source: ClassVar[str] = "Armstrong-Helouvry (1991), ch. 4: position-dependent friction"

    @staticmethod
    def law(moving, direction, speed, base, p, x, drive, load):
        """Return the level [N]."""
        return max(base + p[0] * math.sin(2.0 * math.pi * x / p[1] + p[2]), 0.0)

    @classmethod
    def suggest(cls, screen):
        """Yield waves of the friction, short or longer than the stroke, that explain most of the force."""
        m = screen.motion
        sense = np.sign(m.v) * (np.abs(m.v) > 0.03 * screen.scales.speed)
        plain = np.column_stack([m.a, m.v, sense, np.ones(len(m.v)), m.x])
        basis, _ = np.linalg.qr(plain / np.linalg.norm(plain, axis=0))
        left = m.u - basis @ (basis.T @ m.u)
        span, found = float(np.ptp(m.x)), []
        for turns in np.geomspace(0.3, 30.0, 90):
            angle = 2.0 * math.pi * turns * m.x / span
            pair = np.column_stack([sense * np.sin(angle), sense * np.cos(angle)])
            clean = pair - basis @ (basis.T @ pair)
            weights, *_ = np.linalg.lstsq(clean, left, rcond=None)
            found.append((float(np.sum((left - clean @ weights) ** 2)), turns, weights))
        kept: list[float] = []
        for _, turns, weights in sorted(found, key=lambda f: f[0]):
            if all(abs(math.log(turns / other)) > 0.15 for other in kept):
                kept.append(turns)
                size = min(float(np.hypot(*weights)), 2.0 * screen.scales.force)
                for factor in (1.0, 0.5):
                    yield cls(factor * size, span / turns, math.atan2(weights[1], weights[0]))
            if len(kept) == 4:
                break
