# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""What happens at an event: resolve modes, apply impacts, settle a program into consistent modes."""

from __future__ import annotations

from numba import njit

from .flow import (
    closed,
    dry_level,
    external,
    mechanism_rates,
    node_input,
    signals,
    smooth_forces,
)
from .layout import (
    A_BODIES,
    A_BRISTLE,
    A_JOINT,
    A_NFRIC0,
    AUX,
    DIR0,
    DIR1,
    E_BREAKAWAY,
    E_CONTACT,
    E_CORNER,
    E_DISENGAGE,
    E_ENGAGE,
    E_IMPACT,
    E_RELEASE,
    E_REVERSAL,
    E_STICK,
    E_STOP,
    E_STOP_CONTACT,
    E_SWITCH,
    FREE,
    G_BODY1,
    G_JOINT_HIGH,
    G_JOINT_LOW,
    G_WALL_HIGH,
    H_SCRATCH,
    H_U,
    J_ELASTIC,
    J_IMPACT,
    J_RIGID,
    JOINT,
    KIND,
    MECHANISM,
    MODE,
    NIN,
    NOUT,
    NX,
    OUT,
    P_GAP,
    P_HIGH,
    P_LOW,
    P_M0,
    P_REST,
    P_STOP_REST,
    PAR,
    PLAY,
    PWA,
    QUANTIZER,
    RATE,
    STUCK,
    WALL,
    X,
)


@njit(cache=True, error_model="numpy", _nrt=False)
def has_dry(prog, node, body):
    """Whether set-valued dry friction acts on a body."""
    ao = prog.nodes[node, AUX]
    if prog.ints[ao + A_NFRIC0 + body] == 0:
        return False
    return not (prog.ints[ao + A_BRISTLE] >= 0 and body == prog.ints[ao + A_BODIES] - 1)


@njit(cache=True, error_model="numpy", _nrt=False)
def tendency(f, up, down, wall):
    """Direction in which a body at rest starts under the force f, or 0 (held by friction or wall)."""
    if f > up and wall != 1:
        return 1
    if f < -down and wall != -1:
        return -1
    return 0


@njit(cache=True, error_model="numpy", _nrt=False)
def body_tendency(prog, node, body, f, wall):
    """Tendency of one body by itself."""
    up = dry_level(prog, node, body, 0.0, 1.0, 0.0)
    down = dry_level(prog, node, body, 0.0, -1.0, 0.0)
    return tendency(f, up, down, wall)


@njit(cache=True, error_model="numpy", _nrt=False)
def _direction(prog, node, body, d):
    return d if has_dry(prog, node, body) else FREE


@njit(cache=True, error_model="numpy", _nrt=False)
def resolve(prog, node, t, x, mode, force, f, dx):
    """Bring a mechanism's modes in line with its velocities and forces; returns whether any changed."""
    nodes, aux = prog.nodes, prog.ints
    xo, mo = nodes[node, X], nodes[node, MODE]
    bodies = aux[nodes[node, AUX] + A_BODIES]
    driven = bodies - 1
    joint = aux[nodes[node, AUX] + A_JOINT]
    old0, old1, old_joint, old_wall = mode[mo], mode[mo + 1], mode[mo + JOINT], mode[mo + WALL]
    if joint == J_ELASTIC:
        _elastic_region(prog, node, x, mode)
    smooth_forces(prog, node, t, x, mode, force, f, dx)
    if bodies == 2 and closed(prog, node, mode):
        _resolve_joined(prog, node, x, mode, f)
    else:
        for b in range(bodies):
            v = x[xo + 2 * b + 1]
            wall = mode[mo + WALL] if b == driven else 0
            if v != 0.0:
                mode[mo + b] = _direction(prog, node, b, 1 if v > 0 else -1)
                if b == driven:
                    mode[mo + WALL] = 0
            elif wall == 0 and not has_dry(prog, node, b):
                mode[mo + b] = FREE
            else:
                d = body_tendency(prog, node, b, f[b], wall)
                mode[mo + b] = STUCK if d == 0 else _direction(prog, node, b, d)
                if b == driven and d != 0:
                    mode[mo + WALL] = 0
    return old0 != mode[mo] or old1 != mode[mo + 1] or old_joint != mode[mo + JOINT] or old_wall != mode[mo + WALL]


