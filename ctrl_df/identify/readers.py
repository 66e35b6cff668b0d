"""Tables of named columns out of files and other objects, and the choice of columns from them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

INDEX = "index of the frame"
_UNIT = re.compile(r"^(.*?)\s*[\[(]\s*([^\])]*?)\s*[\])]\s*$")


def stem(path) -> str:
    """Return the file's name without folder and ending."""
    return Path(path).stem


def read_csv(path, delimiter: str | None = None) -> dict[str, np.ndarray]:
    """Return the columns of a text table by header name; without a header by ``0``, ``1``, ..."""
    with open(path, encoding="utf-8-sig") as file:
        lines = [(i, line.strip("\r\n")) for i, line in enumerate(file, 1)]
    lines = [(i, line) for i, line in lines if line.strip() and not line.lstrip().startswith("#")]
    if not lines:
        raise ValueError(f"a CSV file needs a header and rows; {path} is empty.")
    mark = delimiter or _delimiter([line for _, line in lines[:2]])
    rows = [(i, _cells(line, mark)) for i, line in lines]
    comma = mark == ";" and not any("." in c for _, cells in rows[1:20] for c in cells)
    header = rows[0][1]
    if all(_number(cell, comma) is not None for cell in header):
        header = [str(i) for i in range(len(header))]
    else:
        rows = rows[1:]
    if len(set(header)) < len(header):
        twice = next(h for h in header if header.count(h) > 1)
        raise ValueError(f"column names must differ; {path} has {twice!r} more than once. Rename them.")
    table = np.empty((len(rows), len(header)))
    for k, (line, cells) in enumerate(rows):
        if len(cells) != len(header):
            raise ValueError(
                f"{path}, line {line}: needs {len(header)} cells like the header; got {len(cells)}."
            )
        for j, cell in enumerate(cells):
            number = _number(cell, comma)
            # Text columns (a comment, a state) are no error until someone asks for them: they read as NaN.
            table[k, j] = np.nan if number is None else number
    return {name: table[:, j] for j, name in enumerate(header)}


def _delimiter(lines):
    counts = {mark: min(line.count(mark) for line in lines) for mark in (";", "\t", ",")}
    best = max(counts, key=lambda mark: counts[mark])
    return best if counts[best] > 0 else " "


def _cells(line, mark):
    cells = line.split() if mark == " " else line.split(mark)
    return [cell.strip().strip('"') for cell in cells]


def _number(cell, comma):
    try:
        return float(cell.replace(",", ".") if comma else cell)
    except ValueError:
        return None


def read_mat(path) -> dict[str, np.ndarray]:
    """Return the numeric variables of a MATLAB file, struct fields as ``struct.field``."""
    from scipy.io import loadmat

    try:
        content = loadmat(path, squeeze_me=True, struct_as_record=False)
    except NotImplementedError:
        raise ValueError(
            f"a .mat file must be version 7.2 or older; {path} is version 7.3 (HDF5). Save it again with "
            "save(..., '-v7') in MATLAB."
        ) from None
    table: dict[str, np.ndarray] = {}
    for name, value in content.items():
        if not name.startswith("__"):
            _flatten(name, value, table)
    return table


def _flatten(name, value, table):
    if hasattr(value, "_fieldnames"):
        for field in value._fieldnames:
            _flatten(f"{name}.{field}", getattr(value, field), table)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and value.ndim == 1:
        table[name] = value.astype(float)


def read_dataframe(frame, time) -> dict[str, np.ndarray]:
    """Return the columns of a DataFrame by name, its index too where that is the time."""
    if not hasattr(frame, "columns") or not hasattr(frame, "to_numpy"):
        raise TypeError(f"from_dataframe needs a pandas DataFrame; got {type(frame).__name__}.")
    table = {str(name): frame[name].to_numpy() for name in frame.columns}
    if time is None:
        index = frame.index
        if index.dtype.kind in "mM":  # dates or durations: seconds from the first
            table[INDEX] = (index - index[0]).total_seconds().to_numpy()
        else:
            table[INDEX] = index.to_numpy()
    return table


def read_response(response, input, output):
    """Return time, one input, one output of a response of python-control."""
    t = np.asarray(response.time, dtype=float)
    u, y = response.inputs, response.outputs
    if u is None:
        raise ValueError(
            "from_response needs a response that kept its input; got none. Simulate with an input."
        )
    u, y = np.asarray(u, dtype=float), np.asarray(y, dtype=float)
    ku = _row(input, getattr(response, "input_labels", None), u, "input")
    ky = _row(output, getattr(response, "output_labels", None), y, "output")
    return t, _pick(u, ku, t, "inputs"), _pick(y, ky, t, "outputs")


def _row(which, labels, array, kind):
    count = 1 if array.ndim == 1 else array.shape[0]
    if isinstance(which, str):
        labels = list(labels or [])
        if which not in labels:
            raise ValueError(
                f"the {kind} must be one of {', '.join(labels) or 'the numbers'}; got {which!r}."
            )
        return labels.index(which)
    if not 0 <= which < count:
        raise ValueError(f"the {kind} must be a number from 0 to {count - 1}; got {which!r}.")
    return which


def _pick(array, row, t, kind):
    if array.ndim == 1:
        return array
    if array.ndim == 2:
        return array[row]
    if array.ndim == 3 and array.shape[1] == 1:
        return array[row, 0]
    raise ValueError(
        f"from_response needs one trace of {kind}; got shape {array.shape}. Select one trace first."
    )


def select(
    table: Mapping[str, Any], time, input, output, velocity, channels, keywords: dict[str, Any], source: str
) -> dict[str, Any]:
    """Return the keyword arguments of a `Measurement` for the columns asked for."""
    names = {"t": time, "u": input, "y": output}
    if velocity is not None:
        names["velocity"] = velocity
    unit_of = {"t": "time_unit", "u": "input_unit", "y": "output_unit", "velocity": "velocity_unit"}
    chosen: dict[str, Any] = {}
    for field, wanted in names.items():
        column, unit = find_column(table, wanted, source)
        chosen[field] = table[column]
        if unit and keywords.get(unit_of[field]) is None:
            chosen[unit_of[field]] = unit
    extra = {}
    for wanted in channels:
        column, unit = find_column(table, wanted, source)
        extra[str(wanted)] = (table[column], unit) if unit else table[column]
    if extra:
        chosen["channels"] = extra
    return {**chosen, **{k: v for k, v in keywords.items() if v is not None}}


def find_column(table: Mapping[str, Any], wanted, source: str) -> tuple[str, str]:
    """Return the column's full name and the unit its header states."""
    names = list(table)
    if isinstance(wanted, int) and not isinstance(wanted, bool):
        if not 0 <= wanted < len(names):
            raise ValueError(
                f"a column number must be 0 to {len(names) - 1}; got {wanted}. {_exist(names, source)}"
            )
        wanted = names[wanted]
    plain = {name: _UNIT.match(name) for name in names}
    matches = [n for n in names if n == wanted] or [
        n for n, m in plain.items() if m and m.group(1).strip() == wanted
    ]
    if len(matches) != 1:
        raise ValueError(f"a column must be named as in the file; got {wanted!r}. {_exist(names, source)}")
    m = plain[matches[0]]
    return matches[0], m.group(2) if m else ""


def _exist(names, source):
    return f"Columns of {source}: {', '.join(names) or 'none'}."
