# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""What a run does at given instants: controllers tick, outputs are recorded, integrated, remembered."""

from __future__ import annotations

import math

import numpy as np

from ..compiler.compiled import part
from ..dynamics import history
from ..dynamics.flow import combine, external, node_input, refresh, segment_from, signals
from ..dynamics.modes import advance_state, answers_at_once, hold, keep_output, settle
from ..program.layout import (
    DELAY,
    FEED,
    H_DELAYS,
    H_NS,
    H_NY,
    H_OUT,
    H_TRACK,
    KIND,
    NIN,
    NOUT,
    NX,
    PAR,
    SAMPLED,
)
from ..thresholds import GAUSS, GAUSS_FEW, GAUSS_REACH_FEW, TICK
from .stepper import inside

NODES, WEIGHTS = np.zeros((2, GAUSS)), np.zeros((2, GAUSS))
"""Of the quadrature over a step, from zero to one, by few nodes and by many."""
for _row, _count in enumerate((GAUSS_FEW, GAUSS)):
    _nodes, _weights = np.polynomial.legendre.leggauss(_count)
    NODES[_row, :_count], WEIGHTS[_row, :_count] = 0.5 + _nodes / 2, _weights / 2


@part
def next_sample(prog, drive, segment, t, t_end, tout, index):
    """Time of the next tick of any sampled controller.

    A tick that misses a sample of the inputs, an output time or the end by rounding alone falls on that.
    """
    nearest, period = math.inf, 0.0
    for n in range(prog.nodes.shape[0]):
        if prog.nodes[n, KIND] == SAMPLED:
            dt = prog.par[prog.nodes[n, PAR] + _sampled_size(prog, n)]
            following = (math.floor(t / dt + TICK) + 1.0) * dt
            if following < nearest:
                nearest, period = following, dt
    if nearest == math.inf:
        return nearest
    near = 0.5 * TICK * period
    if abs(nearest - t_end) < near:
        return t_end
    last = segment_from(drive, segment, nearest + near)
    if last > segment and drive.time[last] > nearest - near:
        return drive.time[last]
    while index < tout.shape[0] and tout[index] <= nearest - near:
        index += 1
    if index < tout.shape[0] and tout[index] < nearest + near:
        return tout[index]
    return nearest


@part
def _sampled_size(prog, n):
    """Floats of a sampled node's matrices; its period follows them."""
    no = prog.nodes[n, NOUT]
    nd, ni = prog.nodes[n, NX] - no, prog.nodes[n, NIN]
    return nd * nd + nd * ni + no * nd + no * ni


@part
def tick(prog, drive, segment, t, x, mode, work, dx):
    """Run the sampled controllers whose tick falls on `t`.

    One without a direct path (D = 0) knows its output before it reads: it puts it out first, and what answers
    at once (a law without time, the direct path of a plant) is read afterwards, as u[k] = C x[k], y[k] =
    f(u[k]), x[k+1] = A x[k] + B y[k] have it. One with a direct path reads what stands there just before its
    tick. External inputs that jump at the tick have jumped.
    """
    w = work[0]
    late = False
    for n in range(prog.nodes.shape[0]):
        if prog.nodes[n, KIND] == SAMPLED and _ticks(prog, n, t) and not answers_at_once(prog, n):
            hold(prog, n, x, w)
            late = True
    if late:
        settle(prog, drive, segment, t, x, mode, work, dx)
    for n in range(prog.nodes.shape[0]):
        if prog.nodes[n, KIND] == SAMPLED and _ticks(prog, n, t) and answers_at_once(prog, n):
            refresh(prog, drive, segment, t, x, mode, w)
            hold(prog, n, x, w)
            advance_state(prog, n, x, w)
    if late:
        for n in range(prog.nodes.shape[0]):
            if prog.nodes[n, KIND] == SAMPLED and _ticks(prog, n, t) and not answers_at_once(prog, n):
                refresh(prog, drive, segment, t, x, mode, w)
                advance_state(prog, n, x, w)


@part
def _ticks(prog, n, t):
    """Whether a tick of this sampled node falls on `t`."""
    dt = prog.par[prog.nodes[n, PAR] + _sampled_size(prog, n)]
    return abs(t / dt - round(t / dt)) < TICK


