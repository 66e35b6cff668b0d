"""Which kind of data is handed in."""

from __future__ import annotations

from typing import Any

from ..arguments import check_held_out
from ..data.as_data import as_records, as_tables, distinguished, has_tables
from ..data.imposed import imposes_motion
from ..data.long_records import shortened
from ..data.moving_base import moves_base
from .dataset import Dataset
from .imposed import ImposedDataset
from .moving_base import MovingBaseDataset
from .over_time import TimeDataset
from .tables import TableDataset


def dataset_of(model, data, holdout=None, name: str = "data") -> Dataset:
    """Return records over time, or tables N(A, omega), as what a model can be fitted to.

    Of a base that moves and the mass on it, the record as it is seen from the base.

    Raises
    ------
    TypeError
        Neither, or both; `name` is what the message calls the data.
    ValueError
        A record both fitted and held out.
    """
    tables = has_tables(data)
    of = as_tables if tables else as_records
    records: Any = of(data, name)
    validation: Any = () if holdout is None else of(holdout, "holdout")
    check_held_out(records, validation)
    if tables:
        return TableDataset(records, validation)
    named = distinguished((*records, *validation))
    moving = any(moves_base(model, r) for r in named)
    named = tuple(shortened(r, motion=moving) for r in named)
    parts = named[: len(records)], named[len(records) :]
    if any(map(imposes_motion, named)):
        return ImposedDataset(*parts)
    if moving:
        return MovingBaseDataset(model, *parts)
    return TimeDataset(*parts)
