"""The input that drives a model: in fewer steps, or through a lag that acts on its samples."""

from __future__ import annotations

import math

import numpy as np

from ..data.thresholds import REGULAR
from .thresholds import INPUT_ROUGH, MOST_SAMPLES


def decimated(t, u, factor):
    """Return times and values of a held input in fewer steps, and how to join them: "zoh" or "linear".

    An input that changes seldom is given as it is, at the times when it changes. Of another one it is the
    knots of a broken line whose second integral is that of the input at every knot.

    A mass moved by either passes the same places at the knots: (s[k-1] + 4 s[k] + s[k+1]) T^2/6 equals the
    second difference of the place.
    """
    from scipy.linalg import solve_banded

    changes = np.flatnonzero(np.diff(u) != 0) + 1
    if len(changes) <= len(u) // factor:
        at = np.unique(np.concatenate(([0], changes, [len(u) - 1])))
        return t[at], u[at], "zoh"
    dt = float(t[-1] - t[0]) / (len(t) - 1)
    count = (len(t) - 1) // factor
    knots = np.arange(count + 1) * factor
    speed = np.concatenate(([0.0], np.cumsum(u[:-1]) * dt))
    place = np.concatenate(([0.0], np.cumsum(speed[:-1] * dt + 0.5 * dt * dt * u[:-1])))
    step = dt * factor
    right = np.empty(count + 1)
    # ends: the place after the first interval, and the speed and place over the last one
    right[1:-1] = (place[knots[2:]] - 2 * place[knots[1:-1]] + place[knots[:-2]]) * 6 / step**2
    right[0] = place[knots[1]] * 6 / step**2
    last = place[knots[-1]] - place[knots[-2]]
    right[-1] = (speed[knots[-1]] * step - last) * 6 / step**2
    bands = np.ones((3, count + 1))
    bands[1] = 4.0
    bands[1, 0] = bands[1, -1] = 2.0
    values = solve_banded((1, 1), bands, right)
    time = t[0] + knots * dt
    rest = len(t) - 1 - int(knots[-1])
    if rest:
        time, values = np.append(time, t[-1]), np.append(values, u[-1])
    return time, values, "linear"


def decimable(records, factor: int) -> int:
    """Return how many samples a step of the inputs may take, `factor` at most, so that none is rough."""
    while factor > 1 and any(_rough(r, factor) for r in records):
        factor //= 2
    return factor


def _rough(record, factor: int) -> bool:
    """Whether the input jumps about within steps of a decimated one: its peaks decide what breaks away."""
    u, t = record.u, record.t
    off = np.abs(u - np.interp(t, t[::factor], u[::factor]))
    # single jumps (steps of the force) are no harm: what counts is what most samples do
    return float(np.quantile(off, MOST_SAMPLES)) > INPUT_ROUGH * float(np.std(u))


def lagged(t, u, time_constant):
    """Return the output of a first-order lag at the samples of a held input, started at its steady value."""
    from scipy.signal import lfilter

    steps = np.diff(t)
    if np.ptp(steps) <= 2 * REGULAR * np.mean(steps):
        a = math.exp(-float(np.mean(steps)) / time_constant)
        rest, _ = lfilter([1 - a], [1.0, -a], u[:-1], zi=np.array([a * u[0]]))
        return np.concatenate(([u[0]], rest))
    out = np.array(u, dtype=float)
    for i, step in enumerate(steps):
        a = math.exp(-step / time_constant)
        out[i + 1] = a * out[i] + (1 - a) * u[i]
    return out
