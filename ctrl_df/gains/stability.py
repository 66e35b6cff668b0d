"""The loop in the large, where it is linear: its poles to the right, and the border where they appear."""

from __future__ import annotations

import numpy as np

from ..limit_cycles.predicted.thresholds import ON_EDGE
from ..thresholds import ROUNDED
from .controller import GAINS
from .plane import Plane
from .thresholds import BORDER_LINE, BORDER_POINTS, PHASES, PHASES_AT_ONCE, POLES_ASIDE


def unstable_poles(plane: Plane, kp, ki, kd) -> np.ndarray:
    """Count the closed-loop poles in the right half plane for large amplitudes.

    From the phase that 1 + L gains between zero and infinite frequency (Mikhailov): of an open loop with m
    poles at the origin and n to the right of the axis, ``n + m/2 - phase / pi`` poles of the closed loop lie
    to the right.
    """
    q = np.linspace(plane.log_w[0], plane.log_w[-1], PHASES)
    far = _interpolated(plane, q)
    shape = np.broadcast_shapes(np.shape(kp), np.shape(ki), np.shape(kd))
    gains = [np.broadcast_to(g, shape).ravel() for g in (kp, ki, kd)]
    terms = plane.structure.terms(np.exp(q))
    out = np.empty(gains[0].size)
    rows = max(1, PHASES_AT_ONCE // PHASES)
    for k in range(0, out.size, rows):
        C = sum(np.multiply.outer(g[k : k + rows], t) for g, t in zip(gains, terms, strict=True))
        out[k : k + rows] = _count(-C / far, q)
    poles = np.round(out + plane.structure.unstable_poles())
    return np.maximum(poles, 0).astype(int).reshape(shape)


def far_loop(plane: Plane, gains, q) -> np.ndarray:
    """Open loop for large amplitudes at frequencies exp(q)."""
    C = sum(gains[name] * t for name, t in zip(GAINS, plane.structure.terms(np.exp(q)), strict=True))
    return -C / _interpolated(plane, q)


def _count(L, q):
    """m/2 - phase/pi for open loops L over ln omega, m taken from the slope at the lowest frequency."""
    with np.errstate(all="ignore"):
        slope = -(np.log(np.abs(L[:, 1])) - np.log(np.abs(L[:, 0]))) / (q[1] - q[0])
        m = np.maximum(np.round(np.where(np.isfinite(slope), slope, 0)), 0)
        closed = 1 + L
        turn = np.angle(closed[:, 1:] / closed[:, :-1]).sum(axis=1)
        turn += np.where(m > 0, np.angle(closed[:, 0] / L[:, 0]), 0)
        turn -= np.angle(closed[:, -1])  # beyond the last frequency 1 + L goes on to 1
    return 0.5 * m - turn / np.pi


def linear_border(plane: Plane, free, fixed, ranges, points=BORDER_POINTS) -> list[np.ndarray]:
    """Curves in the plane of two gains on which the loop in the large has a pole on the imaginary axis.

    The D-partition: at each frequency Z = C is two equations for two gains. Where the two are one (integral
    and derivative gain of an ideal PID) they are met at single frequencies, by whole lines of gains; so they
    are at frequency zero, on ki = 0. Only what parts stable from unstable is returned.

    Parameters
    ----------
    plane : Plane
    free : (str, str)
        Names of the two gains.
    fixed : dict
        The third one.
    ranges : ((low, high), (low, high))

    Returns
    -------
    list of ndarray, shape (n, 2)
    """
    q = np.linspace(plane.log_w[0], plane.log_w[-1], points)
    w, terms = np.exp(q), plane.structure.terms(np.exp(q))
    (third,) = fixed
    need = _interpolated(plane, q) - fixed[third] * terms[GAINS.index(third)]
    b1, b2 = (terms[GAINS.index(name)] for name in free)
    det = b1.real * b2.imag - b1.imag * b2.real
    curves = []
    if (np.abs(det) > ROUNDED * np.abs(b1) * np.abs(b2)).any():
        with np.errstate(all="ignore"):
            x = (need.real * b2.imag - need.imag * b2.real) / det
            y = (b1.real * need.imag - b1.imag * need.real) / det
        curves.append(np.stack([x, y], axis=1))
    else:
        across = (need / b1).imag
        for k in np.flatnonzero((across[:-1] < 0) != (across[1:] < 0)):
            share = across[k] / (across[k] - across[k + 1])
            at = np.exp(q[k] + share * (q[k + 1] - q[k]))
            one, other, level = (np.interp(at, w, v.real) for v in (b1 / b1, b2 / b1, need / b1))
            x = np.linspace(ranges[0][0], ranges[0][1], BORDER_LINE)
            curves.append(np.stack([x, (level - one * x) / other], axis=1))
    if "ki" in free and plane.structure.plant is None:
        line = np.zeros((BORDER_LINE, 2))
        other = 1 - free.index("ki")
        line[:, other] = np.linspace(ranges[other][0], ranges[other][1], BORDER_LINE)
        curves.append(line)
    return [piece for curve in curves for piece in _parting(plane, curve, free, fixed, ranges)]


def _parting(plane, curve, free, fixed, ranges):
    """Cut a curve into the pieces within the box that have the stable side on one hand."""
    size = np.array([high - low for low, high in ranges])
    low = np.array([r[0] for r in ranges])
    unit = (curve - low) / size
    inside = (
        np.isfinite(unit).all(axis=1) & (unit >= -ON_EDGE).all(axis=1) & (unit <= 1 + ON_EDGE).all(axis=1)
    )
    along = np.gradient(np.where(np.isfinite(unit), unit, 0), axis=0)
    with np.errstate(all="ignore"):
        normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
    inside &= np.isfinite(normal).all(axis=1)
    sides = []
    for sign in (-1, 1):
        at = low + size * (unit[inside] + POLES_ASIDE * sign * normal[inside])
        gains = {free[0]: at[:, 0], free[1]: at[:, 1], **fixed}
        sides.append(unstable_poles(plane, *(gains[name] for name in GAINS)) > 0)
    keep = inside.copy()
    keep[inside] = sides[0] != sides[1]
    pieces = np.split(np.arange(keep.size), np.flatnonzero(np.diff(keep.astype(int))) + 1)
    return [curve[piece] for piece in pieces if keep[piece[0]] and piece.size > 1]


def _interpolated(plane, q):
    """Z for large amplitudes between the grid's frequencies, over its logarithm."""
    known = np.isfinite(plane.far)
    phase = np.unwrap(np.angle(plane.far[known]))
    size = np.log(np.abs(plane.far[known]))
    at = plane.log_w[known]
    return np.exp(np.interp(q, at, size) + 1j * np.interp(q, at, phase))
