"""Start values of every effect for a table N(A, omega): sizes at which it would show somewhere on the plane.

Forces, swings, speeds and frequencies of a table span decades. A gap shows where it is comparable with a
swing, a delay where it is comparable with a period, and so on: every effect is tried at sizes spread over the
range in which it matters, and where it takes over a part of the friction that the refitted model has, that is
taken from the model.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...blocks.core import kinetic_level
from ..starting.attach import attach
from .fit import QUICK, Points, Scales, relative_error, simulate_table

_USUAL = (0.01, 0.05, 0.2, 0.7)


@dataclass(frozen=True)
class Span:
    """Least and largest of something over the points where the mass moved."""

    low: float
    high: float

    def over(self, count: int, below: float = 1.0, above: float = 1.0) -> list[float]:
        """Return values in even ratios from ``below * low`` to ``above * high``."""
        return np.geomspace(below * self.low, above * self.high, count).tolist()


@dataclass(frozen=True)
class Plane:
    """What a table spans: forces [N], swings [m], speeds [m/s], frequencies [rad/s].

    `friction` and `mass` are the model's, `stuck` is the largest force that moved nothing, 0 where all
    points moved.
    """

    force: Span
    swing: Span
    speed: Span
    omega: Span
    friction: float
    mass: float
    stuck: float

    @property
    def scales(self) -> Scales:
        """Scales at which an effect of any unit shows at the largest swings."""
        return Scales(self.force.high, self.swing.high, self.speed.high, self.mass)


def plane_of(block, points: Points) -> Plane:
    """Return what the points span, seen from the refitted model."""
    moved = points.N != 0
    swing = (points.A * np.abs(points.N))[moved]
    spans = (points.A[moved], swing, swing * points.omega[moved], points.omega[moved])
    still = points.A[~moved]
    force, swings, speed, omega = (Span(float(s.min()), float(s.max())) for s in spans)
    mass = sum(p.value for k, p in block.parameters.items() if "." not in k)
    friction, stuck = kinetic_level(block.effects), float(still.max(initial=0.0))
    return Plane(force, swings, speed, omega, friction, mass, stuck)


# --- where each effect shows ----------------------------------------------------------------------


def _stiction(p: Plane):
    for top in _breakaway(p):
        for share in (1.0, 0.8, 0.6):
            yield {"level": top}, share


def _stribeck(p: Plane):
    for velocity in p.speed.over(5, 0.5, 0.7):
        for share, over in ((1.0, 1.3), (0.9, 1.6), (0.6, 2.5)):
            yield {"level": over * share * p.friction, "velocity": velocity}, share


def _breakaway(p: Plane):
    """Return static levels between the model's friction (or what stood still) and the least moving force."""
    low = max(p.stuck, min(p.friction, 0.9 * p.force.low))
    return [low + f * (p.force.low - low) for f in (0.25, 0.6, 0.95)]


def _bristle(p: Plane):
    for bend in p.swing.over(6, 0.3, 0.3):
        stiffness = max(p.friction, 0.02 * p.force.high) / bend
        for ratio in (0.1, 0.6):
            yield {"stiffness": stiffness, "damping": ratio * math.sqrt(stiffness * p.mass)}, 1.0


def _compliance(p: Plane):
    for resonance in p.omega.over(5, 1.0, 8.0):
        for share in (0.3, 0.6):
            stiffness = share * (1 - share) * p.mass * resonance**2
            damping = 0.1 * stiffness / resonance
            yield {"stiffness": stiffness, "damping": damping, "load_fraction": share}, 1.0


def _backlash(p: Plane):
    for gap in p.swing.over(8, 0.1, 0.3):
        for share in (0.3, 0.6):
            yield {"gap": gap, "restitution": 0.3, "load_fraction": share}, 1.0


def _hard_stop(p: Plane):
    # a mass that hits both stops swings by 0.8 (to and fro at one speed) to 1.27 of the limit (standing in
    # between)
    for f in (0.75, 0.85, 0.95, 1.05, 1.2):
        yield {"limit": f * p.swing.high, "restitution": 0.3}, 1.0
    yield {"limit": 0.4 * p.swing.high, "restitution": 0.3}, 1.0


def _position_ripple(p: Plane):
    for wavelength in p.swing.over(7, 1.0, 5.0):
        for amplitude in (0.02, 0.1):
            yield {"amplitude": amplitude * p.force.high, "wavelength": wavelength}, 1.0


def _friction_share(name):
    """Sizes of an effect that acts like dry friction, taken from the model's."""

    def starts(p: Plane):
        for f in (0.1, 0.3, 0.6):
            yield {name: f * p.friction if p.friction > 0 else f * p.force.low}, 1.0 - f
        yield {name: 0.1 * p.force.low}, 1.0

    return starts


