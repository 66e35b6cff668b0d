"""Folds: gains at which two predicted cycles meet and vanish, followed by their arclength.

On a fold 1 + N P C = 0 has a double solution: the derivatives by amplitude and by frequency point the same
way. These are three equations for (ln a, ln omega) and the two free gains, so a fold is a curve in the plane
of gains.
"""

from __future__ import annotations

import numpy as np

from ..limit_cycles.arclength import correction, tangent
from ..limit_cycles.predicted.thresholds import CROSSING_RANK
from ..thresholds import NEWTON_NEAR
from .balance import Segments, defect, excess, segments
from .plane import Plane
from .thresholds import (
    FOLD_AHEAD,
    FOLD_BEYOND,
    FOLD_CLOSED,
    FOLD_LEAST,
    FOLD_NUDGE,
    FOLD_POINTS,
    FOLD_REACH,
    FOLD_STEP,
)


def folds(plane: Plane, free, fixed, axes) -> list[np.ndarray]:
    """Curves of folds within a box of gains.

    Parameters
    ----------
    plane : Plane
    free : (str, str)
    fixed : dict
        The third gain.
    axes : (ndarray, ndarray)
        Values of the two free gains: starts are looked for along each of them.

    Returns
    -------
    list of ndarray, shape (n, 4)
        The two gains, ln a, ln omega, in the order in which a curve is run through.
    """
    low = np.array([axis[0] for axis in axes])
    box = low, np.array([axis[-1] for axis in axes]) - low
    curves: list[np.ndarray] = []

    def equations(u):
        return _equations(plane, free, fixed, box, u)

    for start in _starts(plane, free, fixed, axes, box):
        point = _on_fold(equations, start)
        if point is None or any(_distance(curve, point) < FOLD_STEP for curve in curves):
            continue
        curve = _followed(equations, plane, point)
        if len(curve) > 2:
            curves.append(curve)
    return [np.column_stack([box[0] + box[1] * c[:, 2:], c[:, :2]]) for c in curves]


def _starts(plane, free, fixed, axes, box):
    """Yield (ln a, ln omega, gains in the box) where one gain has an extreme while the other is held."""
    for fixed_axis in (0, 1):
        sought = free[1 - fixed_axis]
        for value in axes[fixed_axis]:
            line = segments(plane, excess(plane, {**fixed, free[fixed_axis]: value}, sought))
            for p, q, gain in _extremes(line):
                at = np.empty(2)
                at[fixed_axis], at[1 - fixed_axis] = value, gain
                unit = (at - box[0]) / box[1]
                if (unit > -FOLD_BEYOND).all() and (unit < 1 + FOLD_BEYOND).all():
                    yield np.array([p, q, *unit])


def _extremes(line: Segments):
    """Yield ends shared by two pieces from which the gain goes the same way along both."""
    edge, order = np.unique(line.edge.ravel(), return_inverse=True)
    if not edge.size:
        return
    order = order.ravel()
    ranked = np.argsort(order, kind="stable")
    first = np.searchsorted(order[ranked], np.arange(edge.size))
    pairs = np.flatnonzero(np.bincount(order, minlength=edge.size) == 2)
    one, other = ranked[first[pairs]], ranked[first[pairs] + 1]
    gain = line.gain.ravel()
    way = [gain[k ^ 1] - gain[k] for k in (one, other)]  # the two ends of a piece lie side by side
    p, q = line.p.ravel(), line.q.ravel()
    for k in one[way[0] * way[1] > 0]:
        yield p[k], q[k], gain[k]


def _equations(plane, free, fixed, box, u):
    """Real and imaginary part of (Z - C)/|Z| and the sine between its derivatives, at points u (n, 4)."""
    at = box[0] + box[1] * u[:, 2:]
    gains = {**fixed, free[0]: at[:, 0], free[1]: at[:, 1]}
    F, by_p, by_q = defect(plane, gains, u[:, 0], u[:, 1])
    size = np.abs(by_p) * np.abs(by_q)
    sine = (by_p.real * by_q.imag - by_p.imag * by_q.real) / size
    return np.stack([F.real, F.imag, sine], axis=1)


def _linearized(equations, u):
    """Equations at a point and their Jacobian (3, 4)."""
    around = np.concatenate([u[None], u + FOLD_NUDGE * np.eye(4), u - FOLD_NUDGE * np.eye(4)])
    values = equations(around)
    return values[0], (values[1:5] - values[5:]).T / (2 * FOLD_NUDGE)


def _on_fold(equations, start):
    """Return the point of a fold nearest to a start; None where there is none."""

    def shortest(J, G, _):
        return np.linalg.lstsq(J, -G, rcond=CROSSING_RANK)[0]

    return _newton(equations, start, shortest, FOLD_REACH)


def _newton(equations, start, step_at, reach=np.inf):
    """Newton's method by steps ``step_at(J, G, u)``; None where it fails, or leads farther than `reach`."""
    u = start
    for _ in range(NEWTON_NEAR):
        G, J = _linearized(equations, u)
        if not (np.isfinite(G).all() and np.isfinite(J).all()):
            return None
        step = step_at(J, G, u)
        u = u + step
        if np.abs(u - start).max() > reach:
            return None
        if np.abs(step).max() < FOLD_CLOSED:
            return u
    return None


def _followed(equations, plane, point):
    """Follow a fold both ways from one of its points."""
    along = np.linalg.svd(_linearized(equations, point)[1])[2][-1]
    ways = [_one_way(equations, plane, point, sign * along) for sign in (1.0, -1.0)]
    return np.concatenate([ways[1][::-1], point[None], ways[0]])


def _one_way(equations, plane, u, along):
    begin, points, length = u, [], FOLD_STEP
    for _ in range(FOLD_POINTS):
        new = _corrected(equations, u + length * along, along)
        if new is None or np.dot(new - u, along) < FOLD_AHEAD * length:
            length *= 0.5
            if length < FOLD_LEAST * FOLD_STEP:
                break
            continue
        if not _within(plane, new):
            break
        points.append(new)
        J = _linearized(equations, new)[1]
        u, along = new, tangent(J, along) if np.isfinite(J).all() else along
        length = min(FOLD_STEP, 2 * length)
        if len(points) > 4 and np.linalg.norm(new - begin) < FOLD_STEP:  # it is closed
            points.append(begin)
            break
    return np.array(points).reshape(-1, 4)


def _corrected(equations, guess, border):
    """Return the point of a fold within the plane across `border` through the guess, or None."""

    def across(J, G, u):
        return correction(J, border, G, np.dot(u - guess, border))

    return _newton(equations, guess, across)


def _within(plane, u) -> bool:
    p, q, *unit = u
    return bool(
        plane.log_a[0] <= p <= plane.log_a[-1]
        and plane.log_w[0] <= q <= plane.log_w[-1]
        and min(unit) >= -FOLD_BEYOND
        and max(unit) <= 1 + FOLD_BEYOND
    )


def _distance(curve, point) -> float:
    return float(np.linalg.norm(curve - point, axis=1).min())
