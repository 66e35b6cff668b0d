"""Static friction above the kinetic level."""

import itertools
from dataclasses import dataclass
from typing import ClassVar

from ..effect import Effect, register_effect
from ..parameter import parameter


@register_effect
@dataclass(frozen=True)
class Stiction(Effect):
    """Static friction: a body at rest breaks away only above `level`; once moving, the kinetic level holds.

    Parameters
    ----------
    level : float
        Breakaway level Ks [N], >= the kinetic level of the block it is added to.

    Examples
    --------
    >>> axis = cdf.Mass(2.0).with_effect(cdf.Coulomb(3.0)).with_effect(cdf.Stiction(4.0))
    >>> [round(float(np.asarray(cdf.event_response(axis, [0, 1], F).outputs)[0, -1]), 3) for F in (3.9, 5.0)]
    [0.0, 0.5]
    """

    level: float = parameter("N", meaning="breakaway level", threshold=True)

    role: ClassVar[str] = "friction"
    nonsmooth: ClassVar[bool] = True
    multimodal: ClassVar[bool] = True
    affine: ClassVar[bool] = True
    rank: ClassVar[int] = 1
    shows: ClassVar[str] = "error just after standstill: the real body stays longer at rest, then jumps off"
    source: ClassVar[str] = "Karnopp (1985)"

    @staticmethod
    def law(moving, direction, speed, base, p):
        """Return the level [N]."""
        if moving > 0.5:
            return base
        return max(base, p[0])

    @classmethod
    def suggest(cls, screen):
        """Return levels a little above the kinetic one, and shares of the force."""
        kinetic, force = screen.friction, screen.scales.force
        near = {kinetic * f for f in (1.03, 1.08, 1.15, 1.3, 1.5, 1.8, 2.3, 3.0)}
        levels = near if kinetic > 0.01 * force else set()
        return [cls(x) for x in sorted(levels | {0.1 * force, 0.3 * force, 0.6 * force}) if x > kinetic]

    @classmethod
    def suggest_on_plane(cls, plane):
        """Yield levels between the model's friction (or what stood still) and the least moving force."""
        least = plane.force.low
        low = max(plane.stuck, min(plane.friction, 0.9 * least))
        for f, share in itertools.product((0.25, 0.6, 0.95), (1.0, 0.8, 0.6)):
            yield cls(low + f * (least - low)), share
