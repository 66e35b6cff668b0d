"""Force ripple over position."""

import math
from dataclasses import dataclass
from typing import ClassVar

from ..effect import Effect, register_effect
from ..parameter import parameter


@register_effect
@dataclass(frozen=True)
class PositionRipple(Effect):
    """A force periodic in position (cogging, screw, gear): ``F = A sin(2 pi x / wavelength + phase)``.

    Parameters
    ----------
    amplitude : float
        A [N], >= 0.
    wavelength : float
        Period over position [m], > 0.
    phase : float
        Phase at x = 0 [rad].

    Examples
    --------
    >>> axis = cdf.Mass(2.0).with_effect(cdf.PositionRipple(1.5, wavelength=0.12))
    >>> print(f"{axis.dynamics(0, [0.03, 0.0], [0.0])[1]:.3f}")  # a quarter of a wave: 1.5 N / 2 kg
    0.750
    """

    amplitude: float = parameter("N", meaning="ripple amplitude")
    wavelength: float = parameter("m", strict=True, default=0.01, meaning="period over position")
    phase: float = parameter("rad", lower=-math.inf, default=0.0, meaning="phase at x = 0")

    role: ClassVar[str] = "force"
    multimodal: ClassVar[bool] = True
    repeatable: ClassVar[bool] = True
    shows: ClassVar[str] = "error periodic over position, whatever the time and the speed"
    source: ClassVar[str] = "cogging force, first harmonic"

    @staticmethod
    def law(t, x, v, z, p, dz):
        """Return the force [N]."""
        return p[0] * math.sin(2.0 * math.pi * x / p[1] + p[2])
