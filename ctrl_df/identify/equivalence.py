"""Effects that are the same map on these data: found by comparing what they make of the output."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from .residual_tests import NoiseModel, noise_model


def whitener(residuals: Sequence[np.ndarray]) -> NoiseModel:
    """Fit one noise model to the residuals of several records."""
    longest = max(residuals, key=len)
    return noise_model(longest - np.mean(longest), max_order=12)


def whitened_power(residuals: Sequence[np.ndarray], noise: NoiseModel, masks=None) -> tuple[float, int]:
    """Return the sum of squares of the whitened residuals, and their number."""
    total, count = 0.0, 0
    for i, r in enumerate(residuals):
        w = noise.whiten(r)[noise.order :]
        if masks is not None:
            w = w[masks[i][noise.order :]]
        total += float(w @ w)
        count += len(w)
    return total, count


def indistinguishable(first, second, noise: NoiseModel, *, nats: float = 6.0) -> bool:
    """Whether two candidates' outputs differ by no more than the noise lets one see.

    Parameters
    ----------
    first, second : sequence of arrays
        Simulated outputs, one a record.
    noise : NoiseModel
        Of the better one's residual.
    nats : float
        Log likelihood ratio that would tell them apart.
    """
    difference = [a - b for a, b in zip(first, second, strict=True)]
    power, _ = whitened_power(difference, noise)
    return 0.5 * power / max(noise.sigma, 1e-300) ** 2 < nats


def classes(candidates, outputs, noise: NoiseModel, alike) -> list[list[int]]:
    """Group candidates, best first: each joins the first class whose leader it cannot be told from.

    `alike(i, j)` decides; `outputs` are not looked at where it is None.
    """
    groups: list[list[int]] = []
    for i in range(len(candidates)):
        for group in groups:
            if alike(group[0], i):
                group.append(i)
                break
        else:
            groups.append([i])
    return groups


def coloured_floor(residual, velocity, dt: float) -> tuple[float, float]:
    """Split the rms of a residual into noise and structure.

    Motion lives at low frequency. The density of the residual just above the band of motion, continued flat
    below it, is taken for noise (white, or of a colour with a plateau); what stands above it inside the band is
    structure.

    Returns
    -------
    (float, float)
        rms of noise, rms of structure.
    """
    from scipy.signal import welch

    n = len(residual)
    length = min(n, max(64, n // 4))
    f, p = welch(residual - np.mean(residual), 1 / dt, nperseg=length, detrend=False)  # pyright: ignore[reportArgumentType]
    _, py = welch(velocity, 1 / dt, nperseg=length, detrend="constant")
    energy = np.cumsum(py)
    edge = f[min(int(np.searchsorted(energy, 0.97 * energy[-1])), len(f) - 1)]
    low = min(max(2.0 * edge, 8 * f[1]), 0.25 * f[-1])
    inside = f <= low
    above = (f > low) & (f <= 2 * low)
    level = float(np.mean(p[above])) if np.any(above) else float(np.median(p))
    noise = np.where(inside, np.minimum(p, level), p)
    step = f[1]
    noise_power = float(np.sum(noise)) * step
    total = float(np.mean(np.square(residual)))
    return math.sqrt(max(noise_power, 0.0)), math.sqrt(max(total - noise_power, 0.0))
