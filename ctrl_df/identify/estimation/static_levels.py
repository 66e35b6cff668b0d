"""Static levels sought over the whole range that records leave.

A static level acts where a body breaks away, and single samples pass it: the cost over it is a staircase that
slopes tell nothing of. A descent keeps the level that it begins with, and bends all other parameters to it.
Over its whole range the cost falls towards the right level from either side, the more of a motion begins too
early or too late.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from ...blocks.core import kinetic_level
from ...simulate.parallel import side_by_side
from ..data.measurement import Measurement
from ..prediction.segments import load_of
from ..prediction.values import block_of, with_values
from ..shooting.thresholds import BETTER_MINIMUM
from ..thresholds import GIVE_UP
from .fit import FitResult
from .thresholds import (
    BREAKAWAY_LEAST,
    BREAKAWAYS_AROUND,
    BREAKAWAYS_OVER_ALL,
    COST_GAIN,
    EFFORT_STATES,
    ITERATIONS,
    OPEN_RANGE,
)


def common_levels(found: FitResult) -> list[str]:
    """Return the static levels that a fit moves, those that records have for themselves left aside."""
    table = block_of(found.model).parameters
    return [n for n in found.names if table[n].threshold and n not in found.own]


def with_levels_scanned(
    found: FitResult, fit: Callable[..., FitResult], records: Sequence[Measurement]
) -> FitResult:
    """Return a fit from those static levels with which it errs least, all else kept; or itself.

    Parameters
    ----------
    found : FitResult
    fit : callable
        ``fit(model, names, starts=, iterations=, tolerance=, give_up=)`` over the segments of `found`.
    records : sequence of Measurement
        Those fitted.
    """
    near = found
    for name in common_levels(found):
        near = _with_level_scanned(near, name, fit, records)
    if near is found:
        return found
    return fit(near.model, found.names, starts=near.starts, iterations=ITERATIONS, tolerance=COST_GAIN)


def _with_level_scanned(found: FitResult, name: str, fit, records) -> FitResult:
    steps, gain = EFFORT_STATES
    far = GIVE_UP * found.rmse
    states_of = partial(fit, names=(), starts=None, iterations=steps, tolerance=gain, give_up=far)
    best, block = found, block_of(found.model)
    (low, high), count = _shown(block, records), BREAKAWAYS_OVER_ALL
    tried: dict[float, FitResult] = {}
    while high > (1 + OPEN_RANGE[0]) * low:
        levels = np.geomspace(low, high, count).tolist()
        new = [v for v in levels if v not in tried]
        tried |= zip(new, side_by_side(lambda v: states_of(with_values(block, {name: v})), new), strict=True)
        i = min(range(count), key=lambda k: tried[levels[k]].rmse)
        there = tried[levels[i]]
        best = there if there.rmse < BETTER_MINIMUM * best.rmse else best
        low, high, count = levels[max(i - 1, 0)], levels[min(i + 1, count - 1)], BREAKAWAYS_AROUND
    return best


def _shown(block, records) -> tuple[float, float]:
    """Return the range of static levels that records can show: from the kinetic one to the largest force."""
    largest = max(float(np.max(np.abs(load_of(block, r)))) for r in records)
    return max(kinetic_level(block.effects), BREAKAWAY_LEAST * largest), largest
