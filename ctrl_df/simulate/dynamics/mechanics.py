# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""Forces and accelerations of a mechanism in a fixed mode, and the margins of its events."""

from __future__ import annotations

import math

from ..compiler.compiled import part
from ..program.layout import (
    A_ASKING,
    A_BODIES,
    A_BRISTLE,
    A_CONTACT,
    A_COUPLING,
    A_JOINT,
    A_LAWS,
    A_NFORCE,
    A_NFRIC0,
    A_PRESLIDING,
    A_STOP,
    ASKING,
    AUX,
    CURVED,
    DIR0,
    DIR1,
    DRIVING,
    F_ASKED,
    F_GIVEN,
    F_LAW_INPUTS,
    FREE,
    G_BODY1,
    G_JOINT_HIGH,
    G_JOINT_LOW,
    G_WALL_HIGH,
    G_WALL_LOW,
    J_IMPACT,
    J_NONE,
    J_RIGID,
    JOINT,
    KIND,
    MECHANISM,
    MODE,
    P_GAP,
    P_HIGH,
    P_LOW,
    P_M0,
    PAR,
    R_ADDRESS,
    R_BODY,
    R_PAR,
    R_SIZE,
    R_SORT,
    R_STATE,
    STUCK,
    TOUCH,
    WALL,
    G,
    X,
)
from ..program.pointers import call_asking, call_force, call_friction, call_presliding


@part(inline=True)
def level(prog, first, count, moving, direction, speed, place, drive, load):
    """Dry friction level of a chain of laws [N]."""
    value = 0.0
    base = prog.par.address
    for i in range(first, first + count * R_SIZE, R_SIZE):
        law, at = prog.ints[i + R_ADDRESS], base + 8 * prog.ints[i + R_PAR]
        if prog.ints[i + R_SORT] & ASKING != 0:
            value = call_asking(law, moving, direction, speed, value, at, place, drive, load)
        else:
            value = call_friction(law, moving, direction, speed, value, at)
    return value


@part(inline=True)
def smooth_forces(prog, node, t, x, mode, force, f, dx):
    """Fill f[0:2] with the forces on the bodies but dry friction and contact; writes internal rates to dx.

    f[F_ASKED] says which sorts of laws are asked, f[F_GIVEN:] what acts besides.
    """
    nodes, par, aux = prog.nodes, prog.par, prog.ints
    xo, po, ao = nodes[node, X], nodes[node, PAR], nodes[node, AUX]
    driven = aux[ao + A_BODIES] - 1
    asked = int(f[F_ASKED])
    f[0], f[1] = f[F_GIVEN], f[F_GIVEN + 1]
    f[driven] += force
    first, drive = aux[ao + A_LAWS], force
    for i in range(first, first + aux[ao + A_NFORCE] * R_SIZE, R_SIZE):
        if aux[i + R_SORT] & asked != 0:
            b = aux[i + R_BODY]
            value = _force(prog, i, xo, t, x[xo + 2 * b], x[xo + 2 * b + 1], x, dx)
            f[b] += value
            if aux[i + R_SORT] & DRIVING != 0:
                drive += value
    if aux[ao + A_CONTACT] >= 0:
        i, side = first + aux[ao + A_CONTACT] * R_SIZE, mode[nodes[node, MODE] + TOUCH]
        if aux[i + R_SORT] & asked != 0:
            at, depth = xo + 2 * driven, 0.0
            if side != 0:
                # a step may end beyond the release that is yet to be located
                depth = max(x[at] - par[po + P_HIGH] if side > 0 else par[po + P_LOW] - x[at], 0.0)
            # away from the wall its states go on
            f[driven] -= side * max(_force(prog, i, xo, t, depth, side * x[at + 1], x, dx), 0.0)
    pull = 0.0
    if aux[ao + A_COUPLING] >= 0:
        i, region = first + aux[ao + A_COUPLING] * R_SIZE, mode[nodes[node, MODE] + JOINT]
        if aux[i + R_SORT] & asked != 0:
            bend = rate = 0.0
            if region != 0:
                bend = x[xo + 2] - x[xo] - (par[po + P_GAP] if region > 0 else 0.0)
                rate = x[xo + 3] - x[xo + 1]
            pull = _force(prog, i, xo, t, bend, rate, x, dx)
            if region == 0:
                pull = 0.0  # in the gap; its states go on
            f[0] += pull
            f[1] -= pull
    if aux[ao + A_ASKING] != 0:
        _tell(prog, node, x, mode, drive, pull, f)
    if aux[ao + A_PRESLIDING] >= 0 and asked & CURVED != 0:
        v = x[xo + 2 * driven + 1]
        start = friction_start(prog, node, driven)
        law_inputs, count = F_LAW_INPUTS + 3 * driven, aux[ao + A_NFRIC0 + driven]
        sense = 1.0 if v >= 0 else -1.0
        g = level(prog, start, count, 1.0, sense, abs(v), f[law_inputs], f[law_inputs + 1], f[law_inputs + 2])
        i, z = first + aux[ao + A_PRESLIDING] * R_SIZE, 8 * (xo + aux[ao + A_BRISTLE])
        p = par.address + 8 * aux[i + R_PAR]
        f[driven] += call_presliding(aux[i + R_ADDRESS], v, g, x.address + z, p, dx.address + z)


