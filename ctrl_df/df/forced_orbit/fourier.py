"""Fourier coefficients of a periodic output from the integrals of a shot."""

from __future__ import annotations

import numpy as np

from ...thresholds import NOTHING


def fourier(integrals, ends, omega, *, periods=1, mirrored=False, free=False):
    """Return Y_k, free of a steady drift and of a free mean.

    Parameters
    ----------
    integrals : (..., orders + 1) complex
        Of the output against exp(-j k omega t) over the shot.
    ends : (..., 2)
        The output at its start and end.
    omega : float or (...)
        Of the force [rad/s].
    periods : int
        Of the force in the shot.
    mirrored : bool
        Whether it took half a period of an orbit with half-wave symmetry.
    free : bool
        Whether the output shifts with a free position: its mean is then zero.
    """
    omega = np.asarray(omega)[..., None]
    period, k = 2 * np.pi / omega, np.arange(integrals.shape[-1])
    if mirrored:
        y = 4 / period * integrals
        center = 0.5 * (ends[..., 0] + ends[..., 1])
        # the integral of a constant over half a period is 2 / (j k omega)
        y[..., 1::2] -= center[..., None] * (4 / np.pi / (1j * k[1::2]))
        y[..., 0::2] = 0.0
        y[..., 0] = center
    else:
        y = integrals * 2 / (periods * period)
        drift = ends[..., 1] - ends[..., 0]
        y[..., 0] = y[..., 0] / 2 - drift / 2
        y[..., 1:] -= 1j * drift[..., None] / (np.pi * k[1:] * periods)
    if free:
        y[..., 0] = 0.0
    return y


def shifted(y, omega, *, delay=0.0, offset=0.0):
    """Return the coefficients of an output delayed by `delay` [s] and moved by `offset`."""
    omega = np.asarray(omega)[..., None]
    y = y * np.exp(-1j * np.arange(y.shape[-1]) * omega * delay) if delay else y.copy()
    y[..., 0] += offset
    return y


def even_share(y):
    """Largest even harmonic over the fundamental."""
    return np.max(np.abs(y[..., 2::2]), axis=-1, initial=0.0) / np.maximum(np.abs(y[..., 1]), NOTHING)
