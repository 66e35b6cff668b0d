# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""Many runs, one after another, without the interpreter: the kernel behind `ctrl_df.simulate.runs`.

Every run begins from a state of its own, and leaves nothing behind that another could see, unless that one is
said to go on behind it: numbers do not depend on how the runs are shared out among threads. The engine is
called through its address (`native.py`), so that it is compiled once, for single runs and for many.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..compiler.compiled import njit, part
from ..compiler.native import call_native
from ..compiler.views import cut, lean
from ..program.layout import H_NG, Drive, Program
from ..thresholds import EVENTS, LOGS, MOST_OUTPUTS, STEPS_AT_ONCE, steps_at_once
from . import driver
from .pace import keep_pace
from .run import reasons
from .run.kept import GOES_ON
from .space import Space, space_at
from .task import NO_WATCH, EventLog, Recording

NOT_STARTED, UNFINISHED = -1, -2
"""Before a run has ended: beside `ctrl_df.simulate.kernel.run.reasons`."""


class Drives(NamedTuple):
    """External inputs of many runs, as in `layout.Drive`; the first axis: one for each.

    ``time`` (1 or k, nt) [s], ``samples`` (k, nr, nt), ``linear`` 0 (held) or 1, ``harmonics`` (k, nr, nh),
    ``omega`` (k,) [rad/s].
    """

    time: np.ndarray
    samples: np.ndarray
    linear: int
    harmonics: np.ndarray
    omega: np.ndarray


class Rows(NamedTuple):
    """What each of n runs begins with and comes to.

    The output times of run i are ``times[first[i] : first[i] + count[i]]``; its outputs, and its states where
    they are kept, are the rows from ``at[i]``. Its modes are ``mode[modes[i] : modes[i + 1]]``. Behind run j,
    ``after[i] = j``, it begins in ``x_i + hidden (x_j - x_i)``, x_j being where that one has ended.
    """

    x: np.ndarray  # (n, nx) states, moved on
    mode: np.ndarray  # moved on
    modes: np.ndarray  # (n + 1,)
    clock: np.ndarray  # (n, 10) as `driver.run` has it
    end: np.ndarray  # (n,) [s]
    max_steps: np.ndarray  # (n,)
    drive: np.ndarray  # (n,) which of the drives
    par: np.ndarray  # (n,) which row of the parameters
    after: np.ndarray  # (n,) behind which run each goes on, made before it in the same thread; -1: none
    hidden: np.ndarray  # (nx, nx) projection on the states that go on
    times: np.ndarray  # [s]
    first: np.ndarray  # (n,)
    count: np.ndarray  # (n,)
    at: np.ndarray  # (n,)
    outputs: np.ndarray  # (total, ny)
    reason: np.ndarray  # (n,)
    events: np.ndarray  # (n,)


class Context(NamedTuple):
    """What one thread works with: the engine's address and program, scratch, its log of events."""

    run: int
    nodes: np.ndarray
    ints: np.ndarray
    space: int
    words: np.ndarray  # of the space
    scale: np.ndarray
    before: np.ndarray
    spectrum: np.ndarray
    states: np.ndarray  # (total, nx), shared by all threads; or scratch of the longest run
    keep: int  # 1: they are shared
    log_t: np.ndarray
    log_n: np.ndarray
    log_k: np.ndarray
    log_row: np.ndarray
    tally: np.ndarray  # events in the log, row of the parameters in use
    chunk: int  # steps between two looks whether to stop
    stop: np.ndarray  # shared by all threads: 1 asks them to leave


def make_context(
    engine, space: Space, states: np.ndarray, keep: bool, logged: bool, stop: np.ndarray
) -> Context:
    """Return what a thread needs for the runs of one program in a space; `logged`: keep their events."""
    program = engine.program
    n, ng = engine.nstates, int(program.ints[H_NG]) + 1
    keep_pace(program, space)
    room = LOGS * EVENTS if logged else 1
    log_t, log_n, log_k, log_row = (np.zeros(room, kind) for kind in (float, np.int64, np.int64, np.int64))
    scale, before = np.zeros((4, ng)), np.zeros(n)
    spectrum = np.zeros((engine.noutputs, 0), complex)
    return Context(
        driver.address(), program.nodes, program.ints, space.at, space.words, scale, before, spectrum, states,
        int(keep),
        log_t, log_n, log_k, log_row, np.array([0, -1]), steps_at_once(STEPS_AT_ONCE, n), stop,
    )  # fmt: skip


