# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""The period map of the event engine: over half a period, mirrored afterwards, or over whole periods.

One evaluation of it is called a shot. A `PeriodMap` holds what stays the same from shot to shot, so that
compiled code allocates nothing. Coordinates y = T x are those of `ctrl_df.df.forced_orbit.symmetries`.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from ....simulate.compiler.compiled import apart, njit, part
from ....simulate.compiler.native import COUNTS, NUMBERS, SPECTRA, call_native, native_address
from ....simulate.compiler.packed import Layout, address_of
from ....simulate.compiler.views import lean
from ....simulate.dynamics.flow import combine, refresh
from ....simulate.dynamics.matrices import copy
from ....simulate.dynamics.modes import settle
from ....simulate.kernel import driver
from ....simulate.kernel.run import reasons
from ....simulate.kernel.space import Space
from ....simulate.kernel.task import NO_WATCH, Accuracy, EventLog, Recording
from ....simulate.program import layout as L
from ....simulate.thresholds import EVENTS, HEIGHT
from ...thresholds import CHATTER_ROOM, EVENS, FIRST_STALE, SIZE_FORGOTTEN, SIZE_KEPT, TOUCHING


class PeriodMap(NamedTuple):
    """Everything a shot needs that stays the same from shot to shot; see `make_period_map`."""

    run: int  # addresses of the engine and of `take`
    take: int
    prog: L.Program
    space: Space
    scale: np.ndarray  # (4, ng) scales of margins
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
    trial_mode: np.ndarray  # rows of scratch, modes
    matrix: np.ndarray  # (3, nf, nf) scratch
    shifts: np.ndarray  # (ns, n) directions of free position
    ends: np.ndarray  # (2, ny) outputs at the start and at the end of the last shot with a spectrum
    error: np.ndarray  # (1,) of the state of the orbit closed last
    tally: np.ndarray  # shots, steps, event kinds (bits), Jacobians, reason of the last run, ended stuck
    words: np.ndarray  # all these, laid out
    at: int  # and where


LAYOUT = Layout()
period_map_at = LAYOUT.opener()
"""A `PeriodMap` from its address, in compiled code."""


def make_period_map(engine, symmetries, rows: int) -> PeriodMap:
    """Allocate the arrays of shots on an engine; harmonics are taken of its first `rows` outputs."""
    n, nf = engine.nstates, len(symmetries.free)
    ng = int(engine.program.ints[L.H_NG]) + 1
    s = symmetries
    modes = engine.modes.copy()
    none, rows_x, rows_y = np.zeros(0), np.zeros((0, n)), np.zeros((0, engine.noutputs))
    no_spectrum = np.zeros((rows, 0), complex)
    log_t, log_n, log_k = (np.zeros(EVENTS, kind) for kind in (float, np.int64, np.int64))
    shot = PeriodMap(
        driver.address(), 0, engine.program, engine.space, np.zeros((4, ng)), np.zeros(10),
        np.zeros(n), log_t, log_n, log_k, none, rows_x, rows_y, no_spectrum, modes, s.transform, s.inverse,
        s.offset, s.free.astype(np.int64), s.wrap, s.lower, s.upper, s.low, s.high, np.zeros(n),
        np.full((nf, nf), np.nan), np.zeros((14, max(n, 1))), np.zeros((4, len(modes)), np.int64),
        np.zeros((4, nf, nf)),
        np.array(s.shifts, float).reshape(len(s.shifts), n), np.zeros((2, rows)), np.zeros(1),
        np.zeros(6, np.int64), COUNTS, 0,
    )  # fmt: skip
    LAYOUT.learn(shot)
    return _laid_out(shot._replace(take=_address()))


def with_own_sizes(shot: PeriodMap) -> PeriodMap:
    """Return the map for orbits of other sizes, none known yet; all other arrays are the same."""
    return _laid_out(shot._replace(size=np.zeros_like(shot.size), words=COUNTS, at=0))


def _laid_out(shot: PeriodMap) -> PeriodMap:
    words = LAYOUT.pack(shot)
    return shot._replace(words=words, at=address_of(words))


ARGUMENTS = (0, L.NO_DRIVE, 1.0, NUMBERS, COUNTS, True, 0.0, 0.0, 1.0, SPECTRA, 1)
"""Those that `take` is compiled for."""


@functools.cache
def _address() -> int:
    """Return the address of `take`, compiled now if need be."""
    return native_address(take, ARGUMENTS)


# --- one shot ---------------------------------------------------------------------------------------------


@njit(error_model="numpy", nogil=True)
def apply(shot, drive, time, x, mode, mirrored, rtol, atol, hmax, spectrum, budget):
    """`take` one shot, from Python."""
    return call_native(
        period_map_at(shot).take,
        (
            shot, lean(drive), time, lean(x), lean(mode), mirrored, rtol, atol, hmax, lean(spectrum),
            budget,
        ),
    )  # fmt: skip


