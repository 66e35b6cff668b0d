"""Nodes into the arrays of a program, in an order in which each follows those it reads."""

from __future__ import annotations

import functools
from itertools import accumulate, chain, pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...values.column import spread
from ..thresholds import WIDEST_AFFINE, WIDEST_CURVED
from . import layout as L

if TYPE_CHECKING:
    from .flatten import Flat
    from .nodes import Node


class Layout(NamedTuple):
    """Where everything of a system stands in its arrays: the same for all that differ in numbers alone.

    Attributes
    ----------
    nodes, ints : array
        Those of a `Program`; nobody writes to them.
    weights : list of float
        Its parameters: weights of the connections, zeros where those of the nodes go.
    order, places : list of int
        Which node comes when, and where its parameters go.
    modes : (nm,) array
        Modes to begin with.
    kind : tuple of bytes
        What such systems have in common, for those who group them.
    """

    nodes: np.ndarray
    ints: np.ndarray
    weights: list[float]
    order: list[int]
    places: list[int]
    modes: np.ndarray
    kind: tuple[bytes, bytes, bytes]


class _Structure(NamedTuple):
    """A node without the values of its parameters."""

    kind: int
    nin: int
    nout: int
    x: int
    nx: int
    npar: int
    ng: int
    feed: int
    affine: bool
    narrow: bool  # friction with a narrow feature over speed
    laws: tuple[tuple[int, int, int, int, int], ...]
    aux: tuple[int, ...]
    start: tuple[int, ...]


def pack(flat: Flat, nx: int) -> tuple[Layout, np.ndarray]:
    """Order the nodes by feedthrough, lay all out in arrays.

    Parameters
    ----------
    flat : Flat
        Its numbers may be columns, one number for each of many systems that differ in numbers only.
    nx : int
        States of the system.

    Returns
    -------
    layout : Layout
        The same object for systems that differ in numbers alone, while it is remembered.
    par : (systems, npar) array
        The packed parameters of each; one row without columns.
    """
    maps = tuple((m.shape, tuple(m.ravel().tolist())) for m in (flat.us, flat.ur, flat.ys, flat.yr))
    try:
        layout = _layout(nx, maps, tuple(map(_structure, flat.nodes)))
    except _AlgebraicLoop as loop:
        inside = ", ".join(dict.fromkeys(flat.names[i] for i in loop.nodes))
        raise ValueError(
            f"the loop has an algebraic loop (direct feedthrough all the way round) through {inside}. "
            "Give the controller a lag (pid(..., tf=...)) or the plant a state."
        ) from None
    par = layout.weights.copy()
    for i, at in zip(layout.order, layout.places, strict=True):
        numbers = flat.nodes[i].par
        par[at : at + len(numbers)] = numbers
    return layout, spread(par)


def _structure(node: Node) -> _Structure:
    narrow = node.kind == L.MECHANISM and min(node.par[L.P_BUMP0 : L.P_BUMP1 + 1]) < np.inf
    return _Structure(
        node.kind, node.nin, node.nout, node.x, node.nx, len(node.par), node.ng, node.feed, node.affine,
        narrow, tuple(node.laws), tuple(node.aux), tuple(node.start),
    )  # fmt: skip


