"""What arguments must be: each check returns the value in the type asked for, or says rule, value, remedy.

TypeError where the kind is wrong (text, a truth value, a complex number in the place of a number), ValueError
where the value is. ``owner`` begins the sentence: the function or block that asks.
"""

from __future__ import annotations

import math
import os
import sys
import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .nearest import did_you_mean
from .values.column import Column
from .values.per_record import PerRecord

CHECK_VALUE = "Check the value and its unit (SI)."
_SHOWN = 60  # characters of a value that an error repeats


def warn(message: str, category: type[Warning]) -> None:
    """Warn at the line of the user's that led here: the nearest that is not of this package."""
    package, level, frame = os.path.dirname(__file__) + os.sep, 2, sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(package):
        frame, level = frame.f_back, level + 1
    warnings.warn(message, category, stacklevel=level)


def shown(value) -> str:
    """Return a value as text, short enough for a sentence."""
    if isinstance(value, np.ndarray) and value.size > 8:
        return f"an array of shape {value.shape}"
    text = " ".join(repr(value).split())
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 4]} ..."


def kind_of(value) -> str:
    """Return what a value is, with the module of its class where that is another package."""
    cls = type(value)
    return cls.__name__ if cls.__module__ == "builtins" else f"{cls.__module__}.{cls.__name__}"


def is_number(value) -> bool:
    """Whether a value is one real number: no text, no truth value, nothing complex, no array of several."""
    if type(value) is float:
        return True
    if (
        isinstance(value, bool | np.bool_ | str | bytes | complex | np.complexfloating)
        or value is np.ma.masked
    ):
        return False
    if isinstance(value, np.ndarray):
        return value.ndim == 0 and value.dtype.kind in "iuf"
    return isinstance(value, int | float | np.number | Column) or (
        hasattr(value, "__float__") and np.ndim(value) == 0
    )


def number(
    owner: str,
    name: str,
    value,
    unit: str = "",
    *,
    lower: float = -math.inf,
    upper: float = math.inf,
    strict: bool = False,
    meaning: str = "",
    remedy: str = CHECK_VALUE,
    infinite: bool = False,
) -> float:
    """Return one real number within its bounds; `lower` itself is excluded if `strict`, zero without a bound.

    A `Column` (one number for each of many runs) is one as well, and a `PerRecord`; both stay what they are.
    """
    if not is_number(value):
        kind = f"one real number [{unit}]" if unit else "one real number"
        tail = "Convert text with float()." if isinstance(value, str | bytes) else remedy
        raise TypeError(f"{owner} needs {name} as {kind}; got {shown(value)}. {tail}")
    given = _as_float(value)
    enough = above(given, lower, strict)
    finite = infinite or abs(given) < math.inf
    if not (enough and given <= upper and finite):  # NaN fails every comparison
        described = f" ({meaning}, unit {unit or 1})" if meaning else (f" [{unit}]" if unit else "")
        rule = _rule(name, lower, upper, strict, infinite)
        raise ValueError(f"{owner} needs {rule}{described}; got {name}={shown(value)}. {remedy}")
    return given


def above(value, lower: float, strict: bool) -> Any:
    """Whether a value, or each of an array, keeps to a lower bound; strict and -inf: whether it is not 0."""
    if not strict:
        return value >= lower
    return value > lower if lower > -math.inf else (value > 0) | (value < 0)


def _as_float(value) -> Any:
    if isinstance(value, Column | PerRecord):
        return value
    try:
        return float(value)
    except OverflowError:  # an integer beyond the range of floats
        return math.inf if value > 0 else -math.inf


def positive(owner: str, name: str, value, unit: str = "", **keywords: Any) -> float:
    """Return a number > 0."""
    return number(owner, name, value, unit, lower=0.0, strict=True, **keywords)


def count(owner: str, name: str, value, least: int = 1, *, meaning: str = "", remedy: str = "") -> int:
    """Return an integer >= `least`; floats that are whole are taken, truth values are not."""
    rule = f"{name} as an integer >= {least}" + (f" ({meaning})" if meaning else "")
    tail = f" {remedy}" if remedy else ""
    if not is_number(value):
        raise TypeError(f"{owner} needs {rule}; got {shown(value)}.{tail}")
    given = _as_float(value)
    if not (math.isfinite(given) and given == int(given) and given >= least):
        raise ValueError(f"{owner} needs {rule}; got {name}={shown(value)}.{tail}")
    return int(value)


def flag(owner: str, name: str, value) -> bool:
    """Return a truth value."""
    if not isinstance(value, bool | np.bool_):
        raise TypeError(f"{owner} needs {name} as True or False; got {shown(value)}.")
    return bool(value)


def choice(owner: str, name: str, value, allowed) -> Any:
    """Return one of the values allowed."""
    if not isinstance(value, str) or value not in allowed:
        words = " or ".join(repr(a) for a in allowed)
        raise (ValueError if isinstance(value, str) else TypeError)(
            f"{owner} needs {name}={words}; got {name}={shown(value)}."
            f"{did_you_mean(value, allowed, 'Give one of these.')}"
        )
    return value


