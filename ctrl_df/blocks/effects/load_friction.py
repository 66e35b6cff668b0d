"""Dry friction on the load side."""

from dataclasses import dataclass
from typing import ClassVar

from ..effect import Effect, register_effect
from ..parameter import parameter


@register_effect
@dataclass(frozen=True)
class LoadFriction(Effect):
    """Coulomb friction that acts on the load, behind the joint; on a rigid block it is the same as `Coulomb`.

    Parameters
    ----------
    level : float
        Level [N], >= 0.

    Examples
    --------
    >>> drive = cdf.TwoMass(1.0, 8.0).with_effect(cdf.Backlash(0.01)).with_effect(cdf.LoadFriction(2.0))
    >>> drive.parameters["load_friction.level"].value
    2.0
    """

    level: float = parameter("N", meaning="Coulomb level on the load")

    role: ClassVar[str] = "friction"
    proportional: ClassVar[bool] = True
    nonsmooth: ClassVar[bool] = True
    multimodal: ClassVar[bool] = True
    ill_conditioned: ClassVar[bool] = True
    affine: ClassVar[bool] = True
    side: ClassVar[str] = "load"
    shows: ClassVar[str] = "a step in the error when the load reverses, later than the motor does"
    source: ClassVar[str] = "Azenha & Machado (1997), eq. (6), on mass M1"

    @staticmethod
    def law(moving, direction, speed, base, p):
        """Return the level [N]."""
        return base + p[0]

    @classmethod
    def regress(cls, screen):
        """Yield shares of the dry friction on the motor, taken from it: where both move the two are one."""
        dry = screen.force_fit([]).dry
        for share in (0.25, 0.5, 0.75) if dry is not None and screen.friction > 0 else ():
            yield cls(share * screen.friction), {dry: (1 - share) * screen.friction}

    @classmethod
    def suggest_on_plane(cls, plane):
        """Return shares of the model's friction, taken from it."""
        return plane.taken_from_friction(cls)
