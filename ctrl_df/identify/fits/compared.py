"""Fits compared: by their errors and parameters, and by their outputs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...thresholds import NOTHING
from ..estimation.segmented import CandidateFit
from ..shooting.noise_model import NoiseModel, whitened_power
from ..thresholds import DISTINGUISHED


def penalized(tried: CandidateFit) -> float:
    """Return the error at which a fit without further parameters would be as good as this one (Schwarz)."""
    count = max(tried.train.count, 1)
    return tried.train.rmse * count ** (0.5 * tried.extra / count)


def nearest(one: CandidateFit, other: CandidateFit) -> CandidateFit:
    """Return the better of two fits of an effect, with those beside it that the data do not tell from it.

    Over a few segments, waves of many lengths may err by the same. Fits in one minimum, with the same output
    within what the noise hides, are not two.
    """
    best, *others = sorted([one, other, *one.beside, *other.beside], key=penalized)
    noise = NoiseModel(np.zeros(0), best.train.rmse)

    def told_from(worse: CandidateFit) -> bool:
        behind = max(best.train.count, 1) * math.log(penalized(worse) / penalized(best))
        return behind > DISTINGUISHED or indistinguishable(best.outputs, worse.outputs, noise)

    return replace(best, beside=tuple(replace(t, beside=()) for t in others if not told_from(t)))


def indistinguishable(first, second, noise: NoiseModel, *, nats: float = DISTINGUISHED) -> bool:
    """Whether two candidates' outputs differ by less than the noise can distinguish.

    Parameters
    ----------
    first, second : sequence of arrays
        Simulated outputs, as evidence takes them (`CandidateFit.outputs`).
    noise : NoiseModel
        Of the better one's residual.
    nats : float
        Log likelihood ratio that distinguishes them.
    """
    difference = [a - b for a, b in zip(first, second, strict=True)]
    power, _ = whitened_power(difference, noise)
    return 0.5 * power / max(noise.sigma, NOTHING) ** 2 < nats
