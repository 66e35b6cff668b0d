"""Initial states of a segment: what the data say of them, corrected by what a fit finds, and back.

Position and speed of the body that is measured are estimated from the record; the corrections of these, and
all that is hidden (where the other body stands in a gap, how far a joint or the bristles are bent), are
nuisance parameters of each segment.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ...blocks.core import ELASTIC, IMPACT, level
from ...blocks.probing import deflection, states_at, stiffness
from ...thresholds import NOTHING
from .thresholds import BEND_REACH, FRICTION_SLOPE, PLACE_REACH, RATE_REACH, SPEED_REACH

SEEN: tuple[str, ...] = ("x", "v")
"""Names of those that the record shows; all others are hidden."""

FREE, CONTINUED, MEASURED = "free", "continued", "measured"
"""Initial states of segments: every one is fitted, segment by segment; all but those that settle are, which
go on from one segment into the next; none is: segments begin as the record says, and what is hidden goes on.
"""


def names(core) -> tuple[str, ...]:
    """Return the names of the initial states of a mechanism, in the order of the corrections."""
    found = list(SEEN)
    if core.joint == IMPACT:
        found += ["slack", "slack_rate"]
    elif core.joint == ELASTIC:
        found += ["deflection", "deflection_rate"]
    return (*found, *(name for name, _, _ in _inner(core)))


def settling(core) -> frozenset[str]:
    """Return the names of those hidden that come to be what the motion makes them, wherever they began."""
    return frozenset(("deflection", "deflection_rate", *(name for name, _, _ in _inner(core))))


def fitted_names(core, initial: str) -> tuple[str, ...]:
    """Return the names of those that are fitted, of initial states of such a kind."""
    if initial == MEASURED:
        return ()
    return tuple(n for n in names(core) if initial == FREE or n not in settling(core))


def continued_names(core, initial: str) -> tuple[str, ...]:
    """Return the names of those that go on from one segment into the next."""
    fitted = fitted_names(core, initial)
    return tuple(n for n in names(core) if n not in fitted and n not in SEEN)


def continued(core, initial: str) -> np.ndarray:
    """Return the projection (nx, nx) of a mechanism's states on those that go on into the next segment.

    A joint goes on as it is bent, whatever the record says of where its seen end begins.
    """
    names, found = continued_names(core, initial), np.zeros((core.nstates, core.nstates))
    seen, other = (2, 0) if core.measured == 1 else (0, 2)
    for name, state in (("slack", 0), ("slack_rate", 1), ("deflection", 0), ("deflection_rate", 1)):
        if name in names:
            found[other + state, other + state], found[other + state, seen + state] = 1.0, -1.0
    inner = [term.state + at for name, term, at in _inner(core) if name in names]
    if "deflection" in names:
        inner += range(core.coupling.state, core.coupling.state + core.coupling.effect.states)
    found[inner, inner] = 1.0
    return found


def reach(which, core, known, segments) -> np.ndarray:
    """Return how far each of the initial states `which` may be from its estimate, (nw, number of states).

    `known`: `segments.facts` of the record.
    """
    one = np.ones(len(segments))
    errors, typical = PLACE_REACH
    x = errors * segments.x_error + typical * known.position
    errors, typical = SPEED_REACH
    table = {
        "x": x,
        "v": errors * segments.v_error + typical * known.speed,
        "slack": one,
        "slack_rate": RATE_REACH * known.speed * one,
    } | {name: 0.5 * one for name, _, _ in _inner(core)}
    if core.joint == ELASTIC:
        bend, rate = _bend(core, known)
        table["deflection"] = (BEND_REACH * bend + core.gap) * one
        table["deflection_rate"] = BEND_REACH * rate * one
    return np.column_stack([table[name] for name in which])


def fill(states, core, given: Mapping[str, Any], usual, speed: float) -> None:
    """Write the states (nw, nx) of a mechanism at the begin of segments.

    `usual`: positions, speeds and accelerations (nw,) of the body measured; `given`: corrections by name,
    each (nw,) or one number; `speed` [m/s] is typical of the record.
    """
    x, v, a = usual
    x, v = x + given.get("x", 0.0), v + given.get("v", 0.0)
    if core.stop is not None:
        x = np.clip(x, *core.stop.span)
    deflection, rate = _joint(core, a)
    if core.joint == IMPACT:
        deflection = np.clip(given.get("slack", deflection / core.gap), 0.0, 1.0) * core.gap
        rate = given.get("slack_rate", 0.0)
    elif core.joint == ELASTIC:
        deflection, rate = deflection + given.get("deflection", 0.0), given.get("deflection_rate", 0.0)
    if core.bodies == 2 and core.measured == 1:
        states[:, 2], states[:, 3] = x, v
        states[:, 0], states[:, 1] = x - deflection, v - rate
    else:
        states[:, 0], states[:, 1] = x, v
        if core.bodies == 2:
            states[:, 2], states[:, 3] = x + deflection, v + rate
    if core.bodies == 2 and core.stop is not None:
        beyond = np.clip(states[:, 2], *core.stop.span) - states[:, 2]
        states[:, 2] += beyond
        states[:, 0] += beyond
    if core.coupling is not None and core.coupling.effect.states:
        first, joint = core.coupling.state, core.coupling.effect
        for row in states:
            ahead = row[2] - row[0]
            bent = float(ahead - min(max(ahead, 0.0), core.gap))
            row[first : first + joint.states] = states_at(joint, bent)
    for name, term, at in _inner(core):
        slip, full = np.array([_settled(row, core, term, at) for row in states]).T
        share = np.tanh(FRICTION_SLOPE * slip / speed) + given.get(name, 0.0)
        states[:, term.state + at] = np.clip(share, -1.0, 1.0) * full


def corrections(states, core, usual, speed: float) -> dict[str, float]:
    """Return the corrections by name that `fill` makes these states of."""
    x, v, a = (float(s) for s in usual)
    at = 2 if core.bodies == 2 and core.measured == 1 else 0
    found = {"x": states[at] - x, "v": states[at + 1] - v}
    if core.bodies == 2:
        deflection, rate = states[2] - states[0], states[3] - states[1]
        found |= {"slack": deflection / core.gap if core.gap else 0.0, "slack_rate": rate}
        found |= {"deflection": deflection - _joint(core, a)[0], "deflection_rate": rate}
    for name, term, at in _inner(core):
        slip, full = _settled(states, core, term, at)
        share = states[term.state + at] / full if full > 0 else 0.0
        found[name] = share - math.tanh(FRICTION_SLOPE * slip / speed)
    return found


def gap_state(core) -> str | None:
    """Return the name of the state that says where in its gap the other body stands; None without a gap."""
    return {IMPACT: "slack", ELASTIC: "deflection"}.get(core.joint) if core.gap else None


def in_gap(core, known, acceleration, place: float) -> Any:
    """Return the correction of `gap_state` with which the other body stands at a `place` of a gap, 0 to 1.

    Of elastic faces from one bent by the typical force to the other. `known`: `segments.facts` of the record;
    `acceleration`: (nw,), as estimated.
    """
    if core.joint == IMPACT:
        return place
    bend, _ = _bend(core, known)
    return place * (core.gap + 2 * bend) - bend - _joint(core, acceleration)[0]


def at_rest(core, usual, speed: float, off: float = 0.0) -> dict[str, float]:
    """Return the corrections, by name, of a mechanism at rest, nothing bent, `off` the usual position."""
    states = np.zeros(core.nstates)
    states[: 2 * core.bodies : 2] = float(usual[0]) + off
    return corrections(states, core, usual, speed)


def _bend(core, known) -> tuple[float, float]:
    """Return how far a joint is bent by the typical force, and its rate as it swings by that."""
    stiff = stiffness(core.coupling.effect, known.force)
    if stiff <= NOTHING:
        return known.position, known.speed  # nothing holds it together
    bend = known.force / stiff
    return bend, bend * math.sqrt(stiff / core.reduced_mass)


def _joint(core, acceleration) -> tuple[Any, float]:
    """Return how far a joint is bent by the load that it accelerates, and at what rate."""
    if core.joint == IMPACT:
        return core.gap * (acceleration > 0), 0.0
    if core.joint == ELASTIC:
        pull = core.masses[0] * acceleration
        return deflection(core.coupling.effect, pull) + core.gap * (pull > 0), 0.0
    return 0.0, 0.0


def _inner(core) -> list[tuple[str, Any, int]]:
    """Return the internal states that come to a steady value: name, law, and which of its states."""
    terms = (*core.forces, core.presliding, core.coupling, core.contact)
    return [
        (core.state_names[term.state + i], term, i)
        for term in terms
        if term is not None
        for i, full in enumerate(term.effect.steady(1.0))
        if full != 0.0
    ]


def _settled(states, core, term, at) -> tuple[float, float]:
    """Return the speed that an internal state follows, and what it comes to."""
    body = core.driven if term.body < 0 else term.body
    slip = float(states[2 * body + 1])
    dry = level(core.friction[body], 1.0, math.copysign(1.0, slip), abs(slip), float(states[2 * body]))
    return slip, float(term.effect.steady(dry)[at])
