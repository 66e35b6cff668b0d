"""Error of free prediction against how far ahead it is made, from some motions to the whole record."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...drawing import draw
from ...thresholds import NOTHING
from ..data.imposed import imposes_motion
from ..data.measurement import Measurement
from ..estimation.fit import FitResult, fit_segments
from ..estimation.starts import matching_initial_states
from ..estimation.thresholds import DECIMATION
from ..prediction.initial_states import CONTINUED, FREE
from ..prediction.segments import equal_segments, facts
from ..prediction.sensed import sensed
from ..prediction.simulators import simulator_of
from ..shooting.problem import Settings
from ..shooting.thresholds import SHORTEST_SEGMENT
from ..thresholds import FULL_SAMPLES
from .one_after_another import one_after_another
from .thresholds import (
    HORIZON_FIRST,
    HORIZON_LAST,
    HORIZON_ON,
    HORIZON_TOLERANCE,
    HORIZONS,
    SHORTEST_HORIZON,
)


@dataclass(frozen=True, eq=False)
class ErrorByHorizon:
    """Error of a model's free prediction against its length.

    The records are divided into segments of every length. In each the model runs freely from a position and a
    speed that are fitted; the hidden states of joints, gaps and bristles are continued from one segment to
    the next. The longest is the whole record, a free run, as `compare` makes it with ``mode="free"``.

    Attributes
    ----------
    horizon : (n,) array
        Lengths [s], ascending; the last is that of the longest record.
    rmse, nrmse : (n,) arrays
        Error, in the unit of the output, and over the rms of the centred output.
    by_noise : (n,) array
        What noise makes of it, over the same rms, that leaves the state open where a segment begins: of an
        unstable machine, which a controller holds, all of the motion within a moment.
    unit : str
        Of the output.
    name : str
        Of the records.
    """

    horizon: np.ndarray
    rmse: np.ndarray
    nrmse: np.ndarray
    by_noise: np.ndarray
    unit: str = ""
    name: str = ""

    @property
    def whole(self) -> float:
        """The nrmse of the free run of the whole record."""
        return float(self.nrmse[-1])

    def plot(self, *others: ErrorByHorizon, labels: Sequence[str] = (), **keywords):
        """Draw it, beside others where they are given; returns a ``ct.ControlPlot``.

        Parameters
        ----------
        *others : ErrorByHorizon
        labels : sequence of str
            One a curve.
        """
        return draw("horizons", (self, *others), labels=labels, **keywords)

    def __str__(self) -> str:
        rows = (f"{h:>9.3g} s  {e:.3g}" for h, e in zip(self.horizon, self.nrmse, strict=True))
        return "\n".join(["  horizon    nrmse", *rows])


def error_by_horizon(model, records: Sequence[Measurement], most: int = HORIZONS) -> ErrorByHorizon:
    """Return the error of a model as it is over segments of every length.

    Parameters
    ----------
    model : block or loop
        Of a loop, and of a system of which nothing is known, the whole record alone is a horizon, as what
        hides in them cannot be restarted; and so it is under an imposed motion.
    records : sequence of Measurement
    most : int
        Lengths at most, each half of the one before.
    """
    records = list(records)
    found = _ladder(model, records, most)
    # of several outputs each counts over its own noise
    outputs = [(w, y) for r in records for w, y in zip(sensed(r).weights, sensed(r).values, strict=True)]
    power = sum(w**2 * float(np.sum((y - y.mean()) ** 2)) for w, y in outputs)
    count = sum(len(y) for _, y in outputs)
    squares = np.array([sum(float(e @ e) for e in f.residual) for f in found])
    longest = max(r.duration for r in records)
    horizon = longest / 2.0 ** np.arange(len(found) - 1, -1, -1)
    return ErrorByHorizon(
        horizon, np.sqrt(squares / count), np.sqrt(squares / max(power, NOTHING)),
        _by_noise(model, records, found, math.sqrt(max(power, NOTHING) / count)), records[0].output_unit,
        ", ".join(r.name for r in records),
    )  # fmt: skip


def noise_of(records: Sequence[Measurement]) -> float:
    """Return the noise of records over the rms of their centred outputs."""
    known = [facts(r) for r in records]
    return math.sqrt(sum(f.noise**2 for f in known) / max(sum(f.spread**2 for f in known), NOTHING))


def _by_noise(model, records, found: Sequence[FitResult], spread: float) -> np.ndarray:
    """Return over every length what becomes of states that the noise within the shortest leaves open."""
    moved, off = np.zeros(len(found)), noise_of(records) * spread
    decimation = _decimation(records)
    for i, record in enumerate(records):
        root = found[0].starts_open(i) if len(found) > 1 else None
        if root is None:
            return moved
        for k, f in enumerate(found):
            initial, start = FREE if f is found[-1] else CONTINUED, f.starts[i]
            apart = off * root[:: len(root) // len(start), : start.shape[1]]
            starts = np.repeat(start[None], 1 + apart.shape[2], axis=0)
            starts[1:, :, : apart.shape[1]] += np.moveaxis(apart, 2, 0)
            simulator = simulator_of(model, record, decimation=decimation, initial=initial)
            y, *others = simulator.run_all([(f.segments[i], None, s) for s in starts])
            moved[k] += float(np.sum((np.array(others) - y) ** 2))
    return np.sqrt(moved / sum(map(len, found[0].simulated))) / spread


def _decimation(records) -> int:
    return max(1, round(max(map(len, records)) / FULL_SAMPLES))


def _ladder(model, records, most) -> list[FitResult]:
    """Return the initial states fitted over segments of every length, the shortest first."""
    decimation = _decimation(records)
    first, found = simulator_of(model, records[0]), []
    if first.mechanism and not first.closed and not any(map(imposes_motion, records)):
        least = [max(SHORTEST_HORIZON * facts(r).period, SHORTEST_SEGMENT * facts(r).dt) for r in records]
        halvings = min(int(math.log2(max(r.duration / s, 1.0))) for r, s in zip(records, least, strict=True))
        for k in range(min(halvings, most - 1), 0, -1):
            found.append(_fitted(model, records, 2**k, decimation, CONTINUED, found))
    return [*found, _fitted(model, records, 1, decimation, FREE, found)]


def _fitted(model, records, parts, decimation, initial, shorter) -> FitResult:
    """Fit initial states of segments: roughly from those of shorter ones, then once at the full rate."""
    segments = [equal_segments(r, parts) for r in records]
    near: Any = matching_initial_states(shorter[-1], segments) if shorter else None
    rates = [(DECIMATION * decimation, HORIZON_ON if shorter else HORIZON_FIRST), (decimation, HORIZON_LAST)]

    def found(initial, rate, iterations) -> FitResult:
        return fit_segments(
            model, records, segments, (), Settings(initial=initial), decimation=rate, starts=near,
            iterations=iterations, tolerance=HORIZON_TOLERANCE, errors=rate == decimation,
        )  # fmt: skip

    if simulator_of(model, records[0], initial=CONTINUED).continued and (shorter or initial == CONTINUED):
        near = near or found(FREE, decimation, HORIZON_FIRST).starts
        if initial == CONTINUED:
            each = zip(records, segments, near, strict=True)
            near = [one_after_another(model, r, w, start, decimation) for r, w, start in each]
        del rates[0]  # they are near, and longer steps of the input would lead away
    for rate, iterations in rates:
        last = found(initial, rate, iterations)
        near = last.starts
    return last
