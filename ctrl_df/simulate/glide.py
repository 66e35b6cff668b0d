"""Uniform records through affine modes: one constant propagator a sample, as long as no event can lie inside.

With z = (x, r, s, t, 1), r the external inputs and s their slopes, a mode obeys dz/dt = M z, so that a sample
of h seconds takes z to exp(M h) z, a matrix computed once for each mode. A margin c z has the curvature
c M^2 z, hence stays within h^2/8 max |c M^2 z| of the chord between its ends; with |z| <= `bound` at the start
of a sample, |c M^2| exp(|M| h) bound limits that curvature over all of it. A sample at whose ends every margin
lies above this limit holds no event, for certain. The first that does not is left to the steps of
`ctrl_df.simulate.driver`.

The matrices are kept row by row, zeros left out. Bounds are taken element by element, so that units do not
matter.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from . import layout as L
from .affine import Memory, recall
from .compiled import part
from .outputs import next_sample, tick

EPS = np.finfo(float).eps
ORDER = 16  # terms of an exponential's series
HALVINGS = 12  # of the sample, at most, before its series is summed
UNEVEN = 1e-6  # difference of two samples, relative, from which on propagators are not worth their making
NEAR = 1e-3  # times the tolerance: how far samples may be from uniform, relative to one of them

SAMPLE, OFFSET = 0, 1  # entries of `Glide.span`
USABLE, USELESS = 1, 2  # entries of `Memory.ready`


class Glide(NamedTuple):
    """Propagators of the modes a `Memory` knows, and scratch. Rows: states, margins, outputs, states and
    outputs at the offset."""

    span: (
        np.ndarray
    )  # (2,): sample time [s] of the propagators, offset [s] of outputs behind a sample's start
    first: np.ndarray  # (SLOTS, rows + 1): where a row begins in `column` and `value`
    column: np.ndarray  # (SLOTS, room)
    value: np.ndarray  # (SLOTS, room)
    fed: np.ndarray  # (SLOTS, rows): whether a row has entries of external inputs
    owner: np.ndarray  # (SLOTS, rows): margin of a row, -1 where the mode has none
    curved: np.ndarray  # (SLOTS, margins, nz): limits of curvature, times h^2/8, for each bound
    bound: np.ndarray  # (nz,)
    slack: np.ndarray  # (margins,)
    here: np.ndarray  # z at the start of a sample
    ahead: np.ndarray  # and at its end
    matrix: np.ndarray  # (6, nz, nz)


def glide_memory(memory: Memory, affine: bool, ny: int) -> Glide:
    """Allocate the propagators that go with a memory; small where its modes are not affine."""
    used, n, nr = memory.b.shape
    margins = memory.rows.shape[1] if affine else 0
    nz = n + 2 * nr + 2 if affine else 0
    rows = 2 * n + margins + 2 * ny if affine else 0
    return Glide(
        np.zeros(2), np.zeros((used, rows + 1), np.int64),
        np.zeros((used, rows * nz), np.int64), np.zeros((used, rows * nz)), np.zeros((used, rows), np.int64),
        np.zeros((used, rows), np.int64), np.zeros((used, margins, nz)), np.zeros(nz), np.zeros(margins),
        np.zeros(nz), np.zeros(nz), np.zeros((6, nz, nz)),
    )  # fmt: skip


@part
def glide(prog, drive, work, store, tracks, slot, t_end, hmax, segment, index, x, mode, tout, xout, yout,
          size, scale, room, rtol, next_tick, x1, xi, dx, g):  # fmt: skip
    """Go on from the start of sample `segment` for as many samples as hold no event.

    Returns the number of samples gone, the next output's index, the time of the next tick, and whether a
    controller ticked at the end of the last.
    """
    n, nr, ny = x.shape[0], prog.ints[L.H_NR], prog.ints[L.H_NY]
    margins = store.rows.shape[1]
    time, nt = drive.time, drive.time.shape[0]
    here, ahead, bound, slack = tracks.here, tracks.ahead, tracks.bound, tracks.slack
    at, one = n + 2 * nr, n + 2 * nr + 1
    held = drive.linear == 0
    begin = time[segment]
    length = time[segment + 1] - begin
    uneven = segment + 2 < nt and abs(time[segment + 2] - time[segment + 1] - length) > UNEVEN * length
    if uneven or length > hmax:
        return 0, index, next_tick, False
    _set_span(store, tracks, length, segment, time, index, tout, rtol)
    h, offset = tracks.span[SAMPLE], tracks.span[OFFSET]
    whole = offset == h
    copied = False
    done, ticked = 0, False
    stale = True  # the bounds, the slack and the margins at the start are to be taken anew
    for j in range(n):
        here[j] = x[j]
        bound[j] = 0.0
    for j in range(n, one):
        bound[j] = 0.0
    here[one] = ahead[one] = bound[one] = 1.0
    outputs = n + margins
    while done < room and segment + 1 < nt and time[segment + 1] <= t_end:
        if store.ready[slot] == 0:
            _make(prog, store, tracks, slot, n, nr, ny)
        if store.ready[slot] == USELESS:
            break
        t0, t1 = time[segment], time[segment + 1]
        near = NEAR * rtol * h + 2.0 * EPS * (abs(t0) + abs(t1))
        if abs(t1 - t0 - h) > near or next_tick < t1 - near:
            break
        due = index < tout.shape[0] and tout[index] <= t1 + near
        if due and (
            abs(tout[index] - t0 - offset) > near
            or (index + 1 < tout.shape[0] and tout[index + 1] <= t1 + near)
        ):
            break
        # --- the inputs, and the bounds of all
        for k in range(nr):
            here[n + k] = ahead[n + k] = drive.samples[k, segment]
            if not held:
                ahead[n + k] = drive.samples[k, segment + 1]
                here[n + nr + k] = ahead[n + nr + k] = (ahead[n + k] - here[n + k]) / (t1 - t0)
        here[at], ahead[at] = t0, t1
        for j in range(at + 1):
            if abs(here[j]) > bound[j]:
                bound[j] = 2.0 * abs(here[j])
                stale = True
        clear = True
        if stale:
            for m in range(margins):
                value = 0.0
                for j in range(one + 1):
                    value += tracks.curved[slot, m, j] * bound[j]
                slack[m] = value
        # --- margins at the start, where they are not those at the end of the sample before
        first, column, values = tracks.first[slot], tracks.column[slot], tracks.value[slot]
        for m in range(margins):
            if tracks.owner[slot, n + m] >= 0 and (stale or (held and tracks.fed[slot, n + m] == 1)):
                if not _row(first, column, values, n + m, here) > slack[m]:
                    clear = False
                    break
        if not clear:
            break
        stale = False
        # --- over the sample
        for j in range(n):
            ahead[j] = _row(first, column, values, j, here)
        for m in range(margins):
            owner = tracks.owner[slot, n + m]
            if owner >= 0:
                value = _row(first, column, values, n + m, ahead)
                if not value > slack[m]:
                    clear = False
                    break
                scale[0, owner] = max(scale[0, owner], value)
        if not clear:
            break
        if due:
            if whole:
                for j in range(n):
                    xout[index, j] = ahead[j]
                for i in range(ny):
                    yout[index, i] = _row(first, column, values, outputs + i, ahead)
            else:
                for j in range(n):
                    xout[index, j] = _row(first, column, values, outputs + ny + j, here)
                for i in range(ny):
                    yout[index, i] = _row(first, column, values, outputs + ny + n + i, here)
            index += 1
        for j in range(n):
            here[j] = ahead[j]
            size[j] = max(abs(ahead[j]), 0.98 * size[j])
        done += 1
        segment += 1
        copied = True
        ticked = next_tick <= t1 + near
        if ticked:
            for j in range(n):
                x[j] = here[j]
            tick(prog, drive, segment - 1, t1, x, mode, work, dx)
            next_tick = next_sample(prog, t1)
            for j in range(n):
                here[j] = x[j]
            slot = recall(prog, store, mode, work, x1, xi, dx, g)
            stale = True
    if copied and not ticked:
        for j in range(n):
            x[j] = here[j]
    return done, index, next_tick, ticked


@part(inline=True)
def _row(first, column, values, row, z):
    """One row times z."""
    value = 0.0
    for i in range(first[row], first[row + 1]):
        value += values[i] * z[column[i]]
    return value


@part
def _set_span(store, tracks, h, segment, time, index, tout, rtol):
    """Take over another sample time or another offset of the outputs; the propagators are then of no use."""
    near = NEAR * rtol * h + 2.0 * EPS * (abs(time[segment]) + abs(time[segment + 1]))
    mean = (time[time.shape[0] - 1] - time[0]) / (time.shape[0] - 1)
    if abs(mean - h) <= near:
        h = mean  # the same wherever in the record a run begins
    offset = tracks.span[OFFSET]
    if index < tout.shape[0] and tout[index] <= time[segment + 1] + near:
        offset = tout[index] - time[segment]
        if abs(offset - h) <= near:
            offset = h
    known = tracks.span[SAMPLE] == h
    if known and abs(offset - tracks.span[SAMPLE]) <= near:
        offset = tracks.span[SAMPLE]
    if not known or abs(offset - tracks.span[OFFSET]) > near:
        if not known:
            tracks.span[SAMPLE] = h
        tracks.span[OFFSET] = offset
        for slot in range(store.ready.shape[0]):
            store.ready[slot] = 0


@part
def _make(prog, store, tracks, slot, n, nr, ny):
    """Compute the propagators of a mode."""
    nz, margins = n + 2 * nr + 2, store.rows.shape[1]
    at, one = nz - 2, nz - 1
    m, absolute, power, scratch = tracks.matrix[0], tracks.matrix[1], tracks.matrix[2], tracks.matrix[3]
    whole, part_way = tracks.matrix[4], tracks.matrix[5]
    h, offset = tracks.span[SAMPLE], tracks.span[OFFSET]
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
    for row in range(margins):
        for j in range(nz):
            tracks.curved[slot, row, j] = 0.0
        if not usable or not store.bases[slot, row] < math.inf:
            continue
        for j in range(nz):
            power[0, j] = power[1, j] = 0.0
        for i in range(nz):
            c = _entry(store, slot, row, i, n, nr)
            for j in range(nz):
                power[0, j] += c * m[i, j]
        for i in range(nz):
            for j in range(nz):
                power[1, j] += power[0, i] * m[i, j]
        for i in range(nz):
            bend = abs(power[1, i]) * h * h / 8.0
            if bend > 0.0:
                for j in range(nz):
                    tracks.curved[slot, row, j] += bend * whole[i, j]
        for j in range(nz):
            usable = usable and tracks.curved[slot, row, j] < math.inf
    if not usable:
        store.ready[slot] = USELESS
        return
    _exponential(m, h, halvings, whole, power, scratch)
    _exponential(m, offset, halvings, part_way, power, scratch)
    # --- the rows, zeros left out
    count = 0
    tracks.first[slot, 0] = 0
    total = 2 * n + margins + 2 * ny
    for row in range(total):
        tracks.fed[slot, row] = 0
        tracks.owner[slot, row] = -1
        if n <= row < n + margins and store.bases[slot, row - n] < math.inf:
            tracks.owner[slot, row] = store.owners[row - n]
        for j in range(nz):
            if row < n:
                value = whole[row, j]
            elif row < n + margins:
                value = _entry(store, slot, row - n, j, n, nr) if tracks.owner[slot, row] >= 0 else 0.0
            elif row < n + margins + ny:
                value = _output(store, slot, row - n - margins, j, n, nr)
            elif row < 2 * n + margins + ny:
                value = part_way[row - n - margins - ny, j]
            else:
                value = 0.0
                for i in range(nz):
                    value += _output(store, slot, row - 2 * n - margins - ny, i, n, nr) * part_way[i, j]
            if value != 0.0:
                tracks.column[slot, count], tracks.value[slot, count] = j, value
                count += 1
                if n <= j < n + nr:
                    tracks.fed[slot, row] = 1
        tracks.first[slot, row + 1] = count
    store.ready[slot] = USABLE


@part
def _entry(store, slot, row, j, n, nr):
    """Entry of a margin's row over z."""
    if j < n + nr:
        return store.rows[slot, row, j]
    if j < n + 2 * nr:
        return 0.0
    return store.rows[slot, row, n + nr] if j == n + 2 * nr else store.bases[slot, row]