@njit(error_model="numpy", nogil=True)
def run_rows(context, rows, drives, par, accuracy, todo, begin):
    """Run the rows ``todo[begin:]`` one after another; return how many of `todo` are done.

    `par` (k, npar) are the packed parameters that ``rows.par`` refers to. Fewer than all are done where the
    log of events is full (take it, set ``context.tally[0]`` to zero, and go on from the number returned, in
    the same context) or where ``context.stop`` asks to leave.
    """
    context, rows, drives, par, todo = lean(context), lean(rows), lean(drives), lean(par), lean(todo)
    for i in range(begin, todo.shape[0]):
        row = todo[i]
        if context.stop[0] != 0 or not _one(context, rows, drives, par, accuracy, row):
            return i
    return todo.shape[0]


@part
def _one(context, rows, drives, par, accuracy, row):
    """Run one row to its end; False where it has to stop before."""
    space = space_at(context.space)
    memo = space.memo
    clock, first = rows.clock[row], rows.first[row]
    times = cut(rows.times, first, rows.count[row])
    outputs = cut(rows.outputs, rows.at[row], times.shape[0])
    at = rows.at[row] if context.keep else 0
    mode = cut(rows.mode, rows.modes[row], rows.modes[row + 1] - rows.modes[row])
    states = cut(context.states, at, times.shape[0])
    which = rows.drive[row]
    time = drives.time[min(which, drives.time.shape[0] - 1)]
    drive = Drive(time, drives.samples[which], drives.linear, drives.harmonics[which], drives.omega[which], 0)
    prog = Program(context.nodes, context.ints, par[rows.par[row]])
    fresh = 0
    if rows.reason[row] == NOT_STARTED:
        fresh = 1
        if context.tally[1] != rows.par[row]:
            # maps of modes that were learnt with other parameters
            space.store.order[0] = 0
            context.tally[1] = rows.par[row]
        for i in range(context.scale.shape[0]):
            for j in range(context.scale.shape[1]):
                context.scale[i, j] = 0.0
        memo[GOES_ON] = 0.0
        clock[6] = _segment(time, clock[0])
        if rows.after[row] >= 0 and rows.reason[rows.after[row]] == reasons.DONE:
            _go_on(rows, row, context.before)
    while True:
        logged = min(EVENTS, context.log_t.shape[0])
        used = context.tally[0]
        if context.stop[0] != 0 or used + logged > context.log_t.shape[0]:
            if fresh == 0:
                rows.reason[row] = UNFINISHED
            return False
        until = rows.end[row]
        if times.shape[0] - int(clock[1]) > MOST_OUTPUTS:
            until = min(until, times[int(clock[1]) + MOST_OUTPUTS])
        budget = min(rows.max_steps[row] - int(clock[3]), context.chunk)
        reason = call_native(
            context.run,
            (
                prog, drive, clock, rows.x[row], mode, until, Recording(times, states, outputs), accuracy,
                True, False, NO_WATCH, budget,
                EventLog(
                    cut(context.log_t, used, logged), cut(context.log_n, used, logged),
                    cut(context.log_k, used, logged),
                ),
                context.before, context.scale, fresh, context.space, context.spectrum, 0.0,
            ),
        )  # fmt: skip
        fresh = 0
        if logged > 1:
            for j in range(used, used + min(int(clock[5]), logged)):
                context.log_row[j] = row
                context.tally[0] = j + 1
        goes_on = (
            reason == reasons.FULL
            or (reason == reasons.STEPS and clock[3] < rows.max_steps[row])
            or (reason == reasons.DONE and until < rows.end[row])
        )
        if not goes_on:
            break
        memo[GOES_ON] = 1.0
    right = _finite(outputs, int(clock[1]))
    if right < int(clock[1]):
        reason = reasons.NAN
    clock[1] = right
    _blank(outputs, right)
    if context.keep:
        _blank(states, right)
    rows.events[row] = int(clock[4])
    rows.reason[row] = reason
    return True


@part
def _go_on(rows, row, came):
    """Let hidden states, and the length of steps, be what the run before came to; `came` (nx,): scratch."""
    x, before = rows.x[row], rows.x[rows.after[row]]
    for j in range(x.shape[0]):
        came[j] = before[j] - x[j]
    for i in range(x.shape[0]):
        for j in range(x.shape[0]):
            x[i] += rows.hidden[i, j] * came[j]
    rows.clock[row, 2] = rows.clock[rows.after[row], 2]


@part
def _blank(values, first):
    """Write NaN from row `first` on."""
    for i in range(first, values.shape[0]):
        for j in range(values.shape[1]):
            values[i, j] = math.nan


@part
def _segment(time, t):
    """Last sample at or before a time [s]; the first where there is none."""
    low, high = 0, time.shape[0]
    while low < high:
        middle = (low + high) // 2
        if time[middle] <= t:
            low = middle + 1
        else:
            high = middle
    return max(low - 1, 0)


@part
def _finite(outputs, recorded):
    """Rows up to the first one with a number that is not finite."""
    for i in range(recorded):
        for j in range(outputs.shape[1]):
            if not math.isfinite(outputs[i, j]):
                return i
    return recorded
