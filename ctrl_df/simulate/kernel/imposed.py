# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""Effects under an imposed motion: the force they take, their hidden states integrated along it.

The motion is a cubic between nodes and never turns within a piece: its reversals are nodes. The laws are
therefore as smooth there as they are written. Hidden states go by Rodas3, an L-stable Rosenbrock method of
order 3 with an embedded one of order 2 (a bristle settles within a small part of a sample), whose
derivatives are differences of the laws.

References: Sandu et al. (1997), Atmospheric Environment 31; Hairer & Wanner (1996), sec. IV.7.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ...thresholds import NOTHING, ROUNDED
from ..compiler.compiled import njit, part
from ..compiler.views import lean
from ..program.imposed import ASKING, CONTACT, FORCE, FRICTION
from ..program.pointers import call_asking, call_force, call_friction, call_presliding
from ..thresholds import (
    BLIND,
    IMPOSED_ALONG,
    IMPOSED_NUDGE,
    IMPOSED_SHRINK,
    SECANT_CLOSED,
    SECANT_STEPS,
    STEP_GROWTH,
    STEP_SAFETY,
)

Laws = namedtuple("Laws", "table par mass span asked presliding")
"""What answers: laws as `program.imposed` lays them out, parameters, mass, walls, of one row."""

Work = namedtuple("Work", "z dz largest f0 ft f moved k jac lu order")
"""Room for the hidden states, the largest they have been, stages of a step, matrices."""


@part(inline=True)
def _level(laws, way, speed, x, drive, load):
    """Return the kinetic dry friction of all laws [N]."""
    value = 0.0
    for i in range(laws.table.shape[0]):
        kind, at = laws.table[i, 0], laws.par.address + 8 * laws.table[i, 2]
        if kind == FRICTION:
            value = call_friction(laws.table[i, 1], 1.0, way, speed, value, at)
        elif kind == ASKING:
            value = call_asking(laws.table[i, 1], 1.0, way, speed, value, at, x, drive, load)
    return value


@part(inline=True)
def _dry(laws, way, x, v, drive, load, z, dz):
    """Return the force of dry friction against the motion [N]; writes the rates of its states."""
    level = _level(laws, way, abs(v), x, drive, load)
    i = laws.presliding
    if i < 0:
        return way * level
    first, at = 8 * laws.table[i, 3], laws.par.address + 8 * laws.table[i, 2]
    return -call_presliding(laws.table[i, 1], v, level, z.address + first, at, dz.address + first)


@part
def _answer(laws, t, x, v, a, way, z, dz):
    """Return the force that imposes the motion [N], positive along +x; writes the rates of hidden states."""
    load = 0.0
    for i in range(laws.table.shape[0]):
        kind, law = laws.table[i, 0], laws.table[i, 1]
        at, first = laws.par.address + 8 * laws.table[i, 2], 8 * laws.table[i, 3]
        if kind == FORCE:
            load += call_force(law, t, x, v, z.address + first, at, dz.address + first)
        elif kind == CONTACT:
            bend = x - min(max(x, laws.span[0]), laws.span[1])
            side = 1.0 if bend > 0.0 else (-1.0 if bend < 0.0 else 0.0)
            push = call_force(law, t, abs(bend), side * v, z.address + first, at, dz.address + first)
            load -= side * max(push, 0.0)
    free = laws.mass * a - load
    force = free + _dry(laws, way, x, v, free, -load, z, dz)
    if laws.asked == 0:
        return force
    # friction that grows with the force carried is a part of that force: F = free + dry(F)
    before, off = free, force - free
    for _ in range(SECANT_STEPS):
        miss = free + _dry(laws, way, x, v, force, -load, z, dz) - force
        if abs(miss) <= SECANT_CLOSED * abs(force) or miss == off:
            break
        moved = force - miss * (force - before) / (miss - off)
        before, off, force = force, miss, moved
    return force


