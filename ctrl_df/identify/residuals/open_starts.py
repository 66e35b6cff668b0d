"""What noise makes of an error where motion is sensitive to its start."""

from __future__ import annotations

import math

import numpy as np

from ..estimation.fit import FitResult
from ..estimation.segmented import SegmentedData
from .thresholds import NOISES_TRIED


def made_by_open_starts(fit: FitResult, data: SegmentedData, noise: float) -> float:
    """Return the rms by which a fit moves where its initial states are off by their standard errors.

    The larger of several draws. Where a fit is a minimum of a sum of squares that is nearly quadratic, this
    is less than the noise that leaves them open: n samples determine fewer than n states. Where motion is so
    sensitive to its start (it comes to rest where friction only just holds, or on either side of a tooth)
    that it is more, no fit finds the states that follow a record, and its error may be as large.

    `noise`: rms of the noise that leaves them open, in the unit of the error.
    """
    view, linear = data.train, fit.sensitivity
    if linear is None or linear.error_filter is not None or not linear.states[0].shape[1]:
        return 0.0
    rng = np.random.default_rng(0)
    power = np.zeros(NOISES_TRIED)
    parts = zip(view.records, view.segments, fit.starts, fit.simulated, strict=True)
    for k, (record, segments, start, y) in enumerate(parts):
        root, run = noise * fit.unit * linear.starts_open(k), data.simulator(fit.model, record).run
        for i in range(NOISES_TRIED):
            off = root @ rng.standard_normal((*start.shape, 1))
            power[i] += np.sum((run(segments, None, start + off[:, :, 0]) - y) ** 2)
    return math.sqrt(np.max(power) / sum(map(len, fit.simulated))) / fit.unit
