"""What every record has for itself: angles sought over the whole turn, all of it re-estimated elsewhere.

The phase of a ripple is an angle of that kind: an encoder counts from a new zero at every start.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from ...values.per_record import PerRecord
from ..prediction.values import block_of, in_record, is_own, knows, with_values
from .fit import FitResult
from .thresholds import ANGLE_WORTH, ANGLES, EFFORT_OWN

Refit = Callable[..., FitResult]
"""``fit(model, names, starts, iterations)`` over the same segments of the same records."""


def reestimated(near: FitResult, fit: Refit) -> FitResult:
    """Return a model with what these records have for themselves, of which it knows that of others.

    An angle is the one that the model has, unless another is worth it.

    Parameters
    ----------
    near : FitResult
        The model with its initial states fitted.
    fit : callable
    """
    best, table, others = near, block_of(near.model).parameters, own_values_of(near.model)
    if others:  # first: with those of other records no angle shows
        best = min(best, fit(best.model, others, best.starts, EFFORT_OWN), key=lambda f: f.rmse)
    for name in [k for k, p in table.items() if p.per_record]:
        found = turned(best, name, fit)
        found = fit(found.model, (*others, name), found.starts, EFFORT_OWN)
        if found.count * math.log(best.rmse / found.rmse) > ANGLE_WORTH:
            best = found
    return best


def own_values_of(model) -> tuple[str, ...]:
    """Return the parameters that every record has for itself, angles apart."""
    table = block_of(model).parameters
    return tuple(k for k, p in table.items() if is_own(p) and not p.per_record)


def turned(near: FitResult, name: str, fit: Refit) -> FitResult:
    """Return a model with that angle, out of some all about the turn, with which each record errs least."""
    begin, records = block_of(near.model).parameters[name].value, near.records
    tries, values = [near], [{r: in_record(begin, r) for r in records}]
    for i in range(1, ANGLES):
        values.append({r: v + 2 * math.pi * i / ANGLES for r, v in values[0].items()})
        tries.append(fit(_with_angles(near.model, name, values[-1]), (), near.starts, 1))
    best = [min(range(ANGLES), key=lambda i: tries[i].squares[k]) for k in range(len(records))]
    if len(set(best)) == 1:
        return tries[best[0]]
    model = _with_angles(near.model, name, {r: values[i][r] for r, i in zip(records, best, strict=True)})
    return fit(model, (), [tries[i].starts[k] for k, i in enumerate(best)], 1)


def _with_angles(model, name, values):
    return with_values(model, {name: PerRecord.angles([*values], [*values.values()])})


def unknown_angles(model, names: Sequence[str], records: Sequence) -> list[str]:
    """Return the angles among the parameters of which a model does not know what several records have."""
    if len(records) < 2:
        return []
    table = block_of(model).parameters
    angles = {k: table[k].value for k in names if table[k].per_record}
    return [k for k, v in angles.items() if not all(knows(v, r.name) for r in records)]


def start_with_angles(model, names: Sequence[str], records: Sequence, starts, fit: Refit):
    """Return where a fit to several records begins whose angles need not be alike: model, initial states.

    `names`: parameters fitted along, beside which angles show; `starts`: initial states or None.
    """
    angles = unknown_angles(model, names, records)
    if not angles:
        return model, starts
    near = fit(model, names, starts, EFFORT_OWN)
    for name in angles:
        near = turned(near, name, fit)
        near = fit(near.model, names, near.starts, EFFORT_OWN)
    return near.model, near.starts
