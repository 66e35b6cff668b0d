"""Motions of two masses with a gap besides the one that `backlash` names, as branches of N.

All is dimensionless as there: N = n(A)/((M1 + M2) omega^2) with A = a/(M2 h omega^2), so that a motion is a
curve over A alone.

*The symmetric motion with two impacts a period.* With r = (1 + eps)/(1 - eps) and the phase tau of the impact
on the upper wall, pi A r sin(tau) - 2 A cos(tau) = 1 (`two_impact` of `impact_map`), that is
A sin(tau - lead) = A0 with A0 = 1/sqrt(4 + pi^2 r^2) and tan(lead) = 2/(pi r). Both solutions are one curve,

    A = A0 cosh(s),    tau = lead + 2 atan(exp(s)),

s < 0 the fast motion, which may attract; s = 0 the fold; s > 0 a saddle that ends in the motion without
contact at A = 1/2. A motion is possible as long as its flights clear the walls.

*Coexisting attractors.* Periodic motions that attract beside each other: which one comes depends on the
start, and N jumps between them from point to point. Each is followed over A as far as it attracts. They are
looked for from five starts at places 1 % apart; a narrower window of A or a small basin is missed.
"""

from __future__ import annotations

import math

import numpy as np

from ...simulate.compiler.compiled import njit
from ..branch import Branch, Motions
from ..thresholds import (
    BRANCH_TRANSIENT,
    CLOSES,
    COEXISTING,
    COEXISTING_AROUND,
    FOLLOWED,
    FOLLOWED_LEAST,
    FOLLOWS,
    GRID_LEAST,
    GRID_LEAST_FOLLOWED,
    GRID_STEP,
    IMPACT_EXACT,
    IMPACT_STARTS,
    LEAST_FOLD,
    MOST_NODES,
    MOST_PLACES,
    SAME_CURVE,
)
from .backlash import BACKLASH_REGIMES, _name
from .impact_map import flight, stays, wrap
from .impact_map import two_impact_harmonics as _two_impact_harmonics
from .wall_orbits import measure, polish, settle, shortest

SYMMETRIC = "symmetric motion with two impacts a period"


def backlash_branches(block, A, omega, near_A, near_omega) -> list[Branch]:
    """Return the branches of N of two masses with a gap; see `Method.branches`."""
    core, motor, load = block.core, *reversed(block.core.masses)
    unit = motor * core.gap
    highest = float(np.max(A) / (unit * np.min(omega) ** 2))
    given = motor, load, core.gap, core.restitution
    symmetric = symmetric_branch(*given, highest)
    if core.restitution >= 1:  # nothing attracts
        return [symmetric]
    return [symmetric, *coexisting_branches(*given, near_A / (unit * near_omega**2))]


class _Scaled:
    """A curve n(A) made a branch of N(a, omega) of two masses."""

    def __init__(self, curve, motor_mass, load_mass, gap):
        self.curve = curve
        self.total, self.unit = motor_mass + load_mass, motor_mass * gap

    def __call__(self, s, omega, orders) -> Motions:
        distinct, where = np.unique(s, return_inverse=True)
        A, n, exists, multiplier = self.curve(distinct, orders)
        return Motions(
            A[where] * self.unit * omega**2,
            n[where] / (self.total * omega**2)[:, None],
            exists[where],
            multiplier[where],
        )


# --- the symmetric motion with two impacts a period -------------------------------------------------------


def symmetric_branch(motor_mass, load_mass, gap, restitution, highest) -> Branch:
    """Return the symmetric motion with two impacts a period, both sides of its fold.

    Parameters
    ----------
    motor_mass, load_mass, gap, restitution : float
        As in `backlash_family`.
    highest : float
        Largest A asked, dimensionless.
    """
    eps = min(float(restitution), 1.0)
    least = _fold(eps)
    low = -math.acosh(max(highest / least, 1.0)) - GRID_STEP
    high = math.acosh(max(0.5 / least, 1.0))
    grid = np.linspace(low, high, max(GRID_LEAST, math.ceil((high - low) / GRID_STEP)))

    def curve(s, orders):
        A, tau, v = _impact_of(s, eps)
        n = np.zeros((s.size, orders + 1), dtype=complex)
        exists, multiplier = np.zeros(s.size, dtype=bool), np.zeros(s.size)
        _symmetric(A, eps, tau, v, n, exists, multiplier)
        return A, n, exists, multiplier

    def state(s, omega):
        A, tau, v = (float(c[0]) for c in _impact_of(np.array([s]), eps))
        # the flight that t = 0 lies in left the lower wall half a period before the impact
        rate = eps * v + A * math.sin(tau)
        y = -0.5 + rate * (math.pi - tau) - A * (1.0 + math.cos(tau))
        return _state(A, y, rate, omega, motor_mass, load_mass, gap)

    return Branch(SYMMETRIC, "impact", grid, _Scaled(curve, motor_mass, load_mass, gap), state)


