# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""States and outputs written down at the times that were asked for, at and between the ends of steps."""

from __future__ import annotations

from ...compiler.compiled import part
from ...thresholds import ROUNDING
from ..outputs import record, record_inside
from .progress import line_up


@part(inline=True)
def record_due(task, now):
    """Record what is asked for at the present time."""
    tout, xout, yout = task.recording
    x, ws = task.x, task.space
    while now.index < tout.shape[0] and tout[now.index] <= now.t + ROUNDING * abs(now.t):
        if now.jumped:
            line_up(task, now)
        for j in range(x.shape[0]):
            xout[now.index, j] = x[j]
        record(task.prog, task.drive, now.segment, now.t, x, task.mode, ws.work, yout[now.index])
        now.index += 1


@part(inline=True)
def record_within(task, now, trial, reached):
    """Record what is asked for inside a step, of which the part until `reached` is gone."""
    tout, xout, yout = task.recording
    ws, length = task.space, trial.length
    while now.index < tout.shape[0] and tout[now.index] < reached - ROUNDING * abs(reached):
        record_inside(
            task.prog, task.drive, now.segment, now.t, (tout[now.index] - now.t) / length, length, task.x,
            task.mode, ws.work, trial.terms, ws.poly, xout[now.index], yout[now.index],
        )  # fmt: skip
        now.index += 1
