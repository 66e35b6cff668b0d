"""Static friction above the kinetic level."""

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
    shows: ClassVar[str] = "error just after standstill: the real mass stays longer at rest, then jumps off"
    source: ClassVar[str] = "Karnopp (1985)"

    @staticmethod
    def law(moving, direction, speed, base, p):
        """Return the level [N]."""
        if moving > 0.5:
            return base
        return max(base, p[0])
