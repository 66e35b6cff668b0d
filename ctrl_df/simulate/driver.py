# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""The event-driven run: adaptive steps within a mode, events located as roots of their margins."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .flow import combine, external, input_rates, rates, signals
from .layout import (
    A_BODIES,
    AUX,
    G_JOINT_HIGH,
    G_JOINT_LOW,
    G_WALL_HIGH,
    G_WALL_LOW,
    H_BUMP,
    H_NG,
    H_NS,
    H_NX,
    H_OUT,
    H_SCRATCH,
    H_TRACK,
    KIND,
    MECHANISM,
    MODE,
    NG,
    NIN,
    NOUT,
    NX,
    P_BUMP0,
    P_HIGH,
    P_LOW,
    PAR,
    PWA,
    SAMPLED,
    G,
    X,
)
from .modes import event, sample, settle, track
from .stepper import inside, prepare5, prepare8, roughness, step5, step8

NODES, WEIGHTS = (a / 2 for a in np.polynomial.legendre.leggauss(10))
NODES = NODES + 0.5
GRAIN = 4.0 * np.finfo(float).eps
DONE, EVENT, SECTION, FULL, STEPS, NAN, CHATTER, TINY = range(8)
"""Why a run returned: end of time, stopped at an event, at the section, event log full, step bound, NaN, sliding, step
below the resolution of time."""


def workspace(prog):
    """Scratch arrays of a run, made once: compiled code that counts no references needs memory from outside."""
    n, ng = int(prog.ints[H_NX]), int(prog.ints[H_NG])
    size = int(prog.ints[H_SCRATCH]) + n + int(prog.ints[H_NS]) + 4
    work = (np.zeros(size), np.zeros(2), np.zeros(max(n, 4) + 2))
    owner = np.zeros(ng + 1, np.int64)
    for node in range(prog.nodes.shape[0]):
        owner[prog.nodes[node, G] : prog.nodes[node, G] + prog.nodes[node, NG]] = node
    vectors = [np.zeros(n) for _ in range(4)] + [np.zeros(ng + 1) for _ in range(5)]
    return (work, np.zeros((16, n)), np.zeros((8, n)), *vectors, owner, np.zeros(3))


@njit(cache=True, error_model="numpy", _nrt=False)
def copy(source, target):
    """Copy a vector in place."""
    for i in range(source.shape[0]):
        target[i] = source[i]


@njit(cache=True, error_model="numpy", _nrt=False)
def margins(prog, drive, segment, t, x, mode, work, dx, g, reach, watch, watch_level, watch_sign):
    """Rates and all margins at one point, those of input rates and of the section included."""
    rates(prog, drive, segment, t, x, mode, work, dx, g, True)
    if prog.ints[H_TRACK] == 1:
        input_rates(prog, drive, segment, t, x, mode, work, dx, reach, g)
    last = g.shape[0] - 1
    g[last] = math.inf
    if watch >= 0:
        w = work[0]
        signals(prog, t, x, mode, w)
        g[last] = watch_sign * (w[watch] - watch_level)


@njit(cache=True, error_model="numpy", _nrt=False)
def next_sample(prog, t):
    """Time of the next tick of any sampled controller."""
    nearest = math.inf
    for n in range(prog.nodes.shape[0]):
        if prog.nodes[n, KIND] == SAMPLED:
            dt = prog.par[prog.nodes[n, PAR] + _sampled_size(prog, n)]
            nearest = min(nearest, (math.floor(t / dt + 1e-6) + 1.0) * dt)
    return nearest


@njit(cache=True, error_model="numpy", _nrt=False)
def _sampled_size(prog, n):
    """Floats of a sampled node's matrices; its period follows them."""
    no = prog.nodes[n, NOUT]
    nd, ni = prog.nodes[n, NX] - no, prog.nodes[n, NIN]
    return nd * nd + nd * ni + no * nd + no * ni


@njit(cache=True, error_model="numpy", _nrt=False)
def tick(prog, drive, segment, t, x, mode, work):
    """Run the sampled controllers whose tick falls on `t`."""
    w = work[0]
    for n in range(prog.nodes.shape[0]):
        if prog.nodes[n, KIND] == SAMPLED:
            dt = prog.par[prog.nodes[n, PAR] + _sampled_size(prog, n)]
            if abs(t / dt - round(t / dt)) < 1e-6:
                external(prog, drive, t, segment, w)
                signals(prog, t, x, mode, w)
                sample(prog, n, x, w)


