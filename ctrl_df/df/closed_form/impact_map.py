"""The map of a ball between two walls under a harmonic force: flights, impacts, chatter.

The ball is the motor in its gap, see `backlash`. Flights are closed forms, so a motion is a map
from wall to wall. It is written in the distance xi in [0, 1] from the wall just left and the phase phi in
which xi'' = A cos(phi): phi = tau at the lower wall, tau + pi at the upper one. Both walls then share one
map (phi, w) -> (phi, w), w the speed of leaving, and a half-wave symmetric motion closes after half a
period.

*Chatter* accumulates: flights under a pressing acceleration g shrink geometrically and end after
2w/(g(1 - eps)). When that is below `CHATTER` rad (and g steady to 1 %) the bodies are taken to stay together
at once. The area this leaves out is at most g CHATTER^3/12; N is off by less than 1e-12 (measured 7e-13).
Contact lasts until g changes sign.
"""

from __future__ import annotations

import math

import numpy as np

from ...simulate.compiler.compiled import njit, part
from ..thresholds import (
    CHATTER,
    CLOSES,
    DIGIT,
    IMPACT_EXACT,
    IMPACT_STEPS,
    LAG_SERIES,
    LONGEST_FLIGHT,
    NEAR_ELASTIC,
    TURNED,
)

# --- the symmetric motion with two impacts a period -------------------------------------------------------


@njit(cache=True)
def two_impact(A, eps):
    """Phase and speed of its impact on the upper wall, if it exists, clears the walls and is stable.

    pi A (1 + eps) sin(tau) - 2 A (1 - eps) cos(tau) = 1 - eps, up to two solutions.
    """
    r = math.hypot(math.pi * (1.0 + eps), 2.0 * (1.0 - eps))
    level = (1.0 - eps) / (A * r)
    if level > 1.0:
        return False, 0.0, 0.0, 0.0
    lead = math.atan2(2.0 * (1.0 - eps), math.pi * (1.0 + eps))
    for branch in range(2):
        tau = lead + (math.asin(level) if branch == 0 else math.pi - math.asin(level))
        sn, cs = math.sin(tau), math.cos(tau)
        if eps < NEAR_ELASTIC:
            v = 2.0 * A * sn / (1.0 - eps)
        else:
            v = 2.0 * (1.0 + 2.0 * A * cs) / (math.pi * (1.0 + eps))
        if v <= 0.0:
            continue
        # Half-period map (tau, v) with the walls exchanged: determinant eps^2.
        trace = 1.0 + eps - A * (2.0 * sn + math.pi * (1.0 + eps) * cs) / v
        if abs(trace) > 1.0 + eps * eps or (abs(trace) == 1.0 + eps * eps and eps < 1.0):
            continue
        if stays(A, eps, -cs, -sn, eps * v):
            continue
        kind, time, speed = flight(A, -cs, -sn, eps * v, IMPACT_EXACT)
        closing = abs(time - math.pi) + abs(speed - v) / v
        if kind == 1 and closing < CLOSES:
            return True, tau, v, closing
    return False, 0.0, 0.0, 0.0


@njit(cache=True)
def two_impact_harmonics(A, eps, tau, v, out):
    """Write the odd harmonics C_k/(k^2 A) of that motion to `out`."""
    turn = complex(math.cos(tau), -math.sin(tau))
    power = turn
    for k in range(1, out.size, 2):
        out[k] = -(2.0 * (1.0 + eps) * v / (math.pi * A * k * k)) * power
        power *= turn * turn


# --- one flight -------------------------------------------------------------------------------------------