@part(inline=True)
def _force(prog, law, first, t, x, v, states, dx):
    """Call the force law of a record; `first` is where the states of its mechanism begin."""
    z = 8 * (first + prog.ints[law + R_STATE])
    p = prog.par.address + 8 * prog.ints[law + R_PAR]
    return call_force(prog.ints[law + R_ADDRESS], t, x, v, states.address + z, p, dx.address + z)


@part(inline=True)
def _tell(prog, node, x, mode, push, pull, f):
    """Write what friction laws that ask are told: place, drive, and the load against it.

    The load's drive is the elastic joint. Bodies that move as one have drive and load in common.
    """
    xo, driven = prog.nodes[node, X], prog.ints[prog.nodes[node, AUX] + A_BODIES] - 1
    joined = driven == 1 and closed(prog, node, mode)
    for b in range(driven + 1):
        at, drive = F_LAW_INPUTS + 3 * b, push if b == driven else pull
        f[at], f[at + 1], f[at + 2] = x[xo + 2 * b], drive, drive - f[b]
        if joined:
            f[at + 1], f[at + 2] = push, push - f[0] - f[1]


@part(inline=True)
def mechanism(prog):
    """Index of the first mechanism among the nodes; their number if there is none."""
    for node in range(prog.nodes.shape[0]):
        if prog.nodes[node, KIND] == MECHANISM:
            return node
    return prog.nodes.shape[0]


@part(inline=True)
def friction_start(prog, node, body):
    """Index of the first friction law of a body."""
    ao = prog.nodes[node, AUX]
    start = prog.ints[ao + A_LAWS] + R_SIZE * prog.ints[ao + A_NFORCE]
    return start if body == 0 else start + R_SIZE * prog.ints[ao + A_NFRIC0]


@part(inline=True)
def _asked(prog, node, body, f):
    """Whether the friction laws of a body are among those asked; there is one at least."""
    return prog.ints[friction_start(prog, node, body) + R_SORT] & int(f[F_ASKED]) != 0


@part(inline=True)
def curved_forces(prog, node, t, x, mode, f, dx):
    """Fill f[0:2] with what the curved laws add to the forces on the bodies; writes internal rates to dx.

    f[F_ASKED] has to be CURVED.
    """
    smooth_forces(prog, node, t, x, mode, 0.0, f, dx)
    xo, mo = prog.nodes[node, X], prog.nodes[node, MODE]
    for b in range(prog.ints[prog.nodes[node, AUX] + A_BODIES]):
        d = mode[mo + b]
        if (d == 1 or d == -1) and _asked(prog, node, b, f):
            f[b] -= d * dry_level(prog, node, b, 1.0, float(d), abs(x[xo + 2 * b + 1]), f)


