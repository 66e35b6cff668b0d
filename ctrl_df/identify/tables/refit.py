"""Refit a block to measured tables N(A, omega)."""

from __future__ import annotations

from types import MappingProxyType
from typing import Any

import numpy as np

from ..arguments import check_fit, free_parameters
from ..data.records import as_tables
from .compare import comparison_of_tables, inner_block
from .fit import FittedTable, fit_table, points_of, table_scales


def refit_frequency(model, data, free=None, *, start=None, budget=600, **keywords):
    """Adjust parameters until the describing function fits the tables best.

    Parameters
    ----------
    model : block, or loop of `ctrl_df.closed_loop`
        Its parameters are the start values.
    data : FrequencyMeasurement or sequence of them
    free : sequence of str or None
        Parameters to move, by name or by effect id; None: all that are meant to be fitted.
    start : mapping or None
        Start values other than the model's.
    budget : int
        Bound on the tables computed.

    Returns
    -------
    Fit
    """
    from ..refit import Fit, FittedParameter

    if keywords:
        raise TypeError(f"unrecognized keyword(s): {', '.join(keywords)}")
    records, block = as_tables(data), inner_block(model)
    if not hasattr(block, "with_parameters") or not hasattr(block, "parameters"):
        raise TypeError(
            f"refit needs a block with named parameters (ctrl_df.Mass, TwoMass, ...); got "
            f"{type(block).__name__}. Build it from ctrl_df.Mass and effects."
        )
    names = free_parameters(block, free)
    check_fit(block, start, True, budget)
    begun = block.with_parameters(dict(start)) if start else block
    points = points_of(records)
    found = fit_table(
        begun, points, names, table_scales(begun, points), iterations=40, tolerance=1e-6, budget=budget
    )
    covariance, errors, doubtful = uncertainty(found)
    table = found.block.parameters
    parameters = {
        k: FittedParameter(
            k, table[k].value, errors[k], table[k].unit, begun.parameters[k].value,
            table[k].value in (v.lower, v.upper), k not in doubtful,
        )
        for k, v in zip(names, found.variables, strict=True)
    }  # fmt: skip
    comparison: Any = comparison_of_tables(found.block, records)  # of its own kind
    return Fit(
        _as_given(model, found.block), MappingProxyType(parameters), comparison,
        covariance, tuple(doubtful.values()), found.converged, found.evaluations,
    )  # fmt: skip


def uncertainty(found: FittedTable) -> tuple[np.ndarray, dict[str, float], dict[str, str]]:
    """Return covariance, standard errors, and a sentence for every parameter the table does not determine."""
    names, j = found.names, found.jacobian
    if not names:
        return np.zeros((0, 0)), {}, {}
    doubtful: dict[str, str] = {}
    values = np.array([v.p(q) for v, q in zip(found.variables, found.q, strict=True)])
    slope = np.array([v.slope(q) for v, q in zip(found.variables, found.q, strict=True)])
    size = np.linalg.norm(j, axis=0)
    for k, s in zip(names, size, strict=True):
        if s < 1e-6 * max(float(size.max()), 1e-300):
            doubtful[k] = f"{k} leaves no trace in these data: its value is the start value."
    live = [i for i, k in enumerate(names) if k not in doubtful]
    residual = float(found.weighted @ found.weighted) / max(len(found.weighted) - len(live), 1)
    covariance = np.full((len(names), len(names)), np.inf)
    if live:
        _, s, vt = np.linalg.svd(j[:, live] / size[live], full_matrices=False)
        for direction in vt[s < 1e-5 * s[0]]:
            alike = [names[live[i]] for i in np.flatnonzero(np.abs(direction) > 0.1)]
            for k in alike:
                doubtful[k] = f"{' and '.join(alike)} cannot be told apart on these data. Fix one of them."
        inverse = (vt.T / np.maximum(s, 1e-8 * s[0]) ** 2) @ vt
        unit = slope[live] / size[live]
        covariance[np.ix_(live, live)] = residual * inverse * np.outer(unit, unit)
    errors = dict(zip(names, np.sqrt(np.diag(covariance)).tolist(), strict=True))
    for k, value in zip(names, values, strict=True):
        if k not in doubtful and errors[k] > abs(value) > 0:
            doubtful[k] = f"{k} is less certain than it is large: these data do not determine it."
    return covariance, errors, doubtful


def _as_given(model, fitted):
    if getattr(model, "parts", None) is None:
        return fitted
    from ...simulate.loop import closed_loop

    return closed_loop(model.parts.controller, fitted, model.parts.dt)