@part
def _rates(laws, motion, node, s, z, dz):
    """Write the rates of the hidden states at the share s of the piece before a node: Hermite's cubic."""
    t0, h = motion[node - 1, 0], motion[node, 0] - motion[node - 1, 0]
    v0, v1 = motion[node - 1, 2], motion[node, 2]
    mean = (motion[node, 1] - motion[node - 1, 1]) / h
    c2, c3 = 3.0 * mean - 2.0 * v0 - v1, v0 + v1 - 2.0 * mean
    x = motion[node - 1, 1] + h * s * (v0 + s * (c2 + s * c3))
    v = v0 + s * (2.0 * c2 + 3.0 * s * c3)
    _answer(laws, t0 + s * h, x, v, (2.0 * c2 + 6.0 * s * c3) / h, motion[node, 4], z, dz)


@part
def _factor(m, order):
    """Write the triangular factors of m into its place, and which rows were exchanged into `order`."""
    n = m.shape[0]
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(m[i, k]) > abs(m[best, k]):
                best = i
        order[k] = best
        if best != k:
            for j in range(n):
                there = m[k, j]
                m[k, j] = m[best, j]
                m[best, j] = there
        for i in range(k + 1, n):
            m[i, k] = m[i, k] / m[k, k]
            for j in range(k + 1, n):
                m[i, j] = m[i, j] - m[i, k] * m[k, j]


@part
def _solve(m, order, b):
    """Solve with the factors of `_factor`; the solution takes the place of b."""
    n = m.shape[0]
    for k in range(n):
        there = b[order[k]]
        b[order[k]] = b[k]
        b[k] = there
    for i in range(1, n):
        for j in range(i):
            b[i] = b[i] - m[i, j] * b[j]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            b[i] = b[i] - m[i, j] * b[j]
        b[i] = b[i] / m[i, i]


@part
def _linearize(laws, motion, node, s, z, largest, work):
    """Write the rates, their derivatives by the states and along the motion, at the share s of a piece."""
    h, n = motion[node, 0] - motion[node - 1, 0], z.shape[0]
    _rates(laws, motion, node, s, z, work.f0)
    ahead = IMPOSED_ALONG if s < 0.5 else -IMPOSED_ALONG
    _rates(laws, motion, node, s + ahead, z, work.ft)
    for i in range(n):
        work.ft[i] = (work.ft[i] - work.f0[i]) / (ahead * h)
    for j in range(n):
        for i in range(n):
            work.moved[i] = z[i]
        reach = IMPOSED_NUDGE * max(abs(z[j]), largest[j], abs(h * work.f0[j]), BLIND)
        work.moved[j] = z[j] + reach
        _rates(laws, motion, node, s, work.moved, work.f)
        for i in range(n):
            work.jac[i, j] = (work.f[i] - work.f0[i]) / reach


@part
def _try(laws, motion, node, s, step, z, work):
    """Leave the states after a step (a share of the piece) in `work.moved`, their error in ``work.k[3]``."""
    hs, n = step * (motion[node, 0] - motion[node - 1, 0]), z.shape[0]
    k, f, moved = work.k, work.f, work.moved
    for i in range(n):
        for j in range(n):
            work.lu[i, j] = -work.jac[i, j]
        work.lu[i, i] = work.lu[i, i] + 2.0 / hs
    _factor(work.lu, work.order)
    for i in range(n):
        k[0, i] = work.f0[i] + 0.5 * hs * work.ft[i]
    _solve(work.lu, work.order, k[0])
    for i in range(n):
        k[1, i] = work.f0[i] + 4.0 * k[0, i] / hs + 1.5 * hs * work.ft[i]
        moved[i] = z[i] + 2.0 * k[0, i]
    _solve(work.lu, work.order, k[1])
    _rates(laws, motion, node, s + step, moved, f)
    for i in range(n):
        k[2, i] = f[i] + (k[0, i] - k[1, i]) / hs
    _solve(work.lu, work.order, k[2])
    for i in range(n):
        moved[i] = moved[i] + k[2, i]
    _rates(laws, motion, node, s + step, moved, f)
    for i in range(n):
        k[3, i] = f[i] + (k[0, i] - k[1, i] - 8.0 / 3.0 * k[2, i]) / hs
    _solve(work.lu, work.order, k[3])
    for i in range(n):
        moved[i] = moved[i] + k[3, i]


