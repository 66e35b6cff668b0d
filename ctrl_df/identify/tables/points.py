"""Measured points of tables N(A, omega): what they weigh, what their errors are relative to.

N of a drive falls by decades over frequency, and a stepped sine is as good, relative to what it measures, at
one end as at the other: errors are relative to ``|N|``, weighted by the stated standard errors where there
are any.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..data.frequency_measurement import FrequencyMeasurement
from ..shooting.scales import Scales
from ..shooting.variables import total_inertia
from ..thresholds import NEARLY_NOTHING
from .thresholds import SCALE_LEAST


@dataclass(frozen=True, eq=False)
class Points:
    """Measured points of all tables in a row.

    Attributes
    ----------
    A, omega, N : (n,) arrays
        Amplitude, frequency [rad/s], measured N.
    weight : (n,) array
        One over the relative standard error, scaled to a mean square of one.
    noise : float
        rms of the stated relative standard errors; NaN where none are stated.
    record : (n,) array of int
        Which table a point belongs to.
    scale : (n,) array
        What errors are relative to: ``|N|``, or a tenth of the median ``|N|`` at that frequency where a point
        is less (a mass that sticks or is about to, an antiresonance: there the scatter does not shrink with
        N).
    unit : str
        Of the amplitudes.
    """

    A: np.ndarray
    omega: np.ndarray
    N: np.ndarray
    weight: np.ndarray
    noise: float
    record: np.ndarray
    scale: np.ndarray
    unit: str = "N"

    @property
    def stated(self) -> float:
        """Rms of the stated relative standard errors, zero where none are stated."""
        return self.noise if math.isfinite(self.noise) else 0.0

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.A)

    def take(self, where) -> Points:
        """Return some of the points."""
        parts = {k: getattr(self, k)[where] for k in ("A", "omega", "N", "weight", "record", "scale")}
        return replace(self, **parts)

    def without(self, where) -> Points:
        """Return the same points, some of them of no weight."""
        return replace(self, weight=np.where(where, 0.0, self.weight))

    def selected(self, count: int, size) -> Points:
        """Return up to `count` points: that of largest `size` in every cell of the logarithmic plane."""
        if len(self) <= count:
            return self
        side = max(int(math.sqrt(count)), 2)
        cell = np.zeros(len(self), int)
        for axis in (self.A, self.omega):
            place = np.log(axis)
            width = max(float(np.ptp(place)), NEARLY_NOTHING)
            cell = cell * side + np.minimum((side * (place - place.min()) / width).astype(int), side - 1)
        order = np.argsort(-np.asarray(size), kind="stable")
        _, first = np.unique(cell[order], return_index=True)
        return self.take(np.sort(order[first]))


def points_of(records: Sequence[FrequencyMeasurement]) -> Points:
    """Return the measured points of several tables in a row.

    N = 0 says that the mass stood still. At frequencies where nothing moved there is no scale to measure by:
    those points are left out, see `counted`.
    """
    rows, sigmas, numbers = [], [], []
    for i, r in enumerate(records):
        keep = counted(r)
        row, column = np.nonzero(keep)
        rows.append((r.A[row], r.omega[column], r.N[keep]))
        sigmas.append(r.noise_of_points[keep[np.isfinite(r.N)]])
        numbers.append(np.full(len(row), i))
    a, w, n = (np.concatenate(column) for column in zip(*rows, strict=True))
    sigma, known = np.concatenate(sigmas), np.concatenate(sigmas)
    if np.all(np.isfinite(known)):
        noise = math.sqrt(float(np.mean(sigma**2)))
        weight = 1 / sigma
        weight = weight / math.sqrt(float(np.mean(weight**2)))
    else:
        noise, weight = math.nan, np.ones(len(a))
    scale = np.abs(n)
    for value in np.unique(w):
        here = w == value
        scale[here] = np.maximum(scale[here], SCALE_LEAST * np.median(np.abs(n[here & (n != 0)])))
    return Points(a, w, n, weight, noise, np.concatenate(numbers), scale, records[0].input_unit)


def counted(record: FrequencyMeasurement) -> np.ndarray:
    """Return which cells (na, nw) of a table count: measured, where some amplitude moved the mass."""
    measured = np.isfinite(record.N)
    return measured & np.any(measured & (record.N != 0), axis=0)


def table_scales(block, points: Points) -> Scales:
    """Return typical sizes of force, position, speed and mass in the tables."""
    amplitude = points.A * np.abs(points.N)
    force, position, speed = (float(np.median(v)) for v in (points.A, amplitude, amplitude * points.omega))
    return Scales(force, position, speed, total_inertia(block), force)
