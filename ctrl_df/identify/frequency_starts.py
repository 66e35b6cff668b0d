"""Start values of every effect for a table N(A, omega): a few magnitudes of each parameter, tried in turn."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np

from ..blocks.core import level
from .attach import attach
from .frequency_fit import QUICK, Points, Scales, relative_error, rms, simulate_table

# Multiples of the table's own scale for the parameters of an effect; the others stay at their defaults.
_MULTIPLES: dict[str, dict[str, tuple[float, ...]]] = {
    "input_gain": {"gain": (0.7, 0.9, 1.1, 1.4)},
    "input_saturation": {"level": (0.2, 0.5, 0.9, 1.6)},
    "input_dead_zone": {"threshold": (0.02, 0.1, 0.3)},
    "bristle": {"stiffness": (1.5, 5.0, 15.0, 60.0, 250.0), "damping": (0.1, 0.7)},
    "position_ripple": {"amplitude": (0.05, 0.2), "wavelength": (0.5, 2.0, 8.0)},
    "hard_stop": {"limit": (0.3, 1.0, 2.0), "restitution": (0.5,)},
    "backlash": {"gap": (0.03, 0.1, 0.3, 1.0), "restitution": (0.3,), "load_fraction": (0.3, 0.6)},
    "compliance": {"stiffness": (1.0, 5.0, 25.0, 125.0), "damping": (0.05,), "load_fraction": (0.3, 0.6)},
    "sensor_quantization": {"step": (0.05, 0.3, 1.0)},
}
_USUAL = (0.01, 0.05, 0.2, 0.7)


def proposals(cls, block, scales: Scales) -> list:
    """Return effects of a class at several sizes.

    Parameters
    ----------
    cls : Effect class
    block : Mechanism
        The refitted model: friction levels are proposed relative to its own.
    scales : Scales
        Of the table.
    """
    if cls.id in ("stiction", "stribeck"):
        return _above_kinetic(cls, block, scales)
    given = dict(_MULTIPLES.get(cls.id, {}))
    fields = [f for f in dataclasses.fields(cls) if f.metadata.get("parameter") is not None]
    if not fields:
        return [cls()]
    given.setdefault(fields[0].name, _USUAL)
    for f in fields[1:]:
        if f.name not in given and f.default is dataclasses.MISSING:
            given[f.name] = (0.1, 1.0)
    found = []
    for values in itertools.product(*given.values()):
        sized = {}
        for name, multiple in zip(given, values, strict=True):
            spec = next(f for f in fields if f.name == name).metadata["parameter"]
            size = 1.0 if spec["unit"] == "" else scales.of(spec["unit"])
            if spec["unit"] == "N s/m" and cls.id in ("bristle", "compliance"):
                size = 2 * math.sqrt(scales.mass * scales.of("N/m"))
            sized[name] = multiple * size
        for sign in (1.0, -1.0) if _signed(fields[0]) else (1.0,):
            try:
                found.append(cls(**{**sized, fields[0].name: sign * sized[fields[0].name]}))
            except ValueError:
                continue
    return found


def _signed(field) -> bool:
    return field.metadata["parameter"]["lower"] < 0


def _above_kinetic(cls, block, scales):
    base = [e for e in block.effects if e.role == "friction" and e.side == "motor" and e.rank == 0]
    kinetic = max(level(base, 1.0, 1.0, 0.0), 0.03 * scales.force)
    levels = [kinetic * f for f in (1.1, 1.4, 2.0, 3.0)]
    if cls.id == "stiction":
        return [cls(x) for x in levels]
    return [cls(x, scales.speed * s) for x in levels for s in (0.1, 0.4, 1.5)]


def best_starts(cls, block, points: Points, scales: Scales, keep: int = 3) -> list:
    """Return the blocks grown by the most promising starts, best first."""
    scored = []
    for effect in proposals(cls, block, scales):
        grown = attach(block, effect)
        if grown is None:
            continue
        try:
            left = rms(points.weight * relative_error(simulate_table(grown, points, QUICK), points))
        except (ValueError, ArithmeticError):
            continue
        if np.isfinite(left):
            scored.append((left, len(scored), grown))
    scored.sort(key=lambda s: s[:2])
    return [grown for _, _, grown in scored[:keep]]
