"""How far noise leaves a fit open: simulated, as motion may be sensitive to its start."""

from __future__ import annotations

import math

import numpy as np

from ..estimation.fit import FitResult
from ..estimation.segmented import CandidateFit, SegmentedData
from ..estimation.starts import begun_there
from ..prediction.values import with_values
from ..thresholds import BY_CHANCE
from .thresholds import NOISES_TRIED


def moved_by_starts(fit: FitResult, data: SegmentedData, noise: float) -> float:
    """Return the rms by which a fit moves where its initial states are off by their standard errors.

    The larger of several draws. Where a fit is a minimum of a sum of squares that is nearly quadratic, this
    is less than the noise that leaves them open: n samples determine fewer than n states. Where motion is so
    sensitive to its start (it comes to rest where friction only just holds, or on either side of a ridge of a
    ripple) that it is more, no fit finds the states that follow a record, and its error may be as large.

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


def moved_by_parameters(tried: CandidateFit, data: SegmentedData) -> float:
    """Return the rms by which parameters that are off by as much as may be chance move what is held out.

    Along every axis of their covariance, to the side that moves it more. Initial states are refitted.
    """
    assert tried.validation is not None
    simulated, power = np.concatenate(tried.validation.simulated), 0.0
    sides = tried.validated.points_off(BY_CHANCE)
    for pair in zip(sides[::2], sides[1::2], strict=True):
        models = [with_values(tried.validation.model, values) for values in pair]
        moved = [
            data.states_of(m, view=data.validation, starts=tried.validation.starts).simulated for m in models
        ]
        power += max(float(np.mean((np.concatenate(y) - simulated) ** 2)) for y in moved)
    return math.sqrt(power) / tried.validation.unit


def curved_by_what_is_open(found: FitResult, data: SegmentedData) -> float:
    """Return by how much longer segments depend otherwise than linearly on what shorter ones leave open, rms.

    Half the second difference of what the model puts out there: to both sides of the fit `found` over shorter
    segments, parameters a standard error along an axis of their covariance, initial states a draw of what
    noise leaves of them; the largest of all axes. It is well below the noise of a usual motion, and far above
    it where another period of a ripple, or another stop, is within what is known.
    """
    there = data.as_it_is(found)
    points = found.sigma_points
    sides = list(zip(points[::2], points[1::2], strict=True)) or NOISES_TRIED * [({}, {})]
    power = np.zeros(len(sides))
    rng = np.random.default_rng(0)
    for k, record in enumerate(data.train.records):
        start, segments = there.starts[k], there.segments[k]
        open_by = np.zeros((len(segments), start.shape[1], start.shape[1]))
        root, (same, at) = found.starts_open(k), begun_there(found.segments[k], segments)
        if root is not None:
            open_by[same] = found.rmse * found.unit * root[at]
        for i, pair in enumerate(sides):
            off = (open_by @ rng.standard_normal((*start.shape, 1)))[:, :, 0]
            up, down = (
                data.simulator(with_values(there.model, values), record).run(
                    segments, None, start + sign * off
                )
                for values, sign in zip(pair, (1, -1), strict=True)
            )
            power[i] += np.sum((0.5 * (up + down) - there.simulated[k]) ** 2)
    return math.sqrt(np.max(power) / sum(map(len, there.simulated))) / there.unit
