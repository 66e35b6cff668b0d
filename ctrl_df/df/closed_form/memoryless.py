"""Describing functions of memoryless and simple hysteretic elements.

Every routine returns the Fourier coefficients of the steady output y(theta) for the input ``a cos(theta)``,

    y = Y_0 + Re sum_k Y_k exp(j k theta),

divided by ``a``, as a complex array of shape (na, orders + 1). Laws made of straight lines (saturation,
relays, dead zone, quantizer, play, rate limiter ...) are arcs ``c0 + c1 cos(theta) + c2 theta`` between
switching angles and integrate in closed form; any other law goes through adaptive quadrature split at its
corners.
"""

from __future__ import annotations

import math

import numpy as np

from ...blocks.primitives import PiecewiseAffine, Play, Quantizer, RateLimiter, Smooth
from ...thresholds import NOTHING
from ..thresholds import EVEN_SEEN, MOST_STAIRS, ROOT, SAMPLES
from .quadrature import sample_error, static_harmonics


def element_harmonics(element, amplitudes, omega=None, orders: int = 9):
    """Return harmonics (na, orders + 1), regimes (na,) and residual (na,) of an `Element`.

    Parameters
    ----------
    element : Element
        A block of `ctrl_df.blocks.elements.memoryless` or `ctrl_df.blocks.elements.hysteresis`.
    amplitudes : ndarray, shape (na,)
        Peak values of the input, > 0.
    omega : float, optional
        Angular frequency [rad/s]; a rate limiter needs it.
    orders : int
        Highest harmonic.

    Returns
    -------
    harmonics : ndarray of complex, shape (na, orders + 1)
        Y_k / a, the mean first. NaN where the output depends on history (relay inside its hysteresis).
    regime : list of str
        ``memoryless``, ``asymmetric`` (a mean or even harmonics), ``hysteresis``, ``stuck`` (the output
        rests), ``linear`` or ``rate-limited``.
    residual : ndarray, shape (na,)
        Estimated error of the harmonics, relative to a.
    """
    primitive = element.primitive
    a = np.asarray(amplitudes, dtype=float)
    residual = np.full(a.shape, ROOT)
    if element.kind == "cubic":
        y = _cubic(a, primitive.p[0], orders)
    elif isinstance(primitive, Smooth):
        y, residual = static_harmonics(primitive.value, a, orders)
    elif isinstance(primitive, Quantizer):
        y = _quantizer(a, primitive.step, orders)
    elif isinstance(primitive, Play):
        return _play(a, primitive.gap / 2, orders), _stuck_below(a, primitive.gap / 2), residual
    elif isinstance(primitive, RateLimiter):
        return _rate_limiter_family(a, primitive.rate, omega, orders, residual)
    elif isinstance(primitive, PiecewiseAffine) and primitive.hysteretic:
        y = np.array([_hysteretic(primitive, v, orders) for v in a]).reshape(a.size, orders + 1)
        return y, ["stuck" if np.isnan(row[1]) else "hysteresis" for row in y], residual
    else:
        y = _broken_line(primitive, a, orders)
    return y, static_regimes(y), residual


def static_regimes(y) -> list[str]:
    """Name the regime of memoryless answers: asymmetric if the mean or an even harmonic is there."""
    size = np.abs(y).max(axis=1) + NOTHING
    even = np.abs(y[:, ::2]).max(axis=1) > EVEN_SEEN * size
    return ["asymmetric" if e else "memoryless" for e in even]


# --- arcs between switching angles --------------------------------------------------------------------------


def arcs_harmonics(arcs, orders: int) -> np.ndarray:
    """Fourier coefficients of a signal given as arcs over one period.

    Parameters
    ----------
    arcs : sequence of (start, end, c0, c1, c2)
        ``y = c0 + c1 cos(theta) + c2 theta`` for start <= theta <= end [rad]; together they cover 2 pi.
    orders : int
        Highest harmonic.
    """
    k = np.arange(orders + 1)
    total = np.zeros(orders + 1, dtype=complex)
    for start, end, c0, c1, c2 in arcs:
        if end > start:
            total += c0 * _turn(-k, start, end)
            total += 0.5 * c1 * (_turn(1 - k, start, end) + _turn(-1 - k, start, end))
            if c2:
                total += c2 * _ramp(-k, start, end)
    total[0] /= 2
    return total / math.pi


