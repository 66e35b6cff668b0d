"""Nodes into the arrays of a program, in an order in which each follows those it reads."""

from __future__ import annotations

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
    s_at = np.cumsum([0] + [n.nout for n in nodes])
    u_at = np.cumsum([0] + [n.nin for n in nodes])
    order = _feed_order(nodes, flat.us, s_at, u_at, flat.names)
    ns, nr = int(s_at[-1]), flat.ur.shape[1]
    widest = max((n.nin for n in nodes), default=1)
    scratch = ns + nr + widest
    header = [
        nx,
        ns,
        nr,
        flat.ys.shape[0],
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
        int(_answers_at_once(flat, order, s_at, u_at)),
    ]
    ints, par, modes = list(header), [], []
    table = np.zeros((len(nodes), 13), np.int64)
    ng = 0

    def rows(from_s, from_r):
        """Append the rows of a block of inputs; returns the position of their pointers."""
        pointers = []
        for weights in np.hstack([from_s, from_r]).tolist():
            pointers.append(len(ints))
            entries = [(index, weight) for index, weight in enumerate(weights) if weight]
            ints.append(len(entries))
            for index, weight in entries:
                ints.extend((index, len(par)))
                par.append(weight)
        ints.extend(pointers)
        return len(ints) - len(pointers)

    for row, i in enumerate(order):
        node = nodes[i]
        inputs = rows(flat.us[u_at[i] : u_at[i + 1]], flat.ur[u_at[i] : u_at[i + 1]])
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
    ints[L.H_OUT] = rows(flat.ys, flat.yr)
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


def _answers_at_once(flat, order, s_at, u_at) -> bool:
    """Whether an output may depend on an external input of the same instant."""
    direct = np.zeros(s_at[-1], bool)
    for i in (i for i in order if flat.nodes[i].feed):
        rows = slice(u_at[i], u_at[i + 1])
        reads = np.any(flat.ur[rows]) or np.any(np.any(flat.us[rows], axis=0) & direct)
        direct[s_at[i] : s_at[i + 1]] = reads
    return bool(np.any(flat.yr) or np.any(np.any(flat.ys, axis=0) & direct))


def _feed_order(nodes, us, s_at, u_at, names) -> list[int]:
    """Order nodes so that each with feedthrough follows those it reads; an algebraic loop is an error."""
    pending, done = list(range(len(nodes))), []
    settled = np.zeros(s_at[-1], bool)
    while pending:
        ready = [
            i
            for i in pending
            if not nodes[i].feed or not np.any((us[u_at[i] : u_at[i + 1]] != 0).any(axis=0) & ~settled)
        ]
        if not ready:
            inside = ", ".join(dict.fromkeys(names[i] for i in pending))
            raise ValueError(
                f"the loop has an algebraic loop (direct feedthrough all the way round) through {inside}. "
                "Give the controller a lag (pid(..., tf=...)) or the plant a state."
            )
        for i in ready:
            settled[s_at[i] : s_at[i + 1]] = True
            pending.remove(i)
            done.append(i)
    return done
