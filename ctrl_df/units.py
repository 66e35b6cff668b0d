"""Units: what is written of a channel or a parameter, as a factor to SI and a dimension.

A unit is a product of symbols with powers, a solidus before those in the denominator: ``N s^2/m^2``,
``kg m2``, ``deg/s``, ``mN*m``, ``m/(N s)``, ``V/(rad/s)``, ``N/(m/s)^2``. Powers may be fractions, as some
laws have them: ``N s^0.5/m^0.5``. Angles and forces count as dimensions of their own here: a drive that turns
has sizes of angle and of torque that follow from nothing else, which libraries of physical units take for
plain numbers and for kg m^2/s^2. That, and a dozen symbols, is why this is done here.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Mapping
from fractions import Fraction

import numpy as np

from .nearest import nearest

_PREFIXES = {"n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3, "c": 1e-2, "k": 1e3, "M": 1e6}
_SYMBOLS: dict[str, tuple[float, dict[str, int]]] = {}


def _define(symbol: str, factor: float, dimension: dict[str, int], prefixes: str = ""):
    for prefix in ("", *prefixes):
        _SYMBOLS.setdefault(prefix + symbol, (_PREFIXES.get(prefix, 1.0) * factor, dimension))


_TURN = 2 * math.pi
_define("m", 1.0, {"m": 1}, "nuµμmck")
_define("in", 0.0254, {"m": 1})
_define("inch", 0.0254, {"m": 1})
_define("N", 1.0, {"N": 1}, "uµμmkM")
_define("lbf", 4.4482216152605, {"N": 1})
_define("ozf", 4.4482216152605 / 16, {"N": 1})
_define("oz", 4.4482216152605 / 16, {"N": 1})  # of motor makers: oz in is a torque
_define("lb", 4.4482216152605, {"N": 1})  # likewise: lb in, lb ft
_define("ft", 0.3048, {"m": 1})
_define("kgf", 9.80665, {"N": 1})
_define("Nm", 1.0, {"N": 1, "m": 1}, "uµμmk")
_define("Nmm", 1e-3, {"N": 1, "m": 1})
_define("Ncm", 1e-2, {"N": 1, "m": 1})
_define("J", 1.0, {"N": 1, "m": 1}, "mk")
_define("W", 1.0, {"N": 1, "m": 1, "s": -1}, "mk")
_define("rad", 1.0, {"rad": 1}, "uµμm")
_define("deg", math.pi / 180, {"rad": 1})
_define("°", math.pi / 180, {"rad": 1})
_define("arcmin", math.pi / 10_800, {"rad": 1})
_define("arcsec", math.pi / 648_000, {"rad": 1})
_define("rev", _TURN, {"rad": 1})
_define("turn", _TURN, {"rad": 1})
_define("rpm", _TURN / 60, {"rad": 1, "s": -1}, "k")
_define("s", 1.0, {"s": 1}, "nuµμm")
_define("min", 60.0, {"s": 1})
_define("h", 3600.0, {"s": 1})
_define("Hz", 1.0, {"s": -1}, "kM")
_define("g", 1e-3, {"kg": 1}, "k")
_define("g0", 9.80665, {"m": 1, "s": -2})
_define("V", 1.0, {"V": 1}, "mk")
_define("A", 1.0, {"A": 1}, "mk")
_define("ohm", 1.0, {"V": 1, "A": -1}, "mk")
_define("Ohm", 1.0, {"V": 1, "A": -1}, "mk")
_define("Ω", 1.0, {"V": 1, "A": -1}, "mk")
_define("%", 0.01, {})
for _plain in ("", "1", "-"):
    _define(_plain, 1.0, {})

BASE = ("kg", "N", "V", "A", "m", "s", "rad")
"""Dimensions, in the order in which units of SI are written."""

Power = int | Fraction
LARGEST_DENOMINATOR, AS_WRITTEN = 12, 1e-5
"""Of a fractional power; by how much its decimals, as users write a third, may miss it."""

_ON_A_LINE = {"N": ("N", "m"), "m": ("rad",), "kg": ("kg", "m", "m")}  # and what stands for it when turning
_PRODUCT = re.compile(r"(?<!\*)\*(?!\*)|·|\.(?!\d)|(?<=[^\W\d])-(?=[^\W\d])")  # and the hyphen of N-m
_SOLIDUS = re.compile(r"/(?![^()]*\))")  # but one within parentheses
_NUMBER = r"(?:(?:\^|\*\*)(?P<power>-?\d+(?:\.\d+)?)|(?P<mark>[²³])|(?P<digit>[23]))?"
_FACTOR = re.compile(rf"(?P<symbol>[^\s^*·./()\d²³][^\s^*·./()²³]*?|1){_NUMBER}")
_GROUP = re.compile(rf"\((?P<inside>[^()]*)\){_NUMBER}")


@functools.cache
def _parsed(unit: str) -> tuple[float, tuple[tuple[str, Power], ...]]:
    factor = 1.0
    total: dict[str, Power] = {}
    above, *below = _SOLIDUS.split(unit.strip())
    if any(not part.strip() for part in below):
        raise _unknown(unit)
    for sign, part in ((1, above), *((-1, b) for b in below)):
        text = part.strip()
        if group := _GROUP.fullmatch(text):
            size, inside = _parsed(group["inside"])
            found = [(size, dict(inside), _stated(unit, group))]
        elif text in _SYMBOLS:  # also those that are no factor: nothing, %
            found = [(*_SYMBOLS[text], 1)]
        else:
            found = [_factor(unit, word) for word in _PRODUCT.sub(" ", text).split()]
        for size, dimension, power in found:
            factor *= size ** float(sign * power)
            for base, exponent in dimension.items():
                total[base] = total.get(base, 0) + sign * power * exponent
    return factor, tuple((base, _whole(total[base])) for base in BASE if total.get(base))


def _factor(unit: str, word: str) -> tuple[float, Mapping[str, Power], Power]:
    match = _FACTOR.fullmatch(word)
    if match is None or match["symbol"] not in _SYMBOLS:
        raise _unknown(unit)
    return *_SYMBOLS[match["symbol"]], _stated(unit, match)


def _stated(unit: str, match: re.Match[str]) -> Power:
    """Return the power that is written, 1 where none is."""
    number = match["power"] or match["digit"] or {"²": 2, "³": 3}.get(match["mark"] or "", 1)
    stated = Fraction(number)
    power = stated.limit_denominator(LARGEST_DENOMINATOR)
    if abs(power - stated) > AS_WRITTEN:
        raise _unknown(unit)
    return _whole(power)


def _whole(power: Power) -> Power:
    return int(power) if power == int(power) else power


def _unknown(unit: str) -> ValueError:
    if re.search(r"count|cts|tick|puls|step|lsb|inc", unit, re.I):
        return ValueError(
            f"a unit must say how large it is; got {unit!r}. Convert counts of an encoder first: "
            "angle = 2 pi counts / (counts a turn), in rad."
        )
    known = [k for k in _SYMBOLS if k and k not in "μ1-"]
    unknown = [part for part in re.split(r"[\s/*·()^\d²³.]+", unit) if part and part not in _SYMBOLS]
    meant = [" or ".join([*_apart(part), *nearest(part, known)]) for part in unknown]
    question = "".join(f" Did you mean {names}?" for names in meant if names)
    return ValueError(
        f"a unit must be one of those known, or made of them (mm/s, N s^2/m^2); got {unit!r}.{question} "
        f"Known are {', '.join(known)}."
    )


def _apart(word: str) -> list[str]:
    """Return two or three symbols that stand together in a word, apart: ``Nm s`` for Nms; or nothing."""
    for first in range(len(word) - 1, 0, -1):
        for second in range(first + 1, len(word) + 1):
            parts = [word[:first], word[first:second], word[second:]]
            if all(p in _SYMBOLS for p in parts):
                return [" ".join(p for p in parts if p)]
    return []


def dimension(unit: str) -> dict[str, Power]:
    """Return the powers of a unit over `BASE`, those that are zero left out.

    Raises
    ------
    ValueError
        For an unknown unit; the message lists the symbols known.
    """
    if not isinstance(unit, str):
        raise TypeError(f"a unit must be a string such as 'mm' or 'N'; got {unit!r}.")
    return dict(_parsed(unit)[1])


def written(powers: Mapping[str, Power]) -> str:
    """Return the SI unit of a dimension."""
    above = [_power(base, powers[base]) for base in BASE if powers.get(base, 0) > 0]
    below = [_power(base, -powers[base]) for base in BASE if powers.get(base, 0) < 0]
    if not below:
        return " ".join(above)
    last = below[0] if len(below) == 1 else f"({' '.join(below)})"
    return f"{' '.join(above) or '1'}/{last}"


def _power(base: str, exponent: Power) -> str:
    return base if exponent == 1 else f"{base}^{float(exponent):.6g}"


def size(unit: str, sizes: Mapping[str, float]) -> float:
    """Return the typical size of what has this unit, given those of `BASE`; angles are as they are."""
    value = 1.0
    for base, exponent in dimension(unit).items():
        value *= (1.0 if base == "rad" else sizes[base]) ** float(exponent)
    return value


def si_unit(unit: str) -> tuple[float, str]:
    """Return the factor to SI and the SI unit.

    Raises
    ------
    ValueError
        For an unknown unit; the message lists the symbols known.
    """
    powers = dimension(unit)
    return _parsed(unit)[0], written(powers)


def to_si(values, unit: str) -> tuple[np.ndarray, str]:
    """Return `values` in SI as floats, and the SI unit."""
    factor, name = si_unit(unit)
    return np.asarray(values, dtype=float) * factor, name


def over(above: str, below: str) -> str:
    """Return the SI unit of a quotient."""
    powers = dimension(above)
    for base, exponent in dimension(below).items():
        powers[base] = powers.get(base, 0) - exponent
    return written(powers)


def driven(unit: str, by: str) -> str:
    """Return a unit of a channel ahead of a motor: that of its input, V or A, in the place of force."""
    powers = dimension(unit)
    if "N" in powers:
        powers[by] = powers.get(by, 0) + powers.pop("N")
    return written(powers)


def turning(unit: str) -> str:
    """Return the unit that a machine that turns has in the place of one on a line: N m for N, rad for m."""
    powers: dict[str, Power] = {}
    for base, exponent in dimension(unit).items():
        for other in _ON_A_LINE.get(base, (base,)):
            powers[other] = powers.get(other, 0) + exponent
    return written(powers)
