"""A line of a family: consecutive orbits, closed one from another by compiled code."""

from __future__ import annotations

import numpy as np

from ...simulate.engine import State, harmonic_drive
from ..threads import go_on
from ..thresholds import AT_ONCE, FIRST_STEP, RTOL
from .continuation import continuation
from .shooting import address


class Line:
    """Consecutive points and what is measured of their orbits.

    Parameters
    ----------
    search : OrbitSearch
        Acquainted with motions of their size.
    A, omega : (n,) arrays
    orders : int
        Highest harmonic.
    """

    def __init__(self, search, A, omega, orders: int):
        n, rows = len(A), search.row + 1
        self.search, self.A, self.omega, self.orders = search, A, omega, orders
        self.integrals = np.zeros((n, rows, orders + 1), complex)
        self.ends, self.miss = np.zeros((n, 2, rows)), np.zeros(n)
        self.kinds, self.still = np.zeros(n, np.int64), np.zeros(n, np.int64)
        self._drive, self._scratch = harmonic_drive([[0.0, 0.0]], 1.0), np.zeros((1, 2), complex)
        self._power = search.symmetries.power
        self._past = np.zeros((4, max(len(self._power), 1)))
        self._mode, self._known = np.zeros(0, np.int64), 0
        self.symmetrical = False  # the last orbit closed turned out to be, though sought without symmetry

    def close(self, first: int, state: State) -> int:
        """Close the orbits from point `first` on, started from the orbit of the one before; return how many.

        Where laws are odd and an orbit sought without half-wave symmetry has it, it is the last of them.
        """
        s = self.search
        self._past[0, : len(state.x)] = state.x / self._units(first - 1)
        self._past[3, 0] = FIRST_STEP
        self._mode, self._known = state.mode.copy(), 1
        p, broken = first, s.symmetric and not s.mirrored
        self.symmetrical = False
        while p < len(self.A):  # compiled code hears no Ctrl-C: some points at a time
            end = min(p + AT_ONCE, len(self.A))
            done, self._known, self.symmetrical = continuation(
                address(), s.shot.at, self._drive, self._scratch, self.A[p:end], self.omega[p:end],
                self._power, self._past, self._mode, self._known, s.mirrored, broken, RTOL,
                s.longest_step(self.orders), s.max_steps, self.integrals[p:end], self.ends[p:end],
                self.miss[p:end], self.kinds[p:end], self.still[p:end],
            )  # fmt: skip
            go_on()
            s.raise_if_raised()
            p += done
            if p < end or self.symmetrical:
                break
        return p - first

    def state(self, p: int) -> State:
        """State of the orbit of point `p`, the last one closed."""
        return State(0.0, self._past[0, : len(self._power)] * self._units(p), self._mode.copy())

    def _units(self, p):
        return self.A[p] / self.omega[p] ** self._power
