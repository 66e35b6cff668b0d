"""Describing functions of two masses with a gap, exact for Newton's law of impact.

Force ``a cos(omega t)`` on the motor M2, position x1 of the load M1. The total momentum integrates in closed
form; what remains is the place of the motor in the gap, y = (x2 - x1)/h - 1/2, which in the phase
tau = omega t is a ball between two walls,

    y'' = A cos(tau),  |y| <= 1/2,  y' -> -eps y' at a wall,     A = a/(M2 h omega^2),

so that one dimensionless function gives all: with Y_k the harmonics of y and q = Y_1/A,

    N = -(1 + q)/((M1 + M2) omega^2),     X_k/a = -(Y_k/A)/((M1 + M2) omega^2),  k != 1.

The walls alone move the load, hence X_k/a = C_k/(k^2 A (M1 + M2) omega^2) with C_k the harmonics of what the
walls do to y: no flight is ever integrated. What impacts lose a period is pi a^2 (M1/M2) Im N.

Flights are closed forms, so a motion is a map from wall to wall. It is written in the distance xi in [0, 1]
from the wall just left and the phase phi in which xi'' = A cos(phi): phi = tau at the lower wall, tau + pi at
the upper one. Both walls then share one map (phi, w) -> (phi, w), w the speed of leaving, and a half-wave
symmetric motion closes after half a period.

*Chatter* accumulates: flights under a pressing acceleration g shrink geometrically and end after
2w/(g(1 - eps)). When that is below `_CHATTER` rad (and g steady to 1 %) the bodies are taken to stay together
at once. The area this leaves out is at most g _CHATTER^3/12; N is off by less than 1e-12 (measured 7e-13).
Contact lasts until g changes sign.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from .friction import _require, checked_orders, positive_axis

BACKLASH_REGIMES = ("impact", "contact", "asymmetric", "subharmonic", "aperiodic", "free")
IMPACT, CONTACT, ASYMMETRIC, SUBHARMONIC, APERIODIC, FREE = range(6)

_CHATTER = 3e-4  # [rad] remaining time of a chatter below which contact is sustained
_NEAR = 1e-5  # distance of a recurrence from which Newton's method is tried
_LONGEST = 1e4  # periods of one flight beyond which the motion counts as free of contact
_BLOCKS = 8  # an average's spread is estimated from that many parts
_IMPACTS = 200  # bound on impacts per period of the budget, chatter included
_RELEASE = -0.5 * math.pi  # phi at which a pressing acceleration changes sign
# Starts (phi, w in units of 1 + A) tried in turn: from sustained contact, then from impacts of some speed.
_STARTS = np.array([[_RELEASE, 0.0], [-1.0, 0.7], [0.9, 0.4], [2.2, 1.3], [-2.6, 0.2]])


def backlash_family(
    motor_mass, load_mass, gap, restitution, A, omega, orders=9, periods=600, transient=300, progress=None
):
    """Harmonics of the load position of two masses with a gap, under ``F = a cos(omega t)`` on the motor.

    Where several motions coexist the answer is, in this order: the symmetric motion with two impacts a
    period if it exists and is stable; else the motion that a release from sustained contact leads to; else
    (no contact remains) those that four impacts of different phase and speed lead to. `backlash_attractors`
    lists all.

    Parameters
    ----------
    motor_mass, load_mass : float
        M2 and M1 [kg], > 0.
    gap : float
        Total clearance h [m], > 0.
    restitution : float
        eps, 0 to 1.
    A, omega : array_like
        Force amplitudes [N] and frequencies [rad/s], 1-D, > 0; shapes (na,) and (nw,).
    orders : int
        Highest harmonic, >= 1.
    periods : int
        Length of the average where no period is found, >= 2.
    transient : int
        Periods a motion is given to settle, >= 1.
    progress : callable or None
        Called with (done, total) after each amplitude.

    Returns
    -------
    harmonics : complex array (na, nw, orders + 1)
        X_k/a [m/N], index 1 is N(a, omega). Index 0 is the mean of x1 from where it would be, for the same
        centre of mass, with the motor in the middle of the gap; the centre of mass drifts freely and is
        no part of it. It is zero for symmetric motions. A subharmonic motion gives its average over
        its whole period, an aperiodic one over `periods` periods. Where contact is lost for good the load
        stands still: all zero.
    regime : int8 array (na, nw)
        Index into `BACKLASH_REGIMES`: ``impact`` (half-wave symmetric, no sustained contact), ``contact``
        (half-wave symmetric, chatter complete), ``asymmetric`` (one period, not symmetric), ``subharmonic``
        (two or more periods), ``aperiodic`` (no period found within `transient`), ``free`` (no impacting
        motion found).
    residual : float array (na, nw)
        Closing error of the orbit (phase plus relative speed). Where ``aperiodic``: by how much N of the two
        halves of the average differ, relative (estimated from eight parts); half of it is the standard error
        of N. inf, with N NaN, where the bound on impacts (200 a period) ended the average.

    Raises
    ------
    ValueError
        A value out of range; the message gives rule, value, remedy.
    """
    for name, value in (("motor_mass", motor_mass), ("load_mass", load_mass)):
        _require(name, value, 0.0, strict=True)
    _require("gap", gap, 0.0, strict=True, remedy="For a tight joint use one mass.")
    _require("restitution", restitution, 0.0, upper=1.0)
    _require("periods", periods, 2)
    _require("transient", transient, 1)
    amplitudes, frequencies = positive_axis("A", A, "N"), positive_axis("omega", omega, "rad/s")
    orders = checked_orders(orders)
    harmonics = np.empty((amplitudes.size, frequencies.size, orders + 1), dtype=complex)
    regime = np.empty(harmonics.shape[:2], dtype=np.int8)
    residual = np.empty(harmonics.shape[:2])
    for i, a in enumerate(amplitudes):
        scaled = a / (motor_mass * gap * frequencies**2)
        _row(
            scaled,
            float(restitution),
            int(periods),
            int(transient),
            _STARTS,
            harmonics[i],
            regime[i],
            residual[i],
        )
        if progress is not None:
            progress(i + 1, amplitudes.size)
    harmonics /= ((motor_mass + load_mass) * frequencies**2)[:, None]
    return harmonics, regime, residual


@dataclass(frozen=True)
class BacklashAttractor:
    """One of the motions that coexist at (A, eps), dimensionless.

    Attributes
    ----------
    regime : str
        As in `BACKLASH_REGIMES`.
    q : complex
        Y_1/A; ``N = -(1 + q)/((M1 + M2) omega^2)``.
    mean : float
        Mean of y, the motor's place in the gap from its middle, in gaps; its mirror image coexists.
    period : float
        In forcing periods; NaN if aperiodic.
    impacts : float
        Impacts a forcing period, those of a chatter counted until contact is sustained; NaN if aperiodic.
    sustained_contact : bool
        Whether chatter completes.
    multiplier : float
        Largest modulus over one lap (half a period of a symmetric motion); NaN if aperiodic or free.
    residual : float
        As in `backlash_family`.
    share : float
        Part of the starts that led here, 0 to 1 (0: found by its closed form alone).
    """

    regime: str
    q: complex
    mean: float
    period: float
    impacts: float
    sustained_contact: bool
    multiplier: float
    residual: float
    share: float


def backlash_attractors(A, restitution, phases=8, speeds=5, periods=600, transient=300, tol=1e-6):
    """List the distinct motions reached from `phases` x `speeds` impacts, most frequent first.

    Parameters
    ----------
    A : float
        a/(M2 h omega^2), dimensionless, > 0.
    restitution : float
        eps, 0 to 1.
    phases, speeds : int
        Grid of starts on a wall, >= 1; speeds from 0 to 2 (1 + A) gaps a radian.
    periods, transient : int
        As in `backlash_family`.
    tol : float
        Two periodic motions are one if regime, period and q agree within this; two aperiodic ones if
        q agrees within the spread of their averages.

    Returns
    -------
    list of BacklashAttractor
        The motion without contact, which exists for A <= 1/2, is listed too (``free``).
    """
    _require("A", A, 0.0, strict=True)
    _require("restitution", restitution, 0.0, upper=1.0)
    A, eps = float(A), float(restitution)
    starts = [(_RELEASE, 0.0)]
    for phase in np.arange(phases) * (2 * math.pi / phases) + 0.1:
        starts += [(phase, speed) for speed in np.linspace(0, 2, speeds + 1)[1:] * (1 + A)]
    found: list[list] = []
    out = np.zeros(2, dtype=complex)
    ok, tau, speed, closing = _two_impact(A, eps)
    if ok:
        trial = _settle(A, eps, tau + math.pi, eps * speed, 2)
        _two_impact_harmonics(A, eps, tau, speed, out)
        radius = trial[6] if trial[0] == 1 else math.nan
        found.append([_attractor(IMPACT, out, A, 1.0, 2.0, False, radius, closing), 0])
    for phi, w in starts:
        status, lap, count, phi, w, contact, radius, closing = _settle(A, eps, phi, w, int(transient))
        out[:] = 0.0
        if status == 2:
            item = _attractor(FREE, out, A, 1.0, 0.0, False, math.nan, 0.0)
        elif status == 1:
            _measure(A, eps, phi, w, count, out)
            length = 0.5 * lap if lap % 2 == 0 else (1.0 if lap == 1 else float(lap))
            rate = 2.0 * count / lap
            item = _attractor(_name(lap, contact), out, A, length, rate, bool(contact), radius, closing)
        else:
            spread = _average(A, eps, phi, w, int(periods), out)
            item = _attractor(APERIODIC, out, A, math.nan, math.nan, False, math.nan, spread)
        for entry in found:
            if _same(entry[0], item, tol):
                entry[1] += 1
                break
        else:
            found.append([item, 1])
    if A <= 0.5 and not any(item.regime == "free" for item, _ in found):
        out[:] = 0.0
        found.append([_attractor(FREE, out, A, 1.0, 0.0, False, math.nan, 0.0), 0])
    found.sort(key=lambda entry: -entry[1])
    return [BacklashAttractor(**{**item.__dict__, "share": hits / len(starts)}) for item, hits in found]


def _attractor(regime, out, A, period, impacts, contact, radius, residual):
    q, mean = complex(-1.0 - out[1]), float(-A * out[0].real)
    name = BACKLASH_REGIMES[regime]
    return BacklashAttractor(name, q, mean, period, impacts, contact, float(radius), float(residual), 0.0)


def _same(one, other, tol):
    if one.regime != other.regime:
        return False
    if one.regime == "aperiodic":
        return abs(one.q - other.q) <= 3 * (one.residual + other.residual) * max(
            abs(1 + one.q), abs(1 + other.q)
        )
    mirrored = abs(abs(one.mean) - abs(other.mean)) <= tol
    return one.period == other.period and abs(one.q - other.q) <= tol * max(1.0, abs(one.q)) and mirrored


# --- the family in dimensionless form ---------------------------------------------------------------------


@njit(cache=True)
def _row(scaled, eps, periods, transient, starts, harmonics, regime, residual):
    """Fill X_k/a in units of 1/((M1 + M2) omega^2) for a row of A."""
    for j in range(scaled.size):
        A = scaled[j]
        out = harmonics[j]
        out[:] = 0.0
        ok, tau, speed, closing = _two_impact(A, eps)
        if ok:
            _two_impact_harmonics(A, eps, tau, speed, out)
            regime[j], residual[j] = IMPACT, closing
            continue
        regime[j], residual[j] = FREE, 0.0
        for n in range(starts.shape[0]):
            w = starts[n, 1] * (1.0 + A)
            status, lap, count, phi, w, contact, _, closing = _settle(A, eps, starts[n, 0], w, transient)
            if status == 1:
                _measure(A, eps, phi, w, count, out)
                regime[j], residual[j] = _name(lap, contact), closing
                break
            if status == 0:
                spread = _average(A, eps, phi, w, periods, out)
                if spread >= 0.0:
                    regime[j], residual[j] = APERIODIC, spread
                    break


@njit(cache=True)
def _name(lap, contact):
    if lap == 1:
        return CONTACT if contact else IMPACT
    return ASYMMETRIC if lap == 2 else SUBHARMONIC


# --- the symmetric motion with two impacts a period -------------------------------------------------------


@njit(cache=True)
def _two_impact(A, eps):
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
        if eps < 0.9:
            v = 2.0 * A * sn / (1.0 - eps)
        else:
            v = 2.0 * (1.0 + 2.0 * A * cs) / (math.pi * (1.0 + eps))
        if v <= 0.0:
            continue
        # Half-period map (tau, v) with the walls exchanged: determinant eps^2.
        trace = 1.0 + eps - A * (2.0 * sn + math.pi * (1.0 + eps) * cs) / v
        if abs(trace) > 1.0 + eps * eps or (abs(trace) == 1.0 + eps * eps and eps < 1.0):
            continue
        if _stays(A, eps, -cs, -sn, eps * v):
            continue
        kind, time, speed = _flight(A, -cs, -sn, eps * v)
        closing = abs(time - math.pi) + abs(speed - v) / v
        if kind == 1 and closing < 1e-6:
            return True, tau, v, closing
    return False, 0.0, 0.0, 0.0


@njit(cache=True)
def _two_impact_harmonics(A, eps, tau, v, out):
    turn = complex(math.cos(tau), -math.sin(tau))
    power = turn
    for k in range(1, out.size, 2):
        out[k] = -(2.0 * (1.0 + eps) * v / (math.pi * A * k * k)) * power
        power *= turn * turn


# --- one flight -------------------------------------------------------------------------------------------


@njit(cache=True)
def _flight(A, c, s, w):
    """Follow the ball from a wall to its next impact: (kind, time, speed).

    Left at speed w >= 0 in phase phi, c = cos(phi), s = sin(phi). Kind 0: back on the same wall, 1: on the
    opposite one, 2: never. The velocity w + A (sin(phi + r) - s) repeats, so that the extremes of xi follow
    in closed form; between two of them xi is monotone, and no impact, grazing included, escapes.
    """
    W = w / A
    reach = c * c + W * (2.0 * s - W)
    drift = w - A * s
    if reach <= 0.0:  # never turns back
        return _impact(A, c, s, w, 0.0, (1.0 + 2.0 * A) / drift, 1)
    # velocity = 0 is a quadratic in tan(r/2); each root in the form that does not cancel
    D = math.sqrt(reach)
    if c >= 0.0:
        top, peak = _extreme(A, c, s, w, c + D, 2.0 * s - W)
    else:
        top, peak = _extreme(A, c, s, w, W, D - c)
    if peak >= 1.0:
        return _impact(A, c, s, w, 0.0, top, 1)
    if c >= 0.0:
        bottom, low = _extreme(A, c, s, w, W, -c - D)
    else:
        bottom, low = _extreme(A, c, s, w, D - c, W - 2.0 * s)
    if low <= 0.0:
        return _impact(A, c, s, w, top, bottom, 0)
    step = 2.0 * math.pi * drift  # shift of the extremes from period to period
    gap = 1.0 - peak if drift > 0.0 else low
    if gap > _LONGEST * abs(step):
        return 2, 0.0, 0.0
    late = 2.0 * math.pi * math.ceil(gap / abs(step))
    if drift > 0.0:
        if _place(A, c, s, w, top + late) < 1.0:
            late += 2.0 * math.pi
        return _impact(A, c, s, w, bottom + late - 2.0 * math.pi, top + late, 1)
    if _place(A, c, s, w, bottom + late) > 0.0:
        late += 2.0 * math.pi
    return _impact(A, c, s, w, top + late, bottom + late, 0)


@njit(cache=True)
def _extreme(A, c, s, w, up, along):
    """Time r in (0, 2 pi] with tan(r/2) = up/along, up >= 0, and xi there."""
    r = 2.0 * math.atan2(up, along)
    size = 2.0 * up / (up * up + along * along)
    return r, w * r + A * (c * size * up - s * _lag(r, size * along))


@njit(cache=True)
def _impact(A, c, s, w, low, high, kind):
    """Time and speed at which xi reaches the wall within a monotone piece, by safeguarded Halley steps."""
    target = 1.0 if kind == 1 else 0.0
    sign = 1.0 if kind == 1 else -1.0
    r = 0.5 * (low + high)
    if kind == 0:
        r = min(r, 2.0 * low)  # steady pressing: twice the time to the top
    v = 0.0
    for _ in range(80):
        h, g = math.sin(0.5 * r), math.cos(0.5 * r)
        sn, versine = 2.0 * h * g, 2.0 * h * h
        miss = sign * (w * r + A * (c * versine - s * _lag(r, sn)) - target)
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
        if abs(move) <= 4e-16 * r:
            break
        if inside and abs(move) <= 1e-6 * r and abs(move * force) <= 1e-6 * v:
            # the next step would be 1e-12 of this one
            jerk = -sign * A * (c * sn + s * (1.0 - versine))
            v += move * (force + 0.5 * move * jerk)
            break
    return kind, r, max(v, 0.0)


@njit(cache=True)
def _place(A, c, s, w, r):
    """Distance xi from the wall a time r after leaving it."""
    return w * r + A * (c * 2.0 * math.sin(0.5 * r) ** 2 - s * _lag(r, math.sin(r)))


@njit(cache=True)
def _lag(r, sn):
    """Return r - sin(r) without cancellation: chatter is made of very short flights."""
    if r > 0.3:
        return r - sn
    x = r * r
    return r * x / 6.0 * (1.0 - x / 20.0 * (1.0 - x / 42.0 * (1.0 - x / 72.0 * (1.0 - x / 110.0))))


@njit(cache=True)
def _stays(A, eps, c, s, w):
    """Whether a ball that leaves at speed w is pressed back for good (complete chatter)."""
    if c >= 0.0:
        return False
    if w == 0.0:
        return True
    left = 2.0 * w / (-A * c * (1.0 - eps)) if eps < 1.0 else np.inf
    return left < _CHATTER and left * abs(s) < 0.01 * -c


@njit(cache=True)
def _wrap(phi):
    return phi - 2.0 * math.pi * math.floor(phi / (2.0 * math.pi) + 0.5)


# --- settling on an attractor -----------------------------------------------------------------------------


@njit(cache=True)
def _event(A, eps, phi, c, s, w):
    """One flight, the impact, and sustained contact if it follows.

    Returns kind, time of flight, time of contact; phi, its cosine and sine, and w after; impact speed.
    """
    kind, time, speed = _flight(A, c, s, w)
    if kind == 2:
        return kind, 0.0, 0.0, phi, c, s, w, 0.0
    phi = _wrap(phi + time + math.pi * kind)
    c, s, w = math.cos(phi), math.sin(phi), eps * speed
    if _stays(A, eps, c, s, w):
        rest = (_RELEASE - phi) % (2.0 * math.pi)
        return kind, time, rest, _RELEASE, 0.0, -1.0, 0.0, speed
    return kind, time, 0.0, phi, c, s, w, speed


@njit(cache=True)
def _settle(A, eps, phi, w, transient):
    """Run until a state recurs (Brent's search) and close the orbit with Newton's method.

    Returns status (0 none found, 1 periodic, 2 free), lap in half periods, impacts of a lap, phi, w, whether
    contact is sustained, largest multiplier of the lap, closing error.
    """
    ref_phi, ref_w, since, power, elapsed, clock, tries = phi, w, 0, 8, 0.0, 0.0, 0
    c, s = math.cos(phi), math.sin(phi)
    for _ in range(_IMPACTS * transient):
        kind, time, rest, phi, c, s, w, _ = _event(A, eps, phi, c, s, w)
        if kind == 2:
            return 2, 0, 0, phi, w, False, 0.0, 0.0
        since += 1
        elapsed += time + rest
        clock += time + rest
        if abs(_wrap(phi - ref_phi)) < _NEAR and abs(w - ref_w) < _NEAR * (1.0 + A) and tries < 100:
            lap = round(elapsed / math.pi)
            if lap >= 1 and abs(elapsed - lap * math.pi) < 2.0 * _NEAR:
                tries += 1
                ok, p, v, contact, radius, closing = _polish(A, eps, phi, w, since, lap)
                if ok:
                    return _shortest(A, eps, p, v, since, lap, contact, radius, closing)
        if since == power:
            ref_phi, ref_w, since, elapsed = phi, w, 0, 0.0
            power = min(2 * power, 4096)
        if clock > 2.0 * math.pi * transient:
            break
    return 0, 0, 0, phi, w, False, 0.0, 0.0


@njit(cache=True)
def _shortest(A, eps, phi, w, count, lap, contact, radius, closing):
    """The answer of `_settle` for a lap that may hold the same orbit several times."""
    for parts in range(lap, 1, -1):
        if lap % parts == 0 and count % parts == 0:
            ok, p, v, con, rad, clo = _polish(A, eps, phi, w, count // parts, lap // parts)
            if ok and abs(_wrap(p - phi)) < _NEAR and abs(v - w) < _NEAR * (1.0 + A):
                return 1, lap // parts, count // parts, p, v, con, rad, clo
    return 1, lap, count, phi, w, contact, radius, closing


@njit(cache=True)
def _polish(A, eps, phi, w, count, lap):
    """Close a lap of `count` impacts by Newton's method on the map (phi, w) and its tangent.

    Returns whether a stable orbit was found, phi, w, contact, largest multiplier, closing error.
    """
    before = np.inf
    for _ in range(15):
        p, c, s, v, total, contact = phi, math.cos(phi), math.sin(phi), w, 0.0, False
        j11, j12, j21, j22 = 1.0, 0.0, 0.0, 1.0
        for _ in range(count):
            p0, c0, s0 = p, c, s
            kind, time, rest, p, c, s, v, speed = _event(A, eps, p, c, s, v)
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
        dp, dw = _wrap(p - phi), v - w
        size = abs(dp) + abs(dw) / (1.0 + A)
        if abs(total - lap * math.pi) > 0.01:
            return False, phi, w, False, 0.0, 0.0
        if size < 1e-14 or (size < 1e-10 and size > 0.25 * before):
            half, det = 0.5 * (j11 + j22), j11 * j22 - j12 * j21
            root = half * half - det
            radius = abs(half) + math.sqrt(root) if root >= 0.0 else math.sqrt(max(det, 0.0))
            return radius < 1.0 + 1e-9 * (eps == 1.0), phi, w, contact, radius, size
        if size > 10.0 * before:
            return False, phi, w, False, 0.0, 0.0
        before = size
        det = (1.0 - j11) * (1.0 - j22) - j12 * j21
        if det == 0.0:
            return False, phi, w, False, 0.0, 0.0
        phi = _wrap(phi + ((1.0 - j22) * dp + j12 * dw) / det)
        w = w + (j21 * dp + (1.0 - j11) * dw) / det
        if not w >= 0.0:
            return False, phi, w, False, 0.0, 0.0
    return False, phi, w, False, 0.0, 0.0


# --- harmonics --------------------------------------------------------------------------------------------


@njit(cache=True)
def _measure(A, eps, phi, w, count, out):
    """Harmonics C_k/(k^2 A), and -mean(y)/A at index 0, of a periodic motion over one lap."""
    side, clock, area = -1.0, 0.0, 0.0
    c, s = math.cos(phi), math.sin(phi)
    wall = np.zeros(out.size, dtype=np.complex128)
    for _ in range(count):
        c0, s0, w0 = c, s, w
        kind, time, rest, phi, c, s, w, speed = _event(A, eps, phi, c, s, w)
        area += side * (0.5 * time - _swept(A, c0, s0, w0, time))
        clock += time + rest
        side = -side if kind == 1 else side
        _push(A, eps, side, phi, rest, rest, speed, wall)
        area += 0.5 * side * rest
    symmetric = round(clock / math.pi) % 2 == 1
    for k in range(1, out.size):
        out[k] = 2.0 * wall[k] / (clock * A * k * k)
    out[0] = -area / (clock * A)
    if symmetric:
        out[::2] = 0.0


@njit(cache=True)
def _average(A, eps, phi, w, periods, out):
    """Project y on the harmonics over blocks of whole periods; returns the spread of N between half windows.

    The spread is estimated from all blocks (twice the standard error of their mean), relative. Returns -1 if
    contact is lost for good, inf (and NaN harmonics) if the bound on impacts is reached first.
    """
    n = out.size
    blocks = min(_BLOCKS, periods)
    length = 2.0 * math.pi * (periods // blocks)
    c, s, side = math.cos(phi), math.sin(phi), -1.0
    tau = phi  # at the lower wall; time counts from here in the forcing phase
    cut = 2.0 * math.pi * math.ceil(tau / (2.0 * math.pi))
    wall = np.zeros(n, dtype=np.complex128)
    mark = np.zeros(n, dtype=np.complex128)
    last = 0j
    area, cuts, squares = 0.0, 0, 0.0
    for _ in range(periods * _IMPACTS):
        c0, s0, w0, side0 = c, s, w, side
        kind, time, rest, phi, c, s, w, speed = _event(A, eps, phi, c, s, w)
        if kind == 2:
            return -1.0
        side = -side if kind == 1 else side
        while cuts <= blocks and tau + time + rest > cut:
            # Integrals up to the cut, e^{-jk tau} = 1 there: int y'' - y' - jk y = (jk)^2 int y.
            mark[:] = wall
            if tau + time > cut:
                r = cut - tau
                y = side0 * (0.5 - _place(A, c0, s0, w0, r))
                rate = -side0 * (w0 + A * (c0 * math.sin(r) - s0 * 2.0 * math.sin(0.5 * r) ** 2))
                mark[0] = area + side0 * (0.5 * r - _swept(A, c0, s0, w0, r))
            else:
                part = cut - tau - time
                y, rate = 0.5 * side, 0.0
                _push(A, eps, side, phi, rest, part, speed, mark)
                mark[0] = area + side0 * (0.5 * time - _swept(A, c0, s0, w0, time)) + y * part
            for k in range(1, n):
                mark[k] -= complex(rate, k * y)
            if cuts == 0:
                out[:] = mark
            else:
                squares += abs(mark[1] - last) ** 2
            last = mark[1]
            cuts += 1
            cut += length
        if cuts > blocks:
            break
        area += side0 * (0.5 * time - _swept(A, c0, s0, w0, time)) + 0.5 * side * rest
        _push(A, eps, side, phi, rest, rest, speed, wall)
        tau += time + rest
    if cuts <= blocks:
        out[:] = complex(np.nan, np.nan)
        return np.inf
    span = length * blocks
    for k in range(n):
        out[k] = (mark[k] - out[k]) * (2.0 / (span * A * k * k) if k > 0 else -1.0 / (span * A))
    mean = 0.5 * abs(out[1]) * length * A
    error = max(squares / blocks - mean * mean, 0.0) / (blocks - 1)
    return 2.0 * math.sqrt(error) / max(mean, 1e-300)


@njit(cache=True)
def _push(A, eps, side, phi, rest, part, speed, wall):
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


@njit(cache=True)
def _swept(A, c, s, w, r):
    """Area under xi over a flight."""
    versine = 2.0 * math.sin(0.5 * r) ** 2
    return 0.5 * w * r * r + A * (c * _lag(r, math.sin(r)) - s * (0.5 * r * r - versine))
