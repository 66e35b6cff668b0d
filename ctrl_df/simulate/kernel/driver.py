# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""The event-driven run: adaptive steps within a mode, events located as roots of their margins."""

from __future__ import annotations

import functools
import math

from ..compiler.compiled import apart, njit, part
from ..compiler.native import COUNTS, NUMBERS, ROWS, SPECTRA, call_native, native_address
from ..compiler.views import lean
from ..dynamics import history
from ..dynamics.flow import segment_from
from ..dynamics.matrices import copy
from ..dynamics.modes import track
from ..program.layout import NO_DRIVE, NO_PROGRAM
from ..thresholds import FADING, PACE_REST, PACE_WAIT, ROUNDING
from .affine import recall
from .outputs import accumulate, next_sample, remember, tick
from .run.opening import close_run, open_run
from .run.passing import pass_event
from .run.progress import line_up, new_progress, new_trial
from .run.reasons import DONE, HISTORY, STEPS
from .run.recording import record_due, record_within
from .run.search import evaluate_here, find_event, look_here, look_inside
from .run.trial import interpolate, try_step
from .space import space_at, workspace
from .stepper import inside
from .task import NO_WATCH, Accuracy, EventLog, Recording, Task, Watch


@functools.cache
def address() -> int:
    """Return the address of `advance`, compiled now if need be."""
    arguments = (
        NO_PROGRAM, NO_DRIVE, NUMBERS, NUMBERS, COUNTS, 0.0, Recording(NUMBERS, ROWS, ROWS),
        Accuracy(8, 0.0, 0.0, 0.0, 0.0), True, True, NO_WATCH, 0, EventLog(NUMBERS, COUNTS, COUNTS), NUMBERS,
        ROWS, 0, workspace(NO_PROGRAM).at, SPECTRA, 0.0,
    )  # fmt: skip
    return native_address(advance, arguments)


@njit(error_model="numpy", nogil=True)
def run(
    engine, prog, drive, clock, x, mode, t_end, tout, xout, yout, order, rtol, atol, hmax, locate,
    stop_at_event, watch, watch_level, watch_sign, height, max_steps, log_t, log_n, log_k, before, scale,
    fresh, space, spectrum, omega,
):  # fmt: skip
    """Run from clock[0] to t_end: `advance`, at its address `engine`, on views of the arrays.

    Python calls it, and hands over every number by itself: tuples of them would make the shortest runs a
    tenth slower.
    """
    recording = Recording(lean(tout), lean(xout), lean(yout))
    log = EventLog(lean(log_t), lean(log_n), lean(log_k))
    return call_native(engine, (
        lean(prog), lean(drive), lean(clock), lean(x), lean(mode), t_end, recording,
        Accuracy(order, rtol, atol, hmax, height), locate, stop_at_event,
        Watch(watch, watch_level, watch_sign), max_steps, log, lean(before), lean(scale), fresh, space,
        lean(spectrum), omega,
    ))  # fmt: skip


@apart
def advance(
    prog, drive, clock, x, mode, t_end, recording, accuracy, locate, stop_at_event, watched, max_steps, log,
    before, scale, fresh, space, spectrum, omega,
):  # fmt: skip
    """Run from clock[0] to t_end; see `task.py` and `ctrl_df.simulate.engine.Engine.run` for the arguments.

    ``clock``: [time, next output index, last step size, steps used, events so far, events in this log,
    segment, on section, margin of the last event, steps by constant propagators].
    ``before``: state just before the event that stopped the run. ``scale`` (4, ng): see `renewed`.
    ``fresh``: 1 to settle modes first (a new state), 0 to go on. ``space``: address of a `workspace`.
    ``spectrum``: (ny, kmax + 1) complex, to which the integrals of y exp(-j k omega t) over the run are
    added; no columns, no integrals. Returns the reason, see `reasons`.
    """
    now, trial = new_progress(), new_trial()
    task = Task(
        prog, drive, x, mode, t_end, recording, accuracy, locate, stop_at_event, watched, max_steps, log,
        before, scale, spectrum, omega, space, space_at(space),
    )  # fmt: skip
    open_run(task, now, clock, fresh)
    while now.reason == DONE:
        _take_inputs(task, now)
        record_due(task, now)
        if now.t >= t_end:
            break
        if now.steps >= max_steps:
            now.reason = STEPS
            break
        trial.limit = _next_instant(task, now)
        if now.jumped and (now.tracked or not locate):
            line_up(task, now)
            now.jumped = now.known = False
        if _kept_pace(task, now, clock):
            continue
        if now.jumped or not now.known:
            evaluate_here(task, now, trial)
        if not look_here(task, now, trial):
            continue
        trial.length = 0.0
        if trial.theta > 0.0:
            if not try_step(task, now, trial):
                continue
            look_inside(task, now, trial)
            if not interpolate(task, now, trial):
                continue
            find_event(task, now, trial)
            if not _go(task, now, trial):
                now.reason = HISTORY
                break
        if trial.at < 0:
            _go_on(task, now, trial)
        else:
            pass_event(task, now, trial, clock)
    close_run(task, now, clock)
    return now.reason


