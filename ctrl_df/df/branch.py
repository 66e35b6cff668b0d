"""Further branches of N: known motions of a block besides the one that its describing function names.

Under one force a block may have several motions. ``N(a, omega)`` names one of them, an attracting one; the
others balance a loop just as well. A `Branch` is one such motion followed by a parameter s of its own, which
may pass folds where the amplitude turns back. A method that knows branches returns them from
``Method.branches``; the search for limit cycles takes them from there and asks no more about them than this.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np


class Motions(NamedTuple):
    """Points of a branch, for n pairs (s, omega).

    Attributes
    ----------
    amplitude : ndarray, shape (n,)
        Of the input, > 0.
    harmonics : ndarray of complex, shape (n, orders + 1)
        Y_k / amplitude as in a `Family`; index 1 is N on this branch. Smooth in s, also beyond the ends of
        the branch as far as its formula goes; NaN where that ends too.
    exists : ndarray of bool, shape (n,)
        Whether the motion is possible there, not only its formula.
    multiplier : ndarray, shape (n,)
        Largest multiplier of one period of the force (modulus): the motion attracts below 1.
    """

    amplitude: np.ndarray
    harmonics: np.ndarray
    exists: np.ndarray
    multiplier: np.ndarray


@dataclass(frozen=True, eq=False)
class Branch:
    """One motion of a block under ``a cos(omega t)``, followed over amplitude and frequency.

    Attributes
    ----------
    name : str
        The motion in words, after "the".
    regime : str
        As in `Family.motion`.
    grid : ndarray
        Values of s, ascending, dense enough that N is nearly linear from one to the next.
    motions : callable
        ``motions(s, omega, orders) -> Motions`` for two equally long 1-D arrays.
    state : callable or None
        ``state(s, omega)``: the state of the block at t = 0, positions about the mean of the output; from it
        the search for the exact orbit starts. None where it is not known.
    """

    name: str
    regime: str
    grid: np.ndarray
    motions: Callable[[np.ndarray, np.ndarray, int], Motions]
    state: Callable[[float, float], np.ndarray] | None = None

    def differentiated(self, order: int) -> Branch:
        """Return the branch of the output differentiated `order` times (1: of a velocity)."""

        def motions(s, omega, orders):
            found = self.motions(s, omega, orders)
            turn = (1j * omega[:, None] * np.arange(orders + 1)) ** order
            return found._replace(harmonics=found.harmonics * turn)

        return replace(self, motions=motions)