@njit(cache=True, error_model="numpy", _nrt=False)
def record(prog, drive, segment, t, x, mode, work, y):
    """System outputs at one point."""
    w = work[0]
    external(prog, drive, t, segment, w)
    signals(prog, t, x, mode, w)
    for i in range(y.shape[0]):
        y[i] = combine(prog, prog.ints[prog.ints[H_OUT] + i], w)


@njit(cache=True, error_model="numpy", _nrt=False)
def accumulate(prog, drive, segment, t, length, theta, x, mode, work, order, poly, xi, spectrum, omega):
    """Add a step's share of the integrals of the outputs against exp(-j k omega t), by Gauss-Legendre quadrature."""
    w = work[0]
    for i in range(NODES.shape[0]):
        at = theta * NODES[i]
        time = t + at * length
        inside(order, at, x, poly, xi)
        external(prog, drive, time, segment, w)
        signals(prog, time, xi, mode, w)
        share = theta * length * WEIGHTS[i]
        turn = complex(math.cos(omega * time), -math.sin(omega * time))
        for row in range(spectrum.shape[0]):
            value = share * combine(prog, prog.ints[prog.ints[H_OUT] + row], w)
            rotation = complex(1.0, 0.0)
            for harmonic in range(spectrum.shape[1]):
                spectrum[row, harmonic] += value * rotation
                rotation *= turn


@njit(cache=True, error_model="numpy", _nrt=False)
def bump_share(prog, x, x1):
    """Share of the way from x to x1 that a step may take near a narrow feature of friction over speed.

    A Stribeck bump lies within about six of its speeds vs (exp(-36) is below rounding). There a step may change the
    speed by vs, or by half: no stage of it can then miss the bump, and the error estimate sees it.
    """
    share = 1.0
    for n in range(prog.nodes.shape[0]):
        if prog.nodes[n, KIND] != MECHANISM:
            continue
        for b in range(prog.ints[prog.nodes[n, AUX] + A_BODIES]):
            narrow = prog.par[prog.nodes[n, PAR] + P_BUMP0 + b]
            at = prog.nodes[n, X] + 2 * b + 1
            v0, v1 = x[at], x1[at]
            passes = v0 * v1 < 0.0 or min(abs(v0), abs(v1)) < 6.0 * narrow
            if narrow < math.inf and passes and v1 != v0:
                share = min(share, max(0.5 * abs(v0), narrow) / abs(v1 - v0))
    return share


@njit(cache=True, error_model="numpy", _nrt=False)
def tolerances(prog, x, mode, scale, atol, gtol):
    """Write how far below zero each margin may be before it counts as crossed.

    A margin compares numbers that are rounded: positions far from zero, a corner of a saturation. What their last
    digits make of it is no crossing.
    """
    for i in range(gtol.shape[0]):
        gtol[i] = 1e-12 * scale[i] + 1e-2 * atol
    for n in range(prog.nodes.shape[0]):
        kind, first, go, po = prog.nodes[n, KIND], prog.nodes[n, X], prog.nodes[n, G], prog.nodes[n, PAR]
        if kind == MECHANISM:
            if prog.ints[prog.nodes[n, AUX] + A_BODIES] == 2:
                rounding = GRAIN * (abs(x[first]) + abs(x[first + 2]))
                gtol[go + G_JOINT_LOW] += rounding
                gtol[go + G_JOINT_HIGH] += rounding
            gtol[go + G_WALL_LOW] += GRAIN * abs(prog.par[po + P_LOW])
            gtol[go + G_WALL_HIGH] += GRAIN * abs(prog.par[po + P_HIGH])
        elif kind == PWA:
            row = po + 4 * mode[prog.nodes[n, MODE]]
            for side in range(2):
                if abs(prog.par[row + side]) < math.inf:
                    gtol[go + side] += GRAIN * abs(prog.par[row + side])


@njit(cache=True, error_model="numpy", _nrt=False)
def _worst(g, gtol, scale, blocked):
    """Smallest margin, relative to its scale, and its index."""
    value, index = 1.0, -1
    for i in range(g.shape[0]):
        if i != blocked:
            v = (g[i] + gtol[i]) / scale[i]
            if v < value:
                value, index = v, i
    return value, index


