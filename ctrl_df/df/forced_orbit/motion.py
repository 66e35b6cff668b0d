"""What is found at a point of a family, and what the next point starts from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...simulate.engine import State
from ...thresholds import NOTHING
from ..thresholds import CHANGES_SEEN, EVEN_LEAST, SLOW_CHANGE
from .driven_block import Laws
from .forced_map import ForcedMap
from .fourier import even_share
from .orbit_search import ClosedOrbit
from .regimes import regime_of


@dataclass(frozen=True, eq=False)
class Start:
    """What a point starts from: where the point before has left off.

    Attributes
    ----------
    laws : Laws
        Those for motions of its size.
    state : State or None
        Of its motion; None: from rest.
    simple : bool
        Whether it closed as an orbit of one period.
    asymmetric : bool
        Whether that orbit has lost the half-wave symmetry that the laws have: the next one begins without.
    """

    laws: Laws
    state: State | None = None
    simple: bool = False
    asymmetric: bool = False


@dataclass(frozen=True, eq=False)
class Motion:
    """The steady motion at a point: Y_k without delays and offsets, regime, residual, and the next start."""

    coefficients: np.ndarray
    regime: str
    residual: float
    after: Start


def motion_of(forced_map: ForcedMap, orbit: ClosedOrbit, y) -> Motion:
    """Return the motion of a closed orbit of one period with coefficients y."""
    laws, even = forced_map.laws, even_share(y)
    asymmetric = False
    if laws.odd and not orbit.mirrored:
        # without even harmonics asked for it is not known
        asymmetric = len(y) < 3 or bool(even > EVEN_LEAST)
        if not asymmetric:
            laws.forget_jacobian()  # it is of shots twice as long
    regime = regime_of(
        forced_map.block, laws, mirrored=orbit.mirrored, kinds=orbit.kinds, stuck=orbit.stuck,
        fundamental=y[1], even=even, ends=orbit.ends, error=orbit.error,
    )  # fmt: skip
    return Motion(y, regime, orbit.error, Start(laws, orbit.state, True, asymmetric))


def changes(laws: Laws, samples, count: int):
    """Return changes over `count` shots of the coordinates that have to repeat, in their sizes."""
    s, steps = laws.symmetries, samples[count:] - samples[:-count]
    wrap = np.where(s.wrap > 0, s.wrap, 1.0)
    steps -= np.where(s.wrap > 0, np.round(steps / wrap) * wrap, 0.0)
    return (steps / np.maximum(np.max(np.abs(samples), axis=0), NOTHING))[:, s.free]


def slow(laws: Laws, samples) -> bool:
    """Whether a motion changes little, and steadily, from shot to shot: a transient, not chaos."""
    steps = np.max(np.abs(changes(laws, samples, 1)), axis=1, initial=0.0)[-CHANGES_SEEN:]
    return bool(np.max(steps) < SLOW_CHANGE and np.max(steps) < 2 * np.min(steps))
