"""All zeros of D(a, omega) = 1 + N(a, omega) H(j omega) in a box, in the variables ln a and ln omega.

D has no unit, so nothing here depends on the scale of N, H, a or omega. The box is cut into cells; a cell
whose corner values may hold a zero in real and imaginary part (with a margin for what lies between) is cut
again with exact values, and each small cell that still may hold one starts a safeguarded Newton iteration.
Converged zeros inside the box are collected once each; sign changes that lead to none (jumps of N between
coexisting motions) are counted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...thresholds import FEW_ROUNDED, HALVINGS, NEWTON_FAR, NOTHING
from ..thresholds import LOG_NUDGE
from .thresholds import (
    CELLS_AT_ONCE,
    CROSSING_ACCEPTED,
    CROSSING_GIVEN_UP,
    CROSSING_RANK,
    CROSSING_SETTLED,
    CUTS,
    LINE_HALVINGS,
    MARGIN,
    MOST_PER_CELL,
    MOST_STARTS,
    NOT_REAL,
    ON_EDGE,
    OWNED_WITHIN,
    SAME_CROSSING,
    SHOWS_BY,
    STRAYED,
    TOGETHER,
)


@dataclass(frozen=True)
class Crossing:
    """One zero of D: place, remaining |D|, and the 2 x 2 matrix of its derivatives."""

    amplitude: float
    omega: float
    residual: float
    jacobian: np.ndarray


@dataclass(frozen=True)
class Scan:
    """What a search found and what it saw on the way."""

    crossings: list[Crossing]
    cells: int
    missing: int
    unresolved: int
    truncated: bool


def find_crossings(D: Callable, log_a, log_w, values, refine=True) -> Scan:
    """Find the zeros of D on a grid.

    Parameters
    ----------
    D : callable
        ``D(ln a, ln omega)`` for two equally long 1-D arrays; NaN where there is no periodic response.
    log_a, log_w : ndarray, shapes (na,), (nw,)
        Grid, ascending.
    values : ndarray, shape (na, nw)
        D on the grid.
    refine : bool
        Whether to iterate to convergence; False returns the estimate of one step.
    """
    missing = int(np.isnan(values).sum())
    if min(values.shape) < 2:
        return Scan([], 0, missing, 0, False)
    rows, columns = np.nonzero(_may_hold_zero(values))
    cells = int((values.shape[0] - 1) * (values.shape[1] - 1))
    if rows.size == 0:
        return Scan([], cells, missing, 0, False)
    truncated = rows.size > MOST_STARTS
    if truncated:
        rows, columns = _nearest(values, rows, columns, MOST_STARTS)
    p, q, reach, size = _cut(D, log_a, log_w, rows, columns)
    if p.size > MOST_STARTS:
        truncated = True
        best = _least(size, MOST_STARTS)
        p, q, reach = p[best], q[best], reach[best]
    box = (log_a[0], log_a[-1], log_w[0], log_w[-1])
    found, unresolved = _polish(D, p, q, reach, box, refine)
    return Scan(found, cells, missing, unresolved, truncated)


def real_crossings(D: Callable, log_a, log_w, N, H: Callable) -> list[Crossing]:
    """Zeros of 1 + N H where N is real and depends on the amplitude alone: there may be very many.

    The phase of H fixes the frequency, then N the amplitude: brackets on the two axes, one after the other.

    Parameters
    ----------
    D : callable
        As in `find_crossings`.
    log_a, log_w : ndarray
        Grid, ascending.
    N : ndarray of float
        On the amplitudes of the grid.
    H : callable
        ``H(omega)``, array of complex.
    """
    found = []
    for q in _bracketed(lambda q: H(np.exp(q)).imag, log_w, H(np.exp(log_w)).imag):
        gain = float(H(np.exp(np.array([q])))[0].real)
        if not np.isfinite(gain) or abs(H(np.exp(np.array([q])))[0].imag) > NOT_REAL * abs(gain):
            continue  # a pole: the phase jumps there
        here = np.full(1, q)
        for p in _bracketed(lambda p, q=q: D(p, np.full(p.size, q)).real, log_a, 1 + N * gain):
            value = abs(D(np.array([p]), here)[0])
            if value <= CROSSING_ACCEPTED:
                J = jacobian(D, np.array([p]), here)[0]
                found.append(Crossing(float(np.exp(p)), float(np.exp(q)), float(value), J))
    return found


def _bracketed(f, grid, values):
    """Return the zeros of a function, bisecting all intervals of a grid across which its sign changes."""
    at = np.flatnonzero((values[:-1] < 0) != (values[1:] < 0))
    low, high, sign = grid[at].copy(), grid[at + 1].copy(), np.sign(values[at])
    for _ in range(HALVINGS if at.size else 0):
        middle = 0.5 * (low + high)
        same = np.sign(f(middle)) == sign
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return 0.5 * (low + high)


def merged(scan: Scan, more: list[Crossing]) -> Scan:
    """Return a scan with crossings that a search to no bound on work found, each once."""
    kept = list(scan.crossings)
    for c in more:
        places = [np.log([c.amplitude / k.amplitude, c.omega / k.omega]) for k in kept]
        if not any((np.abs(place) < SAME_CROSSING).all() for place in places):
            kept.append(c)
    return replace(scan, crossings=sorted(kept, key=lambda c: (c.amplitude, c.omega)), truncated=False)


def jacobian(D: Callable, p, q) -> np.ndarray:
    """Return the derivatives of (Re D, Im D) by (ln a, ln omega) at points p, q; shape (n, 2, 2)."""
    h = LOG_NUDGE
    P = np.concatenate([p + h, p - h, p, p])
    Q = np.concatenate([q, q, q + h, q - h])
    up, down, right, left = np.split(D(P, Q), 4)
    by_p, by_q = (up - down) / (2 * h), (right - left) / (2 * h)
    return np.stack([np.stack([by_p.real, by_q.real], -1), np.stack([by_p.imag, by_q.imag], -1)], -2)


def _nearest(values, rows, columns, most):
    """Select the cells whose corners are least, in the order given: they are where zeros are likeliest."""
    size = np.zeros(rows.size)
    for i, k in ((0, 0), (1, 0), (0, 1), (1, 1)):
        corner = np.abs(values[rows + i, columns + k])
        size = np.maximum(size, np.where(np.isfinite(corner), corner, 0))  # not all four are NaN
    chosen = _least(size, most)
    return rows[chosen], columns[chosen]


def _least(size, most):
    """Return the indices of the least values, in rising order."""
    return np.sort(np.argsort(size, kind="stable")[:most])


def _may_hold_zero(values):
    """Cells whose corners leave room for a zero; corners without a response widen the room."""
    rows = max(1, CELLS_AT_ONCE // values.shape[1])
    blocks = (values[i : i + rows + 1] for i in range(0, values.shape[0] - 1, rows))
    return np.concatenate([_block_may_hold_zero(block) for block in blocks])


def _block_may_hold_zero(values):
    corners = np.stack([values[:-1, :-1], values[1:, :-1], values[:-1, 1:], values[1:, 1:]])
    known = np.isfinite(corners)
    partial = ~known.all(axis=0)
    hold = known.any(axis=0)
    for part in (np.real(corners), np.imag(corners)):
        low = np.where(known, part, np.inf).min(axis=0)
        high = np.where(known, part, -np.inf).max(axis=0)
        with np.errstate(invalid="ignore"):
            room = np.where(partial, 1.0, MARGIN) * (high - low) + np.where(partial, 0.5, 0.0)
            hold &= (low - room <= 0) & (high + room >= 0)
    return hold


def _cut(D, log_a, log_w, rows, columns):
    """Cut candidate cells; return the centres of small cells that may hold a zero, their reach and |D|."""
    t = np.linspace(0, 1, CUTS + 1)
    starts_p, starts_q, reach, sizes = [], [], [], []
    da, dw = log_a[rows + 1] - log_a[rows], log_w[columns + 1] - log_w[columns]
    P = np.broadcast_to((log_a[rows][:, None] + da[:, None] * t)[:, :, None], (rows.size, t.size, t.size))
    Q = np.broadcast_to((log_w[columns][:, None] + dw[:, None] * t)[:, None, :], (rows.size, t.size, t.size))
    values = D(P.ravel(), Q.ravel()).reshape(P.shape)
    for i in range(rows.size):
        r, c = np.nonzero(_may_hold_zero(values[i]))
        middle = np.abs(values[i][r, c] + values[i][r + 1, c] + values[i][r, c + 1] + values[i][r + 1, c + 1])
        middle = np.where(np.isfinite(middle), middle, np.inf)
        if r.size > MOST_PER_CELL:  # neighbours of one zero; the nearest few suffice
            best = np.argsort(middle)[:MOST_PER_CELL]
            r, c, middle = r[best], c[best], middle[best]
        starts_p.append(log_a[rows[i]] + da[i] * (t[r] + 0.5 / CUTS))
        starts_q.append(log_w[columns[i]] + dw[i] * (t[c] + 0.5 / CUTS))
        reach.append(np.tile([da[i], dw[i]], (r.size, 1)))
        sizes.append(middle)
    if not starts_p:
        return np.zeros(0), np.zeros(0), np.zeros((0, 2)), np.zeros(0)
    return tuple(np.concatenate(part) for part in (starts_p, starts_q, reach, sizes))


def _polish(D, p, q, reach, box, refine):
    """Newton from every start at once; returns the distinct zeros in the box, and where it found none."""
    if p.size == 0:
        return [], 0
    x = np.stack([p, q], axis=1)
    start = x.copy()
    value = D(x[:, 0], x[:, 1])
    alive = np.isfinite(value)
    finished = np.zeros(p.size, dtype=bool)
    for iteration in range(NEWTON_FAR if refine else 1):
        active = np.nonzero(alive & ~finished & (np.abs(value) > FEW_ROUNDED))[0]
        if active.size == 0:
            break
        J = jacobian(D, x[active, 0], x[active, 1])
        step = _solve(J, value[active])
        bad = ~np.isfinite(step).all(axis=1)
        alive[active[bad]] = False
        active, step = active[~bad], step[~bad]
        if active.size == 0:
            break
        longest = np.maximum(np.abs(step) / reach[active], NOTHING).max(axis=1)
        step = step * np.minimum(1.0, 1.0 / longest)[:, None]
        moved = _line_search(D, x, value, active, step)
        settled = np.abs(step).max(axis=1) < CROSSING_SETTLED
        finished[active[settled | ~moved]] = True
        if iteration == SHOWS_BY:  # quadratic convergence shows by now; what has none sits at a jump
            alive &= np.abs(value) < CROSSING_GIVEN_UP
        far = np.abs((x - start) / reach).max(axis=1) > STRAYED  # strayed: another start owns what is there
        alive &= ~far
        if refine:
            alive &= ~_followers(x, np.where(alive, np.abs(value), np.inf), reach)
    good = alive & (np.abs(value) <= (CROSSING_ACCEPTED if refine else np.inf))
    slack = ON_EDGE
    inside = (x[:, 0] >= box[0] - slack) & (x[:, 0] <= box[1] + slack)
    inside &= (x[:, 1] >= box[2] - slack) & (x[:, 1] <= box[3] + slack)
    keep = np.nonzero(good & inside)[0]
    found: list[Crossing] = []
    places: list[np.ndarray] = []
    for i in keep[np.argsort(np.abs(value[keep]))]:
        near = SAME_CROSSING if refine else 1.0 * reach[i]
        if any((np.abs(x[i] - place) < near).all() for place in places):
            continue
        places.append(x[i])
        J = jacobian(D, x[i : i + 1, 0], x[i : i + 1, 1])[0]
        found.append(Crossing(float(np.exp(x[i, 0])), float(np.exp(x[i, 1])), float(abs(value[i])), J))
    lost = _neighbourhoods(x[~good], value[~good], reach[~good], places)
    return sorted(found, key=lambda c: (c.amplitude, c.omega)), lost


def _followers(x, size, reach):
    """Mark the starts that a better one is leading to the same zero: they need not be computed on."""
    led = np.zeros(size.size, dtype=bool)
    order = np.argsort(size)
    for n, i in enumerate(order):
        if not np.isfinite(size[i]):
            break
        ahead = order[:n][~led[order[:n]]]
        led[i] = bool((np.abs(x[ahead] - x[i]) < TOGETHER * reach[i]).all(axis=1).any())
    return led


def _neighbourhoods(x, value, reach, places):
    """Count the neighbourhoods without a zero whose starts did not converge."""
    best: list[int] = []
    order = np.argsort(np.where(np.isfinite(value), np.abs(value), np.inf))
    for i in order[np.isfinite(value[order])]:
        others = places + [x[j] for j in best]
        if not any((np.abs(x[i] - place) < OWNED_WITHIN * reach[i]).all() for place in others):
            best.append(int(i))
    return len(best)


def linear_zeros(log_a, log_w, values, chosen):
    """Zeros of the linear interpolant in the two triangles of every chosen cell; shape (n, 2).

    Parameters
    ----------
    log_a, log_w, values
        As in `find_crossings`.
    chosen : ndarray of bool, shape (na - 1, nw - 1)
        Cells to look at.
    """
    zeros, order = [], []
    rows, columns = np.nonzero(chosen)
    for first in range(0, rows.size, CELLS_AT_ONCE):
        i, k = rows[first : first + CELLS_AT_ONCE], columns[first : first + CELLS_AT_ONCE]
        da, dw = log_a[i + 1] - log_a[i], log_w[k + 1] - log_w[k]
        by_a, by_w = values[i + 1, k], values[i, k + 1]  # from the near corner along a and along omega
        for half, (a, w, one, other, sign) in enumerate(
            ((i, k, by_a, by_w, 1.0), (i + 1, k + 1, by_w, by_a, -1.0))
        ):
            D0 = values[a, w]
            with np.errstate(all="ignore"):
                Da, Dw = one - D0, other - D0
                det = Da.real * Dw.imag - Da.imag * Dw.real
                s = (Dw.real * D0.imag - Dw.imag * D0.real) / det
                t = (Da.imag * D0.real - Da.real * D0.imag) / det
                inside = (s >= 0) & (t >= 0) & (s + t <= 1) & (np.abs(det) >= NOTHING)
            inside &= np.isfinite(D0) & np.isfinite(Da) & np.isfinite(Dw)
            here = np.nonzero(inside)[0]
            place = log_a[a] + sign * s * da, log_w[w] + sign * t * dw
            zeros.append(np.stack(place, axis=1)[here])
            order.append(2 * (first + here) + half)
    if not zeros:
        return np.zeros((0, 2))
    return np.concatenate(zeros)[np.argsort(np.concatenate(order))]


def _solve(J, value):
    """Newton steps; a nearly singular matrix gives the least-squares step."""
    rhs = -np.stack([value.real, value.imag], axis=1)
    out = np.full(rhs.shape, np.nan)
    for i in range(len(rhs)):
        if np.isfinite(J[i]).all():
            out[i] = np.linalg.lstsq(J[i], rhs[i], rcond=CROSSING_RANK)[0]
    return out


def _line_search(D, x, value, active, step):
    """Halve steps until |D| falls; updates `x` and `value` in place, returns who moved."""
    moved = np.zeros(active.size, dtype=bool)
    share = 1.0
    for _ in range(LINE_HALVINGS):
        todo = np.nonzero(~moved)[0]
        if todo.size == 0:
            break
        trial = x[active[todo]] + share * step[todo]
        new = D(trial[:, 0], trial[:, 1])
        with np.errstate(invalid="ignore"):
            better = np.abs(new) < np.abs(value[active[todo]])
        x[active[todo[better]]], value[active[todo[better]]] = trial[better], new[better]
        moved[todo[better]] = True
        share *= 0.5
    return moved