@njit(error_model="numpy", nogil=True)
def iterate(
    shot, drive, time, x, mode, mirrored, rtol, atol, hmax, step, budget, trail, settled, twice_settled
):
    """`take` one shot after another, as many as `trail` has rows, which receive the coordinates before each.

    The motion is left as soon as it repeats within `settled`, relative to its size, after one shot, or after
    two and not after one. A step that another run has left behind is `step` [s] if it is no use here. Returns
    why the last shot ended, how many integration steps all took, how many shots there were, and after how
    many the motion repeats (0: it does not yet).
    """
    at, shot = shot, period_map_at(shot)
    drive, x, mode, trail = lean(drive), lean(x), lean(mode), lean(trail)
    reason, spent = reasons.DONE, 0
    for k in range(trail.shape[0]):
        coordinates(shot, x, trail[k])
        if k > 1:
            once = _changes(shot, trail, k, 1)
            if once < settled:
                return reason, spent, k, 1
            twice = _changes(shot, trail, k, 2)
            if twice < twice_settled and twice < EVENS * once:
                return reason, spent, k, 2
        if not 0.0 < shot.clock[2] <= FIRST_STALE * step:
            shot.clock[2] = step
        reason = call_native(
            shot.take,
            (
                at, drive, time, x, mode, mirrored, rtol, atol, hmax, shot.no_spectrum, budget - spent,
            ),
        )  # fmt: skip
        spent += int(shot.clock[3])
        if reason != reasons.DONE or spent >= budget:
            return reason, spent, k + 1, 0
    return reason, spent, trail.shape[0], 0


@part
def _changes(shot, trail, k, shots):
    """Change of the coordinates to row k of a trail over so many shots, relative to their sizes."""
    step = shot.trial[0]
    copy(trail[k], step)
    return mismatch(shot, trail[k - shots], step)


@apart
def take(shot, drive, time, x, mode, mirrored, rtol, atol, hmax, spectrum, budget):
    """Run (x, mode), in place, from t = 0 over `time`, mirrored afterwards if asked; return why it ended.

    With columns in `spectrum` the integrals of the outputs against exp(-j k omega t) are written to it, and
    the outputs at both ends to ``shot.ends``.
    """
    shot = period_map_at(shot)
    prog, clock = shot.prog, shot.clock
    work = shot.space.work
    clock[0] = clock[1] = clock[3] = clock[4] = clock[5] = clock[6] = clock[7] = 0.0
    clock[8] = -1.0
    for j in range(x.shape[0]):
        # tolerances refer to the size of this motion; that of a larger one before it must be forgotten
        shot.space.size[j] = max(abs(x[j]), SIZE_FORGOTTEN * shot.space.size[j])
    settle(prog, drive, 0, 0.0, x, mode, work, shot.space.dx)
    wanted = spectrum.shape[1] > 0
    if wanted:
        for i in range(spectrum.shape[0]):
            for k in range(spectrum.shape[1]):
                spectrum[i, k] = 0.0
        _outputs(shot, drive, 0.0, x, mode, 0)
    reason = reasons.DONE
    kinds = 0
    for _ in range(CHATTER_ROOM):
        reason = call_native(
            shot.run,
            (
                prog, drive, clock, x, mode, time, Recording(shot.none, shot.none_x, shot.none_y),
                Accuracy(8, rtol, atol, hmax, max(rtol, HEIGHT)), True, False, NO_WATCH, budget,
                EventLog(shot.log_t, shot.log_n, shot.log_k), shot.before, shot.scale, 0, shot.space.at,
                spectrum, drive.omega,
            ),
        )  # fmt: skip
        for i in range(min(int(clock[5]), shot.log_t.shape[0])):
            kinds |= 1 << shot.log_k[i]
        if reason != reasons.FULL:
            break
    shot.tally[0] += 1
    shot.tally[1] += int(clock[3])
    shot.tally[2] = kinds
    shot.tally[4] = reason
    shot.tally[5] = _stuck(prog, mode)
    if wanted:
        _outputs(shot, drive, time, x, mode, 1)
    if mirrored and reason == reasons.DONE:
        mirror(shot, x, mode)
    return reason


@part
def _stuck(prog, mode):
    """1 where every body is held by friction or at a stop."""
    bodies = 0
    for n in range(prog.nodes.shape[0]):
        if prog.nodes[n, L.KIND] == L.MECHANISM:
            for b in range(prog.ints[prog.nodes[n, L.AUX]]):
                bodies += 1
                if mode[prog.nodes[n, L.MODE] + b] != L.STUCK:
                    return 0
    return 1 if bodies > 0 else 0


