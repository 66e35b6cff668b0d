"""A run in few values: how accurate, what to record, what to stop at, where events go; and all together."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..program.layout import Drive, Program


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


class Task(NamedTuple):
    """All that a run reads, and the arrays it writes to; see `ctrl_df.simulate.kernel.driver.advance`."""

    prog: Program
    drive: Drive
    x: np.ndarray
    mode: np.ndarray
    t_end: float
    recording: Recording
    accuracy: Accuracy
    locate: bool
    stop_at_event: bool
    watched: Watch
    max_steps: int
    log: EventLog
    before: np.ndarray
    scale: np.ndarray
    spectrum: np.ndarray
    omega: float
    at: int  # address of the workspace
    space: Any  # which lies there, a `Space`
