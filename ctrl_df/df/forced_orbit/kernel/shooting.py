# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""Forced periodic orbits by Newton's method on the shots of `period_map`, all in compiled code.

The Jacobian of the shot is kept from point to point of a line and corrected by what each step shows, the
start is extrapolated from the points before, and the last shot integrates the harmonics along the way: most
points cost three or four shots, the first of them coarse.
"""

from __future__ import annotations

import functools
import math

from ....simulate.compiler.compiled import apart, njit, part
from ....simulate.compiler.native import call_native, native_address
from ....simulate.compiler.views import lean
from ....simulate.dynamics.matrices import copy
from ....simulate.kernel.run import reasons
from ...thresholds import (
    EXPECTED,
    FAR_OFF,
    JACOBIANS,
    NEUTRAL_SHOT,
    NOISE,
    ONE_SIDED,
    ORBIT_ERROR,
    ROUGHLY,
    SHARP,
    SHARPER,
    SHRINKS,
    SHRINKS_FIRST,
    SOON,
    SQUARINGS,
    STALE,
    TOO_FAR,
    WORSE,
)
from .newton import correct, differentiate, newton_step, spectral_radius
from .period_map import ARGUMENTS, coordinates, mismatch, period_map_at, place

CLOSED, OPEN, UNSTABLE, SPENT, FAILED = range(5)
"""Outcome: closed and attracting, not closed, closed but repelling, out of work, the run failed."""


@functools.cache
def address() -> int:
    """Return the address of `close`, compiled now if need be."""
    return native_address(close, (*ARGUMENTS, 1, True))


@njit(error_model="numpy", nogil=True)
def solve_periodic(
    close, shot, drive, time, x, mode, mirrored, rtol, atol, hmax, spectrum, budget, shots, eager
):
    """`close` at its address, from Python; returns outcome and error."""
    outcome = call_native(
        close,
        (
            shot, lean(drive), time, lean(x), lean(mode), mirrored, rtol, atol, hmax, lean(spectrum), budget,
            shots, eager,
        ),
    )  # fmt: skip
    return outcome, period_map_at(shot).error[0]


@apart
def close(shot, drive, time, x, mode, mirrored, rtol, atol, hmax, spectrum, budget, shots, eager):
    """Close an orbit from (x, mode), in place, by secant steps.

    The integrals of the closed shot go to `spectrum`. `shots` bounds the shots, `budget` the integration
    steps; with `eager` the first shot takes integrals already. Returns the outcome, and leaves the error of
    the state in ``shot.error``.
    """
    outcome, period_map_at(shot).error[0] = _close(
        period_map_at(shot),
        shot,
        drive,
        time,
        x,
        mode,
        mirrored,
        rtol,
        atol,
        hmax,
        spectrum,
        budget,
        shots,
        eager,
    )
    return outcome


@part(inline=True)
def _close(shot, at, drive, time, x, mode, mirrored, rtol, atol, hmax, spectrum, budget, shots, eager):
    """Return outcome and error."""
    n, nf = x.shape[0], shot.free.shape[0]
    y0, y1, change, x0 = shot.trial[0], shot.trial[1], shot.trial[2], shot.trial[3]
    last, end = shot.trial[7], shot.trial[6]
    jacobian, m0 = shot.jacobian, shot.trial_mode[0]
    for i in range(n):
        shot.size[i] = 0.0
    fresh_jacobian = False
    moved = False  # `change` is the step that led to the present point, `last` the closing error before it
    previous, best = math.inf, math.inf
    jacobians = sharp = 0
    steps = 0  # that the Jacobian was corrected by since it was differenced
    take, centered = eager, False
    expected = EXPECTED  # closing error of the shot to come
    for _ in range(shots):
        copy(x, x0)
        copy(mode, m0)
        coordinates(shot, x, y0)
        # far from the orbit coarse shots do
        tolerance = rtol if take else max(rtol, min(SHARPER * expected, ROUGHLY))
        first = shot.clock[2]
        reason = call_native(
            shot.take,
            (
                at, drive, time, x, mode, mirrored, tolerance, atol, hmax,
                spectrum if take else shot.no_spectrum, budget,
            ),
        )  # fmt: skip
        budget -= int(shot.clock[3])
        if reason != reasons.DONE:
            return (SPENT if reason == reasons.STEPS else FAILED), best
        if budget <= 0:
            return SPENT, best
        coordinates(shot, x, y1)
        copy(y1, end)
        miss = mismatch(shot, y0, y1)
        best = min(best, miss)
        rests = False  # a body at rest at the end of the shot is at rest, not nearly so
        for f in range(nf):
            i = shot.free[f]
            if end[i] == 0.0 and y0[i] != 0.0:
                rests = True
        if moved:
            steps = correct(shot, jacobian, change, last, y1, steps)
        error = miss  # of the state: what Newton's step would still change
        known = nf > 0 and not math.isnan(jacobian[0, 0])
        if known and miss > 0.0:
            error = math.inf
            if newton_step(shot, jacobian, y1, change):
                error = 0.0
                for f in range(nf):
                    error = max(error, abs(change[f]) / shot.size[shot.free[f]])
        stale = miss > STALE * previous
        if not rests and (
            error < ORBIT_ERROR
            or (take and stale and error < NOISE * rtol)
            or (sharp > 1 and stale and miss < SHARP[0] * rtol and error < SHARP[1] * rtol)
        ):
            copy(x0, x)
            copy(m0, mode)
            far_off = mirrored and not centered and _center(shot, y1, x)
            if not take or far_off:
                # tolerances are relative to the state: a small motion far from its centre is not yet exact
                take, centered, moved, previous = True, True, False, math.inf
                continue
            if known and miss > 0.0 and not _attracts(shot, jacobian):
                if not fresh_jacobian:
                    # Broyden's matrix is no proof: differentiate before it is called unstable
                    if not differentiate(
                        shot, at, drive, time, x0, m0, y1, jacobian, mirrored, rtol, atol, hmax, budget,
                        first, ONE_SIDED * math.sqrt(rtol), False,
                    ):  # fmt: skip
                        return OPEN, error
                if not _attracts(shot, jacobian):
                    return UNSTABLE, error
            return CLOSED, error
        if nf == 0:
            return OPEN, miss
        if not known or (stale and not fresh_jacobian):
            if jacobians >= JACOBIANS:
                return OPEN, best
            if not differentiate(
                shot, at, drive, time, x0, m0, y1, jacobian, mirrored, tolerance, atol, hmax, budget, first,
                ONE_SIDED * math.sqrt(tolerance), False,
            ):  # fmt: skip
                return FAILED, best
            jacobians += 1
            steps = 0
            if tolerance == rtol:
                sharp += 1
            fresh_jacobian = True
        elif stale and jacobians >= 2 and miss > WORSE * previous:
            return OPEN, best
        else:
            fresh_jacobian = False
        if not newton_step(shot, jacobian, y1, change):
            return OPEN, best
        too_far = False
        for f in range(nf):
            if not abs(change[f]) <= TOO_FAR * shot.size[shot.free[f]]:
                too_far = True
        if too_far:
            # far from an orbit the motion itself is the better guide: x holds the end of the shot
            moved = False
            previous = math.inf
            for r in range(nf):
                for c in range(nf):
                    jacobian[r, c] = math.nan
            continue
        for i in range(n):
            last[i] = y1[i]
        for f in range(nf):
            i = shot.free[f]
            if end[i] == 0.0:
                change[f] = -y0[i]
            y0[i] += change[f]
        copy(y0, y1)
        copy(m0, mode)
        place(shot, y0, x, mode)
        if mirrored:
            _center(shot, last, x)
        moved = True
        for f in range(nf):
            i = shot.free[f]
            if y0[i] != y1[i]:
                moved = False  # clipped
        # errors shrink by the same ratio once more, or faster
        ratio = min(miss / previous, SHRINKS) if previous < math.inf else SHRINKS_FIRST
        take = take or ratio * miss < SOON * ORBIT_ERROR
        expected = miss * min(ratio, SHRINKS_FIRST)
        previous = miss
    return OPEN, best


@part
def _center(shot, step, x):
    """Move free positions to where half a period mirrors them onto themselves; tell whether that was far.

    Far: more than a tenth of what the position travels from the start to the end of the shot.
    """
    far = False
    for k in range(shot.shifts.shape[0]):
        amount = 0.0
        for j in range(x.shape[0]):
            if shot.shifts[k, j] != 0.0:
                if amount == 0.0:
                    amount = 0.5 * step[j]
                    travel = shot.offset[j] - step[j] - 2.0 * x[j]
                    far = far or abs(amount) > FAR_OFF * abs(travel)
                x[j] += amount
    return far


@part
def _attracts(shot, jacobian):
    return spectral_radius(shot, jacobian, SQUARINGS) < 1.0 + NEUTRAL_SHOT
