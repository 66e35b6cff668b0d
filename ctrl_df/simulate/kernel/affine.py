# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""Exact flow of modes that are affine: dx/dt = A x + B r(t) + c + d t, and margins that are affine too.

A mass with Coulomb and viscous friction, a joint with clearance, springs, a PID, a saturation: between events
all of it is linear with constant or known forcing. The Taylor series of such a flow costs one small matrix
product a term, converges everywhere, and is its own interpolant; the margins become polynomials whose first
root is found without another call of the laws. Which laws qualify `pack` knows; A, B, d and
the margins' rows of a mode are learnt by evaluating its rates at unit states, once, and kept for the modes
met last. Where a mechanism has curved laws besides, their forces q(x, t) stand apart: rates and margins are
affine in them too, dx/dt = A x + B r(t) + c + d t + Q q, and Q is learnt like B
(`ctrl_df.simulate.kernel.exponential` goes on from there).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...thresholds import UNIT
from ..compiler.compiled import part
from ..dynamics.flow import combine, rates
from ..dynamics.mechanics import closed, dry_level
from ..program import layout as L
from ..program.layout import (
    A_BODIES,
    A_INNER,
    AUX,
    CURVED,
    DIR0,
    DIR1,
    F_ASKED,
    F_GIVEN,
    G_BODY1,
    H_NG,
    H_NR,
    H_NX,
    KIND,
    MECHANISM,
    MODE,
    STRAIGHT,
    STUCK,
    WALL,
    Drive,
    G,
    X,
)
from ..thresholds import AFFINE_SHARE, FORCING_SHARE, SLOTS, TERMS
from .roots import first_root

LENGTHS = 2  # of steps whose propagators are kept
# kinds of propagators for each length: where laws are curved, see `ctrl_df.simulate.kernel.exponential`;
RANKS = 4
# and where none is: one for the whole step, one for parts of it
AFFINE_RANKS = 2


class Memory(NamedTuple):
    """Linear maps of the modes met last, and scratch; see `memory`."""

    probe: Drive  # external inputs of a unit
    seen: np.ndarray  # (SLOTS, nm) modes
    used: np.ndarray  # (SLOTS,): the how-manieth mode a run met first this one was; 0: none of this run
    order: np.ndarray  # (2,): modes that are known, and modes that this run has met
    ready: (
        np.ndarray
    )  # (SLOTS * LENGTHS * ranks,) whether it has propagators, see `ctrl_df.simulate.kernel.propagators`
    a: np.ndarray  # (SLOTS, n, n)
    b: np.ndarray  # (SLOTS, n, nr)
    d: np.ndarray  # (SLOTS, n)
    c: np.ndarray  # (SLOTS, n): rates at zero
    rows: np.ndarray  # (SLOTS, ng + 2, n + nr + 2): a margin's slopes over x, r, t; at zero, inf: none
    acting: np.ndarray  # (nq,) what each of q is: the force on body 0 or 1, or 2 + a state whose rate it is
    q: np.ndarray  # (SLOTS, n, nq)
    pushed: np.ndarray  # (SLOTS, ng + 2, nq): a margin's slopes over q
    outs: np.ndarray  # (SLOTS, ny, n + nr + 2): an output's slopes over x, r, t; its value at zero
    owners: np.ndarray  # (ng + 2,): margin that each row belongs to
    base: np.ndarray  # scratch: rates and margins (ng + 3) at zero
    ahead: np.ndarray  # scratch: margins at a unit state, extended
    forcing: np.ndarray  # (TERMS + 1, nr): powers of the external inputs over a step
    curves: np.ndarray  # (TERMS + 1): a margin over a step
    measures: np.ndarray  # (n,): sizes that tolerances refer to


def memory(prog) -> Memory:
    """Allocate the memory of a program; small where its modes are not affine."""
    used = SLOTS if prog.ints[L.H_AFFINE] else 1
    acting = _acting(prog)
    nq = len(acting)
    n, nr, ny, ng, nm = (int(prog.ints[i]) for i in (H_NX, H_NR, L.H_NY, H_NG, L.H_NM))
    probe = Drive(np.zeros(0), np.zeros((nr, 0)), 1, np.zeros((nr, 1), complex), 0.0, 0)
    return Memory(
        probe, np.zeros((used, nm), np.int64), np.zeros(used, np.int64), np.zeros(2, np.int64),
        np.zeros(used * LENGTHS * (RANKS if nq > 0 else AFFINE_RANKS), np.int64),
        np.zeros((used, n, n)),
        np.zeros((used, n, nr)), np.zeros((used, n)), np.zeros((used, n)),
        np.zeros((used, ng + 2, n + nr + 2)), acting, np.zeros((used, n, nq)), np.zeros((used, ng + 2, nq)),
        np.zeros((used, ny, n + nr + 2)), np.zeros(ng + 2, np.int64),
        np.zeros(ng + 3), np.zeros(ng + 3), np.zeros((TERMS + 1, nr)), np.zeros(TERMS + 1),
        np.zeros(n),
    )  # fmt: skip


