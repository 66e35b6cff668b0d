"""What the maps over gains may be asked: two gains as ranges, the third a number."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..blocks.mechanism import Mechanism
from ..checks import is_number, number, real_array, shown
from ..df.dispatch import translated
from ..units import over
from .controller import GAINS
from .thresholds import OFF


@dataclass(frozen=True, eq=False)
class Box:
    """Two gains over ranges, the third fixed.

    Attributes
    ----------
    free : (str, str)
        Names of the two gains.
    fixed : dict
        Name and value of the third.
    axes : (ndarray, ndarray)
        Values of the two, ascending.
    """

    free: tuple[str, str]
    fixed: dict[str, float]
    axes: tuple[np.ndarray, np.ndarray]

    @property
    def _both(self):
        return tuple(zip(self.free, self.axes, strict=True))

    @property
    def ranges(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """(low, high) of both."""
        x, y = self.axes
        return (float(x[0]), float(x[-1])), (float(y[0]), float(y[-1]))

    def every(self, x, y) -> dict[str, Any]:
        """All three gains, by name, where the free ones are x and y."""
        given = {**self.fixed, self.free[0]: x, self.free[1]: y}
        return {name: given[name] for name in GAINS}

    def to_unit(self, x, y) -> np.ndarray:
        """Place in the unit square, shape (..., 2)."""
        scaled = ((v - low) / (high - low) for v, (low, high) in zip((x, y), self.ranges, strict=True))
        return np.stack(np.broadcast_arrays(*scaled), axis=-1)

    def from_unit(self, unit) -> tuple[np.ndarray, np.ndarray]:
        """Free gains at places of the unit square (..., 2)."""
        (x0, x1), (y0, y1) = self.ranges
        return x0 + unit[..., 0] * (x1 - x0), y0 + unit[..., 1] * (y1 - y0)

    def side(self, poles, gains) -> np.ndarray:
        """Return on which side of the lines gains lie that `Border` knows of, given the poles to the right.

        0 and 1 are stable and unstable in the large; -1 is the rim without integral action, where the loop is
        of lower order than with ever so little of it.
        """
        rim = np.equal(gains["ki"], 0) & ("ki" in self.free)
        return np.where(rim, -1, np.greater(poles, 0))

    def off_the_rim(self, unit) -> np.ndarray:
        """Return points of the unit square (n, 2), moved away from the rim without integral action."""
        away = np.array([name == "ki" and axis[0] == 0 for name, axis in self._both])
        return np.where(away, np.maximum(unit, OFF), unit)

    def rim(self) -> np.ndarray:
        """Return the ends of that rim, in the unit square, (2, 2), or no point."""
        ends = np.array([[0.0, 0.0], [0.0, 1.0] if self.free[0] == "ki" else [1.0, 0.0]])
        return ends if any(name == "ki" and axis[0] == 0 for name, axis in self._both) else ends[:0]

    def corners(self) -> list[dict[str, float]]:
        """All gains at the corners of the box, in the middles of its sides and in its middle."""
        steps = np.array([0.0, 0.5, 1.0])
        places = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
        return [self.every(float(x), float(y)) for x, y in zip(*self.from_unit(places), strict=True)]


def box_of(owner: str, given: dict[str, Any], points: int) -> Box:
    """Tell the two free gains from the fixed one.

    Parameters
    ----------
    owner : str
        Who asks, for errors.
    given : dict
        kp, ki, kd: a number, a range (low, high), or an array of values.
    points : int
        Values of a range.
    """
    fixed = {name: number(owner, name, v) for name, v in given.items() if is_number(v)}
    free = tuple(name for name in GAINS if name not in fixed)
    if len(free) != 2:
        raise ValueError(
            f"{owner} needs two of kp, ki, kd as ranges (low, high) or arrays and the third as a number; got "
            f"{len(free)} ranges: {', '.join(f'{k}={shown(v)}' for k, v in given.items())}."
        )
    first, second = (_axis(owner, name, given[name], points) for name in free)
    return Box(free, fixed, (first, second))


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
            f"{owner} needs {name} as (low, high) with 0 < low < high [{unit or 1}]; got {shown(value)}. "
            "Leave it out to have it chosen."
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
