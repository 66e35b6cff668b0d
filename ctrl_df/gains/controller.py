"""A PID whose gains are free: its share of the loop, gain by gain, and the loop at given gains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import control as ct
import numpy as np

from ..blocks.pid import pid
from ..df.dispatch import translated
from ..limit_cycles.predicted.linear import LinearPart
from ..simulate.loop import closed_loop
from ..thresholds import SQRT_EPS

GAINS = ("kp", "ki", "kd")


@dataclass(frozen=True)
class Structure:
    """``P(s) (kp + ki/s + kd s/(tf s + 1))`` around a block, the gains left open.

    Attributes
    ----------
    block : block
        As handed in.
    tf : float
        Time constant of the derivative filter [s].
    plant : LTI system or None
        P; None: 1.
    output : str or None
        Output of the block that is fed back; None: the first.
    """

    block: Any
    tf: float = 0.0
    plant: Any = None
    output: str | None = None

    def terms(self, omega) -> np.ndarray:
        """Return what the controller multiplies each gain by at a frequency, shape (3, *omega.shape)."""
        s = 1j * np.asarray(omega, dtype=float)
        return np.stack([np.ones_like(s), 1 / s, s / (self.tf * s + 1)])

    def beside(self, omega) -> np.ndarray:
        """Return P(j omega)."""
        omega = np.asarray(omega, dtype=float)
        if self.plant is None:
            return np.ones(omega.shape, dtype=complex)
        return LinearPart(self.plant)(omega)

    def pid(self, gains: Mapping[str, float]) -> Any:
        """Return the PID."""
        return pid(gains["kp"], gains["ki"], gains["kd"], self.tf)

    def controller(self, gains: Mapping[str, float]) -> Any:
        """Return P times the PID."""
        C = self.pid(gains)
        return C if self.plant is None else _product(C, self.plant)

    def loop(self, gains: Mapping[str, float]) -> ct.InterconnectedSystem:
        """Return the closed loop with these gains."""
        return closed_loop(self.controller(gains), translated(self.block), output=self.output)

    def loop_gain(self, gains: Mapping[str, Any], omega) -> np.ndarray:
        """Return P C at a frequency each (NaN where that is): -1/N at a cycle."""
        known = np.where(np.isfinite(omega), omega, 1.0)
        C = sum(gains[name] * term for name, term in zip(GAINS, self.terms(known), strict=True))
        return np.where(np.isfinite(omega), C * self.beside(known), np.nan)

    def unstable_poles(self) -> int:
        """Count the poles of P in the right half plane."""
        if self.plant is None or isinstance(self.plant, ct.FrequencyResponseData):
            return 0
        poles = self.plant.poles()
        return int((poles.real > SQRT_EPS * np.abs(poles).max(initial=0.0)).sum())


def _product(C: Any, plant) -> Any:
    """PID times plant as one fraction: a state space could not hold the derivative of an ideal PID."""
    P: Any = ct.tf(plant)
    return ct.tf(np.polymul(C.num[0][0], P.num[0][0]), np.polymul(C.den[0][0], P.den[0][0]))