def _turn(m, start, end):
    """Integral of exp(j m theta) for an integer array m, exact at m = 0."""
    half, mid = 0.5 * (end - start), 0.5 * (end + start)
    return 2 * half * np.sinc(m * half / math.pi) * np.exp(1j * m * mid)


def _ramp(m, start, end):
    """Integral of theta exp(j m theta) for an integer array m."""
    out = np.full(m.shape, 0.5 * (end**2 - start**2), dtype=complex)
    n = m[m != 0]
    out[m != 0] = (end * np.exp(1j * n * end) - start * np.exp(1j * n * start)) / (1j * n) - _turn(
        n, start, end
    ) / (1j * n)
    return out


def _broken_line(line: PiecewiseAffine, a, orders):
    """Memoryless piecewise affine law: even in theta, so twice the integral over half a period."""
    k = np.arange(orders + 1)
    low = np.arccos(np.clip(np.array(line.high)[None, :] / a[:, None], -1, 1))[..., None]
    high = np.arccos(np.clip(np.array(line.low)[None, :] / a[:, None], -1, 1))[..., None]
    slope = np.array(line.slope)[None, :, None]
    intercept = np.array(line.intercept)[None, :, None] / a[:, None, None]

    def cosine(m):
        half, mid = 0.5 * (high - low), 0.5 * (high + low)
        return 2 * half * np.sinc(m * half / math.pi) * np.cos(m * mid)

    y = (intercept * cosine(k) + 0.5 * slope * (cosine(k + 1) + cosine(k - 1))).sum(axis=1)
    y[:, 0] /= 2
    return (2 / math.pi * y).astype(complex)


def _cubic(a, c, orders):
    y = np.zeros((a.size, orders + 1), dtype=complex)
    for k, weight in ((1, 0.75), (3, 0.25)):
        if k <= orders:
            y[:, k] = weight * c * a**2
    return y


def _quantizer(a, step, orders):
    """Each stair edge (m - 1/2) step is a relay pair: Y_k = 4 step / (pi k) sum sin(k theta_m), k odd."""
    y = np.zeros((a.size, orders + 1), dtype=complex)
    odd = np.arange(1, orders + 1, 2)
    for i, amplitude in enumerate(a):
        stairs = math.floor(amplitude / step + 0.5)
        if stairs > MOST_STAIRS:  # N - 1 is of order (step/a)^(3/2), below 4e-10 here
            y[i, 1] = 1.0
            continue
        theta = np.arccos(np.minimum((np.arange(1, stairs + 1) - 0.5) * step / amplitude, 1.0))
        for k in odd:
            y[i, k] = 4 * step / (math.pi * k * amplitude) * np.sin(k * theta).sum()
    return y


def _hysteretic(line: PiecewiseAffine, a: float, orders: int):
    """Overlapping regions: walk one period from the positive peak, where the input has come from below."""
    top = line.region(a, line.region(-a, line.region(a)))
    arcs, region, theta, switches = [], top, 0.0, 0
    for direction, turn in ((-1, math.pi), (1, 2 * math.pi)):
        while True:
            edge = line.low[region] if direction < 0 else line.high[region]
            leaves = -a < edge if direction < 0 else edge < a
            if not leaves:
                break
            angle = math.acos(min(max(edge / a, -1.0), 1.0))
            angle = angle if direction < 0 else 2 * math.pi - angle
            angle = max(angle, theta)
            arcs.append((theta, angle, line.intercept[region], line.slope[region] * a, 0.0))
            theta, switches = angle, switches + 1
            region = line.below[region] if direction < 0 else line.above[region]
        arcs.append((theta, turn, line.intercept[region], line.slope[region] * a, 0.0))
        theta = turn
    holding = sum(lo <= -a and a <= hi for lo, hi in zip(line.low, line.high, strict=True))
    if switches == 0 and holding > 1:  # which branch it rests on is a matter of history
        return np.full(orders + 1, np.nan + 0j)
    return arcs_harmonics(arcs, orders) / a


# --- play and rate limiter ----------------------------------------------------------------------------------


def _stuck_below(a, half):
    return ["stuck" if v <= half else "hysteresis" for v in a]


