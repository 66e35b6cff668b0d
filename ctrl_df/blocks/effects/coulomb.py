"""Coulomb friction."""

from dataclasses import dataclass
from typing import ClassVar

from ..effect import Effect, register_effect
from ..parameter import parameter


@register_effect
@dataclass(frozen=True)
class Coulomb(Effect):
    """Dry friction of constant level; at rest it holds any force up to that level.

    ::

              F│
             K ┤──────── v > 0
        ───────┼──────── v
        ───────┤ -K

    Parameters
    ----------
    level : float
        K [N], >= 0.

    Examples
    --------
    >>> axis = cdf.Mass(2.0).with_effect(cdf.Coulomb(3.0))
    >>> [float(axis.dynamics(0, [0.0, v], [5.0])[1]) for v in (0.1, -0.1)]  # (5 -+ 3) N / 2 kg
    [1.0, 4.0]
    >>> float(np.asarray(cdf.event_response(axis, [0, 1], 2.9).outputs)[0, -1])  # held
    0.0
    """

    level: float = parameter("N", meaning="Coulomb level")

    role: ClassVar[str] = "friction"
    proportional: ClassVar[bool] = True
    affine: ClassVar[bool] = True
    shows: ClassVar[str] = "a step in the error at every reversal of velocity, flat in between"
    source: ClassVar[str] = "Azenha & Machado (1997), eq. (6)"

    @staticmethod
    def law(moving, direction, speed, base, p):
        """Return the level [N]."""
        return base + p[0]

    @classmethod
    def suggest_on_plane(cls, plane):
        """Return shares of the model's friction, taken from it."""
        return plane.taken_from_friction(cls)
