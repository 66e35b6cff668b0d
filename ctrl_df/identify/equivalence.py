"""Effects that are the same map on these data: found by comparing what they make of the output."""

from __future__ import annotations

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