def _fold(eps):
    return max((1.0 - eps) / math.hypot(math.pi * (1.0 + eps), 2.0 * (1.0 - eps)), LEAST_FOLD)


def _impact_of(s, eps):
    """Return A, the phase of the impact on the upper wall and its relative speed."""
    lead = math.atan2(2.0 * (1.0 - eps), math.pi * (1.0 + eps))
    A = _fold(eps) * np.cosh(s)
    tau = lead + 2.0 * np.arctan(np.exp(s))
    return A, tau, 2.0 * (1.0 + 2.0 * A * np.cos(tau)) / (math.pi * (1.0 + eps))


@njit(cache=True)
def _symmetric(A, eps, tau, v, n, exists, multiplier):
    """Fill n_k = X_k/a in units of 1/((M1 + M2) omega^2), whether the flights clear the walls, multiplier."""
    for i in range(A.size):
        _two_impact_harmonics(A[i], eps, tau[i], v[i], n[i])
        if v[i] <= 0.0:
            continue
        sn, cs = math.sin(tau[i]), math.cos(tau[i])
        # half-period map with the walls exchanged: determinant eps^2
        half = 0.5 * (1.0 + eps - A[i] * (2.0 * sn + math.pi * (1.0 + eps) * cs) / v[i])
        root = half * half - eps * eps
        radius = abs(half) + math.sqrt(root) if root > 0.0 else eps
        multiplier[i] = radius * radius
        if stays(A[i], eps, -cs, -sn, eps * v[i]):
            continue
        kind, time, speed = flight(A[i], -cs, -sn, eps * v[i], IMPACT_EXACT)
        exists[i] = kind == 1 and abs(time - math.pi) + abs(speed - v[i]) / v[i] < CLOSES


def _state(A, y, rate, omega, motor_mass, load_mass, gap):
    """Positions and speeds (x1, v1, x2, v2) at t = 0 from place and rate in the gap, no net momentum."""
    total = motor_mass + load_mass
    centre = -A * motor_mass * gap / total  # of mass, -a/((M1 + M2) omega^2)
    x = centre - motor_mass / total * gap * y
    v = -motor_mass / total * gap * omega * rate
    return np.array([x, v, x + gap * (y + 0.5), v + gap * omega * rate])


# --- coexisting attractors --------------------------------------------------------------------------------


def coexisting_branches(motor_mass, load_mass, gap, restitution, A) -> list[Branch]:
    """Return the periodic motions that attract somewhere among the dimensionless amplitudes `A`.

    Each is followed over A as far as it attracts. The symmetric motion with two impacts a period is left to
    `symmetric_branch`.

    Parameters
    ----------
    motor_mass, load_mass, gap, restitution : float
        As in `backlash_family`.
    A : ndarray
        Where to look: within 5 % of these, every 1 %, at 800 places at most.
    """
    places = _sampled(np.asarray(A, dtype=float))
    eps = float(restitution)
    met = np.zeros((places.size * IMPACT_STARTS.shape[0], 8))
    met = met[: _periodic(places, eps, IMPACT_STARTS, BRANCH_TRANSIENT, met)]
    curves: list[_ContinuedMotion] = []
    for motion in met:
        if not any(curve.holds(motion) for curve in curves):
            curves.append(_ContinuedMotion(eps, motion))
    return [
        Branch(c.name, c.regime, c.grid, _Scaled(c, motor_mass, load_mass, gap))
        for c in curves
        if c.nodes.shape[0] > 1
    ]


def _sampled(A):
    """Return amplitudes near those of A, evenly spread in ln A."""
    if not A.size:
        return A
    spread = np.arange(-COEXISTING_AROUND, COEXISTING_AROUND + 1)
    steps = np.unique(np.unique(np.round(np.log(A) / COEXISTING).astype(int))[:, None] + spread)
    return np.exp(steps[:: math.ceil(steps.size / MOST_PLACES)] * COEXISTING)


