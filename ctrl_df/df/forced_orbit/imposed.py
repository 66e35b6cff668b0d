"""The force along an imposed sine, and its harmonics."""

from __future__ import annotations

import math

import numpy as np

from ...simulate.imposed import imposed_forces, path_of

SAMPLES = 1024
"""A period: harmonics of a dry friction's square wave are then right to 1e-6 (the square of a step)."""

LAPS, SETTLED, CREEPING = 64, 1e-8, 1e-3
"""Periods at most until what is hidden repeats; its change over one, over the largest it is, that counts as
none, and up to which an orbit that creeps on ever more slowly is taken for its limit, to that accuracy.
"""


def force_harmonics(core, amplitude: float, omega: float, orders: int) -> tuple[np.ndarray, float]:
    """Return the harmonics (orders + 1,) over the amplitude, and how well the orbit of hidden states closes.

    NaN where they have not settled.
    """
    # the motion turns midway between samples: a jump there costs the sum nothing
    phase = 2 * math.pi * (np.arange(SAMPLES + 1) + 0.5) / SAMPLES
    path = path_of(phase / omega, amplitude * np.cos(phase), -amplitude * omega * np.sin(phase))
    z, residual = np.zeros((1, core.nstates - 2)), math.inf
    for _ in range(LAPS):
        force, _, states = imposed_forces([core], path, z, states=True)
        before, z = z, states[:, -1]
        size = np.maximum(np.max(np.abs(states), axis=1), 1e-300)
        residual = float(np.max(np.abs(z - before) / size, initial=0.0))
        if residual <= SETTLED or not math.isfinite(residual):
            break
    if residual > CREEPING or not np.all(np.isfinite(force)):
        return np.full(orders + 1, np.nan, complex), math.nan
    k = np.arange(orders + 1)[:, None]
    y = 2.0 * np.mean(force[0, :SAMPLES] * np.exp(-1j * k * phase[:SAMPLES]), axis=1)
    y[0] *= 0.5
    return y / amplitude, residual