@njit(cache=True, error_model="numpy", _nrt=False)
def _elastic_region(prog, node, x, mode):
    """Region of an elastic joint: in the gap, or on one of its faces."""
    xo, gap = prog.nodes[node, X], prog.par[prog.nodes[node, PAR] + P_GAP]
    at = prog.nodes[node, MODE] + JOINT
    delta = x[xo + 2] - x[xo]
    if gap == 0.0:
        mode[at] = 1
    elif delta > gap:
        mode[at] = 1
    elif delta < 0.0:
        mode[at] = -1
    elif 0.0 < delta < gap:
        mode[at] = 0


@njit(cache=True, error_model="numpy", _nrt=False)
def _resolve_joined(prog, node, x, mode, f):
    """Two bodies in contact: move together, stay stuck, or separate."""
    par = prog.par
    xo, po, mo = prog.nodes[node, X], prog.nodes[node, PAR], prog.nodes[node, MODE]
    impact = prog.ints[prog.nodes[node, AUX] + A_JOINT] == J_IMPACT
    side, wall = mode[mo + JOINT], mode[mo + WALL]
    m0, m1 = par[po + P_M0], par[po + P_M0 + 1]
    v = x[xo + 3]
    dry = has_dry(prog, node, 0) or has_dry(prog, node, 1)
    if v != 0.0 or (not dry and wall == 0):
        d = 1 if v > 0 else -1
        if v != 0.0:
            mode[mo + WALL] = 0
        mode[mo + DIR0] = _direction(prog, node, 0, d)
        mode[mo + DIR1] = _direction(prog, node, 1, d)
        if impact:
            f0 = f[0] - d * dry_level(prog, node, 0, 1.0, float(d), abs(v))
            f1 = f[1] - d * dry_level(prog, node, 1, 1.0, float(d), abs(v))
            if side * (m0 * (f0 + f1) / (m0 + m1) - f0) < 0.0:
                mode[mo + JOINT] = 0
        return
    d0 = body_tendency(prog, node, 0, f[0], 0)
    d1 = body_tendency(prog, node, 1, f[1], wall)
    if impact:
        a0 = 0.0 if d0 == 0 else (f[0] - d0 * dry_level(prog, node, 0, 1.0, float(d0), 0.0)) / m0
        a1 = 0.0 if d1 == 0 else (f[1] - d1 * dry_level(prog, node, 1, 1.0, float(d1), 0.0)) / m1
        if side * (a1 - a0) < 0.0:
            mode[mo + JOINT] = 0
            mode[mo + DIR0] = _separate(prog, node, 0, d0, 0)
            mode[mo + DIR1] = _separate(prog, node, 1, d1, wall)
            if d1 != 0:
                mode[mo + WALL] = 0
            return
    up = dry_level(prog, node, 0, 0.0, 1.0, 0.0) + dry_level(prog, node, 1, 0.0, 1.0, 0.0)
    down = dry_level(prog, node, 0, 0.0, -1.0, 0.0) + dry_level(prog, node, 1, 0.0, -1.0, 0.0)
    d = tendency(f[0] + f[1], up, down, wall)
    if d == 0:
        mode[mo + DIR0] = mode[mo + DIR1] = STUCK
    else:
        mode[mo + WALL] = 0
        mode[mo + DIR0] = _direction(prog, node, 0, d)
        mode[mo + DIR1] = _direction(prog, node, 1, d)


@njit(cache=True, error_model="numpy", _nrt=False)
def _separate(prog, node, body, d, wall):
    if d == 0:
        return STUCK if wall != 0 or has_dry(prog, node, body) else FREE
    return _direction(prog, node, body, d)


