"""How well a table determines the parameters fitted to it."""

from __future__ import annotations

import numpy as np

from ...numerals import listed
from ...thresholds import NOTHING
from ..thresholds import TAKES_PART
from .fit import FittedTable
from .thresholds import FLAT_COLUMN, FLAT_INVERSE, FLAT_SINGULAR


def uncertainty(found: FittedTable) -> tuple[np.ndarray, dict[str, float], dict[str, str]]:
    """Return covariance, standard errors, and a sentence for every parameter the table does not determine."""
    names, j = found.names, found.jacobian
    if not names:
        return np.zeros((0, 0)), {}, {}
    doubtful: dict[str, str] = {}
    values = np.array([v.p(q) for v, q in zip(found.variables, found.q, strict=True)])
    slope = np.array([v.slope(q) for v, q in zip(found.variables, found.q, strict=True)])
    size = np.linalg.norm(j, axis=0)
    for k, s in zip(names, size, strict=True):
        if s < FLAT_COLUMN * max(float(size.max()), NOTHING):
            doubtful[k] = f"{k} has no influence on these data, which do not tell its value."
    live = [i for i, k in enumerate(names) if k not in doubtful]
    residual = float(found.weighted @ found.weighted) / max(len(found.weighted) - len(live), 1)
    covariance = np.full((len(names), len(names)), np.inf)
    if live:
        _, s, vt = np.linalg.svd(j[:, live] / size[live], full_matrices=False)
        for direction in vt[s < FLAT_SINGULAR * s[0]]:
            alike = [names[live[i]] for i in np.flatnonzero(np.abs(direction) > TAKES_PART)]
            for k in alike:
                doubtful[k] = f"{listed(alike)} cannot be distinguished on these data. Fix one of them."
        inverse = (vt.T / np.maximum(s, FLAT_INVERSE * s[0]) ** 2) @ vt
        unit = slope[live] / size[live]
        covariance[np.ix_(live, live)] = residual * inverse * np.outer(unit, unit)
    errors = dict(zip(names, np.sqrt(np.diag(covariance)).tolist(), strict=True))
    for k, value in zip(names, values, strict=True):
        if k not in doubtful and errors[k] > abs(value) > 0:
            doubtful[k] = f"{k} has a standard error larger than its value: these data do not determine it."
    return covariance, errors, doubtful