@part
def _across(laws, motion, node, z, largest, rtol, pace, work):
    """Take the hidden states over the piece before a node; return the next step [s], 0 if they run away."""
    h, n, s = motion[node, 0] - motion[node - 1, 0], z.shape[0], 0.0
    while s < 1.0:
        _linearize(laws, motion, node, s, z, largest, work)
        while True:
            left = 1.0 - s
            step = min(pace / h, left)
            _try(laws, motion, node, s, step, z, work)
            error = 0.0
            for i in range(n):
                size = max(largest[i], abs(work.moved[i]), abs(step * h * work.f0[i]), NOTHING)
                off = abs(work.k[3, i]) / (rtol * size)
                error = off if not off <= error else error
            # the estimate is of order 2
            factor = STEP_GROWTH
            if error > 0.0:
                factor = min(max(STEP_SAFETY * error ** (-1.0 / 3.0), IMPOSED_SHRINK), STEP_GROWTH)
            elif not error <= 0.0:  # NaN, as where |z|^127 overflows: shorter
                factor = IMPOSED_SHRINK
            if error <= 1.0:
                break
            pace = factor * step * h
            if step < ROUNDED:
                return 0.0
        for i in range(n):
            z[i] = work.moved[i]
            largest[i] = max(largest[i], abs(z[i]))
        pace = max(pace, factor * step * h) if step == left and factor > 1.0 else factor * step * h
        s = 1.0 if step == left else s + step
    return pace


@njit(error_model="numpy", nogil=True)
def force_along(
    table, par, mass, span, asked, presliding, motion, samples, z0, rtol, stop, work, out, open_at, back, kept
):
    """Write the force of every row of parameters at the samples of one motion; whether all came to an end.

    Parameters
    ----------
    table : (nl, 5) int array
        Laws as `program.imposed` lays them out.
    par : (rows, np) array
    mass : (rows,) array
        [kg]; 0 where there is none.
    span : (rows, 2) array
        Where stops that yield stand.
    asked : int
        Whether a friction law asks for the force carried.
    presliding : int
        Which law is the presliding one; -1: none.
    motion : (m, 5) array
        At its nodes: time, position, speed, acceleration, direction (+-1) of the piece before.
    samples : (m,) int array
        The sample at each node; -1 where it is a reversal between two.
    z0 : (rows, nz) array
        Hidden states at the first node.
    rtol : float
        Of the hidden states, over the largest they have been.
    stop : (1,) int array
        Set by another thread to end it.
    work : Work
        Of `work_arrays`.
    out : (rows, n) array
        [N], NaN from where a row runs away.
    open_at : (n,) int array
        Which column of `back` a sample has; -1: none.
    back : (rows, q) array
        Force at samples whose direction is not known, by the other one.
    kept : (rows, n, nz) array
        Hidden states at the samples; of no rows where nobody asks for them.
    """
    nz, nodes = z0.shape[1], motion.shape[0]
    along, work = lean(motion), lean(work)
    rows, values, walls = lean(table), lean(par), lean(span)
    z, dz, largest = work.z, work.dz, work.largest
    for row in range(par.shape[0]):
        if stop[0] != 0:
            return False
        laws = Laws(rows, values[row], mass[row], walls[row], asked, presliding)
        for i in range(nz):
            z[i] = z0[row, i]
            largest[i] = abs(z[i])
        pace = motion[nodes - 1, 0] - motion[0, 0]
        for node in range(nodes):
            if node > 0 and nz > 0 and pace > 0.0:
                pace = _across(laws, along, node, z, largest, rtol, pace, work)
            i = samples[node]
            if i < 0:
                continue
            out[row, i] = np.nan
            if open_at[i] >= 0:
                back[row, open_at[i]] = np.nan
            if pace > 0.0:
                t, x, v = along[node, 0], along[node, 1], along[node, 2]
                out[row, i] = _answer(laws, t, x, v, along[node, 3], along[node, 4], z, dz)
                if open_at[i] >= 0:
                    back[row, open_at[i]] = _answer(laws, t, x, v, along[node, 3], -along[node, 4], z, dz)
            for j in range(kept.shape[2]):
                kept[row, i, j] = z[j]
    return True


def work_arrays(states: int) -> Work:
    """Return the arrays that `force_along` works in."""
    one, square = np.empty(states), np.empty((states, states))
    return Work(
        *(one.copy() for _ in range(7)), np.empty((4, states)), square, square.copy(),
        np.empty(states, np.int64),
    )  # fmt: skip
