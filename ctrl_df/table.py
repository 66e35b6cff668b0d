"""Tables that show themselves: as text, as HTML in a notebook, as a pandas DataFrame."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tabulate import tabulate

WIDEST = 44
"""Characters of a cell; longer ones are wrapped."""
SHOWN = 180
"""Characters that a result is shown by."""


class Brief:
    """A result with much in it: a debugger shows what it comes to, `str` says all."""

    def __repr__(self) -> str:
        said = str(self).partition("\n")[0]
        room = SHOWN - len(type(self).__name__)
        return f"<{type(self).__name__}: {said if len(said) <= room else said[: room - 4] + ' ...'}>"


@dataclass(frozen=True)
class Table:
    """Rows of text under a head.

    Attributes
    ----------
    head : tuple of str
    rows : tuple of tuple of str
    widths : int or tuple of int
        Characters after which a cell is wrapped, of all columns or of each.
    """

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    widths: int | tuple[int, ...] = WIDEST

    def __str__(self) -> str:
        return self._as("simple_grid" if isinstance(self.widths, tuple) else "simple", wrapped=True)

    def _repr_html_(self) -> str:
        return str(self._as("html"))

    def _as(self, style, wrapped=False):
        columns = len(self.head)
        widths = [self.widths] * columns if isinstance(self.widths, int) else list(self.widths)
        return tabulate(
            self.rows, self.head, tablefmt=style, disable_numparse=True,
            maxcolwidths=widths if wrapped and self.rows else None,
        )  # fmt: skip


def without_empty(head: Sequence[str], rows: Iterable[Sequence[str]]) -> Table:
    """Return a table of the columns in which anything stands."""
    rows = [tuple(row) for row in rows]
    kept = [i for i in range(len(head)) if not rows or any(row[i] for row in rows)]
    return Table(tuple(head[i] for i in kept), tuple(tuple(row[i] for i in kept) for row in rows))


def frame(records: Iterable[Mapping[str, Any]]) -> Any:
    """Return records as a pandas DataFrame.

    Raises
    ------
    ImportError
        pandas is not installed; the message says how to get it.
    """
    try:
        import pandas as pd
    except ImportError:
        raise ImportError(
            "to_pandas needs pandas, which is not installed with ctrl_df: pip install pandas."
        ) from None
    return pd.DataFrame.from_records(list(records))
