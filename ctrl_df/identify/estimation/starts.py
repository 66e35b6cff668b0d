"""Initial states of one fit as those of another: over other segments, or of another model."""

from __future__ import annotations

import numpy as np

from ..prediction.segments import Segments
from ..prediction.simulator import Simulator
from .fit import FitResult


def begin_alike(found: FitResult, segments) -> bool:
    """Whether all of these segments begin at samples where those of a fit do."""
    return all(np.all(np.isin(n.first, o.first)) for o, n in zip(found.segments, segments, strict=True))


def begun_there(old: Segments, new: Segments) -> tuple[np.ndarray, np.ndarray]:
    """Return which of the new segments begin where an old one does, booleans (nw,), and these old ones."""
    at = np.minimum(np.searchsorted(old.first, new.first), len(old) - 1)
    same = old.first[at] == new.first
    return same, at[same]


def matching_initial_states(found: FitResult, segments) -> list[np.ndarray]:
    """Return initial states from a fit over other segments: theirs where both begin at one sample, else 0."""
    starts = []
    for old, new, states in zip(found.segments, segments, found.starts, strict=True):
        same, at = begun_there(old, new)
        rows = np.zeros((len(new), states.shape[1]))
        rows[same] = states[at]
        starts.append(rows)
    return starts


def better_initial_states(*fits: FitResult) -> list[np.ndarray]:
    """Return the initial states of fits over the same segments: of each segment those that err least."""
    starts = []
    for k, segments in enumerate(fits[0].segments):
        nearest = np.argmin([segments.means(f.residual[k] ** 2) for f in fits], axis=0)
        starts.append(np.array([f.starts[k] for f in fits])[nearest, np.arange(len(nearest))])
    return starts


def continued_states(
    simulator: Simulator, segments: Segments, before: Simulator, starts: np.ndarray
) -> np.ndarray:
    """Return one model's initial states as those of another: what the first lacks begins as usual."""
    given = dict(zip(before.free_states, starts.T, strict=True))
    columns = []
    for name in simulator.free_states:
        usual = np.where(segments.a > 0, 1.0, 0.0) if name == "slack" else np.zeros(len(segments))
        columns.append(given.get(name, usual))
    return np.array(columns).T.reshape(len(segments), len(columns))
