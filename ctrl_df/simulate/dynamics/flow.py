# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""Signals and rates of a program in a fixed mode, and the margins of its events.

Every margin g is positive while the mode holds; an event is its passage below zero.
"""

from __future__ import annotations

import math

from ..compiler.compiled import part
from ..program.layout import (
    A_MEASURED,
    AUX,
    DELAY,
    FEED,
    H_NR,
    H_NS,
    H_SCRATCH,
    H_U,
    IN,
    KIND,
    LTI,
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
    RAMP,
    RATE,
    SAMPLED,
    SMOOTH,
    SYSTEM,
    G,
    X,
)
from ..program.pointers import call_input, call_smooth, call_system
from .history import delayed
from .mechanics import mechanism_rates


@part
def segment_from(drive, segment, t):
    """Return the segment of the sampled inputs that holds from `t` on."""
    while segment + 1 < drive.time.shape[0] and drive.time[segment + 1] <= t:
        segment += 1
    return segment


@part(inline=True)
def external(prog, drive, t, segment, w):
    """Fill the external inputs at time `t`, the samples taken from `segment`."""
    at = prog.ints[H_NS]
    if drive.address != 0:
        call_input(drive.address, t, w.address + 8 * at)
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
                value += c.real * math.cos(angle)
                if c.imag != 0.0:
                    value -= c.imag * math.sin(angle)
        w[at + i] = value


@part(inline=True)
def combine(prog, row, w):
    """Value of one linear combination of signals and external inputs."""
    value = 0.0
    for j in range(row + 1, row + 1 + 2 * prog.ints[row], 2):
        value += prog.par[prog.ints[j + 1]] * w[prog.ints[j]]
    return value


@part(inline=True)
def node_input(prog, node, k, w):
    """Input k of a node."""
    return combine(prog, prog.ints[prog.nodes[node, IN] + k], w)


@part(inline=True)
def product(par, row, count, vector, first):
    """One row of a matrix kept in ``par`` times ``vector[first : first + count]``."""
    value = 0.0
    for j in range(count):
        value += par[row + j] * vector[first + j]
    return value


@part
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
                row = po + nx * (nx + ni) + i * nx
                w[so + i] = product(par, row, nx, x, xo)
                if nodes[n, FEED] == 1:
                    row = po + nx * (nx + ni + nodes[n, NOUT]) + i * ni
                    w[so + i] += product(par, row, ni, w, ou)
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
            w[so] = call_smooth(prog.ints[nodes[n, AUX]], w[ou], par.address + 8 * po)
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
                x.address + 8 * xo,
                w.address + 8 * ou,
                w.address + 8 * prog.ints[H_SCRATCH],
                w.address + 8 * so,
                0,
            )
        elif kind == DELAY:
            w[so] = delayed(prog, n, t, w)


@part
def refresh(prog, drive, segment, t, x, mode, w):
    """Fill external inputs and signals; one copy of the code for all who are not in a hurry."""
    external(prog, drive, t, segment, w)
    signals(prog, t, x, mode, w)


@part(inline=True)
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
                dx[xo + i] = product(par, po + i * nx, nx, x, xo) + product(
                    par, po + nx * nx + i * ni, ni, w, ou
                )
        elif kind == PWA:
            if nodes[n, NX] == 1:
                dx[xo] = 0.0
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
                x.address + 8 * xo,
                w.address + 8 * ou,
                dx.address + 8 * xo,
                w.address + 8 * prog.ints[H_SCRATCH],
                1,
            )
        elif kind == DELAY:
            dx[xo] = 0.0


@part
def input_rates(prog, drive, segment, t, x, mode, work, dx, reach, g):
    """Margins that need the rate of an input: a play lets go when it turns, a limiter limits when it is fast.

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
                refresh(prog, drive, segment, t + side * reach, trial, mode, w)
                value = node_input(prog, n, 0, w)
                if side < 0:
                    before = value
                else:
                    rate = (value - before) / (2.0 * reach)
            g[go] = mode[mo] * rate if kind == PLAY else par[po] - abs(rate)
