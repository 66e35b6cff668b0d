"""Forces of no particular law along a motion: what a curve is over, and what it is in proportion to.

A shape is a function of a motion (arrays of its time, place, speed, acceleration and load by name, and the
rms of each) that returns a force of order one at every sample.
"""

from __future__ import annotations

import math

import numpy as np

from ...thresholds import NOTHING
from ..thresholds import SLOWLY


def grid(values, tail, count):
    """Return the middles of so many bumps over the values, but for their tails, and the step between them."""
    low, high = np.quantile(values, (tail, 1 - tail))
    middles = np.linspace(low, high, count)
    return middles, float(middles[1] - middles[0])


def bump(name, middle, width):
    """Return a triangular bump over a quantity."""
    return lambda m: np.clip(1 - np.abs(m[name] - middle) / width, 0, None)


def within(values, low, high) -> tuple[float, float]:
    """Return the part of a span that the values recorded reach."""
    return float(max(low, np.min(values))), float(min(high, np.max(values)))


def times(first, second):
    """Return the product of two shapes."""
    return lambda m: first(m) * second(m)


def one(m):
    """Return what leaves a curve as it is."""
    return 1.0


def direction(m):
    """Return the direction of motion, as dry friction has it."""
    slow = SLOWLY * size(m["v"][m["inside"]]) + NOTHING  # slow in this record
    return np.tanh(m["v"] / slow)


def speed(m):
    """Return the velocity, as a damper has it."""
    return m["v"] / (rms(m, "v") + NOTHING)


def drive(m):
    """Return the force of the drive, as an error of its gain has it."""
    return m["u"] / (rms(m, "u") + NOTHING)


def acceleration(m):
    """Return the acceleration, as an inertia has it."""
    return m["a"] / (rms(m, "a") + NOTHING)


HOW = {
    one: "", direction: ", with the direction of motion", speed: ", in proportion to the velocity",
    drive: ", in proportion to the drive", acceleration: ", in proportion to the acceleration",
}  # fmt: skip
"""What a curve is multiplied by, in words: friction, a damper, a motor or an inertia that varies over it."""


def size(values) -> float:
    """Return the rms of values."""
    return float(np.sqrt(np.mean(values**2)))


def rms(m, name):
    """Return the rms of a quantity of the motion, over all records fitted."""
    return m["rms"][name]


def since(length):
    """Return the force that decays over the travel since the last reversal."""

    def shape(m):
        sense, x = np.sign(m["v"]), m["x"]
        turn = np.flatnonzero(np.diff(sense) != 0) + 1
        last = np.zeros(len(x), int)
        last[turn] = turn
        last = np.maximum.accumulate(last)
        return sense * np.exp(-np.abs(x - x[last]) / length)

    return shape


def relaxing(seconds):
    """Return the force of a spring and a damper in series, whose time constant that is."""

    def shape(m):
        from scipy.signal import lfilter

        x = m["x"] - m["x"][0]
        kept = math.exp(-float(np.median(np.diff(m["t"]))) / seconds)
        return np.asarray(lfilter([kept, -kept], [1.0, -kept], x)) / (rms(m, "x") + NOTHING)

    return shape


def wave(frequency, function):
    """Return a sine, or a cosine, over time."""
    return lambda m: function(2 * math.pi * frequency * m["t"])
