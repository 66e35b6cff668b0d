"""Parameters that every record has for itself, after a fit: each value, and all of a name taken together."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...values.per_record import PerRecord
from ..prediction.values import in_record
from ..shooting.problem import Problem


@dataclass(frozen=True)
class OwnValue:
    """The value of a parameter in one record.

    Attributes
    ----------
    value, standard_error : float
        The error is NaN where none was asked for.
    at_bound : bool
        Whether it stands at a bound of its range.
    determined : bool
        Whether the record determines it.
    """

    value: float
    standard_error: float
    at_bound: bool
    determined: bool


def own_values(problem: Problem, named, covariance, null, at_bound, scale) -> dict[str, dict[str, OwnValue]]:
    """Return them by name, then by record: those in `named` that are a `PerRecord`.

    `named`: values as `Problem.named` has them; the arrays are of all variables of the problem.
    """
    unknown = np.full(len(scale), math.nan)
    errors = np.sqrt(np.maximum(np.diag(covariance), 0)) if len(covariance) else unknown
    open_ = _open(null, len(scale))
    errors = np.where(open_, math.inf, errors)
    found: dict[str, dict[str, OwnValue]] = {k: {} for k in problem.names if isinstance(named[k], PerRecord)}
    for k, record in enumerate(problem.records):
        for name, i in zip(problem.names, problem.of_record[k], strict=True):
            if name in found:
                value, error = in_record(named[name], record.name), float(errors[i])
                known = not open_[i] and error <= max(abs(value), scale[i])
                found[name][record.name] = OwnValue(value, error, at_bound[i], known)
    return found


def at_bounds(problem: Problem, theta, is_at_bound) -> list[bool]:
    """Return ``is_at_bound(variable, q, value)`` for all variables; `value`: what became of it.

    A shared one stands at a bound where it does so in all records.
    """
    found = [True] * len(theta)
    for k, of in enumerate(problem.of_record):
        values = problem.values(theta, k) or {}
        for i in of:
            found[i] &= is_at_bound(problem.variables[i], theta[i], values[problem.variables[i].name])
    return found


def weights_of(problem: Problem, covariance, null) -> np.ndarray:
    """Return what all variables count in means over the records: one over the variance, of a sum of 1.

    Those in a direction that the data do not determine count nothing, unless that holds in all records.
    """
    first, n = problem.first, len(problem.variables)
    found = np.ones(n)
    variances = np.diag(covariance) if len(covariance) else np.ones(n)
    known = np.isfinite(variances) & (variances > 0) & ~_open(null, n)
    for i, j in pairwise([*first, n]):
        if np.any(known[i:j]):
            found[i:j] = np.where(known[i:j], np.min(variances[i:j][known[i:j]]), 0)
            found[i:j][known[i:j]] /= variances[i:j][known[i:j]]
        found[i:j] /= np.sum(found[i:j])
    return found


def merged(problem: Problem, covariance, weights) -> np.ndarray:
    """Return the covariance (names, names) of the means over the records, from that of all variables."""
    if not len(covariance):
        return covariance
    first, counted = problem.first, covariance * np.outer(weights, weights)
    return np.add.reduceat(np.add.reduceat(counted, first, axis=0), first, axis=1)


def by_name(problem: Problem, values, pick) -> list:
    """Return ``pick`` of the values of all variables of a name."""
    return [pick(values[i:j]) for i, j in pairwise([*problem.first, len(values)])]


def parts_of(problem: Problem, direction) -> list[tuple[str, str | None, float]]:
    """Return what takes part in a direction: name, record (None: shared by all), move."""
    found = []
    for name, i, j in zip(problem.names, problem.first, [*problem.first[1:], len(direction)], strict=True):
        records = [r.name for r in problem.records] if name in problem.own else [None]
        moves = zip(records, direction[i:j], strict=True)
        found += [(name, record, float(d)) for record, d in moves if d != 0.0]
    return found


def _open(null, n) -> np.ndarray:
    """Return which of n variables take part in a direction that the data do not determine."""
    return np.any([np.zeros(n, bool), *(d != 0.0 for _, d in null)], axis=0)
