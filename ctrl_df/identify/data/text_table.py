"""Tables as instruments and spreadsheets write them: encoding, delimiter, decimal mark, units, clock times.

A file is either read rightly or refused with its line: no number is guessed that can be read two ways.
"""

from __future__ import annotations

import csv
import re
import warnings
from pathlib import Path

import numpy as np

from ...checks import choice, no_file, path_of, shown
from .thresholds import BINARY, BINARY_LOOK, BLOCK, ENCODING_LOOK, ENCODING_ZEROS, NANOSECONDS, SAMPLE_ROWS

_BOMS = (
    (b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe\x00\x00", "utf-32"), (b"\x00\x00\xfe\xff", "utf-32"),
    (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"),
)  # fmt: skip
_STRANGERS = {
    b"PK\x03\x04": "a workbook or zip archive; save the sheet as CSV",
    b"\xd0\xcf\x11\xe0": "an Excel workbook; save the sheet as CSV",
    b"\x1f\x8b": "compressed; unpack it first",
    b"\x89HDF": "an HDF5 file; export the columns as CSV",
    b"MATLAB": "a MATLAB file; read it with from_mat",
    b"\x89PNG": "a picture",
    b"%PDF": "a PDF",
}
_CONTROL = re.compile("[\x00-\x08\x0e-\x19\x1b-\x1f]")
_QUOTED = re.compile(r'"[^"]*"')
_NUMERIC = re.compile(r"[-+]?[\d.,'\u00a0\u202f ]*\d[\d.,]*(?:[eE][-+]?\d+)?$")
_THOUSANDS = {
    ",": re.compile(r"[-+]?\d{1,3}(?:[.'\u00a0\u202f ]\d{3})+(?:,\d*)?$"),
    ".": re.compile(r"[-+]?\d{1,3}(?:[,'\u00a0\u202f ]\d{3})+(?:\.\d*)?$"),
}
_DATE = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(?::\d\d(?:[.,]\d+)?)?(Z|[-+]\d\d:?\d\d)?$")
_CLOCK = re.compile(r"(\d{1,3}):(\d\d)(?::(\d\d(?:[.,]\d+)?))?$")
_DATE_LIKE = re.compile(r"\d{1,4}[-./]\d{1,2}[-./]\d{1,4}|\d:\d\d")


class Table(dict):
    """Columns by name; `text` says of those that hold anything but numbers where: (cells, place, cell)."""

    def __init__(self):
        super().__init__()
        self.text: dict[str, tuple[int, str, str]] = {}


def read_csv(path, delimiter: str | None = None, decimal: str | None = None) -> Table:
    """Return the columns of a text table by header name; without a header by ``0``, ``1``, ..."""
    _check_format(delimiter, decimal)
    text = _decoded(path_of("a table", "path", path))
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    at = [i for i, s in enumerate(lines) if s and not s.isspace() and s.lstrip()[0] != "#"]
    if at and re.fullmatch("sep=.", lines[at[0]].strip(), re.I):  # a line for spreadsheets
        delimiter = delimiter or lines[at[0]].strip()[-1]
        at = at[1:]
    if not at:
        raise ValueError(f"a CSV file needs a header and rows of numbers; {path} is empty. Record again.")
    mark = delimiter or _delimiter([lines[i] for i in at[:20]])
    quoted = '"' in text
    sample = [[c.strip() for c in row] for row in _rows(lines, at[: SAMPLE_ROWS + 2], mark, quoted)]
    header, used = _header(sample, path)
    data, at = sample[used:], at[used:]
    if not any(_plain(c) or _is_clock(c) for row in data for c in row):
        raise ValueError(f"a CSV file needs rows of numbers; {path} has none below its header. Record again.")
    if decimal is None:
        decimal = "." if mark == "," and not quoted else _decimal_mark(data, path)
    spare = len(data[0]) == len(header) + 1 and not data[0][-1]  # a delimiter at the end of each row
    width = len(header) + spare
    clocks = [j for j in range(len(header)) if j < len(data[0]) and _is_clock(data[0][j])]
    columns: list[list[np.ndarray]] = [[] for _ in header]
    table = Table()
    for k in range(0, len(at), BLOCK):
        some = at[k : k + BLOCK]
        sizes, cells = _cells(lines, some, mark, quoted)
        if set(sizes) != {width}:
            wrong = next(i for i, size in enumerate(sizes) if size != width)
            raise ValueError(
                f"{path}, line {some[wrong] + 1}: needs {len(header)} cells like the header; got "
                f"{sizes[wrong]}. Complete or delete the line, or what stands above the header (lines that "
                "begin with # are skipped); decimal commas need another delimiter."
            )
        for j in range(len(header)):
            column = cells[j::width]
            values, bad = (_clock if j in clocks else _numbers)(column, decimal)
            columns[j].append(values)
            if bad:
                first = (0, f"line {some[bad[0]] + 1}", column[bad[0]].strip())
                count, place, cell = table.text.get(header[j], first)
                table.text[header[j]] = (count + len(bad), place, cell)
    for j, name in enumerate(header):
        values = np.concatenate(columns[j])
        if j in clocks:
            values, name = _since_first(values), _in_seconds(name, table)
        table[name] = values
    return table


def _check_format(delimiter, decimal) -> None:
    """Raise unless delimiter and decimal mark are one character each, or None."""
    if delimiter is not None and not (isinstance(delimiter, str) and len(delimiter) == 1):
        raise (ValueError if isinstance(delimiter, str) else TypeError)(
            f"a table needs delimiter as one character, such as ';'; got {shown(delimiter)}. Leave it out to "
            "have it found."
        )
    if decimal is not None:
        choice("a table", "decimal", decimal, (".", ","))


def _rows(lines, some, mark: str, quoted: bool) -> list[list[str]]:
    """Return the cells of some of the lines, row by row."""
    if mark == " ":
        return [[c.strip('"') for c in lines[i].split()] for i in some]
    if quoted:
        return list(csv.reader((lines[i] for i in some), delimiter=mark))
    return [lines[i].split(mark) for i in some]


def _cells(lines, some, mark: str, quoted: bool) -> tuple[list[int], list[str]]:
    """Return how many cells each of some lines has, and all their cells in turn."""
    if mark == " " or quoted:
        split = _rows(lines, some, mark, quoted)
        return list(map(len, split)), [cell for row in split for cell in row]
    # a list for each of a million rows takes longer than the numbers
    block = [lines[i] for i in some]
    return [line.count(mark) + 1 for line in block], mark.join(block).split(mark)


def refuse_text(table, column: str, source: str) -> None:
    """Raise ValueError where a column that is asked for holds anything but numbers."""
    bad = getattr(table, "text", {}).get(column)
    if bad is None:
        return
    count, place, cell = bad
    if not cell:
        what, remedy = "an empty cell", "Fill it, or cut the record there."
    elif _DATE_LIKE.search(cell):
        what = repr(cell)
        remedy = "Times are numbers [s], ISO (2026-01-31T12:00:00.5) or clock times (12:00:00.5)."
    else:
        what, remedy = shown(cell), "Correct the cell, or choose another column."
    raise ValueError(
        f"column {column!r} of {source} needs numbers; {place} has {what} ({count} such cells). {remedy}"
    )


# --- encoding ----------------------------------------------------------------------------------------------


def _decoded(path: Path) -> str:
    try:
        raw = path.read_bytes()
    except FileNotFoundError:
        raise no_file("a table", "path", path) from None
    for magic, what in _STRANGERS.items():
        if raw.startswith(magic):
            raise ValueError(f"a table needs a text file with columns; {path} is {what}.")
    head = raw[:ENCODING_LOOK]
    encoding = next((name for bom, name in _BOMS if raw.startswith(bom)), None)
    if encoding is None and head.count(0) > 0:
        odd, even = head[1::2].count(0), head[0::2].count(0)
        encoding = (
            "utf-16-le"
            if odd > ENCODING_ZEROS * max(even, 1)
            else ("utf-16-be" if even > ENCODING_ZEROS * max(odd, 1) else "")
        )
    text = None
    for name in (encoding,) if encoding is not None else ("utf-8", "cp1252", "latin-1"):
        try:
            text = raw.decode(name) if name else None
            break
        except UnicodeDecodeError:
            continue
    if text is None or len(_CONTROL.findall(text[:BINARY_LOOK])) > BINARY * min(len(text), BINARY_LOOK):
        raise ValueError(
            f"a table needs a text file with columns; {path} is binary. "
            "Export it as CSV, or read a .mat file with from_mat."
        )
    return text


# --- delimiter, header, units ------------------------------------------------------------------------------


def _delimiter(lines):
    bare = [_QUOTED.sub("", line) for line in lines]
    few = bare[:2]
    counts = {mark: min(line.count(mark) for line in few) for mark in (";", "\t", ",", "|")}
    best = max(counts, key=lambda mark: counts[mark])
    if counts[best] == 0:
        return " "
    # decimal commas between blanks
    if best == "," and any(re.search(r"\d +[-+\d]", c) and ":" not in c for c in bare[-1].split(",")):
        return " "
    return best


def _header(sample, path) -> tuple[list[str], int]:
    """Return the names of the columns, units of a row below included, and how many rows say them."""
    header = sample[0]
    if all(_plain(c) or _is_clock(c) for c in header):
        return [str(i) for i in range(len(header))], 0
    while len(header) > 1 and not header[-1]:
        header = header[:-1]
    names, used = list(header), 1
    row = sample[1] if len(sample) > 1 else []
    after = sample[2] if len(sample) > 2 else []
    units = row[: len(header)]
    if (
        len(units) == len(header)
        and any(units)
        and not any(_plain(c) or _is_clock(c) for c in units)
        and any(_plain(c) for c in after)
    ):
        stated = [re.sub(r"^[\[(<]\s*|\s*[\])>]$", "", u) for u in units]
        names = [
            f"{h} [{u}]" if u and not h.endswith(("]", ")")) else h
            for h, u in zip(header, stated, strict=True)
        ]
        used = 2
    for kind in (header, names):
        if len(set(kind)) < len(kind):
            twice = next(h for h in kind if kind.count(h) > 1)
            raise ValueError(
                f"column names must differ; {path} has {twice!r} more than once. Rename them."
                if twice
                else f"columns need names; {path} has several without one. Name them in the header."
            )
    return names, used


def _plain(cell) -> bool:
    """Whether a cell is a number in one notation or another."""
    return _number(cell, ".") is not None or _number(cell, ",") is not None


# --- numbers -----------------------------------------------------------------------------------------------


def _decimal_mark(rows, path) -> str:
    """Return the decimal mark that the numbers of a table show; ValueError where they show none, or both."""
    shows: dict[str, str] = {}
    doubtful = ""
    for cell in (c for row in rows for c in row if "," in c and _NUMERIC.match(c)):
        if "." in cell:
            shows.setdefault("," if cell.rfind(",") > cell.rfind(".") else ".", cell)
        elif cell.count(",") > 1:
            shows.setdefault(".", cell)
        elif not re.fullmatch(r"[-+]?[1-9]\d{0,2},\d{3}", cell):
            shows.setdefault(",", cell)
        else:
            doubtful = cell
    for cell in (c for row in rows for c in row if "." in c and "," not in c and _NUMERIC.match(c)):
        if not _THOUSANDS[","].match(cell) or cell.startswith(("0", "-0", "+0")):
            shows.setdefault(".", cell)
            break
    if len(shows) == 2:
        raise ValueError(
            f"a table needs one decimal mark; {path} has both {shows['.']!r} and {shows[',']!r}. "
            "Correct the cells, or say decimal=',' or decimal='.'."
        )
    if doubtful and not shows:
        raise ValueError(
            f"numbers of {path} can be read two ways: {doubtful!r} with a decimal comma or with "
            "thousands. Say decimal=',' or decimal='.'."
        )
    return next(iter(shows), ".")


def _numbers(column, decimal) -> tuple[np.ndarray, list[int]]:
    """Return a column as numbers, NaN where a cell is none, and which those are."""
    try:
        if decimal == ".":
            return np.array(list(map(float, column))), []
        if not any("." in c for c in column):
            return np.array([float(c.replace(",", ".")) for c in column]), []
    except ValueError:
        pass
    found = [_number(c.strip(), decimal) for c in column]
    return np.array([np.nan if v is None else v for v in found]), [
        i for i, v in enumerate(found) if v is None
    ]


def _number(cell, decimal):
    if decimal == "," and "." in cell and not _THOUSANDS[","].match(cell):
        return None
    if _THOUSANDS[decimal].match(cell):
        cell = re.sub("[.'\u00a0\u202f ]" if decimal == "," else "[,'\u00a0\u202f ]", "", cell)
    try:
        return float(cell.replace(",", ".") if decimal == "," else cell)
    except ValueError:
        return None


# --- times of day ------------------------------------------------------------------------------------------


def _is_clock(cell) -> bool:
    return bool(_DATE.match(cell) or _CLOCK.match(cell))


def _clock(column, decimal) -> tuple[np.ndarray, list[int]]:
    """Return dates or times of day in whole nanoseconds, and which cells are neither."""
    cells = [c.strip() for c in column]
    first = _DATE.match(cells[0])
    if first is None:
        return _times_of_day(cells)
    zone = first.group(1) or ""
    bare = [c.removesuffix(zone).replace(",", ".") for c in cells]
    bad = [i for i, c in enumerate(cells) if (m := _DATE.match(c)) is None or (m.group(1) or "") != zone]
    if bad:
        return np.full(len(cells), np.nan), bad
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return np.array(bare, dtype="datetime64[ns]").astype(np.int64), []
        except (ValueError, Warning):
            return np.full(len(cells), np.nan), [0]


def _times_of_day(cells):
    out, bad = np.empty(len(cells)), []
    for i, cell in enumerate(cells):
        m = _CLOCK.match(cell)
        if m is None:
            bad.append(i)
            out[i] = np.nan
            continue
        a, b, c = m.groups()
        # two parts are minutes and seconds only where no hours could be meant: hours and minutes otherwise
        out[i] = 3600 * int(a) + 60 * int(b) + float((c or "0").replace(",", "."))
    return np.round(out * NANOSECONDS), bad


def _since_first(values):
    """Return seconds from the first of times in nanoseconds; a clock that passes midnight goes on."""
    day = 86_400_000_000_000
    since = (values - values[0]).astype(float)
    if np.nanmax(np.abs(values), initial=0) < 2 * day:
        since = since + day * np.cumsum(np.concatenate(([0.0], np.diff(since) < -0.5 * day)))
    return since / NANOSECONDS


def _in_seconds(name, table) -> str:
    """Return the name of a column of clock times with the unit it has now."""
    bare = re.sub(r"\s*[\[(][^\])]*[\])]\s*$", "", name)
    renamed = f"{bare} [s]"
    if name in table.text:
        table.text[renamed] = table.text.pop(name)
    return renamed
