"""Complex errors of points: their size, those that are of another motion, how probable they are."""

from __future__ import annotations

import math

import numpy as np

from ...thresholds import NOTHING
from ..thresholds import EXPONENT
from .thresholds import GROSS, MIXTURE_ROUNDS, OUTLYING_LEAST, OUTLYING_POINT, OUTLYING_SHARE


def rms(error) -> float:
    """Return the root mean square of complex errors."""
    return math.sqrt(float(np.mean(np.abs(error) ** 2))) if len(error) else math.nan


def outlying(error) -> np.ndarray:
    """Return which points err by ten times the median: one in sixteen (two) at most, else none.

    Motions coexist (backlash, ripple): where the drive was found in another one than the model, or was
    measured badly, the two differ by as much as N itself, and say nothing of the rest of the plane.
    """
    size = np.abs(error)
    far = (
        size > np.maximum(OUTLYING_POINT * np.median(size), OUTLYING_LEAST)
        if len(size)
        else np.zeros(0, bool)
    )
    return far if np.count_nonzero(far) <= max(len(size) // OUTLYING_SHARE, 2) else np.zeros(len(size), bool)


def log_density(error, least: float) -> tuple[np.ndarray, float]:
    """Return the log density [nats] of every point's error, and the variance of what is mere scatter.

    Parameters
    ----------
    error : (n,) complex array
        Taken as a mixture: scatter of a variance fitted to them, and a few gross errors about as large as N.
    least : float
        The variance is no less.
    """
    size = np.abs(error) ** 2
    gross = GROSS * np.exp(-np.minimum(size, EXPONENT))

    def usual(variance):
        return (1 - GROSS) / variance * np.exp(-np.minimum(size / variance, EXPONENT))

    best = (np.full(len(size), -np.inf), least)
    for variance in (float(np.mean(size)), float(np.median(size)) / math.log(2)):
        variance = max(variance, least)
        for _ in range(MIXTURE_ROUNDS):
            scattered = usual(variance)
            share = scattered / (scattered + gross)
            variance = max(float(share @ size) / max(float(share.sum()), NOTHING), least)
        density = np.log(usual(variance) + gross)
        if density.sum() > best[0].sum():
            best = density, variance
    return best
