# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""Newton's method on the period map: the Jacobian, the step it gives, and the multipliers of an orbit.

The unknowns are the free coordinates y of a state, the equation is P(y) - y = 0 with the period map P.
Both ways to an orbit are made of this: secant steps from nearby (`shooting`), damped steps from far off
(`damped`).
"""

from __future__ import annotations

import math

from ....simulate.compiler.compiled import njit, part
from ....simulate.compiler.native import call_native
from ....simulate.compiler.views import lean
from ....simulate.dynamics.matrices import copy, multiply
from ....simulate.kernel.run import reasons
from ...thresholds import LEADS_ASIDE, PIVOT, STEP_ROUNDED
from .period_map import coordinates, mismatch, period_map_at, place


@part
def correct(shot, jacobian, change, before, after, count):
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
    if total < STEP_ROUNDED:
        return count
    rest = total
    for k in range(min(count, nf - 1)):
        copy(steps[k], known[k])
        for q in range(k):
            _take_off(known[q], known[k])
        length = _product(known[k], known[k])
        if not length > 0.0 or rest - _product(known[k], new) ** 2 / length < LEADS_ASIDE * total:
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
def differentiate(
    shot,
    at,
    drive,
    time,
    x0,
    m0,
    step,
    jacobian,
    mirrored,
    rtol,
    atol,
    hmax,
    budget,
    first,
    relative,
    central,
):
    """Difference the shot over its free coordinates into `jacobian`; `step` is the closing error at x0.

    All shots are of the tolerance of that one and begin with a step `first` as it did, so that their errors
    are nearly its own. Coordinates are changed by `relative` of their sizes, to the side where there is room,
    or (`central`) to both, which costs twice as many shots and errs by the square. False where a run failed.
    """
    y, end, x, base = shot.trial[8], shot.trial[9], shot.trial[10], shot.trial[11]
    other, mode = shot.trial[4], shot.trial_mode[1]
    kinds = shot.tally[2]
    coordinates(shot, x0, base)
    for c in range(shot.free.shape[0]):
        i = shot.free[c]
        h = relative * shot.size[i]
        if not central and (base[i] > 0.0):
            h = -h
        if base[i] + h < shot.lower[i] or base[i] + h > shot.upper[i]:
            h = -h
        before = 0.0  # change of the coordinate on the other side; `other`, by how far its shot misses
        copy(step, other)
        if central:
            copy(base, y)
            y[i] = min(max(y[i] - h, shot.lower[i]), shot.upper[i])
            before = y[i] - base[i]
            if before != 0.0 and not _missed(
                shot, at, drive, time, y, m0, x, mode, mirrored, rtol, atol, hmax, budget, first, base, other
            ):
                return False
        copy(base, y)
        y[i] += h
        h = y[i] - base[i]
        if h != 0.0 and not _missed(
            shot, at, drive, time, y, m0, x, mode, mirrored, rtol, atol, hmax, budget, first, base, end
        ):
            return False
        for r in range(shot.free.shape[0]):
            k = shot.free[r]
            jacobian[r, c] = (end[k] - other[k]) / (h - before) if h != 0.0 else 0.0
    shot.tally[2] = kinds
    shot.tally[3] += 1
    return True


@part
def _missed(shot, at, drive, time, y, m0, x, mode, mirrored, rtol, atol, hmax, budget, first, base, apart):
    """Take the shot from coordinates y; leave how far from `base` it ends in `apart`; False: it failed."""
    copy(m0, mode)
    place(shot, y, x, mode)
    shot.clock[2] = first
    reason = call_native(
        shot.take, (at, drive, time, x, mode, mirrored, rtol, atol, hmax, shot.no_spectrum, budget)
    )
    if reason != reasons.DONE:
        return False
    coordinates(shot, x, apart)
    for k in range(apart.shape[0]):
        apart[k] -= base[k]
        if shot.wrap[k] > 0.0:
            apart[k] -= shot.wrap[k] * round(apart[k] / shot.wrap[k])
    return True


@part
def newton_step(shot, jacobian, step, change):
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
def spectral_radius(shot, jacobian, squarings):
    """Largest multiplier of a shot, from the growth of the Jacobian's powers up to 2^squarings."""
    nf = jacobian.shape[0]
    a, b = shot.matrix[1], shot.matrix[2]
    log_size, power = 0.0, 1.0
    for r in range(nf):
        for c in range(nf):
            ratio = shot.size[shot.free[c]] / shot.size[shot.free[r]] if r != c else 1.0
            a[r, c] = jacobian[r, c] * ratio if jacobian[r, c] != 0.0 else 0.0
    for _ in range(squarings):
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


# --- from Python ------------------------------------------------------------------------------------------


@njit(error_model="numpy")
def newton_step_of(at, jacobian, missed, change):
    """`newton_step` from the coordinates missed; `change`: (nf,)."""
    return newton_step(period_map_at(at), lean(jacobian), lean(missed), lean(change))


@njit(error_model="numpy")
def mismatch_of(at, begin, end):
    """`mismatch` of a shot."""
    return mismatch(period_map_at(at), lean(begin), lean(end))


@njit(error_model="numpy", nogil=True)
def differentiate_of(
    at, drive, time, x0, m0, step, jacobian, mirrored, rtol, atol, hmax, budget, first, relative
):
    """`differentiate` to both sides."""
    return differentiate(
        period_map_at(at), at, lean(drive), time, lean(x0), lean(m0), lean(step), lean(jacobian), mirrored,
        rtol, atol, hmax, budget, first, relative, True,
    )  # fmt: skip


@njit(error_model="numpy")
def spectral_radius_of(at, jacobian, squarings):
    """`spectral_radius` of a Jacobian."""
    return spectral_radius(period_map_at(at), lean(jacobian), squarings)
