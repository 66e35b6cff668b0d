# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""Steps between samples of a mode that is affine but for curved laws: an exponential Runge-Kutta method.

In such a mode dx/dt = A x + B r + c + d t + Q q(x, t); q are the forces of the curved laws and the rates of
their own states (`affine`). With J = A + Q K and the remainder R = q - K x the affine part
is taken exactly, inputs that are held or interpolated included, and R as a polynomial through m + 1 equal
parts of the step, predicted from the step before. Each node, once known, changes what is predicted behind it
by D_i u (u - 1) .. (u - i + 1) / i!, u counting nodes: x_k = E_k z + P_k p + sum_i G_ki D_i at node k, i < k,
z = (x, r, s, t, 1) as in `propagate` and p the parabola predicted; the matrices are the same in
every step of a length. What the last node changes, G_mm D_m, is the difference between the results with
polynomials of degree m - 1 and m: the error of the former, asked to stay within the tolerance of a step (the
result is the latter). The curved laws are evaluated once a node: twice a step (m = 2), and up to eight times
where they vary fast.

K is zero until a law turns out stiff (a bristle: rates of 10^5 1/s): then it is the Jacobian of q at a recent
state, recomputed when steps with it fail. It changes no result beyond the tolerance, as R has what it lacks.

With K all matrices are made again, which takes as long as many steps. Where they serve few (elements that
slip one after another bend at every sample) other methods are faster: what they cost is set off against the
steps that they save, and a mode in which they cost more is left to these methods for a while.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...thresholds import EPS
from ..compiler.compiled import part
from ..compiler.views import lean
from ..dynamics.mechanics import curved_forces
from ..program.layout import CURVED, F_ASKED, F_SIZE, H_BUMP
from ..thresholds import (
    BUMP_KEPT,
    CURVED_HALVINGS,
    CURVED_NUDGE,
    CURVED_SHARE,
    EXPONENTIAL_TERMS,
    EXPONENTIAL_TURN,
)
from .affine import LENGTHS, RANKS, Memory
from .locate import bump_share

PARTS = np.array([2, 3, 5, 8])  # of a step, for each rank
MOST = 8
USE = 1  # an entry of `Bend.state`
# u (u - 1) .. (u - i + 1) / i! = sum_k NEWTON[i, k] u^k / k!
NEWTON = np.zeros((MOST + 1, MOST + 1))
for _i in range(MOST + 1):
    _powers = np.poly1d(np.poly(np.arange(_i))).coeffs[::-1] / math.factorial(_i)
    NEWTON[_i, : _i + 1] = _powers * [math.factorial(k) for k in range(_i + 1)]
BINOMIAL = np.array([[math.comb(k, i) for k in range(MOST + 1)] for i in range(MOST + 1)], float)


class Bend(NamedTuple):
    """What the curved laws add to a `ctrl_df.simulate.kernel.propagators.Propagators`."""

    base: np.ndarray  # (SLOTS * LENGTHS * RANKS, room): rows E_k, P_k of all nodes
    gain: np.ndarray  # (SLOTS * LENGTHS * RANKS, room): G_ki, as they are needed
    slope: np.ndarray  # (SLOTS, nq, n): K
    state: np.ndarray  # (SLOTS, 5): whether K is not zero, use of the slot it is of, rank, patience, worth
    nodes: np.ndarray  # (MOST + 1, nz + 3 nq): at each node z, q, R and D
    push: np.ndarray  # forces, see `ctrl_df.simulate.program.layout`
    dx: np.ndarray  # (n,)
    jacobian: np.ndarray  # (nq, n)
    matrix: np.ndarray  # (2 * MOST + 5, n, n): scratch


