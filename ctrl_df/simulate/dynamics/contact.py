# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""Mechanisms at an event: which way bodies start or stay, and what an impact leaves."""

from __future__ import annotations

import math

from ..compiler.compiled import part
from ..program.layout import (
    A_BODIES,
    A_BRISTLE,
    A_CONTACT,
    A_JOINT,
    A_NFRIC0,
    A_STOP,
    AUX,
    DIR0,
    DIR1,
    E_CONTACT,
    E_IMPACT,
    E_STOP,
    E_STOP_CONTACT,
    FREE,
    J_ELASTIC,
    J_IMPACT,
    J_RIGID,
    JOINT,
    MODE,
    P_GAP,
    P_HIGH,
    P_LOW,
    P_M0,
    P_REST,
    P_STOP_REST,
    PAR,
    STUCK,
    TOUCH,
    WALL,
    X,
)
from ..thresholds import ROUNDS
from .flow import node_input, refresh
from .mechanics import accelerate, closed, dry_level, smooth_forces


@part
def has_dry(prog, node, body):
    """Whether set-valued dry friction acts on a body."""
    ao = prog.nodes[node, AUX]
    if prog.ints[ao + A_NFRIC0 + body] == 0:
        return False
    return not (prog.ints[ao + A_BRISTLE] >= 0 and body == prog.ints[ao + A_BODIES] - 1)


@part
def tendency(f, up, down, wall):
    """Direction in which a body at rest starts under the force f, or 0 (held by friction or wall)."""
    if f > up and wall != 1:
        return 1
    if f < -down and wall != -1:
        return -1
    return 0


@part
def body_tendency(prog, node, body, f, wall):
    """Tendency of one body by itself."""
    up = dry_level(prog, node, body, 0.0, 1.0, 0.0, f)
    down = dry_level(prog, node, body, 0.0, -1.0, 0.0, f)
    return tendency(f[body], up, down, wall)


@part
def _direction(prog, node, body, d):
    return d if has_dry(prog, node, body) else FREE


@part
def resolve(prog, node, t, x, mode, force, f, dx):
    """Bring a mechanism's modes in line with its velocities and forces; returns whether any changed."""
    nodes, aux = prog.nodes, prog.ints
    xo, mo = nodes[node, X], nodes[node, MODE]
    bodies = aux[nodes[node, AUX] + A_BODIES]
    driven = bodies - 1
    joint = aux[nodes[node, AUX] + A_JOINT]
    old0, old1, old_joint, old_wall = mode[mo], mode[mo + 1], mode[mo + JOINT], mode[mo + WALL]
    old_touch = mode[mo + TOUCH]
    if joint == J_ELASTIC:
        _elastic_region(prog, node, x, mode)
    if aux[nodes[node, AUX] + A_CONTACT] >= 0:
        _touched(prog, node, x[xo + 2 * driven], mode)
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
                d = body_tendency(prog, node, b, f, wall)
                mode[mo + b] = STUCK if d == 0 else _direction(prog, node, b, d)
                if b == driven and d != 0:
                    mode[mo + WALL] = 0
    return (
        old0 != mode[mo]
        or old1 != mode[mo + 1]
        or old_joint != mode[mo + JOINT]
        or old_wall != mode[mo + WALL]
        or old_touch != mode[mo + TOUCH]
    )


@part
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


@part
def _touched(prog, node, position, mode):
    """Which yielding wall is touched; at its very face the mode stays."""
    po, at = prog.nodes[node, PAR], prog.nodes[node, MODE] + TOUCH
    if position > prog.par[po + P_HIGH]:
        mode[at] = 1
    elif position < prog.par[po + P_LOW]:
        mode[at] = -1
    elif prog.par[po + P_LOW] < position < prog.par[po + P_HIGH]:
        mode[at] = 0


