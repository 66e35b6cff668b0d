"""Modes on a regular grid: one constant propagator a step, as long as no event can lie inside.

The grid is that of the samples of the inputs, the times of the outputs and the ticks of controllers. With
z = (x, r, s, t, 1), r the external inputs and s their slopes, a mode obeys dz/dt = M z, so that a step of h
seconds adds (exp(M h) - 1) z, a matrix computed once for each mode and length. A margin c z has the curvature
c M^2 z, hence stays within h^2/8 max |c M^2 z| of the chord between its ends; with |z| <= `bound` at the
start of a step, |c M^2| exp(|M| h) bound limits that curvature over all of it. A step at whose ends every
margin lies above this limit holds no event, for certain. Where forces in balance cancel, or fast modes have
decayed, the limit is far above the curvature: the step is then made in equal parts, in which no mode turns or
decays by more than half a radian, and the margins at their ends tell whether it holds an event. The first
that may is left to the steps of `ctrl_df.simulate.kernel.driver`.

Where curved laws stand beside the affine ones, the step is one of `exponential`, and the margins at its
nodes, as close as those parts, tell whether it holds an event.

The matrices are kept row by row, zeros left out. Bounds are taken element by element, so that units do not
matter.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...thresholds import EPS
from ..compiler.compiled import part
from ..dynamics.flow import segment_from
from ..dynamics.matrices import multiply, row_times
from ..dynamics.mechanics import mechanism
from ..dynamics.modes import settle
from ..program import layout as L
from ..thresholds import (
    CHORD_ROOM,
    CURVATURE_EXCESS,
    CURVATURE_SHARE,
    CURVATURE_TERMS,
    EXPONENTIAL_HALVINGS,
    EXPONENTIAL_SHARE,
    EXPONENTIAL_TERMS,
    FADING,
    MADE_IN_STEPS,
    MILD,
    MORE_NODES,
    ORDER_PATIENCE,
    PACED_SHARE,
    PART_TURN,
    PARTS_LEAST,
    PARTS_MOST,
    RATE_SQUARINGS,
    SAME_LENGTH,
    STIFF,
    TICK,
    WORTH_MOST,
)
from .affine import AFFINE_RANKS, LENGTHS, RANKS, Memory, entry, forget_uses, ranks, recall
from .exponential import (
    begin_use,
    bent_step,
    contraction,
    make_bent,
    narrow,
    parts,
    renew,
)
from .outputs import next_sample, record, tick

USABLE, USELESS = 1, 2  # entries of `Memory.ready`
RANK, LEFT, WORTH = 2, 3, 4  # entries of `Bend.state`
COSTLY = -2  # in place of a propagator


class Propagators(NamedTuple):
    """Propagators of the modes a `Memory` knows, one for each length and rank, and scratch.

    Rows: states (unless laws are curved), margins, outputs.
    """

    length: np.ndarray  # (LENGTHS,): steps of this run [s]; of an earlier one: less than zero; 0: none
    newest: np.ndarray  # (1,): which was learnt last
    first: np.ndarray  # (SLOTS * LENGTHS * ranks, rows + 1): where a row begins in `column` and `value`
    column: np.ndarray  # (SLOTS * LENGTHS * ranks, room)
    value: np.ndarray  # (SLOTS * LENGTHS * ranks, room)
    fed: np.ndarray  # (SLOTS * LENGTHS * ranks, margins): whether a row has entries of external inputs
    count: np.ndarray  # (SLOTS * LENGTHS * ranks,): margins that the mode has
    active: np.ndarray  # (SLOTS * LENGTHS * ranks, margins): which these are
    owner: np.ndarray  # (SLOTS * LENGTHS * ranks, margins): margin of a row, -1 where the mode has none
    curved: np.ndarray  # (SLOTS * LENGTHS * ranks, margins, nz): limits of curvature times h^2/8, per bound
    bound: np.ndarray  # (nz,)
    slack: np.ndarray  # (margins,)
    parts: np.ndarray  # (SLOTS * LENGTHS * ranks,): of a step; where laws are curved whether they are enough
    node: np.ndarray  # (2, nz): z at the ends of two parts
    seen: np.ndarray  # (4, margins): margins there, the last second difference, and the margin before
    here: np.ndarray  # z at the start of a step
    ahead: np.ndarray  # and at its end
    matrix: np.ndarray  # (2, nz, nz)
    indptr: np.ndarray  # (nz + 1,): where a row of M begins in the next two
    columns: np.ndarray  # (nz * nz,)
    values: np.ndarray  # (nz * nz,)


def propagator_memory(memory: Memory, usable: bool, ny: int) -> Propagators:
    """Allocate the propagators that go with a memory; small where none can be used."""
    slots, n, nr = memory.b.shape
    used = memory.ready.shape[0]
    margins = memory.rows.shape[1] if usable else 0
    nz = n + 2 * nr + 2 if usable else 0
    rows = n + margins + ny if usable else 0
    return Propagators(
        np.zeros(LENGTHS), np.zeros(1, np.int64), np.zeros((used, rows + 1), np.int64),
        np.zeros((used, rows * nz), np.int64), np.zeros((used, rows * nz)),
        np.zeros((used, margins), np.int64), np.zeros(used, np.int64), np.zeros((used, margins), np.int64),
        np.zeros((used, margins), np.int64),
        np.zeros((used, margins, nz)), np.zeros(nz), np.zeros(margins),
        np.ones(used, np.int64), np.ones((2, nz)), np.zeros((4, margins)),
        np.zeros(nz + 3 * memory.acting.shape[0]), np.zeros(nz),
        np.zeros((2, nz, nz)), np.zeros(nz + 1, np.int64), np.zeros(nz * nz, np.int64), np.zeros(nz * nz),
    )  # fmt: skip


@part
def forget_run(store, tracks):
    """Begin a run like any other: nothing that its numbers depend on is left of an earlier one.

    Matrices are: they are the same whoever has them made.
    """
    forget_uses(store)
    for which in range(LENGTHS):
        tracks.length[which] = -abs(tracks.length[which])


@part
def propagate(prog, drive, work, store, tracks, slot, t, t_end, hmax, segment, index, x, mode, tout, xout,
              yout, size, scale, rtol, atol, long, rounding, next_tick, x1, xi, dx, g, bend):  # fmt: skip
    """Go on from `t` over as many steps as hold no event.

    `bend` goes with curved laws; where there are none it is None, and the branches that need it are not even
    compiled. `long` is a step that error control allowed before: where laws are curved, many short steps may
    not err more than the one long step they stand for.

    Returns the number of steps gone, the time, the segment of the inputs, the next output's index, the time
    of the next tick, whether a controller ticked at the end of the last step, and whether these steps have
    cost more than they save (see `_again`).
    """
    n, nr, ny = x.shape[0], prog.ints[L.H_NR], prog.ints[L.H_NY]
    margins = store.rows.shape[1]
    time, nt = drive.time, drive.time.shape[0]
    here, ahead, bound = tracks.here, tracks.ahead, tracks.bound
    node = mechanism(prog)
    at, one = n + 2 * nr, n + 2 * nr + 1
    ramped = nt > 0 and drive.linear == 1
    done, ticked, costly, whole = 0, False, False, True
    stale = True  # the bounds, the slack and the margins at the start are to be recomputed
    for j in range(n):
        here[j] = x[j]
    for j in range(one):
        bound[j] = 0.0
    for j in range(n, at):
        here[j] = ahead[j] = 0.0
    here[one] = ahead[one] = bound[one] = 1.0
    before = -1
    if bend is not None:
        begin_use(store, bend, slot)
    current = segment_from(drive, segment, t)
    jumped, segment = current > segment and not ramped, current
    direct = not ramped and prog.ints[L.H_DIRECT] == 1
    while t < t_end:
        t1 = _following(t, time, segment, tout, index, next_tick)
        near = SAME_LENGTH * rtol * (t1 - t) + 2.0 * EPS * (abs(t) + abs(t1))
        which = _known(tracks, t1 - t, near)
        if which < 0 and t1 < t_end and done == 0 and t1 - t <= hmax:
            which = _learn_length(store, tracks, t, t1, near, time, segment, tout, index, next_tick)
        if which < 0 or t1 > t_end or t1 - t > hmax:
            break
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
        # --- over the step
        if bend is not None:
            share = min(tracks.length[which] / long, PACED_SHARE) if long > 0.0 else PACED_SHARE
            state = bend.state[slot]
            if state[RANK] > 0.0:
                state[LEFT] -= 1.0
                if state[LEFT] <= 0.0:
                    state[RANK] -= 1.0
                    state[LEFT] = ORDER_PATIENCE
            place = (slot * LENGTHS + which) * RANKS + int(state[RANK])
            if store.ready[place] != USABLE or not share >= bent_step(
                prog, node, mode, store.acting, bend.push, bend.dx, bend.nodes, bend.slope[slot],
                state[0] != 0.0, bend.base[place], bend.gain[place], parts(store, place % RANKS),
                place == before, t, tracks.length[which], here, ahead, size, rounding, rtol, atol,
            ):  # fmt: skip
                place = _again(
                    prog, node, store, tracks, bend, slot, which, t, x, mode, rtol, atol, size, rounding,
                    share, ny,
                )  # fmt: skip
            costly = place == COSTLY
            if place < 0 or narrow(prog, x, ahead):
                break
            m = parts(store, place % RANKS)
            if tracks.parts[place] == 0 and tracks.count[place] > 0:  # events may hide between its nodes
                if place % RANKS + 1 < RANKS:
                    state[RANK], state[LEFT] = place % RANKS + 1, ORDER_PATIENCE
                break
            if not _clear(
                bend.nodes, store.pushed[slot], tracks.first[place], tracks.column[place],
                tracks.value[place], tracks.active[place], tracks.count[place], tracks.owner[place], here,
                ahead, scale, m, tracks.length[which] / m, n, nr, tracks.seen, place == before,
            ):  # fmt: skip
                break
            saved = max(tracks.length[which] / long, 1.0) if long > 0.0 else 1.0
            state[WORTH] = min(state[WORTH] + saved, WORTH_MOST)
        else:
            place = (slot * LENGTHS + which) * AFFINE_RANKS
            if store.ready[place] == 0:
                _make(store, tracks, None, place, slot, tracks.length[which], n, nr, ny)
            stale = stale or place != before
            whole = store.ready[place] == USABLE and _straight(
                here, ahead, bound, tracks.slack, tracks.curved[place], tracks.active[place],
                tracks.count[place], tracks.fed[place], tracks.owner[place], tracks.first[place],
                tracks.column[place], tracks.value[place], stale, jumped, scale, n,
            )  # fmt: skip
            if not whole:
                place += 1
                if store.ready[place] == 0:
                    _make(store, tracks, None, place, slot, tracks.length[which], n, nr, ny)
                if store.ready[place] == USELESS or not _in_parts(
                    here, ahead, tracks.node, tracks.seen, tracks.parts[place], tracks.length[which],
                    tracks.active[place], tracks.count[place], tracks.owner[place], tracks.first[place],
                    tracks.column[place], tracks.value[place], scale, n, nr,
                ):  # fmt: skip
                    break
            stale = False
        before = place
        for j in range(n):
            x[j] = here[j] = ahead[j]
            size[j] = max(abs(ahead[j]), FADING * size[j])
        done += 1
        t = t1
        current = segment_from(drive, segment, t)
        jumped, segment = current > segment and not ramped, current
        ticked = next_tick <= t1 + near
        due = index < tout.shape[0] and tout[index] <= t1 + near
        if ticked or (jumped and due and direct):
            if jumped:
                settle(prog, drive, segment, t, x, mode, work, dx)
            if ticked:
                tick(prog, drive, segment, t, x, mode, work, dx)
                next_tick = next_sample(prog, drive, segment, t, t_end, tout, index)
            if due:
                settle(prog, drive, segment, t, x, mode, work, dx)
                record(prog, drive, segment, t, x, mode, work, yout[index])
            slot = recall(prog, store, mode, work, x1, xi, dx, g)
            if bend is not None:
                begin_use(store, bend, slot)
            stale, before = True, -1
            for j in range(n):
                here[j] = x[j]
        elif due:
            first, column, values = tracks.first[place], tracks.column[place], tracks.value[place]
            row = margins if store.acting.shape[0] > 0 else n + margins
            for i in range(ny):
                yout[index, i] = row_times(first, column, values, row + i, ahead)
        if due:
            for j in range(n):
                xout[index, j] = x[j]
            index += 1
        if (
            bend is None
            and whole
            and next_tick == math.inf
            and not direct
            and 0 < segment < nt
            and t == time[segment]
        ):
            gone, index = _march(
                drive,
                tracks,
                place,
                which,
                t,
                t_end,
                rtol,
                segment - 1,
                index,
                x,
                tout,
                xout,
                yout,
                size,
                scale,
                n,
                nr,
                ny,
            )
            if gone > 0:
                segment += gone
                done += gone
                t, jumped = time[segment], not ramped
            stale = True  # what has stopped it is examined again
    return done, t, segment, index, next_tick, ticked, costly


@part
def _march(
    drive, tracks, place, which, t, t_end, rtol, segment, index, x, tout, xout, yout, size, scale, n, nr, ny
):  # fmt: skip
    """Go on from sample to sample as long as nothing but the inputs changes, every sample an output or none.

    These are the steps of `propagate`, without what it asks at each of them. `t` is the time of the sample
    after `segment`. Returns how many, and the next output's index.
    """
    time, samples = drive.time, drive.samples
    here, ahead, bound, slack = tracks.here, tracks.ahead, tracks.bound, tracks.slack
    curved, active, live, fed = (
        tracks.curved[place], tracks.active[place], tracks.count[place], tracks.fed[place],
    )  # fmt: skip
    owner, first, column = tracks.owner[place], tracks.first[place], tracks.column[place]
    values, length = tracks.value[place], tracks.length[which]
    at, first_segment, ramped = n + 2 * nr, segment, drive.linear == 1
    constant = drive.harmonics.shape[1] > 0
    while segment + 2 < time.shape[0]:
        t1 = time[segment + 2]
        near = SAME_LENGTH * rtol * (t1 - t) + 2.0 * EPS * (abs(t) + abs(t1))
        due = index < tout.shape[0] and tout[index] == t1
        if (
            t1 > t_end
            or abs(length - (t1 - t)) > near
            or (not due and index < tout.shape[0] and tout[index] <= t1 + near)
        ):
            break
        for k in range(nr):
            value = drive.harmonics[k, 0].real if constant else 0.0
            value += samples[k, segment + 1]
            here[n + k] = ahead[n + k] = value
            if ramped:
                slope = (samples[k, segment + 2] - samples[k, segment + 1]) / (t1 - t)
                ahead[n + k] = value + slope * (t1 - t)
                here[n + nr + k] = ahead[n + nr + k] = slope
        here[at], ahead[at] = t, t1
        if not _straight(
            here, ahead, bound, slack, curved, active, live, fed, owner, first, column, values, False,
            not ramped, scale, n,
        ):  # fmt: skip
            break
        for j in range(n):
            x[j] = here[j] = ahead[j]
            size[j] = max(abs(ahead[j]), FADING * size[j])
        if due:
            for i in range(ny):
                yout[index, i] = row_times(first, column, values, n + fed.shape[0] + i, ahead)
            for j in range(n):
                xout[index, j] = x[j]
            index += 1
        segment += 1
        t = t1
    return segment - first_segment, index


@part(inline=True)
def _straight(
    here, ahead, bound, slack, curved, active, live, fed, owner, first, column, values, stale, jumped, scale,
    n,
):  # fmt: skip
    """Take an affine step from `here` to `ahead`, fields of a `Propagators`; whether no event lies inside.

    `stale`: bounds, slack and the margins here are to be recomputed; `jumped`: the inputs have.
    """
    for j in range(here.shape[0] - 1):
        if abs(here[j]) > bound[j]:
            bound[j] = 2.0 * abs(here[j])
            stale = True
    if stale:
        for k in range(live):
            value = 0.0
            for j in range(here.shape[0]):
                value += curved[active[k], j] * bound[j]
            slack[k] = value
    # margins at the start, where they are not those at the end of the step before
    for k in range(live):
        m = active[k]
        if stale or (jumped and fed[m] == 1):
            if not row_times(first, column, values, n + m, here) > slack[k]:
                return False
    for j in range(n):
        ahead[j] = here[j] + row_times(first, column, values, j, here)
        if not abs(ahead[j]) < math.inf:
            return False
    for k in range(live):
        m = active[k]
        value = row_times(first, column, values, n + m, ahead)
        if not value > slack[k]:
            return False
        scale[0, owner[m]] = max(scale[0, owner[m]], value)
    return True


@part
def _in_parts(
    here, ahead, node, seen, parts, length, active, live, owner, first, column, values, scale, n, nr
):  # fmt: skip
    """Take an affine step in equal parts; whether no event lies inside, by the margins at their ends.

    Between two ends a margin stays within an eighth of its second difference there of the chord: of the
    largest beside, and what it changes by from one to the next. Twice as much is asked. (Of second
    differences alone those of a margin that bends one way and then the other cancel.)
    """
    nz = node.shape[1]
    for j in range(nz):
        node[0, j] = here[j]
    for k in range(live):
        seen[0, k] = row_times(first, column, values, n + active[k], node[0])
        if not seen[0, k] > 0.0:
            return False
    for at in range(1, parts + 1):
        before, now = node[(at - 1) % 2], node[at % 2]
        for j in range(n):
            now[j] = before[j] + row_times(first, column, values, j, before)
        gone = length * at / parts
        for k in range(nr):
            now[n + k] = here[n + k] + gone * here[n + nr + k]
            now[n + nr + k] = here[n + nr + k]
        now[nz - 2] = here[nz - 2] + gone
        for k in range(live):
            value = row_times(first, column, values, n + active[k], now)
            if not value > 0.0:
                return False
            if at > 1:
                turn = seen[0, k] - 2.0 * seen[1, k] + value
                if at > 2:
                    bent = max(abs(turn), abs(seen[2, k])) + abs(turn - seen[2, k])
                    lowest = min(min(seen[3, k], seen[0, k]), min(seen[1, k], value))
                    if not lowest > CHORD_ROOM * bent:
                        return False
                seen[2, k], seen[3, k] = turn, seen[0, k]
                seen[0, k] = seen[1, k]
            seen[1, k] = value
    for j in range(n):
        ahead[j] = node[parts % 2, j]
        if not abs(ahead[j]) < math.inf:
            return False
    for k in range(live):
        scale[0, owner[active[k]]] = max(scale[0, owner[active[k]]], seen[1, k])
    return True


@part
def _again(prog, node, store, tracks, bend, slot, which, t, x, mode, rtol, atol, size, rounding, share, ny):
    """Try again a curved step that failed: with matrices not made yet, with K recomputed, with more parts.

    What is tried does not hang on whether a run before this one has had matrices made: by how much the first
    ones err is not asked. Returns the propagator that it succeeded with, -1 where none will do, and `COSTLY`
    where matrices made for K have cost more than the steps by them were worth.
    """
    state, h = bend.state[slot], tracks.length[which]
    if state[WORTH] < -WORTH_MOST:
        state[WORTH] = state[RANK] = 0.0
        return COSTLY
    first = rank = int(state[RANK])
    lag, fresh, tried = -1.0, False, False
    before = math.inf
    while True:
        place = (slot * LENGTHS + which) * RANKS + rank
        error, made = 0.0, store.ready[place] == 0
        if made:
            _make(store, tracks, bend, place, slot, h, x.shape[0], store.b.shape[2], ny)
            if state[0] != 0.0:  # others may be there from an earlier run
                m = parts(store, rank)
                state[WORTH] -= x.shape[0] ** 3 * m * (m + 2) / MADE_IN_STEPS
        if store.ready[place] != USABLE:
            return -1
        if tried or made:
            error = bent_step(
                prog, node, mode, store.acting, bend.push, bend.dx, bend.nodes, bend.slope[slot],
                state[0] != 0.0, bend.base[place], bend.gain[place], parts(store, rank), False, t, h,
                tracks.here, tracks.ahead, size, rounding, rtol, atol,
            )  # fmt: skip
            if error <= share:
                state[RANK] = rank
                return place
        if not tried:
            error = 0.0
        tried = True
        if lag < 0.0:
            lag = contraction(prog, node, store, bend, slot, t, h, x, mode, size)
        if not fresh and lag > STIFF and renew(store, bend, slot):
            fresh = True
        elif rank + 1 < RANKS and error < MORE_NODES * before and not (fresh and lag > STIFF):
            rank += 1
            state[LEFT] = ORDER_PATIENCE
            before = error if error > 0.0 else math.inf
        elif not fresh and state[0] != 0.0 and lag > MILD and renew(store, bend, slot):
            fresh, rank, before = True, first, math.inf
        else:
            state[RANK] = 0.0
            return -1


@part
def _clear(nodes, pushed, first, column, values, active, count, owner, here, ahead, scale, m, sigma, n, nr,
           seen, goes_on):  # fmt: skip
    """Whether no event lies within a step with curved laws, by the margins at its nodes; see `_in_parts`.

    Of two parts there is one second difference: the step before, with `goes_on`, tells what it changes by.
    """
    nq, nz = pushed.shape[1], n + 2 * nr + 2
    for k in range(nr):
        nodes[0, n + k] = here[n + k]
        for node in range(1, m + 1):
            nodes[node, n + k] = here[n + k] + node * sigma * here[n + nr + k]
    for node in range(m + 1):
        nodes[node, nz - 2] = here[nz - 2] + node * sigma
    for j in range(n):
        nodes[0, j], nodes[m, j] = here[j], ahead[j]
    for a in range(count):
        i = active[a]
        before = now = turned = bent = 0.0
        lowest = math.inf
        for node in range(m + 1):
            value = row_times(first, column, values, i, nodes[node])
            for k in range(nq):
                value += pushed[i, k] * nodes[node, nz + k]
            if node > 1:
                turn = before - 2.0 * now + value
                if node == 2:
                    turned = seen[2, a] if goes_on else turn
                bent = max(bent, max(abs(turn), abs(turned)) + abs(turn - turned))
                turned = turn
            before, now = now, value
            lowest = min(lowest, value)
        seen[2, a] = turned
        if not lowest > CHORD_ROOM * bent:
            return False
        scale[0, owner[i]] = max(scale[0, owner[i]], now)
    return True


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
    """Which of the known lengths a step has, the newest first; -1: none."""
    which = tracks.newest[0]
    for _ in range(LENGTHS):
        if abs(tracks.length[which] - length) <= near:
            return which
        which = which - 1 if which > 0 else LENGTHS - 1
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
        regular = regular or abs((beyond - ahead) - (t1 - t)) <= TICK * (t1 - t)
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
    for which in range(LENGTHS):
        if tracks.length[which] == -length:
            tracks.newest[0] = which
            tracks.length[which] = length
            return which
    which = (tracks.newest[0] + 1) % LENGTHS
    tracks.newest[0] = which
    tracks.length[which] = length
    for place in range(store.ready.shape[0]):
        if place // ranks(store) % LENGTHS == which:
            store.ready[place] = 0
    return which


@part
def _make(store, tracks, bend, place, slot, h, n, nr, ny):
    """Compute the propagator of a mode over `h` seconds, and the rows of its margins and outputs."""
    nz, margins = n + 2 * nr + 2, store.rows.shape[1]
    tracks.count[place] = 0
    for row in range(margins):
        tracks.fed[place, row] = 0
        tracks.owner[place, row] = store.owners[row] if store.rows[slot, row, n + nr + 1] < math.inf else -1
        if tracks.owner[place, row] >= 0:
            tracks.active[place, tracks.count[place]] = row
            tracks.count[place] += 1
    tracks.first[place, 0] = 0
    begin = count = 0
    if bend is None:
        begin, count = n, _make_affine(store, tracks, place, slot, h, n, nr)
    else:
        turn = _largest_rate(store.a[slot], tracks.matrix, h / parts(store, place % RANKS))
        tracks.parts[place] = 1 if turn <= PART_TURN else 0
        if not make_bent(store, bend, place, slot, place % RANKS, h, n, nr):
            count = -1
    if count < 0:
        store.ready[place] = USELESS
        return
    for row in range(margins + ny):
        for j in range(nz):
            value = 0.0
            if row >= margins:
                value = entry(store.outs[slot, row - margins], j, n, nr)
            elif tracks.owner[place, row] >= 0:
                value = entry(store.rows[slot, row], j, n, nr)
                if value != 0.0 and n <= j < n + nr:
                    tracks.fed[place, row] = 1
            if value != 0.0:
                tracks.column[place, count], tracks.value[place, count] = j, value
                count += 1
        tracks.first[place, begin + row + 1] = count
    store.ready[place] = USABLE


@part
def _make_affine(store, tracks, place, slot, h, n, nr):
    """Compute exp(M h) - 1, row after row, and the limits of curvature; returns their entries (-1: none).

    Of the second rank it is that of a part of the step. What a step adds to two bodies in contact is the same
    to the last digit, as rows of one kind are.
    """
    nz = n + 2 * nr + 2
    _entries_of(store, tracks, slot, n, nr)
    if place % AFFINE_RANKS == 0:
        usable = _curvatures(store, tracks, place, slot, h, n, nr)
    else:
        needed = _largest_rate(store.a[slot], tracks.matrix, h) / PART_TURN
        usable = needed <= PARTS_MOST
        if usable:
            tracks.parts[place] = max(math.ceil(needed), PARTS_LEAST)
            h /= tracks.parts[place]
    halvings = 0
    while usable and not _exponential(tracks, h / 2.0**halvings, n):
        halvings += 1
        usable = halvings <= EXPONENTIAL_HALVINGS
    if not usable:
        return -1
    whole = tracks.matrix[0]
    for done in range(halvings):
        _double(whole, tracks.matrix[1], h / 2.0 ** (halvings - done), n, nr)
    # --- the rows, zeros left out
    count = 0
    for row in range(n):
        for j in range(nz):
            if whole[row, j] != 0.0:
                tracks.column[place, count], tracks.value[place, count] = j, whole[row, j]
                count += 1
        tracks.first[place, row + 1] = count
    return count


@part
def _largest_rate(a, scratch, h):
    """Return a bound on the spectral radius of `h` A that does not hang on units.

    That of the matrix of absolute values, by the trace of a power of it.
    """
    n = a.shape[0]
    now, ahead = scratch[0], scratch[1]
    for i in range(now.shape[0]):
        for j in range(now.shape[0]):
            now[i, j] = h * abs(a[i, j]) if i < n and j < n else 0.0
    for _ in range(RATE_SQUARINGS):
        multiply(now, now, ahead)
        now, ahead = ahead, now
    trace = 0.0
    for i in range(n):
        trace += now[i, i]
    return trace ** (1.0 / 2**RATE_SQUARINGS)


@part
def _entries_of(store, tracks, slot, n, nr):
    """Write M of a mode row by row, zeros left out."""
    nz, indptr, columns, values = n + 2 * nr + 2, tracks.indptr, tracks.columns, tracks.values
    count = 0
    for i in range(nz):
        indptr[i] = count
        for j in range(nz):
            value = 0.0
            if i < n and j < n:
                value = store.a[slot, i, j]
            elif i < n and j < n + nr:
                value = store.b[slot, i, j - n]
            elif i < n and j >= n + 2 * nr:
                value = store.d[slot, i] if j == nz - 2 else store.c[slot, i]
            elif (n <= i < n + nr and j == i + nr) or (i == nz - 2 and j == nz - 1):
                value = 1.0
            if value != 0.0:
                columns[count], values[count] = j, value
                count += 1
    indptr[nz] = count


@part
def _curvatures(store, tracks, place, slot, h, n, nr):
    """Write the limits of curvature, |c M^2| exp(|M| h) h^2 / 8; False where there are none."""
    nz, margins = n + 2 * nr + 2, store.rows.shape[1]
    indptr, columns, values = tracks.indptr, tracks.columns, tracks.values
    power, ahead = tracks.matrix[0, 0], tracks.matrix[0, 1]
    for row in range(margins):
        limit = tracks.curved[place, row]
        for j in range(nz):
            limit[j] = 0.0
        if tracks.owner[place, row] < 0:
            continue
        for j in range(nz):
            power[j] = entry(store.rows[slot, row], j, n, nr)
        for _ in range(2):
            _times(power, indptr, columns, values, ahead)
            for j in range(nz):
                power[j] = ahead[j]
        for j in range(nz):
            power[j] = limit[j] = abs(power[j]) * h * h / 8.0
        small = False
        for k in range(1, CURVATURE_TERMS + 1):
            for j in range(nz):
                ahead[j] = 0.0
            for i in range(nz):
                if power[i] != 0.0:
                    factor = power[i] * h / k
                    for at in range(indptr[i], indptr[i + 1]):
                        ahead[columns[at]] += factor * abs(values[at])
            small = True
            for j in range(nz):
                power[j] = ahead[j]
                limit[j] += power[j]
                small = small and power[j] <= CURVATURE_SHARE * limit[j] < math.inf
            if small:
                break
        if not small:
            return False
        for j in range(nz):
            limit[j] *= CURVATURE_EXCESS
    return True


@part
def _times(row, indptr, columns, values, out):
    """Write a row times a matrix kept without its zeros to `out`."""
    for j in range(out.shape[0]):
        out[j] = 0.0
    for i in range(row.shape[0]):
        if row[i] != 0.0:
            for at in range(indptr[i], indptr[i + 1]):
                out[columns[at]] += row[i] * values[at]


@part
def _exponential(tracks, h, n):
    """Sum the states' rows of exp(M h) - 1; False where so many terms are too few for an element."""
    indptr, columns, values = tracks.indptr, tracks.columns, tracks.values
    whole, power, ahead = tracks.matrix[0], tracks.matrix[1, 0], tracks.matrix[1, 1]
    nz = power.shape[0]
    for i in range(n):
        out = whole[i]
        for j in range(nz):
            out[j], power[j] = 0.0, 1.0 if i == j else 0.0
        small = False
        for k in range(1, EXPONENTIAL_TERMS + 1):
            _times(power, indptr, columns, values, ahead)
            factor = h / k
            small = True
            for j in range(nz):
                power[j] = ahead[j] * factor
                out[j] += power[j]
                small = small and abs(power[j]) <= EXPONENTIAL_SHARE * EPS * abs(out[j])
            if small:
                break
        if not small:
            return False
    return True


@part
def _double(whole, scratch, h, n, nr):
    """Double the time of the states' rows of exp(M h) - 1; those of inputs and time are known."""
    at, one = n + 2 * nr, n + 2 * nr + 1
    for i in range(n):
        for j in range(one + 1):
            scratch[i, j] = 2.0 * whole[i, j]
        for k in range(nr):
            scratch[i, n + nr + k] += h * whole[i, n + k]
        scratch[i, one] += h * whole[i, at]
        for q in range(n):
            if whole[i, q] != 0.0:
                for j in range(one + 1):
                    scratch[i, j] += whole[i, q] * whole[q, j]
    for i in range(n):
        for j in range(one + 1):
            whole[i, j] = scratch[i, j]
