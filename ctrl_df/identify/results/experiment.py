"""An input that separates the candidates that a diagnosis leaves open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Experiment:
    """An input ready to be applied; unpacks into ``t, u``, prints as a sentence.

    Attributes
    ----------
    t, u : arrays
        Times [s] and force [N] or torque [N m] (for a loop the reference [m or rad]), held between
        samples.
    kind : str
        ``multisine``, ``chirp``, ``steps``, ``triangle`` or ``stepped sine``.
    candidates : tuple of str
        What it separates.
    separation : float
        rms difference of their outputs, over the noise; the least over all pairs.
    stroke : float
        Largest distance from the start that any candidate reaches [m or rad].
    reason : str
        A sentence.
    points : tuple of (float, float)
        Amplitude and frequency [rad/s] of each part of a stepped sine, in order.
    force : float
        Largest force that is asked of the drive [N or N m].
    """

    t: np.ndarray
    u: np.ndarray
    kind: str
    candidates: tuple[str, ...]
    separation: float
    stroke: float
    reason: str
    points: tuple[tuple[float, float], ...] = ()
    force: float = 0.0

    def __iter__(self):
        return iter((self.t, self.u))

    def __str__(self) -> str:
        step = float(np.median(np.diff(self.t))) if len(self.t) > 1 else 0.0
        return f"{self.reason} {len(self.t):,} samples, one every {step:.3g} s."

    def __repr__(self) -> str:
        return f"<Experiment: {self}>"


def separated(names: Sequence[str]) -> str:
    """Return in words what an input is to separate: one candidate from the model without it."""
    return " and ".join(n.replace("_", " ") for n in (names if len(names) > 1 else ("no effect", *names)))
