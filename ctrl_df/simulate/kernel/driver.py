# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""The event-driven run: adaptive steps within a mode, events located as roots of their margins."""

from __future__ import annotations

import functools
import math

import numpy as np

from ..compiler.compiled import apart, njit, part
from ..compiler.native import call_native, native_address
from ..compiler.views import lean
from ..dynamics import history
from ..dynamics.flow import rates, segment_from
from ..dynamics.modes import event, settle, some_input_jumped, take_branches, track
from ..program.layout import (
    H_AFFINE,
    H_BUMP,
    H_DELAYS,
    H_DIRECT,
    H_TRACK,
    Drive,
    G,
    Program,
)
from ..thresholds import (
    AFTER_EVENT,
    BUMP_KEPT,
    DENSE,
    DENSER,
    FADING,
    FIRST_BLIND,
    FIRST_CHANGE,
    FIRST_LEAST,
    GAUSS_REACH,
    GAUSS_REACH_AFFINE,
    GROWS_5,
    GROWS_8,
    HARMONICS,
    LOST,
    MARGIN_GROWTH,
    PACE_WAIT,
    PATIENCE,
    PROGRESS,
    REACH,
    RESTART,
    ROUNDED,
    ROUNDING_STEPS,
    SAME,
    SERIES_REACH,
    SHORTEST,
    STEP_GROWTH,
    STEP_KEPT,
    STEP_SAFETY,
    STEP_SHRINK,
    UNSETTLED,
    WAVE_ROUGH,
    ZENO,
)
from .affine import crossing, forced, recall, series, shrink
from .locate import NOW, bump_share, complete, locate_event, margins, may_touch, renewed, tolerances, worst
from .outputs import accumulate, next_sample, record, record_inside, remember, start_delays, tick
from .propagators import forget_run
from .space import space_at, workspace
from .stepper import inside, prepare, prepare8, rate_rounding, roughness, step
from .task import NO_WATCH, Accuracy, EventLog, Recording, Watch

DONE, EVENT, SECTION, FULL, STEPS, NAN, CHATTER, TINY, HISTORY = range(9)
"""Why a run returned: end of time, stopped at an event, at the section, event log full, step bound, NaN,
sliding, step below the resolution of time, more steps within a delay than its history holds."""


@part(inline=True)
def copy(source, target):
    """Copy a vector in place."""
    for i in range(source.shape[0]):
        target[i] = source[i]


