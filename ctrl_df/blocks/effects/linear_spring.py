"""A linear spring to ground."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..effect import register_effect
from ..parameter import parameter
from .spring import Spring


@register_effect
@dataclass(frozen=True)
class LinearSpring(Spring):
    """A spring to ground, ``F = -k (x - center)``.

    Parameters
    ----------
    stiffness : float
        k [N/m]; negative: it pushes away from the center.
    center : float
        Position of zero force [m].

    Examples
    --------
    >>> axis = cdf.Mass(2.0).with_effect(cdf.LinearSpring(200.0))
    >>> print(f"{cdf.describing_function(axis, 1.0, 5.0).real:.6f}")  # 1 / (200 - 2 * 25)
    0.006667
    """

    stiffness: float = parameter("N/m", lower=-math.inf, meaning="spring stiffness")
    center: float = parameter(
        "m", lower=-math.inf, default=0.0, free=False, origin=True, meaning="position of zero force"
    )

    role: ClassVar[str] = "force"
    proportional: ClassVar[bool] = True
    affine: ClassVar[bool] = True
    shows: ClassVar[str] = "error proportional to position"
    source: ClassVar[str] = "Hooke"

    @classmethod
    def regress(cls, screen):
        """Yield the springs that the slope of the force over the place says, without preload and with it."""
        x = screen.motion.x
        for columns in ([x], [x, np.ones(len(x))]):
            fit = screen.force_fit(columns)
            stiffness, preload = fit.weights[0], sum(fit.weights[1:])
            # what pushes away about a place of its own is a body that falls over: gravity
            if fit.sensible and (stiffness > 0 or (stiffness and len(columns) == 1)):
                yield cls(stiffness, -preload / stiffness), fit.values

    @staticmethod
    def law(t, x, v, z, p, dz):
        """Return the force [N]."""
        return -p[0] * (x - p[1])
