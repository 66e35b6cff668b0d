"""What the map between the walls leads to: attractors closed by Newton's method, their harmonics, averages.

Times are phases tau = omega t, lengths gaps; see `impact_map` for the coordinates (phi, w).
"""

from __future__ import annotations

import math

import numpy as np

from ...simulate.compiler.compiled import njit, part
from ...thresholds import FEW_ROUNDED, NEWTON_NEAR, NOTHING, SQRT_EPS
from ..thresholds import (
    BLOCKS,
    DIVERGES,
    FIRST_APART,
    IMPACT_EXACT,
    IMPACT_ROUGH,
    IMPACTS,
    MEMORIES,
    MEMORY_LEAST,
    MOST_APART,
    MOST_TRIES,
    PERIOD_OFF,
    POLISHED_LATE,
    POLISHED_SHRINKS,
    RARE,
    RECURS,
    SETTLED_IMPACTS,
)
from .impact_map import flight, lag, place, stays, wrap

RELEASE = -0.5 * math.pi  # phi at which a pressing acceleration changes sign


# --- settling on an attractor -----------------------------------------------------------------------------


@part
def event(A, eps, phi, c, s, w, near):
    """One flight, the impact, and sustained contact if it follows.

    Returns kind, time of flight, time of contact; phi, its cosine and sine, and w after; impact speed.
    """
    kind, time, speed = flight(A, c, s, w, near)
    if kind == 2:
        return kind, 0.0, 0.0, phi, c, s, w, 0.0
    phi = wrap(phi + time + math.pi * kind)
    c, s, w = math.cos(phi), math.sin(phi), eps * speed
    if stays(A, eps, c, s, w):
        rest = (RELEASE - phi) % (2.0 * math.pi)
        return kind, time, rest, RELEASE, 0.0, -1.0, 0.0, speed
    return kind, time, 0.0, phi, c, s, w, speed


@njit(cache=True)
def settle(A, eps, phi, w, transient):
    """Run until a state recurs (Brent's search) and close the orbit with Newton's method.

    Returns status (0 none found, 1 periodic, 2 free), half periods and impacts of the orbit, phi, w, whether
    contact is sustained, its largest multiplier, closing error.
    """
    ref_phi, ref_w, since, power, elapsed, clock, tries = phi, w, 0, FIRST_APART, 0.0, 0.0, 0
    c, s = math.cos(phi), math.sin(phi)
    # a weak force needs many periods from wall to wall: what counts then is impacts
    enough = SETTLED_IMPACTS + MEMORIES / max(1.0 - eps, MEMORY_LEAST)
    for n in range(IMPACTS * transient):
        kind, time, rest, phi, c, s, w, _ = event(A, eps, phi, c, s, w, IMPACT_ROUGH)
        if kind == 2:
            return 2, 0, 0, phi, w, False, 0.0, 0.0
        since += 1
        elapsed += time + rest
        clock += time + rest
        if abs(wrap(phi - ref_phi)) < RECURS and abs(w - ref_w) < RECURS * (1.0 + A) and tries < MOST_TRIES:
            halves = round(elapsed / math.pi)
            if halves >= 1 and abs(elapsed - halves * math.pi) < 2.0 * RECURS:
                tries += 1
                ok, p, v, contact, radius, closing = polish(A, eps, phi, w, since, halves)
                if ok:
                    return shortest(A, eps, p, v, since, halves, contact, radius, closing)
        if since == power:
            ref_phi, ref_w, since, elapsed = phi, w, 0, 0.0
            power = min(2 * power, MOST_APART)
        if clock > 2.0 * math.pi * transient and n > enough:
            break
    return 0, 0, 0, phi, w, False, 0.0, 0.0


