"""A model beside measured tables N(A, omega): how far off, whether beyond scatter, and where on the plane."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...cached import cached_property
from ...drawing import draw
from ..data.frequency_measurement import FrequencyMeasurement
from ..residuals.comparison_base import ComparisonBase
from ..residuals.regions import Region, Regions, chance_of, holm
from ..thresholds import LEVEL
from .errors import rms
from .points import Points, counted, points_of
from .simulated import relative_error, simulate_table
from .thresholds import PAIRS_LEAST, REGION_BANDS


@dataclass(frozen=True)
class Scatter:
    """Whether neighbours on the plane err independently of each other: true if so.

    Attributes
    ----------
    correlation : float
        Of the relative errors of neighbours over amplitude or over frequency, whichever tells more; 0 for
        mere scatter, near 1 for an effect's signature.
    p_value : float
        Probability of a correlation this far from none by chance.
    """

    correlation: float
    p_value: float

    def __bool__(self) -> bool:
        """Return whether the errors are mere scatter (at the level of 1 %)."""
        return self.p_value >= LEVEL


@dataclass(frozen=True, eq=False)
class TableComparison:
    """A model beside one table.

    Attributes
    ----------
    record : FrequencyMeasurement
    simulated, residual : (na, nw) complex array
        Model's N; measured minus model's. NaN where nothing was measured or the model has no answer.
    relative : (na, nw) complex array
        Residual over ``|N|``; a point where the model has no answer counts as one.
    """

    record: FrequencyMeasurement
    simulated: np.ndarray
    residual: np.ndarray
    relative: np.ndarray

    @property
    def nrmse(self) -> float:
        """Rms of the relative errors."""
        return rms(self.relative[np.isfinite(self.relative)])


@dataclass(frozen=True, eq=False, repr=False)
class FrequencyComparison(ComparisonBase):
    """Outcome of `compare` for tables: all points together in the figures, each table in `records`.

    Errors are relative to ``|N|``. `simulated` and `residual` are arrays for one table, tuples for several.
    """

    records: tuple[TableComparison, ...]

    @property
    def relative(self):
        """Residual over ``|N|``."""
        return self._each("relative")

    @property
    def rmse(self) -> float:
        """Rms of the residual [output unit over input unit]."""
        return rms(np.concatenate([r.residual[np.isfinite(r.residual)] for r in self.records]))

    @property
    def nrmse(self) -> float:
        """Rms of the relative errors of all points."""
        return rms(np.concatenate([r.relative[np.isfinite(r.relative)] for r in self.records]))

    @cached_property
    def white(self) -> Scatter:
        """Whether what remains is scatter: true if neighbours on the plane err independently."""
        return scatter([r.relative for r in self.records])

    @cached_property
    def where(self) -> Regions:
        """Amplitudes and frequencies ranked by their share of the error."""
        points = points_of([r.record for r in self.records])
        error = np.concatenate([r.relative[counted(r.record)] for r in self.records])
        return plane_regions(points, error)

    def report(self) -> str:
        """Return the comparison as text."""
        lines = [str(self)]
        if len(self.records) > 1:
            lines += [f"  {r.record.name:<24} nrmse {r.nrmse:.4g}" for r in self.records]
        return "\n".join([*lines, "", *self.places[:6], "", self.where.table(8)])

    def __str__(self) -> str:
        """Return it as text."""
        count = sum(int(np.isfinite(r.relative).sum()) for r in self.records)
        lost = sum(int((np.isfinite(r.record.N) & ~np.isfinite(r.simulated)).sum()) for r in self.records)
        text = (
            f"{count} points of N(A, omega): error {self.nrmse:.4g} of |N|, fit {self.fit_percent:.2f} %, "
            f"errors of neighbours {'agree no more than by chance' if self.white else 'agree'} (correlation "
            f"{self.white.correlation:.2f}, p = {self.white.p_value:.2g})"
        )
        if lost:
            text += f"; at {lost} of them the model stands still or has no periodic answer (counted as N = 0)"
        return text + "."

    @property
    def over(self) -> str:
        """What the errors are over, in words."""
        return "the plane"

    def plot(self, record=None, **keywords):
        """Draw measured and model's N, and the error on the plane; returns a ``ct.ControlPlot``."""
        return draw("table comparison", self, record=record, **keywords)


