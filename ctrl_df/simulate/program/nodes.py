"""One node for each elementary part: its kind, sizes, parameters, laws and initial modes."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import control as ct
import numpy as np

from ...blocks.core import ELASTIC, IMPACT, RIGID, Core
from ...blocks.primitives import Delay, Lag, PiecewiseAffine, Play, Quantizer, Ramp, RateLimiter, Smooth
from ...blocks.stated import stated_parameters
from ...checks import returned, shown
from ..thresholds import PROBED_INPUTS
from . import layout as L
from .pointers import address, callback, gave_nan

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
    laws: list[tuple[int, int, int, int, int]] = field(
        default_factory=list
    )  # address, par offset, state offset, body, sort
    start: Sequence[int] = ()  # initial modes
    affine: bool = False  # whether its rates, in any mode, are an affine function of state, inputs and time


def lti_node(system, x0) -> Node:
    """Node of a continuous linear system."""
    if system.dt not in (None, 0) and system.dt is not True and float(system.dt) > 0:
        raise ValueError(
            f"event_response runs in continuous time; got a discrete system with dt={system.dt}. "
            "Use closed_loop(..., dt=) or ctrl_df.sampled for a digital controller."
        )
    ss: Any = ct.ss(system)
    a, b, c, d = (np.asarray(m, float) for m in (ss.A, ss.B, ss.C, ss.D))
    par = np.concatenate([a.ravel(), b.ravel(), c.ravel(), d.ravel()])
    return Node(L.LTI, b.shape[1], c.shape[0], x0, a.shape[0], par, feed=int(np.any(d != 0)), affine=True)


def sampled_node(sampled, x0) -> Node:
    """Node of a sampled controller: its matrices, then its period."""
    a, b, c, d, dt = sampled
    par = np.concatenate([np.ravel(a), np.ravel(b), np.ravel(c), np.ravel(d), [dt]])
    nd, ni, no = np.shape(a)[0], np.shape(b)[1], np.shape(c)[0]
    return Node(L.SAMPLED, ni, no, x0, nd + no, par, affine=True)


def primitive_node(primitive, x0, branch: bool = False) -> Node:
    """Node of a signal element; `branch`: whether a state tells the branch of one with memory."""
    if isinstance(primitive, PiecewiseAffine):
        p = primitive
        par = [v for row in zip(p.low, p.high, p.slope, p.intercept, strict=True) for v in row]
        aux = [len(p.low) + 1] + [v for pair in zip(p.below, p.above, strict=True) for v in pair]
        return Node(L.PWA, 1, 1, x0, int(branch), par, 1, 2, aux, feed=1, start=[p.start], affine=True)
    if isinstance(primitive, Quantizer):
        return Node(L.QUANTIZER, 1, 1, x0, 0, [primitive.step], 1, 2, feed=1, start=[0], affine=True)
    if isinstance(primitive, Smooth):
        return Node(
            L.SMOOTH, 1, 1, x0, 0, primitive.p, feed=1,
            laws=[(address(primitive.law, "smooth"), 0, 0, 0, L.CURVED)],
        )  # fmt: skip
    if isinstance(primitive, Ramp):
        return Node(L.RAMP, 1, 1, x0, 0, [primitive.offset, primitive.rate], feed=1, affine=True)
    if isinstance(primitive, Lag):
        t = primitive.time_constant
        return Node(L.LTI, 1, 1, x0, 1, [-1 / t, 1 / t, 1.0, 0.0], affine=True)
    if isinstance(primitive, Play):
        return Node(L.PLAY, 1, 1, x0, 1, [primitive.gap], 1, 2, feed=1, start=[0])
    if isinstance(primitive, RateLimiter):
        return Node(L.RATE, 1, 1, x0, 1, [primitive.rate], 1, 2, feed=1, start=[0])
    if isinstance(primitive, Delay):
        if primitive.delay == 0:
            return Node(L.LTI, 1, 1, x0, 1, [0.0, 0.0, 0.0, 1.0], feed=1, affine=True)
        # its state stands for the lag of the compliant form and does not move; aux: place of its history,
        # when packed
        return Node(L.DELAY, 1, 1, x0, 1, [primitive.delay], aux=[0])
    raise TypeError(f"unknown element {primitive!r}.")


def user_node(system, x0):
    """Node of a user-written system, called back in Python; returns it with what must be kept alive."""
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
        good = True
        for i, v in enumerate(values):
            if not returned(v):
                raise TypeError(f"{system.name} must return real numbers; got {shown(v)} at t = {t:g}.")
            target[i] = float(v)
            good = good and v == v
        if not good and np.isfinite(xs).all() and np.isfinite(us).all():
            # a shorter step may pass beside it: an error only where the run ends here
            gave_nan[:] = [f"{system.name} returned NaN at t = {t:g}, x = {xs}, u = {us}"]

    pointer, keep = callback(call, "system")
    feed = 1 if nx == 0 else int(_has_feedthrough(output, nx, nu, params))
    return Node(L.SYSTEM, nu, ny, x0, nx, feed=feed, laws=[(pointer, 0, 0, 0, L.CURVED)]), keep


def _has_feedthrough(output, nx, nu, params) -> bool:
    """Probe whether an output function reads its input."""
    if output is None:
        return False
    rng = np.random.default_rng(0)
    for _ in range(4):
        x = rng.normal(size=nx)
        y = [np.atleast_1d(output(0.0, x, rng.normal(size=nu) * s, params)) for s in PROBED_INPUTS]
        if not all(np.array_equal(y[0], other) for other in y[1:]):
            return True
    return False


def core_node(core: Core, x0: int) -> Node:
    """Node of a mechanism."""
    low, high = core.wall
    numbers: list[float] = [core.masses[0], core.masses[1] if core.bodies == 2 else 1.0, core.gap]
    numbers += [core.restitution, low, high, core.stop_restitution]
    par = [*numbers, *(_narrowest(chain) for chain in (core.friction + ((),))[:2])]
    laws, effects = [], []

    def add(effect, state=0, body=0, sort=None):
        law = address(type(effect).law, signature_of(effect))  # type: ignore[arg-type]
        laws.append((law, len(par), state, body, sort or _sort([effect])))
        effects.append(effect)
        par.extend(effect.values)

    for term in core.forces:
        driving = L.DRIVING if term.effect.role == "input" else 0
        add(term.effect, term.state, term.body, _sort([term.effect]) | driving)
    for body, chain in enumerate(core.friction):
        for effect in chain:
            add(effect, 0, body, _sort(chain) | (L.ASKING if effect.asks else 0))
    places = []
    for term in (core.presliding, core.coupling, core.contact):
        places.append(-1 if term is None else len(laws))
        if term is not None:
            add(term.effect, term.state, term.body)
    chains = [len(c) for c in core.friction] + [0]
    aux = [
        core.bodies,
        _JOINT[core.joint],
        int(core.stop is not None),
        -1 if core.presliding is None else core.presliding.state,
        core.measured,
        len(core.forces),
        chains[0],
        chains[1],
        0,  # index of its first law, filled when packed
        sum(effect.states for effect in effects),
        int(any(effect.asks for effect in effects)),
        len(laws),
        *places,
    ]
    mode = [L.FREE, L.FREE, 0, 0, 0]
    return Node(
        L.MECHANISM,
        1,
        2 * core.bodies,
        x0,
        core.nstates,
        par,
        len(mode),
        6,
        aux,
        feed=0,
        laws=laws,
        start=mode,
        affine=_sort(effects) == L.STRAIGHT,
    )


def signature_of(effect) -> str:
    """Return how the law of an effect, or of a class of them, is called: a key of `SIGNATURES`."""
    if effect.role == "friction":
        return "asking" if effect.asks else "friction"
    return "presliding" if effect.role == "presliding" else "force"


def _sort(effects) -> int:
    """Return the sort of laws that act together."""
    return L.STRAIGHT if all(e.affine for e in effects) else L.CURVED


def _narrowest(chain) -> float:
    """Return the smallest speed among the parameters of a chain of friction laws [m/s]; inf if none."""
    speeds = [effect.values[i] for effect in chain for i in _speeds(type(effect))]
    return min((v for v in speeds if v > 0), default=np.inf)


@functools.cache
def _speeds(cls: type) -> tuple[int, ...]:
    """Return which parameters of an effect class are speeds."""
    return tuple(i for i, (_, stated) in enumerate(stated_parameters(cls)) if stated["unit"] == "m/s")
