"""What comparisons over time and over the (A, omega) plane have in common: several records, one answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ...table import Brief
from ..thresholds import UNMOVED


@dataclass(frozen=True, eq=False, repr=False)
class ComparisonBase(Brief):
    """A model beside records, each by itself in `records`.

    `simulated` and `residual` are arrays for one record, tuples of arrays for several.
    """

    model: Any
    records: tuple

    def _each(self, name):
        values = tuple(getattr(r, name) for r in self.records)
        return values[0] if len(values) == 1 else values

    @property
    def simulated(self):
        """Output of the model where there are measured values."""
        return self._each("simulated")

    @property
    def residual(self):
        """Measured minus simulated."""
        return self._each("residual")

    @property
    def nrmse(self) -> float:
        """Relative error of all records together."""
        raise NotImplementedError

    @property
    def where(self) -> Any:
        """Regions, those beyond chance first, then by their share of the error beyond that expected."""
        raise NotImplementedError

    @property
    def stands_out(self) -> Any:
        """Regions that text, table and picture show."""
        return self.where

    @property
    def places(self) -> tuple[str, ...]:
        """Where the error is, in sentences; of a model that misses the motion itself, that it does."""
        where, error = self.stands_out, self.worst.nrmse
        if not where.significant and error > UNMOVED:
            return (
                f"The model does not follow the motion at all: its error is {error:.0%} of the measured "
                "motion, "
                "in no region more than in others.",
            )
        return where.sentences

    def report(self) -> str:
        """Return the comparison as text."""
        raise NotImplementedError

    def plot(self, record=None, **keywords) -> Any:
        """Draw the comparison; returns a ``ct.ControlPlot``."""
        raise NotImplementedError

    @property
    def fit_percent(self) -> float:
        """MATLAB's fit, ``100 (1 - nrmse)``."""
        return 100 * (1 - self.nrmse)

    @property
    def worst(self):
        """The record with the largest nrmse."""
        return max(self.records, key=lambda r: r.nrmse)
