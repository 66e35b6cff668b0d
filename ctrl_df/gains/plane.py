"""N on the plane of amplitude and frequency, and the balance of a loop with free gains on it.

A cycle stands where 1 + N P C = 0, that is where the controller C(j omega), a sum of gains times known
functions of frequency, equals what the loop needs there, Z(a, omega) = -1/(N P). Z knows nothing of the
gains: one family of describing functions serves all of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import RectBivariateSpline, RegularGridInterpolator
from scipy.ndimage import distance_transform_edt

from ..blocks.mechanism import Mechanism
from ..cached import cached_property
from ..df.describing import quiet_family
from ..df.dispatch import method_for
from ..df.methods import ElementIntegrals, Method
from ..df.points import points
from ..limit_cycles.exact.poincare import PoincareSearch
from ..limit_cycles.predicted.linear import LinearPart
from ..limit_cycles.predicted.scan_grid import noisy, with_corners
from ..limit_cycles.thresholds import LOG_NUDGE
from ..simulate.engine import Engine
from ..thresholds import HALVINGS
from .controller import Structure
from .thresholds import ABOVE, BELOW, CLOSER, FASTER, SIZE, SMALL_BETWEEN


@dataclass(frozen=True, eq=False)
class Plane:
    """What a loop needs of its controller, on a grid of ln a and ln omega.

    Attributes
    ----------
    structure : Structure
    log_a, log_w : ndarray, shapes (na,), (nw,)
    Z : ndarray of complex, shape (na, nw)
        -1/(N P); NaN where the block has no periodic answer, or one that is an average over irregular motion.
    far : ndarray of complex, shape (nw,)
        Z where the loop is linear: for large amplitudes, unless another one was asked for.
    method : Method
    scale : float
        Amplitude at the block's input at which its nonlinearity matters.
    """

    structure: Structure
    log_a: np.ndarray
    log_w: np.ndarray
    Z: np.ndarray
    far: np.ndarray
    method: Method
    scale: float

    def need(self, p, q) -> np.ndarray:
        """Z at pairs (ln a, ln omega): of the block where that is quick, else between the grid's points."""
        p, q = np.atleast_1d(p), np.atleast_1d(q)
        if not self.method.quick:
            return self._between(p, q)
        near_p, near_q = (
            np.clip(np.nan_to_num(v), axis[0] - 1, axis[-1] + 1)
            for v, axis in ((p, self.log_a), (q, self.log_w))
        )
        w = np.exp(near_q)
        N, regime, spread = points(self.method, np.exp(near_p), w if self.method.needs_omega else None)
        Z = _needed(N, self.structure.beside(w), noisy(regime, spread))
        return np.where((near_p == p) & (near_q == q), Z, np.nan)  # a step of Newton's may go astray

    def slopes(self, p, q) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Z and its derivatives by ln a and ln omega, at pairs."""
        h = LOG_NUDGE if self.method.quick else SMALL_BETWEEN * float(np.diff(self.log_a).min())
        p, q = np.atleast_1d(p), np.atleast_1d(q)
        at = self.need(np.concatenate([p, p + h, p - h, p, p]), np.concatenate([q, q, q, q + h, q - h]))
        Z, up, down, right, left = at.reshape(5, -1)
        return Z, (up - down) / (2 * h), (right - left) / (2 * h)

    def _between(self, p, q):
        size, phase, known = self._splines
        inside = known(np.stack([p, q], axis=-1)) > 0.5
        return np.where(inside, np.exp(size(p, q, grid=False) + 1j * phase(p, q, grid=False)), np.nan)

    @cached_property
    def _splines(self):
        """Logarithm of Z, nearly straight where N is a power of a and omega, and where Z is known."""
        missing = ~np.isfinite(self.Z)
        filled = self.Z
        if missing.any():
            nearest: Any = distance_transform_edt(missing, return_distances=False, return_indices=True)
            filled = self.Z[tuple(nearest)]
        phase = np.unwrap(np.unwrap(np.angle(filled), axis=1), axis=0)
        size, phase = (
            RectBivariateSpline(self.log_a, self.log_w, v) for v in (np.log(np.abs(filled)), phase)
        )
        known = RegularGridInterpolator(
            (self.log_a, self.log_w), (~missing).astype(float), bounds_error=False, fill_value=0.0
        )
        return size, phase, known


def plane_of(
    structure: Structure, corners, amplitude=None, omega=None, linear_at=None, progress=None
) -> Plane:
    """Compute the plane for a box of gains.

    Parameters
    ----------
    structure : Structure
    corners : list of dict
        Gains at the corners of the box and in its middle: they tell which frequencies matter.
    amplitude, omega : (low, high) or None
        What is looked at; None: chosen.
    linear_at : float or None
        Amplitude at which the loop is taken for linear; None: a large one.
    progress : bool or None
    """
    block = structure.block
    method = method_for(block, structure.output)
    paces, scales = zip(*(_scales(structure, gains) for gains in corners), strict=True)
    scale = float(np.median(scales))
    if amplitude is None:
        amplitude = BELOW * min(scales), ABOVE * max(scales)
    if omega is None:
        omega = min(paces) / FASTER, max(paces) * FASTER
    na, nw = SIZE[method.quick]
    w = np.geomspace(omega[0], omega[1], nw)
    a = _amplitudes(method, np.geomspace(amplitude[0], amplitude[1], na), w)
    family = quiet_family(block, a, w, 1, output=structure.output, progress=progress)
    P = structure.beside(w)
    N = np.broadcast_to(family.N, (a.size, w.size))
    irregular = np.broadcast_to(noisy(family.regime, family.residual), N.shape)
    large = ABOVE * a[-1] if linear_at is None else linear_at
    far = method.harmonics(np.array([large]), w, 1)[0][0, :, 1]
    far = np.broadcast_to(far, w.shape)
    Z = _needed(N, P, irregular)
    Zfar = _needed(far, P, False)
    return Plane(structure, np.log(a), np.log(w), Z, np.where(np.isnan(Zfar), Z[-1], Zfar), method, scale)


def _scales(structure, gains) -> tuple[float, float]:
    """Return the frequency at which a loop moves [rad/s] and the input amplitude at which its block bends."""
    loop: Any = structure.loop(gains)
    starts = PoincareSearch(loop, Engine(loop)).starts
    if isinstance(loop.parts.block, Mechanism):
        return starts.omega, starts.scale * sum(starts.core.masses) * starts.omega**2
    return starts.omega, starts.scale


def _amplitudes(method, a, w):
    """Refine an axis of amplitudes where the block begins to move, and where an element bends."""
    if isinstance(method, ElementIntegrals):
        return with_corners(a, method.block.primitive)
    if not method.quick:
        return a
    middle = w[w.size // 2 : w.size // 2 + 1] if method.needs_omega else None

    def moves(values):
        return np.isfinite(method.harmonics(np.atleast_1d(values), middle, 1)[0][:, 0, 1])

    moving = moves(a)
    if moving[0] or not moving.any():
        return a
    high = int(np.argmax(moving))
    low, high = a[high - 1], a[high]
    for _ in range(HALVINGS):
        mid = np.sqrt(low * high)
        low, high = (low, mid) if moves(mid)[0] else (mid, high)
    near = high * (1 + CLOSER)
    return np.unique(np.concatenate([a[a > high], near[near < a[-1]]]))


def _needed(N, P, irregular):
    with np.errstate(all="ignore"):
        Z = -1 / (N * P)
    return np.where(np.isfinite(Z) & ~np.asarray(irregular), Z, np.nan)


def require_linear(plant) -> None:
    """Refuse plants the gains cannot be mapped for."""
    linear = LinearPart(plant)
    if linear.dt or linear.measured:
        raise ValueError(
            "gains are mapped for a continuous plant as a transfer function or state space; got "
            f"{'a discrete system' if linear.dt else 'measured points'}. Give a continuous model."
        )