@part(inline=True)
def _take_inputs(task, now):
    """Take the inputs from here on, which may jump or kink."""
    current = segment_from(task.drive, now.segment, now.t)
    if current > now.segment:
        now.segment, now.generation = current, 1.0
        now.jumped = now.jumped or now.held


@part(inline=True)
def _next_instant(task, now):
    """Return the next instant at which something outside the states may jump or kink."""
    time = task.drive.time
    limit = task.t_end
    if now.segment + 1 < time.shape[0]:
        limit = min(limit, time[now.segment + 1])
    limit = min(limit, now.next_tick)
    if now.delays:
        known = limit
        limit, arrived = history.advance(
            task.prog, now.t, now.h if now.h > 0.0 else math.inf, limit, task.space.work[0]
        )
        if limit + ROUNDING * abs(limit) >= known:
            limit = known  # what rounding alone parts is one instant
        if arrived > 0.0:
            now.jumped = True
            now.generation = arrived if now.generation == 0.0 else min(now.generation, arrived)
    return limit


@part(inline=True)
def _kept_pace(task, now, clock):
    """Recall the present mode if it is affine; whether steps by its propagators have led anywhere."""
    if not (now.affine or now.gliding):
        return False
    prog, drive, x, mode, ws = task.prog, task.drive, task.x, task.mode, task.space
    now.slot = recall(prog, ws.store, mode, ws.work, ws.x1, ws.xi, ws.dx, ws.g)
    if not now.gliding:
        return False
    if now.skip > 0:
        now.skip -= 1
        return False
    started, (tout, xout, yout) = now.t, task.recording
    gone = call_native(
        ws.paced[0],
        (
            prog, drive, task.at, now.slot, now.t, task.t_end, now.hmax, now.segment, now.index, x, mode,
            tout, xout, yout, task.scale, task.accuracy.rtol, task.accuracy.atol, now.h, now.next_tick,
        ),
    )  # fmt: skip
    now.t, now.segment, now.index, now.next_tick = ws.led[0], int(ws.led[1]), int(ws.led[2]), ws.led[3]
    if gone > 0:
        clock[9] += gone
        now.skip = now.wait = 0
        if now.affine:
            now.h = max(now.h, now.t - started)
        now.known, now.jumped = False, ws.led[4] == 1.0 or now.held
    elif now.curved:
        now.skip = now.wait = min(2 * now.wait + 1, PACE_WAIT)
    if ws.led[5] == 1.0:
        now.skip = PACE_REST
    return gone > 0


@part(inline=True)
def _go(task, now, trial):
    """Move on to the event or the end of the step; False where delays cannot remember it.

    Outputs on the way are recorded and integrated.
    """
    prog, drive, x, mode, ws = task.prog, task.drive, task.x, task.mode, task.space
    length, theta = trial.length, min(trial.theta, 1.0)
    reached = trial.limit if trial.truncated else now.t + length
    if trial.theta < 1.0:
        reached = now.t + trial.theta * length
    record_within(task, now, trial, reached)
    if now.waves:
        accumulate(
            prog, drive, now.segment, now.t, length, theta, x, mode, ws.work, trial.terms, ws.poly, ws.xi,
            task.spectrum, task.omega,
        )  # fmt: skip
    if now.delays and not remember(
        prog, drive, now.segment, now.t, length, theta, now.generation, x, mode, ws.work, trial.terms,
        ws.poly, ws.xi,
    ):  # fmt: skip
        return False
    now.generation = 0.0
    if trial.theta < 1.0:
        inside(trial.terms, trial.theta, x, ws.poly, ws.x1)
    now.t, now.h = reached, trial.following
    copy(ws.x1, x)
    for j in range(x.shape[0]):
        # a size that forgets slowly: tolerances do not tighten as a state passes through zero
        ws.size[j] = max(abs(x[j]), FADING * ws.size[j])
    return True


@part(inline=True)
def _go_on(task, now, trial):
    """Go on after a step without an event: keep its last rates, let controllers tick."""
    prog, drive, x, mode, ws = task.prog, task.drive, task.x, task.mode, task.space
    now.known = False
    if not now.affine:
        if task.locate:
            copy(ws.g, ws.g0)
        copy(ws.k[12 if trial.rank == 8 else (6 if trial.rank == 5 else 3)], ws.k[0])
        now.known = trial.theta == 1.0
    if now.tracked and track(
        prog, drive, now.segment, now.t, x, mode, ws.work, trial.length if task.locate else -1.0
    ):
        now.jumped, now.known = True, False
    if now.t == now.next_tick:
        current = segment_from(drive, now.segment, now.t)
        if current > now.segment and now.held:
            now.segment = current
            line_up(task, now)
        tick(prog, drive, now.segment, now.t, x, mode, ws.work, ws.dx)
        tout = task.recording.times
        now.next_tick = next_sample(prog, drive, now.segment, now.t, task.t_end, tout, now.index)
        now.jumped, now.generation = True, 1.0
