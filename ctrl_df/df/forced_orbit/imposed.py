"""The force along an imposed sine, and its harmonics."""

from __future__ import annotations

import math

import numpy as np

from ...simulate.imposed import harmonics, imposed_forces, sine_path
from ...thresholds import NOTHING
from ..thresholds import CREEPING, HIDDEN_SETTLED, IMPOSED_SAMPLES, PERIODS_AT_MOST


def force_harmonics(core, amplitude: float, omega: float, orders: int) -> tuple[np.ndarray, float]:
    """Return the harmonics (orders + 1,) over the amplitude, and how well the orbit of hidden states closes.

    NaN where they have not settled.
    """
    # the motion turns midway between samples: a jump there costs the sum nothing
    phase = 2 * math.pi * (np.arange(IMPOSED_SAMPLES + 1) + 0.5) / IMPOSED_SAMPLES
    path = sine_path(amplitude, omega, phase)
    z, residual = np.zeros((1, core.nstates - 2)), math.inf
    for _ in range(PERIODS_AT_MOST):
        force, _, states = imposed_forces([core], path, z, states=True)
        before, z = z, states[:, -1]
        size = np.maximum(np.max(np.abs(states), axis=1), NOTHING)
        residual = float(np.max(np.abs(z - before) / size, initial=0.0))
        if residual <= HIDDEN_SETTLED or not math.isfinite(residual):
            break
    if residual > CREEPING or not np.all(np.isfinite(force)):
        return np.full(orders + 1, np.nan, complex), math.nan
    return harmonics(force[0, :-1], phase[:-1], orders) / amplitude, residual
