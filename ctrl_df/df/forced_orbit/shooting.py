# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""Forced periodic orbits by Newton's method on the shots of `shot`, all in compiled code.

The Jacobian of the shot is kept from point to point of a sweep and corrected by what each step shows, the
start is extrapolated from the points before, and the last shot integrates the harmonics along the way: most
points cost three or four shots, the first of them coarse.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from ...simulate.compiler.compiled import apart, njit, part
from ...simulate.compiler.native import call_native, native_address
from ...simulate.compiler.views import lean
from ...simulate.dynamics.matrices import multiply
from ...simulate.engine import harmonic_drive
from ...simulate.kernel import driver
from ...simulate.kernel.driver import copy
from ..thresholds import (
    ASIDE,
    EXPECTED,
    FAR_OFF,
    JACOBIANS,
    NEUTRAL_SHOT,
    NOISE,
    PIVOT,
    ROUGHLY,
    SHARP,
    SHARPER,
    SHRINKS,
    SHRINKS_FIRST,
    SOON,
    SQUARINGS,
    STALE,
    STILL,
    TOLERANCE,
    TOO_FAR,
)
from .shot import coordinates, mismatch, place, shot_at

CLOSED, OPEN, UNSTABLE, SPENT, FAILED = range(5)
"""Outcome: closed and attracting, not closed, closed but repelling, out of work, the run failed."""


@functools.cache
def address() -> int:
    """Return the address of `close`, compiled now if need be."""
    drive, x, modes = harmonic_drive([[0.0, 0.0]], 1.0), np.zeros(0), np.zeros(0, np.int64)
    return native_address(
        close, (0, drive, 1.0, x, modes, True, 0.0, 0.0, 1.0, np.zeros((0, 0), complex), 1, 1, True)
    )


