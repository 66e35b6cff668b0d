# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""What happens at an event: the section passed, or modes and states that change."""

from __future__ import annotations

from ....thresholds import FEW_ROUNDED
from ...compiler.compiled import part
from ...dynamics.matrices import copy
from ...dynamics.modes import event, track
from ...program.layout import G
from ...thresholds import AFTER_EVENT, INPUT_REACH, MARGIN_GROWTH, PROGRESS, UNSETTLED, ZENO
from ..locate import NOW, margins, renewed
from .progress import line_up
from .reasons import CHATTER, EVENT, FULL, SECTION


@part(inline=True)
def pass_event(task, now, trial, clock):
    """Pass the event at (t, x), and enter the mode after it."""
    reach = INPUT_REACH * now.h
    if trial.theta < 1.0 and trial.theta * trial.length > 0.0:
        # a step that ran far beyond its event says little of what follows
        now.h = max(min(now.h, AFTER_EVENT * trial.theta * trial.length), FEW_ROUNDED * abs(now.t))
    now.known = False
    if trial.at == task.scale.shape[1] - 1:
        now.blocked = trial.at
        if task.log.time.shape[0] > 0:
            now.reason = SECTION
        copy(task.x, task.before)
        return
    node, kind = _change_mode(task, now, trial.at, reach)
    if now.t - now.progressed > max(PROGRESS * abs(now.t), now.shortest):
        now.idle, now.progressed = 0, now.t
    clock[4] += 1
    clock[8] = trial.at
    _log(task, now, node, kind)


@part(inline=True)
def _change_mode(task, now, at, reach):
    """Let the event of margin `at` happen; returns its node and kind."""
    prog, drive, x, mode, ws = task.prog, task.drive, task.x, task.mode, task.space
    if now.tracked:
        track(prog, drive, now.segment, now.t, x, mode, ws.work, -1.0)
        margins(prog, drive, now.segment, now.t, x, mode, ws.work, ws.dx, ws.g, reach, -1, 0.0, 1)
    copy(x, task.before)
    node, modes = ws.owner[at], _signature(mode)
    kind = event(
        prog, drive, now.segment, now.t, x, mode, ws.work, ws.dx, ws.g, node, at - prog.nodes[node, G],
        task.accuracy.height, reach,
    )  # fmt: skip
    now.stale = 0
    now.generation = 1.0
    settled = line_up(task, now)
    if not settled:
        now.idle += UNSETTLED
    if settled and _signature(mode) == modes and _same(x, task.before):
        # nothing came of it: rounding alone crossed this margin, which thereby counts as larger
        task.scale[NOW, at] *= MARGIN_GROWTH
    else:
        renewed(prog, mode, task.scale, node)
    now.idle += 1
    return node, kind


@part(inline=True)
def _log(task, now, node, kind):
    """Write an event down; the run ends where too many happen at an instant, where asked to, or for room."""
    log = task.log
    room = log.time.shape[0]
    if now.events < room:
        log.time[now.events] = now.t
        log.node[now.events] = node
        log.kind[now.events] = kind
    now.events += 1
    if now.idle > ZENO:
        now.reason = CHATTER
    elif task.stop_at_event:
        now.reason = EVENT
    elif room > 1 and now.events >= room:
        now.reason = FULL


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
