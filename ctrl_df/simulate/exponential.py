# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""Steps between samples of a mode that is affine but for curved laws: an exponential Runge-Kutta method.

In such a mode dx/dt = A x + B r + c + d t + Q q(x, t), where q are the forces of the curved laws and the rates of
their own states (`ctrl_df.simulate.affine`). With J = A + Q K and the remainder R = q - K x the affine part is
taken exactly, inputs that are held or interpolated included, and R as a polynomial through m + 1 equal parts
of the step: the state at node i is x_i = E_i z + sum_j W_ij R_j, z = (x, r, s, t, 1) as in
`ctrl_df.simulate.glide`, with matrices that are the same in every step of a length. The remainder at nodes still
ahead is foretold from the step before; each node, once known, corrects what is foretold for those behind it.
What the last node changes is the difference between the results with polynomials of degree m - 1 and m: the error
of the former, asked to stay within the tolerance of a step (the result is the latter). One evaluation of the
curved laws a node, three a step (m = 3) or six where they vary fast.

K is zero until a law turns out stiff (a bristle: rates of 10^5 1/s): then it is the Jacobian of q at a recent
state, taken anew when steps with it fail. It changes no result beyond the tolerance, as R has what it lacks.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .affine import LENGTHS, RANKS, Memory, entry
from .compiled import part
from .layout import AUX, CURVED, F_ASKED, F_SIZE, H_BUMP, KIND, MECHANISM
from .locate import bump_share
from .matrices import multiply, row_times
from .mechanics import curved_forces
from .views import lean

PARTS = np.array([3, 6])  # of a step, for each rank
MOST = 6
STIFF = 0.1  # contraction h |dR/dx| of a sweep beyond which K is renewed
NUDGE = 1e-6  # of difference quotients of the curved laws, relative to the size of a state
PATIENCE = 40  # steps of the higher rank before the lower one is tried again
EPS = np.finfo(float).eps
ORDER = 12  # terms of the series of an exponential
HALVINGS = 40
# R(tau) = sum_j R_j sum_k (tau / sigma)^k BASIS[j, k] / k! through the nodes 0, sigma, 2 sigma, ...
BASES = np.zeros((RANKS, MOST + 1, MOST + 1))
for _rank, _m in enumerate(PARTS):
    _powers = np.linalg.inv(np.vander(np.arange(_m + 1.0), increasing=True))
    BASES[_rank, : _m + 1, : _m + 1] = (_powers * [[math.factorial(k)] for k in range(_m + 1)]).T
BINOMIAL = np.array([[math.comb(k, i) for k in range(MOST + 1)] for i in range(MOST + 1)], float)


class Bend(NamedTuple):
    """What the curved laws add to a `ctrl_df.simulate.glide.Glide`."""

    last: np.ndarray  # (SLOTS * LENGTHS * RANKS, n, nq): what the last node's remainder does to the end
    slope: np.ndarray  # (SLOTS, nq, n): K
    state: np.ndarray  # (SLOTS, 4): whether K is not zero, halvings, rank in use, patience
    z: np.ndarray  # z and the remainder at all nodes, known or foretold
    x: np.ndarray  # (MOST + 1, n): states at the nodes
    q: np.ndarray  # (MOST + 1, nq): curved laws there
    change: np.ndarray  # (nq,): of the last node's remainder
    margin: np.ndarray  # (MOST + 1, margins): at the nodes
    push: np.ndarray  # forces, see `ctrl_df.simulate.layout`
    dx: np.ndarray  # (n,)
    jacobian: np.ndarray  # (nq, n)
    matrix: np.ndarray  # (2 * MOST + 7, n, n): scratch