def _acting(prog) -> np.ndarray:
    """Return what the curved laws act on, see `Memory.acting`; nothing where there are none."""
    if prog.ints[L.H_AFFINE] != 2:
        return np.zeros(0, np.int64)
    node = next(row for row in prog.nodes if row[KIND] == MECHANISM)
    aux = prog.ints[node[AUX] :]
    bodies, first, count = int(aux[A_BODIES]), int(aux[L.A_LAWS]), int(aux[L.A_COUNT])
    laws = prog.ints[first : first + count * L.R_SIZE].reshape(count, L.R_SIZE)
    pushed = {int(law[L.R_BODY]) for law in laws if law[L.R_SORT] == CURVED}
    if L.BOTH in pushed:
        pushed = {0, 1}
    inner = int(node[X]) + 2 * bodies
    return np.array([*sorted(pushed), *range(2 + inner, 2 + inner + int(aux[A_INNER]))], np.int64)


@part(inline=True)
def ranks(store):
    """Kinds of propagators for each mode and length."""
    return RANKS if store.acting.shape[0] > 0 else AFFINE_RANKS


@part(inline=True)
def recall(prog, store, mode, work, x, dx0, dx, g):
    """Slot of the present mode, learnt if it is new. `x`, `dx0`, `dx`, `g` are scratch."""
    known = int(store.order[0])
    for slot in range(known):
        same = True
        for i in range(mode.shape[0]):
            if store.seen[slot, i] != mode[i]:
                same = False
                break
        if same:
            if store.used[slot] == 0:
                store.order[1] += 1
                store.used[slot] = store.order[1]
            return slot
    return _learn(prog, store, mode, work, x, dx0, dx, g)


@part
def forget_uses(store):
    """Begin a run like any other: the maps of modes are what they are, which of them were met is not."""
    for slot in range(store.used.shape[0]):
        store.used[slot] = 0


@part(inline=True)
def _learn(prog, store, mode, work, x, dx0, dx, g):
    """Learn the present mode in place of the one that this run has met first, if at all; returns its slot."""
    slot = int(store.order[0])
    if slot < store.used.shape[0]:
        store.order[0] = slot + 1
    else:
        slot = 0
        for other in range(1, store.used.shape[0]):
            if store.used[other] < store.used[slot]:
                slot = other
    store.order[1] += 1
    store.used[slot] = store.order[1]
    each = LENGTHS * ranks(store)
    for i in range(slot * each, (slot + 1) * each):
        store.ready[i] = 0
    for i in range(mode.shape[0]):
        store.seen[slot, i] = mode[i]
    n, nr, nq, forces = x.shape[0], prog.ints[H_NR], store.acting.shape[0], work[1]
    for j in range(n):
        x[j] = dx0[j] = dx[j] = 0.0
    for i in range(nr):
        store.probe.harmonics[i, 0] = 0.0
    forces[F_ASKED] = STRAIGHT
    # rates and margins at zero, then one state, input, the time, or a curved law's force far from it
    for column in range(-1, n + nr + 1 + nq):
        t = 0.0
        acting = store.acting[column - n - nr - 1] if column > n + nr else 2
        if 0 <= column < n:
            x[column] = UNIT
        elif n <= column < n + nr:
            store.probe.harmonics[column - n, 0] = UNIT
        elif column == n + nr:
            t = UNIT
        elif acting < 2:
            forces[F_GIVEN + acting] = UNIT
        margin = store.base if column < 0 else store.ahead
        rates(prog, store.probe, 0, t, x, mode, work, dx0 if column < 0 else dx, g, True)
        extend(prog, mode, work, g, margin)
        if 0 <= column < n:
            x[column] = 0.0
            for j in range(n):
                store.a[slot, j, column] = (dx[j] - dx0[j]) / UNIT
        elif n <= column < n + nr:
            store.probe.harmonics[column - n, 0] = 0.0
            for j in range(n):
                store.b[slot, j, column - n] = (dx[j] - dx0[j]) / UNIT
        elif column == n + nr:
            for j in range(n):
                store.d[slot, j] = (dx[j] - dx0[j]) / UNIT
        elif column > n + nr:
            for j in range(n):
                rate = 1.0 if j == acting - 2 else 0.0
                store.q[slot, j, column - n - nr - 1] = (dx[j] - dx0[j]) / UNIT if acting < 2 else rate
            if acting < 2:
                forces[F_GIVEN + acting] = 0.0
        else:
            for j in range(n):
                store.c[slot, j] = dx0[j]
        # the signals stand in the work vector since the rates were taken
        for i in range(store.outs.shape[1]):
            value = combine(prog, prog.ints[prog.ints[L.H_OUT] + i], work[0])
            if column < 0:
                store.outs[slot, i, n + nr + 1] = value
            elif column <= n + nr:
                store.outs[slot, i, column] = (value - store.outs[slot, i, n + nr + 1]) / UNIT
        if column >= 0:
            for i in range(store.rows.shape[1]):
                slope = (margin[i] - store.base[i]) / UNIT if store.base[i] < math.inf else 0.0
                if column <= n + nr:
                    store.rows[slot, i, column] = slope
                else:
                    store.pushed[slot, i, column - n - nr - 1] = slope
    for i in range(store.rows.shape[1]):
        owner = i if i < prog.ints[H_NG] else _owner(prog, i - prog.ints[H_NG])
        store.owners[i] = owner
        store.rows[slot, i, n + nr + 1] = store.base[i] if owner >= 0 else math.inf
    forces[F_ASKED] = STRAIGHT | CURVED
    return slot


