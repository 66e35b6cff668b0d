"""The way from a describing function's solution to the cycle with all its harmonics.

A describing function drops the harmonics that H returns to the block's input. Here a share of them is fed
back, ``u = a cos(omega t) + Re sum U_k exp(j k omega t)`` with ``U_k = -share H(j k omega) Y_k(u)`` for k
other than 1, and ``1 + H(j omega) Y_1(u) / a = 0``: share 0 is the prediction, share 1 the cycle (up to the
harmonics kept). The solutions form a curve, followed by its arclength, which passes folds. Where the curve
comes back to share 0 it ends on another prediction: the two have merged on the way, and no cycle belongs to
either.

References
----------
Keller (1977), Numerical solution of bifurcation and nonlinear eigenvalue problems; Mees (1981), Dynamics of
Feedback Systems, ch. 5.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from ...df.forced_orbit.periodic_response import ForcedState
from ...df.thresholds import EVEN_LEAST
from ...thresholds import NEWTON_NEAR
from ..arclength import correction, tangent
from ..thresholds import CURVE_BEND, CURVE_FIRST, CURVE_LONGER, LOG_NUDGE
from .thresholds import (
    ASTRAY,
    NAMED,
    PATH_CLOSED,
    PATH_ENDS_NEAR,
    PATH_LATE,
    PATH_LONGEST,
    PATH_REACH,
    PATH_SHORTEST,
    PATH_SLOW,
    PATH_STEPS,
    PROBE,
)


class End(Enum):
    """How a curve ended; the value says it in words."""

    REACHED = "all harmonics are fed back"
    MERGED = "the prediction merges with another one before all harmonics are fed back"
    LEFT = "with its harmonics the cycle moves out of reach"
    UNANSWERED = "the block has no periodic response to the waveform"
    STOPPED = "the curve could not be followed"


@dataclass(frozen=True)
class Path:
    """Where the curve that begins at a prediction leads.

    Attributes
    ----------
    end : End
    share : float
        Largest share of the harmonics that was fed back.
    omega : float
        At the end [rad/s].
    waveform : ndarray of complex
        Fourier coefficients k = 0, 1, ... of the block's input at the end, phase of the fundamental 0.
    response : ndarray of complex
        Those of the block's output.
    folds : int
        Times the curve turned back.
    motion : ForcedState or None
        The block's motion at the end; None for a law without time.
    """

    end: End
    share: float
    omega: float
    waveform: np.ndarray
    response: np.ndarray
    folds: int = 0
    motion: ForcedState | None = None

    @property
    def solution(self) -> tuple[float, float]:
        """(amplitude, omega) at the end."""
        return float(self.waveform[1].real), self.omega


def follow_path(steady_state: Callable, harmonics: int, linear, amplitude, omega) -> Path:
    """Follow the curve from a prediction until all harmonics are fed back, or it comes back.

    Parameters
    ----------
    steady_state : callable
        As `ctrl_df.limit_cycles.predicted.waveform_response.response_of` returns it.
    harmonics : int
        Highest harmonic kept.
    linear : LinearPart
    amplitude, omega : float
        The prediction.
    """
    curve = _Curve(steady_state, harmonics, linear, amplitude, omega)
    return curve.follow()


def corrected_near(steady_state: Callable, harmonics: int, linear, amplitude, omega) -> Path | None:
    """Balance all harmonics at once, from a guess at which no prediction need stand; None if that fails."""
    curve = _Curve(steady_state, harmonics, linear, amplitude, omega)
    z = curve.begin()
    motion = curve.motion
    for share in (0.0, 0.5, 1.0):
        z[-1] = share
        r, _, motion = curve.defect(z, motion)
        J = None if r is None else curve.jacobian(z, r, motion)
        found = None if J is None else curve.corrected(z, curve.level(), J, motion)
        if found is None:
            return None
        z, Y, J, motion = found
    return curve.path(End.REACHED, z, 1.0, Y, 0, motion)


class _Curve:
    """Unknowns z = (ln a, ln omega, U_k / a for k other than 1, share) and their equations."""

    def __init__(self, steady_state, harmonics, linear, amplitude, omega):
        self.steady_state, self.harmonics, self.linear = steady_state, harmonics, linear
        self.first = np.log([amplitude, omega])
        self.kept, self.motion = self._begin(amplitude, omega)
        gain = linear.static_gain
        self.fixed_mean = bool(np.isnan(gain)) and not linear.measured
        self.static_gain = 0.0 if np.isnan(gain) else gain

    def _begin(self, amplitude, omega):
        """Return the harmonics kept, odd ones where the response to these is odd, and the first motion."""
        U = np.zeros(self.harmonics + 1, complex)
        U[1] = amplitude
        H = self.linear.clamped(np.array([omega]))[0][0]
        # of several motions the one whose N balances H there: that which the describing function names
        _, motion = self.steady_state.nearest(U, omega, lambda Y: abs(1 + H * Y[1] / amplitude), NAMED)
        U[3] = PROBE * amplitude
        Y, _ = self.steady_state(U, omega, motion)
        if Y is not None and np.abs(Y[0::2]).max() < EVEN_LEAST * np.abs(Y).max():
            return np.arange(3, self.harmonics + 1, 2), motion
        return np.array([0, *range(2, self.harmonics + 1)]), motion

    def waveform(self, z):
        """Return U_k, a and omega of the unknowns."""
        U = np.zeros(self.harmonics + 1, complex)
        a = float(np.exp(z[0]))
        count = self.kept.size
        parts = z[2:-1]
        V = parts[:count].astype(complex)
        imaginary = self.kept != 0
        V[imaginary] += 1j * parts[count:]
        U[self.kept] = a * V
        U[1] = a
        return U, a, float(np.exp(z[1]))

    def defect(self, z, motion):
        """Return what is missing to the balance of each harmonic, the block's response, and its motion.

        It is sought from a `motion` nearby. None twice, and that motion, where there is no periodic response.
        """
        U, a, omega = self.waveform(z)
        Y, motion = self.steady_state(U, omega, motion)
        if Y is None or not np.isfinite(Y).all() or Y[1] == 0:  # it stands still: nothing goes around
            return None, None, motion
        return self._defect(z, U / a, Y / a, omega), Y, motion

    def _defect(self, z, V, y, omega):
        k = np.concatenate([[1], self.kept])
        H, _ = self.linear.clamped(np.maximum(k, 1) * omega)
        H = np.where(np.isfinite(H), H, 0)
        share = z[-1]
        r = V[self.kept] + share * H[1:] * y[self.kept]
        if self.kept[0] == 0:
            if self.fixed_mean:  # an integrator in H: the mean of the output must vanish
                r[0] = (1 - share) * V[0] + share * y[0] / abs(y[1])
            else:
                r[0] = V[0] + share * self.static_gain * y[0]
        first = 1 + H[0] * y[1]
        return np.concatenate([[first.real, first.imag], r.real, r.imag[self.kept != 0]])

    def jacobian(self, z, r, motion):
        """Return the derivatives of the defect by all unknowns; None where there is no response."""
        columns = []
        for i in range(z.size):
            moved = z.copy()
            moved[i] += LOG_NUDGE if i < z.size - 1 or z[i] < 0.5 else -LOG_NUDGE
            there, *_ = self.defect(moved, motion)
            if there is None:
                return None
            columns.append((there - r) / (moved[i] - z[i]))
        return np.array(columns).T

    def begin(self):
        """Return the unknowns of the prediction."""
        z = np.zeros(2 + 2 * self.kept.size - int(self.kept[0] == 0) + 1)
        z[:2] = self.first
        return z

    def level(self):
        """Return the border that holds the share."""
        border = np.zeros(self.begin().size)
        border[-1] = 1.0
        return border

    def follow(self) -> Path:
        """Follow the curve from share 0 to 1, or back to 0."""
        z = self.begin()
        r, Y, motion = self.defect(z, self.motion)
        J = None if r is None else self.jacobian(z, r, motion)
        border = self.level()
        if r is None or J is None:
            return self.path(End.UNANSWERED, z, 0.0, np.zeros(self.harmonics + 1, complex), 0, motion)
        found = self.corrected(z, border, J, motion)  # the prediction itself, to the accuracy of the samples
        if found is None:
            return self.path(End.STOPPED, z, 0.0, Y, 0, motion)
        z, Y, J, motion = found
        border, near = tangent(J, border), motion  # `near`: the motion that the next step starts from
        step, share, folds, differenced = CURVE_FIRST, 0.0, 0, False
        reason = End.STOPPED
        for _ in range(PATH_STEPS):
            ahead = z + step * border
            target = None
            if ahead[-1] >= 1.0:
                target = 1.0
            elif ahead[-1] <= 0.0 and (border[-1] < 0.0):
                target = 0.0
            if target is not None:
                ahead = z + (target - z[-1]) / border[-1] * border
                found = self.corrected(ahead, self.level(), J, near)
                if found is not None and np.abs(found[0] - ahead).max() < PATH_ENDS_NEAR:
                    z, Y, J, motion = found
                    end = End.REACHED if target == 1.0 else End.MERGED
                    return self.path(end, z, max(share, z[-1]), Y, folds, motion)
            else:
                found = self.corrected(ahead, border, J, near)
            turned = None if found is None or target is not None else tangent(found[2], border)
            # a step that bends the curve sharply, or that went far to find it, is taken shorter
            if (
                found is None
                or turned is None
                or turned @ border < CURVE_BEND
                or np.abs(found[0] - ahead).max() > ASTRAY * step
            ):
                step *= 0.5
                if step < PATH_SHORTEST:
                    break
                near = motion
                if differenced:  # Newton's matrix is that of this point already
                    continue
                fresh, _, near = self.defect(z, motion)
                J = J if fresh is None else self.jacobian(z, fresh, near)
                if J is None:
                    reason = End.UNANSWERED
                    break
                border, differenced = tangent(J, border), True
                continue
            if turned[-1] * border[-1] < 0.0:
                folds += 1
            z, Y, J, motion = found
            border, near, differenced = turned, motion, False
            share = max(share, float(z[-1]))
            step = min(CURVE_LONGER * step, PATH_LONGEST)
            if (np.abs(z[:2] - self.first) > PATH_REACH).any():
                reason = End.LEFT
                break
        return self.path(reason, z, share, Y, folds, motion)

    def corrected(self, z, border, J, motion):
        """Newton onto the curve within the plane through z across `border`; (z, Y, J, motion) or None."""
        z = z.copy()
        offset = border @ z
        r, Y, motion = self.defect(z, motion)
        if r is None:
            return None
        fresh, before = False, np.inf
        for _ in range(NEWTON_NEAR):
            size = float(np.abs(r).max())
            if size < PATH_CLOSED:
                return z, Y, J, motion
            if size > PATH_SLOW[0] * before:
                if fresh and size > PATH_SLOW[1] * before:
                    return (z, Y, J, motion) if size < PATH_LATE * PATH_CLOSED else None
                J = self.jacobian(z, r, motion)
                fresh = True
                if J is None:
                    return None
            before = size
            change = correction(J, border, r, border @ z - offset)
            if np.abs(change).max() > 1.0:
                return None
            there, Y, motion = self.defect(z + change, motion)
            if there is None:
                return None
            if change @ change > 0:  # Broyden's update
                J = J + np.outer(there - r - J @ change, change) / (change @ change)
            z, r = z + change, there
        return None

    def path(self, end, z, share, Y, folds, motion) -> Path:
        """Return where the curve stands."""
        U, _, omega = self.waveform(z)
        return Path(end, share, omega, U, Y, folds, motion)