def real_array(owner: str, name: str, values, unit: str = "", *, remedy: str = "") -> np.ndarray:
    """Return real, finite numbers as an array of floats, of whatever shape."""
    tail = f" {remedy}" if remedy else ""
    rule = f"{name} as real numbers" + (f" [{unit}]" if unit else "")
    if values is None or isinstance(values, str | bytes | Mapping | set):
        raise TypeError(f"{owner} needs {rule}; got {shown(values)}.{tail}")
    if np.any(np.ma.getmaskarray(values)) if isinstance(values, np.ma.MaskedArray) else False:
        raise ValueError(f"{owner} needs {rule}; got masked entries. Cut them off or fill them first.")
    try:
        given = np.asarray(values)
    except ValueError:
        raise ValueError(f"{owner} needs {rule}; got rows of unequal length.{tail}") from None
    mixed = given.dtype.kind == "O"  # numbers of several kinds, or none at all
    if mixed:
        if not all(is_number(v) for v in given.ravel()):
            raise TypeError(f"{owner} needs {rule}; got {shown(values)}.{tail}")
    elif given.dtype.kind not in "iuf":
        kind = {"c": "complex numbers", "b": "truth values", "U": "text", "S": "text"}.get(
            given.dtype.kind, f"dtype {given.dtype}"
        )
        raise TypeError(f"{owner} needs {rule}; got {kind}: {shown(values)}.{tail}")
    flat = [_as_float(v) for v in given.ravel()] if mixed else given
    array = np.array(flat, dtype=float).reshape(given.shape)
    if not np.isfinite(array).all():
        bad = ~np.isfinite(array)
        what = "NaN" if np.isnan(array[bad][0]) else "infinity"
        where = f" at index {int(np.argmax(bad.ravel()))}" if array.ndim else ""
        raise ValueError(f"{owner} needs {name} finite; got {what}{where}.{tail or ' Remove it.'}")
    return array


def mapping(owner: str, name: str, value, example: str = "{'mass': 9.0}") -> Mapping:
    """Return a mapping of names to values."""
    if not isinstance(value, Mapping):
        raise TypeError(f"{owner} needs {name} as a mapping, such as {example}; got {shown(value)}.")
    return value


def known_name(owner: str, name: str, value, known) -> str:
    """Return a name that is among those known."""
    if not isinstance(value, str) or value not in known:
        raise (ValueError if isinstance(value, str) else TypeError)(
            f"{owner} needs {name} out of {', '.join(known) or 'none'}; got {shown(value)}."
            f"{did_you_mean(value, known, 'Give one of these.' if known else '')}"
        )
    return value


def names(owner: str, name: str, value) -> tuple[str, ...]:
    """Return one name or several as a tuple of names."""
    if isinstance(value, str):
        return (value,)
    try:
        given: tuple[Any, ...] = tuple(value) if isinstance(value, Iterable) else (value,)
    except TypeError:  # an array of no dimension
        given = (value,)
    wrong = [v for v in given if not isinstance(v, str)]
    if wrong:
        raise TypeError(f"{owner} needs {name} as one name or a sequence of names; got {shown(wrong[0])}.")
    return given


def returned(value) -> bool:
    """Whether what a user's law returned can stand as one number; a comparison (True or False) can."""
    return is_number(value) or isinstance(value, bool | np.bool_)


def executor(owner: str, value) -> Any:
    """Return what runs work elsewhere: None, or an object with ``submit``."""
    if value is not None and (isinstance(value, type) or not callable(getattr(value, "submit", None))):
        raise TypeError(
            f"{owner} needs executor as a concurrent.futures.Executor (anything with submit), or None; got "
            f"{shown(value)}. Leave it out to compute here."
        )
    return value


def system_name(owner: str, value) -> None:
    """Check the name of a system: text without a point, which python-control keeps for signals."""
    if value is not None and (not isinstance(value, str) or not value or "." in value):
        raise (ValueError if isinstance(value, str) else TypeError)(
            f"{owner} needs name as text without a point; got {shown(value)}. Leave it out for a default."
        )


def path_of(owner: str, name: str, value) -> Path:
    """Return a path given as text or path; numbers, open files and the like are refused."""
    if not isinstance(value, str | os.PathLike):
        raise TypeError(
            f"{owner} needs {name} as the path of a file (text or pathlib.Path); got {shown(value)}."
        )
    if not os.fspath(value) or "\0" in str(value):
        raise ValueError(f"{owner} needs {name} as the path of a file; got {shown(value)}. Give it a name.")
    return Path(value)


def no_file(owner: str, name: str, path) -> FileNotFoundError:
    """Return the error that there is no such file; the remedy is in its words."""
    return FileNotFoundError(f"{owner} needs {name} as a file that exists; got {path}. Check the path.")


def place_to_write(owner: str, name: str, value) -> Path:
    """Return the path of a file to be written, after trying its place; nothing of a file there is changed."""
    path = path_of(owner, name, value)
    if os.path.isdir(path):
        raise IsADirectoryError(f"{owner} needs {name} as a file; {path} is a directory. Add a file name.")
    if not os.path.isdir(path.parent):
        raise FileNotFoundError(
            f"{owner} needs {name} in an existing directory; got {path.parent}. Create it first."
        )
    new = not os.path.exists(path)
    try:
        with open(path, "ab"):
            pass
        if new:
            path.unlink()
    except OSError as error:
        raise type(error)(
            f"{owner} needs {name} in a place that can be written; {path}: {error.strerror or error}. "
            "Give another path."
        ) from None
    return path


def _rule(name, lower, upper, strict, infinite):
    if math.isfinite(lower) and math.isfinite(upper):
        return f"{lower:g} {'<' if strict else '<='} {name} <= {upper:g}"
    end = "" if infinite else " and finite"
    if math.isfinite(lower):
        return f"{name} {'>' if strict else '>='} {lower:g}{end}"
    if math.isfinite(upper):
        return f"{name} <= {upper:g}{end}"
    if strict:
        return f"{name} != 0{end}"
    return f"{name}" + (" as a number" if infinite else " finite")
