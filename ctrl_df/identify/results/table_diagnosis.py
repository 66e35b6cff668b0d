"""What a diagnosis of tables N(A, omega) answers besides."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from ...drawing import draw
from .diagnosis import Diagnosis, require_known


@dataclass(frozen=True, eq=False, repr=False)
class FrequencyDiagnosis(Diagnosis):
    """A `Diagnosis` from tables; `noise` and `structure` are relative to ``|N|``.

    Attributes
    ----------
    before, after : FrequencyComparison
        The refitted model, and that with the first of the ranking, beside all tables.
    """

    before: Any = None
    after: Any = None

    screened: ClassVar[str] = "fitted to some of the points alone"

    def plot(self, **keywords):
        """Draw the ranking and the error on the plane before and after; returns a ``ct.ControlPlot``."""
        require_known(self.nrmse)
        return draw("table diagnosis", self, **keywords)
