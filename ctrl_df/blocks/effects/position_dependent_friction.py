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

    Examples
    --------
    >>> axis = cdf.Mass(2.0, [cdf.Coulomb(3.0), cdf.PositionDependentFriction(1.0, wavelength=0.4)])
    >>> [round(float(axis.dynamics(0, [x, 0.1], [0.0])[1]), 3) for x in (0.0, 0.1, 0.3)]
    [-1.5, -2.0, -1.0]
    """

    amplitude: float = parameter("N", meaning="by how much the level rises and falls")
    wavelength: float = parameter("m", strict=True, default=0.1, meaning="period over position")
    phase: float = parameter(
        "rad", lower=-math.inf, default=0.0, meaning="phase at position 0", per_record=True
    )

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
        """Yield long waves by what they change in the output, and those that explain most of the force."""
        for amplitude, wavelength, phase in screen.long_waves(cls)[:2]:
            yield cls(min(amplitude, 2.0 * screen.scales.force), wavelength, phase)
        for turns, pair in _waves(screen)[:4]:
            size = min(float(np.hypot(*pair)), 2.0 * screen.scales.force)
            for factor in (1.0, 0.5):
                yield cls(factor * size, float(np.ptp(screen.motion.x)) / turns, math.atan2(pair[1], pair[0]))

    @classmethod
    def regress(cls, screen):
        """Yield the waves that explain most, with the friction that the model keeps beside."""
        m = screen.motion
        for turns, _ in _waves(screen)[:2]:
            wavelength = float(np.ptp(m.x)) / turns
            angle, sense = 2.0 * math.pi * m.x / wavelength, np.sign(m.v)
            fit = screen.force_fit([sense * np.sin(angle), sense * np.cos(angle)])
            if fit.sensible:
                a, b = fit.weights
                yield cls(math.hypot(a, b), wavelength, math.atan2(b, a)), fit.values


TURNS = np.concatenate([np.geomspace(0.25, 1.0, 6), np.arange(1.25, 80.0, 0.25)])
"""Waves tried, over the stroke: a quarter of a turn apart they are the same."""


def _waves(screen):
    """Return the waves that explain most of the force, the best first: turns, (sine, cosine) [N]."""
    m = screen.motion
    sense = np.sign(m.v) * (np.abs(m.v) > 0.03 * screen.scales.speed)
    plain = np.column_stack([m.a, m.v, sense, np.ones(len(m.v)), m.x])
    basis, _ = np.linalg.qr(plain / (np.linalg.norm(plain, axis=0) + 1e-300))
    left = m.u - basis @ (basis.T @ m.u)
    span, found = float(np.ptp(m.x)) or 1.0, []
    for turns in TURNS:
        angle = 2.0 * math.pi * turns * m.x / span
        pair = np.column_stack([sense * np.sin(angle), sense * np.cos(angle)])
        pair -= basis @ (basis.T @ pair)
        square = pair.T @ pair + 1e-9 * len(left) * np.eye(2)
        with_it = pair.T @ left
        weights = np.linalg.solve(square, with_it)
        found.append((float(weights @ with_it), float(turns), weights))
    best: list = []
    for _, turns, weights in sorted(found, key=lambda f: -f[0]):
        if all(abs(turns - other) > max(0.1 * turns, 0.6) for other, _ in best):
            best.append((turns, weights))
    return best
