"""Presliding by several elements: friction that gives way bit by bit."""

import math
from dataclasses import dataclass
from typing import ClassVar

from ..core import is_kinetic
from ..effect import Effect, register_effect
from ..parameter import parameter
from .bristle import Bristle

ELEMENTS = 4


@register_effect
@dataclass(frozen=True)
class MaxwellSlip(Effect):
    """The block's dry friction acts through springs side by side that slip one after another.

    Four elements of equal level g(v)/4 and stiffnesses k1 to k4 in geometric steps, k1/k4 = `spread`:
    ``dz_i/dt = v - |v| |q_i| q_i`` with ``q_i = 4 k_i z_i / g(v)``, and
    ``F = -sum(k_i z_i + damping/4 dz_i/dt)``; g(v) is the kinetic level of all the block's dry friction. The
    force builds up fast at first and then ever more slowly, over a stroke `spread` times as long as that of
    the stiffest element: presliding with more than one pole, with the memory of inner loops. `Bristle` has
    one element.

    Parameters
    ----------
    stiffness : float
        Of all elements together, before any slips [N/m], > 0.
    spread : float
        Stiffness of the stiffest element over that of the softest, >= 1.
    damping : float
        [N s/m], >= 0.

    Examples
    --------
    >>> joint = cdf.Mass(2.0).with_effect(cdf.Coulomb(3.0)).with_effect(cdf.MaxwellSlip(5e4, spread=30.0))
    >>> joint.nstates  # position, speed, four elements
    6
    """

    stiffness: float = parameter("N/m", strict=True, meaning="stiffness of all elements")
    spread: float = parameter("", lower=1.0, default=10.0, meaning="stiffest element over softest")
    damping: float = parameter("N s/m", default=0.0, meaning="damping of the elements")

    role: ClassVar[str] = "presliding"
    states: ClassVar[int] = ELEMENTS
    multimodal: ClassVar[bool] = True
    generalizes: ClassVar[type[Effect] | None] = Bristle
    table_starts: ClassVar[int] = 2
    shows: ClassVar[str] = (
        "error around every reversal, where the real friction builds up fast at first, then over a long "
        "stroke"
    )
    source: ClassVar[str] = "Al-Bender, Lampaert & Swevers (2005), slip rounded as by Bouc and Wen"

    @staticmethod
    def law(v, level, z, p, dz):
        """Return the force [N] of elements stretched by z, under a dry friction of `level` [N]."""
        step = p[1] ** (-1.0 / 3.0)
        k = p[0] / (1.0 + step + step * step + step * step * step)
        force = 0.0
        for i in range(4):
            rate = v
            if level > 0.0 and not math.isinf(level):
                q = 4.0 * k * z[i] / level
                rate -= abs(v) * abs(q) * q
            dz[i] = rate
            force += k * z[i] + 0.25 * p[2] * rate
            k *= step
        return -force

    def steady(self, level):
        """Return how far they are stretched where they slip [m]."""
        steps = [self.spread ** (-i / 3.0) for i in range(ELEMENTS)]
        return tuple(0.25 * level * sum(steps) / (self.stiffness * s) for s in steps)

    @classmethod
    def applicable(cls, block):
        """Return whether there is a kinetic level that slips."""
        return any(map(is_kinetic, block.effects))

    @classmethod
    def suggest(cls, screen):
        """Yield elements of which the softest slips after shares of the stroke."""
        level = max(screen.friction, 0.05 * screen.scales.force)
        for last in (0.03, 0.1, 0.3):
            for spread in (10.0, 100.0):
                steps = [spread ** (-i / 3.0) for i in range(ELEMENTS)]
                softest = 0.25 * level / (last * screen.scales.position)
                yield cls(softest * sum(steps) * spread, spread)

    @classmethod
    def from_special(cls, special):
        """Return elements that slip nearly together."""
        known = special.parameters
        return cls(known["stiffness"].value, 3.0, known["damping"].value)

    @classmethod
    def suggest_on_plane(cls, plane):
        """Yield elements that slip over shares of the amplitudes."""
        for bend in plane.amplitude.over(4, 0.3, 0.3):
            yield cls(3.0 * max(plane.friction, 0.02 * plane.force.high) / bend), 1.0

    def distinct(self, stroke, at_bound):
        """Return whether there is more than one element to be told."""
        return self.spread > 2.0

    def ranges(self, seen):
        """Return what does not settle much faster than a sample: that is not seen, and a stiff equation."""
        stiffness = 2 * seen.force / (seen.speed * seen.dt)
        return {
            "stiffness": (0.0, stiffness),
            "spread": (1.0, 1e4),
            "damping": (0.0, 2 * seen.mass / seen.dt),
        }
