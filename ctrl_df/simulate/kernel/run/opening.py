# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""A run opened, afresh or where the call before has left it, and closed for the next one to go on."""

from __future__ import annotations

import math

from ....thresholds import ROUNDED
from ...compiler.compiled import part
from ...dynamics.modes import take_branches
from ...program.layout import H_AFFINE, H_BUMP, H_DELAYS, H_TRACK
from ...thresholds import GAUSS_REACH, GAUSS_REACH_AFFINE, HARMONICS, SERIES_REACH
from ..locate import renewed
from ..outputs import next_sample, start_delays, tick
from ..propagators import forget_run
from .kept import GOES_ON, keep, take_up
from .progress import line_up
from .reasons import CHATTER, DONE


@part(inline=True)
def open_run(task, now, clock, fresh):
    """Set all numbers of a run; see `advance` for `clock` and `fresh`."""
    prog, drive, tout, ws = task.prog, task.drive, task.recording.times, task.space
    now.t, now.index, now.h, now.segment = clock[0], int(clock[1]), clock[2], int(clock[6])
    now.blocked = task.scale.shape[1] - 1 if clock[7] > 0.5 else -1
    now.steps = now.events = 0
    now.reason = DONE
    _know(task, now)
    if ws.memo[GOES_ON] == 1.0:
        take_up(now, ws.memo)
    else:
        _open_afresh(task, now)
    if fresh == 1:
        _begin(task, now)
    renewed(prog, task.mode, task.scale, -1)
    now.next_tick = next_sample(prog, drive, now.segment, now.t, task.t_end, tout, now.index)


@part(inline=True)
def _open_afresh(task, now):
    """Begin without anything that a call before may have left."""
    g = task.space.g
    now.idle, now.progressed = 0, now.t
    now.armed = now.known = now.jumped = False
    now.generation = 1.0
    now.slot = now.skip = now.wait = now.patience = now.stale = 0
    now.level = task.accuracy.order
    for i in range(g.shape[0]):
        g[i] = math.inf  # the section's margin must not outlive the run that watched it


@part(inline=True)
def _know(task, now):
    """Set what stays as it is."""
    prog, drive = task.prog, task.drive
    nt, nh = drive.time.shape[0], drive.harmonics.shape[1]
    now.hmax, now.shortest = task.accuracy.max_step, ROUNDED * (task.t_end - now.t)
    now.held = nt > 0 and drive.linear == 0
    now.tracked, now.bumpy = prog.ints[H_TRACK] == 1, prog.ints[H_BUMP] == 1
    now.delays, now.waves = prog.ints[H_DELAYS] > 0, task.spectrum.shape[1] > 0
    now.affine = prog.ints[H_AFFINE] == 1 and drive.address == 0 and nh <= HARMONICS
    now.curved = prog.ints[H_AFFINE] == 2 and drive.address == 0
    now.gliding = (
        task.space.paced[0] != 0
        and (now.affine or now.curved)
        and task.locate
        and task.watched.signal < 0
        and nh <= 1
        and task.recording.times.shape[0] + nt > 2
        and not now.waves
    )
    if now.affine and nh > 1 and drive.omega > 0.0:
        # the series of the forcing has to converge as well
        now.hmax = min(now.hmax, SERIES_REACH / ((nh - 1) * drive.omega))
    if now.waves and task.omega > 0.0:
        # so many radians of a wave are integrated at once
        reach = GAUSS_REACH_AFFINE if now.affine else GAUSS_REACH
        now.hmax = min(now.hmax, reach / (task.spectrum.shape[1] * task.omega))


@part(inline=True)
def _begin(task, now):
    """Bring a new state in line with its inputs, controllers and delays."""
    prog, drive, x, mode, ws = task.prog, task.drive, task.x, task.mode, task.space
    forget_run(ws.store, ws.tracks)
    for j in range(x.shape[0]):
        ws.size[j], ws.rounding[j] = abs(x[j]), 0.0
    if now.delays:
        start_delays(prog, drive, now.segment, now.t, x, mode, ws.work)
    take_branches(prog, x, mode)
    tout = task.recording.times
    if next_sample(prog, drive, now.segment, now.t, task.t_end, tout, now.index) < math.inf:
        # laws before a controller are in line with what it is to read
        line_up(task, now)
        tick(prog, drive, now.segment, now.t, x, mode, ws.work, ws.dx)
    if not line_up(task, now):
        now.reason = CHATTER
    if now.delays:
        start_delays(prog, drive, now.segment, now.t, x, mode, ws.work)


@part(inline=True)
def close_run(task, now, clock):
    """Write where the run has come to `clock`, and what the next call goes on from."""
    clock[0], clock[1], clock[2] = now.t, now.index, now.h
    clock[3] += now.steps
    clock[5] = now.events
    clock[6] = now.segment
    clock[7] = 1.0 if now.blocked >= 0 else 0.0
    keep(now, task.space.memo)