def comparison_of_tables(model, records) -> FrequencyComparison:
    """Return the comparison; `records` are known to be tables."""
    rows = []
    for record in records:
        points = points_of([record])
        found = simulate_table(model, points)
        where = counted(record)
        simulated = np.full(record.N.shape, np.nan + 0j)
        relative = simulated.copy()
        simulated[where], relative[where] = found, relative_error(found, points)
        rows.append(TableComparison(record, simulated, record.N - simulated, relative))
    return FrequencyComparison(model, tuple(rows))


def inner_block(model):
    """Return the block of a closed loop, or the model itself."""
    return getattr(getattr(model, "parts", None), "block", model)


# --- the plane ------------------------------------------------------------------------------------


def scatter(tables) -> Scatter:
    """Correlate the errors of neighbouring grid points, over amplitude and over frequency apart.

    Where errors are independent the phase of each pair's product is any: of the sum of the real parts the
    variance is half the sum of the squares, however much larger errors are at one end of the plane. One
    direction or both together count, whichever tells more: a signature may be smooth over amplitude and
    change from one frequency to the next.
    """
    sums = []
    for axis in (0, 1):
        pairs = [_neighbours(e, axis) for e in tables]
        a, b = (np.concatenate(side) for side in zip(*pairs, strict=True))
        size = np.abs(a) * np.abs(b)
        if len(size) >= PAIRS_LEAST and size.any():
            product = float(np.sum(np.real(a * b.conj())))
            power = math.sqrt(float(np.sum(np.abs(a) ** 2)) * float(np.sum(np.abs(b) ** 2)))
            sums.append((product, 0.5 * float(np.sum(size**2)), power))
    if not sums:
        return Scatter(0.0, 1.0)
    together = [tuple(map(sum, zip(*sums, strict=True)))] if len(sums) > 1 else []
    found = [(abs(s) / math.sqrt(variance), s / power) for s, variance, power in (*sums, *together)]
    z, correlation = max(found)
    return Scatter(correlation, min(len(found) * math.erfc(z / math.sqrt(2)), 1.0))


def _neighbours(errors: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the errors of neighbours along an axis of a grid, where both are known."""
    lines = np.moveaxis(errors, axis, 0)
    both = np.isfinite(lines[1:]) & np.isfinite(lines[:-1])
    return lines[1:][both], lines[:-1][both]


def plane_regions(points: Points, error) -> Regions:
    """Rank bands of amplitude and of frequency by their share of the squared relative error.

    Points are taken to err independently: a band's squares beside all others' are then an F ratio.
    """
    size = np.abs(error) ** 2
    total = float(size.sum())
    if total == 0 or len(points) < 4:
        return Regions()
    found = []
    for kind, axis, unit, scale in (
        ("amplitude", points.A, points.unit, 1.0),
        ("frequency", points.omega, "rad/s", 1 / (2 * math.pi)),
    ):
        for inside, low, high in _bands(axis):
            n = int(inside.sum())
            share, expected = float(size[inside].sum()) / total, n / len(points)
            if n == len(points):
                continue
            p = chance_of(share, expected, 2 * n, 2 * (len(points) - n))
            label = f"{low:.3g} to {high:.3g} {unit}" if high > low else f"{low:.3g} {unit}"
            bias = float(np.mean(error[inside].real)) / math.sqrt(total / len(points))
            found.append((p, kind, label, share, expected, bias, (low * scale, high * scale)))
    found.sort(key=lambda r: r[0])
    regions = []
    chances = holm([r[0] for r in found]).tolist()
    for p, (_, kind, label, share, expected, bias, span) in zip(chances, found, strict=True):
        what = "amplitudes" if kind == "amplitude" else "frequencies"
        sentence = (
            f"{share:.0%} of the squared error lies at {what} of {label}, against {expected:.0%} of the "
            f"points (p {'< 1e-6' if p < 1e-6 else f'= {p:.2g}'})."
        )
        regions.append(Region(kind, label, share, expected, p, bias, 1.0, span, sentence))
    regions.sort(key=lambda r: (r.p_value >= LEVEL, -r.excess))
    return Regions(regions)


def _bands(axis, count=REGION_BANDS):
    """Yield up to `count` bands of about as many distinct values each."""
    values = np.unique(axis)
    for part in np.array_split(values, min(count, len(values))):
        yield (axis >= part[0]) & (axis <= part[-1]), float(part[0]), float(part[-1])
