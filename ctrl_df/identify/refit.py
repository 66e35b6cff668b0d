"""Refit a model to records by simulation-error least squares, and say how well each parameter is known."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from ..blocks.mechanism import Mechanism
from ..checks import unknown_keywords
from .arguments import check_fit, check_window, free_parameters
from .compare import Comparison, comparison_of
from .data.records import as_records, has_tables
from .estimation.candidate import Candidate, fit_candidate, fit_windows
from .estimation.multistart import hopped, rough
from .estimation.prepared import REFERENCE
from .estimation.simulator import Simulator
from .estimation.trial import brief_window
from .estimation.variables import default_free, step_of_sensor

__all__ = ["Candidate", "Fit", "FittedParameter", "default_free", "fit_candidate", "refit"]


@dataclass(frozen=True)
class FittedParameter:
    """One parameter after a refit.

    Attributes
    ----------
    name, unit : str
        As in ``block.parameters``.
    value, standard_error : float
        SI; the error allows for the colour of the residual.
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


@dataclass(frozen=True, eq=False)
class Fit:
    """Outcome of `refit`.

    Attributes
    ----------
    model : block or loop
        The model given, with the parameters found.
    parameters : mapping of str to FittedParameter
        Those that were free.
    comparison : Comparison
        The refitted model beside the records.
    covariance : (p, p) array
        Of the free parameters, in their order.
    unidentifiable : tuple of str
        A sentence for every direction the data do not determine; empty if all is well.
    converged : bool
        False: stopped at the bound on work.
    simulations : int
        How many were run.
    """

    model: Any
    parameters: Mapping[str, FittedParameter]
    comparison: Comparison
    covariance: np.ndarray
    unidentifiable: tuple[str, ...]
    converged: bool
    simulations: int

    @property
    def nrmse(self) -> float:
        """Residual over the centred output, both rms."""
        return self.comparison.nrmse

    def report(self) -> str:
        """Return parameters, doubts and the comparison as text."""
        lines = [str(p) for p in self.parameters.values()]
        lines += ["", *self.unidentifiable] if self.unidentifiable else []
        if not self.converged:
            lines += ["", "Stopped at the bound on work: the fit may still improve (raise budget)."]
        return "\n".join([*lines, "", self.comparison.report()])

    def __str__(self) -> str:
        """Return it as text."""
        return self.report()


def refit(
    model,
    data,
    free=None,
    *,
    start: Mapping[str, float] | None = None,
    mode: str = "auto",
    window: float | None = None,
    robust: bool = True,
    budget: int = 600,
    **keywords,
) -> Fit:
    """Adjust parameters until the simulated output fits the records best.

    The sum of squared differences of measured and simulated output is minimized; the model starts anew in
    each window, from states that are fitted along (multiple shooting), first over short windows, then over
    those `mode` asks for. A loop of `ctrl_df.closed_loop` whose records hold the reference in a channel is
    fitted through its block, driven by the recorded force.

    Parameters
    ----------
    model : block or loop
        Its parameters are the start values; 30 % off will do.
    data : Measurement or sequence of them
        Records that share the parameters.
    free : sequence of str or None
        Parameters to move, by name or by effect id; None: every parameter that is meant to be fitted
        (``parameter.free``).
    start : mapping or None
        Start values other than the model's; the short windows are then left out.
    mode, window
        As for `ctrl_df.compare`; where forces that no model has (friction that wanders) outweigh the noise of
        the sensor, "auto" fits over windows of some ten samples, in which slow forces move nothing far, and
        compares over the usual ones.
    robust : bool
        Whether outliers beyond four median deviations count linearly only.
    budget : int
        Bound on the simulations of all records.

    Returns
    -------
    Fit

    Raises
    ------
    ValueError
        An unknown parameter name, a record that cannot be simulated.
    TypeError
        A model that is no block, unknown keywords.

    References
    ----------
    Bock (1983), multiple shooting; Golub & Pereyra (1973), variable projection; Ljung (1999), sec. 9.4.
    """
    unknown_keywords(keywords)
    if has_tables(data):
        from .tables.refit import refit_frequency

        return refit_frequency(model, data, free, start=start, budget=budget)
    records = as_records(data)
    check_window(records, mode, window)
    fitted = _fitted_model(model, records)
    block = Simulator(fitted, records[0]).block
    if not hasattr(block, "with_parameters") or not hasattr(block, "parameters"):
        raise TypeError(
            f"refit needs a block with named parameters (ctrl_df.Mass, TwoMass, ...); got "
            f"{type(block).__name__}. Build it from ctrl_df.Mass and effects."
        )
    names = free_parameters(block, free)
    check_fit(block, start, robust, budget)
    start_values = {**{k: block.parameters[k].value for k in names}, **dict(start or {})}
    settings: dict[str, Any] = dict(
        budget=budget, mode=mode, window=window, robust=robust, tolerance=1e-4, central=True, polish=6
    )
    found = fit_candidate(fitted, records, start, names, coarse=start is None, iterations=40, **settings)
    shown = None
    if mode == "auto" and window is None and names and isinstance(fitted, Mechanism):
        brief = brief_window(found.model, records)
        if brief is not None:
            shown = settings | {"coarse": False, "starts": found.starts}
            settings["window"] = brief
            # from the start again: longer windows may have left the right valley (of a ripple, say)
            found = fit_candidate(fitted, records, start, names, coarse=False, iterations=40, **settings)
    if rough(found):
        better = hopped(found, _Beside(records, found.windows), rough(found))
        if better is not found:
            found = fit_candidate(
                better.model, records, None, names, coarse=False, starts=better.starts, **settings
            )
    found = _with_steps(found, records, block, free)
    # a model that errs over brief windows of its own fit would look better than it is
    seen = found if shown is None else fit_candidate(found.model, records, None, (), **shown)
    comparison = comparison_of(found.model, records, seen.windows, seen.starts, fitted=len(names))
    blurred = _blurred(found)
    table = Simulator(found.model, records[0]).block.parameters
    errors = found.standard_errors
    parameters = {
        k: FittedParameter(
            k, table[k].value, errors[k], table[k].unit, float(start_values[k]), bound, k not in blurred
        )
        for k, bound in zip(found.names, found.at_bound, strict=True)
    }
    return Fit(
        _as_given(model, found.model), MappingProxyType(parameters), comparison, found.covariance,
        _sentences(found), found.converged, found.nfev,
    )  # fmt: skip


