"""Directions in which a loop can be shifted without its noticing: a free position, a state nothing reads.

An axis whose position is not fed back (a pure velocity loop) moves alike wherever it stands. Every orbit of
such a loop has a second multiplier 1 beside that of a shift in time, and need only close up to the drift of
its position. Neither says anything about stability; both are taken out here.
"""

from __future__ import annotations

import numpy as np

from ...thresholds import NOTHING
from .monodromy import PeriodTrace, Tracer
from .thresholds import MODE_SAMPLES, NULL, SHIFT_SAME, SLOPE_NUDGE


def shift_directions(tracer: Tracer, traced: PeriodTrace, size) -> np.ndarray:
    """Shifts of the state that change neither rates nor event margins anywhere on an orbit.

    Parameters
    ----------
    tracer : Tracer
        Of the loop.
    traced : PeriodTrace
        One period.
    size : (n,) array
        Scale of each state.

    Returns
    -------
    (n, k) array
        Orthonormal columns in states divided by `size`; no columns, as a rule.
    """
    points = _points(traced.segments)
    if not points:
        return np.zeros((tracer.n, 0))

    def rates_at(point, x):
        return np.concatenate(tracer.rate_and_margins(point.time, x, point.mode, traced.reach))

    here = [rates_at(p, p.x) for p in points]
    scale = np.max([np.where(np.isfinite(a), np.abs(a), 0.0) for a in here], axis=0)
    # rates may all vanish where segments begin (a reversal): no smaller than the size over a period
    scale[: tracer.n] = np.maximum(scale[: tracer.n], size / sum(s.length for s in traced.segments))
    scale[scale == 0.0] = 1.0
    slopes = []
    for p in points:
        columns = []
        for j in range(tracer.n):
            step = np.zeros(tracer.n)
            step[j] = SLOPE_NUDGE * size[j]
            columns.append(_change(rates_at(p, p.x + step), rates_at(p, p.x - step)) / scale)
        slopes.append(np.array(columns).T / (2 * SLOPE_NUDGE))
    _, values, rows = np.linalg.svd(np.vstack(slopes), full_matrices=True)
    values = np.append(values, np.zeros(tracer.n - len(values)))
    candidates = rows[values <= NULL * max(values[0], NOTHING)]
    kept = [d for d in candidates if _invariant(rates_at, points, here, scale, 0.5 * d * size)]
    return np.array(kept).T if kept else np.zeros((tracer.n, 0))


def transverse(directions) -> np.ndarray:
    """Orthonormal columns that span what is left of the state beside `directions`."""
    n, k = directions.shape
    if k == 0:
        return np.eye(n)
    return np.linalg.svd(directions, full_matrices=True)[0][:, k:]


def _points(segments):
    """Take the starts of segments, a few of every mode."""
    taken: dict[bytes, list] = {}
    for s in segments:
        if s.length > 0:
            taken.setdefault(s.start.mode.tobytes(), []).append(s.start)
    few = (starts[:: max(1, len(starts) // MODE_SAMPLES)] for starts in taken.values())
    return [p for starts in few for p in starts[:MODE_SAMPLES]]


def _change(a, b) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        return np.where(np.isfinite(a) & np.isfinite(b), a - b, 0.0)


def _invariant(rates_at, points, here, scale, shift) -> bool:
    for p, before in zip(points, here, strict=True):
        for moved in (p.x + shift, p.x - shift):
            if np.max(np.abs(_change(rates_at(p, moved), before)) / scale) > SHIFT_SAME:
                return False
    return True
