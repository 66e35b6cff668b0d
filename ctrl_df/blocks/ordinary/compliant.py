"""The compliant form of a mechanism, for ordinary ODE solvers.

An ODE right-hand side cannot hold a body still against an unknown force, nor reverse a velocity in no time.
Here sticking becomes creep and impact a short spring contact:

- dry friction rises linearly up to the speed ``ctrl_df.stick_velocity`` (default 1e-4 m/s): a stuck body
  creeps at up to that speed; the static level holds only below it;
- contacts are springs and dampers whose stiffness makes a contact last ``ctrl_df.contact_time`` (default
  1 ms) and whose damping gives the stated restitution: a body pressed on by a steady force F sinks in by
  F/stiffness. Two contacts at once, a load that hits a motor pressed against a stop, are two springs in
  series, whatever they are made of: what the load rebounds by is not the restitution stated;
- delays become first-order Pade elements: right up to about 0.5/delay rad/s.

Both settings live in ``control.config.defaults``. The exact laws are what `ctrl_df.event_response` runs.
"""

from __future__ import annotations

import math

import control as ct

from ...thresholds import ROUNDED
from ..core import ELASTIC, IMPACT, RIGID, Core, level
from ..primitives import Delay, Lag, Play, Primitive, Ramp, RateLimiter
from ..thresholds import CARRIED_ROUNDS, CONTACT_TIME, RESTITUTION_LEAST, STICK_VELOCITY

DEFAULTS = {"ctrl_df.stick_velocity": STICK_VELOCITY, "ctrl_df.contact_time": CONTACT_TIME}
for _key, _value in DEFAULTS.items():
    ct.config.defaults.setdefault(_key, _value)


def rates(core: Core, t: float, x, u: float) -> list[float]:
    """Return dx/dt of the compliant form for force input `u` [N]."""
    dx = [0.0] * core.nstates
    driven = core.driven
    force = [0.0] * core.bodies
    force[driven] = drive = run_channel(core.input_channel, t, x, u, dx)
    for term in core.forces:
        b, z = term.body, term.state
        z_rate = [0.0] * term.effect.states
        law = type(term.effect).law
        value = law(t, x[2 * b], x[2 * b + 1], x[z : z + term.effect.states], term.effect.values, z_rate)  # type: ignore[misc]
        force[b] += value
        if term.effect.role == "input":
            drive += value
        dx[z : z + term.effect.states] = z_rate
    pull = _joint(core, t, x, dx)
    arguments = _law_arguments(core, x, drive, force, pull)
    if core.bodies == 2:
        force[0] += pull
        force[1] -= pull
    for b in range(core.bodies):
        if core.presliding is not None and b == driven:
            force[b] += _presliding(core, x, dx, arguments[b])
        else:
            force[b] += _creep(core.friction[b], x[2 * b + 1], arguments[b])
    _stops(core, t, x, dx, force)
    for b in range(core.bodies):
        dx[2 * b] = x[2 * b + 1]
        dx[2 * b + 1] = force[b] / core.masses[b]
    if core.joint == RIGID:
        a = sum(force) / sum(core.masses)
        dx[1] = dx[3] = a
    run_channel(core.output_channel, t, x, x[2 * core.measured], dx)
    return dx


def outputs(core: Core, t: float, x) -> list[float]:
    """Return x, v (of the measured body; x through the sensor channel), x_motor, v_motor (of two bodies)."""
    m = core.measured
    y = [run_channel(core.output_channel, t, x, x[2 * m], [0.0] * core.nstates), x[2 * m + 1]]
    return y + [x[2], x[3]] if core.bodies == 2 else y


def holding_force(core: Core, t: float, x, a: float) -> tuple[float, list[float]]:
    """Return the force that imposes motion `a` [m/s^2] on one body in state `x`, and the rates of its states.

    Of friction that grows with the force carried the force is a part of itself: the balance is iterated.
    """
    dx = [0.0] * core.nstates
    load = 0.0
    for term in core.forces:
        z, z_rate = term.state, [0.0] * term.effect.states
        law = type(term.effect).law
        load += law(t, x[0], x[1], x[z : z + term.effect.states], term.effect.values, z_rate)  # type: ignore[misc]
        dx[z : z + term.effect.states] = z_rate
    if core.contact is not None:
        pushed = [0.0]
        _stops(core, t, x, dx, pushed)
        load += pushed[0]
    free = core.masses[0] * a - load
    force = free
    for _ in range(CARRIED_ROUNDS):
        arguments = (x[0], force, -load)
        if core.presliding is not None:
            dry = _presliding(core, x, dx, arguments)
        else:
            dry = _creep(core.friction[0], x[1], arguments)
        before, force = force, free - dry
        if abs(force - before) <= ROUNDED * abs(force):
            break
    return force, dx