@part(inline=True)
def extend(prog, mode, work, g, out):
    """Copy margins to `out`, that of a body at rest as two: its hold ends upward or downward.

    The smaller of the two is no straight line. The second ones stand at out[ng] and out[ng + 1].
    """
    ng = g.shape[0] - 1
    for i in range(ng):
        out[i] = g[i]
    out[ng] = out[ng + 1] = math.inf
    for n in range(prog.nodes.shape[0]):
        if prog.nodes[n, KIND] != MECHANISM:
            continue
        mo, f = prog.nodes[n, MODE], work[1]
        bodies = prog.ints[prog.nodes[n, AUX] + A_BODIES]
        joined = bodies == 2 and closed(prog, n, mode)
        for b in range(bodies):
            at_wall = mode[mo + WALL] != 0 and b == bodies - 1
            if mode[mo + b] != STUCK or at_wall or (joined and b == DIR0):
                continue
            up, down, force = (
                dry_level(prog, n, b, 0.0, 1.0, 0.0, f),
                dry_level(prog, n, b, 0.0, -1.0, 0.0, f),
                f[b],
            )
            if joined:
                force = f[0] + f[1]
                up += dry_level(prog, n, 0, 0.0, 1.0, 0.0, f)
                down += dry_level(prog, n, 0, 0.0, -1.0, 0.0, f)
            at = prog.nodes[n, G] + (G_BODY1 if b == DIR1 else 0)
            out[at] = up - force
            out[ng + b] = down + force


@part(inline=True)
def forced(prog, drive, segment, t, length, rtol, store):
    """Write the external inputs over a step as powers: r(t + theta length) = sum forcing[k] theta^k, k > 0.

    Returns the terms their own series needs; 0 where they are constant.
    """
    nr = prog.ints[H_NR]
    nt, nh = drive.time.shape[0], drive.harmonics.shape[1]
    least = 0
    ramped = nt > 0 and drive.linear == 1 and segment + 1 < nt
    for k in range(TERMS + 1):
        for i in range(nr):
            store.forcing[k, i] = 0.0
    if ramped:
        for i in range(nr):
            rise = drive.samples[i, segment + 1] - drive.samples[i, segment]
            store.forcing[1, i] = rise / (drive.time[segment + 1] - drive.time[segment]) * length
            least = 2
    for i in range(nr):
        for h in range(1, nh):
            c = drive.harmonics[i, h]
            if c == 0:
                continue
            angle = h * drive.omega * t
            re = c.real * math.cos(angle) - c.imag * math.sin(angle)
            im = c.real * math.sin(angle) + c.imag * math.cos(angle)
            turn, term = h * drive.omega * length, 1.0
            for k in range(1, TERMS + 1):
                # times j h omega length / k
                re, im = -im * turn / k, re * turn / k
                term *= turn / k
                store.forcing[k, i] += re
                if term > FORCING_SHARE * rtol:
                    least = max(least, k + 1)
    return min(least, TERMS)


