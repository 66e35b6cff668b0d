"""Tables of named columns out of files and other objects, and the choice of columns from them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...checks import is_number, mapping, names, no_file, path_of, shown, warn
from ...units import si_unit
from .quantities import UNITS, quantity_of
from .text_table import Table, read_csv, refuse_text
from .thresholds import MOST_COLUMNS

__all__ = ["find_column", "read_csv", "read_dataframe", "read_mat", "read_response", "select", "stem"]

INDEX = "index of the frame"
_FIELDS = {
    "t": ("time", "s", ()),
    "u": ("input", "N", tuple(UNITS)),
    "y": ("output", "m", ("position", "velocity", "acceleration", "force")),
    "velocity": ("velocity", "m/s", ("velocity",)),
}
"""Of each array of a record: its name as an argument, its usual unit, the quantities that it can be."""

_UNIT = re.compile(r"^(.*?)\s*[\[(]\s*([^\])]*?)\s*[\])]\s*$")


def stem(path) -> str:
    """Return the file's name without folder and ending."""
    return Path(path).stem


def read_mat(path) -> dict[str, np.ndarray]:
    """Return the numeric variables of a MATLAB file, struct fields as ``struct.field``.

    Columns of a matrix are ``name.0``, ``name.1`` ...; of one wider than long, its rows.
    """
    from scipy.io import loadmat

    path = path_of("from_mat", "path", path)
    if not path.exists() and not path.suffix:
        path = path.with_suffix(".mat")
    if not path.exists():
        raise no_file("from_mat", "path", path)
    with open(path, "rb") as file:
        head = file.read(128)
    if b"MATLAB 7.3" in head or head.startswith(b"\x89HDF"):
        raise ValueError(
            f"a .mat file must be version 7.2 or older; {path} is version 7.3 (HDF5). Save it again with "
            "save(..., '-v7') in MATLAB."
        )
    if not head:
        raise ValueError(f"a .mat file must hold variables; {path} is empty. Save it again.")
    try:
        content = loadmat(path, squeeze_me=True, struct_as_record=False, appendmat=False)
    except Exception as error:  # SciPy's reader fails on junk in many ways
        raise ValueError(
            f"a .mat file must be one that MATLAB wrote (version 4 to 7.2); {path} cannot be read as such "
            f"({type(error).__name__}). Save it again, or read text with from_csv."
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
    elif isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and value.ndim == 2:
        wide = value.shape[1] > value.shape[0]
        for k, line in enumerate((value if wide else value.T)[:MOST_COLUMNS]):
            table[f"{name}.{k}"] = line.astype(float)


def read_dataframe(frame, time) -> Table:
    """Return the columns of a DataFrame by name, its index too where that is the time.

    Dates and durations are seconds from the first; columns of objects are numbers where all cells are.
    """
    if not hasattr(frame, "columns") or not hasattr(frame, "to_numpy"):
        raise TypeError(f"from_dataframe needs a pandas DataFrame; got {type(frame).__name__}.")
    if len({str(name) for name in frame.columns}) < len(frame.columns):
        raise ValueError("column names must differ; the DataFrame has some more than once. Rename them.")
    table = Table()
    columns = {str(name): frame[name] for name in frame.columns}
    for name, column in {**columns, **({INDEX: frame.index} if time is None else {})}.items():
        values = column.to_numpy()
        if values.dtype.kind in "mM":
            values = (values - values[:1]) / np.timedelta64(1, "s")
        elif values.dtype.kind not in "fiub":
            values, bad = _as_numbers(values)
            if bad:
                table.text[name] = (len(bad), f"row {bad[0]}", str(values[bad[0]]))
        table[name] = values
    return table


def _as_numbers(cells: np.ndarray) -> tuple[np.ndarray, list[int]]:
    """Return cells as numbers, and none; or as they are, and the rows of those that are none."""
    bad = [i for i, cell in enumerate(cells) if not is_number(cell)]
    return (cells if bad else cells.astype(float)), bad


def read_response(response, input, output):
    """Return time, one input, one output of a response of python-control; of a mapping each output by key."""
    if not all(hasattr(response, k) for k in ("time", "inputs", "outputs")):
        raise TypeError(
            f"from_response needs a ct.TimeResponseData, as event_response returns; got {shown(response)}."
        )
    t = np.asarray(response.time, dtype=float)
    u, y = response.inputs, response.outputs
    if u is None:
        raise ValueError(
            "from_response needs a response that kept its input; got none. Simulate with an input."
        )
    u, y = np.asarray(u, dtype=float), np.asarray(y, dtype=float)
    ku = _row(input, getattr(response, "input_labels", None), u, "input")

    def picked(which):
        return _pick(y, _row(which, getattr(response, "output_labels", None), y, "output"), t, "outputs")

    if not isinstance(output, Mapping):
        return t, _pick(u, ku, t, "inputs"), picked(output)
    chosen = {}
    for word, given in output.items():
        which, unit = given if isinstance(given, tuple | list) and len(given) == 2 else (given, None)
        chosen[word] = picked(which) if unit is None else (picked(which), unit)
    return t, _pick(u, ku, t, "inputs"), chosen


def _row(which, labels, array, kind):
    rows = 1 if array.ndim == 1 else array.shape[0]
    if isinstance(which, str):
        labels = list(labels or [])
        if which not in labels:
            raise ValueError(
                f"the {kind} must be one of {', '.join(labels) or 'the numbers'}; got {which!r}."
            )
        return labels.index(which)
    if not (is_number(which) and which in range(rows)):
        raise (ValueError if is_number(which) else TypeError)(
            f"the {kind} must be a label or a number from 0 to {rows - 1}; got {shown(which)}."
        )
    return int(which)


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
    table: Mapping[str, Any],
    time,
    input,
    output,
    outputs,
    velocity,
    channels,
    keywords: dict[str, Any],
    source: str,
) -> dict[str, Any]:
    """Return the keyword arguments of a `Measurement` for the columns asked for."""
    wanted_of = {"t": time, "u": input}
    if outputs is None:
        wanted_of["y"] = output
    if velocity is not None:
        wanted_of["velocity"] = velocity
    chosen: dict[str, Any] = {}
    taken: dict[str, str] = {}

    def take(wanted, what):
        column, unit = find_column(table, wanted, source, what)
        if column in taken:
            raise ValueError(
                f"{taken[column]} and {what} need a column each; both are {column!r} of {source}. "
                f"{_exist(list(table), source)}"
            )
        taken[column] = what
        refuse_text(table, column, source)
        return column, table[column], unit

    for field, wanted in wanted_of.items():
        what, read_as, quantities = _FIELDS[field]
        argument = f"{what}_unit"
        header, chosen[field], unit = take(wanted, what)
        stated = keywords.get(argument)
        if unit and stated is None:
            chosen[argument] = unit
        elif unit and stated != unit:
            warn(
                f"{source}: the header of {what} says {unit}, {argument}={stated!r} is taken. "
                f"Leave {argument} out, or correct the header.",
                UserWarning,
            )
        elif stated is None:
            if field == "velocity":
                read_as = f"{chosen.get('output_unit') or keywords.get('output_unit') or 'm'}/s"
            suffix = _stated_unit(header, read_as, quantities)
            if suffix:
                warn(
                    f"{source}: the header {header!r} looks like {suffix}; the column is read as {read_as}. "
                    f"State {argument}={suffix!r}, or write '{header.removesuffix('_' + suffix)} "
                    f"[{suffix}]'.",
                    UserWarning,
                )
    if outputs is not None:
        chosen["outputs"] = {}
        for word, given in mapping("a record", "outputs", outputs, "{'x': 'pos', 'v': 'tacho'}").items():
            named = isinstance(given, tuple | list) and len(given) == 2
            column, own = given if named else (given, None)
            _, array, unit = take(column, f"output {word!r}")
            unit = own or unit
            chosen["outputs"][word] = (array, unit) if unit else array
    extra = {}
    for wanted in _several(channels):
        column, unit = find_column(table, wanted, source)
        refuse_text(table, column, source)
        extra[str(wanted)] = (table[column], unit) if unit else table[column]
    if extra:
        chosen["channels"] = extra
    return {**chosen, **{k: v for k, v in keywords.items() if v is not None}}


