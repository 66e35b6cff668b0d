# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""What happens at an event, and how a program settles into consistent modes."""

from __future__ import annotations

from ...thresholds import ROUNDED
from ..compiler.compiled import part
from ..program.layout import (
    A_BODIES,
    A_CONTACT,
    A_JOINT,
    AUX,
    E_BREAKAWAY,
    E_CONTACT,
    E_CORNER,
    E_DISENGAGE,
    E_ENGAGE,
    E_RELEASE,
    E_REVERSAL,
    E_STICK,
    E_SWITCH,
    G_BODY1,
    G_JOINT_HIGH,
    G_JOINT_LOW,
    G_WALL_HIGH,
    H_SCRATCH,
    H_U,
    J_ELASTIC,
    JOINT,
    KIND,
    MECHANISM,
    MODE,
    NIN,
    NOUT,
    NX,
    OUT,
    PAR,
    PLAY,
    PWA,
    QUANTIZER,
    RATE,
    STUCK,
    TOUCH,
    X,
)
from ..thresholds import INPUT_JUMPED, ROUNDING, SETTLING
from .contact import impact, resolve, stop
from .flow import external, node_input, product, refresh, signals
from .mechanics import closed


@part
def settle(prog, drive, segment, t, x, mode, work, dx):
    """Bring all modes in line with the state; returns False if they keep changing (a sliding mode).

    Nodes stand in an order in which each follows those it reads: what has memory sees them settled.
    """
    w, f, trial = work
    nodes, par = prog.nodes, prog.par
    for _pass in range(SETTLING):
        changed = False
        external(prog, drive, t, segment, w)
        signals(prog, t, x, mode, w)
        for n in range(nodes.shape[0]):
            kind, mo, po = nodes[n, KIND], nodes[n, MODE], nodes[n, PAR]
            altered = False
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
                    altered = True
                keep_branch(prog, n, x, mode)
            elif kind == QUANTIZER:
                center = par[po] * mode[mo]
                value = node_input(prog, n, 0, w)
                if abs(value - center) > 0.5 * par[po] + ROUNDING * abs(center):
                    mode[mo] = round(value / par[po])
                    altered = True
            elif kind == PLAY:
                value, out = node_input(prog, n, 0, w), x[nodes[n, X]]
                gap, half, m = value - out, 0.5 * par[po], mode[mo]
                if m * gap < half - ROUNDING * (abs(value) + abs(out)):
                    m = 0  # a jump of the input led away from that side
                if abs(gap) > half:
                    m = 1 if gap > 0.0 else -1
                if m != 0:
                    x[nodes[n, X]] += gap - m * half
                if m != mode[mo]:
                    mode[mo] = m
                    altered = True
            elif kind == RATE:
                value, out = node_input(prog, n, 0, w), x[nodes[n, X]]
                gap = value - out
                if mode[mo] == 0 and abs(gap) > ROUNDING * (abs(value) + abs(out)):
                    # a jump of the input cannot be followed at once
                    mode[mo] = 1 if gap > 0 else -1
                    altered = True
                elif mode[mo] * gap < 0.0:
                    mode[mo] = -mode[mo]
                    altered = True
            elif kind == MECHANISM:
                changed |= resolve(prog, n, t, x, mode, node_input(prog, n, 0, w), f, trial)
            if altered:
                changed = True
                refresh(prog, drive, segment, t, x, mode, w)
        if not changed:
            return True
    return False


@part
def keep_branch(prog, n, x, mode):
    """Write the branch of an element with memory into its state: -1 for the lowest, 1 for the highest."""
    if prog.nodes[n, NX] == 1:
        regions = prog.ints[prog.nodes[n, AUX]] - 1
        x[prog.nodes[n, X]] = 2.0 * mode[prog.nodes[n, MODE]] / (regions - 1) - 1.0


