"""Units of recorded channels, to SI; angles in rad."""

from __future__ import annotations

import math

import numpy as np

_PREFIXES = {"": 1.0, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3, "c": 1e-2, "k": 1e3, "M": 1e6}


def _scaled(unit: str, si: str, prefixes: str, factor: float = 1.0) -> dict[str, tuple[float, str]]:
    return {p + unit: (_PREFIXES[p] * factor, si) for p in ("", *prefixes)}


_TURN = 2 * math.pi
_UNITS: dict[str, tuple[float, str]] = {
    **_scaled("m", "m", "nuµμmck"),
    "in": (0.0254, "m"),
    "inch": (0.0254, "m"),
    **_scaled("N", "N", "umkM"),
    "lbf": (4.4482216152605, "N"),
    "kgf": (9.80665, "N"),
    **_scaled("Nm", "N m", "mk"),
    **_scaled("N m", "N m", "mk"),
    **_scaled("N.m", "N m", "mk"),
    **_scaled("rad", "rad", "um"),
    "deg": (math.pi / 180, "rad"),
    "°": (math.pi / 180, "rad"),
    "arcmin": (math.pi / 10_800, "rad"),
    "arcsec": (math.pi / 648_000, "rad"),
    "rev": (_TURN, "rad"),
    "turn": (_TURN, "rad"),
    **_scaled("s", "s", "num"),
    "us": (1e-6, "s"),
    "min": (60.0, "s"),
    "h": (3600.0, "s"),
    **_scaled("g", "kg", "k", 1e-3),
    **_scaled("V", "V", "mk"),
    **_scaled("A", "A", "mk"),
    **_scaled("Hz", "Hz", "kM"),
    "rpm": (_TURN / 60, "rad/s"),
    "g0": (9.80665, "m/s^2"),
    "%": (0.01, ""),
    "": (1.0, ""),
    "1": (1.0, ""),
    "-": (1.0, ""),
}


def si_unit(unit: str) -> tuple[float, str]:
    """Return the factor to SI and the SI unit; ``mm/s``, ``deg/s^2``, ``N/mm`` are understood.

    Raises
    ------
    ValueError
        For an unknown unit; the message lists those known.
    """
    if not isinstance(unit, str):
        raise TypeError(f"a unit must be a string such as 'mm' or 'N'; got {unit!r}.")
    text = unit.strip()
    if text in _UNITS:
        return _UNITS[text]
    top, slash, bottom = text.partition("/")
    base, _, power = bottom.replace("²", "^2").replace("**", "^").partition("^")
    base = base.strip(" ()")
    if slash and top.strip() in _UNITS and base in _UNITS and power.strip() in ("", "2", "3"):
        above, top_si = _UNITS[top.strip()]
        below, base_si = _UNITS[base]
        exponent = int(power or 1)
        return above / below**exponent, f"{top_si or '1'}/{base_si}" + (
            f"^{exponent}" if exponent > 1 else ""
        )
    known = ", ".join(k for k in _UNITS if k and k != "μ")
    raise ValueError(f"a unit must be one of {known}, or one over another (mm/s, deg/s^2); got {unit!r}.")


def to_si(values, unit: str) -> tuple[np.ndarray, str]:
    """Return `values` in SI as floats, and the SI unit."""
    factor, name = si_unit(unit)
    return np.asarray(values, dtype=float) * factor, name
