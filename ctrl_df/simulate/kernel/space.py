"""What a run works in: made once, and handed to compiled code by its address."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np

from ..compiler.packed import Layout, address_of
from ..program.layout import (
    CURVED,
    F_ASKED,
    F_SIZE,
    H_AFFINE,
    H_DELAYS,
    H_HISTORY,
    H_NG,
    H_NX,
    H_NY,
    NG,
    STRAIGHT,
    Y_SIZE,
    G,
)
from ..thresholds import TERMS
from .affine import Memory, memory
from .exponential import Bend, bend_memory
from .propagators import Propagators, propagator_memory
from .run.kept import KEPT
from .stepper import STAGES

_NONE = np.zeros(0, np.int64)
_KINDS = 8  # of programs whose spaces are kept, some megabytes each
_idle: dict[tuple[bytes, ...], list[Space]] = {}
LAYOUT = Layout()
space_at = LAYOUT.opener()
"""A `Space` from its address, in compiled code."""


class Space(NamedTuple):
    """Scratch arrays of a run; see `workspace`."""

    work: tuple  # signals, inputs and the history of delays; forces; a state
    k: np.ndarray  # rates of the stages of a step
    poly: np.ndarray  # interpolant
    x1: np.ndarray  # states
    xi: np.ndarray
    dx: np.ndarray
    size: np.ndarray  # running size of each state
    rounding: np.ndarray  # see `rate_rounding`
    g: np.ndarray  # margins
    g0: np.ndarray
    gtol: np.ndarray
    lowest: np.ndarray
    norm: np.ndarray
    owner: np.ndarray  # node of each margin
    memo: np.ndarray  # what a run keeps from call to call, and whether the next one goes on with it
    store: Memory
    tracks: Propagators
    bend: Bend
    paced: np.ndarray  # (1,): address of the steps at a pace, see `pace`; 0: none are taken
    led: np.ndarray  # where the last of these led: time, segment, next output, next tick; ticked, costly
    words: np.ndarray  # all these, laid out
    at: int  # and where


@contextmanager
def pooled_space(prog, kind: tuple[bytes, ...]) -> Iterator[Space]:
    """Take a space from the pool for programs of a kind: for a thread that begins every run in it afresh."""
    try:
        space = _idle[kind].pop()
    except LookupError:
        space = workspace(prog, delays=True)
    yield space
    if len(_idle) >= _KINDS and kind not in _idle:
        _idle.clear()
    _idle.setdefault(kind, []).append(space)


def workspace(prog, delays: bool = False):
    """Scratch arrays of a run, made once: compiled code that counts no references needs memory from outside.

    With `delays` the work vector also holds the history of pure delays, part of the state of the program. Who
    moves states about without it cannot treat such a program.
    """
    n, ng = int(prog.ints[H_NX]), int(prog.ints[H_NG])
    past = int(prog.ints[H_DELAYS]) * Y_SIZE
    if past and not delays:
        raise ValueError(
            "exact orbits need a state of finitely many numbers; this system has a pure delay inside, whose "
            "state is a whole history. Find its motion by simulation (event_response), or put a lag of the "
            "same time (input_lag) in its place."
        )
    work = (np.zeros(int(prog.ints[H_HISTORY]) + past), np.zeros(F_SIZE), np.zeros(max(n, 4) + 2))
    work[1][F_ASKED] = STRAIGHT | CURVED
    owner = np.zeros(ng + 1, np.int64)
    for node in range(prog.nodes.shape[0]):
        owner[prog.nodes[node, G] : prog.nodes[node, G] + prog.nodes[node, NG]] = node
    g, g0, gtol, lowest, norm = (np.zeros(ng + 1) for _ in range(5))
    x1, xi, dx, size, rounding = (np.zeros(n) for _ in range(5))
    store = memory(prog)
    space = Space(
        work, np.zeros((STAGES, n)), np.zeros((TERMS, n)), x1, xi, dx, size, rounding, g, g0, gtol, lowest,
        norm, owner, np.zeros(KEPT), store,
        propagator_memory(store, bool(prog.ints[H_AFFINE]), int(prog.ints[H_NY])), bend_memory(store),
        np.zeros(1, np.int64), np.zeros(6), _NONE, 0,
    )  # fmt: skip
    words = LAYOUT.pack(space)
    return space._replace(words=words, at=address_of(words))