@part
def shortest(A, eps, phi, w, count, halves, contact, radius, closing):
    """Return the answer of `settle` for `halves` half periods that may hold the same orbit several times."""
    for parts in range(halves, 1, -1):
        if halves % parts == 0 and count % parts == 0:
            ok, p, v, con, rad, clo = polish(A, eps, phi, w, count // parts, halves // parts)
            if ok and abs(wrap(p - phi)) < RECURS and abs(v - w) < RECURS * (1.0 + A):
                return 1, halves // parts, count // parts, p, v, con, rad, clo
    return 1, halves, count, phi, w, contact, radius, closing


@njit(cache=True)
def polish(A, eps, phi, w, count, halves):
    """Close an orbit of `count` impacts in `halves` half periods.

    By Newton's method on the map (phi, w) and its tangent. Returns whether a stable orbit was found, phi, w,
    contact, largest multiplier, closing error.
    """
    before = np.inf
    for _ in range(NEWTON_NEAR):
        p, c, s, v, total, contact = phi, math.cos(phi), math.sin(phi), w, 0.0, False
        j11, j12, j21, j22 = 1.0, 0.0, 0.0, 1.0
        for _ in range(count):
            p0, c0, s0 = p, c, s
            kind, time, rest, p, c, s, v, speed = event(A, eps, p, c, s, v, IMPACT_EXACT)
            if kind == 2 or (speed == 0.0 and rest == 0.0):
                return False, phi, w, False, 0.0, 0.0
            total += time + rest
            if rest > 0.0:  # the release forgets how the contact began
                contact = True
                j11 = j12 = j21 = j22 = 0.0
            else:
                # xi(time) = const: velocity dr + time dw + slope dphi = 0; then d(velocity)
                slope = A * (c0 * (math.sin(time) - time) - s0 * 2.0 * math.sin(0.5 * time) ** 2)
                out = speed if kind == 1 else -speed
                force = A * math.cos(p0 + time)
                r1, r2 = -slope / out, -time / out
                sign = eps if kind == 1 else -eps
                m11, m12 = 1.0 + r1, r2
                m21 = sign * (force * (1.0 + r1) - A * c0)
                m22 = sign * (1.0 + force * r2)
                j11, j12, j21, j22 = (
                    m11 * j11 + m12 * j21,
                    m11 * j12 + m12 * j22,
                    m21 * j11 + m22 * j21,
                    m21 * j12 + m22 * j22,
                )
        dp, dw = wrap(p - phi), v - w
        size = abs(dp) + abs(dw) / (1.0 + A)
        if abs(total - halves * math.pi) > PERIOD_OFF:
            return False, phi, w, False, 0.0, 0.0
        if size < FEW_ROUNDED or (size < POLISHED_LATE and size > POLISHED_SHRINKS * before):
            half, det = 0.5 * (j11 + j22), j11 * j22 - j12 * j21
            root = half * half - det
            radius = abs(half) + math.sqrt(root) if root >= 0.0 else math.sqrt(max(det, 0.0))
            return radius < 1.0 + SQRT_EPS * (eps == 1.0), phi, w, contact, radius, size
        if size > DIVERGES * before:
            return False, phi, w, False, 0.0, 0.0
        before = size
        det = (1.0 - j11) * (1.0 - j22) - j12 * j21
        if det == 0.0:
            return False, phi, w, False, 0.0, 0.0
        phi = wrap(phi + ((1.0 - j22) * dp + j12 * dw) / det)
        w = w + (j21 * dp + (1.0 - j11) * dw) / det
        if not w >= 0.0:
            return False, phi, w, False, 0.0, 0.0
    return False, phi, w, False, 0.0, 0.0


# --- harmonics --------------------------------------------------------------------------------------------


@njit(cache=True)
def measure(A, eps, phi, w, count, out):
    """Harmonics C_k/(k^2 A), and -mean(y)/A at index 0, of a periodic motion over one orbit."""
    side, clock, area = -1.0, 0.0, 0.0
    c, s = math.cos(phi), math.sin(phi)
    wall = np.zeros(out.size, dtype=np.complex128)
    for _ in range(count):
        c0, s0, w0 = c, s, w
        kind, time, rest, phi, c, s, w, speed = event(A, eps, phi, c, s, w, IMPACT_EXACT)
        area += side * (0.5 * time - swept(A, c0, s0, w0, time))
        clock += time + rest
        side = -side if kind == 1 else side
        push(A, eps, side, phi, rest, rest, speed, wall)
        area += 0.5 * side * rest
    symmetric = round(clock / math.pi) % 2 == 1
    for k in range(1, out.size):
        out[k] = 2.0 * wall[k] / (clock * A * k * k)
    out[0] = -area / (clock * A)
    if symmetric:
        out[::2] = 0.0


@njit(cache=True)
def average(A, eps, phi, w, periods, out):
    """Project y on the harmonics over blocks of whole periods; returns the spread of N between half windows.

    The spread is estimated from all blocks (twice the standard error of their mean), relative. Returns -1 if
    contact is lost for good, inf (and NaN harmonics) if the bound on impacts is reached first.
    """
    n = out.size
    blocks = min(BLOCKS, periods)
    c, s, side = math.cos(phi), math.sin(phi), -1.0
    apart = interval(A, eps, phi, c, s, w)
    if not apart < np.inf:
        return -1.0
    length = 2.0 * math.pi * (periods // blocks)
    if apart > 2.0 * math.pi:  # impacts are rare
        length = max(length, 2.0 * math.pi * math.ceil(RARE * apart / (2.0 * math.pi)))
    tau = phi  # at the lower wall; time counts from here in the forcing phase
    cut = 2.0 * math.pi * math.ceil(tau / (2.0 * math.pi))
    wall = np.zeros(n, dtype=np.complex128)
    mark = np.zeros(n, dtype=np.complex128)
    last = 0j
    area, cuts, squares = 0.0, 0, 0.0
    for _ in range(periods * IMPACTS):
        c0, s0, w0, side0 = c, s, w, side
        kind, time, rest, phi, c, s, w, speed = event(A, eps, phi, c, s, w, IMPACT_ROUGH)
        if kind == 2:
            return -1.0
        side = -side if kind == 1 else side
        while cuts <= blocks and tau + time + rest > cut:
            # Integrals up to the cut, e^{-jk tau} = 1 there: int y'' - y' - jk y = (jk)^2 int y.
            for k in range(wall.size):
                mark[k] = wall[k]
            if tau + time > cut:
                r = cut - tau
                y = side0 * (0.5 - place(A, c0, s0, w0, r))
                rate = -side0 * (w0 + A * (c0 * math.sin(r) - s0 * 2.0 * math.sin(0.5 * r) ** 2))
                mark[0] = area + side0 * (0.5 * r - swept(A, c0, s0, w0, r))
            else:
                part = cut - tau - time
                y, rate = 0.5 * side, 0.0
                push(A, eps, side, phi, rest, part, speed, mark)
                mark[0] = area + side0 * (0.5 * time - swept(A, c0, s0, w0, time)) + y * part
            for k in range(1, n):
                mark[k] -= complex(rate, k * y)
            if cuts == 0:
                for k in range(mark.size):
                    out[k] = mark[k]
            else:
                squares += abs(mark[1] - last) ** 2
            last = mark[1]
            cuts += 1
            cut += length
        if cuts > blocks:
            break
        area += side0 * (0.5 * time - swept(A, c0, s0, w0, time)) + 0.5 * side * rest
        push(A, eps, side, phi, rest, rest, speed, wall)
        tau += time + rest
    if cuts <= blocks:
        out[:] = complex(np.nan, np.nan)
        return np.inf
    span = length * blocks
    for k in range(n):
        out[k] = (mark[k] - out[k]) * (2.0 / (span * A * k * k) if k > 0 else -1.0 / (span * A))
    mean = 0.5 * abs(out[1]) * length * A
    error = max(squares / blocks - mean * mean, 0.0) / (blocks - 1)
    return 2.0 * math.sqrt(error) / max(mean, NOTHING)


@part
def interval(A, eps, phi, c, s, w):
    """Mean time between the next impacts; inf where one of them never comes."""
    clock = 0.0
    for _ in range(RARE):
        kind, time, rest, phi, c, s, w, _ = event(A, eps, phi, c, s, w, IMPACT_ROUGH)
        if kind == 2:
            return np.inf
        clock += time + rest
    return clock / RARE


@part
def push(A, eps, side, phi, rest, part, speed, wall):
    """Add what the wall does to y: an impulse, then -A cos(tau) for the first `part` of a contact."""
    start = phi - rest  # phi of the impact
    # e^{-j tau} with tau = phi at the lower wall (side -1), phi - pi at the upper one
    turn = -side * complex(math.cos(start), -math.sin(start))
    impulse = -side * speed * (1.0 if rest > 0.0 else 1.0 + eps)
    power = turn
    for k in range(1, wall.size):
        wall[k] += impulse * power
        power *= turn
    if rest > 0.0:
        stop = start + part
        leave = -side * complex(math.cos(stop), -math.sin(stop))
        p, q = complex(1.0, 0.0), complex(1.0, 0.0)
        for k in range(1, wall.size):
            inner = complex(part, 0.0) if k == 1 else (q - p) * 1j / (k - 1)
            p2, q2 = p * turn * turn, q * leave * leave
            wall[k] -= 0.5 * A * (inner + (q2 - p2) * 1j / (k + 1))
            p *= turn
            q *= leave


@part
def swept(A, c, s, w, r):
    """Area under xi over a flight."""
    versine = 2.0 * math.sin(0.5 * r) ** 2
    return 0.5 * w * r * r + A * (c * lag(r, math.sin(r)) - s * (0.5 * r * r - versine))
