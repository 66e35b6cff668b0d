"""Data as they are handed in: one or several records over time, or one or several tables over (A, omega)."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterable, Sequence

from ...values.record_name import RecordName, digest
from .frequency_measurement import FrequencyMeasurement
from .measurement import Measurement


def has_tables(data) -> bool:
    """Whether the data are, or contain, tables over frequency."""
    if isinstance(data, FrequencyMeasurement):
        return True
    return isinstance(data, Sequence) and any(isinstance(r, FrequencyMeasurement) for r in data)


def as_tables(data, name: str = "data") -> tuple[FrequencyMeasurement, ...]:
    """Return tables as a tuple; TypeError for anything else, records over time among them included."""
    records = tuple(data) if isinstance(data, Iterable) else (data,)
    bad = [r for r in records if not isinstance(r, FrequencyMeasurement)]
    if bad or not records:
        got = f"also {type(bad[0]).__name__}" if bad else "an empty sequence"
        raise TypeError(
            f"{name} must hold frequency tables only (FrequencyMeasurement), or records over time only; got "
            f"{got}. "
            "Study them in two calls, the second with the model of the first."
        )
    return records


def as_records(data, name: str = "data") -> tuple[Measurement, ...]:
    """Return records over time as a tuple; TypeError for anything else."""
    records = tuple(data) if isinstance(data, Iterable) else (data,)
    bad = [r for r in records if not isinstance(r, Measurement)]
    if bad or not records:
        got = type(bad[0]).__name__ if bad else "an empty sequence"
        raise TypeError(
            f"{name} must be a Measurement or several; got {got}. The model comes first, then its data; wrap "
            "arrays: ctrl_df.Measurement(t, u, y)."
        )
    return records


def distinguished(records: tuple) -> tuple:
    """Return records with names of their own: those of one name are numbered, by numbers no other name has.

    A number is made up: the run then tells which record it is (`RecordName`), and of parts of one run their
    own data.
    """
    counts, runs = Counter(r.name for r in records), Counter(_run(r) for r in records)
    taken, named = set(counts), []
    for record in records:
        name = record.name
        if counts[name] > 1:
            numbered = next(k for i in itertools.count(1) if (k := f"{name} {i}") not in taken)
            taken.add(numbered)
            run = _run(record) if runs[_run(record)] == 1 else _digest(record)
            record = record.replaced(name=RecordName(numbered, run, given=False))
        named.append(record)
    return tuple(named)


def _run(record) -> str:
    return getattr(record.name, "run", "") or _digest(record)


def _digest(record) -> str:
    return digest((record.t, record.u, *record.outputs.values()))
