"""The grid to which the values of a rounded signal keep."""

from __future__ import annotations

import math

import numpy as np

from .thresholds import GRID_CONTRAST, GRID_FINE, GRID_PER_TURN, GRID_RANGE, GRID_STEPS


def value_grid(y, noise: float) -> float:
    """Return the step of the grid: where the mean of exp(2 pi j y / step) has modulus near one.

    Parameters
    ----------
    y : (n,) array
        The signal.
    noise : float
        Error of a model that does not round; 0 is returned where it is none.
    """
    span = float(np.ptp(y))
    if span == 0 or noise == 0:
        return 0.0
    # An error of the size seen belongs to a step of sqrt(12) times it; look half a decade to both sides.
    guess = math.sqrt(12) * noise
    low, high = GRID_RANGE[0] * guess, min(GRID_RANGE[1] * guess, 2 * span)
    fewest, most = GRID_STEPS
    count = int(min(max((1 / low - 1 / high) * span * GRID_PER_TURN, fewest), most))
    inverse = np.linspace(1 / high, 1 / low, count)
    some = y[:: max(1, len(y) // most)]
    contrast = _contrast(some, inverse)
    # Finer grids that hold this one fit as well: of all that stand out, the coarsest.
    inner = contrast[1:-1]
    peaks = 1 + np.flatnonzero(
        (inner >= contrast[:-2]) & (inner >= contrast[2:]) & (inner > GRID_CONTRAST * contrast.max())
    )
    at = int(peaks[0]) if len(peaks) else int(np.argmax(contrast))
    fine = np.linspace(inverse[max(at - 1, 0)], inverse[min(at + 1, count - 1)], GRID_FINE)
    return float(1 / fine[int(np.argmax(_contrast(some, fine)))])


def _contrast(values, inverse) -> np.ndarray:
    """Return how well values keep to grids of the steps ``1 / inverse``, evenly spaced: 1 on the grid."""
    phases = np.exp(2j * math.pi * values * inverse[0])
    turn = np.exp(2j * math.pi * values * (inverse[1] - inverse[0]))
    found = np.empty(len(inverse))
    for i in range(len(inverse)):
        found[i] = abs(np.mean(phases))
        phases *= turn
    return found