@part(inline=True)
def series(store, slot, length, least, k0, size, rtol, atol, poly):
    """Power series of the flow over `length` seconds from a state with rates k0, into poly.

    `least` is the least number of terms. Returns (terms, share): the series holds to tolerance over that
    share of the length (1: all of it).
    """
    n, nr = size.shape[0], store.b.shape[2]
    a = store.a[slot]
    before = now = 0.0
    for i in range(n):
        store.measures[i] = size[i]
    for k in range(1, TERMS + 1):
        before, now = now, 0.0
        for i in range(n):
            if k == 1:
                value = length * k0[i]
            else:
                value = 0.0
                for j in range(n):
                    value += a[i, j] * poly[k - 2, j]
                if least > 0:
                    for j in range(nr):
                        value += store.b[slot, i, j] * store.forcing[k - 1, j]
                if k == 2:
                    value += store.d[slot, i] * length
                value *= length / k
            poly[k - 1, i] = value
            if store.measures[i] == 0.0:
                store.measures[i] = abs(value)  # begins at zero: measured by what moves it first
            if value != 0.0:
                now = max(now, abs(value) / (atol + rtol * store.measures[i]))
        if not now < math.inf:
            return k, -1.0
        if k >= 3 and now < AFFINE_SHARE and before < AFFINE_SHARE and k >= least:
            return k, 1.0
    share = min((AFFINE_SHARE / now) ** (1.0 / TERMS), (AFFINE_SHARE / before) ** (1.0 / (TERMS - 1)))
    return TERMS, min(share, 1.0)


@part
def shrink(store, share, terms, poly):
    """Refer a series to a shorter step."""
    factor = 1.0
    for k in range(terms):
        factor *= share
        for j in range(poly.shape[1]):
            poly[k, j] *= factor
        for i in range(store.forcing.shape[1]):
            store.forcing[k + 1, i] *= factor


@part(inline=True)
def crossing(prog, store, slot, mode, work, length, terms, poly, g0, gtol, norm, g):
    """Fraction of the step at which the first margin crosses zero, and its index (1.0, -1: none).

    `g0` are the margins at the start; `g` receives those at the end.
    """
    n, nr, ng = poly.shape[1], prog.ints[H_NR], prog.ints[H_NG]
    curve = store.curves
    first, index = 1.0, -1
    extend(prog, mode, work, g0, store.base)
    for row in range(ng + 2):
        owner = row if row < ng else _owner(prog, row - ng)
        if not store.base[row] < math.inf or owner < 0:
            if row < ng:
                g[row] = math.inf
            continue
        curve[0] = store.base[row] + gtol[owner]
        slopes = store.rows[slot, row]
        for k in range(1, terms + 1):
            curve[k] = 0.0
        for j in range(n):
            if slopes[j] != 0.0:
                for k in range(1, terms + 1):
                    curve[k] += slopes[j] * poly[k - 1, j]
        for j in range(nr):
            if slopes[n + j] != 0.0:
                for k in range(1, terms + 1):
                    curve[k] += slopes[n + j] * store.forcing[k, j]
        curve[1] += slopes[n + nr] * length
        reach = end = 0.0
        for k in range(1, terms + 1):
            reach += abs(curve[k])
            end += curve[k]
        end += store.base[row]
        g[owner] = end if row < ng else min(g[owner], end)
        if curve[0] > reach:
            continue
        theta = first_root(curve, terms, first, max(norm[owner], reach))
        if theta < first or (theta == first and index < 0 and end + gtol[owner] < 0.0):
            first, index = theta, owner
    return first, index


@part(inline=True)
def _owner(prog, body):
    """Margin that the second hold margin of a body belongs to."""
    for n in range(prog.nodes.shape[0]):
        if prog.nodes[n, KIND] == MECHANISM:
            return prog.nodes[n, G] + body
    return -1


@part
def entry(row, j, n, nr):
    """Entry over z of a row of `Memory.rows` or `Memory.outs`; slopes of inputs stand beside."""
    if j < n + nr:
        return row[j]
    return row[j - nr] if j >= n + 2 * nr else 0.0
