"""From python-control systems to a list of nodes: interconnections and channels of blocks become one."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import control as ct
import numpy as np
from scipy.linalg import block_diag

from ...blocks.core import Core
from ...blocks.massless import Massless
from ...blocks.mechanism import Mechanism
from ...thresholds import ROUNDED
from . import layout as L
from .nodes import Node, core_node, lti_node, primitive_node, sampled_node, user_node
from .parameters import own_parameters, with_values


@dataclass
class Flat:
    """Nodes with the linear maps around them: u = Us s + Ur r, y = Ys s + Yr r."""

    nodes: list[Node]
    us: np.ndarray
    ur: np.ndarray
    ys: np.ndarray
    yr: np.ndarray
    names: list[str]
    keep: list = field(default_factory=list)


def flatten(system, values: Mapping[str, Any] | None = None) -> Flat:
    """Turn a system (a block, an LTI system, or any interconnection of them) into nodes.

    Parameters
    ----------
    system : block, its core, LTI system or interconnection
    values : mapping
        Parameters that differ from those of the blocks, as `parameters` has checked them;
        each block takes those it knows. A `Column` in the place of a number stands for many systems at once.
    """
    return _fold_gains(_flatten(system, 0, values or {}))


def _flatten(system, x0: int, values) -> Flat:
    if isinstance(system, ct.InterconnectedSystem):
        return _interconnection(system, x0, values)
    name = str(getattr(system, "name", ""))
    system = with_values(system, values)
    if isinstance(system, Massless):
        raise TypeError(
            "event_response and loops drive blocks by forces; got a Massless, on which a motion is imposed. "
            "Use imposed_response, or give the block a mass."
        )
    if isinstance(system, Mechanism):
        return _core(system.core, x0, name)
    if isinstance(system, Core):
        return _core(system, x0, name)
    sampled = getattr(system, "sampled", None)
    if sampled is not None:
        return _single(sampled_node(sampled, x0), name)
    primitive = getattr(system, "primitive", None)
    if primitive is not None:
        return _single(primitive_node(primitive, x0, bool(system.nstates)), name)
    if isinstance(system, ct.StateSpace | ct.TransferFunction):
        return _single(lti_node(system, x0), name)
    if isinstance(system, ct.NonlinearIOSystem):
        node, keep = user_node(system, x0)
        flat = _single(node, name)
        flat.keep.append(keep)
        return flat
    raise TypeError(
        "event_response needs a block, an LTI system or an interconnection of them; "
        f"got {type(system).__name__}. "
        "Wrap a frequency response in a fitted transfer function first."
    )


def _single(node: Node, name: str) -> Flat:
    nin, nout = node.nin, node.nout
    return Flat([node], np.zeros((nin, nout)), np.eye(nin), np.eye(nout), np.zeros((nout, nin)), [name])


def _interconnection(system: ct.InterconnectedSystem, x0: int, values) -> Flat:
    parts = []
    for sub in system.syslist:
        mine = {name: values[name] for name in own_parameters(sub) if name in values} if values else {}
        parts.append(_flatten(sub, x0, mine))
        x0 += sub.nstates or 0
    # stack the parts, then close the connections
    ys, yr = _stack([p.ys for p in parts]), _stack([p.yr for p in parts])
    us, ur = _stack([p.us for p in parts]), _stack([p.ur for p in parts])
    c, i = np.asarray(system.connect_map, float), np.asarray(system.input_map, float)
    loop = np.eye(c.shape[0]) - c @ yr
    if abs(np.linalg.det(loop)) < ROUNDED:
        raise ValueError(
            "the interconnection wires inputs straight to themselves; break that loop with a system."
        )
    inner_s = np.linalg.solve(loop, c @ ys)  # inputs of the parts from signals
    inner_r = np.linalg.solve(loop, i)
    out = np.asarray(system.output_map, float)
    out_y, out_u = out[:, : c.shape[1]], out[:, c.shape[1] :]
    return Flat(
        [n for p in parts for n in p.nodes],
        us + ur @ inner_s,
        ur @ inner_r,
        out_y @ (ys + yr @ inner_s) + out_u @ inner_s,
        out_y @ yr @ inner_r + out_u @ inner_r,
        [f"{system.name}.{name}" if "." not in name else name for p in parts for name in p.names],
        [k for p in parts for k in p.keep],
    )


def _fold_gains(flat: Flat) -> Flat:
    """Take pure gains (summing junctions, LTI systems without states) out of the list into the maps."""
    gain = [n.kind == L.LTI and n.nx == 0 for n in flat.nodes]
    if not any(gain) or all(gain):
        return flat
    s_gain: Any = np.repeat(gain, [n.nout for n in flat.nodes])
    u_gain: Any = np.repeat(gain, [n.nin for n in flat.nodes])
    d = _stack([np.reshape(n.par, (n.nout, n.nin)) for n, g in zip(flat.nodes, gain, strict=True) if g])
    # s_gain = d (us s + ur r), solved for the gains' outputs
    loop = np.eye(d.shape[0]) - d @ flat.us[np.ix_(u_gain, s_gain)]
    if abs(np.linalg.det(loop)) < ROUNDED:
        raise ValueError("the gains of the interconnection form a loop of gain one; break it with a system.")
    from_s = np.linalg.solve(loop, d @ flat.us[np.ix_(u_gain, ~s_gain)])
    from_r = np.linalg.solve(loop, d @ flat.ur[u_gain])

    def fold(m_s, m_r):
        return m_s[:, ~s_gain] + m_s[:, s_gain] @ from_s, m_r + m_s[:, s_gain] @ from_r

    us, ur = fold(flat.us[~u_gain], flat.ur[~u_gain])
    ys, yr = fold(flat.ys, flat.yr)
    kept = [i for i, is_gain in enumerate(gain) if not is_gain]
    return Flat([flat.nodes[i] for i in kept], us, ur, ys, yr, [flat.names[i] for i in kept], flat.keep)


def _stack(matrices):
    # scipy's block_diag drops the shape of empty blocks of older versions; keep rows and columns apart
    rows, cols = sum(m.shape[0] for m in matrices), sum(m.shape[1] for m in matrices)
    return np.asarray(block_diag(*matrices)).reshape(rows, cols) if rows and cols else np.zeros((rows, cols))


def _core(core: Core, x0: int, name: str) -> Flat:
    """Input channel, core and output channel of a mechanism in a row."""
    outputs = len(core.motions)
    before = [primitive_node(p, x0 + max(state, 0)) for p, state in core.input_channel]
    after = [primitive_node(p, x0 + max(state, 0)) for p, state in core.output_channel]
    main = core_node(core, x0)
    nodes = [*before, main, *after]
    return Flat(nodes, *_in_a_row(len(before), main.nout, len(after), outputs), [name] * len(nodes))


@functools.cache
def _in_a_row(before: int, nout: int, after: int, outputs: int):
    """Return the maps of a chain of nodes round a mechanism of so many outputs; nobody writes to them."""
    nodes, count = before + 1 + after, before + nout + after
    us, ur = np.zeros((nodes, count)), np.zeros((nodes, 1))
    ys = np.zeros((outputs, count))
    ur[0, 0] = 1.0
    for i in range(1, before + 1):
        us[i, i - 1] = 1.0
    first = last = before  # signal index of the mechanism's x
    for i in range(after):
        us[before + 1 + i, last] = 1.0
        last = first + nout + i
    ys[0, last] = 1.0
    for i in range(1, outputs):
        ys[i, first + i] = 1.0
    return us, ur, ys, np.zeros((outputs, 1))
