# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""One Runge-Kutta step with its error, and the state anywhere inside it.

Three tableaux, all from SciPy's public solver classes: Dormand-Prince 8(5,3) for long steps, 5(4) for the
short steps between the samples of a measurement, Bogacki-Shampine 3(2) where samples are so dense that even
that is too much.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import DOP853, RK23, RK45

from ..compiler.compiled import part
from ..compiler.views import lean
from ..dynamics.flow import node_input, rates
from ..dynamics.mechanics import dry_level
from ..program.layout import A_BODIES, AUX, KIND, LTI, MECHANISM, NIN, NX, P_M0, PAR, X
from ..thresholds import LAST_BASIS, LOW_ORDER, RATE_ROUNDING, ROUNDING_NUDGE, TERM_ROUGH

A8, C8 = np.vstack([DOP853.A[:12, :12], DOP853.B]), np.append(DOP853.C[:12], 1.0)
E3, E5 = DOP853.E3.copy(), DOP853.E5.copy()
A8X, C8X, D8 = np.zeros((16, 16)), np.zeros(16), DOP853.D.copy()
A8X[13:], C8X[13:] = DOP853.A_EXTRA, DOP853.C_EXTRA
A5, C5 = np.zeros((7, 6)), np.append(RK45.C, 1.0)
A5[:6, :5], A5[6] = RK45.A, RK45.B
E5_5, P5 = RK45.E.copy(), RK45.P.copy()
A3, C3 = np.zeros((4, 3)), np.append(RK23.C, 1.0)
A3[:3, :3], A3[3] = RK23.A, RK23.B
E3_3, P3 = RK23.E.copy(), RK23.P.copy()
MAIN, STAGES = len(C8), len(C8X)  # of order 8: of a step, with those of its interpolant


@part
def stages(prog, drive, segment, t, h, x, mode, work, k, g, lowest, x1, a, c, first, last, track, end):
    """Fill the rates k[first:last] of a step from x, each at x + h a[i] k; x1 is left at the last of them.

    With `end` the margins g are those at the last stage. With `track` every stage takes margins, and `lowest`
    receives the smallest met before the last.
    """
    n = x.shape[0]
    for i in range(first, last):
        for j in range(n):
            value = 0.0
            for m in range(i):
                value += a[i, m] * k[m, j]
            x1[j] = x[j] + h * value
        rates(prog, drive, segment, t + c[i] * h, x1, mode, work, k[i], g, track or (end and i == last - 1))
        if track and i < last - 1:
            for m in range(g.shape[0]):
                lowest[m] = min(lowest[m], g[m])


@part(inline=True)
def measure(j, count, h, k, x1, size):
    """Size that the relative tolerance of state j refers to; of one near zero, what the step moves it by."""
    moved = 0.0
    for m in range(count):
        moved = max(moved, h * abs(k[m, j]))
    return max(size[j], min(abs(x1[j]), max(2.0 * size[j], moved)))


@part
def rate_rounding(prog, drive, segment, t, h, x, mode, work, k0, size, trial, dx, g, rounding):
    """Write what rounding leaves of each rate: the last digits of all the terms it is the sum of.

    A rate near zero may be the difference of large forces in balance; its last digits are theirs. The terms
    are the rate's slopes times the sizes of the states, by differences, and what acts from outside. A state
    that begins at rest is given the size to which these terms could bring it over a step of `h` seconds: its
    digits are lost where large forces in balance have just set it free.
    """
    n, w = x.shape[0], work[0]
    for i in range(n):
        rounding[i] = 0.0
        trial[i] = x[i]
    rates(prog, drive, segment, t, trial, mode, work, dx, g, False)
    for node in range(prog.nodes.shape[0]):
        kind, first, po = prog.nodes[node, KIND], prog.nodes[node, X], prog.nodes[node, PAR]
        if kind == MECHANISM:
            force = abs(node_input(prog, node, 0, w))
            for b in range(prog.ints[prog.nodes[node, AUX] + A_BODIES]):
                dry = dry_level(prog, node, b, 0.0, 1.0, 0.0, work[1]) + dry_level(
                    prog, node, b, 0.0, -1.0, 0.0, work[1]
                )
                rounding[first + 2 * b + 1] = RATE_ROUNDING * (force + dry) / prog.par[po + P_M0 + b]
        elif kind == LTI:
            nx, ni = prog.nodes[node, NX], prog.nodes[node, NIN]
            for k in range(ni):
                value = RATE_ROUNDING * abs(node_input(prog, node, k, w))
                for i in range(nx):
                    rounding[first + i] += value * abs(prog.par[po + nx * nx + i * ni + k])
    for j in range(n):
        reach = size[j] + h * rounding[j] / RATE_ROUNDING
        if reach == 0.0:
            continue
        trial[j] = x[j] + ROUNDING_NUDGE * reach
        rates(prog, drive, segment, t, trial, mode, work, dx, g, False)
        trial[j] = x[j]
        for i in range(n):
            term = abs(dx[i] - k0[i]) / ROUNDING_NUDGE
            if term < math.inf:
                rounding[i] += RATE_ROUNDING * term


