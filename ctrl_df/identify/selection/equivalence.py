"""Effects that are the same map on these data: found by comparing what they make of the output."""

from __future__ import annotations

from ..estimation.noise_model import NoiseModel, whitened_power
from ..thresholds import NOTHING, TOLD_APART


def indistinguishable(first, second, noise: NoiseModel, *, nats: float = TOLD_APART) -> bool:
    """Whether two candidates' outputs differ by no more than the noise lets one see.

    Parameters
    ----------
    first, second : sequence of arrays
        Simulated outputs, as evidence takes them (`CandidateFit.outputs`).
    noise : NoiseModel
        Of the better one's residual.
    nats : float
        Log likelihood ratio that would tell them apart.
    """
    difference = [a - b for a, b in zip(first, second, strict=True)]
    power, _ = whitened_power(difference, noise)
    return 0.5 * power / max(noise.sigma, NOTHING) ** 2 < nats