def run_channel(channel: tuple[tuple[Primitive, int], ...], t: float, x, u: float, dx) -> float:
    """Pass a signal through the elements of a channel; writes the rates of their states into `dx`."""
    for element, state in channel:
        if isinstance(element, Lag):
            dx[state] = (u - x[state]) / element.time_constant
            u = x[state]
        elif isinstance(element, Delay):
            if element.delay > 0:
                dx[state] = (u - x[state]) * 2 / element.delay
                u = 2 * x[state] - u
        elif isinstance(element, Ramp):
            u = u + element.offset + element.rate * t
        elif isinstance(element, Play | RateLimiter):
            raise TypeError(f"{type(element).__name__} is no channel element; use it as a block of its own.")
        else:
            u = float(element.value(u))
    return u


def _law_arguments(core, x, drive, force, pull):
    """Return place, drive and load of each body, for friction laws that ask."""
    if core.joint == RIGID:
        common = (drive, drive - sum(force))
        return [(x[2 * b], *common) for b in range(core.bodies)]
    driven = (x[2 * core.driven], drive, drive - force[core.driven] + pull)
    return [driven] if core.bodies == 1 else [(x[0], pull, -force[0]), driven]


def _creep(friction, v, arguments):
    if not friction:
        return 0.0
    vs = ct.config.defaults["ctrl_df.stick_velocity"]
    direction = 1.0 if v >= 0 else -1.0
    kinetic = level(friction, 1.0, direction, abs(v), *arguments)
    static = level(friction, 0.0, direction, 0.0, *arguments)
    if abs(v) < vs:
        return -static * v / vs
    return -direction * (kinetic + (static - kinetic) * math.exp(-abs(v) / vs + 1))


def _presliding(core, x, dx, arguments):
    effect, first, v = core.presliding.effect, core.presliding.state, x[2 * core.driven + 1]
    g = level(core.friction[core.driven], 1.0, 1.0 if v >= 0 else -1.0, abs(v), *arguments)
    inner, rates = slice(first, first + effect.states), [0.0] * effect.states
    force = type(effect).law(v, g, x[inner], effect.values, rates)
    dx[inner] = rates
    return force


def _called(term, t, depth, rate, x, dx):
    """Return the force of a law over a deflection."""
    inner, rates = slice(term.state, term.state + term.effect.states), [0.0] * term.effect.states
    force = type(term.effect).law(t, depth, rate, x[inner], term.effect.values, rates)
    dx[inner] = rates
    return force


def _joint(core, t, x, dx):
    """Return the force of the joint on the load."""
    if core.joint not in (IMPACT, ELASTIC):
        return 0.0
    delta, rate = x[2] - x[0], x[3] - x[1]
    bend = delta - min(max(delta, 0.0), core.gap)
    if core.joint == ELASTIC:
        closed = bend != 0 or core.gap == 0
        force = _called(core.coupling, t, bend, rate if closed else 0.0, x, dx)
        return force if closed else 0.0
    return _contact(bend, rate, core.reduced_mass, core.restitution)


def _stops(core, t, x, dx, force):
    if core.stop is None and core.contact is None:
        return
    b = core.driven
    low, high = core.wall
    bend = x[2 * b] - min(max(x[2 * b], low), high)
    if core.contact is not None:
        side = math.copysign(1.0, bend) if bend != 0.0 else 0.0
        force[b] -= side * max(_called(core.contact, t, abs(bend), side * x[2 * b + 1], x, dx), 0.0)
        return
    force[b] -= _contact(bend, x[2 * b + 1], core.masses[b], core.stop_restitution)


def _contact(bend, rate, mass, restitution):
    """Force of a contact compressed by `bend`; never pulls."""
    if bend == 0.0:
        return 0.0
    loss = -math.log(max(restitution, RESTITUTION_LEAST))
    omega = math.sqrt(math.pi**2 + loss**2) / ct.config.defaults["ctrl_df.contact_time"]
    zeta = loss / math.sqrt(math.pi**2 + loss**2)
    f = mass * (omega**2 * bend + 2 * zeta * omega * rate)
    return f if f * bend > 0 else 0.0
