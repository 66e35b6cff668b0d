"""Affine modes on a regular grid: one constant propagator a step, as long as no event can lie inside.

The grid is that of the samples of the inputs, the times of the outputs and the ticks of controllers. With
z = (x, r, s, t, 1), r the external inputs and s their slopes, a mode obeys dz/dt = M z, so that a step of h
seconds takes z to exp(M h) z, a matrix computed once for each mode and length. A margin c z has the curvature
c M^2 z, hence stays within h^2/8 max |c M^2 z| of the chord between its ends; with |z| <= `bound` at the
start of a step, |c M^2| exp(|M| h) bound limits that curvature over all of it. A step at whose ends every
margin lies above this limit holds no event, for certain. The first that does not is left to the steps of
`ctrl_df.simulate.driver`.

The matrices are kept row by row, zeros left out. Bounds are taken element by element, so that units do not
matter.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from . import layout as L
from .affine import LENGTHS, Memory, recall
from .compiled import part
from .matrices import multiply
from .modes import settle
from .outputs import next_sample, record, tick

EPS = np.finfo(float).eps
ORDER = 16  # terms of an exponential's series
HALVINGS = 12  # of the step, at most, before its series is summed
NEAR = 1e-3  # times the tolerance: how far a step may be from a known length, relative to it
ALIKE = 1e-6  # relative difference of two steps below which they count as the same length

USABLE, USELESS = 1, 2  # entries of `Memory.ready`


class Glide(NamedTuple):
    """Propagators of the modes a `Memory` knows, one for each length, and scratch.

    Rows: states, margins, outputs.
    """

    length: np.ndarray  # (LENGTHS,): known steps [s]; 0: none
    newest: np.ndarray  # (1,): which was learnt last
    first: np.ndarray  # (SLOTS * LENGTHS, rows + 1): where a row begins in `column` and `value`
    column: np.ndarray  # (SLOTS * LENGTHS, room)
    value: np.ndarray  # (SLOTS * LENGTHS, room)
    margins: np.ndarray  # (SLOTS * LENGTHS,): how many a mode has; these come first in the following
    fed: np.ndarray  # (SLOTS * LENGTHS, margins): whether a row has entries of external inputs
    owner: np.ndarray  # (SLOTS * LENGTHS, margins): margin of a row
    curved: np.ndarray  # (SLOTS * LENGTHS, margins, nz): limits of curvature, times h^2/8, for each bound
    bound: np.ndarray  # (nz,)
    slack: np.ndarray  # (margins,)
    source: np.ndarray  # (margins,): rows of `Memory.rows` that a mode has, while its propagator is made
    here: np.ndarray  # z at the start of a step
    ahead: np.ndarray  # and at its end
    matrix: np.ndarray  # (5, nz, nz)


def glide_memory(memory: Memory, affine: bool, ny: int) -> Glide:
    """Allocate the propagators that go with a memory; small where its modes are not affine."""
    slots, n, nr = memory.b.shape
    used = slots * LENGTHS
    margins = memory.rows.shape[1] if affine else 0
    nz = n + 2 * nr + 2 if affine else 0
    rows = n + margins + ny if affine else 0
    return Glide(
        np.zeros(LENGTHS), np.zeros(1, np.int64), np.zeros((used, rows + 1), np.int64),
        np.zeros((used, rows * nz), np.int64), np.zeros((used, rows * nz)),
        np.zeros(used, np.int64), np.zeros((used, margins), np.int64), np.zeros((used, margins), np.int64),
        np.zeros((used, margins, nz)), np.zeros(nz), np.zeros(margins), np.zeros(margins, np.int64),
        np.zeros(nz), np.zeros(nz), np.zeros((5, nz, nz)),
    )  # fmt: skip


@part
def glide(prog, drive, work, store, tracks, slot, t, t_end, hmax, segment, index, x, mode, tout, xout, yout,
          size, scale, rtol, next_tick, x1, xi, dx, g):  # fmt: skip
    """Go on from `t` over as many steps as hold no event.

    Returns the number of steps gone, the time, the segment of the inputs, the next output's index, the time
    of the next tick, and whether a controller ticked at the end of the last step.
    """
    n, nr, ny = x.shape[0], prog.ints[L.H_NR], prog.ints[L.H_NY]
    time, nt = drive.time, drive.time.shape[0]
    here, ahead, bound, slack = tracks.here, tracks.ahead, tracks.bound, tracks.slack
    at, one = n + 2 * nr, n + 2 * nr + 1
    ramped = nt > 0 and drive.linear == 1
    done, ticked = 0, False
    stale = True  # the bounds, the slack and the margins at the start are to be taken anew
    for j in range(n):
        here[j] = x[j]
    for j in range(one):
        bound[j] = 0.0
    for j in range(n, at):
        here[j] = ahead[j] = 0.0
    here[one] = ahead[one] = bound[one] = 1.0
    before = -1
    while t < t_end:
        jumped = False
        while segment + 1 < nt and time[segment + 1] <= t:
            segment += 1
            jumped = not ramped
        t1 = _following(t, time, segment, tout, index, next_tick)
        near = NEAR * rtol * (t1 - t) + 2.0 * EPS * (abs(t) + abs(t1))
        which = _known(tracks, t1 - t, near)
        if which < 0 and t1 < t_end and done == 0 and t1 - t <= hmax:
            which = _learn_length(store, tracks, t, t1, near, time, segment, tout, index, next_tick)
        if which < 0 or t1 > t_end or t1 - t > hmax:
            break
        place = slot * LENGTHS + which
        if store.ready[place] == 0:
            _make(store, tracks, place, slot, tracks.length[which], n, nr, ny)
        if store.ready[place] == USELESS:
            break
        margins = tracks.margins[place]
        if place != before:
            stale, before = True, place
        # --- the inputs, and the bounds of all
        for k in range(nr):
            value = drive.harmonics[k, 0].real if drive.harmonics.shape[1] > 0 else 0.0
            if nt > 0:
                value += drive.samples[k, segment]
            here[n + k] = ahead[n + k] = value
            if ramped and segment + 1 < nt:
                slope = (drive.samples[k, segment + 1] - drive.samples[k, segment]) / (
                    time[segment + 1] - time[segment]
                )
                here[n + k] = value + slope * (t - time[segment])
                ahead[n + k] = value + slope * (t1 - time[segment])
                here[n + nr + k] = ahead[n + nr + k] = slope
        here[at], ahead[at] = t, t1
        for j in range(at + 1):
            if abs(here[j]) > bound[j]:
                bound[j] = 2.0 * abs(here[j])
                stale = True
        clear = True
        if stale:
            for m in range(margins):
                value = 0.0
                for j in range(one + 1):
                    value += tracks.curved[place, m, j] * bound[j]
                slack[m] = value
        # --- margins at the start, where they are not those at the end of the step before
        first, column, values = tracks.first[place], tracks.column[place], tracks.value[place]
        for m in range(margins):
            if stale or (jumped and tracks.fed[place, m] == 1):
                clear = clear and _row(first, column, values, n + m, here) > slack[m]
        if not clear:
            break
        stale = False
        # --- over the step
        for j in range(n):
            ahead[j] = _row(first, column, values, j, here)
            clear = clear and abs(ahead[j]) < math.inf
        for m in range(margins):
            owner, value = tracks.owner[place, m], _row(first, column, values, n + m, ahead)
            if not value > slack[m]:
                clear = False
                break
            scale[0, owner] = max(scale[0, owner], value)
        if not clear:
            break
        for j in range(n):
            x[j] = here[j] = ahead[j]
            size[j] = max(abs(ahead[j]), 0.98 * size[j])
        done += 1
        t = t1
        ticked = next_tick <= t1 + near
        due = index < tout.shape[0] and tout[index] <= t1 + near
        if ticked:
            tick(prog, drive, segment, t, x, mode, work, dx)
            next_tick = next_sample(prog, t)
            if due:
                settle(prog, drive, segment, t, x, mode, work, dx)
                record(prog, drive, segment, t, x, mode, work, yout[index])
            slot = recall(prog, store, mode, work, x1, xi, dx, g)
            stale = True
            for j in range(n):
                here[j] = x[j]
        elif due:
            for i in range(ny):
                yout[index, i] = _row(first, column, values, n + margins + i, ahead)
        if due:
            for j in range(n):
                xout[index, j] = x[j]
            index += 1
    return done, t, segment, index, next_tick, ticked


@part(inline=True)
def _row(first, column, values, row, z):
    """One row times z."""
    value = 0.0
    for i in range(first[row], first[row + 1]):
        value += values[i] * z[column[i]]
    return value


@part(inline=True)
def _following(t, time, segment, tout, index, next_tick):
    """Next point of the grid after `t`: a sample, an output, a tick. Points that rounding parts are one."""
    following = next_tick
    if segment + 1 < time.shape[0]:
        following = min(following, time[segment + 1])
    if index < tout.shape[0]:
        following = min(following, tout[index])
    if segment + 1 < time.shape[0] and time[segment + 1] <= following + 4.0 * EPS * (abs(t) + abs(following)):
        following = time[segment + 1]
    return following


@part(inline=True)
def _known(tracks, length, near):
    """Which of the known lengths a step has; -1: none."""
    for which in range(LENGTHS):
        if abs(tracks.length[which] - length) <= near:
            return which
    return -1


@part
def _learn_length(store, tracks, t, t1, near, time, segment, tout, index, next_tick):
    """Learn a new length of step in place of the older one, if steps go on like it; -1 if not."""
    ahead, s, i = t1, segment, index
    regular = False
    for _ in range(2):  # every step, or every other one
        while s + 1 < time.shape[0] and time[s + 1] <= ahead:
            s += 1
        while i < tout.shape[0] and tout[i] <= ahead:
            i += 1
        beyond = _following(ahead, time, s, tout, i, next_tick if next_tick > ahead else math.inf)
        regular = regular or abs((beyond - ahead) - (t1 - t)) <= ALIKE * (t1 - t)
        ahead = beyond
    if not regular:
        return -1
    length = t1 - t
    if time.shape[0] > 1:
        # the same wherever in the record a run begins
        mean = (time[time.shape[0] - 1] - time[0]) / (time.shape[0] - 1)
        share = mean / max(round(mean / length), 1.0)
        if abs(share - length) <= near:
            length = share
    which = (tracks.newest[0] + 1) % LENGTHS
    tracks.newest[0] = which
    tracks.length[which] = length
    for slot in range(store.ready.shape[0] // LENGTHS):
        store.ready[slot * LENGTHS + which] = 0
    return which


@part
def _make(store, tracks, place, slot, h, n, nr, ny):
    """Compute the propagator of a mode over `h` seconds."""
    nz = n + 2 * nr + 2
    at, one = nz - 2, nz - 1
    m, absolute, power, scratch = tracks.matrix[0], tracks.matrix[1], tracks.matrix[2], tracks.matrix[3]
    whole = tracks.matrix[4]
    for i in range(nz):
        for j in range(nz):
            m[i, j] = 0.0
    for i in range(n):
        for j in range(n):
            m[i, j] = store.a[slot, i, j]
        for k in range(nr):
            m[i, n + k] = store.b[slot, i, k]
        m[i, at], m[i, one] = store.d[slot, i], store.c[slot, i]
    for k in range(nr):
        m[n + k, n + nr + k] = 1.0
    m[at, one] = 1.0
    for i in range(nz):
        for j in range(nz):
            absolute[i, j] = abs(m[i, j])
    halvings = 0
    while halvings <= HALVINGS and not _exponential(absolute, h, halvings, whole, power, scratch):
        halvings += 1
    usable = halvings <= HALVINGS
    # --- limits of curvature: |c M^2| exp(|M| h) h^2 / 8
    count = 0
    for row in range(store.rows.shape[1]):
        if not usable or store.rows[slot, row, n + nr + 1] == math.inf:
            continue
        for j in range(nz):
            tracks.curved[place, count, j] = power[0, j] = power[1, j] = 0.0
        for i in range(nz):
            c = _entry(store.rows[slot, row], i, n, nr)
            if c != 0.0:
                for j in range(nz):
                    power[0, j] += c * m[i, j]
        for i in range(nz):
            if power[0, i] != 0.0:
                for j in range(nz):
                    power[1, j] += power[0, i] * m[i, j]
        for i in range(nz):
            bend = abs(power[1, i]) * h * h / 8.0
            if bend > 0.0:
                for j in range(nz):
                    tracks.curved[place, count, j] += bend * whole[i, j]
        for j in range(nz):
            usable = usable and tracks.curved[place, count, j] < math.inf
        tracks.owner[place, count] = store.owners[row]
        tracks.source[count] = row
        count += 1
    if not usable:
        store.ready[place] = USELESS
        return
    tracks.margins[place] = count
    _exponential(m, h, halvings, whole, power, scratch)
    # --- the rows, zeros left out: states, margins, outputs
    entries = 0
    tracks.first[place, 0] = 0
    for row in range(n + count + ny):
        for j in range(nz):
            if row < n:
                value = whole[row, j]
            elif row < n + count:
                value = _entry(store.rows[slot, tracks.source[row - n]], j, n, nr)
            else:
                value = _entry(store.outs[slot, row - n - count], j, n, nr)
            if value != 0.0:
                tracks.column[place, entries], tracks.value[place, entries] = j, value
                entries += 1
        tracks.first[place, row + 1] = entries
    for k in range(count):
        tracks.fed[place, k] = 0
        for j in range(n, n + nr):
            if _entry(store.rows[slot, tracks.source[k]], j, n, nr) != 0.0:
                tracks.fed[place, k] = 1
    store.ready[place] = USABLE


@part
def _entry(row, j, n, nr):
    """Entry over z of a row of `Memory.rows` or `Memory.outs`; slopes of inputs stand beside."""
    if j < n + nr:
        return row[j]
    return row[j - nr] if j >= n + 2 * nr else 0.0


@part
def _exponential(m, h, halvings, out, power, scratch):
    """Sum exp(m h / 2^halvings), squared as often; False where ORDER terms are too few for an element."""
    nz = m.shape[0]
    step = h / 2.0**halvings
    for i in range(nz):
        for j in range(nz):
            out[i, j] = power[i, j] = 1.0 if i == j else 0.0
    small = False
    for k in range(1, ORDER + 1):
        small = True
        multiply(m, power, scratch)
        for i in range(nz):
            for j in range(nz):
                power[i, j] = scratch[i, j] * step / k
                out[i, j] += power[i, j]
                small = small and abs(power[i, j]) <= 1e-3 * EPS * abs(out[i, j])
        if small:
            break
    for _ in range(halvings):
        multiply(out, out, scratch)
        for i in range(nz):
            for j in range(nz):
                out[i, j] = scratch[i, j]
    return small
