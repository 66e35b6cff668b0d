# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""A step that is tried: how long it is, its method, whether its error is allowed, the state inside it."""

from __future__ import annotations

import math

from ....thresholds import ROUNDED
from ...compiler.compiled import part
from ...dynamics.modes import some_input_jumped
from ...thresholds import (
    BUMP_KEPT,
    DENSE,
    FIRST_BLIND,
    FIRST_CHANGE,
    FIRST_LEAST,
    GROWS_5,
    GROWS_8,
    ORDER_PATIENCE,
    ROUNDING_STEPS,
    SAMPLES_DENSER,
    STEP_GROWTH,
    STEP_SAFETY,
    STEP_SHRINK,
    WAVE_ROUGH,
)
from ..affine import forced, series, shrink
from ..locate import bump_share
from ..stepper import inside, prepare, prepare8, rate_rounding, roughness, step
from .reasons import NAN, TINY


@part
def first_step(x, dx, remaining, hmax):
    """Estimate a first step: the time in which some state changes by a hundredth of itself.

    States that begin at zero tell nothing; where all do, a millionth of the time ahead is tried.
    """
    h = math.inf
    for j in range(x.shape[0]):
        if x[j] != 0.0 and dx[j] != 0.0:
            h = min(h, FIRST_CHANGE * abs(x[j] / dx[j]))
    span = min(remaining, hmax)
    return min(max(h, FIRST_LEAST * span), span) if h < math.inf else FIRST_BLIND * span


@part(inline=True)
def try_step(task, now, trial):
    """Step from x to x1; False where that was too far, or led nowhere (`now.h`, `now.reason`)."""
    now.steps += 1
    trial.prepared = False
    trial.terms = trial.rank = 0
    _choose_length(task, now, trial)
    if now.affine:
        if not _step_by_series(task, now, trial):
            return False
    elif not _step_by_stages(task, now, trial):
        return False
    return not _runs_across_jump(task, now, trial)


@part(inline=True)
def _choose_length(task, now, trial):
    """Set the length of a step."""
    x, ws = task.x, task.space
    remaining = trial.limit - now.t
    length = min(now.h, now.hmax)
    if now.affine and now.h <= 0.0:
        length = min(remaining, now.hmax)
    elif now.h <= 0.0:
        length = now.h = first_step(x, ws.k[0], remaining, now.hmax)
    if now.bumpy:
        for j in range(x.shape[0]):
            ws.x1[j] = x[j] + length * ws.k[0, j]
        length *= bump_share(task.prog, x, ws.x1)
    trial.truncated = now.t + length >= trial.limit - ROUNDED * max(abs(trial.limit), length)
    trial.length = remaining if trial.truncated else length


@part(inline=True)
def _step_by_series(task, now, trial):
    """Step by the power series of an affine flow, as far as it converges; False: the rates are NaN."""
    prog, drive, ws = task.prog, task.drive, task.space
    rtol, atol = task.accuracy.rtol, task.accuracy.atol
    least = forced(prog, drive, now.segment, now.t, trial.length, rtol, ws.store)
    terms, share = series(
        ws.store, now.slot, trial.length, least, ws.k[0], ws.size, rtol, atol, ws.poly
    )  # fmt: skip
    if not share > 0.0:
        now.reason = NAN
        return False
    if share < 1.0:
        shrink(ws.store, share, terms, ws.poly)
        trial.length *= share
        trial.truncated = False
    inside(terms, 1.0, task.x, ws.poly, ws.x1)
    trial.terms, trial.prepared = terms, True
    # a step costs the same however long: only an event cuts the next one short
    trial.following = max(now.h, STEP_GROWTH * trial.length)
    return True