@part
def step(
    order, prog, drive, segment, t, h, x, mode, work, k, g, lowest, x1, size, rounding, rtol, atol, want_g
):
    """One step from x to x1 with k[0] known; fills the other rates, g (at the end); returns the scaled error.

    `size` is the running size of each state, what the relative tolerance refers to: not the end of the step,
    which may lie far behind a wall the step has yet to find. `rounding` is what rounding leaves of each rate:
    no error below that can be asked for. The last row of each tableau is the new state itself.
    """
    n = x.shape[0]
    error = 0.0
    if order == 8:
        stages(
            prog, drive, segment, t, h, x, mode, work, k, g, lowest, x1, lean(A8), lean(C8), 1, MAIN, want_g,
            want_g,
        )  # fmt: skip
        e3 = e5 = 0.0
        for j in range(n):
            scale = atol + h * rounding[j] + rtol * measure(j, MAIN, h, k, x1, size)
            v3 = v5 = 0.0
            for m in range(MAIN):
                v3 += E3[m] * k[m, j]
                v5 += E5[m] * k[m, j]
            if scale == 0.0:
                if v3 == 0.0 and v5 == 0.0:
                    continue  # neither moved nor moving
                return math.inf
            e3 += (v3 / scale) ** 2
            e5 += (v5 / scale) ** 2
        if e3 == 0.0 and e5 == 0.0:
            return 0.0
        return abs(h) * e5 / np.sqrt((e5 + LOW_ORDER * e3) * n)
    if order == 5:
        stages(
            prog, drive, segment, t, h, x, mode, work, k, g, lowest, x1, lean(A5), lean(C5), 1, 7, False,
            want_g,
        )  # fmt: skip
    else:
        stages(
            prog, drive, segment, t, h, x, mode, work, k, g, lowest, x1, lean(A3), lean(C3), 1, 4, False,
            want_g,
        )  # fmt: skip
    for j in range(n):
        scale = atol + h * rounding[j] + rtol * measure(j, 7 if order == 5 else 4, h, k, x1, size)
        value = 0.0
        if order == 5:
            for m in range(7):
                value += E5_5[m] * k[m, j]
        else:
            for m in range(4):
                value += E3_3[m] * k[m, j]
        if scale > 0.0 or value != 0.0:
            error += (h * value / scale) ** 2
    return np.sqrt(error / n)


@part
def prepare8(prog, drive, segment, t, h, x, x1, mode, work, k, g, poly):
    """Coefficients of the 7th-order interpolant of a finished DOP853 step, into poly[0:7]."""
    n = x.shape[0]
    stages(
        prog,
        drive,
        segment,
        t,
        h,
        x,
        mode,
        work,
        k,
        g,
        g,
        poly[7],
        lean(A8X),
        lean(C8X),
        MAIN,
        STAGES,
        False,
        False,
    )
    for j in range(n):
        delta = x1[j] - x[j]
        poly[0, j] = delta
        poly[1, j] = h * k[0, j] - delta
        poly[2, j] = 2.0 * delta - h * (k[12, j] + k[0, j])
        for i in range(4):
            value = 0.0
            for m in range(STAGES):
                value += D8[i, m] * k[m, j]
            poly[3 + i, j] = h * value


@part
def roughness(size, rounding, h, rtol, atol, poly):
    """Error of the 7th-order interpolant relative to tolerance, estimated by its last term.

    A long step can be right at its end and poor inside; events and outputs are taken from inside.
    """
    worst = 0.0
    for j in range(size.shape[0]):
        scale = atol + h * rounding[j] + rtol * max(size[j], abs(poly[0, j]))
        if scale > 0.0:
            worst = max(worst, LAST_BASIS * abs(poly[6, j]) / scale)
    return TERM_ROUGH * worst


@part
def prepare(order, h, k, poly):
    """Power series of a finished step of order 5 or 3, into poly; returns the number of its terms."""
    n = k.shape[1]
    terms = 4 if order == 5 else 3
    for i in range(terms):
        for j in range(n):
            value = 0.0
            if order == 5:
                for m in range(7):
                    value += P5[m, i] * k[m, j]
            else:
                for m in range(4):
                    value += P3[m, i] * k[m, j]
            poly[i, j] = h * value
    return terms


@part
def inside(terms, theta, x, poly, out):
    """State at the fraction `theta` of a step: a power series of so many terms, or DOP853's form (0)."""
    n = x.shape[0]
    if terms == 0:
        for j in range(n):
            value = 0.0
            for i in range(7):
                value += poly[6 - i, j]
                value *= theta if i % 2 == 0 else 1.0 - theta
            out[j] = x[j] + value
    else:
        for j in range(n):
            value = 0.0
            for i in range(terms - 1, -1, -1):
                value = (value + poly[i, j]) * theta
            out[j] = x[j] + value
