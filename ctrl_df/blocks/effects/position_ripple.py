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
    phase: float = parameter(
        "rad", lower=-math.inf, default=0.0, meaning="phase at position 0", per_record=True
    )

    role: ClassVar[str] = "force"
    multimodal: ClassVar[bool] = True
    repeatable: ClassVar[bool] = True
    costly: ClassVar[bool] = True
    table_starts: ClassVar[int] = 1
    shows: ClassVar[str] = "error periodic over position, whatever the time and the speed"
    source: ClassVar[str] = "cogging force, first harmonic"

    @staticmethod
    def law(t, x, v, z, p, dz):
        """Return the force [N]."""
        return p[0] * math.sin(2.0 * math.pi * x / p[1] + p[2])

    @classmethod
    def suggest(cls, screen):
        """Yield the long waves that explain most; `regress` finds the short ones."""
        yield from screen.long_waves(cls)

    @classmethod
    def regress(cls, screen):
        """Yield the waves of any length that explain most of the motion."""
        for wave, values in screen.waves():
            yield cls(wave.amplitude, wave.wavelength, wave.phase), values

    @classmethod
    def suggest_on_plane(cls, plane):
        """Yield waves as long as the amplitudes."""
        for wavelength in plane.amplitude.over(7, 1.0, 5.0):
            for amplitude in (0.02, 0.1):
                yield cls(amplitude * plane.force.high, wavelength), 1.0

    def distinct(self, stroke, at_bound):
        """Return whether the stroke shows a period: of less it is a spring."""
        return self.wavelength < 0.9 * stroke
