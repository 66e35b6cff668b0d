"""Describing functions of two masses with a gap, exact for Newton's law of impact.

Force ``a cos(omega t)`` on the motor M2, position x1 of the load M1. The total momentum integrates in closed
form; what remains is the place of the motor in the gap, y = (x2 - x1)/h - 1/2, which in the phase
tau = omega t is a ball between two walls,

    y'' = A cos(tau),  |y| <= 1/2,  y' -> -eps y' at a wall,     A = a/(M2 h omega^2),

so that one dimensionless function gives all: with Y_k the harmonics of y and q = Y_1/A,

    N = -(1 + q)/((M1 + M2) omega^2),     X_k/a = -(Y_k/A)/((M1 + M2) omega^2),  k != 1.

The walls alone move the load, hence X_k/a = C_k/(k^2 A (M1 + M2) omega^2) with C_k the harmonics of what the
walls do to y: no flight is ever integrated. What impacts lose a period is pi a^2 (M1/M2) Im N.

Flights are closed forms: `impact_map`. What they lead to is found in `wall_orbits`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...simulate.compiler.compiled import njit
from ..thresholds import (
    ATTRACTOR_PERIODS,
    ATTRACTOR_STARTS,
    ATTRACTOR_TRANSIENT,
    AVERAGE_VAGUE,
    CLOSES,
    FAMILY_PERIODS,
    FIRST_PHASE,
    IMPACT_STARTS,
    MOST_PERIODS,
)
from .friction import _require, checked_orders, positive_axis
from .impact_map import two_impact as _two_impact
from .impact_map import two_impact_harmonics as _two_impact_harmonics
from .wall_orbits import RELEASE as _RELEASE
from .wall_orbits import average as _average
from .wall_orbits import measure as _measure
from .wall_orbits import settle as _settle

BACKLASH_REGIMES = (
    "impact", "contact", "asymmetric", "subharmonic", "aperiodic", "free",
    *(f"subharmonic {k}" for k in range(2, MOST_PERIODS)),
)  # fmt: skip
IMPACT, CONTACT, ASYMMETRIC, SUBHARMONIC, APERIODIC, FREE = range(6)


def backlash_family(
    motor_mass,
    load_mass,
    gap,
    restitution,
    A,
    omega,
    orders=9,
    periods=FAMILY_PERIODS,
    transient=ATTRACTOR_TRANSIENT,
    progress=None,
):
    """Harmonics of the load position of two masses with a gap, under ``F = a cos(omega t)`` on the motor.

    Where several motions coexist the result is, in this order: the symmetric motion with two impacts a
    period if it exists and is stable; else the motion that a release from sustained contact leads to; else
    (no contact remains, or the average of an irregular motion says little) those that four impacts of
    different phase and speed lead to. `backlash_attractors` lists all.

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
    regime : int16 array (na, nw)
        Index into `BACKLASH_REGIMES`: ``impact`` (half-wave symmetric, no sustained contact), ``contact``
        (half-wave symmetric, chatter complete), ``asymmetric`` (one period, not symmetric), ``subharmonic k``
        (repeats after k periods), ``aperiodic`` (no period found within `transient`), ``free`` (no impacting
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
    regime = np.empty(harmonics.shape[:2], dtype=np.int16)
    residual = np.empty(harmonics.shape[:2])
    for i, a in enumerate(amplitudes):
        scaled = a / (motor_mass * gap * frequencies**2)
        _row(
            scaled,
            float(restitution),
            int(periods),
            int(transient),
            IMPACT_STARTS,
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
        Largest modulus over one orbit (half a period of a symmetric motion); NaN if aperiodic or free.
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


def backlash_attractors(
    A, restitution, phases=ATTRACTOR_STARTS[0], speeds=ATTRACTOR_STARTS[1], periods=ATTRACTOR_PERIODS,
    transient=ATTRACTOR_TRANSIENT, tol=CLOSES,
):  # fmt: skip
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
    for phase in np.arange(phases) * (2 * math.pi / phases) + FIRST_PHASE:
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
        status, halves, count, phi, w, contact, radius, closing = _settle(A, eps, phi, w, int(transient))
        out[:] = 0.0
        if status == 2:
            item = _attractor(FREE, out, A, 1.0, 0.0, False, math.nan, 0.0)
        elif status == 1:
            _measure(A, eps, phi, w, count, out)
            length = 0.5 * halves if halves % 2 == 0 else (1.0 if halves == 1 else float(halves))
            rate = 2.0 * count / halves
            item = _attractor(_name(halves, contact), out, A, length, rate, bool(contact), radius, closing)
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


@njit(nogil=True)
def _row(scaled, eps, periods, transient, starts, harmonics, regime, residual):
    """Fill X_k/a in units of 1/((M1 + M2) omega^2) for a row of A."""
    mean = np.zeros(harmonics.shape[1], dtype=np.complex128)
    for j in range(scaled.size):
        A = scaled[j]
        out = harmonics[j]
        out[:] = 0.0
        ok, tau, speed, closing = _two_impact(A, eps)
        if ok:
            _two_impact_harmonics(A, eps, tau, speed, out)
            regime[j], residual[j] = IMPACT, closing
            continue
        regime[j], residual[j], least = FREE, 0.0, np.inf
        for n in range(starts.shape[0]):
            w = starts[n, 1] * (1.0 + A)
            status, halves, count, phi, w, contact, _, closing = _settle(A, eps, starts[n, 0], w, transient)
            if status == 1:
                out[:] = 0.0
                _measure(A, eps, phi, w, count, out)
                regime[j], residual[j] = _name(halves, contact), closing
                break
            if status == 0:
                mean[:] = 0.0
                spread = _average(A, eps, phi, w, periods, mean)
                if spread >= 0.0 and (spread < least or regime[j] == FREE):
                    for k in range(mean.size):
                        out[k] = mean[k]
                    regime[j], residual[j], least = APERIODIC, spread, spread
                if 0.0 <= spread < AVERAGE_VAGUE:
                    break


@njit(cache=True)
def _name(halves, contact):
    """Index into `BACKLASH_REGIMES` of a motion that closes after `halves` half periods."""
    if halves == 1:
        return CONTACT if contact else IMPACT
    if halves == 2:
        return ASYMMETRIC
    # an odd number of half periods mirrors the motion: it repeats after twice as many
    periods = halves if halves % 2 == 1 else halves // 2
    return min(FREE - 1 + periods, FREE + MOST_PERIODS - 2)
