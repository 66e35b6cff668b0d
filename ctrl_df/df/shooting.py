"""Forced periodic orbits by Newton's method on the event engine, all in compiled code.

One *shot* runs the engine over half a period (odd laws, mirrored afterwards) or over whole ones. The Jacobian of the
shot is kept from point to point of a sweep and corrected by Broyden's formula, the start is extrapolated from the
points before, and the last shot integrates the harmonics along the way: most points cost two or three shots.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from ..simulate import driver, layout
from ..simulate.driver import copy, run
from ..simulate.engine import harmonic_drive
from ..simulate.flow import combine, external, signals
from ..simulate.layout import (
    A_JOINT,
    AUX,
    DIR0,
    DIR1,
    H_OUT,
    J_ELASTIC,
    J_IMPACT,
    JOINT,
    KIND,
    MECHANISM,
    MODE,
    P_GAP,
    PAR,
    PLAY,
    PWA,
    QUANTIZER,
    RATE,
    STUCK,
    WALL,
    Drive,
    X,
)
from ..simulate.modes import settle
from .native import call_native, native_address

CLOSED, OPEN, UNSTABLE, SPENT, FAILED = range(5)
"""Outcome of `close_orbit`: closed and attracting, not closed, closed but repelling, out of work, the run failed."""

TOLERANCE = 1e-9  # error of an orbit's state, relative to its size
_CHATTER_ROOM = 60  # runs go on where the event log is full


class Shot(NamedTuple):
    """Everything a shot needs that stays the same from shot to shot; see `make_shot`."""

    run: int  # addresses of the engine and of `shoot`
    shoot: int
    prog: layout.Program
    space: tuple
    scale: np.ndarray  # margins' running scales
    clock: np.ndarray
    before: np.ndarray
    log_t: np.ndarray
    log_n: np.ndarray
    log_k: np.ndarray
    none: np.ndarray  # no output times
    none_x: np.ndarray
    none_y: np.ndarray
    no_spectrum: np.ndarray
    modes: np.ndarray  # modes of a fresh state
    transform: np.ndarray
    inverse: np.ndarray
    offset: np.ndarray
    free: np.ndarray
    wrap: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    low: np.ndarray
    high: np.ndarray
    size: np.ndarray  # sizes of the coordinates
    jacobian: np.ndarray  # (nf, nf), kept from point to point
    trial: np.ndarray  # rows of scratch, states
    matrix: np.ndarray  # (3, nf, nf) scratch
    shifts: np.ndarray  # (ns, n) directions of free position
    ends: np.ndarray  # (2, ny) outputs at the start and at the end of the last shot with a spectrum
    tally: np.ndarray  # shots, steps, event kinds (bits), Jacobians, reason of the last run, whether it ended stuck


def make_shot(engine, symmetries, rows: int) -> Shot:
    """Allocate the arrays of shots on an engine; harmonics are taken of its first `rows` outputs."""
    n, nf = engine.nstates, len(symmetries.free)
    ng = int(engine.program.ints[layout.H_NG]) + 1
    s = symmetries
    drive, vector, modes = harmonic_drive([[0.0, 0.0]], 1.0), np.zeros(n), engine._modes.copy()
    none, rows_x, rows_y, no_spectrum = np.zeros(0), np.zeros((0, n)), np.zeros((0, engine.noutputs)), np.zeros((rows, 0), complex)
    log_t, log_n, log_k = np.zeros(256), np.zeros(256, np.int64), np.zeros(256, np.int64)
    arguments = (
        engine.program, drive, np.zeros(9), vector, modes, 1.0, none, rows_x, rows_y, 8, 1e-9, 1e-12, 1.0, True, False, -1,
        0.0, -1, 1e-11, 1, log_t, log_n, log_k, vector, vector, 0, engine._space, no_spectrum, 1.0,
    )  # fmt: skip
    shot = Shot(
        native_address(run, arguments), 0, engine.program, engine._space, np.full(ng, 1e-13), np.zeros(9), np.zeros(n), log_t,
        log_n, log_k, none, rows_x, rows_y, no_spectrum, modes, s.transform, s.inverse, s.offset, s.free.astype(np.int64),
        s.wrap, s.lower, s.upper, s.low, s.high, np.zeros(n), np.full((nf, nf), np.nan), np.zeros((8, max(n, 1))),
        np.zeros((3, nf, nf)), np.array(s.shifts, float).reshape(len(s.shifts), n), np.zeros((2, rows)), np.zeros(6, np.int64),
    )  # fmt: skip
    return shot._replace(
        shoot=native_address(shoot, (shot, drive, 1.0, vector, modes, True, 1e-9, 1e-12, 1.0, no_spectrum, 1))
    )


# --- one shot ---------------------------------------------------------------------------------------------


@njit(cache=True, error_model="numpy")
def shoot(shot, drive, time, x, mode, mirrored, rtol, atol, hmax, spectrum, budget):
    """Run (x, mode), in place, from t = 0 over `time`, mirrored afterwards if asked; returns the engine's reason.

    With columns in `spectrum` the integrals of the outputs against exp(-j k omega t) are written to it, and the
    outputs at both ends to ``shot.ends``.
    """
    prog, clock = shot.prog, shot.clock
    work = shot.space[0]
    clock[0] = clock[1] = clock[3] = clock[4] = clock[5] = clock[6] = clock[7] = 0.0
    clock[8] = -1.0
    settle(prog, drive, 0, 0.0, x, mode, work, shot.space[5])
    wanted = spectrum.shape[1] > 0
    if wanted:
        spectrum[:] = 0.0
        _outputs(shot, drive, 0.0, x, mode, 0)
    reason = driver.DONE
    kinds = 0
    for _ in range(_CHATTER_ROOM):
        reason = call_native(
            shot.run,
            (
                prog, drive, clock, x, mode, time, shot.none, shot.none_x, shot.none_y, 8, rtol, atol, hmax, True, False, -1,
                0.0, -1, 1e-2 * rtol, budget, shot.log_t, shot.log_n, shot.log_k, shot.before, shot.scale, 0, shot.space,
                spectrum, drive.omega,
            ),
        )  # fmt: skip
        for i in range(min(int(clock[5]), shot.log_t.shape[0])):
            kinds |= 1 << shot.log_k[i]
        if reason != driver.FULL:
            break
    shot.tally[0] += 1
    shot.tally[1] += int(clock[3])
    shot.tally[2] = kinds
    shot.tally[4] = reason
    shot.tally[5] = _stuck(prog, mode)
    if wanted:
        _outputs(shot, drive, time, x, mode, 1)
    if mirrored and reason == driver.DONE:
        mirror(shot, x, mode)
    return reason


@njit(cache=True, error_model="numpy")
def _stuck(prog, mode):
    """1 where every body is held by friction or at a stop."""
    bodies = 0
    for n in range(prog.nodes.shape[0]):
        if prog.nodes[n, KIND] == MECHANISM:
            for b in range(prog.ints[prog.nodes[n, AUX]]):
                bodies += 1
                if mode[prog.nodes[n, MODE] + b] != STUCK:
                    return 0
    return 1 if bodies > 0 else 0


@njit(cache=True, error_model="numpy")
def _outputs(shot, drive, t, x, mode, row):
    prog, w = shot.prog, shot.space[0][0]
    external(prog, drive, t, 0, w)
    signals(prog, t, x, mode, w)
    for i in range(shot.ends.shape[1]):
        shot.ends[row, i] = combine(prog, prog.ints[prog.ints[H_OUT] + i], w)


@njit(cache=True, error_model="numpy")
def mirror(shot, x, mode):
    """The mirrored state of an odd system: what follows from it is the mirror image of what follows from (x, mode)."""
    prog = shot.prog
    for j in range(x.shape[0]):
        x[j] = shot.offset[j] - x[j]
    for n in range(prog.nodes.shape[0]):
        kind, at = prog.nodes[n, KIND], prog.nodes[n, MODE]
        if kind == MECHANISM:
            for slot in (DIR0, DIR1):
                if abs(mode[at + slot]) == 1:
                    mode[at + slot] = -mode[at + slot]
            elastic = prog.ints[prog.nodes[n, AUX] + A_JOINT] == J_ELASTIC
            if not (elastic and prog.par[prog.nodes[n, PAR] + P_GAP] == 0.0):
                mode[at + JOINT] = -mode[at + JOINT]
            mode[at + WALL] = -mode[at + WALL]
        elif kind == PWA:
            mode[at] = prog.ints[prog.nodes[n, AUX]] - 2 - mode[at]
        elif kind == QUANTIZER or kind == PLAY or kind == RATE:
            mode[at] = -mode[at]


# --- coordinates ------------------------------------------------------------------------------------------


@njit(cache=True, error_model="numpy")
def coordinates(shot, x, y):
    """Y = T x."""
    for i in range(x.shape[0]):
        value = 0.0
        for j in range(x.shape[0]):
            value += shot.transform[i, j] * x[j]
        y[i] = value


@njit(cache=True, error_model="numpy")
def place(shot, y, x, mode):
    """State at coordinates y (clipped to gaps and stops), with modes that hold there; contacts survive if untouched."""
    prog, n = shot.prog, x.shape[0]
    for i in range(n):
        y[i] = min(max(y[i], shot.lower[i]), shot.upper[i])
    for i in range(n):
        value = 0.0
        for j in range(n):
            value += shot.inverse[i, j] * y[j]
        x[i] = value
    for k in range(prog.nodes.shape[0]):
        if prog.nodes[k, KIND] != MECHANISM:
            continue
        at, first = prog.nodes[k, MODE], prog.nodes[k, X]
        mode[at + DIR0], mode[at + DIR1] = shot.modes[at + DIR0], shot.modes[at + DIR1]
        if prog.ints[prog.nodes[k, AUX] + A_JOINT] == J_IMPACT and mode[at + JOINT] != 0:
            gap = prog.par[prog.nodes[k, PAR] + P_GAP]
            face = gap if mode[at + JOINT] > 0 else 0.0
            # contact survives what rounding leaves of it
            if abs(y[first + 2] - face) > 1e-9 * gap or abs(y[first + 3]) > 1e-9 * shot.size[first + 3]:
                mode[at + JOINT] = 0
            else:
                x[first + 2] = x[first] + face
                x[first + 3] = x[first + 1]
    for i in range(n):
        if x[i] < shot.low[i] or x[i] > shot.high[i]:
            x[i] = min(max(x[i], shot.low[i]), shot.high[i])
    for k in range(prog.nodes.shape[0]):
        if prog.nodes[k, KIND] == MECHANISM:
            at, first = prog.nodes[k, MODE], prog.nodes[k, X]
            if mode[at + WALL] != 0:
                driven = first + 2 * (prog.ints[prog.nodes[k, AUX]] - 1)
                if (x[driven] != shot.low[driven] and x[driven] != shot.high[driven]) or x[driven + 1] != 0.0:
                    mode[at + WALL] = 0


@njit(cache=True, error_model="numpy")
def _mismatch(shot, y0, y1):
    """Closing error relative to the sizes of the coordinates, which grow with what is seen; the step is left in y1."""
    n = y0.shape[0]
    seen = shot.space[6]
    for i in range(n):
        size = max(abs(y0[i]), abs(y1[i]))
        if shot.lower[i] > -math.inf:
            size = shot.upper[i] - shot.lower[i]
        elif shot.transform[i, i] == 1.0:
            size = max(size, seen[i])
        shot.size[i] = max(size, 0.5 * shot.size[i])
    worst = 0.0
    for i in range(n):
        y1[i] -= y0[i]
        if shot.wrap[i] > 0.0:
            y1[i] -= shot.wrap[i] * round(y1[i] / shot.wrap[i])
    for f in range(shot.free.shape[0]):
        i = shot.free[f]
        if y1[i] != 0.0:
            worst = max(worst, abs(y1[i]) / shot.size[i])
    return worst


# --- Newton's method --------------------------------------------------------------------------------------


@njit(cache=True, error_model="numpy")
def close_orbit(shot, drive, time, x, mode, mirrored, rtol, atol, hmax, spectrum, budget, shots, eager):
    """Close an orbit from (x, mode), in place, by chord and Broyden steps; harmonics of the closed shot in `spectrum`.

    `shots` bounds the shots, `budget` the integration steps; with `eager` the first shot takes harmonics already.
    Returns outcome and closing error.
    """
    n, nf = x.shape[0], shot.free.shape[0]
    y0, y1, change, x0 = shot.trial[0], shot.trial[1], shot.trial[2], shot.trial[3]
    last, end = shot.trial[7], shot.trial[6]
    jacobian, m0 = shot.jacobian, mode.copy()
    fresh_jacobian = False
    moved = False  # `change` is the step that led to the present point, `last` the closing error before it
    previous, best = math.inf, math.inf
    jacobians = 0
    take = eager
    expected = 1e-2  # closing error of the shot to come
    for _ in range(shots):
        copy(x, x0)
        m0[:] = mode
        coordinates(shot, x, y0)
        # far from the orbit coarse shots do
        loose = 1.0 if take else max(1.0, min(1e-3 * expected, 1e-7) / rtol)
        reason = call_native(
            shot.shoot,
            (
                shot, drive, time, x, mode, mirrored, loose * rtol, atol, hmax,
                spectrum if take else shot.no_spectrum, budget,
            ),
        )  # fmt: skip
        budget -= int(shot.clock[3])
        if reason != driver.DONE:
            return (SPENT if reason == driver.STEPS else FAILED), best
        if budget <= 0:
            return SPENT, best
        coordinates(shot, x, y1)
        copy(y1, end)
        miss = _mismatch(shot, y0, y1)
        best = min(best, miss)
        rests = False  # a body at rest at the end of the shot is at rest, not nearly so
        for f in range(nf):
            i = shot.free[f]
            if end[i] == 0.0 and y0[i] != 0.0:
                rests = True
        if moved:
            _broyden(shot, jacobian, change, last, y1)
        error = miss  # of the state: what Newton's step would still change
        known = nf > 0 and not math.isnan(jacobian[0, 0])
        if known and miss > 0.0:
            error = math.inf
            if _newton_step(shot, jacobian, y1, change):
                error = 0.0
                for f in range(nf):
                    error = max(error, abs(change[f]) / shot.size[shot.free[f]])
        stale = miss > 0.5 * previous
        if not rests and (
            error < TOLERANCE or (miss < TOLERANCE and error < 100 * TOLERANCE and stale and fresh_jacobian)
        ):
            copy(x0, x)
            mode[:] = m0
            if not take:
                take, moved, previous = True, False, math.inf
                continue
            if known and miss > 0.0 and not _attracts(shot, jacobian):
                if not fresh_jacobian:
                    # Broyden's matrix is no proof: differentiate before judging
                    if not _differentiate(shot, drive, time, x0, m0, y1, mirrored, rtol, atol, hmax, budget):
                        return OPEN, error
                if not _attracts(shot, jacobian):
                    return UNSTABLE, error
            if mirrored:
                _center(shot, y1, x)
            return CLOSED, error
        if nf == 0:
            return OPEN, miss
        if not known or (stale and not fresh_jacobian):
            if jacobians == 3:
                return OPEN, best
            if not _differentiate(shot, drive, time, x0, m0, y1, mirrored, rtol, atol, hmax, budget):
                return FAILED, best
            jacobians += 1
            fresh_jacobian = True
        elif stale and jacobians >= 2 and miss > 1.5 * previous:
            return OPEN, best
        else:
            fresh_jacobian = False
        if not _newton_step(shot, jacobian, y1, change):
            return OPEN, best
        too_far = False
        for f in range(nf):
            if not abs(change[f]) <= 3.0 * shot.size[shot.free[f]]:
                too_far = True
        if too_far:
            # far from an orbit the motion itself is the better guide: x holds the end of the shot
            moved = False
            previous = math.inf
            jacobian[:] = math.nan
            continue
        for i in range(n):
            last[i] = y1[i]
        for f in range(nf):
            i = shot.free[f]
            if end[i] == 0.0:
                change[f] = -y0[i]
            y0[i] += change[f]
        copy(y0, y1)
        mode[:] = m0
        place(shot, y0, x, mode)
        moved = True
        for f in range(nf):
            i = shot.free[f]
            if y0[i] != y1[i]:
                moved = False  # clipped
        previous = miss
        expected = 1e-2 * miss
        take = take or expected < 1e-6
    return OPEN, best


@njit(cache=True, error_model="numpy")
def _center(shot, step, x):
    """Move free positions to where half a period mirrors them onto themselves."""
    for k in range(shot.shifts.shape[0]):
        amount = 0.0
        for j in range(x.shape[0]):
            if shot.shifts[k, j] != 0.0:
                if amount == 0.0:
                    amount = 0.5 * step[j]
                x[j] += amount


@njit(cache=True, error_model="numpy")
def _broyden(shot, jacobian, change, before, after):
    """Correct the Jacobian of the shot by what the last step did to the closing error (before, after)."""
    nf = shot.free.shape[0]
    total = 0.0
    for f in range(nf):
        scaled = change[f] / shot.size[shot.free[f]]
        total += scaled * scaled
    if total < 1e-14:  # a step so small measures rounding
        return
    for r in range(nf):
        i = shot.free[r]
        # d(closing) = (J - 1) change
        value = after[i] - before[i] + change[r]
        for c in range(nf):
            value -= jacobian[r, c] * change[c]
        for c in range(nf):
            size = shot.size[shot.free[c]]
            jacobian[r, c] += value * change[c] / (size * size) / total


@njit(cache=True, error_model="numpy")
def _differentiate(shot, drive, time, x0, m0, step, mirrored, rtol, atol, hmax, budget):
    """Jacobian of the shot by one-sided differences over its free coordinates; `step` is the closing error at x0."""
    y, end, x = np.empty(x0.shape[0]), np.empty(x0.shape[0]), np.empty(x0.shape[0])
    mode = m0.copy()
    kinds = shot.tally[2]
    base = np.empty(x0.shape[0])
    coordinates(shot, x0, base)
    for c in range(shot.free.shape[0]):
        i = shot.free[c]
        copy(base, y)
        h = 1e-5 * shot.size[i]
        if y[i] > 0.0:
            h = -h
        if y[i] + h < shot.lower[i] or y[i] + h > shot.upper[i]:
            h = -h
        y[i] += h
        h = y[i] - base[i]
        mode[:] = m0
        if h != 0.0:
            place(shot, y, x, mode)
            reason = call_native(
                shot.shoot, (shot, drive, time, x, mode, mirrored, rtol, atol, hmax, shot.no_spectrum, budget)
            )
            if reason != driver.DONE:
                return False
            coordinates(shot, x, end)
        for r in range(shot.free.shape[0]):
            k = shot.free[r]
            value = 0.0
            if h != 0.0:
                value = end[k] - base[k]
                if shot.wrap[k] > 0.0:
                    value -= shot.wrap[k] * round(value / shot.wrap[k])
                value = (value - step[k]) / h
            shot.jacobian[r, c] = value
    shot.tally[2] = kinds
    shot.tally[3] += 1
    return True


@njit(cache=True, error_model="numpy")
def _newton_step(shot, jacobian, step, change):
    """Solve (1 - J) change = step by elimination with pivots; False where the matrix is singular."""
    nf = shot.free.shape[0]
    a = shot.matrix[0]
    for r in range(nf):
        for c in range(nf):
            a[r, c] = ((1.0 if r == c else 0.0) - jacobian[r, c]) * (shot.size[shot.free[c]] / shot.size[shot.free[r]] if r != c else 1.0)
        change[r] = step[shot.free[r]] / shot.size[shot.free[r]] if step[shot.free[r]] != 0.0 else 0.0
    for c in range(nf):
        p = c
        for r in range(c + 1, nf):
            if abs(a[r, c]) > abs(a[p, c]):
                p = r
        if not abs(a[p, c]) > 1e-9:
            return False
        if p != c:
            for k in range(nf):
                a[c, k], a[p, k] = a[p, k], a[c, k]
            change[c], change[p] = change[p], change[c]
        for r in range(c + 1, nf):
            q = a[r, c] / a[c, c]
            if q != 0.0:
                for k in range(c, nf):
                    a[r, k] -= q * a[c, k]
                change[r] -= q * change[c]
    for c in range(nf - 1, -1, -1):
        for k in range(c + 1, nf):
            change[c] -= a[c, k] * change[k]
        change[c] /= a[c, c]
    for c in range(nf):
        change[c] *= shot.size[shot.free[c]]
    return True


@njit(cache=True, error_model="numpy")
def spectral_radius(shot, jacobian):
    """Largest multiplier of a shot, from the growth of the Jacobian's powers."""
    nf = jacobian.shape[0]
    a, b = shot.matrix[1], shot.matrix[2]
    log_size, power = 0.0, 1.0
    for r in range(nf):
        for c in range(nf):
            ratio = shot.size[shot.free[c]] / shot.size[shot.free[r]] if r != c else 1.0
            a[r, c] = jacobian[r, c] * ratio if jacobian[r, c] != 0.0 else 0.0
    for _ in range(12):
        norm = 0.0
        for r in range(nf):
            for c in range(nf):
                norm = max(norm, abs(a[r, c]))
        if norm == 0.0:
            return 0.0
        if not norm < math.inf:
            return math.inf
        log_size += math.log(norm) / power
        for r in range(nf):
            for c in range(nf):
                a[r, c] /= norm
        for r in range(nf):
            for c in range(nf):
                value = 0.0
                for k in range(nf):
                    value += a[r, k] * a[k, c]
                b[r, c] = value
        for r in range(nf):
            for c in range(nf):
                a[r, c] = b[r, c]
        power *= 2.0
    return math.exp(log_size)


