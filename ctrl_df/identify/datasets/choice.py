"""Which kind of data is handed in."""

from __future__ import annotations

from ..arguments import check_held_out
from ..data.as_data import as_records, as_tables, distinguished, has_tables
from ..data.imposed import imposes_motion
from .dataset import Dataset
from .imposed import ImposedDataset
from .over_time import TimeDataset
from .tables import TableDataset


def dataset_of(data, holdout=None, name: str = "data") -> Dataset:
    """Return records over time, or tables N(A, omega), as what a model can be fitted to.

    Raises
    ------
    TypeError
        Neither, or both; `name` is what the message calls the data.
    ValueError
        A record both fitted and held out.
    """
    of, kind = (as_tables, TableDataset) if has_tables(data) else (as_records, TimeDataset)
    records = of(data, name)
    validation = () if holdout is None else of(holdout, "holdout")
    check_held_out(records, validation)
    if kind is TableDataset:
        return kind(records, validation)
    named = distinguished((*records, *validation))
    kind = ImposedDataset if any(map(imposes_motion, named)) else TimeDataset
    return kind(named[: len(records)], named[len(records) :])
