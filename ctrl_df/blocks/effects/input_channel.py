"""Effects on the way of the applied force: saturation, dead zone, gain, lag, delay."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..effect import Effect, register_effect
from ..parameter import parameter
from ..primitives import Delay, Lag, PiecewiseAffine


@register_effect
@dataclass(frozen=True)
class InputSaturation(Effect):
    """The drive gives no more than `level`, in either direction.

    Parameters
    ----------
    level : float
        [N], > 0.

    Examples
    --------
    >>> axis = cdf.Mass(2.0).with_effect(cdf.InputSaturation(10.0))
    >>> [float(axis.dynamics(0, [0.0, 0.0], [F])[1]) for F in (8.0, 30.0)]
    [4.0, 5.0]
    """

    level: float = parameter("N", strict=True, meaning="largest force")

    role: ClassVar[str] = "input"
    shows: ClassVar[str] = "error when the commanded force is large: the real force has a plateau"
    source: ClassVar[str] = "current limit of the amplifier"

    def channel(self):
        """Return the clipping line."""
        s = self.level
        return (PiecewiseAffine.from_corners((-s, s), (0, 1, 0), (-s, 0, s)),)

    @classmethod
    def suggest(cls, screen):
        """Return shares of the largest force."""
        top = float(np.quantile(np.abs(screen.motion.u), 0.999))
        shares = (0.97, 0.93, 0.87, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3) if top > 0 else ()
        return [cls(top * f) for f in shares]

    @classmethod
    def suggest_on_plane(cls, plane):
        """Yield levels between the least and the largest force."""
        for f in (0.05, 0.3, 0.6, 0.8, 0.95):
            yield cls(plane.force.low + f * (plane.force.high - plane.force.low)), 1.0


@register_effect
@dataclass(frozen=True)
class InputDeadZone(Effect):
    """The drive gives nothing until the command exceeds `threshold`, in either direction.

    Parameters
    ----------
    threshold : float
        Half width of the dead zone [N], >= 0.

    Examples
    --------
    >>> axis = cdf.Mass(2.0).with_effect(cdf.InputDeadZone(1.0))
    >>> [float(axis.dynamics(0, [0.0, 0.0], [F])[1]) for F in (0.9, 3.0)]
    [0.0, 1.0]
    """

    threshold: float = parameter("N", meaning="half width of the dead zone")

    role: ClassVar[str] = "input"
    proportional: ClassVar[bool] = True
    shows: ClassVar[str] = (
        "error when the commanded force is small, and a force short by the threshold beyond"
    )
    source: ClassVar[str] = "Tao & Kokotovic (1996), ch. 2"

    def channel(self):
        """Return the dead band and its two flanks."""
        d = self.threshold
        return (PiecewiseAffine.from_corners((-d, d), (1, 0, 1), (d, 0, -d)),)

    @classmethod
    def regress(cls, screen):
        """Yield shares of the dry friction, taken from it: where the machine moves the two are one."""
        fit = screen.force_fit([])
        if fit.sensible and fit.friction > 0:
            for share in (0.25, 0.5, 0.75):
                yield cls(share * fit.friction), fit.with_friction(1 - share)

    @classmethod
    def suggest_on_plane(cls, plane):
        """Return shares of the model's friction, taken from it."""
        return plane.taken_from_friction(cls)


@register_effect
@dataclass(frozen=True)
class InputGain(Effect):
    """The drive gives `gain` times the commanded force; a negative gain reverses it.

    Parameters
    ----------
    gain : float
        Actual over nominal drive gain, not 0.

    Examples
    --------
    >>> axis = cdf.Mass(2.0).with_effect(cdf.InputGain(0.8))
    >>> float(axis.dynamics(0, [0.0, 0.0], [5.0])[1])
    2.0
    """

    gain: float = parameter("", lower=-math.inf, strict=True, meaning="actual over nominal drive gain")

    role: ClassVar[str] = "input"
    shows: ClassVar[str] = "error proportional to the applied force (a negative gain: the force is reversed)"
    source: ClassVar[str] = "drive gain; a negative one: sign of the force, or of the place, in the record"

    def channel(self):
        """Return the straight line."""
        return (PiecewiseAffine.from_corners((), (self.gain,), (0.0,)),)

    @classmethod
    def suggest(cls, screen):
        """Return gains about one, and the nominal one reversed."""
        return [cls(g) for g in (0.7, 0.9, 0.97, 1.03, 1.1, 1.3, -1.0)]

    @classmethod
    def suggest_on_plane(cls, plane):
        """Return gains about one, and the nominal one reversed."""
        return [(cls(g), 1.0) for g in (0.7, 0.9, 1.1, 1.4, -1.0)]


@register_effect
@dataclass(frozen=True)
class InputLag(Effect):
    """The drive's force follows the command with a first-order lag.

    Parameters
    ----------
    time_constant : float
        [s], > 0.

    Examples
    --------
    >>> axis = cdf.Mass(2.0).with_effect(cdf.InputLag(0.1))
    >>> N = cdf.describing_function(axis, 1.0, 10.0)
    >>> print(f"{np.degrees(np.angle(-N)):.3f}")  # 0.1 s at 10 rad/s
    -45.000
    """

    time_constant: float = parameter("s", strict=True, meaning="time constant of the drive")

    role: ClassVar[str] = "input"
    proportional: ClassVar[bool] = True
    states: ClassVar[int] = 1
    shows: ClassVar[str] = "error in phase with the rate of the applied force, at high frequency"
    source: ClassVar[str] = "current loop of the amplifier"
    remedy: ClassVar[str] = "For a fast drive leave the effect out."

    def channel(self):
        """Return the lag."""
        return (Lag(self.time_constant),)

    @classmethod
    def suggest_on_plane(cls, plane):
        """Return shares of the shortest period."""
        return plane.in_periods(cls)

    def ranges(self, seen):
        """Return what settles neither much faster than a sample nor slower than the record."""
        return {"time_constant": (0.05 * seen.dt, seen.duration)}


@register_effect
@dataclass(frozen=True)
class InputDelay(Effect):
    """The force acts `delay` after the command.

    Parameters
    ----------
    delay : float
        [s], >= 0.

    Examples
    --------
    >>> axis = cdf.Mass(2.0).with_effect(cdf.InputDelay(0.1))
    >>> N = cdf.describing_function(axis, 1.0, 5.0)
    >>> print(f"{np.degrees(np.angle(-N)):.3f}")  # 0.1 s at 5 rad/s
    -28.648
    """

    delay: float = parameter("s", meaning="dead time of the drive")

    role: ClassVar[str] = "input"
    proportional: ClassVar[bool] = True
    shows: ClassVar[str] = "error proportional to the rate of the output, everywhere"
    source: ClassVar[str] = "dead time"

    def channel(self):
        """Return the delay."""
        return (Delay(self.delay),)

    @classmethod
    def regress(cls, screen):
        """Yield a dead time that explains most of the force."""
        for delay, values in screen.dead_times:
            yield cls(delay), values

    @classmethod
    def suggest_on_plane(cls, plane):
        """Return shares of the shortest period."""
        return plane.in_periods(cls)
