"""Hysteresis that saturates."""

from dataclasses import dataclass
from typing import ClassVar

from ..effect import Effect, register_effect
from ..parameter import parameter


@register_effect
@dataclass(frozen=True)
class Hysteresis(Effect):
    """A force that builds up over a stroke after every reversal and then stays (Bouc-Wen).

    ``F = -force z``, ``stroke dz/dt = v - |v| |z|^(shape - 1) z``, so that z goes to 1 for v > 0. Felt pads,
    flexures, magnetic material, rubber: what yields plastically. After a reversal it is a spring of
    ``force/stroke`` at first. It stands beside the friction; where friction itself builds up over a small
    stroke, that is `Bristle`.

    Parameters
    ----------
    force : float
        Where it saturates [N], >= 0.
    stroke : float
        Over which it builds up [m], > 0.
    shape : float
        How sharply it bends over, >= 1: 1 as the exponential, large as a spring with a slider.

    Examples
    --------
    >>> flexure = cdf.Mass(2.0).with_effect(cdf.Hysteresis(4.0, stroke=0.1))
    >>> pushed = cdf.event_response(flexure, [0.0, 1.0], 3.0)  # below saturation: it swings about 1.1 strokes
    >>> bool(pushed.states[2, -1] < 1.0)
    True
    """

    force: float = parameter("N", meaning="saturated force")
    stroke: float = parameter("m", strict=True, default=0.01, meaning="stroke over which it builds up")
    shape: float = parameter("", lower=1.0, default=2.0, meaning="sharpness of the bend")

    role: ClassVar[str] = "force"
    states: ClassVar[int] = 1
    place_free: ClassVar[bool] = True
    proportional: ClassVar[bool] = True
    multimodal: ClassVar[bool] = True
    shows: ClassVar[str] = "error that builds up over a stroke after every reversal and then keeps its size"
    source: ClassVar[str] = "Bouc (1967); Wen (1976), with gamma = 0"

    @staticmethod
    def law(t, x, v, z, p, dz):
        """Return the force [N]."""
        dz[0] = (v - abs(v) * abs(z[0]) ** (p[2] - 1.0) * z[0]) / p[1]
        return -p[0] * z[0]

    def steady(self, level):
        """Return what z comes to."""
        return (1.0,)

    def distinct(self, stroke, at_bound):
        """Return whether motion bends it: over a tenth of its stroke the slope changes by 1/400."""
        return self.stroke < 10.0 * stroke

    def ranges(self, seen):
        """Return strokes that take a good part of a sample, and bends that are no corner.

        Shorter ones are dry friction. Of a shape of 100 the force differs from a corner's by 0.7 % (ln 2 over
        the shape), over 2 % of the stroke; the larger the shape, the shorter the steps it takes.
        """
        return {"stroke": (0.5 * seen.speed * seen.dt, float("inf")), "shape": (1.0, 100.0)}

    @classmethod
    def suggest(cls, screen):
        """Yield strokes of shares of the motion, at a tenth of the force."""
        s = screen.scales
        for share in (0.02, 0.06, 0.2, 0.5, 1.2):
            yield cls(0.1 * s.force, share * s.position)