@njit(cache=True, error_model="numpy", _nrt=False)
def run(
    prog, drive, clock, x, mode, t_end, tout, xout, yout, order, rtol, atol, hmax, locate, stop_at_event, watch,
    watch_level, watch_sign, height, max_steps, log_t, log_n, log_k, before, scale, fresh, space,
    spectrum, omega,
):  # fmt: skip
    """Run from clock[0] to t_end; see `ctrl_df.simulate.engine.Engine.run` for the arguments.

    ``clock``: [time, next output index, last step size, steps used, events so far, events in this log, segment,
    on section, margin of the last event]. ``before``: state just before the event that stopped the run.
    ``scale``: running scale of each margin. ``fresh``: 1 to settle modes first (a new state), 0 to go on.
    ``space``: scratch arrays of `workspace`.
    ``spectrum``: (ny, kmax + 1) complex, to which the integrals of y exp(-j k omega t) over the run are added; no
    columns, no integrals. Returns the reason (module constants).
    """
    work, k, poly, x1, xi, dx, size, g, g0, gtol, lowest, norm, owner, memo = space
    n, ng = x.shape[0], scale.shape[0]
    if fresh == 1:
        for j in range(n):
            size[j] = abs(x[j])
    for i in range(ng):
        g[i] = math.inf  # the section's margin must not outlive the run that watched it
    t, index, h = clock[0], int(clock[1]), clock[2]
    segment = int(clock[6])
    steps = 0
    events_here = 0
    # a run that goes on after a full event log goes on counting events without progress
    zero_events = int(memo[0]) if memo[2] == 1.0 else 0
    last_event_t = memo[1] if memo[2] == 1.0 else t
    bumpy = prog.ints[H_BUMP] == 1
    nt = drive.time.shape[0]
    held = nt > 0 and drive.linear == 0
    has_tracked = prog.ints[H_TRACK] == 1
    known = False  # k[0] holds the rates at (t, x)
    blocked = ng - 1 if clock[7] > 0.5 else -1
    reason = DONE
    if fresh == 1:
        tick(prog, drive, segment, t, x, mode, work)
        if not settle(prog, drive, segment, t, x, mode, work, dx):
            reason = CHATTER
    next_tick = next_sample(prog, t)
    while reason == DONE:
        while index < tout.shape[0] and tout[index] <= t:
            for j in range(n):
                xout[index, j] = x[j]
            record(prog, drive, segment, t, x, mode, work, yout[index])
            index += 1
        if t >= t_end:
            break
        if steps >= max_steps:
            reason = STEPS
            break
        # --- the next instant at which the inputs may jump or kink
        limit = t_end
        while segment + 1 < nt and drive.time[segment + 1] <= t:
            segment += 1
            if held:
                known = False
                settle(prog, drive, segment, t, x, mode, work, dx)
        if segment + 1 < nt:
            limit = min(limit, drive.time[segment + 1])
        limit = min(limit, next_tick)
        if not known:
            if locate:
                margins(
                    prog, drive, segment, t, x, mode, work, k[0], g0, max(1e-4 * h, 1e-9), watch, watch_level, watch_sign
                )
            else:
                rates(prog, drive, segment, t, x, mode, work, k[0], g0, False)
            known = True
        if h <= 0.0:
            h = _first_step(x, k[0], rtol, atol, limit - t, hmax)
        length = min(h, hmax)
        if bumpy:
            for j in range(n):
                x1[j] = x[j] + length * k[0, j]
            length *= bump_share(prog, x, x1)
        truncated = t + length >= limit - 1e-12 * max(abs(limit), length)
        if truncated:
            length = limit - t
        if locate:
            for i in range(ng):
                if g0[i] < math.inf:
                    scale[i] = max(scale[i], abs(g0[i]))
                lowest[i] = g0[i]
            tolerances(prog, x, mode, scale, atol, gtol)
            # margins already crossed at the start (simultaneous events)
            value, at = _worst(g0, gtol, scale, blocked)
            if at >= 0 and value < 0.0:
                if at == ng - 1:
                    blocked = at
                    continue
                theta = 0.0
                zero_events += 1
                if zero_events > 2000:
                    reason = CHATTER
                    break
            else:
                theta = 1.0
                at = -1
        else:
            theta = 1.0
            at = -1
        if theta > 0.0:
            steps += 1
            if order == 8:
                error = step8(
                    prog, drive, segment, t, length, x, mode, work, k, g, lowest, x1, size, rtol, atol, locate
                )
            else:
                error = step5(
                    prog, drive, segment, t, length, x, mode, work, k, g, lowest, x1, size, rtol, atol, locate
                )
            if not error < math.inf:
                h = 0.2 * length
                if not h >= 1e-13 * max(abs(t), 1e-3):
                    reason = NAN
                continue
            if error > 1.0:
                h = length * max(0.2, 0.9 * error ** (-1.0 / order))
                if t + h == t:
                    reason = TINY
                continue
            if bumpy:
                share = bump_share(prog, x, x1)
                if share < 0.7:
                    h = 0.9 * share * length
                    continue
            grow = 5.0 if error == 0.0 else min(5.0, 0.9 * error ** (-1.0 / order))
            h_next = length * max(grow, 0.3)
            if truncated:
                h_next = max(h_next, h)
            # --- events
            last = 6 if order == 5 else 12
            suspect = False
            if locate:
                if watch >= 0 or has_tracked:
                    margins(
                        prog, drive, segment, t + length, x1, mode, work, dx, g, 1e-4 * length, watch, watch_level,
                        watch_sign,
                    )  # fmt: skip
                for i in range(ng):
                    norm[i] = max(scale[i], abs(g[i])) if abs(g[i]) < math.inf else scale[i]
                    if i != blocked and (g[i] + gtol[i] < 0.0 or lowest[i] + gtol[i] < 0.0):
                        suspect = True
                if has_tracked or watch >= 0:
                    suspect = True
            needed = suspect or spectrum.shape[1] > 0 or (index < tout.shape[0] and tout[index] < t + length)
            if needed:
                if order == 8:
                    prepare8(prog, drive, segment, t, length, x, x1, mode, work, k, dx, poly)
                    rough = roughness(size, rtol, atol, poly)
                    if rough > 1.0:
                        h = length * max(0.3, 0.9 * rough ** (-0.125))
                        continue
                else:
                    prepare5(length, k, poly)
                if suspect:
                    theta, at = _locate(
                        prog, drive, segment, t, length, x, mode, work, order, poly, xi, dx, g, lowest, gtol, norm,
                        blocked, watch, watch_level, watch_sign, has_tracked or watch >= 0,
                    )  # fmt: skip
            if blocked >= 0 and locate and g[blocked] > gtol[blocked]:
                blocked = -1
            reached = t + theta * length if theta < 1.0 else (limit if truncated else t + length)
            # --- outputs inside the step
            if index < tout.shape[0] and tout[index] < reached:
                while index < tout.shape[0] and tout[index] < reached:
                    inside(order, (tout[index] - t) / length, x, poly, xi)
                    for j in range(n):
                        xout[index, j] = xi[j]
                    record(prog, drive, segment, tout[index], xi, mode, work, yout[index])
                    index += 1
            if spectrum.shape[1] > 0:
                accumulate(
                    prog, drive, segment, t, length, min(theta, 1.0), x, mode, work, order, poly, xi, spectrum, omega
                )  # fmt: skip
            if theta < 1.0:
                if theta > 0.0:
                    inside(order, theta, x, poly, x1)
                else:
                    copy(x, x1)
            t = reached
            copy(x1, x)
            for j in range(n):
                # a size that forgets slowly: tolerances do not tighten as a state swings through zero
                size[j] = max(abs(x[j]), 0.98 * size[j])
            h = h_next
            if at < 0:
                if locate:
                    copy(g, g0)
                copy(k[last], k[0])
                known = theta == 1.0
                if has_tracked:
                    track(prog, drive, segment, t, x, mode, work)
                if t == next_tick:
                    tick(prog, drive, segment, t, x, mode, work)
                    settle(prog, drive, segment, t, x, mode, work, dx)
                    next_tick = next_sample(prog, t)
                    known = False
                continue
        if theta < 1.0 and theta * length > 0.0:
            # a step that ran far beyond its event says little of what follows
            h = min(h, 3.0 * theta * length)
        # --- an event at (t, x)
        if at == ng - 1:
            blocked = at
            known = False
            if log_t.shape[0] > 0:
                reason = SECTION
            copy(x, before)
            continue
        if has_tracked:
            track(prog, drive, segment, t, x, mode, work)
        copy(x, before)
        node = owner[at]
        rates(prog, drive, segment, t, x, mode, work, dx, g, False)
        kind = event(
            prog, drive, segment, t, x, mode, work, dx, g, node, at - prog.nodes[node, G], height
        )
        known = False
        for i in range(prog.nodes[node, G], prog.nodes[node, G] + prog.nodes[node, NG]):
            scale[i] = 1e-3 * rtol  # the margins of the new mode are of another kind
        if not settle(prog, drive, segment, t, x, mode, work, dx):
            zero_events += 100
        if t - last_event_t > 1e-9 * max(abs(t), 1e-3):
            zero_events = 0
            last_event_t = t
        clock[4] += 1
        clock[8] = at
        if events_here < log_t.shape[0]:
            log_t[events_here] = t
            log_n[events_here] = node
            log_k[events_here] = kind
        events_here += 1
        if stop_at_event:
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


