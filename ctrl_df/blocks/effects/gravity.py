"""Gravity on what swings about an axis."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..effect import Effect, register_effect
from ..parameter import parameter


@register_effect
@dataclass(frozen=True)
class Gravity(Effect):
    """Gravity on a body that turns about an axis out of the vertical, ``-torque sin(angle - angle0)``.

    It hangs still at `angle0` and stands, unstably, half a turn from there. On a line gravity is a
    `ConstantForce`.

    Parameters
    ----------
    torque : float
        m g l [N m], >= 0: weight times distance of the centre of mass.
    angle0 : float
        Where it hangs [rad].

    Examples
    --------
    >>> pendulum = cdf.Inertia(0.5).with_effect(cdf.Gravity(2.0))
    >>> [round(float(pendulum.dynamics(0, [angle, 0.0], [0.0])[1]), 3) for angle in (0.5, 3.0)]
    [-1.918, -0.564]
    """

    torque: float = parameter("N", meaning="weight times lever")
    angle0: float = parameter("m", lower=-math.inf, default=0.0, meaning="angle at which it hangs")

    role: ClassVar[str] = "force"
    usual_side: ClassVar[str] = "load"
    turns: ClassVar[bool] = True
    proportional: ClassVar[bool] = True
    shows: ClassVar[str] = "error proportional to the sine of the angle, in motion and at rest"
    source: ClassVar[str] = "Newton"
    remedy: ClassVar[str] = "On a line gravity is a ConstantForce."

    @staticmethod
    def law(t, x, v, z, p, dz):
        """Return the torque [N m]."""
        return -p[0] * math.sin(x - p[1])

    def periods(self):
        """Return a turn."""
        return (2.0 * math.pi,)

    @classmethod
    def applicable(cls, block):
        """Return whether the machine turns."""
        return block.coordinates.position == "angle"

    @classmethod
    def regress(cls, screen):
        """Yield the pendulum that hangs where sine and cosine of the angle in the force say."""
        x = screen.motion.x
        fit = screen.force_fit([np.sin(x), np.cos(x)])
        if fit.sensible:
            yield cls(math.hypot(*fit.weights), math.atan2(-fit.weights[1], fit.weights[0])), fit.values
            yield cls(math.hypot(*fit.weights)), fit.values

    @classmethod
    def suggest(cls, screen):
        """Return the pendulum whose sine and cosine explain most of the output, and shares of the force."""
        shares = [cls(f * screen.scales.force) for f in (0.1, 0.4)]
        wave = screen.long_wave(lambda size, _, phase: cls(size, math.pi - phase), 2.0 * math.pi)
        if wave is None:
            return shares
        _, torque, phase = wave
        return [cls(torque, math.remainder(math.pi - phase, 2 * math.pi)), *shares]
