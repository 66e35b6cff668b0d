# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""Crossings of a Poincaré section, where a signal rises through zero, without the interpreter between."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..status import Status
from .compiler.compiled import njit
from .compiler.native import call_native
from .compiler.views import lean
from .dynamics import history
from .engine import STATUS, Engine, State, constant_drive
from .kernel import driver
from .kernel.run import reasons
from .kernel.run.kept import GOES_ON
from .kernel.space import space_at, workspace
from .kernel.task import Accuracy, EventLog, Recording, Watch
from .program import pointers
from .program.layout import H_NG
from .thresholds import (
    HEIGHT,
    INTERVAL_LONGER,
    INTERVAL_STEPS,
    PEAK_DECADES,
    PEAK_SAMPLES,
    STATE_MOST,
    STEPS_AT_ONCE_MANY,
    TOGETHER_INTERVALS,
    steps_at_once,
)


class Interval(NamedTuple):
    """A run from one crossing to the next, or over some time without any.

    Attributes
    ----------
    time : float
        Its end [s].
    x : (n,) array
        State there.
    crossed : bool
        Whether it ended at a crossing.
    peak : float
        Largest magnitude of the output on the way.
    steps : int
    status : Status
    """

    time: float
    x: np.ndarray
    crossed: bool
    peak: float
    steps: int
    status: Status


def intervals(
    engine: Engine, state: State, signal: int, row: int, first: float, limit: float, rtol: float
) -> Iterator[Interval]:
    """Run an engine without inputs from crossing to crossing of a signal, until nobody asks for more.

    Parameters
    ----------
    engine : Engine
    state : State
        Where to begin.
    signal, row : int
        Signal whose upward crossings through zero count, and output whose peaks are taken.
    first : float
        Longest interval while fewer than two crossings are known [s]; then four times what the last one took.
    limit : float
        Time at which the last interval ends [s].
    rtol : float
        As in `Engine.run`.
    """
    n, program = engine.nstates, engine.program
    space, now = workspace(program, delays=True), state.copy()
    if engine.delayed and now.history is not None:
        history.stored(program, space.work[0])[:] = now.history
    scale = np.zeros((4, int(program.ints[H_NG]) + 1)) if now.scale is None else now.scale
    clock = np.array([now.time, 0, now.step, 0, 0, 0, now.segment, float(now.on_section), -1, 0])
    together = 1 if engine.calls_python else TOGETHER_INTERVALS
    drive = constant_drive(np.zeros(engine.ninputs))
    accuracy = Accuracy(8, float(rtol), 0.0, math.inf, max(rtol, HEIGHT))
    recording = Recording(
        np.zeros(PEAK_SAMPLES), np.zeros((PEAK_SAMPLES, n)), np.zeros((PEAK_SAMPLES, engine.noutputs))
    )
    log = EventLog(np.zeros(1), np.zeros(1, np.int64), np.zeros(1, np.int64))
    spectrum, last = np.zeros((engine.noutputs, 0), complex), np.array([0.0, 0.0, 0.0, float(now.fresh)])
    ends, states, numbers = (
        np.zeros((together, 2)),
        np.zeros((together, n)),
        np.zeros((together, 2), np.int64),
    )
    budget = steps_at_once(STEPS_AT_ONCE_MANY, n)
    while clock[0] < limit:
        pointers.raised.clear()
        pointers.gave_nan.clear()
        with pointers.interruptible():
            done = _follow(
                driver.address(), program, drive, clock, now.x, now.mode, recording, accuracy,
                Watch(signal, 0.0, -1), row, log, now.x.copy(), scale, space.at, spectrum, first, limit, last,
                ends, states, numbers, budget,
            )  # fmt: skip
        pointers.raise_kept()
        for i in range(done):
            reason = int(numbers[i, 0])
            x = states[i].copy()
            if reason == reasons.NAN and pointers.gave_nan and np.max(np.abs(x), initial=0.0) < STATE_MOST:
                raise RuntimeError(f"{Status.USER_ERROR} ({pointers.gave_nan[0]}).")
            crossed = reason == reasons.SECTION
            yield Interval(
                float(ends[i, 0]), x, crossed, float(ends[i, 1]), int(numbers[i, 1]), STATUS[reason]
            )


@njit(error_model="numpy", nogil=True)
def _follow(
    engine, prog, drive, clock, x, mode, recording, accuracy, watch, row, log, before, scale, space, spectrum,
    first, limit, last, ends, states, numbers, budget,
):  # fmt: skip
    """Make as many intervals as there are rows in `ends`, or fewer; return how many.

    ``last``: times of the last two crossings, their number, whether the state is a fresh one. ``ends``: time
    and peak of each interval; ``numbers``: why it ended, its steps.
    """
    prog, drive, clock, x, mode = lean(prog), lean(drive), lean(clock), lean(x), lean(mode)
    recording, log, before = lean(recording), lean(log), lean(before)
    scale, spectrum, memo = lean(scale), lean(spectrum), space_at(space).memo
    times, _, outputs = recording
    peeks, spent = times.shape[0], 0
    for i in range(ends.shape[0]):
        begin = clock[0]
        ahead = INTERVAL_LONGER * (last[0] - last[1]) if last[2] >= 2.0 else first
        for k in range(peeks):
            share = k / (peeks - 1.0)
            if last[2] < 2.0 and k > 0:
                share = 10.0 ** (PEAK_DECADES * (share - 1.0))  # nobody knows yet how long it will be
            times[k] = begin + share * ahead
        times[peeks - 1] = begin + ahead
        until = min(begin + ahead, limit)
        clock[1] = clock[3] = clock[4] = clock[9] = 0.0
        clock[8] = -1.0
        memo[GOES_ON] = 0.0
        while True:
            reason = call_native(
                engine,
                (
                    prog, drive, clock, x, mode, until, recording, accuracy, True, False, watch,
                    min(INTERVAL_STEPS - int(clock[3]), budget), log, before, scale, int(last[3]), space,
                    spectrum, 0.0,
                ),
            )  # fmt: skip
            last[3] = 0.0
            if reason != reasons.STEPS or int(clock[3]) >= INTERVAL_STEPS:
                break
            memo[GOES_ON] = 1.0
        peak = 0.0
        for k in range(int(clock[1])):
            value = abs(outputs[k, row])
            if not value <= peak:
                peak = value
        ends[i, 0], ends[i, 1] = clock[0], peak
        numbers[i, 0], numbers[i, 1] = reason, int(clock[3])
        for j in range(x.shape[0]):
            states[i, j] = x[j]
        spent += int(clock[3])
        if reason == reasons.SECTION:
            last[1], last[0] = last[0], clock[0]
            last[2] += 1.0
        elif reason != reasons.DONE:
            return i + 1
        if clock[0] >= limit or spent > budget:
            return i + 1
    return ends.shape[0]