@njit(cache=True, error_model="numpy")
def _attracts(shot, jacobian):
    return spectral_radius(shot, jacobian) < 1.0 + 1e-3  # neutral directions, differenced, come out near 1


# --- a sweep ----------------------------------------------------------------------------------------------


@njit(cache=True, error_model="numpy")
def sweep(
    shot, samples, coefficients, amplitudes, omegas, power, inertia, past, past_mode, known, mirrored, rtol, hmax, budget,
    out, ends, miss, kinds, still,
):  # fmt: skip
    """Close the orbits of consecutive points, each started from those before; stops at the first that does not close.

    `past` (4, n): scaled states of the points before, newest first, `known` of them, and the step size relative to the
    period in ``past[3, 0]``; `past_mode` the newest modes. `coefficients`: (1, nh) scratch of the drive. Returns
    points done, outcome of the last, points known.
    """
    n = power.shape[0]
    x, mode, y = np.zeros(n), past_mode.copy(), np.zeros(n)
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
        mode[:] = past_mode
        coordinates(shot, x, y)
        _snap(shot, y, mode)
        place(shot, y, x, mode)
        period = 2.0 * math.pi / omega
        shot.clock[2] = past[3, 0] * period
        shot.tally[0] = 0
        outcome, miss[p] = close_orbit(
            shot, drive, 0.5 * period if mirrored else period, x, mode, mirrored, rtol, floor(power, inertia, A, omega),
            hmax * period, out[p], budget, 12, eager,
        )  # fmt: skip
        past[3, 0] = min(shot.clock[2] / period, 0.1)
        if outcome != CLOSED:
            return p, outcome, known
        eager = shot.tally[0] <= 2
        kinds[p] = shot.tally[2]
        still[p] = shot.tally[5]
        ends[p] = shot.ends
        for j in range(n):
            past[2, j] = past[1, j]
            past[1, j] = past[0, j]
            past[0, j] = x[j] / unit(power[j], A, omega)
        past_mode[:] = mode
        known = min(known + 1, 3)
        if kinds[p] != before:
            known = 1
        before = kinds[p]
    return amplitudes.shape[0], CLOSED, known


