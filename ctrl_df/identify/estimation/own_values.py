"""Parameters that every record has for itself, after a fit: each value, and all of a name taken together."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..prediction.values import in_record
from ..shooting.problem import Problem
from ..thresholds import TAKES_PART


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
    """Return them by name, then by record.

    `named`: values as `Problem.named` has them; the arrays are of all variables of the problem.
    """
    unknown = np.full(len(scale), math.nan)
    errors = np.sqrt(np.maximum(np.diag(covariance), 0)) if len(covariance) else unknown
    open_ = [i for i in range(len(scale)) if any(abs(d[i]) > TAKES_PART for _, d in null)]
    found: dict[str, dict[str, OwnValue]] = {name: {} for name in problem.names if name in problem.own}
    for k, record in enumerate(problem.records):
        for name, i in zip(problem.names, problem.of_record[k], strict=True):
            if name in found:
                value, error = in_record(named[name], record.name), float(errors[i])
                known = i not in open_ and error <= max(abs(value), scale[i])
                found[name][record.name] = OwnValue(value, error, at_bound[i], known)
    return found


def at_bounds(problem: Problem, theta, is_at_bound) -> list[bool]:
    """Return ``is_at_bound(variable, q, value)`` for all variables; `value`: what became of it."""
    found = [False] * len(theta)
    for k, of in enumerate(problem.of_record):
        values = problem.values(theta, k) or {}
        for i in of:
            found[i] = is_at_bound(problem.variables[i], theta[i], values[problem.variables[i].name])
    return found


def merged(problem: Problem, covariance) -> np.ndarray:
    """Return the covariance (names, names) of the means over the records, from that of all variables."""
    if not len(covariance):
        return covariance
    first = problem.first
    sizes = np.diff([*first, len(covariance)])
    sums = np.add.reduceat(np.add.reduceat(covariance, first, axis=0), first, axis=1)
    return sums / np.outer(sizes, sizes)


def strongest(problem: Problem, values) -> list:
    """Return of all variables of a name the value that is largest, either way."""
    edges = [*problem.first, len(values)]
    return [max(values[i:j], key=abs) for i, j in zip(edges[:-1], edges[1:], strict=True)]
