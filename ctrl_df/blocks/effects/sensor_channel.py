"""Effects on the way of the measured position: delay, quantization, offset, drift."""

import math
from dataclasses import dataclass
from typing import ClassVar

from ..effect import Effect, register_effect
from ..parameter import parameter
from ..primitives import Delay, Quantizer, Ramp


@register_effect
@dataclass(frozen=True)
class SensorDelay(Effect):
    """The position is reported `delay` late.

    Parameters
    ----------
    delay : float
        [s], >= 0.

    Examples
    --------
    >>> axis = cdf.Mass(2.0).with_effect(cdf.SensorDelay(0.1))
    >>> N = cdf.describing_function(axis, 1.0, 5.0)
    >>> print(f"{np.degrees(np.angle(-N)):.3f}")  # 0.1 s at 5 rad/s
    -28.648
    """

    delay: float = parameter("s", meaning="delay of the sensor")

    role: ClassVar[str] = "output"
    proportional: ClassVar[bool] = True
    shows: ClassVar[str] = "error proportional to velocity in the measured position"
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


@register_effect
@dataclass(frozen=True)
class SensorQuantization(Effect):
    """The position is reported in steps.

    Parameters
    ----------
    step : float
        [m], > 0.

    Examples
    --------
    >>> axis = cdf.Mass(2.0).with_effect(cdf.SensorQuantization(0.01))
    >>> print(f"{axis.output(0, [0.1234, 0.0], [0.0])[0]:.3f}")
    0.120
    """

    step: float = parameter("m", strict=True, meaning="resolution of the sensor", stepped=True)

    role: ClassVar[str] = "output"
    costly: ClassVar[bool] = True
    table_starts: ClassVar[int] = 1
    shows: ClassVar[str] = "an error that jumps by one step and never exceeds half of it"
    source: ClassVar[str] = "encoder"
    remedy: ClassVar[str] = "For a fine encoder leave the effect out."

    def channel(self):
        """Return the rounding."""
        return (Quantizer(self.step),)

    @classmethod
    def suggest(cls, screen):
        """Return the grid to which the values keep."""
        step = screen.step()
        return [cls(step)] if step > 0 else []

    @classmethod
    def suggest_on_plane(cls, plane):
        """Return steps of shares of the amplitudes."""
        return [(cls(s), 1.0) for s in plane.amplitude.over(6, 0.3, 0.3)]


@register_effect
@dataclass(frozen=True)
class SensorOffset(Effect):
    """The reported position is shifted by a constant.

    Parameters
    ----------
    offset : float
        Reported minus true position [m].

    Examples
    --------
    >>> axis = cdf.Mass(2.0).with_effect(cdf.SensorOffset(0.002))
    >>> print(f"{axis.output(0, [0.1, 0.0], [0.0])[0]:.3f}")
    0.102
    """

    offset: float = parameter("m", lower=-math.inf, meaning="reported minus true position")

    role: ClassVar[str] = "output"
    proportional: ClassVar[bool] = True
    shows: ClassVar[str] = "a constant error of position"
    source: ClassVar[str] = "zero of the scale"

    def channel(self):
        """Return the shift."""
        return (Ramp(self.offset),)

    @classmethod
    def applicable(cls, block):
        """Return whether the place matters: elsewhere an offset is where the record begins."""
        return block.core.position_dependent


@register_effect
@dataclass(frozen=True)
class Drift(Effect):
    """The reported position runs away at a constant rate.

    Parameters
    ----------
    rate : float
        [m/s].

    Examples
    --------
    >>> axis = cdf.Mass(2.0).with_effect(cdf.LinearSpring(50.0)).with_effect(cdf.Drift(1e-3))
    >>> x = np.asarray(cdf.event_response(axis, [0, 10], 0).outputs)[0]
    >>> print(f"{x[-1]:.3f}")  # m after 10 s at rest
    0.010
    """

    rate: float = parameter("m/s", lower=-math.inf, meaning="rate of the sensor's drift")

    role: ClassVar[str] = "output"
    proportional: ClassVar[bool] = True
    shows: ClassVar[str] = "an error of position that grows in proportion to time"
    source: ClassVar[str] = "thermal drift of the sensor"

    def channel(self):
        """Return the ramp."""
        return (Ramp(0.0, self.rate),)
