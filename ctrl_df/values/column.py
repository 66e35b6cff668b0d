"""A number for each of many runs, that goes through code written for one number."""

from __future__ import annotations

import operator

import numpy as np


class Differs(Exception):  # noqa: N818 - not an error: a question that has two answers
    """A comparison has not the same outcome for all runs; ``mask`` tells for which it is true."""

    def __init__(self, mask: np.ndarray):
        super().__init__("a comparison has not the same outcome for all runs")
        self.mask = mask


class Column:
    """One number a run, shape (runs,), in the place of a number.

    Arithmetic is done for all runs at once, as numpy does it: to the last bit what it is for each alone. A
    comparison is answered if its outcome is the same for all runs; otherwise it raises `Differs`, and who
    began can go on with the two parts apart. Whatever needs one number (``float``, ``math.exp``, an index)
    raises TypeError. So whatever code makes of columns without an exception it also makes of every row.
    """

    __slots__ = ("values",)
    __hash__ = None  # type: ignore[assignment]
    __array_ufunc__ = None  # numpy leaves arithmetic with its numbers to this class

    def __init__(self, values: np.ndarray):
        self.values = values

    def __repr__(self) -> str:
        return f"one of {len(self.values)} numbers from {self.values.min():g} to {self.values.max():g}"

    def __neg__(self):
        return Column(-self.values)

    def __pos__(self):
        return self

    def __abs__(self):
        return Column(abs(self.values))

    def __bool__(self) -> bool:
        return self != 0.0


def _value(other):
    return other.values if isinstance(other, Column) else other


def _arithmetic(operation, swapped):
    def combine(self, other):
        if not isinstance(other, int | float | Column):
            return NotImplemented
        a, b = self.values, _value(other)
        a, b = (b, a) if swapped else (a, b)
        if operation is operator.truediv and np.any(b == 0):
            raise ZeroDivisionError("one of the runs divides by zero")
        with np.errstate(all="ignore"):
            return Column(operation(a, b))

    return combine


def _comparison(operation):
    def compare(self, other) -> bool:
        if not isinstance(other, int | float | Column):
            return NotImplemented
        mask = operation(self.values, _value(other))
        if mask.all() or not mask.any():
            return bool(mask[0])
        raise Differs(mask)

    return compare


for _name in ("add", "sub", "mul", "truediv"):
    setattr(Column, f"__{_name}__", _arithmetic(getattr(operator, _name), False))
    setattr(Column, f"__r{_name}__", _arithmetic(getattr(operator, _name), True))
for _name in ("lt", "le", "gt", "ge", "eq", "ne"):
    setattr(Column, f"__{_name}__", _comparison(getattr(operator, _name)))


def spread(numbers) -> np.ndarray:
    """Return numbers and columns side by side, shape (runs, numbers); one row where there is no column."""
    columns = [(i, v.values) for i, v in enumerate(numbers) if isinstance(v, Column)]
    if not columns:
        return np.array([numbers], float)
    table = np.empty((len(columns[0][1]), len(numbers)))
    table[:] = [0.0 if isinstance(v, Column) else v for v in numbers]
    for i, values in columns:
        table[:, i] = values
    return table
