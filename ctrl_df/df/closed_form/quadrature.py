"""Fourier coefficients of an arbitrary static law by adaptive quadrature split at its corners."""

from __future__ import annotations

import math

import numpy as np

from ...thresholds import HALVINGS, NOTHING
from ..thresholds import (
    CORNER,
    CORNER_LEAST,
    CORNER_WINDOW,
    DEPTH,
    DIGIT,
    INTERVAL_SHARE,
    JUMPS,
    LAW_PROBES,
    MOST_CORNERS,
    MOST_INTERVALS,
    NULL_SHARE,
    QUADRATURE_RTOL,
    ROOT,
    SCAN_LEAST,
    SCAN_POINTS,
    SHARPENED,
    SHARPENED_POWER,
)
from .kronrod import NULL, WG, WK, X


def static_harmonics(f, amplitudes, orders: int = 9, rtol: float = QUADRATURE_RTOL):
    """Harmonics of ``y = f(a cos theta)`` for every amplitude, divided by the amplitude.

    A static law makes y even in theta, so Y_k = (2/pi) integral over half a period of f(a cos theta) cos(k
    theta). Corners and jumps of `f`, found once for all amplitudes, split the interval; one that escapes
    costs bisections, not accuracy.

    Parameters
    ----------
    f : callable
        Static law; called with arrays if it agrees with its own scalar values, else point by point.
    amplitudes : ndarray, shape (na,)
        > 0.
    orders : int
        Highest harmonic.
    rtol : float
        Aim for the error relative to the largest |y| of that amplitude.

    Returns
    -------
    harmonics : ndarray of complex, shape (na, orders + 1)
    error : ndarray, shape (na,)
        Estimate of the largest error among the harmonics.

    Raises
    ------
    ValueError
        If the law returns NaN or infinity.
    """
    amplitudes = np.asarray(amplitudes, dtype=float)
    if amplitudes.size == 0:
        return np.zeros((0, orders + 1), dtype=complex), np.zeros(0)
    scan = scan_points(amplitudes.min(), amplitudes.max())
    law = Law(f, scan)
    corners = find_corners(law, scan)
    owner, left, right = _first_intervals(amplitudes, corners)
    k = np.arange(orders + 1)
    total = np.zeros((amplitudes.size, orders + 1))
    error = np.zeros(amplitudes.size)
    scale = np.full(amplitudes.size, NOTHING)
    calls = 0
    for depth in range(DEPTH + 1):
        half = 0.5 * (right - left)
        theta = 0.5 * (left + right)[:, None] + half[:, None] * X
        y = law(amplitudes[owner][:, None] * np.cos(theta))
        np.maximum.at(scale, owner, np.abs(y).max(axis=1))
        basis = np.cos(k[None, :, None] * theta[:, None, :]) * y[:, None, :]
        kronrod = (basis @ WK) * half[:, None]
        gap = np.abs((basis @ (WK - WG)) * half[:, None]).max(axis=1)
        gap = np.maximum(gap, NULL_SHARE * np.abs(basis @ NULL).max(axis=(1, 2)) * half)
        # The classical sharpening: the Kronrod sum is far better than its distance to the Gauss sum.
        size = np.abs(y).max(axis=1) * half + NOTHING
        estimate = size * np.minimum(1.0, (SHARPENED * gap / size) ** SHARPENED_POWER)
        good = (estimate <= INTERVAL_SHARE * rtol * scale[owner]) | (gap <= DIGIT * scale[owner])
        calls += owner.size
        if depth == DEPTH or calls > MOST_INTERVALS * amplitudes.size:
            good[:] = True
        np.add.at(total, owner[good], kronrod[good])
        np.add.at(error, owner[good], estimate[good])
        if good.all():
            break
        owner, left, right = owner[~good], left[~good], right[~good]
        middle = 0.5 * (left + right)
        owner = np.concatenate([owner, owner])
        left, right = np.concatenate([left, middle]), np.concatenate([middle, right])
    total *= 2 / math.pi
    total[:, 0] /= 2
    return (total / amplitudes[:, None]).astype(complex), error * 2 / math.pi / amplitudes


