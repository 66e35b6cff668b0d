"""What noise of the recorded input makes of an error: a force that never acted, integrated by the model."""

from __future__ import annotations

import math

import numpy as np

from ..data.signals import usual_noise
from ..estimation.fit import FitResult
from ..estimation.segmented import SegmentedData
from ..prediction.segments import facts
from ..prediction.sensed import sensed
from ..thresholds import BY_CHANCE, QUARTILE
from .thresholds import FEEDBACK_LAGS, INPUT_NOISE_MOST, INPUT_ORDER, INPUT_SAMPLES, NOISES_TRIED, TRIMMED


def input_noise(record) -> float:
    """Return the rms of white noise in the recorded input, at most [its unit].

    The least of three bounds: what the usual fourth difference shows; the part of the usual sample that
    neither the input's own past nor the outputs, which a controller feeds back, predict; and a share of its
    spread (`INPUT_NOISE_MOST`). "Usual" is the median: jumps are left aside.
    """
    count = min(len(record), INPUT_SAMPLES)
    u, first = np.asarray(record.u[:count], float), max(INPUT_ORDER, FEEDBACK_LAGS)
    if count < 2 * (first + INPUT_ORDER + FEEDBACK_LAGS):
        return 0.0
    columns = [np.ones(count - first)]
    columns += [u[first - k : count - k] for k in range(1, INPUT_ORDER + 1)]
    for y in sensed(record).values:
        columns += [np.asarray(y[first - k : count - k], float) for k in range(FEEDBACK_LAGS)]
    matrix = np.column_stack(columns)
    matrix = matrix / np.maximum(np.max(np.abs(matrix), axis=0), np.finfo(float).tiny)
    rows = np.full(count - first, True)
    for _ in range(TRIMMED):
        missed = np.abs(u[first:] - matrix @ np.linalg.lstsq(matrix[rows], u[first:][rows])[0])
        usual = float(np.median(missed)) / QUARTILE
        rows = missed <= BY_CHANCE * usual
    return min(usual, usual_noise(u), INPUT_NOISE_MOST * float(np.std(u)))


def made_by_input_noise(fit: FitResult, data: SegmentedData) -> float:
    """Return the rms error of a fit that noise of the recorded inputs may make, by chance once in 370.

    The model is run under inputs with more of it; what refitting would take away is taken away. What is left
    is a random walk in every segment, their number is that of independent ones. A motion that is imposed is
    no force: its noise shows in the error as it is.
    """
    view = data.train
    noises = [0.0 if facts(r).imposed else input_noise(r) for r in view.records]
    if fit.sensitivity is None or not any(noises):
        return 0.0
    rng = np.random.default_rng(0)
    errors: list[list[np.ndarray]] = [[] for _ in range(NOISES_TRIED)]
    parts = zip(view.records, view.segments, fit.starts, fit.simulated, noises, strict=True)
    for record, segments, start, y, noise in parts:
        inputs = [record.u + noise * rng.standard_normal(len(record)) for _ in errors]
        moved = data.simulator(fit.model, record).run_driven(segments, start, inputs)
        for error, z in zip(errors, moved, strict=True):
            error.append(z - y)
    squares = [float(np.mean(fit.sensitivity.project(e) ** 2)) for e in errors]
    segments_run = sum(len(segments) for segments in view.segments)
    return math.exp(BY_CHANCE / math.sqrt(segments_run)) * math.sqrt(float(np.mean(squares))) / fit.unit