@functools.lru_cache(maxsize=256)
def _layout(nx: int, maps, nodes: tuple[_Structure, ...]) -> Layout:
    """Lay a system out; `maps`: shape and values of the maps of a `Flat`."""
    # lists: there are few numbers, and arrays take longer over each
    us, ur, ys, yr = ([list(v[i * n : (i + 1) * n]) for i in range(m)] for (m, n), v in maps)
    s_at = [0, *accumulate(n.nout for n in nodes)]
    u_at = [0, *accumulate(n.nin for n in nodes)]
    reads = [_nonzero(us[i:j]) for i, j in pairwise(u_at)]  # signals that each node reads
    order = _feed_order(nodes, reads, s_at)
    driven = [any(map(any, ur[i:j])) for i, j in pairwise(u_at)]
    ns, nr = s_at[-1], maps[1][0][1]
    widest = max((n.nin for n in nodes), default=1)
    scratch = ns + nr + widest
    header = [
        nx,
        ns,
        nr,
        len(ys),
        0,
        0,
        widest,
        0,
        0,
        ns + nr,
        scratch,
        0,
        0,
        0,
        scratch + nx + ns + 4,
        int(any(map(any, yr)) or bool(_nonzero(ys) & _direct(nodes, order, reads, driven, s_at))),
    ]
    ints, par, modes, places = list(header), [], [], []
    table = np.zeros((len(nodes), 13), np.int64)
    ng = 0

    def rows(from_s, from_r):
        """Append the rows of a block of inputs; returns the position of their pointers."""
        pointers = []
        for of_signals, of_inputs in zip(from_s, from_r, strict=True):
            pointers.append(len(ints))
            entries = [(i, weight) for i, weight in enumerate(chain(of_signals, of_inputs)) if weight]
            ints.append(len(entries))
            for index, weight in entries:
                ints.extend((index, len(par)))
                par.append(weight)
        ints.extend(pointers)
        return len(ints) - len(pointers)

    for row, i in enumerate(order):
        node = nodes[i]
        inputs = rows(us[u_at[i] : u_at[i + 1]], ur[u_at[i] : u_at[i + 1]])
        laws = len(ints)
        for law_address, offset, state, body, sort in node.laws:
            ints.extend((law_address, len(par) + offset, state, body, sort))
        aux = list(node.aux)
        if node.kind == L.MECHANISM:
            aux[L.A_LAWS] = laws
        elif node.kind == L.DELAY:
            aux[0] = header[L.H_HISTORY] + ints[L.H_DELAYS] * L.Y_SIZE
            ints[L.H_DELAYS] += 1
        table[row] = [
            node.kind, node.nin, node.nout, inputs, s_at[i], node.x, node.nx, len(par), len(modes), ng,
            node.ng, len(ints) if aux else laws, node.feed,
        ]  # fmt: skip
        ints.extend(aux)
        places.append(len(par))
        par.extend([0.0] * node.npar)
        modes.extend(node.start)
        ng += node.ng
    ints[L.H_OUT] = rows(ys, yr)
    ints[L.H_NM], ints[L.H_NG] = len(modes), ng
    ints[L.H_TRACK] = int(any(n.kind in (L.PLAY, L.RATE) for n in nodes))
    kinds = [n.kind for n in nodes]
    curved = [n.kind for n in nodes if not n.affine]
    if kinds.count(L.MECHANISM) <= 1 and not curved and nx <= WIDEST_AFFINE:
        ints[L.H_AFFINE] = 1
    elif (
        curved == [L.MECHANISM] == [k for k in kinds if k == L.MECHANISM]
        and nx <= WIDEST_CURVED
        and not any(n.kind == L.MECHANISM and n.aux[L.A_ASKING] for n in nodes)
    ):
        ints[L.H_AFFINE] = 2
    ints[L.H_BUMP] = int(any(n.narrow for n in nodes))
    numbers, begin = np.array(ints, np.int64), np.array(modes, np.int64)
    kind = table.tobytes(), numbers.tobytes(), begin.tobytes()
    return Layout(table, numbers, par, order, places, begin, kind)


def _nonzero(rows) -> set[int]:
    """Return the columns in which some row is not zero."""
    return {j for row in rows for j, weight in enumerate(row) if weight}


def _direct(nodes, order, reads, driven, s_at) -> set[int]:
    """Return the signals that may depend on an external input of the same instant."""
    direct: set[int] = set()
    for i in order:
        if nodes[i].feed and (driven[i] or reads[i] & direct):
            direct.update(range(s_at[i], s_at[i + 1]))
    return direct


def _feed_order(nodes, reads, s_at) -> list[int]:
    """Order nodes so that each with feedthrough follows those it reads."""
    pending, done = list(range(len(nodes))), []
    settled: set[int] = set()
    while pending:
        ready = [i for i in pending if not nodes[i].feed or reads[i] <= settled]
        if not ready:
            raise _AlgebraicLoop(pending)
        for i in ready:
            settled.update(range(s_at[i], s_at[i + 1]))
            pending.remove(i)
            done.append(i)
    return done


class _AlgebraicLoop(ValueError):  # noqa: N818 - `pack` says what it is
    """Nodes that all wait for each other."""

    def __init__(self, nodes: list[int]):
        super().__init__("the loop has an algebraic loop")
        self.nodes = nodes
