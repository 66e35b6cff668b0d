"""Refit a model to what was measured, and say how well each parameter is known."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from ..simulate.parallel import one_thread_each
from .arguments import (
    check_fit,
    check_quantities,
    known_beforehand,
    own_parameters,
    parametric,
    with_those,
)
from .datasets.choice import dataset_of
from .prediction.values import in_record, with_block
from .results.fit import Fit, FittedParameter
from .thresholds import REFIT_BUDGET

__all__ = ["Fit", "FittedParameter", "refit"]


def refit(
    model,
    data,
    free=None,
    *,
    own=None,
    prior=None,
    start: Mapping[str, float] | None = None,
    mode: str = "auto",
    window: float | None = None,
    robust: bool = True,
    budget: int = REFIT_BUDGET,
) -> Fit:
    """Adjust parameters until the simulated output fits the records best.

    The sum of squared differences of measured and simulated output is minimized; each segment starts
    from initial states that are fitted, too (multiple shooting), first over short segments, then over
    those `mode` asks for. A loop of `ctrl_df.closed_loop` whose records hold the reference in a channel is
    fitted through its block, driven by the recorded force.

    Parameters
    ----------
    model : block or loop
        Its parameters are the start values; 30 % off will do.
    data : Measurement, FrequencyMeasurement or sequence of them
        Records, or tables, that share the parameters; records of one name are numbered.
    free : sequence of str or None
        Parameters to move, by name or by effect id; None: every parameter that is meant to be fitted
        (``parameter.free``).
    own : sequence of str or None
        Parameters that differ between records (an offset, friction at another temperature), by name or by
        effect id; they are fitted even where `free` does not name them. Those declared so
        (``parameter.per_record``: a ripple's phase), and those the model has from such a fit, always do.
    prior : mapping or None
        What is known of parameters from elsewhere: value and standard deviation by name, each in its unit,
        ``{"mass": (2.0, 0.05)}``. The others are taken to be known within a factor of three (one standard
        deviation) of the model's own values, which weighs no more than one sample.
    start : mapping or None
        Start values other than the model's; the short segments are then left out.
    mode, window
        As for `ctrl_df.compare`; where disturbance forces (friction that drifts) outweigh the noise of
        the sensor, "auto" fits over segments of some ten samples, in which slow forces move nothing far, and
        compares over the usual ones.
    robust : bool
        Whether outliers beyond four median deviations count linearly only; points of tables count in full.
    budget : int
        Bound on the simulations of all records, in each of up to three ways to the minimum; fits over short
        segments that lead there are bounded by themselves.

    Returns
    -------
    Fit

    Raises
    ------
    ValueError
        An unknown parameter name, a record that cannot be simulated, `own` with tables.
    TypeError
        A model that is no block, unknown keywords.

    References
    ----------
    Bock (1983), multiple shooting; Golub & Pereyra (1973), variable projection; Ljung (1999), sec. 9.4.

    Examples
    --------
    >>> t = np.arange(0, 4, 0.01)
    >>> F = 9 * np.sin(3 * t) + 5 * np.sin(8 * t)
    >>> machine = cdf.friction_mass(2.2, 3.0, 6.0)
    >>> x = np.asarray(cdf.event_response(machine, t, F, input_hold="zoh").outputs)[0]
    >>> record = cdf.Measurement(t, F, x + 1e-4 * np.random.default_rng(1).standard_normal(t.size))
    >>> fit = cdf.refit(cdf.friction_mass(2.0, 2.5, 5.0), record)
    >>> {name: round(p.value, 1) for name, p in fit.parameters.items()}
    {'mass': 2.2, 'coulomb.level': 3.0, 'viscous.coefficient': 6.0}
    """
    dataset = dataset_of(model, data)
    check_quantities(model, dataset.records)
    dataset.check_segments(mode, window)
    block: Any = parametric(dataset.block_of(model))
    own = own_parameters(block, own)
    names = with_those(dataset.free_parameters(block, free), own)
    check_fit(block, start, robust, budget)
    dataset.warn_of_doubts(model, names)
    dataset = dataset.with_prior(known_beforehand(block, names, prior, grows=False))
    with one_thread_each():
        found = dataset.fit(
            dataset.with_own(model, own),
            names,
            start,
            whole=free is None,
            mode=mode,
            window=window,
            robust=robust,
            budget=budget,
        )
    table = found.block.parameters
    before = {k: p.value for k, p in block.parameters.items()} | dict(start or {})
    parameters = {
        k: FittedParameter(
            k, table[k].value, found.errors[k], table[k].unit, float(before[k]), at_bound,
            k not in found.undetermined,
        )
        for k, at_bound in zip(names, found.at_bound, strict=True) if k not in found.own
    }  # fmt: skip
    by_record = {
        k: MappingProxyType({
            record: FittedParameter(
                k, v.value, v.standard_error, table[k].unit, in_record(before[k], record), v.at_bound,
                v.determined,
            )
            for record, v in values.items()
        })
        for k, values in found.own.items()
    }  # fmt: skip
    shared = [i for i, k in enumerate(names) if k in parameters]
    return Fit(
        with_block(model, found.block), MappingProxyType(parameters), found.comparison,
        found.covariance[np.ix_(shared, shared)], found.doubts, found.converged, found.simulations,
        MappingProxyType(by_record),
    )  # fmt: skip