def bend_memory(memory: Memory) -> Bend:
    """Allocate what goes with a memory; small where no law is curved."""
    slots, n, nr = memory.b.shape
    nq = memory.acting.shape[0]
    if nq == 0:
        slots = n = nr = 0
    push = np.zeros(F_SIZE)
    push[F_ASKED] = CURVED
    return Bend(
        np.zeros((slots * LENGTHS * RANKS, n, nq)), np.zeros((slots, nq, n)), np.zeros((slots, 4)),
        np.zeros(n + 2 * nr + 2 + (MOST + 1) * nq), np.zeros((MOST + 1, n)), np.zeros((MOST + 1, nq)),
        np.zeros(nq), np.zeros((MOST + 1, memory.rows.shape[1])), push, np.zeros(n), np.zeros((nq, n)), np.zeros((2 * MOST + 7, n, n)),
    )  # fmt: skip


@part(inline=True)
def parts(store, rank):
    """Parts of a step: one where no law is curved."""
    return lean(PARTS)[rank] if store.acting.shape[0] > 0 else 1


@part
def forget(store, bend):
    """Begin a run like any other: no Jacobian that an earlier one has left."""
    for slot in range(bend.state.shape[0]):
        if bend.state[slot, 0] != 0.0:
            _straighten(store, bend, slot)
        for i in range(4):
            bend.state[slot, i] = 0.0


@part
def _straighten(store, bend, slot):
    """Set K of a mode to zero."""
    for i in range(bend.slope.shape[1]):
        for j in range(bend.slope.shape[2]):
            bend.slope[slot, i, j] = 0.0
    for i in range(slot * LENGTHS * RANKS, (slot + 1) * LENGTHS * RANKS):
        store.ready[i] = 0
    bend.state[slot, 0] = 0.0


@part
def ask(prog, t, x, mode, store, bend, q):
    """Write the curved laws' forces and rates at one state."""
    for node in range(prog.nodes.shape[0]):
        if prog.nodes[node, KIND] == MECHANISM:
            curved_forces(prog, node, t, x, mode, bend.push, bend.dx)
    for i in range(q.shape[0]):
        acting = store.acting[i]
        q[i] = bend.push[acting] if acting < 2 else bend.dx[acting - 2]


@part
def bent_step(prog, store, tracks, place, slot, rank, goes_on, t, h, here, x, mode, rtol, atol, size, grain,
              share, ahead):  # fmt: skip
    """One step from `here` (z) to `ahead` (its states), the nodes left in `tracks.bend`.

    With `goes_on` the step before ended here and was of the same kind. Returns whether its error is within
    `share` of the tolerance.
    """
    bend = tracks.bend
    n, nq, m = x.shape[0], store.acting.shape[0], lean(PARTS)[rank]
    nz = here.shape[0]
    z, xs, q = bend.z, bend.x, bend.q
    slope, binomial = bend.slope[slot], lean(BINOMIAL)
    curled = bend.state[slot, 0] != 0.0
    sigma = h / m
    first, column, value = tracks.first[place], tracks.column[place], tracks.value[place]
    for j in range(nz):
        z[j] = here[j]
    # --- the remainder here and, foretold, ahead: a parabola through the last nodes of the step before
    if goes_on:
        for i in range(nq):
            end, before = nz + m * nq + i, nz + i
            r0, r1, r2 = z[end], z[end - nq], z[end - 2 * nq]
            one, two = r0 - r1, r0 - 2.0 * r1 + r2
            for k in range(m + 1):
                z[before + k * nq] = r0 + k * (one + 0.5 * (k + 1) * two)
            q[0, i] = q[m, i]
    else:
        ask(prog, t, x, mode, store, bend, q[0])
        for i in range(nq):
            r0 = q[0, i]
            if curled:
                for j in range(n):
                    r0 -= slope[i, j] * x[j]
            for k in range(m + 1):
                z[nz + k * nq + i] = r0
    for j in range(n):
        xs[0, j] = x[j]
    # --- from node to node
    for node in range(1, m + 1):
        for j in range(n):
            xs[node, j] = row_times(first, column, value, (node - 1) * n + j, z)
        ask(prog, t + node * sigma, xs[node], mode, store, bend, q[node])
        for i in range(nq):
            r = q[node, i]
            if curled:
                for j in range(n):
                    r -= slope[i, j] * xs[node, j]
            at = nz + node * nq + i
            change = r - z[at]
            z[at] = r
            bend.change[i] = change
            for k in range(node + 1, m + 1):
                z[at + (k - node) * nq] += binomial[node, k] * change
    # --- the end, and its error
    total = 0.0
    for j in range(n):
        error = 0.0
        for i in range(nq):
            error += bend.last[place, j, i] * bend.change[i]
        ahead[j] = xs[m, j] + error
        if error != 0.0:
            total += (error / (atol + h * grain[j] + rtol * size[j])) ** 2
    return total <= n * share * share