@njit(error_model="numpy", nogil=True)
def close_orbit(
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
    return outcome, shot_at(shot).error[0]


@apart
def close(shot, drive, time, x, mode, mirrored, rtol, atol, hmax, spectrum, budget, shots, eager):
    """Close an orbit from (x, mode), in place, by secant steps.

    The integrals of the closed shot go to `spectrum`. `shots` bounds the shots, `budget` the integration
    steps; with `eager` the first shot takes integrals already. Returns the outcome, and leaves the error of
    the state in ``shot.error``.
    """
    outcome, shot_at(shot).error[0] = _close(
        shot_at(shot), shot, drive, time, x, mode, mirrored, rtol, atol, hmax, spectrum, budget, shots, eager
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
        if reason != driver.DONE:
            return (SPENT if reason == driver.STEPS else FAILED), best
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
            steps = _broyden(shot, jacobian, change, last, y1, steps)
        error = miss  # of the state: what Newton's step would still change
        known = nf > 0 and not math.isnan(jacobian[0, 0])
        if known and miss > 0.0:
            error = math.inf
            if _newton_step(shot, jacobian, y1, change):
                error = 0.0
                for f in range(nf):
                    error = max(error, abs(change[f]) / shot.size[shot.free[f]])
        stale = miss > STALE * previous
        if not rests and (
            error < TOLERANCE
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
                    # Broyden's matrix is no proof: differentiate before judging
                    if not _differentiate(
                        shot, at, drive, time, x0, m0, y1, mirrored, rtol, atol, hmax, budget, first
                    ):
                        return OPEN, error
                if not _attracts(shot, jacobian):
                    return UNSTABLE, error
            return CLOSED, error
        if nf == 0:
            return OPEN, miss
        if not known or (stale and not fresh_jacobian):
            if jacobians >= JACOBIANS:
                return OPEN, best
            if not _differentiate(
                shot, at, drive, time, x0, m0, y1, mirrored, tolerance, atol, hmax, budget, first
            ):
                return FAILED, best
            jacobians += 1
            steps = 0
            if tolerance == rtol:
                sharp += 1
            fresh_jacobian = True
        elif stale and jacobians >= 2 and miss > 1.5 * previous:
            return OPEN, best
        else:
            fresh_jacobian = False
        if not _newton_step(shot, jacobian, y1, change):
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
        take = take or ratio * miss < SOON * TOLERANCE
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
def _broyden(shot, jacobian, change, before, after, count):
    """Correct the Jacobian of the shot by what the last step did to the closing error (before, after).

    What the steps before it did stays known: the Jacobian changes along what is new in this one alone
    (Gay and Schnabel's projected updates). ``shot.matrix[3]`` has `count` of those, newest first; returns how
    many it has now.
    """
    nf = shot.free.shape[0]
    steps, known, new = shot.matrix[3], shot.matrix[2], shot.matrix[1, 0]
    for f in range(nf):
        new[f] = change[f] / shot.size[shot.free[f]]
    total = _product(new, new)
    if total < STILL:
        return count
    rest = total
    for k in range(min(count, nf - 1)):
        copy(steps[k], known[k])
        for q in range(k):
            _take_off(known[q], known[k])
        length = _product(known[k], known[k])
        if not length > 0.0 or rest - _product(known[k], new) ** 2 / length < ASIDE * total:
            break
        for f in range(nf):
            known[k, f] /= math.sqrt(length)
        _take_off(known[k], new)
        rest = _product(new, new)
    for r in range(nf):
        i = shot.free[r]
        # d(closing) = (J - 1) change
        value = after[i] - before[i] + change[r]
        for c in range(nf):
            value -= jacobian[r, c] * change[c]
        for c in range(nf):
            jacobian[r, c] += value * new[c] / (shot.size[shot.free[c]] * rest)
    for k in range(nf - 1, 0, -1):
        copy(steps[k - 1], steps[k])
    for f in range(nf):
        steps[0, f] = change[f] / shot.size[shot.free[f]]
    return min(count + 1, nf)


@part(inline=True)
def _product(a, b):
    value = 0.0
    for f in range(a.shape[0]):
        value += a[f] * b[f]
    return value


@part(inline=True)
def _take_off(unit, vector):
    """Take from a vector its part along a unit vector."""
    along = _product(unit, vector)
    for f in range(unit.shape[0]):
        vector[f] -= along * unit[f]


@part
def _differentiate(shot, at, drive, time, x0, m0, step, mirrored, rtol, atol, hmax, budget, first):
    """Difference the shot over its free coordinates; `step` is the closing error at x0.

    All shots are of the tolerance of that one and begin with a step `first` as it did, so that their errors
    are nearly its own; the difference quotient balances what is left of them against curvature.
    """
    y, end, x, base = shot.trial[8], shot.trial[9], shot.trial[10], shot.trial[11]
    mode = shot.trial_mode[1]
    kinds = shot.tally[2]
    coordinates(shot, x0, base)
    for c in range(shot.free.shape[0]):
        i = shot.free[c]
        copy(base, y)
        h = 0.5 * math.sqrt(rtol) * shot.size[i]
        if y[i] > 0.0:
            h = -h
        if y[i] + h < shot.lower[i] or y[i] + h > shot.upper[i]:
            h = -h
        y[i] += h
        h = y[i] - base[i]
        copy(m0, mode)
        if h != 0.0:
            place(shot, y, x, mode)
            shot.clock[2] = first
            reason = call_native(
                shot.take, (at, drive, time, x, mode, mirrored, rtol, atol, hmax, shot.no_spectrum, budget)
            )
            if reason != driver.DONE:
                return False
            coordinates(shot, x, end)
        for r in range(shot.free.shape[0]):
            k = shot.free[r]
            value = 0.0
            if h != 0.0:
                value = end[k] - base[k]
                if shot.wrap[k] > 0.0:
                    value -= shot.wrap[k] * round(value / shot.wrap[k])
                value = (value - step[k]) / h
            shot.jacobian[r, c] = value
    shot.tally[2] = kinds
    shot.tally[3] += 1
    return True


@part
def _newton_step(shot, jacobian, step, change):
    """Solve (1 - J) change = step by elimination with pivots; False where the matrix is singular."""
    nf = shot.free.shape[0]
    a = shot.matrix[0]
    for r in range(nf):
        for c in range(nf):
            a[r, c] = -jacobian[r, c]
            if r == c:
                a[r, c] += 1.0
            else:
                a[r, c] *= shot.size[shot.free[c]] / shot.size[shot.free[r]]
        change[r] = 0.0
        if step[shot.free[r]] != 0.0:
            change[r] = step[shot.free[r]] / shot.size[shot.free[r]]
    for c in range(nf):
        p = c
        for r in range(c + 1, nf):
            if abs(a[r, c]) > abs(a[p, c]):
                p = r
        if not abs(a[p, c]) > PIVOT:
            return False
        if p != c:
            for k in range(nf):
                a[c, k], a[p, k] = a[p, k], a[c, k]
            change[c], change[p] = change[p], change[c]
        for r in range(c + 1, nf):
            q = a[r, c] / a[c, c]
            if q != 0.0:
                for k in range(c, nf):
                    a[r, k] -= q * a[c, k]
                change[r] -= q * change[c]
    for c in range(nf - 1, -1, -1):
        for k in range(c + 1, nf):
            change[c] -= a[c, k] * change[k]
        change[c] /= a[c, c]
    for c in range(nf):
        change[c] *= shot.size[shot.free[c]]
    return True


@part
def spectral_radius(shot, jacobian):
    """Largest multiplier of a shot, from the growth of the Jacobian's powers."""
    nf = jacobian.shape[0]
    a, b = shot.matrix[1], shot.matrix[2]
    log_size, power = 0.0, 1.0
    for r in range(nf):
        for c in range(nf):
            ratio = shot.size[shot.free[c]] / shot.size[shot.free[r]] if r != c else 1.0
            a[r, c] = jacobian[r, c] * ratio if jacobian[r, c] != 0.0 else 0.0
    for _ in range(SQUARINGS):
        norm = 0.0
        for r in range(nf):
            for c in range(nf):
                norm = max(norm, abs(a[r, c]))
        if norm == 0.0:
            return 0.0
        if not norm < math.inf:
            return math.inf
        log_size += math.log(norm) / power
        for r in range(nf):
            for c in range(nf):
                a[r, c] /= norm
        multiply(a, a, b)
        for r in range(nf):
            for c in range(nf):
                a[r, c] = b[r, c]
        power *= 2.0
    return math.exp(log_size)


@part
def _attracts(shot, jacobian):
    return spectral_radius(shot, jacobian) < 1.0 + NEUTRAL_SHOT
