"""Dry friction that depends on the place."""

import math
from dataclasses import dataclass
from typing import ClassVar

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
        """Yield the long waves that explain most; `regress` finds the short ones."""
        yield from screen.long_waves(cls)

    @classmethod
    def regress(cls, screen):
        """Yield the waves of any length that explain most of the motion."""
        for wave, values in screen.waves(reversing=True):
            yield cls(wave.amplitude, wave.wavelength, wave.phase), values
