"""How well fitted parameters are known, for residuals of any spectrum; directions that are not determined."""

from __future__ import annotations

import math

import numpy as np
from scipy.special import ndtr, stdtrit

from ...thresholds import NOTHING
from ..shooting.least_squares import Solution, Stage
from ..thresholds import DEPENDENT, TAKES_PART
from .noise_spectrum import noise_spectrum
from .sensitivity import OutputSensitivity
from .thresholds import FREEDOM_MOST, MANY_SEGMENTS, NOISE_LEAST, UNDETERMINED


def covariance_of(stage: Stage, found: Solution, sensitivity: OutputSensitivity):
    """Return the covariance of the scaled parameters and the directions the data do not determine.

    The sandwich rule with the noise spectrum of the residual: cov = H^-1 (sum over records J' Omega J)
    H^-1, Omega the covariance of stationary noise (`noise_spectrum`). Two of its standard errors hold the
    truth for 95 % of records, also where the noise is known from few frequencies (Student's distribution).
    Errors that go on from one of many segments into the next (forces that vary, whose trace in position every
    fitted start cuts off) are seen from the scores of the segments.

    Returns
    -------
    covariance : (p, p) array
        Within the directions that the data determine; positive semidefinite.
    null : list of (float, (p,) array)
        Relative singular value and direction in scaled parameters, 0 of those that take no part in it.

    References
    ----------
    Ljung (1999), sec. 9.4; Newey & West (1987); Satterthwaite (1946).
    """
    assert found.slopes is not None
    problem, residual = stage.problem, found.residual
    ones = [np.ones(len(r)) for r in residual]
    h, _, _ = stage.normal(stage.products(*found.slopes, residual, ones), found.states)
    # what is stated of parameters tells as one sample off by the error there is, and is as uncertain as that
    power, count = stage.power(residual)
    error = power * problem.unit**2 / max(count, 1)
    h = h + error * np.diag(problem.stated)
    size = np.sqrt(np.maximum(np.diag(h), NOTHING))
    size[size <= DEPENDENT * max(float(size.max()), NOTHING)] = 1.0
    eigen, vectors = np.linalg.eigh(h / np.outer(size, size))
    top = max(float(eigen[-1]), NOTHING)
    determined = eigen >= UNDETERMINED * top
    # of what the data leave open they tell less than derivatives err by: only what is stated counts there
    vectors = vectors / size[:, None]
    tilted, turn = np.linalg.eigh(
        error * vectors[:, ~determined].T @ np.diag(problem.stated) @ vectors[:, ~determined]
    )
    left, known = (
        vectors[:, ~determined] @ turn,
        tilted > DEPENDENT * max(np.max(tilted, initial=0.0), NOTHING),
    )
    null = [
        (math.sqrt(max(e, 0.0) / top), _parts(v, size))
        for e, v in zip(tilted[~known], left[:, ~known].T, strict=True)
    ]
    # the information is (root root')^-1 over what is determined: all that follows is a product of factors
    eigen = np.concatenate([eigen[determined], tilted[known]])
    root = np.column_stack([vectors[:, determined], left[:, known]]) / np.sqrt(eigen)
    middle = error**2 * root.T @ np.diag(problem.stated) @ root
    variances = [(np.zeros(len(h)), np.zeros(len(h)))]
    for k, e in enumerate(residual):
        e, columns, segments = stage.weighed(k, e), sensitivity.parameters[k] @ root, stage.segments[k]
        if problem.settings.error_filter is None and len(segments) >= MANY_SEGMENTS:
            scores = np.array([columns[w].T @ e[w] for w in segments.places])
            middle += _long_run(scores)
            continue
        floor = NOISE_LEAST * (
            problem.noise**2 if problem.settings.error_filter is None else float(np.mean(e * e))
        )
        absorbed = np.column_stack((columns, sensitivity.absorbed_by_starts(k)))
        for block in segments.blocks if problem.settings.error_filter is None else [slice(0, len(e))]:
            noise = noise_spectrum(e[block], absorbed[block], floor)
            middle += noise.product(columns[block])
            variances.append(noise.variances(columns[block] @ root.T))
    wide = _widening(*np.sum(variances, axis=0))
    factor = wide[:, None] * root @ _factor(middle)
    return factor @ factor.T, null


def _parts(direction, size) -> np.ndarray:
    """Return a null direction without what takes no part in it, its largest component of size one.

    What parameters that take part do to the output, their moves times `size`, makes up for each other: units
    do not matter, nor how large a parameter is.
    """
    effect = np.abs(direction * size)
    found = np.where(effect > TAKES_PART * np.max(effect), direction, 0.0)
    return found / max(float(np.max(np.abs(found))), NOTHING)


def _factor(matrix) -> np.ndarray:
    """Return f with f f' the positive semidefinite matrix that is closest to a symmetric one."""
    eigen, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return vectors * np.sqrt(np.maximum(eigen, 0.0))


def _widening(variances, errors) -> np.ndarray:
    """Return how much wider than of a normal distribution two standard errors are, (p,).

    `errors`: variances of what the variances are estimated to be.
    """
    freedom = 2 * variances**2 / np.maximum(errors, NOTHING)
    return np.where(errors > 0, stdtrit(np.clip(freedom, 1.0, FREEDOM_MOST), ndtr(2.0)) / 2, 1.0)


def _long_run(scores) -> np.ndarray:
    """Return the covariance (p, p) of the sum of scores (nw, p) of segments that follow each other."""
    n = len(scores)
    reach, total = round(2 * n ** (1 / 3)), scores.T @ scores
    for lag in range(1, reach + 1):
        after = scores[lag:].T @ scores[:-lag]
        total += (1 - lag / (reach + 1)) * (after + after.T)
    return total