class _ContinuedMotion:
    """A periodic motion that attracts, over the range of A in which it does; its parameter is ln A."""

    def __init__(self, eps, motion):
        self.eps = eps
        self.halves, self.count, self.contact = int(motion[1]), int(motion[2]), bool(motion[3])
        parts = []
        for step in (-FOLLOWED, FOLLOWED):
            nodes = np.zeros((MOST_NODES, 5))
            kept = _follow(
                motion[0], eps, motion[4], motion[5], self.count, self.halves, self.contact, step, nodes
            )
            parts.append(nodes[:kept])
        self.nodes = np.concatenate([parts[0][:0:-1], parts[1]])  # ln A, phi, w, n
        self.nodes[:, 1] = np.unwrap(self.nodes[:, 1])
        low, high = self.nodes[0, 0], self.nodes[-1, 0]
        self.grid = np.linspace(low, high, max(GRID_LEAST_FOLLOWED, math.ceil((high - low) / GRID_STEP)))
        self.regime = BACKLASH_REGIMES[_name(self.halves, self.contact)]
        periods = self.halves / (1 if self.halves % 2 else 2)
        period = "a period" if self.halves <= 2 else f"in {periods:g} periods"
        impacts = self.count * (2 if self.halves % 2 else 1)
        how = f"{self.regime.split()[0]} motion of {impacts} impacts {period}"
        self.name = "motion with complete chatter" if self.contact else how

    def holds(self, motion) -> bool:
        """Whether a motion met lies on this curve."""
        s = math.log(motion[0])
        if (motion[1], motion[2], motion[3]) != (self.halves, self.count, self.contact) or not (
            self.nodes[0, 0] - FOLLOWED_LEAST <= s <= self.nodes[-1, 0] + FOLLOWED_LEAST
        ):
            return False
        n, its = complex(*self._between(s, slice(3, 5))), complex(motion[6], motion[7])
        return abs(n - its) < SAME_CURVE * abs(its)

    def __call__(self, s, orders):
        n = np.full((s.size, orders + 1), np.nan + 0j)
        exists, multiplier = np.zeros(s.size, dtype=bool), np.full(s.size, np.nan)
        start = self._between(s, slice(1, 3)).T.copy()
        inside = (s >= self.nodes[0, 0] - FOLLOWED_LEAST) & (s <= self.nodes[-1, 0] + FOLLOWED_LEAST)
        _at(np.exp(s), self.eps, start, self.count, self.halves, inside, n, exists, multiplier)
        return np.exp(s), n, exists, multiplier

    def _between(self, s, columns):
        return np.array([np.interp(s, self.nodes[:, 0], column) for column in self.nodes[:, columns].T])


@njit(cache=True)
def _periodic(places, eps, starts, transient, met):
    """Write the periodic motions that `starts` lead to (A, halves, count, contact, phi, w, n); count them."""
    kept = 0
    out = np.zeros(2, dtype=np.complex128)
    for A in places:
        first = kept
        for k in range(starts.shape[0]):
            if k == 3 and kept == first:
                break  # irregular from all: what hides beside that has a small basin
            w = starts[k, 1] * (1.0 + A)
            status, halves, count, phi, w, contact, _, _ = settle(A, eps, starts[k, 0], w, transient)
            if status != 1 or (halves == 1 and count == 1 and not contact):
                continue
            measure(A, eps, phi, w, count, out)
            new = True
            for m in range(first, kept):
                known = complex(met[m, 6], met[m, 7])
                new = new and not (met[m, 2] == count and abs(known - out[1]) < CLOSES * abs(known))
            if new:
                met[kept, 0], met[kept, 1], met[kept, 2], met[kept, 3] = A, halves, count, contact
                met[kept, 4], met[kept, 5], met[kept, 6], met[kept, 7] = phi, w, out[1].real, out[1].imag
                kept += 1
    return kept


@njit(cache=True)
def _follow(A, eps, phi, w, count, halves, contact, step, nodes):
    """Follow a motion over A, by factors exp(step), until it ceases to attract; return how many nodes."""
    out = np.zeros(2, dtype=np.complex128)
    s, kept, h = math.log(A), 0, 0.0
    dphi, dw = 0.0, 0.0  # by ln A
    while kept < nodes.shape[0]:
        a = math.exp(s + h)
        ok, p, v, con, radius, closing = polish(a, eps, phi + dphi * h, max(w + dw * h, 0.0), count, halves)
        near = abs(wrap(p - phi)) < FOLLOWS and abs(v - w) < FOLLOWS * (1.0 + a)
        if ok and near:  # where a doubled period ends, the single one is another motion
            near = shortest(a, eps, p, v, count, halves, con, radius, closing)[1] == halves
        if not ok or con != contact or not near:
            if kept == 0 or abs(h) < 2.0 * FOLLOWED_LEAST:
                return kept
            h *= 0.5
            continue
        if h != 0.0:
            dphi, dw = wrap(p - phi) / h, (v - w) / h
        s, phi, w = s + h, p, v
        measure(a, eps, phi, w, count, out)
        nodes[kept, 0], nodes[kept, 1], nodes[kept, 2] = s, phi, w
        nodes[kept, 3], nodes[kept, 4] = out[1].real, out[1].imag
        kept += 1
        h = step if h == 0.0 or 2.0 * abs(h) > abs(step) else 2.0 * h
    return kept


@njit(cache=True)
def _at(A, eps, start, count, halves, inside, n, exists, multiplier):
    """Fill harmonics, existence and multiplier of a followed motion at places A, from states nearby."""
    for i in range(A.size):
        if not inside[i]:
            continue
        ok, phi, w, _, radius, _ = polish(A[i], eps, start[i, 0], max(start[i, 1], 0.0), count, halves)
        if ok:
            n[i] = 0.0
            measure(A[i], eps, phi, w, count, n[i])
            exists[i] = True
            multiplier[i] = radius ** (2.0 / halves)
