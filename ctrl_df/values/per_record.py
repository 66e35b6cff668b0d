"""A number that every record has for itself, in the place of one number."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from .record_name import among


class PerRecord(float):
    """Value of a parameter that differs from record to record; as a number, what it is for one not known.

    Attributes
    ----------
    values : mapping of str to float
        By name of the record. A `RecordName` that is made up is known by its run.
    """

    values: Mapping[str, float]

    def __new__(cls, usual: float, values: Mapping[str, float] | None = None):
        """Take the value of a record not known, and those of others."""
        self = super().__new__(cls, usual)
        self.values = MappingProxyType(dict(values or {}))
        return self

    @classmethod
    def over(
        cls, values: Mapping[str, float], angle: bool = False, weights: Sequence[float] | None = None
    ) -> PerRecord:
        """Return these values; a record not known has their mean, of angles its direction.

        `weights`: of each in the mean, not all zero, one over its variance say; None: all count the same.
        """
        pairs = list(zip(values.values(), weights or [1.0] * len(values), strict=True))
        if angle:
            values = {k: math.remainder(v, 2 * math.pi) for k, v in values.items()}
            return cls(cmath.phase(sum(cmath.rect(w, v) for v, w in pairs)), values)
        return cls(sum(w * v for v, w in pairs) / sum(w for _, w in pairs), values)

    @classmethod
    def angles(cls, records: Sequence[str], values: Sequence[float]) -> float:
        """Return one angle a record: of one record alone that angle."""
        return values[0] if len(values) == 1 else cls.over(dict(zip(records, values, strict=True)), True)

    def of(self, record: str) -> float:
        """Return the value of the record of that name."""
        name = among(record, self.values)
        return float(self) if name is None else self.values[name]

    def knows(self, record: str) -> bool:
        """Whether it has a value of the record of that name."""
        return among(record, self.values) is not None

    def __eq__(self, other) -> bool:
        same = super().__eq__(other)
        return same and self.values == other.values if isinstance(other, PerRecord) else same

    def __ne__(self, other) -> bool:
        return not self == other

    __hash__ = float.__hash__

    def __reduce__(self):
        return PerRecord, (float(self), dict(self.values))
