# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""One Runge-Kutta step with its error, and the state anywhere inside it.

Two tableaux, both from SciPy's public solver classes: Dormand-Prince 8(5,3) for long steps, 5(4) for the short
steps between the samples of a measurement.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.integrate import DOP853, RK45

from .flow import rates

A8, C8 = np.vstack([DOP853.A[:12, :12], DOP853.B]), np.append(DOP853.C[:12], 1.0)
E3, E5 = DOP853.E3.copy(), DOP853.E5.copy()
A8X, C8X, D8 = DOP853.A_EXTRA.copy(), DOP853.C_EXTRA.copy(), DOP853.D.copy()
A5, C5 = np.zeros((7, 6)), np.append(RK45.C, 1.0)
A5[:6, :5], A5[6] = RK45.A, RK45.B
# share of the interpolant's last term that stands for its error
ROUGH = 0.1
E5_5, P5 = RK45.E.copy(), RK45.P.copy()


@njit(cache=True, error_model="numpy", _nrt=False)
def step8(prog, drive, segment, t, h, x, mode, work, k, g, lowest, x1, size, rtol, atol, want_g):
    """One step of DOP853 from x to x1, with k[0] known; fills k[1:13], g (at the end); returns the scaled error.

    `size` is the running size of each state, what the relative tolerance refers to: not the end of the step, which may
    lie far behind a wall the step has yet to find.
    `lowest` receives the smallest margin met at the inner stages.
    """
    n = x.shape[0]
    for i in range(1, 13):
        # the last row of A is B: the new state itself
        for j in range(n):
            value = 0.0
            for m in range(i):
                value += A8[i, m] * k[m, j]
            x1[j] = x[j] + h * value
        rates(prog, drive, segment, t + C8[i] * h, x1, mode, work, k[i], g, want_g)
        if want_g and i < 12:
            for m in range(g.shape[0]):
                lowest[m] = min(lowest[m], g[m])
    e3 = e5 = 0.0
    for j in range(n):
        scale = atol + rtol * max(size[j], min(abs(x1[j]), 2.0 * size[j]))
        v3 = v5 = 0.0
        for m in range(13):
            v3 += E3[m] * k[m, j]
            v5 += E5[m] * k[m, j]
        e3 += (v3 / scale) ** 2
        e5 += (v5 / scale) ** 2
    if e3 == 0.0 and e5 == 0.0:
        return 0.0
    return abs(h) * e5 / np.sqrt((e5 + 0.01 * e3) * n)


@njit(cache=True, error_model="numpy", _nrt=False)
def step5(prog, drive, segment, t, h, x, mode, work, k, g, lowest, x1, size, rtol, atol, want_g):
    """One step of Dormand-Prince 5(4), as `step8`; fills k[1:7]."""
    n = x.shape[0]
    for i in range(1, 7):
        for j in range(n):
            value = 0.0
            for m in range(i):
                value += A5[i, m] * k[m, j]
            x1[j] = x[j] + h * value
        rates(prog, drive, segment, t + C5[i] * h, x1, mode, work, k[i], g, want_g and i == 6)
    error = 0.0
    for j in range(n):
        scale = atol + rtol * max(size[j], min(abs(x1[j]), 2.0 * size[j]))
        value = 0.0
        for m in range(7):
            value += E5_5[m] * k[m, j]
        error += (h * value / scale) ** 2
    return np.sqrt(error / n)


@njit(cache=True, error_model="numpy", _nrt=False)
def prepare8(prog, drive, segment, t, h, x, x1, mode, work, k, g, poly):
    """Coefficients of the 7th-order interpolant of a finished DOP853 step, into poly[0:7]."""
    n = x.shape[0]
    trial = poly[7]
    for i in range(3):
        for j in range(n):
            value = 0.0
            for m in range(13 + i):
                value += A8X[i, m] * k[m, j]
            trial[j] = x[j] + h * value
        rates(prog, drive, segment, t + C8X[i] * h, trial, mode, work, k[13 + i], g, False)
    for j in range(n):
        delta = x1[j] - x[j]
        poly[0, j] = delta
        poly[1, j] = h * k[0, j] - delta
        poly[2, j] = 2.0 * delta - h * (k[12, j] + k[0, j])
        for i in range(4):
            value = 0.0
            for m in range(16):
                value += D8[i, m] * k[m, j]
            poly[3 + i, j] = h * value


@njit(cache=True, error_model="numpy", _nrt=False)
def roughness(size, rtol, atol, poly):
    """Error of the 7th-order interpolant relative to tolerance, judged by its last term.

    A long step can be right at its end and poor inside; events and outputs are taken from inside.
    """
    worst = 0.0
    for j in range(size.shape[0]):
        # 0.0084 is the largest value of the last basis function, theta^4 (1 - theta)^3
        worst = max(worst, 0.0084 * abs(poly[6, j]) / (atol + rtol * size[j]))
    return ROUGH * worst


@njit(cache=True, error_model="numpy", _nrt=False)
def prepare5(h, k, poly):
    """Coefficients of the 4th-order interpolant of a finished 5(4) step, into poly[0:4]."""
    for i in range(4):
        for j in range(k.shape[1]):
            value = 0.0
            for m in range(7):
                value += P5[m, i] * k[m, j]
            poly[i, j] = h * value


@njit(cache=True, error_model="numpy", _nrt=False)
def inside(order, theta, x, poly, out):
    """State at the fraction `theta` of a finished step."""
    n = x.shape[0]
    if order == 8:
        for j in range(n):
            value = 0.0
            for i in range(7):
                value += poly[6 - i, j]
                value *= theta if i % 2 == 0 else 1.0 - theta
            out[j] = x[j] + value
    else:
        for j in range(n):
            out[j] = x[j] + theta * (poly[0, j] + theta * (poly[1, j] + theta * (poly[2, j] + theta * poly[3, j])))
