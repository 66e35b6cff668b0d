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

    Examples
    --------
    >>> drive = cdf.TwoMass(1.0, 8.0).with_effect(cdf.Compliance(500.0, damping=0.5))
    >>> print(f"{abs(cdf.describing_function(drive, 1.0, 5.0)):.6f}")  # linear: the same at every amplitude
    0.004651
    >>> print(f"{abs(cdf.describing_function(drive, 9.0, 5.0)):.6f}")
    0.004651
    """

    stiffness: float = parameter("N/m", strict=True, meaning="joint stiffness")
    damping: float = parameter("N s/m", default=0.0, meaning="joint damping")
    load_fraction: float = parameter(
        "", strict=True, upper=0.999, default=0.5, meaning="share of a single mass behind the joint"
    )

    role: ClassVar[str] = "coupling"
    multimodal: ClassVar[bool] = True
    shows: ClassVar[str] = "a resonance in the error spectrum, ringing after every step of force"
    source: ClassVar[str] = "two-mass drive, e.g. Vukosavic & Stojic (1998)"
    remedy: ClassVar[str] = "For a stiff joint leave the effect out."
