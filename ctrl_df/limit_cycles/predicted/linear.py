"""The linear part of a loop on the imaginary axis: transfer function, state space or measured response."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import control as ct
import numpy as np

from ...checks import is_number, number, real_array, shown
from ...thresholds import ROUNDED, SQRT_EPS
from .thresholds import OMEGA_BEYOND, OMEGA_LEAST, OMEGA_POINTS, OMEGA_SPAN, ON_EDGE, SMOOTH_STEP


class LinearPart:
    """H evaluated at real frequencies.

    Parameters
    ----------
    H : TransferFunction, StateSpace, FrequencyResponseData or number
        One input, one output; continuous, or discrete with a stated sampling time.

    Raises
    ------
    TypeError
        H is no linear system.
    ValueError
        H is MIMO, or measured at fewer than two frequencies or with NaN.
    """

    def __init__(self, H):
        if is_number(H):
            H = ct.tf([number("describing_function_response", "H", H)], [1.0])
        if not isinstance(H, ct.TransferFunction | ct.StateSpace | ct.FrequencyResponseData):
            raise TypeError(
                f"H must be a linear system (transfer function, state space or FRD); got {type(H).__name__}. "
                "The nonlinear part is the second argument."
            )
        if not H.issiso():
            raise ValueError(
                f"H must have one input and one output; got {H.ninputs} inputs, {H.noutputs} outputs. "
                "Select one channel, H[i, j]."
            )
        _require_finite(H)
        self.H: Any = H  # control's stubs know less of it than it can
        self.measured = isinstance(H, ct.FrequencyResponseData)
        self.dt = 0.0 if not H.isdtime(strict=True) else (1.0 if H.dt is True else float(self.H.dt))
        top = math.pi / self.dt if self.dt else math.inf
        self._curve = _MeasuredCurve.of(H) if self.measured else None
        self.bottom, self.top = 0.0, top
        if self._curve is not None:
            self.bottom, self.top = self._curve.low, min(top, self._curve.high)

    def __call__(self, omega) -> np.ndarray:
        """Return H at `omega` [rad/s]; NaN at a pole; beyond measured data ValueError."""
        omega = np.asarray(omega, dtype=float)
        flat = omega.reshape(-1)
        if self._curve is not None:
            self._require_inside(flat)
            x = np.clip(np.log(flat), np.log(self.bottom), np.log(self.top))
            return np.asarray(self._curve.over_log(x), dtype=complex).reshape(omega.shape)
        s = np.exp(1j * flat * self.dt) if self.dt else 1j * flat
        with np.errstate(all="ignore"):
            value = np.asarray(self.H(s, squeeze=False, warn_infinite=False)).reshape(-1).astype(complex)
        return np.where(np.isfinite(value), value, np.nan).reshape(omega.shape)

    def clamped(self, omega) -> tuple[np.ndarray, np.ndarray]:
        """Return H at frequencies that may lie beyond measured data (the end value there), and which did."""
        omega = np.asarray(omega, dtype=float)
        if not self.measured:
            return self(omega), np.zeros(omega.shape, dtype=bool)
        return self(np.clip(omega, self.bottom, self.top)), (omega > self.top) | (omega < self.bottom)

    @property
    def static_gain(self) -> float:
        """H at zero frequency, NaN if infinite or not measured."""
        if self.measured:
            return math.nan
        try:
            gain = complex(np.squeeze(self.H(1.0 if self.dt else 0.0, warn_infinite=False))).real
        except (ZeroDivisionError, np.linalg.LinAlgError):
            return math.nan
        return gain if math.isfinite(gain) else math.nan

    @property
    def proper(self) -> bool:
        """Whether H stays bounded at high frequency, as far as its form tells."""
        if not isinstance(self.H, ct.TransferFunction):
            return True
        return len(np.trim_zeros(self.H.num[0][0], "f")) <= len(np.trim_zeros(self.H.den[0][0], "f"))

    def grid(self, omega=None, points=OMEGA_POINTS[True]) -> np.ndarray:
        """Frequencies to scan: those given, the range given as a two-element list, or what the poles suggest.

        Raises
        ------
        ValueError
            Frequencies not positive, above the Nyquist frequency, or outside measured data.
        """
        if omega is None:
            return self._own_grid(points)
        is_range = isinstance(omega, list | tuple) and len(omega) == 2
        values = np.unique(np.atleast_1d(real_array("describing_function_response", "omega", omega, "rad/s")))
        if values.ndim != 1 or values.size == 0:
            raise ValueError(
                "omega needs at least one frequency [rad/s]; got none. Leave it out to scan by default."
            )
        if (values < 0).any():
            raise ValueError(
                f"omega must be positive and finite [rad/s]; got {values.min():g} to {values.max():g}."
            )
        if values[0] == 0:  # python-control starts some of its contours at zero, where no cycle can be
            values = values[1:] if not is_range else np.array([OMEGA_LEAST * values[-1], values[-1]])
        if not values.size or values[-1] == 0:
            raise ValueError(
                f"omega must be positive and finite [rad/s]; got {shown(omega)}. A range is [low, high]."
            )
        if is_range and values.size == 2:
            values = np.geomspace(values[0], values[1], points)
        if self.measured:
            self._require_inside(values)
        if values.size and values[-1] > self.top * (1 + ON_EDGE):
            raise ValueError(
                f"omega must stay below the Nyquist frequency pi/dt = {self.top:g} rad/s; got {values[-1]:g} "
                f"rad/s. A sampled loop has no higher frequencies: end the range there."
            )
        return np.minimum(values, self.top)

    def _own_grid(self, points):
        if self.measured:
            return np.geomspace(self.bottom, self.top, max(points, 4 * self.H.omega.size))
        features = np.concatenate([self.H.poles(), self.H.zeros()])
        if self.dt:
            features = features[np.abs(features) > ROUNDED]
            features = np.log(features) / self.dt
        size = np.abs(features)
        size = size[(size > SQRT_EPS * max(size.max(initial=0.0), SQRT_EPS)) & np.isfinite(size)]
        low, high = (size.min(), size.max()) if size.size else (1.0, 1.0)
        top = self.top if self.dt else OMEGA_BEYOND * high
        return np.geomspace(min(low / OMEGA_BEYOND, top / OMEGA_SPAN), top, points)

    def _require_inside(self, omega):
        slack = ON_EDGE
        if omega.size and (omega.min() < self.bottom * (1 - slack) or omega.max() > self.top * (1 + slack)):
            raise ValueError(
                f"a measured H is known from {self.bottom:g} to {self.top:g} rad/s only; got omega from "
                f"{omega.min():g} "
                f"to {omega.max():g}. Keep omega inside the data, or fit a model to them."
            )


@dataclass(frozen=True)
class _MeasuredCurve:
    """Measured points of H, interpolated over ln omega from `low` to `high` [rad/s]."""

    low: float
    high: float
    over_log: Callable

    @classmethod
    def of(cls, H) -> _MeasuredCurve:
        """Interpolate the points of a measured H; ValueError for too few, or NaN among them."""
        omega = np.asarray(H.omega, dtype=float)
        value = np.asarray(H.frdata)[0, 0].astype(complex)
        keep = np.argsort(omega)
        omega, value = omega[keep], value[keep]
        positive = omega > 0
        omega, value = omega[positive], value[positive]
        if omega.size < 2 or not np.isfinite(value).all():
            raise ValueError(
                f"a measured H needs at least two positive frequencies with finite values; got {omega.size} "
                f"frequencies. "
                "Remove points that are NaN."
            )
        from scipy.interpolate import Akima1DInterpolator, CubicSpline

        make = CubicSpline if omega.size >= 4 else (lambda x, y: CubicSpline(x, y, bc_type="natural"))
        low, high, x = float(omega[0]), float(omega[-1]), np.log(omega)
        smooth = (np.abs(value) > 0).all() and np.abs(np.angle(value[1:] / value[:-1])).max() < SMOOTH_STEP
        if smooth:  # magnitude and phase of a physical response run smoothly over log frequency
            log = make(x, np.log(np.abs(value)) + 1j * np.unwrap(np.angle(value)))
            return cls(low, high, lambda q: np.exp(log(q)))
        return cls(low, high, Akima1DInterpolator(x, value) if omega.size > 2 else make(x, value))


def _require_finite(H):
    """Refuse NaN or infinity among the numbers of a model; those of measured points are looked at later."""
    if isinstance(H, ct.TransferFunction):
        numbers = [H.num[0][0], H.den[0][0]]
    elif isinstance(H, ct.StateSpace):
        numbers = [H.A, H.B, H.C, H.D]
    else:
        return
    if not all(np.isfinite(n).all() for n in numbers):
        raise ValueError(f"H needs finite coefficients; got NaN or infinity in {H!r}. Correct the model.")