def bend_memory(memory: Memory) -> Bend:
    """Allocate what goes with a memory; small where no law is curved."""
    slots, n, nr = memory.b.shape
    nq = memory.acting.shape[0]
    if nq == 0:
        slots = n = nr = 0
    used, nz = slots * LENGTHS * RANKS, n + 2 * nr + 2
    push, nodes = np.zeros(F_SIZE), np.zeros((MOST + 1, nz + 3 * nq))
    push[F_ASKED] = CURVED
    nodes[:, nz - 1] = 1.0
    return Bend(
        np.zeros((used, MOST * n * (nz + 3 * nq))), np.zeros((used, (MOST * (MOST - 1) // 2 + 1) * n * nq)),
        np.zeros((slots, nq, n)), np.zeros((slots, 5)), nodes, push, np.zeros(n), np.zeros((nq, n)),
        np.zeros((2 * MOST + 5, n, n)),
    )  # fmt: skip


@part(inline=True)
def parts(store, rank):
    """Parts of a step: one where no law is curved."""
    return lean(PARTS)[rank] if store.acting.shape[0] > 0 else 1


@part
def begin_use(store, bend, slot):
    """Begin with a mode as a run does that meets it first: no Jacobian that another has left."""
    use = float(store.used[slot])
    if bend.state[slot, USE] != use:
        if bend.state[slot, 0] != 0.0:
            _straighten(store, bend, slot)
        for i in range(bend.state.shape[1]):
            bend.state[slot, i] = 0.0
        bend.state[slot, USE] = use


@part
def _straighten(store, bend, slot):
    """Set K of a mode to zero."""
    for i in range(bend.slope.shape[1]):
        for j in range(bend.slope.shape[2]):
            bend.slope[slot, i, j] = 0.0
    for i in range(slot * LENGTHS * RANKS, (slot + 1) * LENGTHS * RANKS):
        store.ready[i] = 0
    bend.state[slot, 0] = 0.0


@part(inline=True)
def _ask(prog, node, t, x, mode, acting, push, dx, out, first):
    """Write the curved laws' forces and rates at one state to `out` from `first` on."""
    curved_forces(prog, node, t, x, mode, push, dx)
    for i in range(acting.shape[0]):
        out[first + i] = push[acting[i]] if acting[i] < 2 else dx[acting[i] - 2]


@part
def ask(prog, node, t, x, mode, acting, push, dx, out, first):
    """Write the same; one copy of the code for all who are not in a hurry."""
    _ask(prog, node, t, x, mode, acting, push, dx, out, first)


@part
def bent_step(prog, node, mode, acting, push, dx, nodes, slope, curled, base, gain, m, goes_on, t, h, here,
              ahead, size, rounding, rtol, atol):  # fmt: skip
    """Take a step of m parts from `here` (z and p) to the states `ahead`, the nodes left in `nodes`.

    With `goes_on` the step before ended here and was of the same kind; `curled`: K is not zero. Returns the
    error relative to the tolerance.
    """
    n, nq = size.shape[0], acting.shape[0]
    width = here.shape[0]
    nz = width - 3 * nq
    at_r, at_d, sigma, binomial = nz + nq, nz + 2 * nq, h / m, lean(BINOMIAL)
    # --- the remainder here and, predicted, ahead: a parabola through the last nodes of the step before
    if not goes_on:
        ask(prog, node, t, here, mode, acting, push, dx, nodes[0], nz)
    for f in range(nq):
        p = nz + 3 * f
        if goes_on:
            r0, r1, r2 = nodes[m, at_r + f], nodes[m - 1, at_r + f], nodes[m - 2, at_r + f]
            here[p], here[p + 1], here[p + 2] = r0, r0 - r1, r0 - 2.0 * r1 + r2
            nodes[0, nz + f] = nodes[m, nz + f]
        else:
            r0 = nodes[0, nz + f]
            if curled:
                for j in range(n):
                    r0 -= slope[f, j] * here[j]
            here[p], here[p + 1], here[p + 2] = r0, 0.0, 0.0
    for f in range(nq):
        nodes[0, at_r + f] = here[nz + 3 * f]
    at = 0
    for k in range(1, m + 1):
        for j in range(n):
            total = 0.0
            for i in range(width):
                total += base[at + i] * here[i]
            nodes[k, j] = total
            at += width
    # --- from node to node
    at = 0
    for k in range(1, m + 1):
        row = nodes[k]
        for j in range(n):
            total = row[j]
            for i in range(1, k):
                for f in range(nq):
                    total += gain[at] * nodes[i, at_d + f]
                    at += 1
            row[j] = total
        _ask(prog, node, t + k * sigma, row, mode, acting, push, dx, row, nz)
        for f in range(nq):
            value = row[nz + f]
            if curled:
                for j in range(n):
                    value -= slope[f, j] * row[j]
            row[at_r + f] = value
            p = nz + 3 * f
            value -= here[p] + k * (here[p + 1] + 0.5 * (k + 1) * here[p + 2])
            for i in range(1, k):
                value -= binomial[i, k] * nodes[i, at_d + f]
            row[at_d + f] = value
    # --- the end, and its error
    total = 0.0
    for j in range(n):
        error = 0.0
        for f in range(nq):
            error += gain[at] * nodes[m, at_d + f]
            at += 1
        ahead[j] = nodes[m, j] + error
        if error != 0.0:
            error /= atol + h * rounding[j] + rtol * size[j]
            total += error * error
    return math.sqrt(total / n)


@part
def contraction(prog, node, store, bend, slot, t, h, x, mode, size):
    """Take the Jacobian of the curved laws here; returns how much an error of R shrinks in a sweep with K.

    That is the spectral radius of h Q (dq/dx - K), about: the larger of what its trace and that of its square
    say of it, which do not depend on units.
    """
    n, nq = x.shape[0], store.acting.shape[0]
    trial, beside = bend.nodes[1], bend.nodes[0]
    ask(prog, node, t, x, mode, store.acting, bend.push, bend.dx, beside, 0)
    for j in range(n):
        trial[j] = x[j]
    for j in range(n):
        trial[j] = x[j] + CURVED_NUDGE * size[j]
        nudge = trial[j] - x[j]
        if nudge != 0.0:
            ask(prog, node, t, trial, mode, store.acting, bend.push, bend.dx, beside, nq)
        for i in range(nq):
            bend.jacobian[i, j] = (beside[nq + i] - beside[i]) / nudge if nudge != 0.0 else 0.0
        trial[j] = x[j]
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
    return max(abs(trace), math.sqrt(abs(square)))


@part
def renew(store, bend, slot):
    """Let K be the Jacobian that `contraction` has taken; whether it is finite."""
    for i in range(bend.jacobian.shape[0]):
        for j in range(bend.jacobian.shape[1]):
            if not abs(bend.jacobian[i, j]) < math.inf:
                return False
    _straighten(store, bend, slot)
    for i in range(bend.jacobian.shape[0]):
        for j in range(bend.jacobian.shape[1]):
            bend.slope[slot, i, j] = bend.jacobian[i, j]
    bend.state[slot, 0] = 1.0
    return True


@part
def narrow(prog, x, x1):
    """Whether a step is too long to meet a narrow feature of friction over speed."""
    return prog.ints[H_BUMP] == 1 and bump_share(prog, x, x1) < BUMP_KEPT


@part
def make_bent(store, bend, place, slot, rank, h, n, nr):
    """Compute the matrices E, P, G of a mode over `h` seconds; returns whether there are any.

    With V_k(tau) the integral of exp((tau - s) J) s^k / k! over 0..tau, from its series and
    V_k(tau + s) = exp(s J) V_k(tau) + sum_j tau^(k - j) / (k - j)! V_j(s).
    """
    m, nq, newton = lean(PARTS)[rank], store.acting.shape[0], lean(NEWTON)
    base, gain = bend.base[place], bend.gain[place]
    sigma = h / m
    # exp and V_0 .. V_m at tau, at sigma; J
    jacobian = bend.matrix[2 * MOST + 4]
    for i in range(n):
        for j in range(n):
            value = store.a[slot, i, j]
            for k in range(nq):
                value += store.q[slot, i, k] * bend.slope[slot, k, j]
            jacobian[i, j] = value
    halvings = _least_halvings(jacobian, sigma)
    while halvings > CURVED_HALVINGS or not _series(bend.matrix, jacobian, sigma / 2.0**halvings, m, bend.dx):
        halvings += 1
        if halvings > CURVED_HALVINGS:
            return False
    tau = sigma / 2.0**halvings
    for _ in range(halvings):
        _copy(bend.matrix, m, n)
        _extend(bend.matrix, tau, m, bend.dx)
        tau *= 2.0
    _copy(bend.matrix, m, n)
    width, at = n + 2 * nr + 2 + 3 * nq, 0
    for node in range(1, m + 1):
        if node > 1:
            _extend(bend.matrix, (node - 1) * sigma, m, bend.dx)
        exponential, v0, v1, v2 = bend.matrix[0], bend.matrix[1], bend.matrix[2], bend.matrix[3]
        for i in range(n):
            row = ((node - 1) * n + i) * width
            for j in range(width):
                base[row + j] = 0.0
            one = row + n + 2 * nr + 1
            for j in range(n):
                base[row + j] = exponential[i, j]
                for k in range(nr):
                    base[row + n + k] += v0[i, j] * store.b[slot, j, k]
                    base[row + n + nr + k] += v1[i, j] * store.b[slot, j, k]
                base[one - 1] += v0[i, j] * store.d[slot, j]
                base[one] += v0[i, j] * store.c[slot, j] + v1[i, j] * store.d[slot, j]
                for k in range(nq):
                    # what grows like the parabola's parts, u and u (u + 1) over 2
                    up, bow = v1[i, j] / sigma, v2[i, j] / (sigma * sigma)
                    to = one + 1 + 3 * k
                    base[to] += v0[i, j] * store.q[slot, j, k]
                    base[to + 1] += up * store.q[slot, j, k]
                    base[to + 2] += (bow + 0.5 * up) * store.q[slot, j, k]
            for j in range(width):
                if not abs(base[row + j]) < math.inf:
                    return False
            for of in range(1, node):
                for k in range(nq):
                    gain[at] = _newton_gain(bend.matrix, newton, store.q[slot], i, of, k, sigma)
                    at += 1
    for i in range(n):
        for k in range(nq):
            gain[at] = _newton_gain(bend.matrix, newton, store.q[slot], i, m, k, sigma)
            at += 1
    return True


@part
def _newton_gain(matrix, newton, q, row, degree, k, sigma):
    """Return what a change of remainder k that grows like Newton's polynomial of a degree does to a state."""
    value, scale = 0.0, 1.0
    for power in range(degree + 1):
        total = 0.0
        for j in range(q.shape[0]):
            total += matrix[1 + power, row, j] * q[j, k]
        value += newton[degree, power] * scale * total
        scale /= sigma
    return value


@part
def _least_halvings(jacobian, tau):
    """Return how often tau is to be halved at least for a series of `EXPONENTIAL_TERMS` terms to converge.

    The trace of J^2 tells about the largest rate, whatever the units of the states.
    """
    square = 0.0
    for i in range(jacobian.shape[0]):
        for j in range(jacobian.shape[0]):
            square += jacobian[i, j] * jacobian[j, i]
    turn, halvings = math.sqrt(abs(square)) * tau, 0
    while turn > EXPONENTIAL_TURN and halvings <= CURVED_HALVINGS:
        turn *= 0.5
        halvings += 1
    return halvings


@part
def _series(matrix, jacobian, tau, m, column):
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
    for term in range(1, EXPONENTIAL_TERMS + 1):
        small = True
        factor = tau / (term + m + 1)
        for j in range(n):
            for i in range(n):
                column[i] = power[i, j]
            for i in range(n):
                total = 0.0
                for q in range(n):
                    total += jacobian[i, q] * column[q]
                total *= factor
                power[i, j] = total
                top[i, j] += total
                small = small and abs(total) <= CURVED_SHARE * EPS * abs(top[i, j])
        if small:
            break
    if not small:
        return False
    # V_(k-1) = tau^k / k! + J V_k
    factor = 1.0
    for k in range(1, m + 1):
        factor *= tau / k
    for k in range(m, -1, -1):
        for i in range(n):
            for j in range(n):
                total = factor if i == j else 0.0
                for q in range(n):
                    total += jacobian[i, q] * matrix[1 + k, q, j]
                matrix[k, i, j] = total
        factor *= k / tau
    return True


@part
def _copy(matrix, m, n):
    """Keep what belongs to tau as what belongs to sigma."""
    for k in range(m + 2):
        for i in range(n):
            for j in range(n):
                matrix[MOST + 2 + k, i, j] = matrix[k, i, j]


@part
def _extend(matrix, tau, m, column):
    """Go on from tau by sigma. `column` is scratch."""
    n = matrix.shape[1]
    for k in range(m + 2):
        for j in range(n):
            for i in range(n):
                column[i] = matrix[k, i, j]
            for i in range(n):
                total = 0.0
                for q in range(n):
                    total += matrix[MOST + 2, i, q] * column[q]
                factor = 1.0
                for back in range(k):
                    # V_(k-1) takes tau^back / back! V_(k-1-back)
                    total += factor * matrix[MOST + 2 + k - back, i, j]
                    factor *= tau / (back + 1)
                matrix[k, i, j] = total
