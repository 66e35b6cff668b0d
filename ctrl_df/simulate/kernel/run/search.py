# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""Whether a margin is crossed: at the begin of a step, or inside it."""

from __future__ import annotations

import math

from ...compiler.compiled import part
from ...dynamics.flow import rates
from ...thresholds import INPUT_REACH
from ..affine import crossing
from ..locate import NOW, complete, locate_event, margins, may_touch, renewed, tolerances, worst
from .progress import line_up
from .trial import first_step


@part(inline=True)
def evaluate_here(task, now, trial):
    """Take rates and margins at (t, x)."""
    prog, drive, x, mode, ws = task.prog, task.drive, task.x, task.mode, task.space
    watch, watch_level, watch_sign = task.watched
    renewed(prog, mode, task.scale, -1)  # a jump may have made a speed of a margin that was a force
    rates(prog, drive, now.segment, now.t, x, mode, ws.work, ws.k[0], ws.g0, task.locate)
    if task.locate and (now.tracked or watch >= 0):
        h = now.h if now.h > 0.0 else first_step(x, ws.k[0], trial.limit - now.t, now.hmax)
        complete(
            prog, drive, now.segment, now.t, x, mode, ws.work, ws.k[0], ws.g0, INPUT_REACH * h, watch,
            watch_level, watch_sign,
        )  # fmt: skip
    else:
        ws.g0[ws.g0.shape[0] - 1] = math.inf
    now.known = True


@part(inline=True)
def look_here(task, now, trial):
    """Find a margin that is crossed already (simultaneous events); False where all is to be taken again."""
    trial.theta, trial.at = 1.0, -1
    if not task.locate:
        return True
    scale, g0, gtol = task.scale, task.space.g0, task.space.gtol
    section = g0.shape[0] - 1
    for i in range(g0.shape[0]):
        if g0[i] < math.inf:
            scale[NOW, i] = max(scale[NOW, i], abs(g0[i]))
    tolerances(task.prog, task.x, task.mode, scale, gtol)
    now.armed = now.armed or (now.blocked != section and gtol[section] < g0[section] < math.inf)
    value, at = worst(g0, gtol, scale[NOW], now.blocked)
    if value < 0.0 and now.jumped:
        now.jumped = now.known = False
        line_up(task, now)
        return False
    now.jumped = False
    if at >= 0 and value < 0.0:
        if at == section and not now.armed:
            now.blocked = at  # started beyond the section
            return False
        trial.theta, trial.at = 0.0, at
    return True


@part(inline=True)
def look_inside(task, now, trial):
    """Find what may be an event in the step; where the flow is affine, find the event itself."""
    trial.suspect = False
    if not task.locate:
        return
    prog, mode, scale, ws, length = task.prog, task.mode, task.scale, task.space, trial.length
    watch, watch_level, watch_sign = task.watched
    for i in range(scale.shape[1]):
        ws.norm[i] = scale[NOW, i]
    if now.affine and watch < 0:
        trial.theta, trial.at = crossing(
            prog, ws.store, now.slot, mode, ws.work, length, trial.terms, ws.poly, ws.g0, ws.gtol, ws.norm,
            ws.g,
        )  # fmt: skip
        return
    if now.affine or watch >= 0 or now.tracked:
        margins(
            prog, task.drive, now.segment, now.t + length, ws.x1, mode, ws.work, ws.dx, ws.g,
            INPUT_REACH * length, watch, watch_level, watch_sign,
        )  # fmt: skip
        trial.suspect = True
    for i in range(scale.shape[1]):
        if abs(ws.g[i]) < math.inf:
            ws.norm[i] = max(scale[NOW, i], abs(ws.g[i]))
        if i != now.blocked and (
            ws.g[i] + ws.gtol[i] < 0.0 or (trial.rank == 8 and ws.lowest[i] + ws.gtol[i] < 0.0)
        ):
            trial.suspect = True
    trial.suspect = trial.suspect or may_touch(prog, task.x, ws.x1, mode, length)


@part(inline=True)
def find_event(task, now, trial):
    """Locate the first event of a step that may hold one."""
    ws = task.space
    if trial.suspect:
        watch, watch_level, watch_sign = task.watched
        trial.theta, trial.at = locate_event(
            task.prog, task.drive, now.segment, now.t, trial.length, task.x, task.mode, ws.work, trial.terms,
            ws.poly, ws.xi, ws.dx, ws.g, ws.gtol, ws.norm, now.blocked, watch, watch_level, watch_sign,
        )  # fmt: skip
    if now.blocked >= 0 and task.locate and ws.g[now.blocked] > ws.gtol[now.blocked]:
        now.blocked = -1