def _play(a, half, orders):
    """Friction-driven backlash: held from the peak until the gap is crossed, then driven."""
    y = np.zeros((a.size, orders + 1), dtype=complex)
    for i, v in enumerate(a):
        if v <= half:
            continue
        r = half / v
        free = math.acos(max(1 - 2 * r, -1.0))
        arcs = []
        for shift, sign in ((0.0, 1.0), (math.pi, -1.0)):
            arcs.append((shift, shift + free, sign * (1 - r), 0.0, 0.0))
            arcs.append((shift + free, shift + math.pi, sign * r, 1.0, 0.0))
        y[i] = arcs_harmonics(arcs, orders)
    return y


def _rate_limiter_family(a, rate, omega, orders, residual):
    if omega is None or not np.isfinite(omega):
        raise ValueError(
            "a rate limiter's describing function depends on frequency: N(A, omega). Give omega [rad/s]."
        )
    y = np.array([_rate_limiter(v * omega / rate, orders) for v in a]).reshape(a.size, orders + 1)
    return y, ["linear" if v * omega <= rate else "rate-limited" for v in a], residual


# Beyond this a*omega/rate the output never catches the input before it turns: sqrt(1 + pi^2/4).
ALWAYS_LIMITED = math.hypot(1.0, math.pi / 2)


def _rate_limiter(excess: float, orders: int):
    """Rate limiter on cos(theta), theta = omega t, with `excess` = a omega / rate, the only parameter."""
    if excess <= 1:
        y = np.zeros(orders + 1, dtype=complex)
        y[1] = 1.0
        return y
    slope = 1 / excess
    if excess >= ALWAYS_LIMITED:  # a triangle whose corners lie on the cosine
        corner = math.acos(math.pi * slope / 2)
        arcs = [(corner, corner + math.pi, slope * (math.pi / 2 + corner), 0.0, -slope)]
    else:  # follows the cosine, leaves it where that gets too fast, meets it again past the middle
        from scipy.optimize import brentq

        leave = math.asin(slope)

        def ahead(theta):
            return math.cos(leave) - slope * (theta - leave) - math.cos(theta)

        meet = brentq(ahead, math.pi / 2, leave + math.pi, xtol=ROOT, rtol=np.float64(ROOT))
        arcs = [
            (leave, meet, math.cos(leave) + slope * leave, 0.0, -slope),
            (meet, leave + math.pi, 0.0, 1.0, 0.0),
        ]
    # The second half period is the negative of the first: even harmonics cancel, odd ones double.
    half = arcs_harmonics(arcs, orders)
    half[::2] = 0
    return 2 * half


# --- anything callable --------------------------------------------------------------------------------------


def callable_harmonics(f, amplitudes, orders: int = 9):
    """Return harmonics, regimes and residual of a static law ``y = f(u)`` by adaptive quadrature.

    Parameters
    ----------
    f : callable
        Scalar in, scalar out; need not accept arrays.
    amplitudes : ndarray, shape (na,)
        > 0.
    """
    y, residual = static_harmonics(f, np.asarray(amplitudes, dtype=float), orders)
    return y, static_regimes(y), residual


def swept_harmonics(f, amplitudes, orders: int = 9, samples: int = SAMPLES):
    """Return harmonics, regimes and residual of a callable that keeps its own memory.

    It is called in the order of time: one period to settle, one to measure, `samples` calls each. A jump
    falls between two samples, so the error is about its height over `samples`; `residual` estimates it. A
    block that holds its memory as a state (`play`, `relay_with_hysteresis`) is exact instead.
    """
    amplitudes = np.asarray(amplitudes, dtype=float)
    theta = (np.arange(samples) + 0.5) * 2 * np.pi / samples
    wave = np.cos(theta)
    kernel = np.exp(-1j * np.outer(np.arange(orders + 1), theta)) * 2 / samples
    kernel[0] /= 2
    y = np.empty((amplitudes.size, orders + 1), dtype=complex)
    residual = np.empty(amplitudes.size)
    for i, a in enumerate(amplitudes):
        for u in a * wave:
            f(u)
        out = np.array([f(u) for u in a * wave])
        y[i] = kernel @ out / a
        residual[i] = sample_error(out) / a
    return y, ["hysteresis"] * amplitudes.size, residual