@part
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
            f0 = f[0] - d * dry_level(prog, node, 0, 1.0, float(d), abs(v), f)
            f1 = f[1] - d * dry_level(prog, node, 1, 1.0, float(d), abs(v), f)
            if side * (m0 * (f0 + f1) / (m0 + m1) - f0) < 0.0:
                mode[mo + JOINT] = 0
        return
    d0 = body_tendency(prog, node, 0, f, 0)
    d1 = body_tendency(prog, node, 1, f, wall)
    if impact:
        a0 = 0.0 if d0 == 0 else (f[0] - d0 * dry_level(prog, node, 0, 1.0, float(d0), 0.0, f)) / m0
        a1 = 0.0 if d1 == 0 else (f[1] - d1 * dry_level(prog, node, 1, 1.0, float(d1), 0.0, f)) / m1
        if side * (a1 - a0) < 0.0:
            mode[mo + JOINT] = 0
            mode[mo + DIR0] = _separate(prog, node, 0, d0, 0)
            mode[mo + DIR1] = _separate(prog, node, 1, d1, wall)
            if d1 != 0:
                mode[mo + WALL] = 0
            return
    up = dry_level(prog, node, 0, 0.0, 1.0, 0.0, f) + dry_level(prog, node, 1, 0.0, 1.0, 0.0, f)
    down = dry_level(prog, node, 0, 0.0, -1.0, 0.0, f) + dry_level(prog, node, 1, 0.0, -1.0, 0.0, f)
    d = tendency(f[0] + f[1], up, down, wall)
    if d == 0:
        mode[mo + DIR0] = mode[mo + DIR1] = STUCK
    else:
        mode[mo + WALL] = 0
        mode[mo + DIR0] = _direction(prog, node, 0, d)
        mode[mo + DIR1] = _direction(prog, node, 1, d)


@part
def _separate(prog, node, body, d, wall):
    if d == 0:
        return STUCK if wall != 0 or has_dry(prog, node, body) else FREE
    return _direction(prog, node, body, d)


@part
def impact(prog, drive, segment, t, x, mode, work, dx, g, node, side, height):
    """Newton's impact in the joint; the end of chatter becomes sustained contact.

    Chatter: with restitution e < 1 and a steady pressing acceleration p the flights shrink geometrically and
    end after 2 w / (p (1 - e)), w the rebound speed. Once a flight is lower than `height` of the gap (or of
    the position's own size) the rest of the chatter is passed over at once, momentum kept: an error of
    position of that order. A motor driven against a stop close behind it is hit as often as it takes, see
    `_between`.
    """
    w, f, trial = work
    nodes, par = prog.nodes, prog.par
    mo, po, xo = nodes[node, MODE], nodes[node, PAR], nodes[node, X]
    m0, m1, gap = par[po + P_M0], par[po + P_M0 + 1], par[po + P_GAP]
    v0, v1 = x[xo + 1], x[xo + 3]
    face, wall = (gap if side > 0 else 0.0), _wall_at(prog, node, x, mode, height)
    common, rebound = _collision(v0, v1, m0, m1, par[po + P_REST])
    if side * (v1 - v0) < 0.0:
        rebound = v1 - v0  # already parting: the margin was crossed by rounding alone
    if wall == -side:
        x[xo + 2] = _stop_place(prog, node, wall)
        x[xo] = x[xo + 2] - face
    else:
        x[xo + 2] = x[xo] + face
    x[xo + 1] = common - m1 / (m0 + m1) * rebound
    x[xo + 3] = common + m0 / (m0 + m1) * rebound
    if wall == -side:
        load, motor = _between(
            wall * v0, wall * v1, m0, m1, par[po + P_REST], par[po + P_STOP_REST]
        )  # fmt: skip
        x[xo + 1], x[xo + 3] = wall * load, wall * motor
        common, rebound = (m0 * x[xo + 1] + m1 * x[xo + 3]) / (m0 + m1), x[xo + 3] - x[xo + 1]
        mode[mo + WALL] = wall if motor == 0.0 else 0
    mode[mo + JOINT] = 0
    if wall != 0 and _rests(prog, drive, segment, t, x, mode, work, node, side, wall, height):
        return E_CONTACT
    refresh(prog, drive, segment, t, x, mode, w)
    force = node_input(prog, node, 0, w)
    resolve(prog, node, t, x, mode, force, f, trial)
    accelerate(prog, node, t, x, mode, force, f, dx, g)
    press = side * (dx[xo + 3] - dx[xo + 1])
    speed = abs(rebound)
    if press > 0.0 and speed * speed < 2.0 * press * _least_flight(prog, node, x, height):
        x[xo + 1] = x[xo + 3] = common
        mode[mo + JOINT] = side
        refresh(prog, drive, segment, t, x, mode, w)
        resolve(prog, node, t, x, mode, node_input(prog, node, 0, w), f, trial)
        return E_CONTACT if mode[mo + JOINT] != 0 else E_IMPACT
    return E_IMPACT


