"""End stops."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...checks import number
from ..effect import Effect, register_effect
from ..parameter import parameter
from ..thresholds import EVEN_STOPS, FAR_STOP, INSIDE, REBOUNDS


@register_effect
@dataclass(frozen=True)
class HardStop(Effect):
    """Rigid stops at both ends of the stroke, hit with Newton's restitution.

    Parameters
    ----------
    limit : float
        Upper stop [m], from `center` on; the lower one stands at ``-limit`` unless given.
    restitution : float
        Rebound speed over impact speed, 0 to 1.
    lower : float or None
        Lower stop [m] < limit, from `center` on.
    center : float
        Where both are counted from [m]: the middle of the stroke, unless `lower` is given.

    Examples
    --------
    >>> axis = cdf.Mass(2.0).with_effect(cdf.HardStop(0.1, restitution=0.5))
    >>> run = cdf.event_response(axis, [0, 1], 1.0)
    >>> [(round(float(e.time), 4), e.kind) for e in run.events[:1]]
    [(0.6325, 'stop')]
    """

    limit: float = parameter("m", lower=-math.inf, meaning="upper end of the stroke")
    restitution: float = parameter(
        "", upper=1.0, default=0.0, known_as="restitution", meaning="coefficient of restitution"
    )
    lower: float | None = None
    center: float = parameter(
        "m", lower=-math.inf, default=0.0, free=False, origin=True, meaning="middle of the stroke"
    )

    role: ClassVar[str] = "contact"
    nonsmooth: ClassVar[bool] = True
    multimodal: ClassVar[bool] = True
    ill_conditioned: ClassVar[bool] = True
    shows: ClassVar[str] = "error at the ends of the stroke only: the measured position stops short"
    source: ClassVar[str] = "Newton's law of restitution"

    def check(self):
        """Check that the stroke has a length."""
        if self.lower is not None:
            object.__setattr__(
                self, "lower", number("HardStop", "lower", self.lower, "m", meaning="lower stop")
            )
        low = self._low
        if not low < self.limit:
            raise ValueError(
                "HardStop needs lower < limit (a stroke of some length); "
                f"got lower={low:g}, limit={self.limit:g}. "
                "Give lower= when the stroke does not contain x = 0."
            )

    @property
    def span(self) -> tuple[float, float]:
        """Lower and upper stop [m]."""
        return self.center + self._low, self.center + self.limit

    @property
    def _low(self) -> float:
        """Lower stop, from `center` on [m]."""
        return -self.limit if self.lower is None else float(self.lower)

    @classmethod
    def suggest(cls, screen):
        """Return stops at the ends of the stroke, or a little within; then a stop at one end alone.

        The stroke is about the zero of the encoder; where the motion is not, from one end of it to the other.
        """
        x = screen.motion.x
        low, high, reach = float(np.min(x)), float(np.max(x)), float(np.max(np.abs(x)))
        half, middle = 0.5 * (high - low), 0.5 * (high + low)
        even = [cls(reach * f, e) for f in INSIDE for e in REBOUNDS]
        if abs(middle) < EVEN_STOPS * half:
            return even
        ends = [cls(half * f, e, center=middle) for f in INSIDE for e in REBOUNDS]
        # the other stop is out of reach
        far = [middle + side * half * (f - FAR_STOP) for f in INSIDE for side in (1, -1)]
        return [*even, *ends, *(cls(FAR_STOP * half, max(REBOUNDS), center=c) for c in far)]

    @classmethod
    def suggest_on_plane(cls, plane):
        """Yield stops near the largest amplitude.

        A mass that hits both stops swings by 0.8 (to and fro at one speed) to 1.27 of the limit (standing in
        between).
        """
        for f in (0.75, 0.85, 0.95, 1.05, 1.2, 0.4):
            yield cls(f * plane.amplitude.high, 0.3), 1.0

    def about_zero(self):
        """Yield even stops of which one stands where one of these does: the other may not be reached."""
        if self.center != 0:
            lower, upper = self.span
            for limit in (upper, -lower):
                if limit > 0:
                    yield type(self)(limit, self.restitution)

    def bounds(self, seen):
        """Return where the stop can stand: no body has been where it would not let it.

        Nor does any move between stops nearer to each other than its way from one sample to the next.
        """
        least = seen.speed * seen.dt
        if self.center != 0:  # estimated as well: what is known is how far apart the stops are
            apart = max(seen.stroke, least)
            return {"limit": (0.5 * apart if self.lower is None else self.lower + apart, math.inf)}
        if self.lower is None:
            return {"limit": (max(seen.reach, 0.5 * least), math.inf)}
        return {"limit": (max(seen.highest, self.lower + least), math.inf)}
