"""The grid on which 1 + N H is searched: the family's, finer where that costs little or H varies fast."""

from __future__ import annotations

import math

import numpy as np

from ...df.family import Family
from ...df.methods import ElementIntegrals, Method
from ...df.points import points
from .linear import LinearPart
from .thresholds import (
    BEYOND_CORNER,
    JUMPY,
    QUANTIZER_LEVELS,
    SCAN_AT_ONCE,
    SCAN_CHANGE,
    SCAN_HALVINGS,
    SCAN_MOST,
    SCAN_QUICK,
    SCAN_STEP,
)


def defect(method: Method, linear: LinearPart, bar=None):
    """D(ln a, ln omega) = 1 + N H, for matching 1-D arrays; NaN where N is a noisy average.

    `bar`, a progress bar, counts the points asked.
    """
    method = method.with_short_averages()

    def D(p, q):
        a, w = np.exp(p), np.exp(q)
        h, _ = linear.clamped(w)
        if bar is not None:
            bar.update(a.size)
        N, regime, spread = points(method, a, w)
        with np.errstate(all="ignore"):
            return np.where(noisy(regime, spread), np.nan, 1 + N * h)

    return D


def scan_grid(method: Method, linear: LinearPart, family: Family):
    """Return the grid to search: the family's, finer where that costs little or H varies fast."""
    w = refined_omega(linear, family.omega)
    if method.quick:
        coarse = family.amplitudes
        a = _refined(coarse, method.amplitudes)
        if isinstance(method, ElementIntegrals):
            a = with_corners(a, method.block.primitive)
        if method.needs_omega and a.size * w.size > SCAN_QUICK:
            a = coarse
        N = _fundamental(method, a, w, family)
    else:
        a, N = family.amplitudes, _interpolated(np.log(family.omega), family.N, np.log(w))
    with np.errstate(all="ignore"):
        values = np.broadcast_to(N, (a.size, w.size)) * linear(w)
        values += 1
    return np.log(a), np.log(w), values


def _fundamental(method, a, w, family):
    """N on a grid, the family's own where it is the same; some rows at a time, so that Ctrl-C works."""
    if not method.needs_omega:
        return method.harmonics(a, None, 1)[0][..., 1]
    if a is family.amplitudes and w is family.omega:
        return family.N
    rows = max(1, SCAN_AT_ONCE // w.size)
    parts = (a[i : i + rows] for i in range(0, a.size, rows))
    return np.concatenate([method.harmonics(part, w, 1)[0][..., 1] for part in parts])


def _refined(grid, least):
    """Points between those of a grid, equally many in each step, so that there are at least `least`."""
    if grid.size < 2:
        return grid
    cuts = max(1, math.ceil(least / (grid.size - 1)))
    return np.unique(
        np.concatenate([np.geomspace(lo, hi, cuts + 1) for lo, hi in zip(grid[:-1], grid[1:], strict=True)])
    )


def with_corners(a, primitive):
    """Add the amplitudes at which an element's N bends, and points closing in on them from above.

    As a sine reaches a further jump N rises at once, with the square root of what it is beyond: between two
    points of any grid it may fall and rise again. All other bends are milder.
    """
    corners = np.abs(np.asarray(getattr(primitive, "corners", ()), dtype=float))
    step = getattr(primitive, "step", 0.0)
    if step > 0:
        most = min(int(a[-1] / step + 0.5), QUANTIZER_LEVELS)
        corners = np.concatenate([corners, (np.arange(most) + 0.5) * step])
    corners = corners[(corners >= a[0]) & (corners < a[-1])]
    beyond = corners[:, None] * (1.0 + BEYOND_CORNER)
    return np.unique(np.concatenate([a, corners, beyond[beyond < a[-1]]]))


def refined_omega(linear, w, change=SCAN_CHANGE, most=SCAN_MOST):
    """Halve steps of ln omega until H changes by at most `change` (relative) from point to point."""
    for _ in range(SCAN_HALVINGS):
        if w.size < 2 or w.size >= most:
            break
        h = linear(w)
        with np.errstate(all="ignore"):
            step = np.abs(np.diff(h)) / np.minimum(np.abs(h[1:]), np.abs(h[:-1]))
        coarse = (step > change) & (np.diff(np.log(w)) > SCAN_STEP)
        if not coarse.any():
            break
        w = np.unique(np.concatenate([w, np.sqrt(w[:-1] * w[1:])[coarse]]))
    return w


def _interpolated(q, N, fine):
    """N between columns, linear in log magnitude and phase over ln omega (a power of omega is exact)."""
    if q.size == fine.size:
        return N
    upper = np.clip(np.searchsorted(q, fine), 1, q.size - 1)
    share = (fine - q[upper - 1]) / (q[upper] - q[upper - 1])
    left, right = N[:, upper - 1], N[:, upper]
    with np.errstate(all="ignore"):
        turn = np.where(left == 0, 0, right / np.where(left == 0, 1, left))
        smooth = left * np.exp(share * np.log(np.where(turn == 0, 1, turn)))
    return np.where(turn == 0, (1 - share) * left + share * right, smooth)


def grid_slope(log_a, log_w, values, place):
    """Return the derivatives of the interpolant in the cell that holds `place`."""
    i = int(np.clip(np.searchsorted(log_a, place[0]) - 1, 0, log_a.size - 2))
    k = int(np.clip(np.searchsorted(log_w, place[1]) - 1, 0, log_w.size - 2))
    v = values[i : i + 2, k : k + 2]
    by_a = (v[1] - v[0]).mean() / (log_a[i + 1] - log_a[i])
    by_w = (v[:, 1] - v[:, 0]).mean() / (log_w[k + 1] - log_w[k])
    return np.array([[by_a.real, by_w.real], [by_a.imag, by_w.imag]])


def noisy(regime, spread):
    """Where N is an average over irregular motion rather than a function of (a, omega)."""
    return (np.asarray(regime) == "aperiodic") & ~(np.asarray(spread) < JUMPY)