@part(inline=True)
def _step_by_stages(task, now, trial):
    """Step by a Runge-Kutta method; False where its error is not allowed."""
    prog, drive, x, mode, ws = task.prog, task.drive, task.x, task.mode, task.space
    order, rtol, atol, length = task.accuracy.order, task.accuracy.rtol, task.accuracy.atol, trial.length
    for i in range(ws.g.shape[0]):
        ws.lowest[i] = ws.g0[i]
    if now.stale == 0:
        rate_rounding(
            prog, drive, now.segment, now.t, length, x, mode, ws.work, ws.k[0], ws.size, ws.x1, ws.dx, ws.g,
            ws.rounding,
        )  # fmt: skip
        now.stale = ROUNDING_STEPS
    now.stale -= 1
    # samples much denser than the motion: a cheaper pair does
    dense = (
        task.drive.time.shape[0] > 0
        and not now.delays
        and trial.truncated
        and now.h >= SAMPLES_DENSER * length
    )
    trial.rank = now.level if dense else order
    error = step(
        trial.rank, prog, drive, now.segment, now.t, length, x, mode, ws.work, ws.k, ws.g, ws.lowest, ws.x1,
        ws.size, ws.rounding, rtol, atol, task.locate,
    )  # fmt: skip
    if trial.rank < order and not _cheaper_does(now, trial, order, error):
        return False
    now.patience = max(now.patience - 1, 0)
    if trial.truncated and trial.rank == now.level and now.patience == 0 and error < DENSE * length / now.h:
        now.level = 5 if now.level == 8 else 3
    if not _is_allowed(now, length, order, error):
        return False
    if now.bumpy:
        share = bump_share(prog, x, ws.x1)
        if share < BUMP_KEPT:
            now.h = STEP_SAFETY * share * length
            return False
    _grow(now, trial, order, error)
    return True


@part(inline=True)
def _cheaper_does(now, trial, order, error):
    """Whether a pair of lower order does: many short steps may not err more than the long one they are."""
    if error <= min(trial.length / now.h, 1.0):
        return True
    now.level = 8 if trial.rank == 5 else min(order, 5)
    now.patience = ORDER_PATIENCE
    return False


@part(inline=True)
def _is_allowed(now, length, order, error):
    """Whether the error of a step is within the tolerance; where it is not, the next one is shorter."""
    if not error < math.inf:
        now.h = STEP_SHRINK * length
        if not now.h >= max(ROUNDED * abs(now.t), now.shortest):
            now.reason = NAN
        return False
    if error > 1.0:
        now.h = length * max(STEP_SHRINK, STEP_SAFETY * error ** (-1.0 / order))
        if now.t + now.h == now.t:
            now.reason = TINY
        return False
    return True


@part(inline=True)
def _grow(now, trial, order, error):
    """Choose the step that follows one that was right."""
    trial.following = now.h
    if trial.rank == order:
        grow = STEP_GROWTH
        if error > (GROWS_8 if order == 8 else GROWS_5):
            grow = min(STEP_GROWTH, STEP_SAFETY * error ** (-1.0 / order))
        trial.following = trial.length * grow
        if trial.truncated:
            trial.following = max(trial.following, now.h)


@part(inline=True)
def _runs_across_jump(task, now, trial):
    """Whether an input jumps within the step: half of it is next, until the jump stands at its end.

    Only inputs that are functions may jump anywhere.
    """
    length = trial.length
    if now.tracked and task.locate and task.drive.address != 0:
        if length > max(ROUNDED * abs(now.t), now.shortest) and some_input_jumped(
            task.prog, task.drive, now.segment, now.t + length, task.x, task.space.x1, task.mode,
            task.space.work, length,
        ):  # fmt: skip
            now.h = 0.5 * length
            return True
    return False


@part(inline=True)
def interpolate(task, now, trial):
    """Prepare the interpolant of a step that is looked into; False where it is too rough, and tried again."""
    tout, ws, length = task.recording.times, task.space, trial.length
    inner = now.index < tout.shape[0] and tout[now.index] < now.t + length
    if trial.prepared or not (trial.suspect or now.waves or inner or now.delays):
        return True
    if trial.rank != 8:
        trial.terms = prepare(trial.rank, length, ws.k, ws.poly)
        return True
    prepare8(
        task.prog, task.drive, now.segment, now.t, length, task.x, ws.x1, task.mode, ws.work, ws.k, ws.dx,
        ws.poly,
    )  # fmt: skip
    rough = roughness(ws.size, ws.rounding, length, task.accuracy.rtol, task.accuracy.atol, ws.poly)
    if not (trial.suspect or inner or now.delays):
        rough /= WAVE_ROUGH
    if rough > 1.0:
        now.h = length * max(STEP_SHRINK, STEP_SAFETY * rough ** (-0.125))
        return False
    if now.waves and rough > GROWS_8:  # the next one is integrated as well
        longest = length * min(STEP_GROWTH, STEP_SAFETY * rough ** (-0.125))
        trial.following = min(trial.following, longest)
    return True
