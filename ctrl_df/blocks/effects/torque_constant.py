"""A motor that is driven by current or voltage."""

from dataclasses import dataclass
from typing import ClassVar

from ..effect import Effect, register_effect
from ..parameter import parameter
from ..primitives import PiecewiseAffine


@register_effect
@dataclass(frozen=True)
class TorqueConstant(Effect):
    """The input is a current [A], ``F = constant i``, or, given the resistance, a voltage [V].

    ``F = constant (u - constant v) / resistance``: the back-EMF brakes like viscous friction. The inductance
    is left out; `InputLag` stands for it. A record of voltage and motion distinguishes constant and
    inertia by the back-EMF alone, one of current not at all: then hold the inertia
    (``refit(..., free=...)``).

    Parameters
    ----------
    constant : float
        Force over current [N/A], which is back-EMF over speed [V s/m]; > 0.
    resistance : float
        Of the winding [V/A]; 0: the input is a current.

    Examples
    --------
    >>> motor = cdf.Inertia(1e-4).with_effect(cdf.TorqueConstant(0.05, resistance=2.0))
    >>> motor.signals["torque"]
    'V'
    >>> round(float(motor.dynamics(0, [0.0, 100.0], [12.0])[1]))  # 0.05 N m/A (12 V - 5 V) / 2 ohm
    1750
    """

    constant: float = parameter("N/A", strict=True, meaning="force over current")
    resistance: float = parameter("V/A", default=0.0, free=False, meaning="resistance; 0: driven by current")

    role: ClassVar[str] = "input"
    affine: ClassVar[bool] = True
    place_free: ClassVar[bool] = True
    shows: ClassVar[str] = "error proportional to the input, and to the speed"
    source: ClassVar[str] = "permanent-magnet motor"

    @classmethod
    def applicable(cls, block):
        """Return False: what goes in is known, and nothing to be found out."""
        return False

    @property
    def input_unit(self) -> str:  # type: ignore[override]
        """Unit of what goes in."""
        return "V" if self.resistance > 0 else "A"

    def channel(self):
        """Return the straight line from current or voltage to force at standstill."""
        gain = self.constant / self.resistance if self.resistance > 0 else self.constant
        return (PiecewiseAffine.from_corners((), (gain,), (0.0,)),)

    @staticmethod
    def law(t, x, v, z, p, dz):
        """Return the force of the back-EMF [N]."""
        return -p[0] * p[0] / p[1] * v if p[1] > 0.0 else 0.0
