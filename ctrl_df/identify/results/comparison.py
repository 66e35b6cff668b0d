"""A model beside its records: how far off, whether by more than noise, and where."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...blocks.coordinates import moving_in
from ...cached import cached_property
from ...drawing import draw
from ...numerals import probability
from ...table import Brief
from ..data.imposed import imposed_motion
from ..data.measurement import Measurement
from ..data.signals import automatic_cutoff, derivative
from ..prediction.segments import facts
from ..prediction.sensed import sensed
from ..residuals.comparison_base import ComparisonBase
from ..residuals.horizons import ErrorByHorizon, error_by_horizon
from ..residuals.regions import Regions, error_regions
from ..residuals.residual_tests import (
    InputTest,
    Whiteness,
    input_residual_test,
    nrmse,
    rmse,
    whiteness,
)
from ..smoothing.missing_force import MissingForce, missing_force, missing_of_imposed
from ..thresholds import RECORD_SAMPLES
from .thresholds import SMOOTHED_ENDS, SPECTRUM_LEAST


@dataclass(frozen=True, eq=False, repr=False)
class RecordComparison(Brief):
    """A model beside one record.

    Attributes
    ----------
    record : Measurement
    simulated, residual : (n,) array
        At the record's samples; residual is measured minus simulated.
    edges : (nw + 1,) array
        Samples at which the model was restarted; two for a free run.
    fitted : int
        Parameters fitted to these data.
    model : block or loop
        What was compared.
    outputs : mapping
        Simulated outputs by quantity, where the record holds several; `simulated` and `residual` are of the
        one that leads, `record.output`.
    """

    record: Measurement
    simulated: np.ndarray
    residual: np.ndarray
    edges: np.ndarray
    fitted: int = 0
    model: Any = None
    outputs: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __str__(self) -> str:
        over = "a free run" if self.windows == 1 else f"{self.windows} segments"
        return f"{self.record.name}, nrmse {self.nrmse:.4g} over {over}"

    @cached_property
    def by_output(self) -> dict[str, RecordComparison]:
        """The comparison of each output by itself, by quantity, that which leads first."""
        if len(self.outputs) < 2:
            return {self.record.output or "": self}
        rows = {}
        for quantity, simulated in self.outputs.items():
            record = self.record.only(quantity)
            rows[quantity] = RecordComparison(
                record, simulated, record.y - simulated, self.edges, self.fitted, self.model
            )
        return rows

    @cached_property
    def missing_force(self) -> MissingForce:
        """The force that would have to be added, at every instant, for the model to follow the record.

        By fixed-interval smoothing over the model: seconds, of a million samples minutes. Under an imposed
        motion it is the residual. See `ctrl_df.identify.smoothing.missing_force.missing_force` for what it
        refuses.
        """
        if facts(self.record).imposed:
            return missing_of_imposed(self.model, self.record, self.residual)
        return missing_force(self.model, self.record)

    @property
    def rmse(self) -> float:
        """Rms of the residual [output unit], of the output that leads."""
        return rmse(self.residual)

    @property
    def nrmse(self) -> float:
        """Rms of the residual over that of the centred output; of several outputs the rms of theirs."""
        if len(self.by_output) > 1:
            return float(np.sqrt(np.mean([r.nrmse**2 for r in self.by_output.values()])))
        return nrmse(self.record.y, self.simulated)

    @property
    def fit_percent(self) -> float:
        """``100 (1 - nrmse)``."""
        return 100.0 * (1.0 - self.nrmse)

    @property
    def windows(self) -> int:
        """Number of segments; 1: a free run."""
        return len(self.edges) - 1

    @cached_property
    def white(self) -> Whiteness:
        """Test of the residual for whiteness; of several outputs that which passes least."""
        if len(self.by_output) > 1:
            return min((r.white for r in self.by_output.values()), key=lambda w: w.p_value)
        return whiteness(self.residual, band=self.record.band)

    @cached_property
    def input_test(self) -> InputTest | None:
        """Test of the residual for traces of the input; None for records too short."""
        if len(self.residual) < SPECTRUM_LEAST:
            return None
        return input_residual_test(self.record.u, self.residual, fitted=self.fitted)

    @cached_property
    def where(self) -> Regions:
        """Regions, those beyond chance first, then by how far their share of the error exceeds that expected.

        None for records under 50 samples.

        A position error remembers what went wrong before. As long as the residual is not white, its regions
        are therefore those of its second derivative, the error of acceleration, which stands where it arises.
        """
        if len(self.residual) < RECORD_SAMPLES:
            return Regions()
        known = facts(self.record)
        velocity = self.record.velocity if self.record.velocity is not None else known.velocity
        plain = known.imposed or self.white
        error, kept = (self.residual, slice(None)) if plain else self._acceleration_error()
        return error_regions(
            self.record.t[kept],
            error,
            position=known.place[kept],
            velocity=velocity[kept],
            force=known.load[kept],
            units=known.units,
        )

    @cached_property
    def stands_out(self) -> Regions:
        """What text, table and picture show: where the error is; where it is nowhere, what force is missing.

        A force over the position errs by as much everywhere: no region shows it, its curve does.
        """
        if self.where.significant or self.white:
            return self.where
        try:
            return self.missing_force.regions or self.where
        except (TypeError, ValueError, ArithmeticError):  # nobody knows where a force acts, or what it was
            return self.where

    def _acceleration_error(self) -> tuple[np.ndarray, slice]:
        """Return the error of the acceleration, low-passed, and the samples at which it holds.

        The second derivative of a residual in position, the first of one in velocity.

        Derivatives fail at the ends of a segment: a line bridges them inside; the record's ends are left out.
        """
        t, dt = self.record.t, facts(self.record).dt
        order = 2 - sensed(self.record).columns[0]
        parts = [self.residual[a:b] for a, b in zip(self.edges[:-1], self.edges[1:], strict=True)]
        # where a segment begins the residual jumps: that is in none of their spectra
        cutoff = float(np.median([automatic_cutoff(p - p.mean(), dt) for p in parts]))
        out, margin = np.empty(len(t)), int(SMOOTHED_ENDS / (cutoff * dt)) + 1
        for a, b in zip(self.edges[:-1], self.edges[1:], strict=True):
            out[a:b] = derivative(t[a:b], self.residual[a:b], order, cutoff)
        good = np.ones(len(t), bool)
        for edge in self.edges:
            good[max(edge - margin, 0) : edge + margin] = False
        if np.count_nonzero(good) < RECORD_SAMPLES:
            return self.residual, slice(None)
        out[~good] = np.interp(t[~good], t[good], out[good])
        first, last = np.flatnonzero(good)[[0, -1]]
        return out[first : last + 1], slice(int(first), int(last) + 1)


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(ComparisonBase):
    """Outcome of `compare`: the sum over all records, and each by itself in `records`.

    `simulated` and `residual` are arrays for one record, tuples of arrays for several; `white` and
    `where` are those of the record with the largest error.

    Examples
    --------
    >>> t = np.arange(0, 4, 0.01)
    >>> F = 9 * np.sin(3 * t) + 5 * np.sin(8 * t)
    >>> machine = cdf.friction_mass(2.2, 3.0, 6.0)
    >>> x = np.asarray(cdf.event_response(machine, t, F, input_hold="zoh").outputs)[0]
    >>> record = cdf.Measurement(t, F, x + 1e-4 * np.random.default_rng(1).standard_normal(t.size))
    >>> comparison = cdf.compare(machine, record)
    >>> round(comparison.fit_percent), bool(comparison.white)
    (100, True)
    """

    records: tuple[RecordComparison, ...]

    @property
    def rmse(self) -> float:
        """Rms of the residual over all samples [output unit]."""
        return math.sqrt(
            sum(float(r.residual @ r.residual) for r in self.records)
            / sum(len(r.residual) for r in self.records)
        )

    @property
    def nrmse(self) -> float:
        """Rms of the residual over that of the outputs, each centred; of several quantities the rms of it."""
        squares = []
        for quantity in self.worst.by_output:
            rows = [r.by_output[quantity] for r in self.records]
            error = sum(float(r.residual @ r.residual) for r in rows)
            squares.append(error / sum(float(np.sum((r.record.y - r.record.y.mean()) ** 2)) for r in rows))
        return math.sqrt(sum(squares) / len(squares)) if len(squares) > 1 else math.sqrt(squares[0])

    @property
    def white(self) -> Whiteness:
        """Whiteness of the worst record's residual: true if it passes, with its ``p_value``."""
        return self.worst.white

    @property
    def input_test(self) -> InputTest | None:
        """Whether the worst record's residual still depends on the input."""
        return self.worst.input_test

    @property
    def where(self) -> Regions:
        """Regions of the worst record; see `RecordComparison.where`."""
        return self.worst.where

    @property
    def stands_out(self) -> Regions:
        """What text, table and picture of the worst record show; see `RecordComparison.stands_out`."""
        return self.worst.stands_out

    @property
    def missing_force(self) -> MissingForce:
        """The force that would have to be added for the model to follow the worst record."""
        return self.worst.missing_force

    @cached_property
    def error_by_horizon(self) -> ErrorByHorizon:
        """Error of free prediction against its length, up to the whole record; seconds.

        `ErrorByHorizon.plot` draws it, several models in one picture.
        """
        return error_by_horizon(self.model, [r.record for r in self.records])

    @property
    def windows(self) -> int:
        """Number of segments of all records together."""
        return sum(r.windows for r in self.records)

    @property
    def mode(self) -> str:
        """``free`` or ``windows``."""
        return "windows" if any(r.windows > 1 for r in self.records) else "free"

    @property
    def over(self) -> str:
        """What the errors are over, in words."""
        return "a free run" if self.mode == "free" else f"{self.windows} segments"

    def report(self) -> str:
        """Return the comparison as text: each record, the tests, the regions."""
        lines = [str(self)]
        if len(self.records) > 1:
            lines += [
                f"  {r.record.name:<24} nrmse {r.nrmse:.4g}  rmse {r.rmse:.4g} {r.record.output_unit}"
                for r in self.records
            ]
        test = self.worst.input_test
        if test is not None:
            if not test:
                so = "The residual is correlated with the input: something is missing"
            elif self.white:
                so = "The residual is white, and not correlated with the input: nothing seems to be missing"
            else:
                so = "The residual is neither white nor a linear response to the input"
            lines.append(f"{so} (test of correlation: p{probability(test.p_value)}).")
        if self.stands_out:
            lines += ["", *self.places[:6], "", self.stands_out.table(8)]
        return "\n".join(lines)

    def __str__(self) -> str:
        """Return it as text."""
        worst = self.worst
        imposed = next((r.record for r in self.records if facts(r.record).imposed), None)
        how = "free run from fitted initial states"
        if imposed is not None:
            how = moving_in(imposed.input_unit).text(f"in force, {imposed_motion(imposed)}")
        elif self.mode == "windows":
            lengths = [float(np.ptp(r.record.t)) / r.windows for r in self.records]
            how = (
                f"{self.windows} segments of {np.mean(lengths):.3g} s, each from a fitted initial state "
                "(nothing holds this model in place: over a free run it would drift)"
            )
        if worst.record.note:
            how = f"{worst.record.note}; {how}"
        count = f"{len(self.records)} records" if len(self.records) > 1 else f"record {worst.record.name!r}"
        return (
            f"{count}: nrmse {self.nrmse:.4g}, fit {self.fit_percent:.2f} %, rmse {self._sizes()}, "
            f"residual {'white' if self.white else 'not white'} "
            f"(p{probability(self.white.p_value)}); {how}."
        )

    def _sizes(self) -> str:
        """Return the rms of the residual of each output, with its unit."""
        sizes = []
        for quantity, worst in self.worst.by_output.items():
            rows = [r.by_output[quantity].residual for r in self.records]
            size = math.sqrt(sum(float(e @ e) for e in rows) / sum(map(len, rows)))
            sizes.append(f"{size:.4g} {worst.record.output_unit}")
        return " and ".join(sizes)

    def plot(self, record=None, output=None, **keywords):
        """Draw outputs, residual, and where the error lies; returns a ct.ControlPlot.

        Parameters
        ----------
        record : int or None
            Which record; None: the worst.
        output : str or None
            Which of several outputs, by quantity; None: the one that leads.
        """
        return draw("comparison", self, record=record, output=output, **keywords)
