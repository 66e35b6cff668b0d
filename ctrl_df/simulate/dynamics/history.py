# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""What a pure delay remembers: its input over the last `delay` seconds, as polynomials in a ring.

The history of each delay stands in the work vector: serial of the oldest record, of the next one, of the
record in use, then `RING` records. A record is one accepted step, or its part before an event: start [s],
length [s], generation, and the input at eight Chebyshev points, which keep all of a step's interpolant. A
record of generation g > 0 begins with a jump or kink that has passed a delay g - 1 times. Its arrival ends a
step, so that none runs across a kink; after `LAST_GENERATION` passages, each of which the plant smooths,
error control alone does.
"""

from __future__ import annotations

import math

import numpy as np

from ...thresholds import EPS
from ..compiler.compiled import part
from ..program.layout import AUX, DELAY, H_DELAYS, H_HISTORY, KIND, PAR
from ..program.layout import Y_POINTS as POINTS
from ..program.layout import Y_RECORD as RECORD
from ..program.layout import Y_RECORDS as RECORDS
from ..program.layout import Y_RING as RING
from ..program.layout import Y_VALUES as VALUES
from ..thresholds import AHEAD

LAST_GENERATION = 6
OLDEST, NEXT, NOW = range(3)
START, LENGTH, GENERATION = range(3)

NODES = 0.5 - 0.5 * np.cos(np.pi * np.arange(POINTS) / (POINTS - 1))
# barycentric weights of Chebyshev points of the second kind
WEIGHTS = (-1.0) ** np.arange(POINTS)
WEIGHTS[0], WEIGHTS[-1] = 0.5 * WEIGHTS[0], 0.5 * WEIGHTS[-1]


@part
def _record(base, serial):
    return base + RECORDS + (serial % RING) * RECORD


@part
def delayed(prog, node, t, w):
    """Input of a delay node one delay before `t`, read from that side of a jump the present step lies on."""
    base = prog.ints[prog.nodes[node, AUX]]
    past = t - prog.par[prog.nodes[node, PAR]]
    serial = int(w[base + NOW])
    while serial + 1 < int(w[base + NEXT]):
        following = _record(base, serial + 1)
        if w[following + GENERATION] > 0.0 or w[following + START] > past:
            break
        serial += 1
    at = _record(base, serial)
    theta = (past - w[at + START]) / w[at + LENGTH]
    above = below = 0.0
    for q in range(POINTS):
        d = theta - NODES[q]
        if d == 0.0:
            return w[at + VALUES + q]
        above += WEIGHTS[q] / d * w[at + VALUES + q]
        below += WEIGHTS[q] / d
    return above / below


@part
def begin(prog, node, t, value, w):
    """Start the history of a delay: its input was `value` at all times before `t`."""
    base, delay = prog.ints[prog.nodes[node, AUX]], prog.par[prog.nodes[node, PAR]]
    w[base + OLDEST] = w[base + NOW] = 0.0
    w[base + NEXT] = 1.0
    at = _record(base, 0)
    w[at + START], w[at + LENGTH], w[at + GENERATION] = t - 2.0 * delay, 2.0 * delay, 0.0
    for q in range(POINTS):
        w[at + VALUES + q] = value


@part
def advance(prog, t, h, limit, w):
    """Move every delay on to the record that leaves it at `t`.

    Returns the end of a step of about `h` from `t` that crosses no kink on its way out of a delay, and the
    generation (1 more) of the kink that leaves one right now (0: none).
    """
    arrived = 0.0
    limit_here = limit
    for n in range(prog.nodes.shape[0]):
        if prog.nodes[n, KIND] != DELAY:
            continue
        base, delay = prog.ints[prog.nodes[n, AUX]], prog.par[prog.nodes[n, PAR]]
        serial, following = int(w[base + NOW]), int(w[base + NEXT])
        near = 2.0 * EPS * (abs(t) + delay)
        while serial + 1 < following:
            at = _record(base, serial + 1)
            if w[at + START] + delay > t + near:
                break
            serial += 1
            generation = w[at + GENERATION]
            if generation > 0.0 and (arrived == 0.0 or generation + 1.0 < arrived):
                arrived = generation + 1.0
        w[base + NOW] = serial
        # steps no longer than the delay need no more history than there is
        limit_here = min(limit_here, t + delay)
        serial += 1
        while serial < following:
            at = _record(base, serial)
            arrival = w[at + START] + delay
            if arrival > t + AHEAD * h or arrival >= limit_here:
                break
            if w[at + GENERATION] > 0.0:
                limit_here = arrival
                break
            serial += 1
    return limit_here, arrived


@part
def room(prog, node, w):
    """Place in the work vector for the values of a delay's next record; -1 where the ring is full."""
    base = prog.ints[prog.nodes[node, AUX]]
    if w[base + NEXT] - w[base + OLDEST] >= RING:
        if w[base + OLDEST] >= w[base + NOW]:
            return -1
        w[base + OLDEST] += 1.0
    return _record(base, int(w[base + NEXT])) + VALUES


@part
def keep(prog, node, start, length, generation, w):
    """Close a delay's next record, whose values stand in its `room` already."""
    base = prog.ints[prog.nodes[node, AUX]]
    at = _record(base, int(w[base + NEXT]))
    w[at + START], w[at + LENGTH] = start, length
    w[at + GENERATION] = generation if generation <= LAST_GENERATION else 0.0
    w[base + NEXT] += 1.0


@part
def shortest(prog):
    """Shortest delay of a program [s]; inf without delays."""
    value = math.inf
    if prog.ints[H_DELAYS] > 0:
        for n in range(prog.nodes.shape[0]):
            if prog.nodes[n, KIND] == DELAY:
                value = min(value, prog.par[prog.nodes[n, PAR]])
    return value


def stored(prog, w) -> np.ndarray:
    """Return the part of a work vector that holds the history (no elements without delays)."""
    return w[int(prog.ints[H_HISTORY]) :]
