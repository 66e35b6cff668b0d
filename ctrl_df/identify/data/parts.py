"""A run that has breaks, as several records: pauses, dropped samples, an encoder that was reset."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ...checks import is_number, warn
from . import quantities
from .checks import at_rest, holes, jumps, seconds
from .thresholds import MINIMUM


def in_parts(kind: Callable, t, u, y, keywords: dict[str, Any]) -> tuple:
    """Return the parts of a run as records; see `Measurement.in_parts`."""
    name, n = keywords.pop("name", "measurement"), np.size(t)
    owner = f"Measurement {name!r}"
    t = seconds(t)
    given = dict(t=t, u=u, y=y) | {k: keywords.pop(k, None) for k in ("outputs", "velocity", "channels")}
    every: dict[str, Any] = {}
    for key, value in given.items():
        several = (
            value.items() if isinstance(value, Mapping) else [(None, value)] if value is not None else []
        )
        every |= {
            (key if inner is None else f"{key} {inner}"): quantities.with_unit(v)[0] for inner, v in several
        }
    for key, values in every.items():
        if np.shape(values) != (n,):
            raise ValueError(
                f"{owner} needs 1-D arrays of equal length; t has {n} samples and {key} the shape "
                f"{np.shape(values)}. Where a sample is missing put NaN."
            )
    there = np.logical_and.reduce([_present(values) for values in every.values()])
    places = [_numbers(values, there) for values in _places(y, given["outputs"], keywords)]
    outputs = [_numbers(v, there) for k, v in every.items() if k == "y" or k.startswith("outputs ")]
    times, driving = _numbers(t, there), _numbers(u, there)
    of_input = quantities.stated("input", keywords.get("input"), keywords.get("input_unit"), "N")[0]
    imposed = of_input == "position" and not places

    def informative(span) -> bool:
        if span.stop - span.start < MINIMUM or any(np.ptp(y[span]) == 0 for y in outputs):
            return False
        return not at_rest(times[span], driving[span], [y[span] for y in outputs], imposed)

    found = [
        kind(**keywords, **{k: _sliced(v, span) for k, v in given.items()}, name=name)
        for span in _spans(times, there, places)
        if informative(span)
    ]
    left_out = n - sum(map(len, found))
    if not found:
        raise ValueError(
            f"{owner} needs a part without a break of {MINIMUM} samples or more, its output not constant "
            f"(nor noise under a constant input); got none in {n} samples. Interpolate where that is "
            "honest, or record again."
        )
    if left_out:
        warn(
            f"{owner}: {left_out} of {n} samples are left out: missing, or in parts that are too short or "
            "at rest",
            UserWarning,
        )
    numbered = (f"{name} [{i}]" for i in range(1, len(found) + 1))
    return tuple(part.replaced(name=k) for part, k in zip(found, numbered, strict=True))


def _places(y, outputs, keywords):
    """Yield the outputs that are positions."""
    if y is not None:
        stated = quantities.stated("output", keywords.get("output"), keywords.get("output_unit"), "m")
        if stated[0] == "position":
            yield y
    for word, channel in (outputs or {}).items():
        values, unit = quantities.with_unit(channel)
        if quantities.stated("output", word, unit, "")[0] == "position":
            yield values


def _sliced(value, span: slice):
    """Return a part of a channel, of one with its unit, or of several by name."""
    if value is None:
        return None
    if isinstance(value, Mapping):
        return {k: _sliced(v, span) for k, v in value.items()}
    values, unit = quantities.with_unit(value)
    part = np.asarray(np.ma.getdata(values)[span])
    part = part.astype(float) if part.dtype.kind == "O" else part
    return part if unit is None else (part, unit)


def _present(values) -> np.ndarray:
    """Return which samples of a channel are there: not masked, finite numbers."""
    plain = np.ma.getdata(values)
    if plain.dtype.kind not in "fiubO":
        raise TypeError(f"Measurement needs numbers, NaN where one is missing; got dtype {plain.dtype}.")
    finite = (
        [is_number(v) and bool(np.isfinite(v)) for v in plain]
        if plain.dtype.kind == "O"
        else np.isfinite(plain)
    )
    return np.logical_and(finite, ~np.ma.getmaskarray(values))


def _numbers(values, there) -> np.ndarray:
    """Return a channel as numbers, zero where a sample is missing."""
    found = np.zeros(len(there))
    found[there] = np.ma.getdata(values)[there].astype(float)
    return found


def _spans(t, there, places) -> list[slice]:
    """Return the spans of samples without a break."""
    whole = _cut(np.flatnonzero(there), lambda i: np.diff(i) > 1)
    runs = [r for span in whole for r in _cut(span, lambda i: np.diff(t[i]) < 0)]
    regular = [r for run in runs for r in _cut(run, lambda i: _after(holes(t[i]), i))]

    def jump(i):
        return np.logical_or.reduce([_after(jumps(t[i], x[i]), i) for x in places] or [False])

    parts = [r for run in regular for r in _cut(run, jump)]
    return [slice(int(i[0]), int(i[-1]) + 1) for i in parts]


def _cut(samples: np.ndarray, breaks: Callable) -> list[np.ndarray]:
    """Return the parts of samples, cut after those where `breaks` says so; short ones are as they are."""
    if len(samples) < MINIMUM:
        return [samples] if len(samples) else []
    return np.split(samples, 1 + np.flatnonzero(breaks(samples)))


def _after(found, samples) -> np.ndarray:
    """Return indices as truth values of all but the last sample."""
    said = np.zeros(len(samples) - 1, bool)
    said[found] = True
    return said
