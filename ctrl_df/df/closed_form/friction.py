"""Describing functions of a mass with dry and viscous friction, in closed form.

With theta = omega t, kappa = K/a, sigma = Ks/a, beta = B/(M omega) and the velocity u in units of
a/(M omega), a mass that slides forward obeys

    du/dtheta + beta u = cos(theta) - kappa

and three numbers (kappa, sigma, beta) decide everything. All motions are half-wave symmetric:

- *stuck*, sigma >= 1: the force never reaches the static level;
- *slip*: the mass reverses without stopping. Its phase psi0 follows from u(psi0) = u(psi0 + pi) = 0, which
  fixes the constants that eq. (6) of Azenha & Machado (1997) leaves open;
- *stick-slip*: it breaks away at psi_s = -arccos(sigma), slides until u = 0 and waits for the next half
  period.

The arc that starts from rest at psi_s decides between the last two: u(psi_s + pi) > 0 means it never stops.
An arc from breakaway never outlasts the reversed force: without friction and damping it ends at the phase
pi + arccos(sigma), where the force falls below Ks again, and either one ends it earlier. So no motion is
one-sided, and a mass that stops before psi_s + pi stops under less than Ks.

The harmonics need no velocity, only the force along the arc: as u vanishes at both of its ends,
(jk + beta) int u e^{-jk theta} = int (cos(theta) - kappa) e^{-jk theta}.
"""

from __future__ import annotations

import math

import numpy as np

from ...simulate.compiler.compiled import njit, part
from ...thresholds import HALVINGS, SQRT_EPS
from ..thresholds import ARC_NODES, DIGIT, PANEL, SERIES_END, SERIES_TERMS, SHORT_ARC

FRICTION_REGIMES = ("slip", "stick-slip", "stuck")
SLIP, STICK_SLIP, STUCK = 0, 1, 2

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(ARC_NODES)
_NODES, _WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS


def friction_family(mass, coulomb, viscous, static, A, omega, orders=9):
    """Harmonics of the position of a mass with dry and viscous friction under ``F = a cos(omega t)``.

    Parameters
    ----------
    mass : float
        M [kg], > 0.
    coulomb, viscous : float
        K [N] >= 0 and B [N s/m] >= 0.
    static : float or None
        Breakaway level Ks [N], >= `coulomb`; None means `coulomb`.
    A, omega : array_like
        Force amplitudes [N] and frequencies [rad/s], 1-D, > 0; shapes (na,) and (nw,).
    orders : int
        Highest harmonic, >= 1.

    Returns
    -------
    harmonics : complex array (na, nw, orders + 1)
        X_k/a [m/N], x = Re sum X_k e^{jk omega t}; index 1 is N(a, omega). Even orders are zero by
        symmetry, and so is index 0 by convention (the mean position is wherever the mass started). NaN
        where the mass is stuck.
    regime : int8 array (na, nw)
        Index into `FRICTION_REGIMES`.
    residual : float array (na, nw)
        Velocity left at the end of the half period (slip) or of the arc (stick-slip), over the peak velocity
        (the peak within a factor of two). NaN where stuck.

    Raises
    ------
    ValueError
        A value out of range; the message gives rule, value, remedy.
    """
    _require("mass", mass, 0.0, strict=True)
    for name, value in dict(coulomb=coulomb, viscous=viscous).items():
        _require(name, value, 0.0)
    static = coulomb if static is None else static
    _require("static", static, coulomb, remedy="Breakaway needs at least the kinetic level.")
    amplitudes, frequencies = positive_axis("A", A, "N"), positive_axis("omega", omega, "rad/s")
    orders = checked_orders(orders)
    shape = (amplitudes.size, frequencies.size)
    harmonics = np.zeros((*shape, orders + 1), dtype=complex)
    regime = np.zeros(shape, dtype=np.int8)
    residual = np.zeros(shape)
    _family(
        float(mass),
        float(coulomb),
        float(viscous),
        float(static),
        amplitudes,
        frequencies,
        harmonics,
        regime,
        residual,
    )
    return harmonics, regime, residual


def positive_axis(name, values, unit):
    """Return a 1-D float array of an axis of the family, or raise ValueError."""
    axis = np.ascontiguousarray(np.atleast_1d(np.asarray(values, dtype=float)))
    if axis.ndim != 1 or axis.size == 0:
        raise ValueError(f"a family needs {name} as a non-empty 1-D array [{unit}]; got shape {axis.shape}.")
    bad = axis[~((axis > 0) & np.isfinite(axis))]
    if bad.size:
        raise ValueError(
            f"a family needs {name} > 0 and finite [{unit}]; got {name}={bad[0]:g}. Leave that point out."
        )
    return axis


