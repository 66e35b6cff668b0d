"""Forced periodic orbits under a waveform that holds more than its fundamental."""

from __future__ import annotations

import numpy as np

from ..df.orbits import OrbitSolver, _OutOfWork
from ..simulate.engine import harmonic_drive


class WaveformOrbit(OrbitSolver):
    """`OrbitSolver` for the input ``Re sum U_k exp(j k omega t)``; each solution starts the next."""

    def respond(self, U, omega: float):
        """Return the output's coefficients Y_k, k = 0..len(U) - 1, or None where no attracting period is found."""
        U = np.asarray(U, dtype=complex)
        size = float(abs(U[1]))
        self.omega, self.period, self.budget = omega, 2 * np.pi / omega, self.max_steps
        self.drive, self.flipped = harmonic_drive([U], omega), harmonic_drive([-U], omega)
        try:
            for state in self._starts(size):
                state.time, state.fresh = 0.0, True
                orbit = self._periodic(state)
                if orbit is not None:
                    self.previous = orbit[0]
                    return self._harmonics(orbit[0], size, U.size - 1, 1)[0] * size
        except _OutOfWork:
            pass
        return None

    def _starts(self, size):
        """States to start from: the last orbit, rest, and for a gap a knock that leaves the motion without contact."""
        if self.previous is not None:
            yield self.previous.copy()
            self.previous = None
        if self.core is None or self.core.gap == 0:
            yield self._start(size)
            yield self._follow(self._start(size), 30)
            return
        driven = size / (sum(self.core.masses) * self.omega)
        crossing = self.core.gap * self.omega / np.pi  # one gap in half a period: the two-impact motion
        for speed in (3.0 * driven, crossing, -crossing, 2.0 * crossing, -driven):
            x = np.zeros(self.engine.nstates)
            x[2], x[3] = 0.5 * self.core.gap, speed
            yield self._follow(self.engine.start(x), 20)
