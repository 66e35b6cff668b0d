"""What a run is asked for, in few values: how accurate, what to record, what to stop at, where events go."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Accuracy(NamedTuple):
    """Options of integration; see `ctrl_df.simulate.engine.Engine.run`."""

    order: int
    rtol: float
    atol: float
    max_step: float
    height: float


class Recording(NamedTuple):
    """Where states and outputs are written, and at what times."""

    times: np.ndarray  # (nt,)
    states: np.ndarray  # (nt, nx)
    outputs: np.ndarray  # (nt, ny)


class Watch(NamedTuple):
    """A section: the signal whose passage ends the run (-1: none), its value there, the direction."""

    signal: int
    level: float
    sign: int


NO_WATCH = Watch(-1, 0.0, -1)


class EventLog(NamedTuple):
    """Times, nodes and kinds of events; a run ends where it is full. Of length one: none are kept."""

    time: np.ndarray
    node: np.ndarray
    kind: np.ndarray