@njit(cache=True, error_model="numpy", _nrt=False)
def settle(prog, drive, segment, t, x, mode, work, dx):
    """Bring all modes in line with the state; returns False if they keep changing (a sliding mode)."""
    w, f, trial = work
    nodes, par = prog.nodes, prog.par
    for _pass in range(50):
        changed = False
        external(prog, drive, t, segment, w)
        signals(prog, t, x, mode, w)
        for n in range(nodes.shape[0]):
            kind, mo, po = nodes[n, KIND], nodes[n, MODE], nodes[n, PAR]
            if kind == PWA:
                value = node_input(prog, n, 0, w)
                region = mode[mo]
                steps = prog.ints[nodes[n, AUX]]
                for _i in range(steps):
                    row = po + 4 * region
                    at = nodes[n, AUX] + 1 + 2 * region
                    if value > par[row + 1]:
                        region = prog.ints[at + 1]
                    elif value < par[row]:
                        region = prog.ints[at]
                    else:
                        break
                if region != mode[mo]:
                    mode[mo] = region
                    changed = True
            elif kind == QUANTIZER:
                value = node_input(prog, n, 0, w) / par[po]
                if value > mode[mo] + 0.5 or value < mode[mo] - 0.5:
                    mode[mo] = round(value)
                    changed = True
            elif kind == PLAY:
                gap = node_input(prog, n, 0, w) - x[nodes[n, X]]
                half = 0.5 * par[po]
                m = 1 if gap > half else (-1 if gap < -half else mode[mo])
                if m != 0:
                    x[nodes[n, X]] += gap - m * half
                if m != mode[mo]:
                    mode[mo] = m
                    changed = True
            elif kind == RATE:
                gap = node_input(prog, n, 0, w) - x[nodes[n, X]]
                if mode[mo] == 0 and gap != 0.0:
                    # a jump of the input cannot be followed at once
                    mode[mo] = 1 if gap > 0 else -1
                    changed = True
                elif mode[mo] * gap < 0.0:
                    mode[mo] = -mode[mo]
                    changed = True
            elif kind == MECHANISM:
                changed |= resolve(prog, n, t, x, mode, node_input(prog, n, 0, w), f, trial)
        if not changed:
            return True
    return False


@njit(cache=True, error_model="numpy", _nrt=False)
def track(prog, drive, segment, t, x, mode, work):
    """Write the outputs of engaged plays and tracking rate limiters into their states (end of a step)."""
    w, _, _ = work
    nodes = prog.nodes
    external(prog, drive, t, segment, w)
    signals(prog, t, x, mode, w)
    for n in range(nodes.shape[0]):
        if nodes[n, KIND] == PLAY or nodes[n, KIND] == RATE:
            x[nodes[n, X]] = w[nodes[n, OUT]]


@njit(cache=True, error_model="numpy", _nrt=False)
def sample(prog, node, x, w):
    """One step of a sampled controller: hold its new output, then update its state."""
    nodes, par = prog.nodes, prog.par
    ou, scratch = prog.ints[H_U], prog.ints[H_SCRATCH]
    ni, no, xo, po = nodes[node, NIN], nodes[node, NOUT], nodes[node, X], nodes[node, PAR]
    nd = nodes[node, NX] - no
    for k in range(ni):
        w[ou + k] = node_input(prog, node, k, w)
    for i in range(no):
        value = 0.0
        row = po + nd * nd + nd * ni + i * nd
        for j in range(nd):
            value += par[row + j] * x[xo + j]
        row = po + nd * nd + nd * ni + no * nd + i * ni
        for j in range(ni):
            value += par[row + j] * w[ou + j]
        x[xo + nd + i] = value
    for i in range(nd):
        value = 0.0
        for j in range(nd):
            value += par[po + i * nd + j] * x[xo + j]
        for j in range(ni):
            value += par[po + nd * nd + i * ni + j] * w[ou + j]
        w[scratch + i] = value
    for i in range(nd):
        x[xo + i] = w[scratch + i]


