"""Angles that belong to the record, such as a ripple's phase: an encoder begins anew at every start."""

from __future__ import annotations

import math

from .fit import FitResult
from .thresholds import ANGLE_WORTH, ANGLES


def reestimated_per_record(near: FitResult, fit) -> FitResult:
    """Return a model with its angles per record as this record has them, where it says so.

    Parameters
    ----------
    near : FitResult
        The model with its initial states fitted.
    fit : callable
        ``fit(block, names, starts, iterations)`` over the same segments.
    """
    best = near
    for name in [k for k, p in near.model.parameters.items() if p.per_record]:
        own, found = best.model.parameters[name].value, best
        for i in range(1, ANGLES):
            block = best.model.with_parameters({name: own + 2 * math.pi * i / ANGLES})
            tried = fit(block, (), best.starts, 1)
            found = min(found, tried, key=lambda f: f.rmse)
        found = fit(found.model, (name,), found.starts, 5)
        if found.count * math.log(best.rmse / found.rmse) > ANGLE_WORTH:
            best = found
    return best