@part
def renew(prog, store, bend, slot, t, h, x, mode, size):
    """Take the Jacobian of the curved laws here for K, if they are stiff beside the present one."""
    n, nq = x.shape[0], store.acting.shape[0]
    trial, q0, q1 = bend.x[1], bend.q[0], bend.q[1]
    ask(prog, t, x, mode, store, bend, q0)
    for j in range(n):
        trial[j] = x[j]
    for j in range(n):
        nudge = NUDGE * size[j]
        trial[j] = x[j] + nudge
        nudge = trial[j] - x[j]
        if nudge != 0.0:
            ask(prog, t, trial, mode, store, bend, q1)
        for i in range(nq):
            bend.jacobian[i, j] = (q1[i] - q0[i]) / nudge if nudge != 0.0 else 0.0
        trial[j] = x[j]
    # contraction: trace of h Q (dq/dx - K), and of its square
    lag, trace, square = bend.matrix[0], 0.0, 0.0
    for i in range(n):
        for j in range(n):
            value = 0.0
            for k in range(nq):
                value += store.q[slot, i, k] * (bend.jacobian[k, j] - bend.slope[slot, k, j])
            lag[i, j] = h * value
    for i in range(n):
        trace += lag[i, i]
        for j in range(n):
            square += lag[i, j] * lag[j, i]
    if not max(abs(trace), math.sqrt(abs(square))) > STIFF:
        return False
    for i in range(nq):
        for j in range(n):
            if not abs(bend.jacobian[i, j]) < math.inf:
                return False
    _straighten(store, bend, slot)
    for i in range(nq):
        for j in range(n):
            bend.slope[slot, i, j] = bend.jacobian[i, j]
    bend.state[slot, 0] = 1.0
    return True


@part
def narrow(prog, x, x1):
    """Whether a step is too long to meet a narrow feature of friction over speed."""
    return prog.ints[H_BUMP] == 1 and bump_share(prog, x, x1) < 0.7