class _Beside:
    """Fits over the windows of a refit, at the full rate."""

    def __init__(self, records, windows):
        self.records, self.windows = records, windows

    def __call__(self, model, names, *, starts, iterations, hopeless) -> Candidate:
        return fit_windows(
            model, self.records, self.windows, names, thin=1, starts=starts, iterations=iterations,
            hopeless=hopeless,
        )  # fmt: skip


def _fitted_model(model, records):
    """Return the block of a loop where the recorded force can drive it; otherwise the model."""
    if getattr(model, "parts", None) is None:
        return model
    has_reference = all(any(k in (r.channels or {}) for k in REFERENCE) for r in records)
    return model.parts.block if has_reference else model


def _as_given(model, fitted):
    if getattr(model, "parts", None) is not None and getattr(fitted, "parts", None) is None:
        from ..simulate.loop import closed_loop

        return closed_loop(model.parts.controller, fitted, model.parts.dt)
    return fitted


def _with_steps(found: Candidate, records, block, free) -> Candidate:
    """Take the step of a rounding sensor from the records themselves: least squares cannot see it."""
    from .data.derivatives import step_of

    key = step_of_sensor(block)
    if key is None or (free is not None and key not in free_parameters(block, free)):
        return found
    steps = [step_of(r.y) for r in records]
    if min(steps) > 0:
        found.model = Simulator(found.model, records[0]).with_values({key: float(np.median(steps))})
    return found


def _blurred(found: Candidate) -> set[str]:
    """Parameters the data do not determine: in a null direction, or uncertain by more than themselves."""
    names = set()
    for _, direction in found.null:
        names |= {k for k, d in zip(found.names, direction, strict=True) if abs(d) > 0.1}
    errors = np.sqrt(np.maximum(np.diag(found.covariance), 0)) if len(found.names) else np.zeros(0)
    for k, value, error, scale in zip(found.names, found.values, errors, found.scale, strict=True):
        if not math.isfinite(error) or error > max(abs(value), scale):
            names.add(k)
    return names


def _sentences(found: Candidate) -> tuple[str, ...]:
    lines, named = [], set()
    for _, direction in found.null:
        parts = [(k, d) for k, d in zip(found.names, direction, strict=True) if abs(d) > 0.1]
        parts.sort(key=lambda p: -abs(p[1]))
        named |= {k for k, _ in parts}
        if len(parts) == 1:
            lines.append(f"{parts[0][0]} leaves no trace in these data: its value is the start value.")
            continue
        signs = [p[1] * parts[0][1] > 0 for p in parts]
        up = ", ".join(k for (k, _), s in zip(parts, signs, strict=True) if s)
        down = ", ".join(k for (k, _), s in zip(parts, signs, strict=True) if not s)
        change = (
            f"raising {up}"
            + (f" while lowering {down}" if down else "")
            + (" together" if len(parts) > 1 else "")
        )
        lines.append(
            f"{' and '.join(k for k, _ in parts)} cannot be told apart on these data: {change} leaves the "
            "output as it is. Fix one of them, or excite the drive otherwise."
        )
    for k in sorted(_blurred(found) - named, key=found.names.index):
        lines.append(f"{k} is less certain than it is large: these data do not determine it.")
    return tuple(lines)