@njit(cache=True, error_model="numpy", _nrt=False)
def _first_step(x, dx, rtol, atol, room, hmax):
    """Estimate a first step from the size of state and rates (Hairer, Norsett & Wanner, II.4, step a)."""
    d0 = d1 = 0.0
    for j in range(x.shape[0]):
        scale = atol + rtol * abs(x[j])
        d0 += (x[j] / scale) ** 2
        d1 += (dx[j] / scale) ** 2
    h = 1e-6 if d0 < 1e-10 or d1 < 1e-10 else 0.01 * math.sqrt(d0 / d1)
    return min(max(h, 1e-9), hmax, room)


@njit(cache=True, error_model="numpy", _nrt=False)
def _locate(
    prog, drive, segment, t, length, x, mode, work, order, poly, xi, dx, g, lowest, gtol, scale, blocked, watch,
    watch_level, watch_sign, scan,
):  # fmt: skip
    """Fraction of the step at which the first margin crosses zero, and its index (1.0, -1: none).

    The inner stages of a step are crude; what they suspect is confirmed on the interpolant.
    """
    reach = 1e-4 * length
    left, right = 0.0, -1.0
    value_right, at = _worst(g, gtol, scale, blocked)
    value_left = 1.0
    inner = scan
    for i in range(g.shape[0]):
        if i != blocked and lowest[i] + gtol[i] < 0.0 <= g[i] + gtol[i]:
            inner = True
    end_value, end_at = value_right, at
    if inner or value_right < 0.0:
        # a margin may have gone below zero and come back before it went again: look from the left
        pieces = 12
        for p in range(1, pieces + 1):
            theta = p / pieces
            if p == pieces:
                value, at = end_value, end_at
            else:
                inside(order, theta, x, poly, xi)
                margins(prog, drive, segment, t + theta * length, xi, mode, work, dx, g, reach, watch,
                        watch_level, watch_sign)  # fmt: skip
                value, at = _worst(g, gtol, scale, blocked)
            if value < 0.0:
                right, value_right = theta, value
                break
            left, value_left = theta, value
    if right < 0.0:
        # g must again be the margins at the end of the step
        inside(order, 1.0, x, poly, xi)
        margins(prog, drive, segment, t + length, xi, mode, work, dx, g, reach, watch, watch_level, watch_sign)
        return 1.0, -1
    if left == 0.0:
        inside(order, 0.0, x, poly, xi)
        margins(prog, drive, segment, t, xi, mode, work, dx, g, reach, watch, watch_level, watch_sign)
        value_left, _ = _worst(g, gtol, scale, blocked)
    if value_left < 0.0:
        return 0.0, at
    if left == 0.0:
        # a flight or slip that began at this very point: its margin rises from zero before it falls
        for _halving in range(50):
            theta = 0.5 * right
            inside(order, theta, x, poly, xi)
            margins(prog, drive, segment, t + theta * length, xi, mode, work, dx, g, reach, watch, watch_level, watch_sign)
            value, index = _worst(g, gtol, scale, blocked)
            if value >= 0.0:
                left, value_left = theta, value
                break
            right, value_right, at = theta, value, index
    weight_left, weight_right, side = value_left, value_right, 0
    for iteration in range(100):
        width = right - left
        if width * length <= 2e-16 * max(abs(t), length) or width < 1e-15 or value_right > -1e-15:
            break
        # Illinois: a secant that cannot hang on one side, with a bisection now and then
        theta = left + width * weight_left / (weight_left - weight_right)
        if iteration % 5 == 4 or not left < theta < right:
            theta = 0.5 * (left + right)
        inside(order, theta, x, poly, xi)
        margins(prog, drive, segment, t + theta * length, xi, mode, work, dx, g, reach, watch, watch_level, watch_sign)
        value, index = _worst(g, gtol, scale, blocked)
        if value < 0.0:
            right, value_right, weight_right, at = theta, value, value, index
            if side < 0:
                weight_left *= 0.5
            side = -1
        else:
            left, weight_left = theta, value
            if side > 0:
                weight_right *= 0.5
            side = 1
    return right, at
