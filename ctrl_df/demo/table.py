"""Text tables with wrapped cells."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence


def wrapped_table(head: Sequence[str], rows: Sequence[Sequence[str]], widths: Sequence[int]) -> str:
    """Return a table whose cells are wrapped to `widths`; a blank line between rows."""
    lines = _row(head, widths)
    rule = "-+-".join("-" * w for w in widths)
    lines.append(rule)
    for cells in rows:
        lines += _row(cells, widths)
        lines.append(rule)
    return "\n".join(lines)


def _row(cells, widths) -> list[str]:
    columns = []
    for cell, width in zip(cells, widths, strict=True):
        pieces: list[str] = []
        for line in str(cell).split("\n"):
            pieces += textwrap.wrap(line, width, subsequent_indent=" ") or [""]
        columns.append(pieces)
    height = max(len(c) for c in columns)
    filled = [c + [""] * (height - len(c)) for c in columns]
    return [
        " | ".join(c[i].ljust(w) for c, w in zip(filled, widths, strict=True)).rstrip() for i in range(height)
    ]