@njit(cache=True, error_model="numpy", _nrt=False)
def event(prog, drive, segment, t, x, mode, work, dx, g, node, slot, height):
    """Apply the event whose margin `slot` of `node` was crossed; returns its kind.

    `height` is the flight, relative to the gap or stroke, below which an impact counts as the end of chatter.
    """
    w, f, trial = work
    nodes, par, aux = prog.nodes, prog.par, prog.ints
    kind, mo, po, xo = nodes[node, KIND], nodes[node, MODE], nodes[node, PAR], nodes[node, X]
    if kind == PWA:
        at = nodes[node, AUX] + 1 + 2 * mode[mo]
        before = mode[mo]
        value = par[po + 4 * before + slot]
        mode[mo] = aux[at + slot]
        row_a, row_b = po + 4 * before, po + 4 * mode[mo]
        jump = par[row_a + 3] + par[row_a + 2] * value - par[row_b + 3] - par[row_b + 2] * value
        return E_SWITCH if abs(jump) > 1e-12 * (1.0 + abs(value)) else E_CORNER
    if kind == QUANTIZER:
        mode[mo] += 1 if slot == 1 else -1
        return E_SWITCH
    if kind == PLAY:
        if mode[mo] != 0:
            mode[mo] = 0
            return E_DISENGAGE
        mode[mo] = 1 if slot == 1 else -1
        return E_ENGAGE
    if kind == RATE:
        if mode[mo] != 0:
            mode[mo] = 0
            return E_DISENGAGE
        # the sign of the input's rate tells the direction of the limit
        external(prog, drive, t, segment, w)
        signals(prog, t, x, mode, w)
        value = node_input(prog, node, 0, w)
        x[xo] = value
        reach = 1e-6
        for i in range(x.shape[0]):
            trial[i] = x[i] + reach * dx[i]
        external(prog, drive, t + reach, segment, w)
        signals(prog, t + reach, trial, mode, w)
        mode[mo] = 1 if node_input(prog, node, 0, w) > value else -1
        return E_ENGAGE

    bodies = aux[nodes[node, AUX] + A_BODIES]
    joint = aux[nodes[node, AUX] + A_JOINT]
    joined = bodies == 2 and closed(prog, node, mode)
    if slot <= G_BODY1:
        was_stuck = mode[mo + slot] == STUCK
        if not was_stuck:
            x[xo + 2 * slot + 1] = 0.0
            if joined:
                x[xo + 1] = x[xo + 3] = 0.0
        external(prog, drive, t, segment, w)
        signals(prog, t, x, mode, w)
        resolve(prog, node, t, x, mode, node_input(prog, node, 0, w), f, trial)
        if was_stuck:
            return E_BREAKAWAY
        return E_STICK if mode[mo + slot] == STUCK else E_REVERSAL
    if slot == G_JOINT_LOW or slot == G_JOINT_HIGH:
        if joint == J_ELASTIC:
            if mode[mo + JOINT] != 0:
                mode[mo + JOINT] = 0
                return E_RELEASE
            mode[mo + JOINT] = 1 if slot == G_JOINT_HIGH else -1
            return E_CONTACT
        if joined:
            external(prog, drive, t, segment, w)
            signals(prog, t, x, mode, w)
            resolve(prog, node, t, x, mode, node_input(prog, node, 0, w), f, trial)
            if mode[mo + JOINT] != 0:
                mode[mo + JOINT] = 0
                resolve(prog, node, t, x, mode, node_input(prog, node, 0, w), f, trial)
            return E_RELEASE
        return _impact(prog, drive, segment, t, x, mode, work, dx, g, node, 1 if slot == G_JOINT_HIGH else -1, height)
    return _stop(prog, drive, segment, t, x, mode, work, dx, g, node, 1 if slot == G_WALL_HIGH else -1, height)


