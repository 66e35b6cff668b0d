# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""Signals and rates of a program in a fixed mode, and the margins of its events.

Every margin g is positive while the mode holds; an event is its passage below zero.
"""

from __future__ import annotations

import math

from numba import njit

from .layout import (
    A_BODIES,
    A_BRISTLE,
    A_JOINT,
    A_LAWS,
    A_MEASURED,
    A_NFORCE,
    A_NFRIC0,
    A_STOP,
    AUX,
    DELAY,
    DIR0,
    DIR1,
    FEED,
    FREE,
    G_BODY1,
    G_JOINT_HIGH,
    G_JOINT_LOW,
    G_WALL_HIGH,
    G_WALL_LOW,
    H_NR,
    H_NS,
    H_SCRATCH,
    H_U,
    IN,
    J_ELASTIC,
    J_IMPACT,
    J_NONE,
    J_RIGID,
    JOINT,
    KIND,
    LTI,
    MECHANISM,
    MODE,
    NIN,
    NOUT,
    NX,
    OUT,
    P_C,
    P_GAP,
    P_HIGH,
    P_K,
    P_LOW,
    P_M0,
    P_SIGMA0,
    P_SIGMA1,
    P_SIGMA_LEVEL,
    PAR,
    PLAY,
    PWA,
    QUANTIZER,
    R_ADDRESS,
    R_BODY,
    R_PAR,
    R_SIZE,
    R_STATE,
    RAMP,
    RATE,
    SAMPLED,
    SMOOTH,
    STUCK,
    SYSTEM,
    WALL,
    G,
    X,
)
from .pointers import call_force, call_friction, call_input, call_smooth, call_system


@njit(cache=True, error_model="numpy", _nrt=False, forceinline=True)
def external(prog, drive, t, segment, w):
    """Fill the external inputs at time `t`, the samples taken from `segment`."""
    at = prog.ints[H_NS]
    if drive.address != 0:
        call_input(drive.address, t, w.ctypes.data + 8 * at)
        return
    nt = drive.time.shape[0]
    nh = drive.harmonics.shape[1]
    for i in range(prog.ints[H_NR]):
        value = 0.0
        if nt > 0:
            value = drive.samples[i, segment]
            if drive.linear == 1 and segment + 1 < nt:
                span = drive.time[segment + 1] - drive.time[segment]
                value += (drive.samples[i, segment + 1] - value) * (t - drive.time[segment]) / span
        for k in range(nh):
            c = drive.harmonics[i, k]
            if c != 0:
                angle = k * drive.omega * t
                value += c.real * math.cos(angle) - c.imag * math.sin(angle)
        w[at + i] = value


@njit(cache=True, error_model="numpy", _nrt=False, forceinline=True)
def combine(prog, row, w):
    """Value of one linear combination of signals and external inputs."""
    value = 0.0
    for j in range(row + 1, row + 1 + 2 * prog.ints[row], 2):
        value += prog.par[prog.ints[j + 1]] * w[prog.ints[j]]
    return value


@njit(cache=True, error_model="numpy", _nrt=False, forceinline=True)
def node_input(prog, node, k, w):
    """Input k of a node."""
    return combine(prog, prog.ints[prog.nodes[node, IN] + k], w)


@njit(cache=True, error_model="numpy", _nrt=False, forceinline=True)
def signals(prog, t, x, mode, w):
    """Fill the work vector with the outputs of all nodes."""
    nodes, par, ou = prog.nodes, prog.par, prog.ints[H_U]
    for n in range(nodes.shape[0]):
        kind, xo, po, so = nodes[n, KIND], nodes[n, X], nodes[n, PAR], nodes[n, OUT]
        if nodes[n, FEED] == 1:
            for k in range(nodes[n, NIN]):
                w[ou + k] = node_input(prog, n, k, w)
        if kind == LTI:
            nx, ni = nodes[n, NX], nodes[n, NIN]
            for i in range(nodes[n, NOUT]):
                value = 0.0
                row = po + nx * nx + nx * ni + i * nx
                for j in range(nx):
                    value += par[row + j] * x[xo + j]
                if nodes[n, FEED] == 1:
                    row = po + nx * nx + nx * ni + nodes[n, NOUT] * nx + i * ni
                    for j in range(ni):
                        value += par[row + j] * w[ou + j]
                w[so + i] = value
        elif kind == MECHANISM:
            body = xo + 2 * prog.ints[nodes[n, AUX] + A_MEASURED]
            w[so] = x[body]
            w[so + 1] = x[body + 1]
            if nodes[n, NOUT] == 4:
                w[so + 2] = x[xo + 2]
                w[so + 3] = x[xo + 3]
        elif kind == PWA:
            row = po + 4 * mode[nodes[n, MODE]]
            w[so] = par[row + 3] + par[row + 2] * w[ou]
        elif kind == QUANTIZER:
            w[so] = par[po] * mode[nodes[n, MODE]]
        elif kind == SMOOTH:
            w[so] = call_smooth(prog.ints[nodes[n, AUX]], w[ou], par.ctypes.data + 8 * po)
        elif kind == RAMP:
            w[so] = w[ou] + par[po] + par[po + 1] * t
        elif kind == SAMPLED:
            held = xo + nodes[n, NX] - nodes[n, NOUT]
            for i in range(nodes[n, NOUT]):
                w[so + i] = x[held + i]
        elif kind == PLAY:
            m = mode[nodes[n, MODE]]
            w[so] = x[xo] if m == 0 else w[ou] - m * 0.5 * par[po]
        elif kind == RATE:
            w[so] = w[ou] if mode[nodes[n, MODE]] == 0 else x[xo]
        elif kind == SYSTEM:
            call_system(
                prog.ints[nodes[n, AUX]],
                t,
                x.ctypes.data + 8 * xo,
                w.ctypes.data + 8 * ou,
                w.ctypes.data + 8 * prog.ints[H_SCRATCH],
                w.ctypes.data + 8 * so,
                0,
            )
        elif kind == DELAY:
            w[so] = x[xo]


@njit(cache=True, error_model="numpy", _nrt=False, forceinline=True)
def level(prog, first, count, moving, direction, speed):
    """Dry friction level of a chain of laws [N]."""
    value = 0.0
    base = prog.par.ctypes.data
    for i in range(first, first + count * R_SIZE, R_SIZE):
        at = base + 8 * prog.ints[i + R_PAR]
        value = call_friction(prog.ints[i + R_ADDRESS], moving, direction, speed, value, at)
    return value


@njit(cache=True, error_model="numpy", _nrt=False, forceinline=True)
def smooth_forces(prog, node, t, x, mode, force, f, dx):
    """Fill f[0:2] with the forces on the bodies other than dry friction and contact; writes internal rates to dx."""
    nodes, par, aux = prog.nodes, prog.par, prog.ints
    xo, po, ao = nodes[node, X], nodes[node, PAR], nodes[node, AUX]
    driven = aux[ao + A_BODIES] - 1
    f[0] = f[1] = 0.0
    f[driven] = force
    first = aux[ao + A_LAWS]
    base_p, base_x, base_dx = par.ctypes.data, x.ctypes.data, dx.ctypes.data
    for i in range(first, first + aux[ao + A_NFORCE] * R_SIZE, R_SIZE):
        b = aux[i + R_BODY]
        z = 8 * (xo + aux[i + R_STATE])
        f[b] += call_force(
            aux[i + R_ADDRESS],
            t,
            x[xo + 2 * b],
            x[xo + 2 * b + 1],
            base_x + z,
            base_p + 8 * aux[i + R_PAR],
            base_dx + z,
        )
    if aux[ao + A_BRISTLE] >= 0:
        z = xo + aux[ao + A_BRISTLE]
        v = x[xo + 2 * driven + 1]
        start = friction_start(prog, node, driven)
        g = level(prog, start, aux[ao + A_NFRIC0 + driven], 1.0, 1.0 if v >= 0 else -1.0, abs(v))
        g += par[po + P_SIGMA_LEVEL]
        rate = v
        if g > 0:
            rate -= par[po + P_SIGMA0] * abs(v) * x[z] / g
        dx[z] = rate
        f[driven] -= par[po + P_SIGMA0] * x[z] + par[po + P_SIGMA1] * rate
    if aux[ao + A_JOINT] == J_ELASTIC:
        region = mode[nodes[node, MODE] + JOINT]
        if region != 0:
            bend = x[xo + 2] - x[xo] - (par[po + P_GAP] if region > 0 else 0.0)
            pull = par[po + P_K] * bend + par[po + P_C] * (x[xo + 3] - x[xo + 1])
            f[0] += pull
            f[1] -= pull


@njit(cache=True, error_model="numpy", _nrt=False, forceinline=True)
def friction_start(prog, node, body):
    """Index of the first friction law of a body."""
    ao = prog.nodes[node, AUX]
    start = prog.ints[ao + A_LAWS] + R_SIZE * prog.ints[ao + A_NFORCE]
    return start if body == 0 else start + R_SIZE * prog.ints[ao + A_NFRIC0]


@njit(cache=True, error_model="numpy", _nrt=False, forceinline=True)
def dry_level(prog, node, body, moving, direction, speed):
    """Dry friction level of a body that is not carried by a bristle [N]."""
    ao = prog.nodes[node, AUX]
    count = prog.ints[ao + A_NFRIC0 + body]
    if count == 0 or (prog.ints[ao + A_BRISTLE] >= 0 and body == prog.ints[ao + A_BODIES] - 1):
        return 0.0
    return level(prog, friction_start(prog, node, body), count, moving, direction, speed)


@njit(cache=True, error_model="numpy", _nrt=False, forceinline=True)
def closed(prog, node, mode):
    """Whether the two bodies move as one (rigid joint, or impact joint in contact)."""
    joint = prog.ints[prog.nodes[node, AUX] + A_JOINT]
    return joint == J_RIGID or (joint == J_IMPACT and mode[prog.nodes[node, MODE] + JOINT] != 0)


@njit(cache=True, error_model="numpy", _nrt=False, forceinline=True)
def hold_margin(prog, node, body, f, wall):
    """How far a stuck body is from breaking away [N]; at a wall only away from it."""
    up = dry_level(prog, node, body, 0.0, 1.0, 0.0) - f
    down = dry_level(prog, node, body, 0.0, -1.0, 0.0) + f
    if wall > 0:
        return down
    if wall < 0:
        return up
    return min(up, down)


@njit(cache=True, error_model="numpy", _nrt=False, forceinline=True)
def mechanism_rates(prog, node, t, x, mode, force, f, dx, g, want_g):
    """Accelerations of a mechanism in its mode, and its event margins."""
    nodes, par, aux = prog.nodes, prog.par, prog.ints
    xo, po, ao, mo, go = nodes[node, X], nodes[node, PAR], nodes[node, AUX], nodes[node, MODE], nodes[node, G]
    smooth_forces(prog, node, t, x, mode, force, f, dx)
    bodies = aux[ao + A_BODIES]
    driven = bodies - 1
    joint, wall = aux[ao + A_JOINT], mode[mo + WALL]
    if want_g:
        for i in range(6):
            g[go + i] = math.inf
    joined = bodies == 2 and closed(prog, node, mode)
    friction0 = friction1 = 0.0
    for b in range(bodies):
        d = mode[mo + b]
        if d == 1 or d == -1:
            drag = d * dry_level(prog, node, b, 1.0, float(d), abs(x[xo + 2 * b + 1]))
            if b == 0:
                friction0 = drag
            else:
                friction1 = drag
    f0, f1 = f[0] - friction0, f[1] - friction1
    m0, m1 = par[po + P_M0], par[po + P_M0 + 1]
    if joined:
        still = mode[mo + DIR1] == STUCK
        a = 0.0 if still else (f0 + f1) / (m0 + m1)
        dx[xo] = x[xo + 1]
        dx[xo + 1] = a
        dx[xo + 2] = x[xo + 3]
        dx[xo + 3] = a
        if want_g:
            _joined_margins(prog, node, x, mode, f, f0, a, g)
    else:
        for b in range(bodies):
            still = mode[mo + b] == STUCK
            dx[xo + 2 * b] = x[xo + 2 * b + 1]
            dx[xo + 2 * b + 1] = 0.0 if still else (f0 / m0 if b == 0 else f1 / m1)
            if want_g:
                d = mode[mo + b]
                if still:
                    g[go + b] = hold_margin(prog, node, b, f[b], wall if b == driven else 0)
                elif d != FREE:
                    g[go + b] = d * x[xo + 2 * b + 1]
        if want_g and bodies == 2 and joint != J_NONE:
            delta, gap = x[xo + 2] - x[xo], par[po + P_GAP]
            if joint == J_IMPACT:
                g[go + G_JOINT_LOW] = delta
                g[go + G_JOINT_HIGH] = gap - delta
            elif gap > 0:
                region = mode[mo + JOINT]
                if region == 0:
                    g[go + G_JOINT_LOW] = delta
                    g[go + G_JOINT_HIGH] = gap - delta
                elif region > 0:
                    g[go + G_JOINT_HIGH] = delta - gap
                else:
                    g[go + G_JOINT_LOW] = -delta
    if want_g and aux[ao + A_STOP] == 1 and wall == 0:
        position = x[xo + 2 * driven]
        g[go + G_WALL_LOW] = position - par[po + P_LOW]
        g[go + G_WALL_HIGH] = par[po + P_HIGH] - position


@njit(cache=True, error_model="numpy", _nrt=False)
def _joined_margins(prog, node, x, mode, f, f0, a, g):
    """Margins of two bodies in contact: common reversal or breakaway, and release of the contact."""
    nodes, par, aux = prog.nodes, prog.par, prog.ints
    xo, po, mo, go = nodes[node, X], nodes[node, PAR], nodes[node, MODE], nodes[node, G]
    side = mode[mo + JOINT]
    impact = aux[nodes[node, AUX] + A_JOINT] == J_IMPACT
    d, wall = mode[mo + DIR1], mode[mo + WALL]
    if d != STUCK:
        if mode[mo + DIR0] != FREE or d != FREE:
            direction = d if d != FREE else mode[mo + DIR0]
            g[go + G_BODY1] = direction * x[xo + 3]
        if impact:
            # the load is pushed, never pulled
            g[go + G_JOINT_LOW] = side * (par[po + P_M0] * a - f0)
        return
    up = dry_level(prog, node, 0, 0.0, 1.0, 0.0) + dry_level(prog, node, 1, 0.0, 1.0, 0.0)
    down = dry_level(prog, node, 0, 0.0, -1.0, 0.0) + dry_level(prog, node, 1, 0.0, -1.0, 0.0)
    net = f[0] + f[1]
    if wall > 0:
        g[go + G_BODY1] = down + net
    elif wall < 0:
        g[go + G_BODY1] = up - net
    else:
        g[go + G_BODY1] = min(up - net, down + net)
    if impact:
        # neither does the motor draw back, nor the load run ahead
        g[go + G_JOINT_LOW] = side * f[1] + dry_level(prog, node, 1, 0.0, -float(side), 0.0)
        g[go + G_JOINT_HIGH] = dry_level(prog, node, 0, 0.0, float(side), 0.0) - side * f[0]


@njit(cache=True, error_model="numpy", _nrt=False, forceinline=True)
def rates(prog, drive, segment, t, x, mode, work, dx, g, want_g):
    """Rates of all states at (t, x) in the given mode; with `want_g` the event margins too."""
    w, f, _ = work
    external(prog, drive, t, segment, w)
    signals(prog, t, x, mode, w)
    nodes, par, ou = prog.nodes, prog.par, prog.ints[H_U]
    for n in range(nodes.shape[0]):
        kind, xo, po, mo, go = nodes[n, KIND], nodes[n, X], nodes[n, PAR], nodes[n, MODE], nodes[n, G]
        if kind == MECHANISM:
            force = node_input(prog, n, 0, w)
            mechanism_rates(prog, n, t, x, mode, force, f, dx, g, want_g)
        elif kind == LTI:
            nx, ni = nodes[n, NX], nodes[n, NIN]
            for k in range(ni):
                w[ou + k] = node_input(prog, n, k, w)
            for i in range(nx):
                value = 0.0
                for j in range(nx):
                    value += par[po + i * nx + j] * x[xo + j]
                for j in range(ni):
                    value += par[po + nx * nx + i * ni + j] * w[ou + j]
                dx[xo + i] = value
        elif kind == PWA:
            if want_g:
                value = node_input(prog, n, 0, w)
                row = po + 4 * mode[mo]
                low, high = par[row], par[row + 1]
                g[go] = value - low
                g[go + 1] = high - value
        elif kind == QUANTIZER:
            if want_g:
                value = node_input(prog, n, 0, w)
                center = par[po] * mode[mo]
                g[go] = value - center + 0.5 * par[po]
                g[go + 1] = center + 0.5 * par[po] - value
        elif kind == SAMPLED:
            for i in range(nodes[n, NX]):
                dx[xo + i] = 0.0
        elif kind == PLAY:
            dx[xo] = 0.0
            if want_g:
                gap = node_input(prog, n, 0, w) - x[xo]
                if mode[mo] == 0:
                    g[go] = 0.5 * par[po] + gap
                    g[go + 1] = 0.5 * par[po] - gap
                else:
                    g[go] = g[go + 1] = math.inf
        elif kind == RATE:
            m = mode[mo]
            dx[xo] = m * par[po]
            if want_g:
                g[go] = math.inf if m == 0 else m * (node_input(prog, n, 0, w) - x[xo])
                g[go + 1] = math.inf
        elif kind == SYSTEM:
            for k in range(nodes[n, NIN]):
                w[ou + k] = node_input(prog, n, k, w)
            call_system(
                prog.ints[nodes[n, AUX]],
                t,
                x.ctypes.data + 8 * xo,
                w.ctypes.data + 8 * ou,
                dx.ctypes.data + 8 * xo,
                w.ctypes.data + 8 * prog.ints[H_SCRATCH],
                1,
            )
        elif kind == DELAY:
            dx[xo] = 0.0


@njit(cache=True, error_model="numpy", _nrt=False)
def input_rates(prog, drive, segment, t, x, mode, work, dx, reach, g):
    """Margins that need the rate of an input: a play lets go when its input turns, a limiter limits when it is fast.

    Rates are central differences along the flow over +-`reach` seconds.
    """
    w, _, trial = work
    nodes, par = prog.nodes, prog.par
    before = 0.0
    for n in range(nodes.shape[0]):
        kind = nodes[n, KIND]
        mo, go, po = nodes[n, MODE], nodes[n, G], nodes[n, PAR]
        if (kind == PLAY and mode[mo] != 0) or (kind == RATE and mode[mo] == 0):
            rate = 0.0
            for side in (-1.0, 1.0):
                for i in range(x.shape[0]):
                    trial[i] = x[i] + side * reach * dx[i]
                external(prog, drive, t + side * reach, segment, w)
                signals(prog, t + side * reach, trial, mode, w)
                value = node_input(prog, n, 0, w)
                if side < 0:
                    before = value
                else:
                    rate = (value - before) / (2.0 * reach)
            g[go] = mode[mo] * rate if kind == PLAY else par[po] - abs(rate)