@part
def take_branches(prog, x, mode):
    """Begin elements with memory on the branch that their state says: of zero or above, the highest."""
    for n in range(prog.nodes.shape[0]):
        if prog.nodes[n, KIND] == PWA and prog.nodes[n, NX] == 1:
            highest = prog.ints[prog.nodes[n, AUX]] - 2
            mode[prog.nodes[n, MODE]] = highest if x[prog.nodes[n, X]] >= 0.0 else 0


@part
def some_input_jumped(prog, drive, segment, t, x, x1, mode, work, length):
    """Whether some input jumped within the step from `x` to `x1` that ends at `t`: see `input_jumped`."""
    w, _, _ = work
    refresh(prog, drive, segment, t, x1, mode, w)
    for n in range(prog.nodes.shape[0]):
        if input_jumped(prog, n, x, mode, length, w):
            return True
    return False


@part
def input_jumped(prog, n, x, mode, length, w):
    """Whether an input jumped, by what no margin shows: it led a play back, or outran a rate limiter.

    `x`: as the step of this length [s] began; `w`: signals at its end.
    """
    nodes = prog.nodes
    kind, m = nodes[n, KIND], mode[nodes[n, MODE]]
    if kind != PLAY and kind != RATE:
        return False
    old, new = x[nodes[n, X]], w[nodes[n, OUT]]
    rounding = ROUNDING * (abs(old) + abs(new) + abs(node_input(prog, n, 0, w)))
    if kind == PLAY:
        return m * (new - old) < -rounding
    return m == 0 and abs(new - old) > (1.0 + INPUT_JUMPED) * prog.par[nodes[n, PAR]] * length + rounding


@part
def keep_output(prog, n, x, w):
    """Write the output of a play or a rate limiter, as signals have it, into its state."""
    if prog.nodes[n, KIND] == PLAY or prog.nodes[n, KIND] == RATE:
        x[prog.nodes[n, X]] = w[prog.nodes[n, OUT]]


@part
def track(prog, drive, segment, t, x, mode, work, length):
    """Write the outputs of engaged plays and tracking rate limiters into their states.

    `length`: of the step that ends here [s]; negative at an event, which tells by itself what happens. Where
    an input jumped (`input_jumped`) the state is the one before; returns whether any did.
    """
    w, _, _ = work
    jumped = False
    refresh(prog, drive, segment, t, x, mode, w)
    for n in range(prog.nodes.shape[0]):
        if length >= 0.0 and input_jumped(prog, n, x, mode, length, w):
            jumped = True
        else:
            keep_output(prog, n, x, w)
    return jumped


@part
def answers_at_once(prog, node):
    """Whether a sampled controller has a direct path: its new output depends on what it reads (D != 0)."""
    nodes = prog.nodes
    ni, no = nodes[node, NIN], nodes[node, NOUT]
    nd = nodes[node, NX] - no
    first = nodes[node, PAR] + nd * (nd + ni + no)
    for i in range(first, first + no * ni):
        if prog.par[i] != 0.0:
            return True
    return False


@part
def hold(prog, node, x, w):
    """Put out the new output of a sampled controller and hold it."""
    nodes, par, ou = prog.nodes, prog.par, prog.ints[H_U]
    ni, no, xo, po = nodes[node, NIN], nodes[node, NOUT], nodes[node, X], nodes[node, PAR]
    nd = nodes[node, NX] - no
    for k in range(ni):
        w[ou + k] = node_input(prog, node, k, w)
    for i in range(no):
        from_state = product(par, po + nd * (nd + ni) + i * nd, nd, x, xo)
        x[xo + nd + i] = from_state + product(par, po + nd * (nd + ni + no) + i * ni, ni, w, ou)