@part
def make_bent(store, tracks, place, slot, rank, h, n, nr):
    """Compute the matrices E, W of a mode over `h` seconds, row after row; returns their entries (-1: none).

    With V_k(tau) the integral of exp((tau - s) J) s^k / k! over 0..tau, from its series and
    V_k(tau + s) = exp(s J) V_k(tau) + sum_j tau^(k - j) / (k - j)! V_j(s).
    """
    bend = tracks.bend
    m, nq = lean(PARTS)[rank], store.acting.shape[0]
    basis = lean(BASES)[rank]
    sigma = h / m
    # exp and V_0 .. V_m at tau, at sigma; J; scratch
    jacobian, scratch = bend.matrix[2 * MOST + 5], bend.matrix[2 * MOST + 6]
    for i in range(n):
        for j in range(n):
            value = store.a[slot, i, j]
            for k in range(nq):
                value += store.q[slot, i, k] * bend.slope[slot, k, j]
            jacobian[i, j] = value
    halvings = int(bend.state[slot, 1])
    while not _series(bend.matrix, jacobian, sigma / 2.0**halvings, m, scratch):
        halvings += 1
        if halvings > HALVINGS:
            return -1
    bend.state[slot, 1] = halvings
    tau = sigma / 2.0**halvings
    for _ in range(halvings):
        _copy(bend.matrix, m, n)
        _extend(bend.matrix, tau, m, scratch)
        tau *= 2.0
    _copy(bend.matrix, m, n)
    count = 0
    tracks.first[place, 0] = 0
    for node in range(1, m + 1):
        if node > 1:
            _extend(bend.matrix, (node - 1) * sigma, m, scratch)
        exponential, v0, v1 = bend.matrix[0], bend.matrix[1], bend.matrix[2]
        for i in range(n):
            for column in range(n + 2 * nr + 2 + (m + 1) * nq):
                value = 0.0
                if column < n:
                    value = exponential[i, column]
                elif column < n + 2 * nr:
                    k = (column - n) % nr
                    for j in range(n):
                        value += (v0[i, j] if column < n + nr else v1[i, j]) * store.b[slot, j, k]
                elif column == n + 2 * nr:
                    for j in range(n):
                        value += v0[i, j] * store.d[slot, j]
                elif column == n + 2 * nr + 1:
                    for j in range(n):
                        value += v0[i, j] * store.c[slot, j] + v1[i, j] * store.d[slot, j]
                else:
                    of, k = divmod(column - n - 2 * nr - 2, nq)
                    scale = 1.0
                    for power in range(m + 1):
                        share = 0.0
                        for j in range(n):
                            share += bend.matrix[1 + power][i, j] * store.q[slot, j, k]
                        value += basis[of, power] * scale * share
                        scale /= sigma
                    if node == m and of == m:
                        bend.last[place, i, k] = value
                if not abs(value) < math.inf:
                    return -1
                if value != 0.0:
                    tracks.column[place, count], tracks.value[place, count] = column, value
                    count += 1
            tracks.first[place, (node - 1) * n + i + 1] = count
    return count


@part
def _series(matrix, jacobian, tau, m, scratch):
    """Write exp(tau J), V_0 .. V_m at tau; False where the series needs more terms than there are."""
    n = jacobian.shape[0]
    top, power = matrix[1 + m], matrix[0]
    factor = 1.0
    for k in range(1, m + 2):
        factor *= tau / k
    for i in range(n):
        for j in range(n):
            top[i, j] = power[i, j] = factor if i == j else 0.0
    small = False
    for term in range(1, ORDER + 1):
        multiply(jacobian, power, scratch)
        small = True
        for i in range(n):
            for j in range(n):
                power[i, j] = scratch[i, j] * tau / (term + m + 1)
                top[i, j] += power[i, j]
                small = small and abs(power[i, j]) <= 0.1 * EPS * abs(top[i, j])
        if small:
            break
    if not small:
        return False
    # V_(k-1) = tau^k / k! + J V_k
    for k in range(m, -1, -1):
        multiply(jacobian, matrix[1 + k], matrix[k])
        factor = 1.0
        for i in range(1, k + 1):
            factor *= tau / i
        for i in range(n):
            matrix[k][i, i] += factor
    return True


@part
def _copy(matrix, m, n):
    """Keep what belongs to tau as what belongs to sigma."""
    for k in range(m + 2):
        for i in range(n):
            for j in range(n):
                matrix[MOST + 2 + k, i, j] = matrix[k, i, j]


@part
def _extend(matrix, tau, m, scratch):
    """Go on from tau by sigma."""
    n = scratch.shape[0]
    onward = matrix[MOST + 2]
    for k in range(m + 2):
        multiply(onward, matrix[k], scratch)
        for i in range(n):
            for j in range(n):
                matrix[k][i, j] = scratch[i, j]
        factor = 1.0
        for back in range(k):
            # V_(k-1): j = k - 1 - back
            older = matrix[MOST + 2 + k - back]
            for i in range(n):
                for j in range(n):
                    matrix[k][i, j] += factor * older[i, j]
            factor *= tau / (back + 1)