@njit(cache=True, error_model="numpy")
def unit(power, A, omega):
    """What a state is measured in on a sweep: the motion of a free inertia under the force."""
    return A / omega**power


@njit(cache=True, error_model="numpy")
def floor(power, inertia, A, omega):
    """Absolute tolerance: far below the motion of a free inertia, but above the rounding of its positions."""
    highest = 0
    for j in range(power.shape[0]):
        highest = max(highest, power[j])
    return 1e-12 * unit(highest, A, omega) / inertia


@njit(cache=True, error_model="numpy")
def _snap(shot, y, mode):
    """Contacts stay contacts when a state is scaled."""
    prog = shot.prog
    for k in range(prog.nodes.shape[0]):
        if prog.nodes[k, KIND] != MECHANISM:
            continue
        at, first = prog.nodes[k, MODE], prog.nodes[k, X]
        if prog.ints[prog.nodes[k, AUX] + A_JOINT] == J_IMPACT and mode[at + JOINT] != 0:
            y[first + 2] = prog.par[prog.nodes[k, PAR] + P_GAP] if mode[at + JOINT] > 0 else 0.0
            y[first + 3] = 0.0
        if mode[at + WALL] != 0:
            driven = first + 2 * (prog.ints[prog.nodes[k, AUX]] - 1)
            stop = shot.high[driven] if mode[at + WALL] > 0 else shot.low[driven]
            y[first] = stop if driven == first else stop - y[first + 2]
            y[first + 1] = 0.0
