"""Dry friction that grows with the force carried."""

from dataclasses import dataclass
from typing import ClassVar

from ..effect import Effect, register_effect
from ..parameter import parameter


@register_effect
@dataclass(frozen=True)
class LoadDependentFriction(Effect):
    """Dry friction of gears, screws and guides that grows with the force carried, ``coefficient |carried|``.

    Carried is what passes from the drive to what it moves: with a `share` of the inertia behind the gears,
    ``share drive + (1 - share) load``, where `load` is what acts against the drive, except inertia and dry
    friction: springs, gravity, and viscous friction too. In a block with an elastic joint it is the friction
    of the motor.

    Parameters
    ----------
    coefficient : float
        Friction level over force carried, >= 0.
    share : float
        Share of the inertia that lies behind the gears, 0 to 1; only forces other than the drive's determine
        it. A refit keeps it unless it is named; a diagnosis that adds the effect estimates it between 0 and 1
        where such forces act, and keeps it at either.

    Examples
    --------
    >>> screw = cdf.Mass(2.0).with_effect(cdf.LoadDependentFriction(0.2))
    >>> [float(screw.dynamics(0, [0.0, 0.1], [F])[1]) for F in (10.0, -10.0)]  # pushing on, braking
    [4.0, -6.0]
    """

    coefficient: float = parameter("", meaning="friction level over force carried")
    share: float = parameter(
        "", upper=1.0, default=1.0, free=False, between=True, meaning="share of the inertia behind the gears"
    )

    role: ClassVar[str] = "friction"
    asks: ClassVar[tuple[str, ...]] = ("drive", "load")
    proportional: ClassVar[bool] = True
    shows: ClassVar[str] = "friction that is larger where the drive works harder"
    source: ClassVar[str] = "Coulomb; of geared servos Duclusaud et al. (2025), Better Actuator Models"

    @staticmethod
    def law(moving, direction, speed, base, p, x, drive, load):
        """Return the level [N]."""
        return base + p[0] * abs(p[1] * drive + (1.0 - p[1]) * load)

    @classmethod
    def suggest(cls, screen):
        """Return small and large ones; where something besides the drive pushes, of several shares."""
        loaded = any(e.role == "force" and not e.place_free for e in screen.block.effects)
        shares = (1.0, 0.5, 0.0) if loaded else (1.0,)
        return [cls(size, share) for share in shares for size in (0.02, 0.1, 0.4)]