@part
def _output(store, slot, row, j, n, nr):
    """Entry of an output's row over z."""
    if j < n + nr:
        return store.outs[slot, row, j]
    if j < n + 2 * nr:
        return 0.0
    return store.outs[slot, row, n + nr + (j - n - 2 * nr)]


@part
def _exponential(m, h, halvings, out, power, scratch):
    """Sum exp(m h / 2^halvings) and square it as often; False where ORDER terms are too few, by any element."""
    nz = m.shape[0]
    step = h / 2.0**halvings
    for i in range(nz):
        for j in range(nz):
            out[i, j] = power[i, j] = 1.0 if i == j else 0.0
    small = False
    for k in range(1, ORDER + 1):
        small = True
        for i in range(nz):
            for j in range(nz):
                value = 0.0
                for q in range(nz):
                    if m[q, j] != 0.0:
                        value += power[i, q] * m[q, j]
                scratch[i, j] = value * step / k
        for i in range(nz):
            for j in range(nz):
                power[i, j] = scratch[i, j]
                out[i, j] += scratch[i, j]
                small = small and abs(scratch[i, j]) <= 1e-3 * EPS * abs(out[i, j])
        if small:
            break
    for _ in range(halvings):
        for i in range(nz):
            for j in range(nz):
                value = 0.0
                for q in range(nz):
                    value += out[i, q] * out[q, j]
                scratch[i, j] = value
        for i in range(nz):
            for j in range(nz):
                out[i, j] = scratch[i, j]
    return small