@part
def stop(prog, drive, segment, t, x, mode, work, dx, g, node, side, height):
    """Newton's impact on an end stop; the end of chatter becomes rest at the stop.

    A load in contact flies on; where it stands behind the motor it hits it at once (`_between`).
    """
    w, f, trial = work
    nodes, par, aux = prog.nodes, prog.par, prog.ints
    mo, po, xo = nodes[node, MODE], nodes[node, PAR], nodes[node, X]
    driven = aux[nodes[node, AUX] + A_BODIES] - 1
    at = xo + 2 * driven
    rigid = aux[nodes[node, AUX] + A_JOINT] == J_RIGID
    joint = mode[mo + JOINT] if driven == 1 and not rigid and closed(prog, node, mode) else 0
    v = x[at + 1]
    rebound = -par[po + P_STOP_REST] * v if side * v > 0.0 else v
    x[at] = _stop_place(prog, node, side)
    x[at + 1] = rebound
    if rigid:
        x[xo] = x[at]
        x[xo + 1] = rebound
    elif joint != 0 and rebound != v:
        x[xo] = x[at] - (par[po + P_GAP] if joint > 0 else 0.0)
        mode[mo + JOINT] = 0
        if joint == -side:
            m0, m1 = par[po + P_M0], par[po + P_M0 + 1]
            load, motor = _between(side * v, side * rebound, m0, m1, par[po + P_REST], par[po + P_STOP_REST])
            x[xo + 1], x[at + 1] = side * load, side * motor
        if _rests(prog, drive, segment, t, x, mode, work, node, joint, side, height):
            return E_STOP_CONTACT
    refresh(prog, drive, segment, t, x, mode, w)
    force = node_input(prog, node, 0, w)
    resolve(prog, node, t, x, mode, force, f, trial)
    accelerate(prog, node, t, x, mode, force, f, dx, g)
    press, speed = side * dx[at + 1], abs(x[at + 1])
    lowest = _least_flight_at_stop(prog, node, x[at], height)
    if speed == 0.0 or (press > 0.0 and speed * speed < 2.0 * press * lowest):
        x[at + 1] = 0.0
        if rigid:
            x[xo + 1] = 0.0
        mode[mo + WALL] = side
        refresh(prog, drive, segment, t, x, mode, w)
        resolve(prog, node, t, x, mode, node_input(prog, node, 0, w), f, trial)
        return E_STOP_CONTACT
    return E_STOP


@part
def _least_flight(prog, node, x, height):
    """Flight in the gap below which there is none [m]: positions are known relative to their size only."""
    return height * (prog.par[prog.nodes[node, PAR] + P_GAP] + 4.0 * abs(x[prog.nodes[node, X]]))


@part
def _least_flight_at_stop(prog, node, place, height):
    """Do the same between the stops."""
    po = prog.nodes[node, PAR]
    return height * (prog.par[po + P_HIGH] - prog.par[po + P_LOW] + abs(place))


@part
def _stop_place(prog, node, side):
    """Where the stop of a side stands [m]."""
    return prog.par[prog.nodes[node, PAR] + (P_HIGH if side > 0 else P_LOW)]


@part
def _wall_at(prog, node, x, mode, height):
    """Side of the stop at which the motor of two stands, or off which it flies too low to count; 0: none."""
    ao, wall = prog.nodes[node, AUX], mode[prog.nodes[node, MODE] + WALL]
    if prog.ints[ao + A_STOP] != 1 or wall != 0:
        return wall
    place = x[prog.nodes[node, X] + 2]
    lowest = _least_flight_at_stop(prog, node, place, height)
    for side in (-1, 1):
        if side * (_stop_place(prog, node, side) - place) < lowest:
            return side
    return 0


