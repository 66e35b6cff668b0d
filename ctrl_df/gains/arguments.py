"""What the maps over gains may be asked: two gains as ranges, the third a number."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..blocks.mechanism import Mechanism
from ..checks import is_number, number, real_array, shown
from ..df.dispatch import translated
from ..units import over
from .controller import GAINS


def free_gains(owner: str, given: dict[str, Any], points: int) -> tuple[tuple[str, str], dict, tuple]:
    """Tell the two free gains from the fixed one.

    Parameters
    ----------
    owner : str
        Who asks, for errors.
    given : dict
        kp, ki, kd: a number, a range (low, high), or an array of values.
    points : int
        Values of a range.

    Returns
    -------
    free : (str, str)
    fixed : dict
    axes : (ndarray, ndarray)
    """
    fixed = {name: number(owner, name, v) for name, v in given.items() if is_number(v)}
    free = tuple(name for name in GAINS if name not in fixed)
    if len(free) != 2:
        raise ValueError(
            f"{owner} needs two of kp, ki, kd as ranges (low, high) or arrays and the third as a number; got "
            f"{len(free)} ranges: {', '.join(f'{k}={shown(v)}' for k, v in given.items())}."
        )
    return free, fixed, tuple(_axis(owner, name, given[name], points) for name in free)


def _axis(owner, name, value, points) -> np.ndarray:
    values = real_array(owner, name, value)
    if values.shape == (2,):
        low, high = values
        values = np.linspace(low, high, points)
    if values.ndim != 1 or values.size < 2 or not (np.diff(values) > 0).all():
        raise ValueError(
            f"{owner} needs {name} as a range (low, high) or an ascending array of at least two values; got "
            f"{shown(value)}."
        )
    return values


def bounds(owner: str, name: str, value, unit: str) -> tuple[float, float] | None:
    """Return a range (low, high) of positive numbers, or None."""
    if value is None:
        return None
    values = real_array(owner, name, value, unit)
    if values.shape != (2,) or not 0 < values[0] < values[1]:
        raise ValueError(
            f"{owner} needs {name} as (low, high) with 0 < low < high [{unit or 1}]; got {shown(value)}. Leave it "
            "out to have it chosen."
        )
    return float(values[0]), float(values[1])


def gain_units(block, output=None) -> dict[str, str]:
    """Units of kp, ki, kd, empty for a block that tells none."""
    block = translated(block)
    if not isinstance(block, Mechanism):
        return dict.fromkeys(GAINS, "")
    signals = block.signals
    force, motion = signals[block.input_labels[0]], signals[output or block.output_labels[0]]
    return {"kp": over(force, motion), "ki": over(force, f"{motion} s"), "kd": over(f"{force} s", motion)}