def _stated_unit(header: str, read_as: str, fitting) -> str:
    """Return the unit that a header ends with after ``_``, where it fits and is not the one read.

    `fitting`: the quantities that do; of a time none does, but seconds of any length.
    """
    suffix = header.rpartition("_")[2] if "_" in header else ""
    if suffix == "in":  # what goes in, far more often than inches
        return ""
    try:
        meant, read = si_unit(suffix), si_unit(read_as)
    except ValueError:
        return ""
    fits = quantity_of(suffix) in fitting if fitting else meant[1] == read[1]
    return suffix if fits and meant != read else ""


def _several(channels):
    if isinstance(channels, int) and not isinstance(channels, bool):
        return (channels,)
    if isinstance(channels, list | tuple) and any(isinstance(c, int) for c in channels):
        return tuple(channels)
    return names("a record", "channels", channels)


def find_column(table: Mapping[str, Any], wanted, source: str, what: str = "channel") -> tuple[str, str]:
    """Return the column's full name and the unit its header states; `what` it is to be, for messages."""
    known = list(table)
    if not isinstance(wanted, str | int | np.integer) or isinstance(wanted, bool):
        raise TypeError(
            f"the {what} column must be given by name or number; got {shown(wanted)}. {_exist(known, source)}"
        )
    if not isinstance(wanted, str):
        if not 0 <= wanted < len(known):
            raise ValueError(
                f"the {what} column number must be 0 to {len(known) - 1}; got {wanted}. "
                f"{_exist(known, source)}"
            )
        wanted = known[wanted]
    plain = {name: _UNIT.match(name) for name in known}
    matches = [n for n in known if n == wanted] or [
        n for n, m in plain.items() if m and m.group(1).strip() == wanted
    ]
    if len(matches) != 1:
        raise ValueError(
            f"the {what} column must be named as in the file; got {wanted!r}. {_exist(known, source)}"
        )
    m = plain[matches[0]]
    return matches[0], m.group(2) if m else ""


def _exist(known, source):
    return f"Columns of {source}: {', '.join(map(str, known)) or 'none'}."