@part
def record(prog, drive, segment, t, x, mode, work, y):
    """System outputs at one point."""
    w = work[0]
    external(prog, drive, t, segment, w)
    signals(prog, t, x, mode, w)
    for i in range(y.shape[0]):
        y[i] = combine(prog, prog.ints[prog.ints[H_OUT] + i], w)


@part
def record_inside(prog, drive, segment, t, theta, length, x, mode, work, terms, poly, xout, yout):
    """States and outputs at a fraction of a step."""
    inside(terms, theta, x, poly, xout)
    record(prog, drive, segment, t + theta * length, xout, mode, work, yout)
    if prog.ints[H_TRACK] == 1:
        for n in range(prog.nodes.shape[0]):
            keep_output(prog, n, xout, work[0])


@part
def accumulate(prog, drive, segment, t, length, theta, x, mode, work, terms, poly, xi, spectrum, omega):
    """Add a step's share of the integrals of the outputs against exp(-j k omega t), by Gauss' quadrature.

    The nodes lie in pairs about the middle of the step, and so do the phases of the waves there.
    """
    w, driven = work[0], _driven(prog)
    row, count = 1, GAUSS
    if spectrum.shape[1] * omega * theta * length < GAUSS_REACH_FEW:
        row, count = 0, GAUSS_FEW
    middle = omega * (t + 0.5 * theta * length)
    center, aside = complex(math.cos(middle), -math.sin(middle)), complex(1.0, 0.0)
    for step in range(count):
        i = step // 2 if step % 2 == 0 else count - 1 - step // 2
        at = theta * NODES[row, i]
        time = t + at * length
        inside(terms, at, x, poly, xi)
        if driven:
            external(prog, drive, time, segment, w)
        signals(prog, time, xi, mode, w)
        share = theta * length * WEIGHTS[row, i]
        if step % 2 == 0:
            angle = omega * (NODES[row, i] - 0.5) * theta * length
            aside = complex(math.cos(angle), -math.sin(angle))
        else:
            aside = aside.conjugate()
        turn = center * aside
        for output in range(spectrum.shape[0]):
            value = share * combine(prog, prog.ints[prog.ints[H_OUT] + output], w)
            rotation = complex(1.0, 0.0)
            for harmonic in range(spectrum.shape[1]):
                spectrum[output, harmonic] += value * rotation
                rotation *= turn


@part
def _driven(prog):
    """Whether signals or outputs follow external inputs without a state between."""
    for n in range(prog.nodes.shape[0]):
        if prog.nodes[n, FEED] == 1:
            return True
    for i in range(prog.ints[H_NY]):
        row = prog.ints[prog.ints[H_OUT] + i]
        for j in range(row + 1, row + 1 + 2 * prog.ints[row], 2):
            if prog.ints[j] >= prog.ints[H_NS]:
                return True
    return False


@part
def start_delays(prog, drive, segment, t, x, mode, work):
    """Begin the history of every delay: its input has always been what it is now."""
    w = work[0]
    for n in range(prog.nodes.shape[0]):
        if prog.nodes[n, KIND] == DELAY:
            history.begin(prog, n, t, 0.0, w)
    # a delay behind a delay learns its input one pass later
    for _pass in range(prog.ints[H_DELAYS]):
        refresh(prog, drive, segment, t, x, mode, w)
        for n in range(prog.nodes.shape[0]):
            if prog.nodes[n, KIND] == DELAY:
                history.begin(prog, n, t, node_input(prog, n, 0, w), w)


@part
def remember(prog, drive, segment, t, length, theta, generation, x, mode, work, terms, poly, xi):
    """Keep the inputs of all delays over the fraction `theta` of a step; False if there is no room."""
    w = work[0]
    span = theta * length
    if span <= 0.0:
        return True
    for q in range(history.POINTS):
        at = theta * history.NODES[q]
        inside(terms, at, x, poly, xi)
        refresh(prog, drive, segment, t + at * length, xi, mode, w)
        for n in range(prog.nodes.shape[0]):
            if prog.nodes[n, KIND] == DELAY:
                # the values are written while the record is still closed, so that no signal reads it
                place = history.room(prog, n, w)
                if place < 0:
                    return False
                w[place + q] = node_input(prog, n, 0, w)
    for n in range(prog.nodes.shape[0]):
        if prog.nodes[n, KIND] == DELAY:
            history.keep(prog, n, t, span, generation, w)
    return True
