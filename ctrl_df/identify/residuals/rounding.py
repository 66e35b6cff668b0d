"""Evidence that a sensor rounds: values keep to a grid, and the model tells which line comes next.

The error of a rounded signal is no noise: it is the distance to the next line of the grid. A model that is
right to a few hundredths of a step still errs by a whole one wherever the motion passes the middle between
two lines, so the size of its residual says little. What is compared here is how probable the recorded
values are.
"""

from __future__ import annotations

import math

import numpy as np

from ..data.measurement import Measurement
from ..data.signals import step_of
from ..prediction.sensed import sensed
from .thresholds import LINE_SPREAD, ROUNDING_COARSE, ROUNDING_SPREAD, STRAY


def rounding_evidence(measured, simulated, step: float) -> float:
    """Return the log likelihood of values under rounding, given what a model says before it.

    Parameters
    ----------
    measured, simulated : lists of (n,) arrays
        Per record [m].
    step : float
        Of the grid, whose lines are its multiples [m].

    Returns
    -------
    float
        In nats, with the spread about the lines and the model's own error at their likeliest values; -inf
        where the model is further off than rounding explains.
    """
    from scipy.optimize import minimize_scalar

    y, x = np.concatenate(measured), np.concatenate(simulated)
    if len(y) == 0:
        return 0.0
    if float(np.sqrt(np.mean((y - x) ** 2))) > ROUNDING_COARSE * step:
        return -math.inf
    line = np.round(y / step)
    spread = max(float(np.sqrt(np.mean((y / step - line) ** 2))), LINE_SPREAD)
    about = -len(y) * math.log(spread * step * math.sqrt(2 * math.pi * math.e))
    distance = line - x / step
    found = minimize_scalar(
        lambda s: -_lines(distance, math.exp(s)), bounds=ROUNDING_SPREAD, method="bounded"
    )
    return about - float(found.fun)  # pyright: ignore[reportAttributeAccessIssue]


def steps_of_outputs(record: Measurement) -> list[float]:
    """Return the steps that the outputs of a record are rounded to, as `sensed` weighs them; 0: to none."""
    known = sensed(record)
    return [w * step_of(y) for w, y in zip(known.weights, known.values, strict=True)]


def error_of_rounding(values: np.ndarray, step: float, at: float) -> np.ndarray:
    """Return what values err by that are rounded to a grid, with a line at this share of a step."""
    if not step:
        return np.zeros(len(values))
    x = values / step - at
    return step * (np.round(x) - x)


def _lines(distance, error: float) -> float:
    """Return the log probability of the lines seen, `distance` from a model with that `error`, in steps."""
    from scipy.special import ndtr

    sure = ndtr((distance + 0.5) / error) - ndtr((distance - 0.5) / error)
    return float(np.sum(np.log((1 - STRAY) * sure + 0.5 * STRAY)))