def checked_orders(orders):
    """Return the highest harmonic as an int, or raise ValueError."""
    if int(orders) != orders or orders < 1:
        raise ValueError(f"a family needs orders as an integer >= 1 (highest harmonic); got {orders!r}.")
    return int(orders)


def _require(name, value, lower, strict=False, upper=math.inf, remedy="Check the value and its unit (SI)."):
    ok = math.isfinite(value) and (value > lower if strict else value >= lower) and value <= upper
    if not ok:
        above = "" if math.isinf(upper) else f" and <= {upper:g}"
        rule = f"{name} {'>' if strict else '>='} {lower:g}{above} and finite"
        raise ValueError(f"a family needs {rule}; got {name}={value!r}. {remedy}")


@njit(error_model="numpy", nogil=True)
def _family(M, K, B, Ks, amplitudes, frequencies, harmonics, regime, residual):
    nw = frequencies.size
    half = np.empty((nw, 3))
    for j in range(nw):
        E, S, C, _, _ = _responses(B / (M * frequencies[j]), math.pi)
        half[j, 0], half[j, 1], half[j, 2] = E, S, C
    for i in range(amplitudes.size):
        a = amplitudes[i]
        if a <= Ks:
            harmonics[i] = complex(np.nan, np.nan)
            regime[i] = STUCK
            residual[i] = np.nan
            continue
        kappa, sigma, rise = K / a, Ks / a, (Ks - K) / a
        # Angles from differences of forces: exact however close a is to a level.
        sine = math.sqrt((a - Ks) / a * (1.0 + sigma))
        delta = math.atan2(sine, sigma)
        falls = math.atan2(math.sqrt((a - K) / a * (1.0 + kappa)), kappa)  # F = K, falling
        for j in range(nw):
            w = frequencies[j]
            beta = B / (M * w)
            E, S, C = half[j, 0], half[j, 1], half[j, 2]
            out = harmonics[i, j]
            if rise * E + sigma * C + sine * S > 0.0:
                regime[i, j] = SLIP
                residual[i, j] = _slip(kappa, beta, falls, E, S, C, out)
            else:
                regime[i, j] = STICK_SLIP
                residual[i, j] = _stick_slip(kappa, sigma, rise, sine, delta, falls, beta, out)
            scale = 1.0 / (M * w) / w
            for k in range(1, out.size, 2):
                out[k] *= scale


@part
def _slip(kappa, beta, falls, E, S, C, out):
    """Sliding without stop: the input less a square wave of height kappa that starts at psi0."""
    # p(psi0) = -(kappa/beta) tanh(pi beta/2), p the particular solution cos(theta + phi)/sqrt(1 + beta^2)
    x = 0.5 * math.pi * beta
    if beta > 1.0:
        c = -kappa * math.tanh(x) * math.sqrt(1.0 + 1.0 / beta / beta)
    else:
        ratio = math.tanh(x) / x if x > SQRT_EPS else 1.0
        c = -kappa * 0.5 * math.pi * ratio * math.sqrt(1.0 + beta * beta)
    s = -math.sqrt(max((1.0 - c) * (1.0 + c), 0.0))
    norm = math.hypot(1.0, beta)
    along, across = beta / norm, 1.0 / norm
    cos0, sin0 = c * along - s * across, s * along + c * across
    turn = complex(cos0, -sin0)
    square = turn * turn
    power = turn
    for k in range(1, out.size, 2):
        drive = (4.0 * kappa / (math.pi * k)) * (1j * power)
        if k == 1:
            drive += 1.0
        out[k] = drive * _position(k, beta)
        power *= square
    rise = cos0 - kappa
    left = rise * E + cos0 * C - sin0 * S
    return abs(left) / _speed(rise, cos0, -sin0, beta, falls - math.atan2(sin0, cos0))


@part
def _stick_slip(kappa, sigma, rise, sine, delta, falls, beta, out):
    """One slip arc from rest a half period; returns the velocity left at its end, relative."""
    low, high = delta + falls, math.pi
    peak = _speed(rise, sigma, sine, beta, low)
    # Newton from the small-angle arc without damping, or from the quasi-steady one: both lie near the root.
    s = min(0.5 * (3.0 * delta + math.sqrt(9.0 * delta * delta + 24.0 * rise)), high)
    if beta > 0.0:
        s = min(s, low + 1.0 / beta)
    left = 0.0
    for _ in range(HALVINGS):
        E, S, C, sn, vs = _responses(beta, s)
        left = rise * E + sigma * C + sine * S
        slope = rise - sigma * vs + sine * sn - beta * left
        if left > 0.0:
            low = s
        elif left < 0.0:
            high = s
        else:
            break
        new = s - left / slope if slope < 0.0 else low
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - s) <= DIGIT * s:
            break
        s = new
    if s >= SHORT_ARC:
        _long_arc(kappa, delta, s, beta, out)
    else:
        _short_arc(sigma, rise, sine, delta, s, beta, out)
    return abs(left) / peak


