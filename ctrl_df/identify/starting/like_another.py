"""One law in the place of another: the parameters with which it does most nearly the same along a motion."""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from ...blocks.effect import Effect
from .own_laws import acts_along, force_along
from .thresholds import LIKE_LEFT, LIKE_SAMPLES


def like_another(effect: Effect, other: Effect, x: np.ndarray, v: np.ndarray) -> Effect | None:
    """Return an effect with the parameters that make it act most like another one.

    A pendulum is a ripple as long as a turn, drag over a narrow range of speeds viscous friction, a Stribeck
    curve beyond all speeds Coulomb friction: where the fit of the one has not come as far as that of the
    other it may begin there.

    Parameters
    ----------
    effect, other : Effect
        With the values that fits came to.
    x, v : (n,) arrays
        The motion.

    Returns
    -------
    Effect or None
        None where it cannot do what the other does, or where the motion alone does not determine one.
    """
    names = [k for k, p in effect.parameters.items() if p.estimated and not p.stepped]
    if not (names and acts_along(effect) and acts_along(other)):
        return None
    every = max(len(x) // LIKE_SAMPLES, 1)
    x, v = x[::every], v[::every]
    table = [effect.parameters[k] for k in names]

    def made(values):
        return effect.replace(**dict(zip(names, map(float, values), strict=True)))

    wanted = force_along(other, x, v)
    low, high = np.array([(p.lower, p.upper) for p in table]).T
    begin = np.clip([p.value for p in table], low, high)
    try:
        found = least_squares(
            lambda values: force_along(made(values), x, v) - wanted, begin, bounds=(low, high), x_scale="jac"
        )
        return made(found.x) if np.mean(found.fun**2) < LIKE_LEFT * np.mean(wanted**2) else None
    except (ValueError, ArithmeticError):  # a value that the law refuses, on the way
        return None
