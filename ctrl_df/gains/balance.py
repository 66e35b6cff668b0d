"""Where a loop with given gains balances: its predicted cycles, for many pairs of gains at once.

With one of two free gains held, what the other would have to be, R = (Z - the rest) / its term, is a function
of (ln a, ln omega); it is a gain where it is real. So the line Im R = 0 holds the cycles of a whole row of
gains, each where Re R is the gain.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..limit_cycles.predicted.thresholds import CROSSING_RANK, LOEB
from ..thresholds import NEWTON_NEAR
from .controller import GAINS
from .plane import Plane
from .thresholds import MOTION_JUMPS, POLISH_REACH, POLISHED


class Segments(NamedTuple):
    """Pieces of the line Im R = 0, each within one triangle of the plane; columns are their two ends."""

    p: np.ndarray
    q: np.ndarray
    gain: np.ndarray
    edge: np.ndarray
    sine: np.ndarray  # of the angle between the curves, its sign that of Loeb's criterion; one a piece


@dataclass(frozen=True)
class Cycles:
    """Predicted cycles at many values of one gain: which value, ln a, ln omega, Loeb's sine."""

    index: np.ndarray
    p: np.ndarray
    q: np.ndarray
    sine: np.ndarray


def excess(plane: Plane, gains, sought: str) -> np.ndarray:
    """R on the plane: what the gain `sought` would have to be, the others being as given."""
    terms = plane.structure.terms(np.exp(plane.log_w))
    rest = sum(gains[name] * terms[GAINS.index(name)] for name in GAINS if name != sought)
    return (plane.Z - rest) / terms[GAINS.index(sought)]


def segments(plane: Plane, R) -> Segments:
    """Cut the line Im R = 0 out of the plane, triangle by triangle."""
    na, nw = R.shape
    node = np.arange(na * nw).reshape(na, nw)
    a, b, c, d = node[:-1, :-1].ravel(), node[1:, :-1].ravel(), node[:-1, 1:].ravel(), node[1:, 1:].ravel()
    flat, need = R.ravel(), plane.Z.ravel()
    above = flat.imag > 0
    found = []
    for corner in ((a, b, d), (a, c, d)):
        up = [above[k] for k in corner]
        mixed = np.flatnonzero((up[0] != up[1]) | (up[0] != up[2]))
        tri = np.stack([k[mixed] for k in corner])
        tri = tri[:, np.isfinite(flat[tri]).all(axis=0)]
        size = np.abs(need[tri])
        spread = np.abs(need[tri] - need[np.roll(tri, 1, axis=0)]).max(axis=0)
        found.append(tri[:, spread < MOTION_JUMPS * size.max(axis=0)])
    tri = np.concatenate(found, axis=1)
    up = above[tri]
    lone = np.where(up[0] == up[1], 2, np.where(up[0] == up[2], 1, 0))
    which = np.arange(tri.shape[1])
    apex, sides = tri[lone, which], (tri[(lone + 1) % 3, which], tri[(lone + 2) % 3, which])
    P, Q = plane.log_a[tri // nw], plane.log_w[tri % nw]
    row, column = np.divmod(np.arange(na * nw), nw)
    fields = plane.log_a[row], plane.log_w[column], flat.real
    ends: list = [[], [], [], []]
    for side in sides:
        share = flat[apex].imag / (flat[apex].imag - flat[side].imag)
        for out, values in zip(ends, fields, strict=False):
            out.append(values[apex] + share * (values[side] - values[apex]))
        ends[3].append(np.minimum(apex, side) * (na * nw) + np.maximum(apex, side))
    p, q, gain, edge = (np.stack(e, axis=1) for e in ends)
    return Segments(p, q, gain, edge, _sine(P, Q, flat[tri]))


def _sine(P, Q, R):
    """Sine of the angle between the derivatives of R by ln a and ln omega, linear over each triangle."""
    p1, p2, q1, q2 = P[1] - P[0], P[2] - P[0], Q[1] - Q[0], Q[2] - Q[0]
    r1, r2 = R[1] - R[0], R[2] - R[0]
    area = p1 * q2 - p2 * q1
    by_p, by_q = (r1 * q2 - r2 * q1) / area, (r2 * p1 - r1 * p2) / area
    with np.errstate(all="ignore"):
        return (by_p.real * by_q.imag - by_p.imag * by_q.real) / (np.abs(by_p) * np.abs(by_q))


def cycles_along(plane: Plane, gains, sought: str, values) -> Cycles:
    """Find the predicted cycles where the gain `sought` takes each of `values` (ascending)."""
    found = segments(plane, excess(plane, gains, sought))
    low, high = found.gain.min(axis=1), found.gain.max(axis=1)
    # a value on the end of a piece belongs to the piece that begins there
    first, last = np.searchsorted(values, low, "left"), np.searchsorted(values, high, "left")
    count = last - first
    piece = np.repeat(np.arange(count.size), count)
    index = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + first[piece]
    begin, end = found.gain[piece].T
    share = (values[index] - begin) / np.where(end == begin, 1.0, end - begin)
    p, q = (v[piece, 0] + share * (v[piece, 1] - v[piece, 0]) for v in (found.p, found.q))
    return Cycles(index, p, q, found.sine[piece])


def settled(sine) -> np.ndarray:
    """Loeb's criterion as numbers: 1 stable, 0 unstable, NaN where the curves are nearly tangent."""
    return np.where(np.abs(sine) < LOEB, np.nan, (sine > 0).astype(float))


def polished(
    plane: Plane, gains, p: float, q: float, steps: int = NEWTON_NEAR
) -> tuple[float, float, float] | None:
    """Newton's method from a cycle found on the grid to (ln a, ln omega), and Loeb's sine there."""
    start = np.array([p, q])
    x = start.copy()
    reach = POLISH_REACH * np.array([np.diff(plane.log_a).max(), np.diff(plane.log_w).max()])
    for _ in range(steps):
        F, by_p, by_q = defect(plane, gains, x[:1], x[1:])
        J = np.array([[by_p[0].real, by_q[0].real], [by_p[0].imag, by_q[0].imag]])
        if not np.isfinite(J).all() or not np.isfinite(F[0]):
            return None
        step = np.linalg.lstsq(J, -np.array([F[0].real, F[0].imag]), rcond=CROSSING_RANK)[0]
        x = x + step
        if (np.abs(x - start) > reach).any():
            return None
        if np.abs(step).max() < POLISHED:
            break
    size = np.linalg.norm(J[:, 0]) * np.linalg.norm(J[:, 1])
    return float(x[0]), float(x[1]), float(np.linalg.det(J) / size)


def defect(plane: Plane, gains, p, q) -> tuple[Any, Any, Any]:
    """(Z - C) / |Z| at pairs, and its derivatives by ln a and ln omega with |Z| held."""
    Z, by_p, by_q = plane.slopes(p, q)
    s, tf = 1j * np.exp(q), plane.structure.tf
    C = gains["kp"] + gains["ki"] / s + gains["kd"] * s / (tf * s + 1)
    turned = -gains["ki"] / s + gains["kd"] * s / (tf * s + 1) ** 2
    with np.errstate(invalid="ignore"):
        return (Z - C) / np.abs(Z), by_p / np.abs(Z), (by_q - turned) / np.abs(Z)
