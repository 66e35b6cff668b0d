"""Reversals of a recorded motion, the time since the last one, and the strokes between them."""

from __future__ import annotations

import math

import numpy as np


def reversals(velocity, threshold) -> np.ndarray:
    """Return the samples where the velocity changes sign for good, that is, goes on to pass `threshold`."""
    v = np.asarray(velocity, float)
    state = np.where(v > threshold, 1, np.where(v < -threshold, -1, 0))
    moving = np.flatnonzero(state)
    change = np.flatnonzero(state[moving[1:]] != state[moving[:-1]])
    turns = []
    for before, after in zip(moving[change], moving[change + 1], strict=True):
        crossing = np.flatnonzero(v[before : after + 1] * state[after] > 0)
        turns.append(before + int(crossing[0]))
    return np.array(turns, dtype=int)


def time_since(t, events) -> np.ndarray:
    """Return the time since the last event [s]; infinite before the first."""
    t = np.asarray(t, float)
    last = np.searchsorted(np.asarray(events), np.arange(len(t)), "right") - 1
    return np.where(last >= 0, t - t[np.asarray(events)[np.maximum(last, 0)]], math.inf)


def half_stroke(position, turns) -> np.ndarray:
    """Return, for every sample, half the stroke (between two reversals) it belongs to."""
    x = np.asarray(position, float)
    edges = np.concatenate(([0], turns, [len(x)]))
    half = np.empty(len(x))
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        half[a:b] = 0.5 * np.ptp(x[a:b]) if b > a else 0.0
    return half