@functools.cache
def address() -> int:
    """Return the address of `advance`, compiled now if need be."""
    none, rows, counts = np.zeros(0), np.zeros((0, 0)), np.zeros(0, np.int64)
    prog = Program(np.zeros((0, 13), np.int64), np.zeros(H_DIRECT + 1, np.int64), none)
    drive = Drive(none, rows, 0, np.zeros((0, 0), complex), 0.0, 0)
    arguments = (
        prog, drive, none, none, counts, 0.0, Recording(none, rows, rows), Accuracy(8, 0.0, 0.0, 0.0, 0.0),
        True, True, NO_WATCH, 0, EventLog(none, counts, counts), none, rows, 0, workspace(prog).at,
        np.zeros((0, 0), complex), 0.0,
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
    added; no columns, no integrals. Returns the reason (module constants).
    """
    tout, xout, yout = recording
    order, rtol, atol, hmax, height = accuracy
    watch, watch_level, watch_sign = watched
    log_t, log_n, log_k = log
    ws = space_at(space)
    work, k, poly, x1, xi, dx, size, rounding = (
        ws.work, ws.k, ws.poly, ws.x1, ws.xi, ws.dx, ws.size, ws.rounding,
    )  # fmt: skip
    g, g0, gtol, lowest, norm, owner, memo, store, paced, led = (
        ws.g, ws.g0, ws.gtol, ws.lowest, ws.norm, ws.owner, ws.memo, ws.store, ws.paced,
        ws.led,
    )  # fmt: skip
    n, ng = x.shape[0], scale.shape[1]
    t, index, h = clock[0], int(clock[1]), clock[2]
    segment = int(clock[6])
    shortest = SHORTEST * (t_end - t)
    nt, nh = drive.time.shape[0], drive.harmonics.shape[1]
    held = nt > 0 and drive.linear == 0
    has_tracked, bumpy, delays = prog.ints[H_TRACK] == 1, prog.ints[H_BUMP] == 1, prog.ints[H_DELAYS] > 0
    affine = prog.ints[H_AFFINE] == 1 and drive.address == 0 and nh <= HARMONICS
    curved = prog.ints[H_AFFINE] == 2 and drive.address == 0
    gliding = (
        paced[0] != 0
        and (affine or curved)
        and locate
        and watch < 0
        and nh <= 1
        and tout.shape[0] + nt > 2
        and spectrum.shape[1] == 0
    )
    if affine and nh > 1 and drive.omega > 0.0:
        # the series of the forcing has to converge as well
        hmax = min(hmax, SERIES_REACH / ((nh - 1) * drive.omega))
    if spectrum.shape[1] > 0 and omega > 0.0:
        # so many radians of a wave are integrated at once
        hmax = min(hmax, (GAUSS_REACH_AFFINE if affine else GAUSS_REACH) / (spectrum.shape[1] * omega))
    steps = events_here = 0
    # a run that goes on after a full event log goes on counting events without progress
    zero_events = int(memo[0]) if memo[2] == 1.0 else 0
    last_event_t = memo[1] if memo[2] == 1.0 else t
    armed = False  # the run has been before the section: beyond it is a passage, at an event too
    known = False  # k[0] holds the rates at (t, x)
    jumped = False  # something outside the states jumped just now: modes may be out of line
    generation = 1.0  # of the record that a delay opens next
    patience = slot = skip = wait = 0
    level = order  # of steps that samples cut short
    stale = 0  # steps until rounding is estimated again
    blocked = ng - 1 if clock[7] > 0.5 else -1
    reason = DONE
    for i in range(ng):
        g[i] = math.inf  # the section's margin must not outlive the run that watched it
    if fresh == 1:
        forget_run(store, ws.tracks)
        for j in range(n):
            size[j], rounding[j] = abs(x[j]), 0.0
        if delays:
            start_delays(prog, drive, segment, t, x, mode, work)
        take_branches(prog, x, mode)
        if next_sample(prog, drive, segment, t, t_end, tout, index) < math.inf:
            # laws before a controller are in line with what it is to read
            settle(prog, drive, segment, t, x, mode, work, dx)
            tick(prog, drive, segment, t, x, mode, work, dx)
        if not settle(prog, drive, segment, t, x, mode, work, dx):
            reason = CHATTER
        if delays:
            start_delays(prog, drive, segment, t, x, mode, work)
    renewed(prog, mode, scale, -1)
    next_tick = next_sample(prog, drive, segment, t, t_end, tout, index)
    while reason == DONE:
        # the inputs from here on, which may jump or kink
        current = segment_from(drive, segment, t)
        if current > segment:
            segment, generation = current, 1.0
            jumped = jumped or held
        while index < tout.shape[0] and tout[index] <= t + SAME * abs(t):
            if jumped:
                settle(prog, drive, segment, t, x, mode, work, dx)
            for j in range(n):
                xout[index, j] = x[j]
            record(prog, drive, segment, t, x, mode, work, yout[index])
            index += 1
        if t >= t_end:
            break
        if steps >= max_steps:
            reason = STEPS
            break
        # --- the next instant at which they may
        limit = t_end
        if segment + 1 < nt:
            limit = min(limit, drive.time[segment + 1])
        limit = min(limit, next_tick)
        if delays:
            known_limit = limit
            limit, arrived = history.advance(prog, t, h if h > 0.0 else math.inf, limit, work[0])
            if limit + SAME * abs(limit) >= known_limit:
                limit = known_limit  # what rounding alone parts is one instant
            if arrived > 0.0:
                jumped = True
                generation = arrived if generation == 0.0 else min(generation, arrived)
        # --- rates and margins here
        if jumped and (has_tracked or not locate):
            settle(prog, drive, segment, t, x, mode, work, dx)
            jumped = known = False
        if affine or gliding:
            slot = recall(prog, store, mode, work, x1, xi, dx, g)
            if gliding and skip > 0:
                skip -= 1
            elif gliding:
                started = t
                gone = call_native(
                    paced[0],
                    (
                        prog, drive, space, slot, t, t_end, hmax, segment, index, x, mode, tout, xout, yout,
                        scale, rtol, atol, h, next_tick,
                    ),
                )  # fmt: skip
                t, segment, index, next_tick = led[0], int(led[1]), int(led[2]), led[3]
                if gone > 0:
                    clock[9] += gone
                    skip = wait = 0
                    if affine:
                        h = max(h, t - started)
                    known, jumped = False, led[4] == 1.0 or held
                    continue
                if curved:
                    skip = wait = min(2 * wait + 1, PACE_WAIT)
        if jumped or not known:
            renewed(prog, mode, scale, -1)  # a jump may have made a speed of a margin that was a force
            rates(prog, drive, segment, t, x, mode, work, k[0], g0, locate)
            if locate and (has_tracked or watch >= 0):
                reach = REACH * (h if h > 0.0 else _first_step(x, k[0], limit - t, hmax))
                complete(
                    prog, drive, segment, t, x, mode, work, k[0], g0, reach, watch, watch_level, watch_sign
                )
            else:
                g0[ng - 1] = math.inf
            known = True
        theta, at = 1.0, -1
        if locate:
            for i in range(ng):
                if g0[i] < math.inf:
                    scale[NOW, i] = max(scale[NOW, i], abs(g0[i]))
            tolerances(prog, x, mode, scale, gtol)
            armed = armed or (blocked != ng - 1 and gtol[ng - 1] < g0[ng - 1] < math.inf)
            # margins already crossed at the start (simultaneous events)
            value, at = worst(g0, gtol, scale[NOW], blocked)
            if value < 0.0 and jumped:
                jumped = known = False
                settle(prog, drive, segment, t, x, mode, work, dx)
                continue
            jumped = False
            if at >= 0 and value < 0.0:
                if at == ng - 1 and not armed:
                    blocked = at  # started beyond the section
                    continue
                theta = 0.0
            else:
                at = -1
        length = 0.0
        if theta > 0.0:
            # --- a step
            steps += 1
            remaining = limit - t
            length = min(h, hmax)
            if affine and h <= 0.0:
                length = min(remaining, hmax)
            elif h <= 0.0:
                length = h = _first_step(x, k[0], remaining, hmax)
            if bumpy:
                for j in range(n):
                    x1[j] = x[j] + length * k[0, j]
                length *= bump_share(prog, x, x1)
            truncated = t + length >= limit - ROUNDED * max(abs(limit), length)
            if truncated:
                length = remaining
            prepared = False
            terms = rank = 0
            if affine:
                least = forced(prog, drive, segment, t, length, rtol, store)
                terms, share = series(store, slot, length, least, k[0], size, rtol, atol, poly)
                if not share > 0.0:
                    reason = NAN
                    break
                if share < 1.0:
                    shrink(store, share, terms, poly)
                    length *= share
                    truncated = False
                inside(terms, 1.0, x, poly, x1)
                prepared = True
                # a step costs the same however long: only an event cuts the next one short
                h_next = max(h, STEP_GROWTH * length)
            else:
                for i in range(ng):
                    lowest[i] = g0[i]
                if stale == 0:
                    rate_rounding(
                        prog, drive, segment, t, length, x, mode, work, k[0], size, x1, dx, g, rounding
                    )  # fmt: skip
                    stale = ROUNDING_STEPS
                stale -= 1
                # samples much denser than the motion: a cheaper pair does
                rank = level if nt > 0 and not delays and truncated and h >= DENSER * length else order
                error = step(
                    rank,
                    prog,
                    drive,
                    segment,
                    t,
                    length,
                    x,
                    mode,
                    work,
                    k,
                    g,
                    lowest,
                    x1,
                    size,
                    rounding,
                    rtol,
                    atol,
                    locate,
                )
                # many short steps may not err more than the one long step they stand for
                share = min(length / h, 1.0) if rank < order else 1.0
                if not error <= share and rank < order:
                    level = 8 if rank == 5 else min(order, 5)
                    patience = PATIENCE
                    continue
                patience = max(patience - 1, 0)
                if truncated and rank == level and patience == 0 and error < DENSE * length / h:
                    level = 5 if level == 8 else 3
                if not error < math.inf:
                    h = STEP_SHRINK * length
                    if not h >= LOST * max(ROUNDED * abs(t), shortest):
                        reason = NAN
                    continue
                if error > 1.0:
                    h = length * max(STEP_SHRINK, STEP_SAFETY * error ** (-1.0 / order))
                    if t + h == t:
                        reason = TINY
                    continue
                if bumpy:
                    share = bump_share(prog, x, x1)
                    if share < BUMP_KEPT:
                        h = STEP_SAFETY * share * length
                        continue
                h_next = h
                if rank == order:
                    grow = STEP_GROWTH
                    if error > (GROWS_8 if order == 8 else GROWS_5):
                        grow = min(STEP_GROWTH, STEP_SAFETY * error ** (-1.0 / order))
                    h_next = length * max(grow, STEP_KEPT)
                    if truncated:
                        h_next = max(h_next, h)
            if has_tracked and locate and drive.address != 0 and length > max(ROUNDED * abs(t), shortest):
                # inputs that are functions may jump anywhere: half the step, until the jump stands at its end
                if some_input_jumped(prog, drive, segment, t + length, x, x1, mode, work, length):
                    h = 0.5 * length
                    continue
            # --- events
            suspect = False
            if locate:
                for i in range(ng):
                    norm[i] = scale[NOW, i]
                if affine and watch < 0:
                    theta, at = crossing(
                        prog, store, slot, mode, work, length, terms, poly, g0, gtol, norm, g
                    )
                else:
                    if affine or watch >= 0 or has_tracked:
                        margins(
                            prog, drive, segment, t + length, x1, mode, work, dx, g, REACH * length, watch,
                            watch_level, watch_sign,
                        )  # fmt: skip
                        suspect = True
                    for i in range(ng):
                        if abs(g[i]) < math.inf:
                            norm[i] = max(scale[NOW, i], abs(g[i]))
                        if i != blocked and (
                            g[i] + gtol[i] < 0.0 or (rank == 8 and lowest[i] + gtol[i] < 0.0)
                        ):
                            suspect = True
                    suspect = suspect or may_touch(prog, x, x1, mode, length)
            inner = index < tout.shape[0] and tout[index] < t + length
            if not prepared and (suspect or spectrum.shape[1] > 0 or inner or delays):
                if rank == 8:
                    prepare8(prog, drive, segment, t, length, x, x1, mode, work, k, dx, poly)
                    rough = roughness(size, rounding, length, rtol, atol, poly)
                    if not (suspect or inner or delays):
                        rough /= WAVE_ROUGH
                    if rough > 1.0:
                        h = length * max(STEP_KEPT, STEP_SAFETY * rough ** (-0.125))
                        continue
                    if spectrum.shape[1] > 0 and rough > GROWS_8:  # the next one is integrated as well
                        h_next = min(h_next, length * min(STEP_GROWTH, STEP_SAFETY * rough ** (-0.125)))
                else:
                    terms = prepare(rank, length, k, poly)
            if suspect:
                theta, at = locate_event(
                    prog, drive, segment, t, length, x, mode, work, terms, poly, xi, dx, g, gtol, norm,
                    blocked, watch, watch_level, watch_sign,
                )  # fmt: skip
            if blocked >= 0 and locate and g[blocked] > gtol[blocked]:
                blocked = -1
            reached = t + theta * length if theta < 1.0 else (limit if truncated else t + length)
            # --- outputs inside the step
            while index < tout.shape[0] and tout[index] < reached - SAME * abs(reached):
                record_inside(
                    prog, drive, segment, t, (tout[index] - t) / length, length, x, mode, work, terms, poly,
                    xout[index], yout[index],
                )  # fmt: skip
                index += 1
            if spectrum.shape[1] > 0:
                accumulate(
                    prog, drive, segment, t, length, min(theta, 1.0), x, mode, work, terms, poly, xi,
                    spectrum, omega
                )  # fmt: skip
            if delays and not remember(
                prog, drive, segment, t, length, min(theta, 1.0), generation, x, mode, work, terms, poly, xi
            ):
                reason = HISTORY
                break
            generation = 0.0
            if theta < 1.0:
                inside(terms, theta, x, poly, x1)
            t = reached
            copy(x1, x)
            for j in range(n):
                # a size that forgets slowly: tolerances do not tighten as a state passes through zero
                size[j] = max(abs(x[j]), FADING * size[j])
            h = h_next
            if at < 0:
                known = False
                if not affine:
                    if locate:
                        copy(g, g0)
                    copy(k[12 if rank == 8 else (6 if rank == 5 else 3)], k[0])
                    known = theta == 1.0
                if has_tracked and track(prog, drive, segment, t, x, mode, work, length if locate else -1.0):
                    jumped, known = True, False
                if t == next_tick:
                    current = segment_from(drive, segment, t)
                    if current > segment and held:
                        segment = current
                        settle(prog, drive, segment, t, x, mode, work, dx)
                    tick(prog, drive, segment, t, x, mode, work, dx)
                    next_tick = next_sample(prog, drive, segment, t, t_end, tout, index)
                    jumped, generation = True, 1.0
                continue
        reach = REACH * h
        if theta < 1.0 and theta * length > 0.0:
            # a step that ran far beyond its event says little of what follows
            h = max(min(h, AFTER_EVENT * theta * length), RESTART * abs(t))
        # --- an event at (t, x)
        known = False
        if at == ng - 1:
            blocked = at
            if log_t.shape[0] > 0:
                reason = SECTION
            copy(x, before)
            continue
        if has_tracked:
            track(prog, drive, segment, t, x, mode, work, -1.0)
            margins(prog, drive, segment, t, x, mode, work, dx, g, reach, -1, 0.0, 1)
        copy(x, before)
        node = owner[at]
        modes = _signature(mode)
        slot_at = at - prog.nodes[node, G]
        kind = event(prog, drive, segment, t, x, mode, work, dx, g, node, slot_at, height, reach)
        stale = 0
        generation = 1.0
        settled = settle(prog, drive, segment, t, x, mode, work, dx)
        if not settled:
            zero_events += UNSETTLED
        if settled and _signature(mode) == modes and _same(x, before):
            # nothing came of it: rounding alone crossed this margin, which thereby counts as larger
            scale[NOW, at] *= MARGIN_GROWTH
        else:
            renewed(prog, mode, scale, node)
        zero_events += 1
        if t - last_event_t > max(PROGRESS * abs(t), shortest):
            zero_events = 0
            last_event_t = t
        clock[4] += 1
        clock[8] = at
        if events_here < log_t.shape[0]:
            log_t[events_here] = t
            log_n[events_here] = node
            log_k[events_here] = kind
        events_here += 1
        if zero_events > ZENO:
            reason = CHATTER
        elif stop_at_event:
            reason = EVENT
        elif log_t.shape[0] > 1 and events_here >= log_t.shape[0]:
            reason = FULL
    clock[0], clock[1], clock[2] = t, index, h
    clock[3] += steps
    clock[5] = events_here
    clock[6] = segment
    clock[7] = 1.0 if blocked >= 0 else 0.0
    memo[0], memo[1], memo[2] = zero_events, last_event_t, 1.0 if reason == FULL else 0.0
    return reason


@part
def _signature(mode):
    """One number that tells mode vectors apart."""
    value = 0
    for i in range(mode.shape[0]):
        value = 31 * value + mode[i]
    return value


@part
def _same(a, b):
    """Whether two vectors are equal."""
    for i in range(a.shape[0]):
        if a[i] != b[i]:
            return False
    return True


@part
def _first_step(x, dx, remaining, hmax):
    """Estimate a first step: the time in which some state changes by a hundredth of itself.

    States that begin at zero tell nothing; where all do, a millionth of the time ahead is tried.
    """
    h = math.inf
    for j in range(x.shape[0]):
        if x[j] != 0.0 and dx[j] != 0.0:
            h = min(h, FIRST_CHANGE * abs(x[j] / dx[j]))
    span = min(remaining, hmax)
    return min(max(h, FIRST_LEAST * span), span) if h < math.inf else FIRST_BLIND * span
