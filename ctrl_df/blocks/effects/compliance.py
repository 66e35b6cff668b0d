"""An elastic joint between motor and load."""

from dataclasses import dataclass
from typing import ClassVar

from ..effect import Effect, register_effect
from ..parameter import parameter


@register_effect
@dataclass(frozen=True)
class Compliance(Effect):
    """An elastic joint: ``F_load = k (x_motor - x) + c (v_motor - v)``.

    Together with `Backlash` the spring acts outside the gap only. Added to a single `Mass`, it splits off
    `load_fraction` of it as the load.

    Parameters
    ----------
    stiffness : float
        k [N/m], > 0.
    damping : float
        c [N s/m], >= 0.
    load_fraction : float
        Share of a single mass that lies behind the joint, in (0, 1); no meaning in a two-mass block.
    """

    stiffness: float = parameter("N/m", strict=True, meaning="joint stiffness")
    damping: float = parameter("N s/m", default=0.0, meaning="joint damping")
    load_fraction: float = parameter(
        "", strict=True, upper=0.999, default=0.5, meaning="share of a single mass behind the joint"
    )

    role: ClassVar[str] = "coupling"
    multimodal: ClassVar[bool] = True
    affine: ClassVar[bool] = True
    shows: ClassVar[str] = "a resonance in the error spectrum, ringing after every step of force"
    source: ClassVar[str] = "two-mass drive, e.g. Vukosavic & Stojic (1998)"
    remedy: ClassVar[str] = "For a stiff joint leave the effect out."

    @staticmethod
    def law(t, x, v, z, p, dz):
        """Return the force on the load [N]; `x` and `v` are those of the motor beyond the load."""
        return p[0] * x + p[1] * v