@part
def _outputs(shot, drive, t, x, mode, row):
    prog, w = shot.prog, shot.space.work[0]
    refresh(prog, drive, 0, t, x, mode, w)
    for i in range(shot.ends.shape[1]):
        shot.ends[row, i] = combine(prog, prog.ints[prog.ints[L.H_OUT] + i], w)


@part
def mirror(shot, x, mode):
    """Mirror the state of an odd system: what follows is the mirror image of what would have followed."""
    prog = shot.prog
    for j in range(x.shape[0]):
        x[j] = shot.offset[j] - x[j]
    for n in range(prog.nodes.shape[0]):
        kind, at = prog.nodes[n, L.KIND], prog.nodes[n, L.MODE]
        if kind == L.MECHANISM:
            for slot in (L.DIR0, L.DIR1):
                if abs(mode[at + slot]) == 1:
                    mode[at + slot] = -mode[at + slot]
            elastic = prog.ints[prog.nodes[n, L.AUX] + L.A_JOINT] == L.J_ELASTIC
            if not (elastic and prog.par[prog.nodes[n, L.PAR] + L.P_GAP] == 0.0):
                mode[at + L.JOINT] = -mode[at + L.JOINT]
            mode[at + L.WALL], mode[at + L.TOUCH] = -mode[at + L.WALL], -mode[at + L.TOUCH]
        elif kind == L.PWA:
            mode[at] = prog.ints[prog.nodes[n, L.AUX]] - 2 - mode[at]
        elif kind == L.QUANTIZER or kind == L.PLAY or kind == L.RATE:
            mode[at] = -mode[at]


# --- coordinates ------------------------------------------------------------------------------------------


@part
def coordinates(shot, x, y):
    """Y = T x."""
    for i in range(x.shape[0]):
        value = 0.0
        for j in range(x.shape[0]):
            value += shot.transform[i, j] * x[j]
        y[i] = value


@njit(error_model="numpy")
def set_state(shot, y, x, mode):
    """`place`, from Python."""
    place(period_map_at(shot), lean(y), lean(x), lean(mode))


@part
def place(shot, y, x, mode):
    """Set the state at coordinates y (clipped to gaps and stops); contacts survive if untouched."""
    prog, n = shot.prog, x.shape[0]
    for i in range(n):
        y[i] = min(max(y[i], shot.lower[i]), shot.upper[i])
    for i in range(n):
        value = 0.0
        for j in range(n):
            value += shot.inverse[i, j] * y[j]
        x[i] = value
    for k in range(prog.nodes.shape[0]):
        if prog.nodes[k, L.KIND] != L.MECHANISM:
            continue
        at, first = prog.nodes[k, L.MODE], prog.nodes[k, L.X]
        mode[at + L.DIR0], mode[at + L.DIR1] = shot.modes[at + L.DIR0], shot.modes[at + L.DIR1]
        if prog.ints[prog.nodes[k, L.AUX] + L.A_JOINT] == L.J_IMPACT and mode[at + L.JOINT] != 0:
            gap = prog.par[prog.nodes[k, L.PAR] + L.P_GAP]
            face = gap if mode[at + L.JOINT] > 0 else 0.0
            # contact survives what rounding leaves of it
            apart = abs(y[first + 2] - face) > TOUCHING * gap
            if apart or abs(y[first + 3]) > TOUCHING * shot.size[first + 3]:
                mode[at + L.JOINT] = 0
            else:
                x[first + 2] = x[first] + face
                x[first + 3] = x[first + 1]
    for i in range(n):
        if x[i] < shot.low[i] or x[i] > shot.high[i]:
            x[i] = min(max(x[i], shot.low[i]), shot.high[i])
    for k in range(prog.nodes.shape[0]):
        if prog.nodes[k, L.KIND] == L.MECHANISM:
            at, first = prog.nodes[k, L.MODE], prog.nodes[k, L.X]
            if mode[at + L.WALL] != 0:
                driven = first + 2 * (prog.ints[prog.nodes[k, L.AUX]] - 1)
                if (x[driven] != shot.low[driven] and x[driven] != shot.high[driven]) or x[driven + 1] != 0.0:
                    mode[at + L.WALL] = 0


@part
def mismatch(shot, y0, y1):
    """Return the closing error relative to the sizes of the coordinates; leave the step itself in y1."""
    n = y0.shape[0]
    seen = shot.space.size
    for i in range(n):
        size = max(abs(y0[i]), abs(y1[i]))
        if shot.lower[i] > -math.inf:
            size = shot.upper[i] - shot.lower[i]
        elif shot.transform[i, i] == 1.0:
            size = max(size, seen[i])
        shot.size[i] = max(size, SIZE_KEPT * shot.size[i])
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