@part(inline=True)
def _collision(v0, v1, m0, m1, e):
    """Speed of the common centre of two bodies that collide, and that of the second over the first after."""
    return (m0 * v0 + m1 * v1) / (m0 + m1), -e * (v1 - v0)


@part
def _between(v0, v1, m0, m1, e, e_stop):
    """Speeds after all that follows at once where a load hits a motor that has a stop close behind it.

    Speeds toward the stop, v0 of the load and v1 of the motor. As long as v0 > v1 they collide, and a motor
    that is thrown against the stop comes back by `e_stop`: one round, which takes (v0, v1) to a matrix times
    it, whose determinant is e e_stop. Either the bodies part after some rounds, or they never do: with
    real eigenvalues l1 >= l2 >= 0 each round brings v1/v0 closer to the eigenvector of l1 < 1, unless it was
    below that of l2. Infinitely many collisions then bring both to rest at once, the inelastic collapse of
    McNamara & Young (1992).
    """
    share0, share1 = m0 / (m0 + m1), m1 / (m0 + m1)
    kept = share0 - e * share1
    half, product = 0.5 * (kept - e_stop * (share1 - e * share0)), e * e_stop
    if v0 > max(v1, 0.0) and half > 0.0 and half * half >= product:
        # l2, without a difference of nearly equal numbers
        least = product / (half + math.sqrt(half * half - product))
        if share1 * (1.0 + e) * v1 >= (least - kept) * v0:
            return 0.0, 0.0
    for _round in range(ROUNDS):
        if not v0 > v1:
            return v0, v1
        common, rebound = _collision(v0, v1, m0, m1, e)
        v0, v1 = common - share1 * rebound, common + share0 * rebound
        if v1 > 0.0:
            v1 *= -e_stop
    return 0.0, 0.0


@part
def _rests(prog, drive, segment, t, x, mode, work, node, side, wall, height):
    """Whether load and motor come to rest in contact, `side`, with the motor at a stop, `wall`; sets them so.

    They do where both contacts are pressed together and the flights off either are too low to count: that of
    the load off the motor that is held, and that of both off the stop.
    """
    w, f, trial = work
    po, mo, xo = prog.nodes[node, PAR], prog.nodes[node, MODE], prog.nodes[node, X]
    m0, m1 = prog.par[po + P_M0], prog.par[po + P_M0 + 1]
    x0, v0, x1, v1 = x[xo], x[xo + 1], x[xo + 2], x[xo + 3]
    dir0, dir1, joint, wall_before = mode[mo + DIR0], mode[mo + DIR1], mode[mo + JOINT], mode[mo + WALL]
    x[xo + 2] = _stop_place(prog, node, wall)
    x[xo] = x[xo + 2] - (prog.par[po + P_GAP] if side > 0 else 0.0)
    x[xo + 1] = x[xo + 3] = 0.0
    mode[mo + JOINT], mode[mo + WALL] = side, wall
    refresh(prog, drive, segment, t, x, mode, w)
    resolve(prog, node, t, x, mode, node_input(prog, node, 0, w), f, trial)
    if mode[mo + JOINT] == side and mode[mo + WALL] == wall:
        press, both = -side * f[0] / m0, wall * (f[0] + f[1]) / (m0 + m1)
        low = 2.0 * press * _least_flight(prog, node, x, height)
        low_both = 2.0 * both * _least_flight_at_stop(prog, node, x[xo + 2], height)
        still = v0 == 0.0 and v1 == 0.0
        if still or ((v1 - v0) ** 2 < low and max(v0 * v0, v1 * v1) < low_both):
            return True
    x[xo], x[xo + 1], x[xo + 2], x[xo + 3] = x0, v0, x1, v1
    mode[mo + DIR0], mode[mo + DIR1], mode[mo + JOINT], mode[mo + WALL] = dir0, dir1, joint, wall_before
    return False