@part
def _speed(rise, sigma, sine, beta, s):
    """Peak velocity of an arc, within a factor of two: where F = K falling, or half way when overdamped."""
    E, S, C, _, _ = _responses(beta, s if beta < 1.0 else 0.5 * s)
    return rise * E + sigma * C + sine * S


@part
def _long_arc(kappa, delta, s, beta, out):
    """Integrate the force over the arc in closed form: int (cos(theta) - kappa) e^{-jk theta}."""
    middle, h = 0.5 * s - delta, 0.5 * s
    z = complex(math.cos(middle), -math.sin(middle))
    wide = complex(math.cos(h), math.sin(h))
    before = complex(s, 0.0)  # int e^{-j(k-1) theta}
    power, width = z, wide
    for k in range(1, out.size, 2):
        here = power * (2.0 * width.imag / k)
        power *= z
        width *= wide
        after = power * (2.0 * width.imag / (k + 1))
        power *= z
        width *= wide
        out[k] = (2.0 / math.pi) * (0.5 * (before + after) - kappa * here) * _position(k, beta)
        before = after


@part
def _short_arc(sigma, rise, sine, delta, s, beta, out):
    """Gauss's rule over the velocity, or over the force where the velocity has a boundary layer."""
    damped = beta * s >= 1.0
    orders = out.size - 1
    panels = 1 + int(orders * s / PANEL)
    width = s / panels
    for p in range(panels):
        for n in range(_NODES.size):
            r = (p + _NODES[n]) * width
            if damped:
                vs = 2.0 * math.sin(0.5 * r) ** 2
                value = rise - sigma * vs + sine * math.sin(r)
            else:
                E, S, C, _, _ = _responses(beta, r)
                value = rise * E + sigma * C + sine * S
            value *= _WEIGHTS[n] * width
            turn = complex(math.cos(r), -math.sin(r))
            square = turn * turn
            for k in range(1, orders + 1, 2):
                out[k] += value * turn
                turn *= square
    start = complex(math.cos(delta), math.sin(delta))
    square = start * start
    for k in range(1, orders + 1, 2):
        out[k] *= (2.0 / math.pi) * start * (_position(k, beta) if damped else 1.0 / complex(0.0, k))
        start *= square


@part
def _position(k, beta):
    """1/(jk (jk + beta)): force harmonic to position harmonic; no overflow for any beta."""
    unit = 1.0 / max(1.0, beta)
    size = k * (k * k * unit + beta * (beta * unit))
    return complex(-k * unit / size, -beta * unit / size)


@part
def _responses(beta, s):
    """Velocity a time s after rest under forces 1, sin and cos - 1: (E, S, C), then sin(s) and 1 - cos(s).

    Each is relatively accurate for every beta >= 0 and s in (0, 2 pi), beta = 0 included.
    """
    sn = math.sin(s)
    vs = 2.0 * math.sin(0.5 * s) ** 2
    x = beta * s
    lost = -math.expm1(-x)
    E = lost / beta if x > SQRT_EPS else s * (1.0 - 0.5 * x)
    if x >= 1.0:
        S = (sn + (vs - lost) / beta) / (beta + 1.0 / beta)
        return E, S, (S - vs) / beta, sn, vs
    if s >= SHORT_ARC:
        S = (beta * sn + vs - lost) / (1.0 + beta * beta)
        return E, S, (beta * (lost - vs) + sn) / (1.0 + beta * beta) - E, sn, vs
    # Taylor: S' = sin - beta S, C' = -S
    sine, term, S, C = s, 0.5 * s * s, 0.0, 0.0
    for n in range(2, SERIES_TERMS):
        S += term
        C -= term * s / (n + 1)
        if abs(term) + abs(s * sine) < SERIES_END * S:
            break
        even = n % 2 == 0
        term = ((0.0 if even else s * sine) - x * term) / (n + 1)
        if even:
            sine *= -s * s / (n * (n + 1))
    return E, S, C, sn, vs