class Law:
    """A user's static law, called with arrays where that gives the same values, and checked for NaN.

    Parameters
    ----------
    f : callable
    probed : ndarray
        Arguments among which it is asked for that.
    """

    def __init__(self, f, probed):
        self._f = f
        self._arrays = self._accepts_arrays(probed)

    def __call__(self, u):
        """Evaluate elementwise."""
        y = self._as_array(u) if self._arrays else self._point_by_point(u)
        if not np.isfinite(y).all():
            bad = u.ravel()[np.argmin(np.isfinite(y.ravel()))]
            raise ValueError(
                f"the nonlinearity must return finite numbers; got {self._scalar(bad)} at u = {bad:g}. "
                "Give amplitudes within the law's domain."
            )
        return y

    def _scalar(self, u):
        y = np.asarray(self._f(float(u)), dtype=float)
        if y.size != 1:
            raise ValueError(
                f"the nonlinearity must return one number; got shape {y.shape}. Choose one with output=."
            )
        return float(y.reshape(()) if y.ndim == 0 else y.ravel()[0])

    def _point_by_point(self, u):
        return np.array([self._scalar(v) for v in u.ravel()]).reshape(u.shape)

    def _as_array(self, u):
        return np.asarray(self._f(u.ravel()), dtype=float).reshape(u.shape)

    def _accepts_arrays(self, u):
        flat = u.ravel()
        probe = flat[np.linspace(0, flat.size - 1, min(flat.size, LAW_PROBES)).astype(int)]
        single = self._point_by_point(probe)
        try:
            with np.errstate(all="ignore"):
                together = np.asarray(self._f(probe), dtype=float).ravel()
        except Exception:  # a law written for scalars may fail on arrays in any way; its scalar values stand
            return False
        return together.shape == single.shape and np.array_equal(together, single, equal_nan=True)


def scan_points(smallest: float, largest: float) -> np.ndarray:
    """Return arguments in [-largest, largest], evenly spaced and in ratios, at which corners show."""
    fine = np.geomspace(max(smallest, SCAN_LEAST * largest), largest, SCAN_POINTS // 4)
    side = np.unique(np.concatenate([fine, np.linspace(largest / SCAN_POINTS, largest, SCAN_POINTS)]))
    return np.concatenate([-side[::-1], [0.0], side])


def find_corners(law, u) -> np.ndarray:
    """Locate kinks and jumps of `law`, as far as a scan of arguments `u`, ascending, shows them."""
    y = law(u)
    slope = np.diff(y) / np.diff(u)
    bend = np.abs(np.diff(slope))
    if bend.size < CORNER_WINDOW:
        return np.zeros(0)
    padded = np.pad(bend, CORNER_WINDOW // 2, mode="edge")
    around = np.median(np.lib.stride_tricks.sliding_window_view(padded, CORNER_WINDOW), axis=1)
    strong = np.nonzero(bend > CORNER * around + CORNER_LEAST * np.abs(slope).max())[0]
    strong = np.sort(strong[np.argsort(bend[strong])[::-1][:MOST_CORNERS]])
    corners = [_bisect_corner(law, u[i], u[i + 2]) for i in strong]
    return np.unique(np.array([c for c in corners if c is not None]))


def _bisect_corner(law, left, right):
    """Close in on the half that departs more from a straight line."""
    scale = np.abs(law(np.array([left, right]))).max() + NOTHING
    for _ in range(HALVINGS):
        q = np.linspace(left, right, 5)
        if not (q[0] < q[1] < q[2] < q[3] < q[4]):
            break
        y = law(q)
        low, high = abs(y[1] - 0.5 * (y[0] + y[2])), abs(y[3] - 0.5 * (y[2] + y[4]))
        if max(low, high) <= ROOT * scale:
            return q[2]
        left, right = (q[0], q[2]) if low > high else (q[2], q[4])
    return 0.5 * (left + right)


def _first_intervals(amplitudes, corners):
    owner, left, right = [], [], []
    for i, a in enumerate(amplitudes):
        inside = corners[np.abs(corners) < a]
        edges = np.unique(np.concatenate([np.linspace(0, np.pi, 4), np.arccos(inside / a)]))
        owner.append(np.full(edges.size - 1, i))
        left.append(edges[:-1])
        right.append(edges[1:])
    return np.concatenate(owner), np.concatenate(left), np.concatenate(right)


def sample_error(y) -> float:
    """Estimate the error of a uniform Fourier sum over samples with jumps between them."""
    steps = np.abs(np.diff(np.concatenate([y, y[:1]])))
    jumps = steps[steps > JUMPS * np.median(steps) + NOTHING]
    return float(2 * jumps.sum() / y.size + np.ptp(y) / y.size**2)