@part
def flight(A, c, s, w, near):
    """Follow the ball from a wall to its next impact: (kind, time, speed).

    Left at speed w >= 0 in phase phi, c = cos(phi), s = sin(phi). Kind 0: back on the same wall, 1: on the
    opposite one, 2: never. The velocity w + A (sin(phi + r) - s) repeats, so that the extremes of xi follow
    in closed form; between two of them xi is monotone, and no impact, grazing included, escapes. `near` is
    `IMPACT_EXACT` or `IMPACT_ROUGH`.
    """
    W = w / A
    reach = c * c + W * (2.0 * s - W)
    drift = w - A * s
    if reach <= 0.0:  # never turns back
        return impact(A, c, s, w, 0.0, (1.0 + 2.0 * A) / drift, 1, near)
    # velocity = 0 is a quadratic in tan(r/2); each root in the form that does not cancel
    D = math.sqrt(reach)
    if c >= 0.0:
        top, peak = extreme(A, c, s, w, c + D, 2.0 * s - W)
    else:
        top, peak = extreme(A, c, s, w, W, D - c)
    if peak >= 1.0:
        return impact(A, c, s, w, 0.0, top, 1, near)
    if c >= 0.0:
        bottom, low = extreme(A, c, s, w, W, -c - D)
    else:
        bottom, low = extreme(A, c, s, w, D - c, W - 2.0 * s)
    if low <= 0.0:
        return impact(A, c, s, w, top, bottom, 0, near)
    step = 2.0 * math.pi * drift  # shift of the extremes from period to period
    gap = 1.0 - peak if drift > 0.0 else low
    if gap > LONGEST_FLIGHT * abs(step):
        return 2, 0.0, 0.0
    late = 2.0 * math.pi * math.ceil(gap / abs(step))
    if drift > 0.0:
        if place(A, c, s, w, top + late) < 1.0:
            late += 2.0 * math.pi
        return impact(A, c, s, w, bottom + late - 2.0 * math.pi, top + late, 1, near)
    if place(A, c, s, w, bottom + late) > 0.0:
        late += 2.0 * math.pi
    return impact(A, c, s, w, top + late, bottom + late, 0, near)


@part
def extreme(A, c, s, w, up, along):
    """Time r in (0, 2 pi] with tan(r/2) = up/along, up >= 0, and xi there."""
    r = 2.0 * math.atan2(up, along)
    size = 2.0 * up / (up * up + along * along)
    return r, w * r + A * (c * size * up - s * lag(r, size * along))


@part
def impact(A, c, s, w, low, high, kind, near):
    """Time and speed at which xi reaches the wall within a monotone piece, by safeguarded Halley steps."""
    target = 1.0 if kind == 1 else 0.0
    sign = 1.0 if kind == 1 else -1.0
    r = 0.5 * (low + high)
    if kind == 0:
        r = min(r, 2.0 * low)  # steady pressing: twice the time to the top
    v = 0.0
    for _ in range(IMPACT_STEPS):
        h, g = math.sin(0.5 * r), math.cos(0.5 * r)
        sn, versine = 2.0 * h * g, 2.0 * h * h
        miss = sign * (w * r + A * (c * versine - s * lag(r, sn)) - target)
        v = sign * (w + A * (c * sn - s * versine))
        force = sign * A * (c - c * versine - s * sn)
        if miss > 0.0:
            high = r
        elif miss < 0.0:
            low = r
        else:
            break
        slope = v - 0.5 * force * miss / v if v > 0.0 else 0.0
        new = r - miss / slope if slope > 0.0 else low
        inside = low < new < high
        if not inside:
            new = 0.5 * (low + high)
        move = new - r
        r = new
        if abs(move) <= DIGIT * r:
            break
        if inside and abs(move) <= near * r and abs(move * force) <= near * v:
            # the next step would be near^2 of this one
            jerk = -sign * A * (c * sn + s * (1.0 - versine))
            v += move * (force + 0.5 * move * jerk)
            break
    return kind, r, max(v, 0.0)


@part
def place(A, c, s, w, r):
    """Distance xi from the wall a time r after leaving it."""
    return w * r + A * (c * 2.0 * math.sin(0.5 * r) ** 2 - s * lag(r, math.sin(r)))


@part
def lag(r, sn):
    """Return r - sin(r) without cancellation: chatter is made of very short flights."""
    if r > LAG_SERIES:
        return r - sn
    x = r * r
    return r * x / 6.0 * (1.0 - x / 20.0 * (1.0 - x / 42.0 * (1.0 - x / 72.0 * (1.0 - x / 110.0))))


@part
def stays(A, eps, c, s, w):
    """Whether a ball that leaves at speed w is pressed back for good (complete chatter)."""
    if c >= 0.0:
        return False
    if w == 0.0:
        return True
    left = 2.0 * w / (-A * c * (1.0 - eps)) if eps < 1.0 else np.inf
    return left < CHATTER and left * abs(s) < TURNED * -c


@njit(cache=True)
def wrap(phi):
    """Return the phase within half a turn of zero."""
    return phi - 2.0 * math.pi * math.floor(phi / (2.0 * math.pi) + 0.5)