@njit(cache=True, error_model="numpy", _nrt=False)
def _impact(prog, drive, segment, t, x, mode, work, dx, g, node, side, height):
    """Newton's impact in the joint; the end of chatter becomes sustained contact.

    Chatter: with restitution e < 1 and a steady pressing acceleration p the flights shrink geometrically and end after
    2 w / (p (1 - e)), w the rebound speed. Once a flight is lower than `height` of the gap (or of the position's own
    size) the rest of the chatter is passed over at once, momentum kept: an error of position of that order.
    """
    w, f, trial = work
    nodes, par = prog.nodes, prog.par
    mo, po, xo = nodes[node, MODE], nodes[node, PAR], nodes[node, X]
    m0, m1, gap = par[po + P_M0], par[po + P_M0 + 1], par[po + P_GAP]
    v0, v1 = x[xo + 1], x[xo + 3]
    common = (m0 * v0 + m1 * v1) / (m0 + m1)
    rebound = -par[po + P_REST] * (v1 - v0)
    if side * (v1 - v0) < 0.0:
        rebound = v1 - v0  # already parting: the margin was crossed by rounding alone
    x[xo + 1] = common - m1 / (m0 + m1) * rebound
    x[xo + 3] = common + m0 / (m0 + m1) * rebound
    x[xo + 2] = x[xo] + (gap if side > 0 else 0.0)
    mode[mo + JOINT] = 0
    external(prog, drive, t, segment, w)
    signals(prog, t, x, mode, w)
    force = node_input(prog, node, 0, w)
    resolve(prog, node, t, x, mode, force, f, trial)
    mechanism_rates(prog, node, t, x, mode, force, f, dx, g, False)
    press = side * (dx[xo + 3] - dx[xo + 1])
    speed = abs(rebound)
    # positions are known relative to their size only: a flight below that resolution is none
    lowest = height * (gap + 4.0 * abs(x[xo]))
    if press > 0.0 and speed * speed < 2.0 * press * lowest:
        x[xo + 1] = x[xo + 3] = common
        mode[mo + JOINT] = side
        signals(prog, t, x, mode, w)
        resolve(prog, node, t, x, mode, node_input(prog, node, 0, w), f, trial)
        return E_CONTACT if mode[mo + JOINT] != 0 else E_IMPACT
    return E_IMPACT


@njit(cache=True, error_model="numpy", _nrt=False)
def _stop(prog, drive, segment, t, x, mode, work, dx, g, node, side, height):
    """Newton's impact on an end stop; the end of chatter becomes rest at the stop."""
    w, f, trial = work
    nodes, par, aux = prog.nodes, prog.par, prog.ints
    mo, po, xo = nodes[node, MODE], nodes[node, PAR], nodes[node, X]
    driven = aux[nodes[node, AUX] + A_BODIES] - 1
    at, low, high = xo + 2 * driven, par[po + P_LOW], par[po + P_HIGH]
    rigid = aux[nodes[node, AUX] + A_JOINT] == J_RIGID
    joined = driven == 1 and closed(prog, node, mode)
    v = x[at + 1]
    rebound = -par[po + P_STOP_REST] * v if side * v > 0.0 else v
    x[at] = high if side > 0 else low
    x[at + 1] = rebound
    if rigid:
        x[xo] = x[at]
        x[xo + 1] = rebound
    elif joined:
        # the load flies on, or is hit at once when it stands between motor and stop
        mode[mo + JOINT] = 0 if rebound != v else mode[mo + JOINT]
    external(prog, drive, t, segment, w)
    signals(prog, t, x, mode, w)
    force = node_input(prog, node, 0, w)
    resolve(prog, node, t, x, mode, force, f, trial)
    mechanism_rates(prog, node, t, x, mode, force, f, dx, g, False)
    press, speed = side * dx[at + 1], abs(rebound)
    if speed == 0.0 or (press > 0.0 and speed * speed < 2.0 * press * height * (high - low + abs(x[at]))):
        x[at + 1] = 0.0
        if rigid:
            x[xo + 1] = 0.0
        mode[mo + WALL] = side
        signals(prog, t, x, mode, w)
        resolve(prog, node, t, x, mode, node_input(prog, node, 0, w), f, trial)
        return E_STOP_CONTACT
    return E_STOP


