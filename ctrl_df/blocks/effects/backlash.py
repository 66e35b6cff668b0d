"""A gap between motor and load."""

import itertools
from dataclasses import dataclass
from typing import ClassVar

from ..effect import Effect, register_effect
from ..parameter import parameter


@register_effect
@dataclass(frozen=True)
class Backlash(Effect):
    """A gap between motor and load, closed by impacts with Newton's restitution.

    ``0 <= x_motor - x <= gap``. Together with `Compliance` the faces are elastic and the restitution
    unused. They part where the deflection is back at zero, so that the joint's damper pulls just before:
    faces that let go as soon as their force is zero lose a little less energy. Added to a single `Mass`, it
    splits off `load_fraction` of it as the load; the sensor sees the load unless the block has
    ``measured="motor"``.

    Parameters
    ----------
    gap : float
        Total clearance [m], > 0.
    restitution : float
        Rebound speed over approach speed, 0 to 1.
    load_fraction : float
        Share of a single mass that lies behind the gap, in (0, 1); no meaning in a two-mass block.

    Examples
    --------
    >>> drive = cdf.TwoMass(1.0, 8.0).with_effect(cdf.Backlash(0.018, restitution=0.2))
    >>> drive.state_labels
    ['x', 'v', 'x_motor', 'v_motor']
    """

    gap: float = parameter("m", strict=True, known_as="gap", meaning="total clearance")
    restitution: float = parameter(
        "", upper=1.0, default=0.0, known_as="restitution", meaning="coefficient of restitution"
    )
    load_fraction: float = parameter(
        "", strict=True, upper=0.999, default=0.5, known_as="load_fraction",
        meaning="share of a single mass behind the gap",
    )  # fmt: skip

    role: ClassVar[str] = "contact"
    nonsmooth: ClassVar[bool] = True
    multimodal: ClassVar[bool] = True
    ill_conditioned: ClassVar[bool] = True
    divides: ClassVar[bool] = True
    table_starts: ClassVar[int] = 4
    shows: ClassVar[str] = "error after reversals that lasts as long as the gap is crossed"
    source: ClassVar[str] = "Azenha & Machado (1997), eqs. (9)-(13)"
    remedy: ClassVar[str] = "For a tight joint leave the effect out."

    @classmethod
    def suggest(cls, screen):
        """Yield gaps of shares of the stroke."""
        shares = (0.3, 0.6) if screen.bodies == 1 else (0.5,)
        for gap, share in itertools.product((0.003, 0.01, 0.03, 0.08, 0.2, 0.5), shares):
            yield cls(screen.scales.position * gap, 0.2, share)

    @classmethod
    def suggest_on_plane(cls, plane):
        """Yield gaps of shares of the amplitudes."""
        for gap, share in itertools.product(plane.amplitude.over(8, 0.1, 0.3), (0.3, 0.6)):
            yield cls(gap, 0.3, share), 1.0

    def ranges(self, seen):
        """Return what leaves something on either side of the gap."""
        return {"load_fraction": (0.05, 0.95)}

    def distinct(self, stroke, at_bound):
        """Return whether there is a load behind it: else it is a dashpot, in the place of other friction."""
        return "load_fraction" not in at_bound
