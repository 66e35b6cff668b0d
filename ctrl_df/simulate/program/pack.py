"""Nodes into the arrays of a program, in an order in which each follows those it reads."""

from __future__ import annotations

from itertools import accumulate, chain, pairwise
from typing import TYPE_CHECKING

import numpy as np

from ...values.column import spread
from ..thresholds import WIDEST_AFFINE, WIDEST_CURVED
from . import layout as L
from .layout import Program

if TYPE_CHECKING:
    from .flatten import Flat


def pack(flat: Flat, nx: int) -> tuple[Program, np.ndarray, np.ndarray, list[str]]:
    """Order the nodes by feedthrough, lay all out in arrays.

    Parameters
    ----------
    flat : Flat
        Its numbers may be columns, one number for each of many systems that differ in numbers only.
    nx : int
        States of the system.

    Returns
    -------
    program : Program
        Of the first of these systems.
    par : (systems, npar) array
        The packed parameters of each; one row without columns.
    modes : (nm,) array
        Modes to begin with.
    names : list of str
        Of the nodes.
    """
    nodes = flat.nodes
    # lists: there are few numbers, and arrays take longer over each
    us, ur, ys, yr = (matrix.tolist() for matrix in (flat.us, flat.ur, flat.ys, flat.yr))
    s_at = [0, *accumulate(n.nout for n in nodes)]
    u_at = [0, *accumulate(n.nin for n in nodes)]
    reads = [_nonzero(us[i:j]) for i, j in pairwise(u_at)]  # signals that each node reads
    order = _feed_order(nodes, reads, s_at, flat.names)
    driven = [any(map(any, ur[i:j])) for i, j in pairwise(u_at)]
    ns, nr = s_at[-1], flat.ur.shape[1]
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
    ints, par, modes = list(header), [], []
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
        par.extend(node.par)
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
    ints[L.H_BUMP] = int(
        any(n.kind == L.MECHANISM and min(n.par[L.P_BUMP0 : L.P_BUMP1 + 1]) < np.inf for n in nodes)
    )
    numbers = spread(par)
    program = Program(table, np.array(ints, np.int64), numbers[0].copy())
    return program, numbers, np.array(modes, np.int64), [flat.names[i] for i in order]


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


def _feed_order(nodes, reads, s_at, names) -> list[int]:
    """Order nodes so that each with feedthrough follows those it reads; an algebraic loop is an error."""
    pending, done = list(range(len(nodes))), []
    settled: set[int] = set()
    while pending:
        ready = [i for i in pending if not nodes[i].feed or reads[i] <= settled]
        if not ready:
            inside = ", ".join(dict.fromkeys(names[i] for i in pending))
            raise ValueError(
                f"the loop has an algebraic loop (direct feedthrough all the way round) through {inside}. "
                "Give the controller a lag (pid(..., tf=...)) or the plant a state."
            )
        for i in ready:
            settled.update(range(s_at[i], s_at[i + 1]))
            pending.remove(i)
            done.append(i)
    return done
