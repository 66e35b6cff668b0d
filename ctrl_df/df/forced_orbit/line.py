"""A line of a family: consecutive orbits, closed one from another by compiled code."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...simulate.engine import State, harmonic_drive
from ..threads import go_on
from ..thresholds import FIRST_STEP, RTOL_SHOTS, SHOTS_AT_ONCE
from .driven_block import DrivenBlock, Laws
from .kernel.continuation import continuation
from .kernel.shooting import address


@dataclass(frozen=True, eq=False)
class ClosedPoints:
    """Consecutive points whose orbits have closed.

    Attributes
    ----------
    count : int
    scaled, mode : arrays
        State of the last orbit, in units of the motion of a free inertia under the force, and its modes.
    symmetric : bool
        Whether that orbit has half-wave symmetry, though sought without.
    """

    count: int
    scaled: np.ndarray
    mode: np.ndarray
    symmetric: bool


class Line:
    """Consecutive points, and the arrays that receive what is measured of their orbits.

    Parameters
    ----------
    block : DrivenBlock
    A, omega : (n,) arrays
    orders : int
        Highest harmonic.
    """

    def __init__(self, block: DrivenBlock, A, omega, orders: int):
        n, rows = len(A), block.row + 1
        self.block, self.A, self.omega, self.orders = block, A, omega, orders
        self.integrals = np.zeros((n, rows, orders + 1), complex)
        self.ends, self.miss = np.zeros((n, 2, rows)), np.zeros(n)
        self.kinds, self.stuck = np.zeros(n, np.int64), np.zeros(n, np.int64)

    def close(self, first: int, state: State, laws: Laws, *, mirrored: bool, max_steps: int) -> ClosedPoints:
        """Close the orbits from point `first` on, started from the state of the one before.

        `laws`: those for motions of their size; `mirrored`: over half periods; `max_steps` bounds the
        integration steps of one. Where laws are odd and an orbit sought without half-wave symmetry has it,
        it is the last of them.
        """
        power, longest = self.block.power, self.block.longest_step(self.orders)
        drive, scratch = harmonic_drive([[0.0, 0.0]], 1.0), np.zeros((1, 2), complex)
        past = np.zeros((4, max(len(power), 1)))
        past[0, : len(state.x)] = state.x / self.units(first - 1)
        past[3, 0] = FIRST_STEP
        mode, known = state.mode.copy(), 1
        p, until_symmetric, symmetric = first, laws.odd and not mirrored, False
        while p < len(self.A):  # compiled code ignores Ctrl-C: some points at a time
            end = min(p + SHOTS_AT_ONCE, len(self.A))
            done, known, symmetric = continuation(
                address(), laws.period_map.at, drive, scratch, self.A[p:end], self.omega[p:end],
                power, past, mode, known, mirrored, until_symmetric, RTOL_SHOTS, longest, max_steps,
                self.integrals[p:end], self.ends[p:end], self.miss[p:end], self.kinds[p:end],
                self.stuck[p:end],
            )  # fmt: skip
            go_on()
            self.block.raise_if_raised()
            p += done
            if p < end or symmetric:
                break
        return ClosedPoints(p - first, past[0, : len(power)], mode, symmetric)

    def units(self, p: int):
        """Motion of a free inertia under the force of point `p`."""
        return self.A[p] / self.omega[p] ** self.block.power
