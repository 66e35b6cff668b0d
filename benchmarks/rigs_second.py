"""A second generator of virtual rigs, for judging only: nothing is tuned on it.

It shares no physics with the library: machines run in `second_physics`, without unit, and are scaled to
masses from a gram to a tonne, strokes from micrometres to metres, times from milliseconds to ten seconds.
``rig(kind, number)`` is the same rig for ever; kinds are ``single``, ``nothing``, ``outside``, ``double``,
``triple``.

The size of a hidden effect is the rms of what is left of the motion when the model without it, its parameters
and the states that segments of one and a half periods begin with have done their best (to first order), over
the noise.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import second_physics as physics
import second_signals as signals

import ctrl_df as cdf

UNITS = {
    "": (0, 0, 0), "force": (1, 1, -2), "place": (0, 1, 0), "speed": (0, 1, -1), "time": (0, 0, 1),
    "viscous": (1, 0, -1), "stiffness": (1, 0, -2), "cubic": (1, -2, -2), "drag": (1, -1, 0),
    "mass": (1, 0, 0),
}  # fmt: skip
SMALL, LARGE = (1.5, 5.0), (6.0, 300.0)
WINDOW = 1.5  # periods
TRIES = 40


class Unsuited(Exception):
    """A draw whose motion tells nothing; another one is made."""


@dataclass(frozen=True)
class Rig:
    """A machine with something hidden.

    `accepted` has for each hidden effect the ids that say the same of any record; `truth` is the true
    structure as a block of the library (None outside it), `free` what its user does not know exactly.
    """

    kind: str
    number: int
    hidden: tuple[str, ...]
    accepted: dict[str, set[str]]
    baseline: Any
    truth: Any
    free: tuple[str, ...]
    train: Any
    held: Any
    regions: tuple[str, ...] = ()
    facts: dict[str, Any] = field(default_factory=dict)


@dataclass
class Scene:
    """What a baseline does, for the sizes of what is hidden in it."""

    force: float
    place: float
    reach: float
    speed: float
    friction: float
    viscous: float
    stiffness: float
    sigma: float = 0.0
    swing: float = 1.0  # radians in a unit of place


@dataclass(frozen=True)
class Hidden:
    """An effect to hide: `draw(rng, scene)` gives its values over a size from 0 to 1."""

    draw: Callable
    make: Callable
    on: tuple[str, ...] = ("plain", "slick", "dry", "spring", "hardening")
    loops: tuple[bool, ...] = (False, True)


def _pm(rng):
    return float(rng.choice([-1.0, 1.0]))


def _one(name, effect, unit, size):
    """Return an effect of one number, in proportion to its size."""

    def draw(rng, c):
        top = size(rng, c)
        return lambda s: {name: s * top}

    return draw, lambda v, q: effect(q(v[name], unit))


def _stiction(rng, c):
    more = rng.uniform(0.3, 1.5) * c.friction
    return lambda s: {"breakaway": c.friction + s * more}


def _stribeck(rng, c):
    more, v = rng.uniform(0.3, 1.5) * c.friction, c.speed * rng.uniform(0.04, 0.6)
    return lambda s: {"static": c.friction + s * more, "stribeck_speed": v}


def _bristle(rng, c):
    bend, zeta = 0.4 * c.place * rng.uniform(0.1, 1), rng.uniform(0.03, 0.8)

    def at(s):
        k = c.friction / (bend * s)
        return {"bristle": k, "bristle_damping": 2 * zeta * math.sqrt(k)}

    return at


def _wave(name, wave, phase, top, low, high):
    def draw(rng, c):
        size = top(c) * rng.uniform(0.3, 1)
        length = 2 * c.reach / math.exp(rng.uniform(math.log(low), math.log(high)))
        p = rng.uniform(0, 2 * math.pi)
        return lambda s: {name: s * size, wave: length, phase: p}

    return draw


def _stop(rng, c):
    inside, e = rng.uniform(0.1, 0.5), rng.choice([0.0, rng.uniform(0, 0.85)])

    def at(s):
        limit = c.reach * (1 - inside * s)
        return {"stop_high": limit, "stop_low": -limit, "stop_restitution": e}

    return at


def _gap(rng, c):
    share, e, gap = rng.uniform(0.15, 0.85), rng.uniform(0, 0.7), 0.5 * c.place * rng.uniform(0.3, 1)
    return lambda s: {
        "joint": physics.LOOSE,
        "motor": 1 - share,
        "load": share,
        "gap": s * gap,
        "gap_restitution": e,
    }


def _joint(rng, c):
    share, zeta, soft = rng.uniform(0.15, 0.85), rng.uniform(0.01, 0.25), rng.uniform(1.6, 5.0)
    inner = share * (1 - share)

    def at(s):
        k = inner * (2 * math.pi * soft) ** 2 / s
        return {"joint": physics.SPRUNG, "motor": 1 - share, "load": share, "joint_stiffness": k,
                "joint_damping": 2 * zeta * math.sqrt(k * inner)}  # fmt: skip

    return at


def _pad(rng, c):
    force, stroke = (
        0.5 * c.force * rng.uniform(0.2, 1),
        c.place * math.exp(rng.uniform(math.log(0.05), math.log(0.8))),
    )
    return lambda s: {"pad": s * force, "pad_stroke": stroke, "pad_shape": 2.0}


def _saturation(rng, c):
    depth = rng.uniform(0.3, 0.75)
    return lambda s: {"limit": 1.4 * c.force * (1 - depth * s)}


def _gain(rng, c):
    off = rng.uniform(-0.3, 0.5)
    return lambda s: {"gain": 1 + s * off}


def _weight(rng, c):
    size, at = 0.8 * c.force * rng.uniform(0.3, 1), rng.uniform(-math.pi, math.pi) * rng.choice([0.0, 1.0])
    return lambda s: {"weight": s * size, "hangs_at": at}


def _spring(rng, c):
    size = c.force / c.reach * rng.uniform(0.2, 1) * (-0.3 if rng.random() < 0.15 else 1.0)
    return lambda s: {"spring": s * size}


def _level_of(c):
    return 0.6 * c.force


def _uneven(rng, c):
    return _pm(rng) * rng.uniform(0.3, 1.6) * c.friction


def _backlash(v, q):
    return cdf.Backlash(q(v["gap"], "place"), v["gap_restitution"], v["load"] / (v["load"] + v["motor"]))


def _compliance(v, q):
    share = v["load"] / (v["load"] + v["motor"])
    return cdf.Compliance(q(v["joint_stiffness"], "stiffness"), q(v["joint_damping"], "viscous"), share)


RUBS = ("plain", "dry")
HELD = ("spring", "hardening")
EFFECTS: dict[str, Hidden] = {
    "viscous": Hidden(
        *_one("viscous", cdf.Viscous, "viscous", lambda r, c: r.uniform(0.2, 1) * c.force / c.speed), ("dry",)
    ),
    "coulomb": Hidden(
        *_one("coulomb", cdf.Coulomb, "force", lambda r, c: r.uniform(0.1, 0.5) * c.force), ("slick", *HELD)
    ),
    "stiction": Hidden(_stiction, lambda v, q: cdf.Stiction(q(v["breakaway"], "force")), RUBS),
    "stribeck": Hidden(
        _stribeck, lambda v, q: cdf.Stribeck(q(v["static"], "force"), q(v["stribeck_speed"], "speed")), RUBS
    ),
    "bristle": Hidden(
        _bristle,
        lambda v, q: cdf.Bristle(q(v["bristle"], "stiffness"), q(v["bristle_damping"], "viscous")),
        RUBS,
    ),
    "quadratic_drag": Hidden(
        *_one("drag", cdf.QuadraticDrag, "drag", lambda r, c: r.uniform(0.2, 1) * c.force / c.speed**2),
        ("plain", "slick", "spring", "gap"),
    ),
    "asymmetric_coulomb": Hidden(*_one("uneven_coulomb", cdf.AsymmetricCoulomb, "force", _uneven), RUBS),
    "asymmetric_viscous": Hidden(
        *_one(
            "uneven_viscous",
            cdf.AsymmetricViscous,
            "viscous",
            lambda r, c: _pm(r) * r.uniform(0.3, 1.6) * c.viscous,
        ),
        ("plain", "slick", "spring"),
    ),
    "position_ripple": Hidden(
        _wave("ripple", "ripple_wave", "ripple_phase", lambda c: 0.5 * c.force, 2.5, 25),
        lambda v, q: cdf.PositionRipple(
            q(v["ripple"], "force"), q(v["ripple_wave"], "place"), v["ripple_phase"]
        ),
    ),
    "constant_force": Hidden(
        *_one(
            "constant",
            cdf.ConstantForce,
            "force",
            lambda r, c: _pm(r) * r.uniform(0.1, 0.9) * (c.friction or 0.5 * c.force),
        ),
        ("plain", "dry", "spring", "slick"),
    ),
    "linear_spring": Hidden(
        _spring, lambda v, q: cdf.LinearSpring(q(v["spring"], "stiffness")), ("plain", "slick", "dry", "gap")
    ),
    "cubic_spring": Hidden(
        *_one("cubic", cdf.CubicSpring, "cubic", lambda r, c: r.uniform(0.2, 1.5) * c.force / c.reach**3),
        ("plain", "slick", "dry", "spring"),
    ),
    "hard_stop": Hidden(
        _stop,
        lambda v, q: cdf.HardStop(q(v["stop_high"], "place"), v["stop_restitution"]),
        ("plain", "slick", "spring"),
    ),
    "backlash": Hidden(_gap, _backlash, ("plain", "slick", "spring")),
    "compliance": Hidden(_joint, _compliance, ("plain", "slick", "spring")),
    "load_friction": Hidden(
        *_one("load_coulomb", cdf.LoadFriction, "force", lambda r, c: r.uniform(0.1, 0.5) * c.force),
        ("gap", "shaft"),
    ),
    "input_saturation": Hidden(
        _saturation,
        lambda v, q: cdf.InputSaturation(q(v["limit"], "force")),
        ("plain", "slick", "spring", "gap"),
    ),
    "input_dead_zone": Hidden(
        *_one("dead", cdf.InputDeadZone, "force", lambda r, c: r.uniform(0.1, 0.5) * c.force)
    ),
    "input_delay": Hidden(*_one("late_in", cdf.InputDelay, "time", lambda r, c: r.uniform(0.01, 0.06))),
    "input_lag": Hidden(*_one("lag", cdf.InputLag, "time", lambda r, c: r.uniform(0.01, 0.08))),
    "input_gain": Hidden(_gain, lambda v, q: cdf.InputGain(v["gain"]), ("plain", "slick", "spring")),
    "sensor_delay": Hidden(*_one("late_out", cdf.SensorDelay, "time", lambda r, c: r.uniform(0.01, 0.06))),
    "sensor_quantization": Hidden(
        *_one("quantum", cdf.SensorQuantization, "place", lambda r, c: 0.15 * c.place)
    ),
    "sensor_offset": Hidden(
        *_one("offset", cdf.SensorOffset, "place", lambda r, c: _pm(r) * c.place * r.uniform(0.2, 1)), HELD
    ),
    "drift": Hidden(
        *_one("drift", cdf.Drift, "speed", lambda r, c: _pm(r) * 0.2 * c.speed * r.uniform(0.1, 1)),
        ("plain", "dry", "spring"),
    ),
    "gravity": Hidden(
        _weight, lambda v, q: cdf.Gravity(q(v["weight"], "force"), v["hangs_at"]), ("plain", "slick", "dry")
    ),
    "load_dependent_friction": Hidden(
        *_one("carried", cdf.LoadDependentFriction, "", lambda r, c: r.uniform(0.1, 0.5)), RUBS
    ),
    "position_dependent_friction": Hidden(
        _wave("place", "place_wave", "place_phase", lambda c: c.friction, 0.6, 8),
        lambda v, q: cdf.PositionDependentFriction(
            q(v["place"], "force"), q(v["place_wave"], "place"), v["place_phase"]
        ),
        RUBS,
    ),
    "hysteresis": Hidden(
        _pad,
        lambda v, q: cdf.Hysteresis(q(v["pad"], "force"), q(v["pad_stroke"], "place")),
        ("plain", "slick", "spring"),
    ),
}


def _cogging(rng, c):
    wave, v = 2 * c.reach / rng.uniform(3, 20), c.speed * rng.uniform(0.3, 1.5)
    return lambda s: {"cogging": s * 0.6 * c.force, "cogging_wave": wave, "cogging_speed": v}


def _varying(rng, c):
    share, waves = rng.uniform(0.4, 0.95), rng.uniform(0.3, 2.5)
    return lambda s: {"warming": s * share, "warming_time": -1 / waves}


def _eddy(rng, c):
    v, size = c.speed * rng.uniform(0.15, 0.6), rng.uniform(0.3, 1.0)
    return lambda s: {"eddy": s * size * 2 * c.force / v, "eddy_speed": v}


def _power(rng, c):
    depth = rng.uniform(0.3, 0.8)
    return lambda s: {"power": 1.4 * c.force * c.speed * (1 - depth * s)}


def _hum(rng, c):
    frequency = rng.uniform(0.7, 3.3)
    return lambda s: {"hum": s * 0.5 * c.force, "hum_omega": 2 * math.pi * frequency}


def _grease(rng, c):
    wave = 2 * c.reach / rng.uniform(0.8, 6)
    return lambda s: {"greasy": s * c.force / c.speed, "greasy_wave": wave}


def _memory(rng, c):
    memory, v = rng.uniform(0.02, 0.1), c.speed * 0.02
    return lambda s: {"memory": s * memory, "stribeck_speed": v}


def _failing(rng, c):
    loss, time = rng.uniform(0.2, 0.6), rng.uniform(0.2, 1.0)
    return lambda s: {"derating": s * loss, "derating_time": -time}


OUTSIDE: dict[str, tuple[Callable, tuple[str, ...], tuple[str, ...]]] = {
    # what, the baselines it is hidden in, the regions that tell of it
    "speed_dependent_cogging": (_cogging, ("plain", "slick"), ("position", "low_speed", "frequency")),
    "varying_friction": (_varying, RUBS, ("time",)),
    "magnetic_drag": (_eddy, ("plain", "slick", "spring"), ("low_speed",)),
    "limited_power": (_power, ("plain", "slick", "spring"), ("load", "low_speed")),
    "hum": (_hum, ("plain", "slick", "dry", "spring"), ("frequency", "time")),
    "uneven_grease": (_grease, ("plain", "slick", "spring"), ("position", "low_speed")),
    "friction_memory": (_memory, RUBS, ("after_reversal", "low_speed")),
    "failing_drive": (_failing, ("plain", "slick", "spring"), ("time", "load")),
}

DOUBLES = (
    ("linear_spring", "input_delay"), ("position_ripple", "quadratic_drag"), ("coulomb", "cubic_spring"),
    ("stribeck", "position_ripple"), ("constant_force", "input_lag"), ("compliance", "coulomb"),
    ("backlash", "linear_spring"), ("asymmetric_viscous", "position_dependent_friction"),
    ("hysteresis", "quadratic_drag"), ("bristle", "linear_spring"), ("input_saturation", "constant_force"),
    ("load_dependent_friction", "position_ripple"), ("hard_stop", "quadratic_drag"),
    ("viscous", "sensor_delay"),
)  # fmt: skip
TRIPLES = (
    ("linear_spring", "quadratic_drag", "input_delay"), ("stribeck", "position_ripple", "constant_force"),
    ("coulomb", "cubic_spring", "input_lag"), ("position_ripple", "asymmetric_viscous", "compliance"),
    ("bristle", "linear_spring", "quadratic_drag"), ("input_dead_zone", "cubic_spring", "constant_force"),
)  # fmt: skip
BASES = ("plain", "slick", "dry", "spring", "hardening", "gap", "shaft")


def rig(kind, number):
    """Return a rig by its kind and number; the first draw whose motion tells anything."""
    for attempt in range(TRIES):
        rng = np.random.default_rng([zlib.crc32(kind.encode()), number, attempt])
        try:
            return _draw(kind, number, rng)
        except Unsuited as reason:
            last = reason
    raise RuntimeError(f"no rig {kind} {number}: {last}")


# --- a machine, and what it does ------------------------------------------------------------------------


@dataclass
class Setting:
    """How one record is taken."""

    closed: bool
    signal: str
    tick: float
    ticks: int  # in a sample of the record
    linear: bool
    pid: np.ndarray
    size: float
    length: float
    measured_load: bool
    noise: str = "white"


@dataclass
class Motion:
    """What happened, at ticks."""

    command: np.ndarray
    place: np.ndarray
    speed: np.ndarray
    force: np.ndarray
    states: np.ndarray


def _baseline(base, rng):
    """Return parameters of a machine without unit: a mass of one, forces of some forty, periods of one."""
    p = dict(motor=1.0)
    top = 40.0
    if base in ("plain", "dry", "gap", "shaft") or (base in HELD and rng.random() < 0.4):
        p["coulomb"] = top * math.exp(rng.uniform(math.log(0.03), math.log(0.35)))
    if base != "dry":
        p["viscous"] = math.exp(rng.uniform(math.log(0.3), math.log(7)))
    if base in HELD:
        p["spring"] = (2 * math.pi) ** 2 * math.exp(rng.uniform(math.log(0.1), math.log(2)))
    if base == "hardening":
        p["cubic"] = p["spring"] * rng.uniform(0.2, 2.0)
    if base in ("gap", "shaft"):
        share = rng.uniform(0.25, 0.8)
        p.update(motor=1 - share, load=share, joint=physics.LOOSE if base == "gap" else physics.SPRUNG)
    if base == "gap":
        p.update(gap=rng.uniform(0.03, 0.25), gap_restitution=rng.uniform(0.05, 0.6))
    if base == "shaft":
        k = p["motor"] * p["load"] * (2 * math.pi * rng.uniform(1.5, 4)) ** 2
        p.update(
            joint_stiffness=k,
            joint_damping=2 * rng.uniform(0.02, 0.2) * math.sqrt(k * p["motor"] * p["load"]),
        )
    return p


def _array(values):
    p = physics.blank()
    for name, value in values.items():
        if name in physics.AT:
            p[physics.AT[name]] = value
    return p


def _setting(rng, closed, length):
    """Return how a record is taken: rate, controller, where the sensor sits."""
    per_period = math.exp(rng.uniform(math.log(40), math.log(250)))
    continuous = closed and rng.random() < 0.35
    ticks = 8 if continuous else 1
    bandwidth = 2 * math.pi * math.exp(rng.uniform(math.log(0.7), math.log(min(2.5, per_period / 35))))
    kp = bandwidth**2 * rng.uniform(0.6, 1.4)
    ki = kp * bandwidth * rng.choice([0.0, rng.uniform(0.02, 0.25)])
    kd = 2 * rng.uniform(0.4, 1.1) * bandwidth
    every = (
        int(rng.integers(2, 5))
        if closed and not continuous and per_period > 120 and rng.random() < 0.3
        else 1
    )
    pid = np.array([kp, ki, kd, 1 / (rng.uniform(5, 15) * bandwidth), every, 1e9])
    kinds = signals.REFERENCES if closed else signals.FORCES
    return Setting(
        closed, str(rng.choice(list(kinds))), 1 / per_period / ticks, ticks,
        bool(rng.random() < (0.5 if continuous else 0.25)) and (continuous or not closed), pid,
        rng.uniform(0.5, 1.6) if closed else 40.0 * math.exp(rng.uniform(-0.7, 0.7)), length,
        bool(rng.random() < 0.6), str(rng.choice(["white", "coloured", "pink", "encoder"])),
    )  # fmt: skip


def _run(values, setting, rng, sigma=0.0, fineness=1.0):
    """Run a machine; the controller sees what the sensor reports."""
    n = int(setting.length / (setting.tick * setting.ticks)) * setting.ticks
    t = setting.tick * np.arange(n)
    command = setting.size * signals.excitation(setting.signal, rng, t, setting.closed)
    values = dict(values)
    for name in ("warming_time", "derating_time"):  # a share of the record
        if values.get(name, 1.0) < 0:
            values[name] = -values[name] * setting.length
    p = _array(values)
    seen = np.zeros(n)
    if setting.closed and setting.ticks == 1 and sigma and "quantum" not in values:
        seen = 0.5 * sigma * rng.standard_normal(n) if setting.noise == "encoder" else np.zeros(n)
    noise = signals.noise(setting.noise, rng, n) * sigma
    if setting.closed and setting.ticks == 1 and setting.noise != "encoder" and "quantum" not in values:
        seen = noise.copy()
    shift = values.get("offset", 0.0) + values.get("drift", 0.0) * t
    step = values.get("quantum", 0.0)
    if not step and setting.closed and setting.ticks == 1 and setting.noise == "encoder":
        step = sigma * 3.0
    speed = 1.5 * (setting.size if setting.closed else 1.0) * 2 * math.pi
    h = physics.longest_step(p, setting.tick, speed, 60.0, 2.0) / fineness
    loads = bool(p[physics.JOINT] != physics.RIGID and setting.measured_load)
    place, speeds, force, states = physics.run(
        p, np.zeros(8), command, setting.closed, setting.tick, h, setting.linear,
        values.get("late_in", 0.0), values.get("late_out", 0.0), loads, setting.pid, seen + shift, step,
    )  # fmt: skip
    if not np.all(np.isfinite(place)) or np.max(np.abs(place)) > 1e3:
        raise Unsuited("it runs away")
    place = place + shift
    if values.get("quantum"):
        place = values["quantum"] * np.floor(place / values["quantum"] + 0.5)
    if setting.noise == "encoder" and not values.get("quantum"):
        measured = 3.0 * sigma * np.floor((place + seen) / (3.0 * sigma) + 0.5) if sigma else place
    else:
        measured = place + noise
    return Motion(command, place, speeds, force, states), measured


def _suited(motion, setting):
    x, v = motion.place, motion.speed
    moving = np.mean(np.abs(v) > 0.03 * np.std(v))
    if np.std(v) < 1e-3 or moving < 0.3:
        raise Unsuited("it hardly moves")
    window = max(int(3 / setting.tick), 10)
    swing = np.median([np.std(x[i : i + window]) for i in range(0, len(x) - window, window)])
    if np.ptp(x) > 40 * swing:
        raise Unsuited("it drifts away")
    return swing


def _scene(values, setting, rng):
    motion, _ = _run(values, setting, rng)
    swing = _suited(motion, setting)
    reach = float(np.quantile(np.abs(motion.place), 0.99))
    stiffness = values.get("spring", 0.0)
    return Scene(
        float(np.std(motion.force)), float(swing), reach, float(np.std(motion.speed)),
        values.get("coulomb", 0.0), values.get("viscous", 0.0), stiffness,
    )  # fmt: skip


# --- how much of a hidden effect shows ---------------------------------------------------------------------


def _shows(base, motion, setting, sigma, known, begin=0):
    """Return what is left of the motion beside the model without what is hidden, over the noise.

    `begin`: tick where the record begins.
    """
    two = base.get("joint", 0) != physics.RIGID
    names = [k for k in base if k not in ("joint", *known)]
    width = int(WINDOW / setting.tick)
    starts = range(begin, len(motion.place) - width, width)
    first = [motion.place, motion.speed]
    if two and setting.measured_load:
        first = [motion.place + motion.states[:, 2], motion.speed + motion.states[:, 3]]
    speed = 2 * float(np.std(motion.speed))

    def go(values, i, kick=None):
        p = _array(values)
        y = np.zeros(8)
        y[0], y[1] = first[0][i], first[1][i]
        if two:
            y[2], y[3] = motion.states[i, 2], motion.states[i, 3]
            if values["joint"] == physics.LOOSE:
                y[2] = min(max(y[2], 0.0), values["gap"])
        if kick is not None:
            y[kick] += 1e-4
        h = physics.longest_step(p, setting.tick, speed, 60.0, 2.0)
        force = motion.force[i : i + width]
        none = np.zeros(6)
        return physics.run(
            p, y, force, False, setting.tick, h, setting.linear and not setting.closed, 0.0, 0.0,
            bool(two and setting.measured_load), none, np.zeros(width), 0.0,
        )[0]  # fmt: skip

    rows, left = [], []
    for i in starts:
        model = go(base, i)
        error = motion.place[i : i + width] - model
        own = np.column_stack([(go(base, i, k) - model) / 1e-4 for k in range(4 if two else 2)])
        q, _ = np.linalg.qr(own)
        change = np.column_stack([(go({**base, k: base[k] * 1.01}, i) - model) / 0.01 for k in names])
        left.append(error - q @ (q.T @ error))
        rows.append(change - q @ (q.T @ change))
    left, rows = np.concatenate(left), np.concatenate(rows)
    if not np.all(np.isfinite(left)):
        return math.inf
    weights, *_ = np.linalg.lstsq(rows, left, rcond=1e-9)
    return float(np.sqrt(np.mean((left - rows @ weights) ** 2))) / sigma


def _faithful(values, motion, setting, sigma):
    """Check that the force as recorded moves the machine as the force did, which changes between samples."""
    if setting.ticks == 1:
        return
    steady = {k: v for k, v in values.items() if k not in ("warming", "derating")}
    p, width = _array(steady), int(WINDOW / setting.tick)
    h = physics.longest_step(p, setting.tick, 2 * float(np.std(motion.speed)), 60.0, 2.0)
    recorded, linear = _recorded(motion, setting), setting.linear
    for i in range(0, len(motion.place) - width, width):
        y = motion.states[i].copy()
        runs = [
            physics.run(
                p, y, f[i : i + width], False, setting.tick, h, straight, 0.0, 0.0, False, np.zeros(6),
                np.zeros(width), 0.0,
            )[0]
            for f, straight in ((motion.force, False), (recorded, linear))
        ]  # fmt: skip
        if np.std(runs[1] - runs[0]) > 0.5 * sigma:
            raise Unsuited("the record of the force is too coarse")


def _recorded(motion, setting):
    """Return the force as the record has it, at ticks."""
    r = setting.ticks
    n = len(motion.force) // r * r
    if setting.linear:
        return np.interp(np.arange(n), np.arange(0, n, r), motion.force[:n:r])
    return motion.force[:n].reshape(-1, r).mean(1).repeat(r)


def _sized(law, target, base, others, setting, seed, sigma, known):
    """Return the size, 0 to 1, at which a hidden effect shows as much as asked, and how much it does."""
    s, tried = 1.0 if target > 20 else 0.3, []
    for _ in range(6):
        motion, _ = _run({**base, **others, **law(s)}, setting, np.random.default_rng(seed), sigma)
        _suited(motion, setting)
        shown = _shows({**base, **others}, motion, setting, sigma, known)
        tried.append((abs(math.log(max(shown, 1e-9) / target)), s, shown))
        if shown <= 0 or tried[-1][0] < 0.2 or (s == 1.0 and shown < target):
            break
        slope = 1.0
        if len(tried) > 1 and tried[-2][1] != s and tried[-2][2] > 0:
            slope = math.log(shown / tried[-2][2]) / math.log(s / tried[-2][1])
        s = min(max(s * (target / shown) ** (1 / min(max(slope, 0.5), 3.0)), 1e-4, s / 30), 1.0)
    _, s, shown = min(tried)
    if shown < SMALL[0]:
        raise Unsuited("what is hidden does not show")
    return s, shown


# --- drawing ------------------------------------------------------------------------------------------------


def _what(kind, number, rng):
    """Return what is hidden, and the baselines and loops it may be hidden in."""
    if kind == "nothing":
        return (), BASES[number % len(BASES)], (False, True)
    if kind == "outside":
        name = list(OUTSIDE)[number % len(OUTSIDE)]
        return (name,), str(rng.choice(OUTSIDE[name][1])), (False, True)
    if kind == "single":
        names: tuple[str, ...] = (list(EFFECTS)[number % len(EFFECTS)],)
    else:
        among = DOUBLES if kind == "double" else TRIPLES
        names = among[number % len(among)]
    on = set.intersection(*(set(EFFECTS[n].on) for n in names))
    order = [b for b in BASES if b in on]
    return names, str(rng.choice(order)), (False, True)


def _draw(kind, number, rng):
    names, base_name, loops = _what(kind, number, rng)
    closed = bool(rng.choice(loops))
    turns = bool(rng.random() < 0.4) or "gravity" in names
    samples = rng.integers(1200, 4000)
    setting = _setting(rng, closed, 1.0)
    setting.length = samples * setting.tick * setting.ticks
    if setting.length < 8.0 or setting.length > 60.0:
        setting.length = float(np.clip(setting.length, 8.0, 60.0))
    base = _baseline(base_name, rng)
    seed = int(rng.integers(2**62))
    scene = _scene(base, setting, np.random.default_rng(seed))
    decibel = rng.uniform(30, 60)
    scene.sigma = sigma = scene.place * 10 ** (-decibel / 20)
    if "sensor_quantization" in names:
        setting.noise = "white"
    small = rng.random() < 1 / 3 and kind == "single"
    values, shows, laws = dict(base), [], {}
    known = ("motor", "load") if "input_gain" in names else ()
    for name in names:
        law = (OUTSIDE[name][0] if kind == "outside" else EFFECTS[name].draw)(rng, scene)
        low, high = SMALL if small else (LARGE if kind == "single" else (10.0, 300.0))
        target = math.exp(rng.uniform(math.log(low), math.log(high)))
        others = {k: v for k, v in values.items() if k not in base}
        if set(law(1.0)) & (set(values) - {"motor", "load"}):
            raise Unsuited("the machine has that already")
        s, shown = _sized(law, target, base, others, setting, seed, sigma, known)
        if shown > 3 * high or (not small and shown < low):
            raise Unsuited("what is hidden shows too much or too little")
        values.update(law(s))
        laws[name] = law(s)
        shows.append(shown)
    motion, measured = _run(values, setting, np.random.default_rng(seed), sigma)
    _suited(motion, setting)
    _faithful(values, motion, setting, sigma)
    other = Setting(**{**setting.__dict__, "length": max(0.6 * setting.length, 6.0)})
    other.signal = str(rng.choice(list(signals.REFERENCES if closed else signals.FORCES)))
    other.size *= rng.uniform(0.7, 1.2)
    second, held = _run(values, other, np.random.default_rng(seed + 1), sigma)
    _suited(second, other)
    _faithful(values, second, other, sigma)
    scale = _scales(rng, setting, motion, turns, "gravity" in names)
    velocity = rng.uniform(20, 60) if rng.random() < 0.2 and "sensor_quantization" not in names else None
    skip = float(rng.choice([0.0, rng.uniform(0.0, 2.0)]))
    if "drift" in names:  # it runs from the first sample on
        skip = 0.0
    for name in names:
        rest = {k: v for other, law in laws.items() if other != name for k, v in law.items()}
        if _shows({**base, **rest}, motion, setting, sigma, known, int(skip / setting.tick)) < SMALL[0]:
            raise Unsuited("what is hidden does not show in the record, beside the rest")
    label = f"{kind} {number}"
    train = _record(label, motion, measured, setting, scale, turns, velocity, rng, skip)
    holdout = _record(f"{label} held out", second, held, other, scale, turns, velocity, rng, 0.0)
    if not setting.closed and np.ptp(train.u) == 0:
        raise Unsuited("nothing drives it")
    block, free = _block(base, base_name, turns, setting, scale, rng, known)
    true_block = None
    if kind != "outside":
        exact, _ = _block(base, base_name, turns, setting, scale, None, known)
        true_block = exact
        for name in names:

            def q(value, unit):
                return value * _factor(UNITS[unit], scale)

            full = {**base, **laws[name]}
            true_block = true_block.with_effect(EFFECTS[name].make(full, q))
    regions = OUTSIDE[names[0]][2] if kind == "outside" else ()
    facts = dict(
        base=base_name, closed=closed, signal=setting.signal, held_signal=other.signal, noise=setting.noise,
        decibel=round(decibel, 1), sigma=sigma, shows=[round(s, 2) for s in shows], small=small, turns=turns,
        samples=len(train), rate=round(1 / train.dt, 1), scale=[float(f"{s:.3g}") for s in scale],
        ticks=setting.ticks, hold=train.input_hold, velocity=velocity is not None,
    )  # fmt: skip
    accepted = {n: _accepted(n, base, velocity is not None) for n in names} if kind != "outside" else {}
    return Rig(kind, number, names, accepted, block, true_block, free, train, holdout, regions, facts)


def _scales(rng, setting, motion, turns, by_radians):
    """Return units of mass, place and time, such that rates are ones that instruments have."""
    per_period = 1 / (setting.tick * setting.ticks)
    low, high = max(100 / per_period, 0.1), min(5000 / per_period, 125.0)  # periods a second
    rate = per_period * math.exp(rng.uniform(math.log(low), math.log(high)))
    swing = float(np.ptp(motion.place))
    if by_radians:
        place = 1.0
    elif turns:
        place = 10 ** rng.uniform(-2.5, 1.3) / swing
    else:
        place = 10 ** rng.uniform(-5.5, 0.5) / swing
    return 10 ** (rng.uniform(-6, 1) if turns else rng.uniform(-3, 3)), place, per_period / rate


def _factor(exponents, scale):
    return math.prod(s**e for s, e in zip(scale, exponents, strict=True))


def _record(name, motion, measured, setting, scale, turns, velocity, rng, skip):
    """Return what instruments would have recorded, in physical units."""
    r = setting.ticks
    n = len(motion.place) // r
    force = _recorded(motion, setting)
    pick = slice(int(skip / (setting.tick * r)) * r, n * r, r)
    x, u, v = measured[pick], force[pick], motion.speed[pick]
    t = setting.tick * r * np.arange(len(x)) * scale[2]
    extra = {}
    if velocity is not None:
        v = v + np.std(v) * 10 ** (-velocity / 20) * rng.standard_normal(len(v))
        extra["velocity"] = v * scale[1] / scale[2]
    return cdf.Measurement(
        t, u * _factor(UNITS["force"], scale), x * scale[1], name=name, input_unit="N m" if turns else "N",
        output_unit="rad" if turns else "m", input_hold="linear" if setting.linear else "zoh", **extra,
    )  # fmt: skip


def _block(base, base_name, turns, setting, scale, rng, known):
    """Return the model of the user: the machine without what is hidden, its parameters up to 30 % off."""

    def q(name, unit):
        off = 1.0 if rng is None or name in known else rng.uniform(0.7, 1.3)
        return base[name] * off * _factor(UNITS[unit], scale)

    effects = []
    if "coulomb" in base:
        effects.append(cdf.Coulomb(q("coulomb", "force")))
    if "viscous" in base:
        effects.append(cdf.Viscous(q("viscous", "viscous")))
    if "spring" in base:
        effects.append(cdf.LinearSpring(q("spring", "stiffness")))
    if "cubic" in base:
        effects.append(cdf.CubicSpring(q("cubic", "cubic")))
    measured = "load" if setting.measured_load else "motor"
    if base_name in ("gap", "shaft"):
        if base_name == "gap":
            effects.append(cdf.Backlash(q("gap", "place"), min(q("gap_restitution", ""), 1.0)))
        else:
            effects.append(cdf.Compliance(q("joint_stiffness", "stiffness"), q("joint_damping", "viscous")))
        make = cdf.TwoInertias if turns else cdf.TwoMass
        block = make(q("motor", "mass"), q("load", "mass"), effects, measured=measured)
    else:
        make = cdf.Inertia if turns else cdf.Mass
        block = make(q("motor", "mass"), effects, measured=measured)
    inertias = ("mass", "inertia", "motor_mass", "load_mass", "motor_inertia", "load_inertia")
    free = [k for k, p in block.parameters.items() if p.free and not (known and k in inertias)]
    return block, tuple(free)


def _accepted(name, base, velocity):
    """Return the ids under which a hidden effect is the same map from input to output on any record."""
    same = {name}
    if name in ("constant_force", "asymmetric_coulomb") and "coulomb" in base:
        same |= {"constant_force", "asymmetric_coulomb"}
    if name in ("input_delay", "sensor_delay") and not velocity:
        same |= {"input_delay", "sensor_delay"}
    held_by_line = "spring" in base and "cubic" not in base
    if name in ("sensor_offset", "constant_force") and held_by_line:
        same |= {"sensor_offset", "constant_force"}
        if "coulomb" in base:
            same.add("asymmetric_coulomb")
    return same
