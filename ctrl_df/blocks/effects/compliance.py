"""An elastic joint between motor and load."""

import itertools
import math
from dataclasses import dataclass
from typing import ClassVar

from ..effect import Effect, register_effect
from ..parameter import parameter


@register_effect
@dataclass(frozen=True)
class Compliance(Effect):
    """An elastic joint: ``F_load = k (x_motor - x) + c (v_motor - v)``.

    Together with `Backlash` the spring acts outside the gap only. Added to a single `Mass`, it splits off
    `load_fraction` of it as the load; the sensor sees the load unless the block has ``measured="motor"``.

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
        "", strict=True, upper=0.999, default=0.5, known_as="load_fraction",
        meaning="share of a single mass behind the joint",
    )  # fmt: skip

    role: ClassVar[str] = "coupling"
    multimodal: ClassVar[bool] = True
    ill_conditioned: ClassVar[bool] = True
    affine: ClassVar[bool] = True
    table_starts: ClassVar[int] = 2
    shows: ClassVar[str] = "a resonance in the error spectrum, ringing after every step of force"
    source: ClassVar[str] = "two-mass drive, e.g. Vukosavic & Stojic (1998)"
    remedy: ClassVar[str] = "For a stiff joint leave the effect out."

    @staticmethod
    def law(t, x, v, z, p, dz):
        """Return the force on the load [N]; `x` and `v` are those of the motor beyond the load."""
        return p[0] * x + p[1] * v

    @classmethod
    def suggest(cls, screen):
        """Yield joints that the force bends by shares of the stroke."""
        s = screen.scales
        shares = (0.3, 0.6) if screen.bodies == 1 else (0.5,)
        for bend, share in itertools.product((0.003, 0.01, 0.03, 0.08, 0.2, 0.5), shares):
            k = share * s.force / (bend * s.position)
            yield cls(k, 0.12 * math.sqrt(k * share * (1 - share) * s.mass), share)

    @classmethod
    def suggest_on_plane(cls, plane):
        """Yield joints that resonate within the frequencies measured or above them."""
        for resonance, share in itertools.product(plane.omega.over(5, 1.0, 8.0), (0.3, 0.6)):
            stiffness = share * (1 - share) * plane.mass * resonance**2
            yield cls(stiffness, 0.1 * stiffness / resonance, share), 1.0

    def ranges(self, seen):
        """Return what does not settle much faster than a sample, with something on either side.

        And what resonates within the Nyquist frequency, whatever the share of the load: faster ringing passes
        for slow motion between the samples (aliasing), and so for slow noise.
        """
        stiffest = 0.25 * seen.mass * (math.pi / seen.dt) ** 2
        return {
            "stiffness": (0.0, stiffest), "damping": (0.0, 0.1 * seen.mass / seen.dt),
            "load_fraction": (0.05, 0.95),
        }  # fmt: skip

    def distinct(self, stroke, at_bound):
        """Return whether there is a load behind it: else it is a dashpot, in the place of other friction."""
        return "load_fraction" not in at_bound
