"""Friction behind a linkage that yields and has play."""

import math
from dataclasses import dataclass
from typing import ClassVar

from ..core import is_kinetic
from ..effect import Effect, register_effect
from ..parameter import parameter
from .bristle import Bristle


@register_effect
@dataclass(frozen=True)
class LooseLinkage(Effect):
    """The block's dry friction acts through a spring with play: none of it for a while after a reversal.

    ::

              F│      ┌─────        with b = z beyond the gap on either side, q = stiffness b / g(v):
               │     ╱
        ───────┼────╱───── x        dz/dt = v - |v| |q|^(shape - 1) q,  F = -(stiffness b + damping db/dt)
               │├gap┤
         ──────┘

    g(v) is the kinetic level of all the block's dry friction. The spring unloads, the gap is crossed at no
    force, the spring on the other side is loaded until the friction slips. Clevis and pin of a damper, worn
    keys, a pawl. Without a gap it is a `Bristle` whose bend is as sharp as `shape` says.

    Parameters
    ----------
    stiffness : float
        Of the linkage [N/m], > 0.
    gap : float
        Total clearance [m], >= 0.
    damping : float
        Of the linkage while it bears [N s/m], >= 0.
    shape : float
        How sharply slip sets in, >= 1: 1 as the exponential, large as a spring with a slider.

    Examples
    --------
    >>> damper = cdf.Massless().with_effect(cdf.Coulomb(100.0)).with_effect(cdf.LooseLinkage(1e5, gap=0.01))
    >>> t = np.linspace(0, 2, 401)
    >>> F = np.asarray(cdf.imposed_response(damper, t, 0.02 * np.sin(np.pi * t)).outputs)[0]
    >>> round(float(F[95])), round(float(F[160])), round(float(F[195]))  # slips, in the gap, slips back
    (100, 0, -100)
    """

    stiffness: float = parameter("N/m", strict=True, meaning="stiffness of the linkage")
    gap: float = parameter("m", default=0.001, meaning="total clearance")
    damping: float = parameter("N s/m", default=0.0, meaning="damping of the linkage")
    shape: float = parameter("", lower=1.0, default=2.0, meaning="sharpness of slip")

    role: ClassVar[str] = "presliding"
    states: ClassVar[int] = 1
    multimodal: ClassVar[bool] = True
    generalizes: ClassVar[type[Effect] | None] = Bristle
    nonsmooth: ClassVar[bool] = True
    table_starts: ClassVar[int] = 2
    shows: ClassVar[str] = (
        "error after every reversal: the real force falls to nothing, stays there over a stroke, and only "
        "then builds up"
    )
    source: ClassVar[str] = "Canudas de Wit et al. (1995), with a dead zone in the bristle's spring"

    @staticmethod
    def law(v, level, z, p, dz):
        """Return the force [N] of a linkage stretched by z[0], under a dry friction of `level` [N]."""
        half = 0.5 * p[1]
        bend = z[0] - half if z[0] > half else (z[0] + half if z[0] < -half else 0.0)
        rate = v
        if level > 0.0 and not math.isinf(level):
            share = p[0] * bend / level
            rate -= abs(v) * abs(share) ** (p[3] - 1.0) * share
        dz[0] = rate
        force = p[0] * bend
        if bend != 0.0:
            force += p[2] * rate
        return -force

    def steady(self, level):
        """Return how far it is stretched where the friction slips [m]."""
        return (level / self.stiffness + 0.5 * self.gap,)

    @classmethod
    def applicable(cls, block):
        """Return whether there is a kinetic level that slips."""
        return any(map(is_kinetic, block.effects))

    @classmethod
    def suggest(cls, screen):
        """Yield gaps and deflections of shares of the stroke."""
        level = max(screen.friction, 0.05 * screen.scales.force)
        for gap in (0.03, 0.1, 0.3):
            for bend in (0.02, 0.1):
                yield cls(level / (bend * screen.scales.position), gap * screen.scales.position)

    @classmethod
    def suggest_on_plane(cls, plane):
        """Yield gaps of shares of the amplitudes."""
        for gap in plane.amplitude.over(4, 0.3, 0.3):
            yield cls(max(plane.friction, 0.02 * plane.force.high) / gap, gap), 1.0

    def distinct(self, stroke, at_bound):
        """Return whether it has a gap to speak of; without one it is a bristle."""
        return "gap" not in at_bound and self.gap > 2e-3 * stroke

    def ranges(self, seen):
        """Return what does not settle much faster than a sample, gaps within the motion, bends to a corner.

        Of a shape of 100 the force differs from that of a spring with a slider by 0.7 % (see `Hysteresis`).
        """
        stiffness = 2 * seen.force / (seen.speed * seen.dt)
        return {
            "stiffness": (0.0, stiffness), "gap": (0.0, 4 * seen.position),
            "damping": (0.0, 2 * seen.mass / seen.dt), "shape": (1.0, 100.0),
        }  # fmt: skip
