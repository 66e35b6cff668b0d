"""The periodic response of a system whose laws are linear, in closed form, however light the damping.

Where all laws of a program are affine and none ever switches, dx/dt = a x + b u + e, and the forced motion at
omega solves (j omega - a) x = b u. Free positions and speeds are left out of the question whether it
attracts; a constant force makes them travel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...simulate.program import layout as L
from ...thresholds import FEW_ROUNDED, ROUNDED, SQRT_EPS, UNIT
from ..thresholds import DRIFTS
from .symmetries import Probe, Symmetries


@dataclass(frozen=True)
class LinearOrbit:
    """Linear maps of one system.

    Attributes
    ----------
    a, b, c, d : arrays
        ``dx/dt = a x + b u``, ``y = c x + d u`` (one input, one output).
    center : (n,) array
        State about which it oscillates.
    mean : float
        Mean of the output.
    travel : float
        Steady speed of the output [unit/s].
    runaway : bool
        Whether a constant force accelerates a free body.
    poles : ndarray of complex
        Of the coordinates that have to repeat.
    """

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    d: float
    center: np.ndarray
    mean: float
    travel: float
    runaway: bool
    poles: Any

    def response(self, A: float, omega: float, orders: int):
        """Return (Y_k for k = 0..orders, regime, state at t = 0); NaN where no periodic motion attracts."""
        y, omega = np.full(orders + 1, np.nan + 0j), float(omega)
        size = np.max(np.abs(self.poles), initial=0.0)
        if self.runaway or np.any(self.poles.real > SQRT_EPS * size):
            return y, "diverged", None
        if np.any(np.abs(self.poles - 1j * omega) <= FEW_ROUNDED * max(size, omega)):
            return y, "resonance", None
        matrix = 1j * omega * np.eye(len(self.b)) - self.a
        x = np.linalg.solve(matrix, self.b)
        unit = np.where(x != 0, np.abs(x), 1.0)  # solved again with all states of size one
        x = A * unit * np.linalg.solve(matrix * unit / unit[:, None], self.b / unit)
        y[:] = 0.0
        y[0], y[1] = self.mean, self.c @ x + A * self.d
        travels = abs(self.travel) * 2 * np.pi / omega > DRIFTS * abs(y[1])
        return y, "drifting" if travels else "smooth", self.center + x.real


def linear_orbit(engine, s: Symmetries, row: int, free_row: bool) -> LinearOrbit | None:
    """Return the closed form of a system, or None where its laws are not linear.

    Parameters
    ----------
    engine : Engine
    s : Symmetries
    row : int
        Output described.
    free_row : bool
        Whether that output shifts with a free position.
    """
    prog, n = engine.program, engine.nstates
    if prog.ints[L.H_AFFINE] != 1 or n == 0 or not s.autonomous:
        return None
    probe = Probe(engine)
    if np.isfinite(probe.samples().g[:, : probe.ng]).any():
        return None  # something switches
    base, _, y0 = probe.at(np.zeros(n), 0.0)
    a, c = np.empty((n, n)), np.empty(n)
    for j in range(n):
        rates, _, y = probe.at(UNIT * (np.arange(n) == j), 0.0)
        a[:, j], c[j] = rates / UNIT, y[row] / UNIT
    rates, _, y = probe.at(np.zeros(n), UNIT)
    b, d = rates / UNIT, float(y[row] / UNIT)
    # coordinates that must repeat stand by themselves; what they and constant forces do to the free ones
    free = s.free
    turned, steady = s.transform @ a @ s.inverse, s.transform @ base
    inner, center, runaway = turned[free][:, free], np.zeros(n), False
    if np.any(steady[free] != 0):
        try:
            center[free] = -np.linalg.solve(inner, steady[free])
        except np.linalg.LinAlgError:
            runaway = True
    rates = turned @ center + steady
    speed, tied = np.zeros(n), np.abs(turned) @ np.abs(center) + np.abs(steady)
    for direction in s.shifts:
        speed[direction] = rates[np.flatnonzero(direction)[0]]
    runaway = runaway or bool(np.any(np.abs(rates) > ROUNDED * tied, where=s.inertial))
    center = s.inverse @ center
    poles = np.linalg.eigvals(inner) if len(free) else np.zeros(0, complex)
    mean = 0.0 if free_row else float(y0[row] + c @ center)
    return LinearOrbit(a, b, c, d, center, mean, float(c @ speed), runaway, poles)