@part
def advance_state(prog, node, x, w):
    """Take the state of a sampled controller to the next sample, by what it reads now."""
    nodes, par = prog.nodes, prog.par
    ou, scratch = prog.ints[H_U], prog.ints[H_SCRATCH]
    ni, xo, po = nodes[node, NIN], nodes[node, X], nodes[node, PAR]
    nd = nodes[node, NX] - nodes[node, NOUT]
    for k in range(ni):
        w[ou + k] = node_input(prog, node, k, w)
    for i in range(nd):
        from_state = product(par, po + i * nd, nd, x, xo)
        w[scratch + i] = from_state + product(par, po + nd * nd + i * ni, ni, w, ou)
    for i in range(nd):
        x[xo + i] = w[scratch + i]


@part
def event(prog, drive, segment, t, x, mode, work, dx, g, node, slot, height, reach):
    """Apply the event whose margin `slot` of `node` was crossed; returns its kind.

    `height` is the flight, relative to the gap or stroke, below which an impact counts as the end of chatter;
    `reach` the time [s] over which rates of inputs are taken.
    """
    w, f, trial = work
    nodes, par, aux = prog.nodes, prog.par, prog.ints
    kind, mo, po, xo = nodes[node, KIND], nodes[node, MODE], nodes[node, PAR], nodes[node, X]
    if kind == PWA:
        at = nodes[node, AUX] + 1 + 2 * mode[mo]
        before = mode[mo]
        value = par[po + 4 * before + slot]
        mode[mo] = aux[at + slot]
        keep_branch(prog, node, x, mode)
        row_a, row_b = po + 4 * before, po + 4 * mode[mo]
        jump = par[row_a + 3] + par[row_a + 2] * value - par[row_b + 3] - par[row_b + 2] * value
        sizes = (
            abs(par[row_a + 3])
            + abs(par[row_a + 2] * value)
            + abs(par[row_b + 3])
            + abs(par[row_b + 2] * value)
        )
        return E_SWITCH if abs(jump) > ROUNDED * sizes else E_CORNER
    if kind == QUANTIZER:
        mode[mo] += 1 if slot == 1 else -1
        return E_SWITCH
    if kind == PLAY:
        if mode[mo] != 0:
            # free from here on: rounding must not find the output at that side of the gap still
            refresh(prog, drive, segment, t, x, mode, w)
            x[xo] += mode[mo] * ROUNDING * (abs(node_input(prog, node, 0, w)) + abs(x[xo]))
            mode[mo] = 0
            return E_DISENGAGE
        mode[mo] = 1 if slot == 1 else -1
        return E_ENGAGE
    if kind == RATE:
        if mode[mo] != 0:
            # caught up: what rounding leaves of the way is no jump of the input
            refresh(prog, drive, segment, t, x, mode, w)
            x[xo] = node_input(prog, node, 0, w)
            mode[mo] = 0
            return E_DISENGAGE
        # the sign of the input's rate tells the direction of the limit
        refresh(prog, drive, segment, t, x, mode, w)
        value = node_input(prog, node, 0, w)
        x[xo] = value
        for i in range(x.shape[0]):
            trial[i] = x[i] + reach * dx[i]
        refresh(prog, drive, segment, t + reach, trial, mode, w)
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
        refresh(prog, drive, segment, t, x, mode, w)
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
            refresh(prog, drive, segment, t, x, mode, w)
            resolve(prog, node, t, x, mode, node_input(prog, node, 0, w), f, trial)
            if mode[mo + JOINT] != 0:
                mode[mo + JOINT] = 0
                resolve(prog, node, t, x, mode, node_input(prog, node, 0, w), f, trial)
            return E_RELEASE
        return impact(
            prog, drive, segment, t, x, mode, work, dx, g, node, 1 if slot == G_JOINT_HIGH else -1, height
        )
    if aux[nodes[node, AUX] + A_CONTACT] >= 0:
        if mode[mo + TOUCH] != 0:
            mode[mo + TOUCH] = 0
            return E_RELEASE
        mode[mo + TOUCH] = 1 if slot == G_WALL_HIGH else -1
        return E_CONTACT
    return stop(prog, drive, segment, t, x, mode, work, dx, g, node, 1 if slot == G_WALL_HIGH else -1, height)
