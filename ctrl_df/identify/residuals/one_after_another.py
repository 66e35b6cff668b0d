"""Where segments begin whose hidden states go on, found one after the other.

All at once they are hard to find: what hides at the end of one moves all later ones, and each has wrong
minima of its own. One after the other each is a problem of a place and a speed: what hides in it is known
from the one before, and so is about where it begins.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import least_squares

from ..data.measurement import Measurement
from ..prediction.initial_states import CONTINUED, FREE, continued_names, fitted_names
from ..prediction.segments import Segments
from ..prediction.sensed import sensed
from ..prediction.simulator import Simulator
from ..prediction.simulators import simulator_of
from ..prediction.values import block_of
from ..shooting.thresholds import HIDDEN_NUDGE
from .thresholds import HORIZON_ONE, HORIZON_TOLERANCE


def one_after_another(
    model, record: Measurement, segments: Segments, starts: np.ndarray, decimation: int
) -> np.ndarray:
    """Return the initial states of a record's segments, all of the hidden ones going on from before.

    Parameters
    ----------
    model : block
    record : Measurement
    segments : Segments
    starts : (nw, ns) array
        Initial states to begin with, the hidden ones of a segment that follows no other as they are.
    decimation : int
        Samples a step of the input.

    Returns
    -------
    (nw, ns) array
        Those that lie nearer.
    """
    simulator = simulator_of(model, record, decimation=decimation, initial=FREE)
    names, core = simulator.free_states, block_of(model).core
    own = [names.index(n) for n in fitted_names(core, CONTINUED)]
    hidden = np.isin(names, continued_names(core, CONTINUED))
    reach, numbers = simulator.beginnings.priors(segments), np.arange(len(segments))
    found = np.zeros_like(reach)
    found[:, : starts.shape[1]] = starts[:, : len(names)]
    for w in numbers:
        here, tries = segments.only(numbers == w), [found[w]]
        if segments.follow[w]:
            two = segments.only((numbers == w) | (numbers == w - 1))
            before = simulator.continued_from(two, None, found[w - 1 : w + 1])[1]
            if np.all(np.isfinite(before)):
                tries = [before, np.where(hidden, before, found[w])]
        moved = [_moved(simulator, record, here, start, own, reach[w]) for start in tries]
        found[w] = min(moved, key=lambda m: m[0])[1]
    return found


def _moved(simulator: Simulator, record, segment, start, own, reach) -> tuple[float, np.ndarray]:
    """Return the squared error of one segment, and the state it begins in, with its own states moved."""
    measured, step = sensed(record).within(segment.samples), HIDDEN_NUDGE * reach[own]

    def at(moves) -> np.ndarray:
        state = start.copy()
        state[own] += moves * step
        return state

    def left(moves) -> np.ndarray:
        return simulator.run(segment, None, at(moves)[None]) - measured

    def slopes(moves) -> np.ndarray:
        here = left(moves)
        return np.column_stack([left(moves + one) - here for one in np.eye(len(own))])

    jac: Any = slopes  # the stubs know names only
    fit = least_squares(left, np.zeros(len(own)), jac=jac, ftol=HORIZON_TOLERANCE, max_nfev=HORIZON_ONE)
    return 2 * float(fit.cost), at(fit.x)