@part(inline=True)
def dry_level_at(prog, node, body, moving, direction, speed, place, drive, load):
    """Dry friction level of a body that is not carried by a bristle [N]."""
    ao = prog.nodes[node, AUX]
    count = prog.ints[ao + A_NFRIC0 + body]
    if count == 0 or (prog.ints[ao + A_BRISTLE] >= 0 and body == prog.ints[ao + A_BODIES] - 1):
        return 0.0
    first = friction_start(prog, node, body)
    return level(prog, first, count, moving, direction, speed, place, drive, load)


@part(inline=True)
def dry_level(prog, node, body, moving, direction, speed, f):
    """Return the same where `smooth_forces` has left in `f` what laws that ask are told."""
    at = F_LAW_INPUTS + 3 * body
    return dry_level_at(prog, node, body, moving, direction, speed, f[at], f[at + 1], f[at + 2])


@part(inline=True)
def closed(prog, node, mode):
    """Whether the two bodies move as one (rigid joint, or impact joint in contact)."""
    joint = prog.ints[prog.nodes[node, AUX] + A_JOINT]
    return joint == J_RIGID or (joint == J_IMPACT and mode[prog.nodes[node, MODE] + JOINT] != 0)


@part(inline=True)
def hold_margin(prog, node, body, f, wall):
    """How far a stuck body is from breaking away [N]; at a wall only away from it."""
    up = dry_level(prog, node, body, 0.0, 1.0, 0.0, f) - f[body]
    down = dry_level(prog, node, body, 0.0, -1.0, 0.0, f) + f[body]
    if wall > 0:
        return down
    if wall < 0:
        return up
    return min(up, down)


@part(inline=True)
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
        if (d == 1 or d == -1) and _asked(prog, node, b, f):
            drag = d * dry_level(prog, node, b, 1.0, float(d), abs(x[xo + 2 * b + 1]), f)
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
                    g[go + b] = hold_margin(prog, node, b, f, wall if b == driven else 0)
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
    if want_g and aux[ao + A_CONTACT] >= 0:
        position, touched = x[xo + 2 * driven], mode[mo + TOUCH]
        if touched <= 0:
            g[go + G_WALL_LOW] = (position - par[po + P_LOW]) * (1.0 if touched == 0 else -1.0)
        if touched >= 0:
            g[go + G_WALL_HIGH] = (par[po + P_HIGH] - position) * (1.0 if touched == 0 else -1.0)


@part(inline=True)
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
    up = dry_level(prog, node, 0, 0.0, 1.0, 0.0, f) + dry_level(prog, node, 1, 0.0, 1.0, 0.0, f)
    down = dry_level(prog, node, 0, 0.0, -1.0, 0.0, f) + dry_level(prog, node, 1, 0.0, -1.0, 0.0, f)
    net = f[0] + f[1]
    if wall > 0:
        g[go + G_BODY1] = down + net
    elif wall < 0:
        g[go + G_BODY1] = up - net
    else:
        g[go + G_BODY1] = min(up - net, down + net)
    if impact:
        # neither does the motor draw back, which a stop behind it does not let it, nor the load run ahead
        if wall != -side:
            g[go + G_JOINT_LOW] = side * f[1] + dry_level(prog, node, 1, 0.0, -float(side), 0.0, f)
        g[go + G_JOINT_HIGH] = dry_level(prog, node, 0, 0.0, float(side), 0.0, f) - side * f[0]


@part
def accelerate(prog, node, t, x, mode, force, f, dx, g):
    """Write the accelerations of a mechanism to dx; one copy of the code for all who are not in a hurry."""
    mechanism_rates(prog, node, t, x, mode, force, f, dx, g, False)