def _lopsided(name):
    def starts(p: Plane):
        size = p.friction or 0.3 * p.force.low
        for f in (0.1, 0.4, 0.8, -0.1, -0.4, -0.8):
            yield {name: f * size}, 1.0

    return starts


def _saturation(p: Plane):
    for f in (0.05, 0.3, 0.6, 0.8, 0.95):
        yield {"level": p.force.low + f * (p.force.high - p.force.low)}, 1.0


def _in_periods(name):
    def starts(p: Plane):
        for f in (0.02, 0.1, 0.4, 1.2):
            yield {name: f / p.omega.high}, 1.0

    return starts


_STARTS = {
    "stiction": _stiction,
    "stribeck": _stribeck,
    "bristle": _bristle,
    "compliance": _compliance,
    "backlash": _backlash,
    "hard_stop": _hard_stop,
    "position_ripple": _position_ripple,
    "coulomb": _friction_share("level"),
    "load_friction": _friction_share("level"),
    "input_dead_zone": _friction_share("threshold"),
    "constant_force": _lopsided("force"),
    "asymmetric_coulomb": _lopsided("difference"),
    "input_saturation": _saturation,
    "input_gain": lambda p: (({"gain": g}, 1.0) for g in (0.7, 0.9, 1.1, 1.4)),
    "input_lag": _in_periods("time_constant"),
    "input_delay": _in_periods("delay"),
    "sensor_delay": _in_periods("delay"),
    "sensor_quantization": lambda p: (({"step": s}, 1.0) for s in p.swing.over(6, 0.3, 0.3)),
}
"""Parameters, and the share of the model's Coulomb friction that stays, by effect."""


def _any(cls):
    """Sizes of an effect that is not known here, by the units of its parameters."""
    fields = [f for f in dataclasses.fields(cls) if f.metadata.get("parameter") is not None]
    grids = {}
    for f in fields:
        spec = f.metadata["parameter"]
        if f is fields[0]:
            grids[f] = (*_USUAL, *(-m for m in _USUAL)) if spec["lower"] < 0 else _USUAL
        elif f.default is dataclasses.MISSING:
            grids[f] = (0.1, 1.0)

    def starts(p: Plane):
        for multiples in itertools.product(*grids.values()):
            sized = {}
            for f, multiple in zip(grids, multiples, strict=True):
                unit = f.metadata["parameter"]["unit"]
                sized[f.name] = multiple * p.scales.of(unit)
            yield sized, 1.0

    return starts


def proposals(cls, block, points: Points) -> Iterator:
    """Yield blocks grown by an effect of the class at several sizes.

    Parameters
    ----------
    cls : Effect class
    block : Mechanism
        The refitted model.
    points : Points
        Of the table.
    """
    plane = plane_of(block, points)
    coulomb = block.parameters.get("coulomb.level")
    for values, share in _STARTS.get(cls.id, _any(cls))(plane):
        less = block
        if share < 1.0 and coulomb is not None and coulomb.free:
            less = block.with_parameters({"coulomb.level": share * coulomb.value})
        try:
            grown = attach(less, cls(**values))
        except ValueError:
            continue
        if grown is not None:
            yield grown


_HOPELESS = 3.0  # times the error of the model itself: no start value to begin with


def best_starts(cls, block, points: Points, slopes, keep: int = 3, work=QUICK) -> tuple[list, bool]:
    """Return the blocks grown by the most promising starts, best first, and whether any promises anything.

    A start is judged by what remains of its errors once the model's own parameters have moved along `slopes`
    (2 n, p), those of the weighted errors. An effect that changes no point leaves no print: no start.
    """
    q = np.linalg.qr(slopes)[0] if slopes.size else np.zeros((2 * len(points), 0))

    def left(table):
        e = points.weight * relative_error(table, points)
        e = np.concatenate([np.real(e), np.imag(e)])
        e = e - q @ (q.T @ e)
        return e[: len(points)] ** 2 + e[len(points) :] ** 2

    before = simulate_table(block, points, work)
    size = left(before)
    # a single point of another motion must not hide a good start
    common = 0.1 * float(np.mean(size)) + 1e-12
    scored = []
    for grown in proposals(cls, block, points):
        try:
            table = simulate_table(grown, points, work)
        except (ValueError, ArithmeticError):
            continue
        if not np.allclose(table, before, rtol=1e-5, atol=0, equal_nan=True):
            scored.append((float(np.sum(np.log(left(table) + common))), len(scored), grown))
    scored.sort(key=lambda s: s[:2])
    bound = float(np.sum(np.log(size + common))) + 2 * len(points) * math.log(_HOPELESS)
    hopeful = [g for size, _, g in scored[:keep] if size < bound]
    return hopeful or [g for _, _, g in scored[:1]], bool(hopeful)
