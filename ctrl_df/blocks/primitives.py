"""The few elementary signal elements that channel effects and memoryless blocks are made of.

Each is plain data. The event engine knows how to run them exactly; `value` evaluates the static ones
for an ordinary ODE solver.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class PiecewiseAffine:
    """Regions of straight lines, with located corners; regions may overlap (hysteresis).

    Region i holds while ``low[i] <= u <= high[i]``; there ``y = intercept[i] + slope[i] u``. Leaving it
    below leads to region ``below[i]``, above to ``above[i]``.
    """

    low: tuple[float, ...]
    high: tuple[float, ...]
    slope: tuple[float, ...]
    intercept: tuple[float, ...]
    below: tuple[int, ...] = ()
    above: tuple[int, ...] = ()

    def __post_init__(self):
        n = len(self.slope)
        if not self.below:
            object.__setattr__(self, "below", tuple(max(i - 1, 0) for i in range(n)))
        if not self.above:
            object.__setattr__(self, "above", tuple(min(i + 1, n - 1) for i in range(n)))

    @classmethod
    def from_corners(cls, corners, slopes, intercepts) -> PiecewiseAffine:
        """Build adjoining regions between ascending `corners` (n corners, n + 1 lines)."""
        inner, slopes, intercepts = (tuple(1.0 * v for v in line) for line in (corners, slopes, intercepts))
        return cls((-math.inf, *inner), (*inner, math.inf), slopes, intercepts)

    @property
    def hysteretic(self) -> bool:
        """Whether the output depends on which region the input came from."""
        return any(self.low[i + 1] < self.high[i] for i in range(len(self.low) - 1))

    @property
    def corners(self) -> tuple[float, ...]:
        """Input values where the line changes."""
        return tuple(sorted({c for c in (*self.low, *self.high) if math.isfinite(c)}))

    def region(self, u: float, start: int | None = None) -> int:
        """Return the region that holds `u`, walking from region `start` (default: the one nearest u = 0)."""
        i = self.start if start is None else start
        for _ in range(len(self.low) + 1):
            if u > self.high[i]:
                i = self.above[i]
            elif u < self.low[i]:
                i = self.below[i]
            else:
                break
        return i

    @property
    def start(self) -> int:
        """The region a rest start (u = 0) begins in."""
        holding = [i for i in range(len(self.low)) if self.low[i] <= 0 <= self.high[i]]
        return holding[len(holding) // 2] if holding else 0

    def value(self, u):
        """Evaluate elementwise, without memory (at a jump: the mean of both sides)."""
        u = np.asarray(u, dtype=float)
        y = np.zeros_like(u)
        count = np.zeros_like(u)
        for low, high, slope, intercept in zip(self.low, self.high, self.slope, self.intercept, strict=True):
            inside = (u >= low) & (u <= high)
            y = np.where(inside, y + intercept + slope * u, y)
            count = count + inside
        return y / np.maximum(count, 1)


@dataclass(frozen=True)
class Quantizer:
    """Round to the nearest multiple of `step`."""

    step: float

    def value(self, u):
        """Evaluate elementwise."""
        return self.step * np.round(np.asarray(u, dtype=float) / self.step)


@dataclass(frozen=True)
class Smooth:
    """A continuous static law ``law(u, p) -> y`` with parameters `p`."""

    law: Callable
    p: tuple[float, ...] = ()

    def value(self, u):
        """Evaluate elementwise."""
        u = np.asarray(u, dtype=float)
        return np.array([self.law(float(v), self.p) for v in u.ravel()]).reshape(u.shape)


@dataclass(frozen=True)
class Lag:
    """First-order lag ``T dy/dt = u - y``."""

    time_constant: float


@dataclass(frozen=True)
class Delay:
    """Pure time delay ``y(t) = u(t - delay)``."""

    delay: float


@dataclass(frozen=True)
class Ramp:
    """A signal added to the channel: ``y = u + offset + rate t``."""

    offset: float
    rate: float = 0.0


@dataclass(frozen=True)
class Play:
    """Friction-driven backlash: the output waits until the gap (total width) is taken up."""

    gap: float


@dataclass(frozen=True)
class RateLimiter:
    """The output follows the input, but never faster than `rate` [unit/s]."""

    rate: float


Primitive = PiecewiseAffine | Quantizer | Smooth | Lag | Delay | Ramp | Play | RateLimiter
