"""A physical parameter: value, unit, bounds; how effects declare theirs."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Parameter:
    """One named number of a block.

    Parameters
    ----------
    value : float
        SI value.
    unit : str
        SI unit, ``""`` if dimensionless.
    lower, upper : float
        Bounds, inclusive unless `strict`.
    strict : bool
        Whether `lower` itself is excluded.
    free : bool
        Whether a refit moves it unless told otherwise.
    meaning : str
        What it is, in a few words.
    """

    value: float
    unit: str
    lower: float = -math.inf
    upper: float = math.inf
    strict: bool = False
    free: bool = True
    meaning: str = ""

    def __float__(self) -> float:
        return self.value


def parameter(
    unit,
    *,
    lower=0.0,
    upper=math.inf,
    strict=False,
    free=True,
    default: Any = dataclasses.MISSING,
    meaning="",
) -> Any:
    """Declare a dataclass field that is a physical parameter (unit, bounds, what it means)."""
    bounds = dict(unit=unit, lower=lower, upper=upper, strict=strict, free=free, meaning=meaning)
    return dataclasses.field(default=default, metadata={"parameter": bounds})


def checked(owner: str, name: str, value, spec: dict, remedy: str = "") -> float:
    """Return `value` as a float, or raise ValueError naming rule, value and remedy."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise TypeError(
            f"{owner} needs {name} as one real number [{spec['unit'] or '-'}]; got {value!r}."
        ) from None
    lower, upper, strict = spec["lower"], spec["upper"], spec["strict"]
    low_ok = number > lower if strict else number >= lower
    if math.isnan(number) or not low_ok or not number <= upper or math.isinf(number):
        rule = _rule(name, lower, upper, strict)
        meaning = f" ({spec['meaning']}, unit {spec['unit'] or '1'})" if spec["meaning"] else ""
        tail = f" {remedy}" if remedy else " Check the value and its unit (SI)."
        raise ValueError(f"{owner} needs {rule}{meaning}; got {name}={value!r}.{tail}")
    return number


def _rule(name, lower, upper, strict):
    if math.isfinite(lower) and math.isfinite(upper):
        return f"{lower:g} {'<' if strict else '<='} {name} <= {upper:g}"
    if math.isfinite(lower):
        return f"{name} {'>' if strict else '>='} {lower:g} and finite"
    if math.isfinite(upper):
        return f"{name} <= {upper:g} and finite"
    return f"{name} finite"
