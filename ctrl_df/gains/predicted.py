"""What the describing function says of gains: cycles at one pair, words and sizes over a grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..limit_cycles.predicted.thresholds import SAME_CROSSING
from .arguments import Box
from .balance import Cycles, cycles_along, polished, settled
from .plane import Plane
from .simulated import worded


@dataclass(frozen=True)
class PredictedCycle:
    """A cycle that the describing function predicts at some gains.

    Attributes
    ----------
    amplitude : float
        At the block's input.
    omega : float
        [rad/s].
    stable : bool or None
        Loeb's criterion; None where it is degenerate.
    """

    amplitude: float
    omega: float
    stable: bool | None

    def __repr__(self) -> str:
        words = {True: "stable", False: "unstable", None: "stability unknown"}[self.stable]
        return f"<PredictedCycle: {self.amplitude:.5g} @ {self.omega:.5g} rad/s, {words}>"


def over_grid(plane: Plane, box: Box, x, y) -> list[Cycles]:
    """Cycles along every value x of the first gain, at values y of the second."""
    return [cycles_along(plane, {**box.fixed, box.free[0]: float(value)}, box.free[1], y) for value in x]


class Summary(NamedTuple):
    """Words, and amplitude, frequency and number of cycles, at every point of a grid of gains."""

    words: np.ndarray
    amplitude: np.ndarray
    omega: np.ndarray
    number: np.ndarray


def summed_up(cycles: list[Cycles], poles) -> Summary:
    """Sum up cycles found along columns of a grid, given the number of poles to the right in the large."""
    words = np.empty(poles.shape, dtype="U32")
    amplitude, omega = np.full(poles.shape, np.nan), np.full(poles.shape, np.nan)
    numbers = np.zeros(poles.shape, dtype=int)
    for i, column in enumerate(cycles):
        stable = settled(column.sine)
        for k in range(poles.shape[1]):
            here = np.flatnonzero(column.index == k)
            here = here[np.argsort(column.p[here])]
            words[i, k] = worded(*fates(stable[here], poles[i, k]))
            numbers[i, k] = here.size
            first = here[stable[here] == 1]
            if first.size:
                amplitude[i, k], omega[i, k] = np.exp([column.p[first[0]], column.q[first[0]]])
    return Summary(words, amplitude, omega, numbers)


def fates(stable, poles) -> tuple[bool, bool, bool]:
    """Return (rests, cycles, diverges), given cycles by rising amplitude and poles in the large."""
    grows = bool(poles > 0)
    rests = not grows if not len(stable) else bool(stable[0] != 1)
    return rests, bool((np.asarray(stable) == 1).any()), grows


def at_one(plane: Plane, gains, sought: str) -> tuple[PredictedCycle, ...]:
    """Cycles at one pair of gains, each brought to convergence."""
    near = cycles_along(plane, gains, sought, np.array([gains[sought]]))
    found: list[tuple[float, float, float]] = []
    for p, q, sine in sorted(zip(near.p, near.q, near.sine, strict=True)):
        exact = polished(plane, gains, float(p), float(q)) or (float(p), float(q), float(sine))
        if not any(
            abs(exact[0] - o[0]) < SAME_CROSSING and abs(exact[1] - o[1]) < SAME_CROSSING for o in found
        ):
            found.append(exact)
    loeb = settled(np.array([f[2] for f in found]))
    return tuple(
        PredictedCycle(float(np.exp(p)), float(np.exp(q)), None if np.isnan(s) else bool(s))
        for (p, q, _), s in zip(found, loeb, strict=True)
    )
