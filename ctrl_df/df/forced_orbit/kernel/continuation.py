# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""Orbits of consecutive points, each started from those before."""

from __future__ import annotations

import math

from ....simulate.compiler.compiled import njit, part
from ....simulate.compiler.native import call_native
from ....simulate.compiler.views import lean
from ....simulate.dynamics.matrices import copy
from ....simulate.program import layout as L
from ....simulate.program.layout import Drive
from ...thresholds import EVEN_LEAST, FIRST_LONGEST, SHOTS
from .period_map import coordinates, period_map_at, place
from .shooting import CLOSED


@njit(error_model="numpy", nogil=True)
def continuation(
    close, shot, samples, coefficients, amplitudes, omegas, power, past, past_mode, known, mirrored,
    broken, rtol, hmax, budget, out, ends, miss, kinds, still,
):  # fmt: skip
    """Close the orbits of consecutive points, each started from those before; stop where one does not close.

    `past` (4, n): scaled states of the points before, newest first, `known` of them, and the step size
    relative to the period in ``past[3, 0]``; `past_mode` the newest modes. `coefficients`: (1, nh) scratch
    of the drive; `close`: address of `shooting.close`. With `broken` an orbit without even harmonics is the
    last. Returns points done, points known, whether the last one is such an orbit.
    """
    at, shot = shot, period_map_at(shot)
    samples, coefficients, amplitudes, omegas = (
        lean(samples), lean(coefficients), lean(amplitudes), lean(omegas),
    )  # fmt: skip
    power, past, past_mode, out, ends = lean(power), lean(past), lean(past_mode), lean(out), lean(ends)
    n = power.shape[0]
    x, mode, y = shot.trial[12], shot.trial_mode[2], shot.trial[13]
    eager = False
    before = -1
    for p in range(amplitudes.shape[0]):
        A, omega = amplitudes[p], omegas[p]
        coefficients[0, 1] = A
        drive = Drive(samples.time, samples.samples, samples.linear, coefficients, omega, samples.address)
        # grids are even, linearly or in ratios: extrapolate in their index
        for j in range(n):
            value = past[0, j]
            if known == 2:
                value = 2.0 * past[0, j] - past[1, j]
            elif known >= 3:
                value = 3.0 * (past[0, j] - past[1, j]) + past[2, j]
            x[j] = value * unit(power[j], A, omega)
        copy(past_mode, mode)
        coordinates(shot, x, y)
        _snap(shot, y, mode)
        place(shot, y, x, mode)
        period = 2.0 * math.pi / omega
        shot.clock[2] = past[3, 0] * period
        shot.tally[0] = 0
        outcome = call_native(
            close,
            (
                at, drive, 0.5 * period if mirrored else period, x, mode, mirrored, rtol, 0.0,
                hmax * period, out[p], budget, SHOTS, eager,
            ),
        )  # fmt: skip
        miss[p] = shot.error[0]
        past[3, 0] = min(shot.clock[2] / period, FIRST_LONGEST)
        if outcome != CLOSED:
            return p, known, False
        eager = shot.tally[0] <= 2
        kinds[p] = shot.tally[2]
        still[p] = shot.tally[5]
        for i in range(2):
            copy(shot.ends[i], ends[p, i])
        for j in range(n):
            past[2, j] = past[1, j]
            past[1, j] = past[0, j]
            past[0, j] = x[j] / unit(power[j], A, omega)
        copy(mode, past_mode)
        known = min(known + 1, 3)
        if kinds[p] != before:
            known = 1
        before = kinds[p]
        if broken and evenless(out[p, out.shape[1] - 1]):
            return p + 1, known, True
    return amplitudes.shape[0], known, False


@part
def evenless(integrals):
    """Whether an output has no even harmonics, its mean left aside; not where none were asked for."""
    if integrals.shape[0] < 3:
        return False
    even = 0.0
    for k in range(2, integrals.shape[0], 2):
        even = max(even, abs(integrals[k]))
    return even <= EVEN_LEAST * abs(integrals[1])


@part
def unit(power, A, omega):
    """Return what a state is measured in on a line: the motion of a free inertia under the force."""
    return A / omega**power


@part
def _snap(shot, y, mode):
    """Contacts stay contacts when a state is scaled."""
    prog = shot.prog
    for k in range(prog.nodes.shape[0]):
        if prog.nodes[k, L.KIND] != L.MECHANISM:
            continue
        at, first = prog.nodes[k, L.MODE], prog.nodes[k, L.X]
        if prog.ints[prog.nodes[k, L.AUX] + L.A_JOINT] == L.J_IMPACT and mode[at + L.JOINT] != 0:
            y[first + 2] = prog.par[prog.nodes[k, L.PAR] + L.P_GAP] if mode[at + L.JOINT] > 0 else 0.0
            y[first + 3] = 0.0
        if mode[at + L.WALL] != 0:
            driven = first + 2 * (prog.ints[prog.nodes[k, L.AUX]] - 1)
            stop = shot.high[driven] if mode[at + L.WALL] > 0 else shot.low[driven]
            y[first] = stop if driven == first else stop - y[first + 2]
            y[first + 1] = 0.0
