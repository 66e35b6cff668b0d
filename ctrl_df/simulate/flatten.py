"""From python-control systems to a program: nested interconnections become one list of nodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import control as ct
import numpy as np
from scipy.linalg import block_diag

from ..blocks.core import ELASTIC, IMPACT, RIGID, Core
from ..blocks.mechanism import Mechanism
from ..blocks.primitives import Delay, Lag, PiecewiseAffine, Play, Quantizer, Ramp, RateLimiter, Smooth
from . import layout as L
from .layout import Program
from .pointers import address, callback

_JOINT = {None: L.J_NONE, RIGID: L.J_RIGID, IMPACT: L.J_IMPACT, ELASTIC: L.J_ELASTIC}


@dataclass
class Node:
    """One node before the arrays are packed."""

    kind: int
    nin: int
    nout: int
    x: int = 0
    nx: int = 0
    par: Sequence[float] | np.ndarray = ()
    nmode: int = 0
    ng: int = 0
    aux: Sequence[int] = ()
    feed: int = 0
    laws: list[tuple[int, int, int, int]] = field(default_factory=list)  # address, par offset, state offset, body
    start: Sequence[int] = ()  # initial modes


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


def flatten(system) -> Flat:
    """Turn a system (a block, an LTI system, or any interconnection of them) into nodes."""
    return _fold_gains(_flatten(system, 0))


def _flatten(system, x0: int) -> Flat:
    if isinstance(system, ct.InterconnectedSystem):
        return _interconnection(system, x0)
    if isinstance(system, Mechanism):
        return _mechanism(system, x0)
    sampled = getattr(system, "sampled", None)
    if sampled is not None:
        return _single(_sampled_node(sampled, x0), system)
    primitive = getattr(system, "primitive", None)
    if primitive is not None:
        return _single(_primitive_node(primitive, x0), system)
    if isinstance(system, ct.StateSpace | ct.TransferFunction):
        return _single(_lti_node(system, x0), system)
    if isinstance(system, ct.NonlinearIOSystem):
        node, keep = _user_node(system, x0)
        flat = _single(node, system)
        flat.keep.append(keep)
        return flat
    raise TypeError(
        f"event_response needs a block, an LTI system or an interconnection of them; got {type(system).__name__}. "
        "Wrap a frequency response in a fitted transfer function first."
    )


def _single(node: Node, system) -> Flat:
    nin, nout = node.nin, node.nout
    return Flat(
        [node], np.zeros((nin, nout)), np.eye(nin), np.eye(nout), np.zeros((nout, nin)), [str(system.name)]
    )


def _interconnection(system: ct.InterconnectedSystem, x0: int) -> Flat:
    parts = []
    for sub in system.syslist:
        parts.append(_flatten(sub, x0))
        x0 += sub.nstates or 0
    # stack the parts, then close the connections
    ys, yr = _stack([p.ys for p in parts]), _stack([p.yr for p in parts])
    us, ur = _stack([p.us for p in parts]), _stack([p.ur for p in parts])
    c, i = np.asarray(system.connect_map, float), np.asarray(system.input_map, float)
    loop = np.eye(c.shape[0]) - c @ yr
    if abs(np.linalg.det(loop)) < 1e-12:
        raise ValueError("the interconnection wires inputs straight to themselves; break that loop with a system.")
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
    """Take pure gains (summing junctions, LTI systems without states) out of the list into the maps around them."""
    gain = [n.kind == L.LTI and n.nx == 0 for n in flat.nodes]
    if not any(gain) or all(gain):
        return flat
    s_gain: Any = np.repeat(gain, [n.nout for n in flat.nodes])
    u_gain: Any = np.repeat(gain, [n.nin for n in flat.nodes])
    d = _stack([np.reshape(n.par, (n.nout, n.nin)) for n, g in zip(flat.nodes, gain, strict=True) if g])
    # s_gain = d (us s + ur r), solved for the gains' outputs
    loop = np.eye(d.shape[0]) - d @ flat.us[np.ix_(u_gain, s_gain)]
    if abs(np.linalg.det(loop)) < 1e-12:
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


# --- nodes ------------------------------------------------------------------------------------------------


def _lti_node(system, x0) -> Node:
    if system.dt not in (None, 0) and system.dt is not True and float(system.dt) > 0:
        raise ValueError(
            f"event_response runs in continuous time; got a discrete system with dt={system.dt}. "
            "Use closed_loop(..., dt=) or ctrl_df.sampled for a digital controller."
        )
    ss: Any = ct.ss(system)
    a, b, c, d = (np.asarray(m, float) for m in (ss.A, ss.B, ss.C, ss.D))
    par = np.concatenate([a.ravel(), b.ravel(), c.ravel(), d.ravel()])
    return Node(L.LTI, b.shape[1], c.shape[0], x0, a.shape[0], par, feed=int(np.any(d != 0)))


def _sampled_node(sampled, x0) -> Node:
    a, b, c, d, dt = sampled
    par = np.concatenate([np.ravel(a), np.ravel(b), np.ravel(c), np.ravel(d), [dt]])
    nd, ni, no = np.shape(a)[0], np.shape(b)[1], np.shape(c)[0]
    return Node(L.SAMPLED, ni, no, x0, nd + no, par)


def _primitive_node(primitive, x0) -> Node:
    if isinstance(primitive, PiecewiseAffine):
        p = primitive
        par = [v for row in zip(p.low, p.high, p.slope, p.intercept, strict=True) for v in row]
        aux = [len(p.low) + 1] + [v for pair in zip(p.below, p.above, strict=True) for v in pair]
        return Node(L.PWA, 1, 1, x0, 0, par, 1, 2, aux, feed=1, start=[p.start])
    if isinstance(primitive, Quantizer):
        return Node(L.QUANTIZER, 1, 1, x0, 0, [primitive.step], 1, 2, feed=1, start=[0])
    if isinstance(primitive, Smooth):
        return Node(
            L.SMOOTH, 1, 1, x0, 0, primitive.p, feed=1, laws=[(address(primitive.law, "smooth"), 0, 0, 0)]
        )
    if isinstance(primitive, Ramp):
        return Node(L.RAMP, 1, 1, x0, 0, [primitive.offset, primitive.rate], feed=1)
    if isinstance(primitive, Lag):
        t = primitive.time_constant
        return Node(L.LTI, 1, 1, x0, 1, [-1 / t, 1 / t, 1.0, 0.0])
    if isinstance(primitive, Play):
        return Node(L.PLAY, 1, 1, x0, 1, [primitive.gap], 1, 2, feed=1, start=[0])
    if isinstance(primitive, RateLimiter):
        return Node(L.RATE, 1, 1, x0, 1, [primitive.rate], 1, 2, feed=1, start=[0])
    if isinstance(primitive, Delay):
        # a Pade element of first order: y = 2 z - u, dz/dt = (u - z) 2 / delay
        if primitive.delay == 0:
            return Node(L.LTI, 1, 1, x0, 1, [0.0, 0.0, 0.0, 1.0], feed=1)
        k = 2 / primitive.delay
        return Node(L.LTI, 1, 1, x0, 1, [-k, k, 2.0, -1.0], feed=1)
    raise TypeError(f"unknown element {primitive!r}.")


def _user_node(system, x0):
    if system.dt not in (None, 0):
        raise ValueError(
            f"event_response runs in continuous time; got {system.name} with dt={system.dt}. "
            "Use ctrl_df.sampled for a digital controller."
        )
    nx, nu, ny = system.nstates or 0, system.ninputs, system.noutputs
    update, output, params = system.updfcn, system.outfcn, dict(system.params)

    def call(t, x, u, dx, y, what):
        xs = np.array([x[i] for i in range(nx)])
        us = np.array([u[i] for i in range(nu)])
        if what == 1:
            values, target = np.atleast_1d(update(t, xs, us, params)), dx
        else:
            values = xs if output is None else np.atleast_1d(output(t, xs, us, params))
            target = y
        wanted = nx if what == 1 else ny
        if len(values) != wanted:
            raise ValueError(f"{system.name} must return {wanted} values; got {len(values)}.")
        for i, v in enumerate(values):
            target[i] = float(v)

    pointer, keep = callback(call, "system")
    feed = 1 if nx == 0 else int(_has_feedthrough(output, nx, nu, params))
    return Node(L.SYSTEM, nu, ny, x0, nx, feed=feed, laws=[(pointer, 0, 0, 0)]), keep


def _has_feedthrough(output, nx, nu, params) -> bool:
    """Probe whether an output function reads its input."""
    if output is None:
        return False
    rng = np.random.default_rng(0)
    for _ in range(4):
        x = rng.normal(size=nx)
        y = [np.atleast_1d(output(0.0, x, rng.normal(size=nu) * s, params)) for s in (0.0, 1.0, 10.0)]
        if not all(np.array_equal(y[0], other) for other in y[1:]):
            return True
    return False


# --- mechanisms -------------------------------------------------------------------------------------------


def _mechanism(block: Mechanism, x0: int) -> Flat:
    """Input channel, core and output channel in a row."""
    core = block.core
    before = [_primitive_node(p, x0 + max(state, 0)) for p, state in core.input_channel]
    after = [_primitive_node(p, x0 + max(state, 0)) for p, state in core.output_channel]
    main = _core_node(core, x0)
    nodes = [*before, main, *after]
    count = main.nout + len(before) + len(after)
    us, ur = np.zeros((len(nodes), count)), np.zeros((len(nodes), 1))
    ys = np.zeros((block.noutputs, count))
    ur[0, 0] = 1.0
    for i in range(1, len(before) + 1):
        us[i, i - 1] = 1.0
    first = len(before)  # signal index of the core's x
    last = first
    for i in range(len(after)):
        us[len(before) + 1 + i, last] = 1.0
        last = first + main.nout + i
    ys[0, last] = 1.0
    for i in range(1, block.noutputs):
        ys[i, first + i] = 1.0
    return Flat(nodes, us, ur, ys, np.zeros((block.noutputs, 1)), [str(block.name)] * len(nodes))


def _core_node(core: Core, x0: int) -> Node:
    two = core.bodies == 2
    low, high = core.stop.span if core.stop else (0.0, 0.0)
    bristle = core.bristle
    par = [core.masses[0], core.masses[1] if two else 1.0, core.gap, core.restitution, core.stiffness, core.damping]
    par += [low, high, core.stop.restitution if core.stop else 0.0]
    par += [bristle.stiffness, bristle.damping, bristle.level] if bristle else [0.0, 0.0, 0.0]
    par += [_narrowest(chain) for chain in (core.friction + ((),))[:2]]
    laws = []
    for term in core.forces:
        laws.append((address(type(term.effect).law, "force"), len(par), term.state, term.body))  # type: ignore[arg-type]
        par += term.effect.values
    for body, chain in enumerate(core.friction):
        for effect in chain:
            laws.append((address(type(effect).law, "friction"), len(par), 0, body))  # type: ignore[arg-type]
            par += effect.values
    chains = [len(c) for c in core.friction] + [0]
    aux = [
        core.bodies,
        _JOINT[core.joint],
        int(core.stop is not None),
        core.bristle_state,
        core.measured,
        len(core.forces),
        chains[0],
        chains[1],
        0,  # index of its first law, filled when packed
    ]
    mode = [L.FREE, L.FREE, 0, 0]
    return Node(
        L.MECHANISM, 1, 4 if two else 2, x0, core.nstates, par, len(mode), 6, aux, feed=0, laws=laws, start=mode
    )


def _narrowest(chain) -> float:
    """Return the smallest speed a chain of friction laws names among its parameters [m/s]; inf if none does."""
    speeds = [p.value for effect in chain for p in effect.parameters.values() if p.unit == "m/s"]
    return min((v for v in speeds if v > 0), default=np.inf)


# --- packing ----------------------------------------------------------------------------------------------


def pack(flat: Flat, nx: int) -> tuple[Program, np.ndarray, list[str]]:
    """Order the nodes by feedthrough and lay everything out in arrays; returns program, initial modes, node names."""
    nodes = flat.nodes
    s_at = np.cumsum([0] + [n.nout for n in nodes])
    u_at = np.cumsum([0] + [n.nin for n in nodes])
    order = _feed_order(nodes, flat.us, s_at, u_at, flat.names)
    ns, nr = int(s_at[-1]), flat.ur.shape[1]
    widest = max((n.nin for n in nodes), default=1)
    header = [nx, ns, nr, flat.ys.shape[0], 0, 0, widest, 0, 0, ns + nr, ns + nr + widest, 0]
    ints, par, modes = list(header), [], []
    table = np.zeros((len(nodes), 13), np.int64)
    ng = 0

    def rows(from_s, from_r):
        """Append the rows of a block of inputs; returns the position of their pointers."""
        pointers = []
        for row_s, row_r in zip(from_s, from_r, strict=True):
            pointers.append(len(ints))
            entries = [(i, row_s[i]) for i in np.flatnonzero(row_s)] + [(ns + i, row_r[i]) for i in np.flatnonzero(row_r)]
            ints.append(len(entries))
            for index, weight in entries:
                ints.extend((int(index), len(par)))
                par.append(float(weight))
        ints.extend(pointers)
        return len(ints) - len(pointers)

    for row, i in enumerate(order):
        node = nodes[i]
        inputs = rows(flat.us[u_at[i] : u_at[i + 1]], flat.ur[u_at[i] : u_at[i + 1]])
        laws = len(ints)
        for law_address, offset, state, body in node.laws:
            ints.extend((law_address, len(par) + offset, state, body))
        aux = list(node.aux)
        if node.kind == L.MECHANISM:
            aux[L.A_LAWS] = laws
        table[row] = [
            node.kind, node.nin, node.nout, inputs, s_at[i], node.x, node.nx, len(par), len(modes), ng, node.ng,
            len(ints) if aux else laws, node.feed,
        ]  # fmt: skip
        ints.extend(aux)
        par.extend(node.par)
        modes.extend(node.start)
        ng += node.ng
    ints[L.H_OUT] = rows(flat.ys, flat.yr)
    ints[L.H_NM], ints[L.H_NG] = len(modes), ng
    ints[L.H_TRACK] = int(any(n.kind in (L.PLAY, L.RATE) for n in nodes))
    ints[L.H_BUMP] = int(any(n.kind == L.MECHANISM and min(n.par[L.P_BUMP0 : L.P_BUMP1 + 1]) < np.inf for n in nodes))
    program = Program(table, np.array(ints, np.int64), np.array(par, float))
    return program, np.array(modes, np.int64), [flat.names[i] for i in order]


def _feed_order(nodes, us, s_at, u_at, names) -> list[int]:
    """Order nodes so that each with direct feedthrough follows those it reads; an algebraic loop is an error."""
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
