"""What a refit answers: the parameters, how well they are known, and what the data do not determine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...checks import known_name
from ...numerals import digits, listed
from ...values.record_name import RecordName, among
from ..prediction.values import block_of, for_record
from ..residuals.comparison_base import ComparisonBase
from .thresholds import CORRELATED


@dataclass(frozen=True)
class FittedParameter:
    """One parameter after a refit.

    Attributes
    ----------
    name, unit : str
        As in ``block.parameters``.
    value, standard_error : float
        SI; the error allows for the noise spectrum that the residual shows: two of them hold the truth
        for 95 % of records.
    start : float
        Value before.
    at_bound : bool
        Whether it stands at a bound of its range (its error then means little).
    identifiable : bool
        Whether these data determine it.
    """

    name: str
    value: float
    standard_error: float
    unit: str
    start: float
    at_bound: bool
    identifiable: bool

    def __float__(self) -> float:
        """Return the value."""
        return self.value

    def __str__(self) -> str:
        """Return it as text."""
        marks = ("  at its bound" if self.at_bound else "") + (
            "" if self.identifiable else "  not determined by these data"
        )
        return f"{self.name:<28} {self.value:>12.6g} ± {self.standard_error:<9.2g} {self.unit:<10}{marks}"


@dataclass(frozen=True, eq=False, repr=False)
class Fit:
    """Outcome of `refit`.

    Attributes
    ----------
    model : block or loop
        The model given, with the parameters found. Of those that differ between records it shows the mean (of
        angles the mean direction), each value weighted by one over its variance. It recognizes the records by
        their names where these are unique, otherwise by their data: `compare` takes each record's own values,
        and for any other record the mean, with a warning. See `model_of`.
    parameters : mapping of str to FittedParameter
        Those that were free and that all records share.
    comparison : ComparisonBase
        The refitted model beside the records.
    covariance : (p, p) array
        Of the free parameters, in their order; positive semidefinite. For those that the data do not
        determine the variance is infinite and the covariances are zero.
    unidentifiable : tuple of str
        A sentence for every direction the data do not determine; empty if all is well.
    converged : bool
        False: stopped at the bound on work.
    simulations : int
        How many were run.
    own : mapping of str to mapping of str to FittedParameter
        Those that differ between several records: by name, then by name of the record.

    Examples
    --------
    >>> t = np.arange(0, 4, 0.01)
    >>> F = 9 * np.sin(3 * t) + 5 * np.sin(8 * t)
    >>> machine = cdf.friction_mass(2.2, 3.0, 6.0)
    >>> x = np.asarray(cdf.event_response(machine, t, F, input_hold="zoh").outputs)[0]
    >>> record = cdf.Measurement(t, F, x + 1e-4 * np.random.default_rng(1).standard_normal(t.size))
    >>> fit = cdf.refit(cdf.friction_mass(2.0, 2.5, 5.0), record)
    >>> fit.parameters["mass"].unit, bool(fit.comparison.white)
    ('kg', True)
    """

    model: Any
    parameters: Mapping[str, FittedParameter]
    comparison: ComparisonBase
    covariance: np.ndarray
    unidentifiable: tuple[str, ...]
    converged: bool
    simulations: int
    own: Mapping[str, Mapping[str, FittedParameter]] = field(default_factory=dict)

    def model_of(self, record) -> Any:
        """Return the model with the values that it has in one record of this fit, or in that of a name.

        A record is known by its name where that was given to it alone, or by its data.

        Raises
        ------
        ValueError, TypeError
            A record, or a name, that is none of this fit.
        """
        known = [r.record.name for r in self.comparison.records]
        asked = getattr(record, "name", record)
        name = among(asked, known) if isinstance(asked, str) else None
        if name is None and isinstance(asked, RecordName):
            same = [k for k in known if getattr(k, "run", "") == asked.run]
            name = same[0] if len(same) == 1 else None
            if name is None and asked in known:
                raise ValueError(
                    f"model_of needs a record of this fit; got {asked!r}, which is not the one of that name "
                    "(a generated name, as it had none). Give every record a name, or pass the one fitted."
                )
        return for_record(
            self.model, known_name("model_of", "record", asked, known) if name is None else name
        )

    @property
    def nrmse(self) -> float:
        """Residual over the centred output, both rms."""
        return self.comparison.nrmse

    @property
    def correlation(self) -> np.ndarray:
        """Correlations of the free parameters, (p, p), in their order; NaN where an error is not known."""
        errors = np.sqrt(np.diag(self.covariance))
        errors = np.where(np.isfinite(errors) & (errors > 0), errors, np.nan)
        return np.clip(self.covariance / np.outer(errors, errors), -1.0, 1.0)

    def correlated(self, beyond: float = CORRELATED) -> list[tuple[str, str, float]]:
        """Return pairs of strongly correlated parameters, the strongest correlation first."""
        names, table = list(self.parameters), self.correlation
        pairs = [(a, b, float(table[i, j])) for i, a in enumerate(names) for j, b in enumerate(names[:i])]
        return sorted((p for p in pairs if abs(p[2]) > beyond), key=lambda p: -abs(p[2]))

    def report(self) -> str:
        """Return parameters, correlations, doubts and the comparison as text."""
        lines = [str(p) for p in self.parameters.values()]
        for name, values in self.own.items():
            lines += [
                f"{name}, of each record:",
                *(str(replace(p, name=f"  {r}")) for r, p in values.items()),
            ]
        table = block_of(self.model).parameters
        fixed = [k for k, p in table.items() if k not in self.parameters and k not in self.own and p.value]
        if fixed:
            values = listed([f"{k} {digits(table[k].value, 6)} {table[k].unit}".rstrip() for k in fixed])
            lines.append(f"Held as the model states: {values} (`free` names what is fitted).")
        lines += [f"{a} and {b} are correlated: {r:+.3f}" for a, b, r in self.correlated()]
        lines += ["", *self.unidentifiable] if self.unidentifiable else []
        if not self.converged:
            lines += ["", "Stopped at the bound on work: the fit may still improve (raise budget)."]
        return "\n".join([*lines, "", self.comparison.report()])

    def __str__(self) -> str:
        """Return it as text."""
        return self.report()

    def __repr__(self) -> str:
        values = ", ".join(f"{k} {digits(p.value, 4)} {p.unit}".rstrip() for k, p in self.parameters.items())
        return f"<Fit: {values}>"
