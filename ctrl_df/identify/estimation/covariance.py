"""How well fitted parameters are known, for residuals of any colour; directions that are not determined."""

from __future__ import annotations

import math

import numpy as np

from ..thresholds import MANY_SEGMENTS
from .multiple_shooting import Problem
from .noise_model import noise_model
from .sensitivity import OutputSensitivity


def covariance_of(problem: Problem, sensitivity: OutputSensitivity, jp, js):
    """Return the covariance of the scaled parameters and the directions the data do not determine.

    The sandwich rule with the noise's colour from the residual: cov = H^-1 (sum over records J' Omega J)
    H^-1, Omega the covariance of a stationary residual whose spectrum an autoregressive model gives; lost
    degrees of freedom are given back. Errors that go on from one of many segments into the next (forces that
    vary, whose trace in position every fitted start cuts off) are seen from the scores of the segments.

    Returns
    -------
    covariance : (p, p) array
    null : list of (float, (p,) array)
        Relative singular value and direction in scaled parameters.

    References
    ----------
    Ljung (1999), sec. 9.4; Newey & West (1987).
    """
    residual = problem.last
    ones = [np.ones(len(r)) for r in residual]
    h, _, _ = problem.normal(jp, js, residual, ones, problem.nuisance)
    size = np.sqrt(np.maximum(np.diag(h), 1e-300))
    size[size <= 1e-9 * max(float(size.max()), 1e-300)] = 1.0
    eigen, vectors = np.linalg.eigh(h / np.outer(size, size))
    top = max(float(eigen[-1]), 1e-300)
    null = [
        (math.sqrt(max(e, 0.0) / top), v / size / max(float(np.max(np.abs(v / size))), 1e-300))
        for e, v in zip(eigen, vectors.T, strict=True)
        if e < 1e-7 * top
    ]
    inverse = (vectors / np.maximum(eigen, 1e-12 * top)) @ vectors.T / np.outer(size, size)
    middle = np.zeros_like(h)
    for k, e in enumerate(residual):
        e, columns = problem.weighed(k, e), sensitivity.parameters[k]
        if problem.error_filter is None and len(problem.segments[k]) >= MANY_SEGMENTS:
            scores = np.array([columns[w].T @ e[w] for w in problem.segments[k].slices])
            middle += _long_run(scores)
            continue
        n = len(e)
        lost = len(problem.names) / len(residual) + js[k].shape[1] * len(problem.segments[k])
        length = 1 << (n - 1).bit_length()
        transform = np.fft.rfft(columns, length, axis=0)
        omega = np.linspace(0, math.pi, transform.shape[0])
        floor = problem.noise**2 if problem.error_filter is None else float(np.mean(e * e))
        density = noise_model(e).spectrum(omega) + 1e-6 * floor
        double = np.full(len(omega), 2.0)
        double[0] = double[-1] = 1.0
        middle += n / max(n - lost, 0.1 * n) * np.real(
            (transform.conj() * (density * double / length)[:, None]).T @ transform
        )  # fmt: skip
    return inverse @ middle @ inverse, null


def _long_run(scores) -> np.ndarray:
    """Return the covariance (p, p) of the sum of scores (nw, p) of segments that follow each other."""
    n = len(scores)
    reach, total = round(2 * n ** (1 / 3)), scores.T @ scores
    for lag in range(1, reach + 1):
        after = scores[lag:].T @ scores[:-lag]
        total += (1 - lag / (reach + 1)) * (after + after.T)
    return total
