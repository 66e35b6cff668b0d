"""Sizing and recording of one rig: base model, inputs, noise; the library's names to numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import rig_physics as physics
from rig_excitation import controller_for, excite, reference
from rig_sizes import EFFECTS, OUTSIDE, base_needs

from ctrl_df.blocks.effect import effect_class

RATIO = (3.0, 200.0)


@dataclass(frozen=True, eq=False)
class Record:
    """One run: time [s], force [N] held over each sample, reported position [m], and what a test may know.

    `v` is a velocity channel [m/s] or None; `r` the reference of a closed loop or None; `clean` the position
    without noise and encoder; `noise` the rms of noise and encoder together [m]. Where the drive `turns`, all
    is in units of rotation.
    """

    t: np.ndarray
    u: np.ndarray
    y: np.ndarray
    v: np.ndarray | None
    r: np.ndarray | None
    clean: np.ndarray
    noise: float
    excitation: str
    name: str
    turns: bool = False

    def measurement(self):
        """Return the record as the library's `Measurement`."""
        from ctrl_df.identify.data.measurement import Measurement

        units = dict(input_unit="N m", output_unit="rad", velocity_unit="rad/s") if self.turns else {}
        return Measurement(self.t, self.u, self.y, name=self.name, velocity=self.v, **units)


def is_free(name):
    return not name.endswith((".center", ".restitution"))


_FIELDS = {
    "coulomb.level": "COULOMB", "stribeck.level": "STRIBECK", "stribeck.velocity": "STRIBECK_V",
    "stiction.level": "STATIC", "asymmetric_coulomb.difference": "ASYM_COULOMB", "load_friction.level":
    "LOAD_COULOMB", "bristle.stiffness": "BRISTLE_K", "bristle.damping": "BRISTLE_C", "bristle.level":
    "BRISTLE_LEVEL", "viscous.coefficient": "VISCOUS", "quadratic_drag.coefficient": "DRAG",
    "asymmetric_viscous.difference": "ASYM_VISCOUS", "linear_spring.stiffness": "SPRING",
    "linear_spring.center": "SPRING_X", "cubic_spring.stiffness": "CUBIC", "cubic_spring.center": "CUBIC_X",
    "position_ripple.amplitude": "RIPPLE", "position_ripple.wavelength": "RIPPLE_LENGTH",
    "position_ripple.phase": "RIPPLE_PHASE", "constant_force.force": "FORCE", "hard_stop.limit":
    "STOP_HIGH", "hard_stop.restitution": "STOP_RESTITUTION", "backlash.gap": "GAP", "backlash.restitution":
    "RESTITUTION", "compliance.stiffness": "JOINT_K", "compliance.damping": "JOINT_C", "input_gain.gain":
    "GAIN", "input_saturation.level": "SATURATION", "input_dead_zone.threshold": "DEAD_ZONE",
    "input_delay.delay": "DELAY", "input_lag.time_constant": "LAG", "sensor_delay.delay": "SENSOR_DELAY",
    "gravity.torque": "PENDULUM", "gravity.angle0": "PENDULUM_ANGLE",
    "position_dependent_friction.amplitude": "PLACED", "position_dependent_friction.wavelength":
    "PLACED_LENGTH", "position_dependent_friction.phase": "PLACED_PHASE",
    "load_dependent_friction.coefficient": "FORCE_FRICTION",
    "sensor_quantization.step": "SENSOR_STEP", "sensor_offset.offset": "SENSOR_OFFSET", "drift.rate":
    "SENSOR_DRIFT",
}  # fmt: skip


def pack(values: dict[str, float]) -> np.ndarray:
    """Return the parameter vector of `rig_physics` for parameters named as in the library."""
    given: dict[str, float] = {"MOTOR": values["mass"]}
    for name, value in values.items():
        if name in _FIELDS:
            given[_FIELDS[name]] = value
        elif name.startswith("outside."):
            given[name.removeprefix("outside.").upper()] = value
    if "hysteresis.force" in values:
        stroke = values["hysteresis.stroke"]
        given.update(HYSTERESIS_K=values["hysteresis.force"] / stroke, HYSTERESIS_B=1 / stroke)
    if "hard_stop.limit" in values:
        given.update(STOP=1.0, STOP_LOW=-values["hard_stop.limit"])
    joint = (
        "compliance" if "compliance.stiffness" in values else "backlash" if "backlash.gap" in values else None
    )
    if joint:
        share = values[f"{joint}.load_fraction"]
        given.update(LOAD=share * values["mass"], MOTOR=(1 - share) * values["mass"])
        given["JOINT"] = physics.ELASTIC if joint == "compliance" else physics.IMPACT
    return physics.numbers(**given)


class Lost(Exception):
    """A drawn plant that runs away or does not move; another one is drawn."""


@dataclass
class Setup:
    """One attempt at a rig: base model, inputs, noise."""

    rng: np.random.Generator
    ids: tuple[str, ...]
    outside: str | None
    excitation: str
    snr_db: float
    closed_loop: bool
    noise: str
    n: int
    dt: float

    def __post_init__(self):
        rng = self.rng
        wants = base_needs(self.ids, self.outside)
        self.f0 = float(rng.uniform(0.5, 1.5))  # where most of the motion happens [Hz]
        self.w = 2 * math.pi * self.f0
        mass = float(np.exp(rng.uniform(np.log(0.5), np.log(100))))
        self.speed = float(np.exp(rng.uniform(np.log(0.05), np.log(0.5))))
        if wants.stroke is not None:
            self.speed = self.w * float(rng.uniform(*wants.stroke))
        self.stroke = self.speed / self.w
        self.inertia = mass * self.speed * self.w  # force that makes this speed at f0
        kinetic = self.inertia * float(rng.uniform(*wants.dry))
        self.base = {"mass": mass}
        if "coulomb" not in self.ids:
            self.base["coulomb.level"] = kinetic
        if "viscous" not in self.ids:
            self.base["viscous.coefficient"] = self.inertia / self.speed * float(rng.uniform(0.15, 0.7))
        self.kinetic = kinetic
        self.peak = self.inertia * float(rng.uniform(*wants.drive)) + kinetic
        for effect in wants.effects:
            self.base.update(EFFECTS[effect].draw(rng, self, EFFECTS[effect].typical))
        self.controller = controller_for(rng, self) if self.closed_loop else None
        self.slack = float(rng.uniform(0.0, 1.0))  # share of a gap taken up at the start
        self.reach, self.force_reach = 2 * self.stroke, self.peak
        self.input = self.make_input(self.excitation)
        self.measure_reach(self.base)

    def measure_reach(self, values):
        """Note how far and how hard the plant goes."""
        run = self.run(values, self.input, closed=self.closed_loop)
        self.reach = float(np.max(np.abs(run["x"])))
        self.force_reach = float(np.quantile(np.abs(run["u"]), 0.999))
        self.effort = float(np.std(run["u"]))

    # inputs and runs

    def make_input(self, kind):
        if self.closed_loop:
            return reference(self.rng, kind, self)
        u = excite(self.rng, kind, self)
        # A free inertia drifts away; a small constant force keeps the base model in place on the whole.
        damping = self.base.get("viscous.coefficient", 0.0) + self.kinetic / self.speed
        for _ in range(
            3 if not ({"linear_spring.stiffness", "cubic_spring.stiffness"} & set(self.base)) else 0
        ):
            v = self.run(self.base, u)["v"]
            u = np.where(u != 0, u - damping * np.mean(v) * self.n / np.count_nonzero(u), 0.0)
        return u

    def run(self, values, u, *, closed=False, fine=False, noise=None, quantum=0.0, start=0.0):
        p = pack(values)
        result = physics.run(
            p, u, dt=self.dt, substeps=self.substeps(values, fine), noise=noise, quantum=quantum,
            start=(start, 0.0), slack=self.slack * p[physics.GAP],
            controller=self.controller if closed else None,
        )  # fmt: skip
        if not np.all(np.isfinite(result["y"])) or np.max(np.abs(result["x"])) > 1e3 * self.stroke:
            raise Lost
        return result

    def substeps(self, values, fine):
        """Sub-steps a sample: enough for the fastest law at work."""
        rate = 0.0
        if "bristle.stiffness" in values:
            k, level = (
                values["bristle.stiffness"],
                values.get("coulomb.level", 0.0) + values.get("bristle.level", 0.0),
            )
            rate = 4 * k * self.speed / max(level, 1e-9) + math.sqrt(k / values["mass"])
            rate += values["bristle.damping"] / values["mass"]
        if "stribeck.velocity" in values:
            rate = max(rate, 2 * self.peak / values["mass"] / values["stribeck.velocity"])
        if "compliance.stiffness" in values:
            share = values["compliance.load_fraction"]
            rate = max(
                rate, 3 * math.sqrt(values["compliance.stiffness"] / values["mass"] / (share * (1 - share)))
            )
        return int(min(max(math.ceil(rate * self.dt * (4 if fine else 1.5)), 5 if fine else 1), 60))

    def deviation(self, values, free=None):
        """Return (rms error of the base model refitted to `values`, rms of the position), without noise."""
        run = self.run(values, self.input, closed=self.closed_loop)
        spread = float(np.std(run["clean"]))
        # Nobody records a drive that does not move, or a loop that the hidden effect has made oscillate.
        if not spread > 0.02 * self.stroke or np.std(run["u"]) > 2.5 * self.effort:
            raise Lost
        model = self.base if free is None else free
        error = self.refit(model, run["u"], run["clean"])
        return float(np.std(error)), spread

    def refit(self, model, u, target, iterations=6):
        """Return the least error of `model` over its base parameters (Gauss-Newton from the truth)."""
        names = [
            k for k in self.base if is_free(k) and k not in (("mass",) if "input_gain" in self.ids else ())
        ]
        # Where a run starts is unknown: it matters once a spring or a stop ties the model to a place.
        tied = any(k.startswith(("cubic", "linear", "hard", "position")) for k in model)
        theta = np.zeros(len(names) + tied)

        def error(th):
            moved = {k: model[k] * math.exp(x) for k, x in zip(names, th, strict=False)}
            moved.update({k: min(v, 0.95) for k, v in moved.items() if k.endswith("load_fraction")})
            start = target[0] + th[-1] * self.stroke if tied else 0.0
            try:
                e = target - self.run({**model, **moved}, u, start=start)["clean"]
            except Lost:
                return np.full(len(target), 1e3 * self.stroke)
            return e if tied else e - e.mean()

        best, e = np.inf, error(theta)
        best, damping = float(e @ e), 1e-3
        for _ in range(iterations):
            columns = []
            for i in range(len(theta)):
                step = np.zeros(len(theta))
                step[i] = 1e-3
                columns.append((error(theta + step) - e) / 1e-3)
            jacobian = np.array(columns)
            normal = jacobian @ jacobian.T
            move = -np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-30), jacobian @ e)
            trial_theta = theta + np.clip(move, -0.5, 0.5)
            trial = error(trial_theta)
            gain = best - float(trial @ trial)
            if gain <= 0:
                damping *= 10
                if damping > 1:
                    break
                continue
            theta, e, best, damping = trial_theta, trial, best - gain, damping / 5
            if gain < 0.02 * best:
                break
        return e

    # sizes

    def size(self, ratio):
        """Return (parameters of what is hidden, error over noise); (None, 0) if it cannot be sized."""
        relative = 10 ** (-self.snr_db / 20)
        kinds = [EFFECTS[i] for i in self.ids] or ([OUTSIDE[self.outside]] if self.outside else [])
        if not kinds:
            return {}, 0.0
        added: dict[str, float] = {}
        # The joint first: what acts behind it cannot be sized without it.
        for kind in sorted(kinds, key=lambda k: k.id not in ("compliance", "backlash")):
            top = min(120.0, 0.5 / relative)
            goal = ratio or float(np.exp(self.rng.uniform(np.log(5.0), np.log(top))))
            found = self.size_one(kind, added, goal, relative, ratio is None)
            if found is None:
                return None, 0.0
            added.update(found[0])
            self.measure_reach({**self.base, **added})
        if len(kinds) == 1:
            return added, found[1]
        return self.check_together(kinds, added, relative)

    def size_one(self, kind, added, goal, relative, loose):
        low, high = kind.span
        size = kind.typical * (goal / 25) ** 0.7
        slack = 2.5 if loose else 1.6
        state = self.rng.bit_generator.state
        tried = []
        for _ in range(8):
            self.rng.bit_generator.state = state  # the same draw of shape parameters at every size
            values = kind.draw(self.rng, self, size)
            try:
                model = {**self.base, **added}
                error, spread = self.deviation({**model, **values}, model)
            except Lost:
                high = size  # too much of it
                size = math.sqrt(low * size)
                continue
            got = error / (relative * spread)
            tried.append((math.log(size), math.log(max(got, 1e-6)), values))
            if 1 / slack < got / goal < slack and RATIO[0] * 1.1 < got < RATIO[1] * 0.9:
                return values, got
            slope = 1.0
            if len(tried) > 1 and abs(tried[-1][0] - tried[-2][0]) > 1e-6:
                slope = (tried[-1][1] - tried[-2][1]) / (tried[-1][0] - tried[-2][0])
                slope = min(max(slope, 0.4), 3.0)
            new = min(max(size * (goal / max(got, 1e-6)) ** (1 / slope), low), high)
            if abs(math.log(new / size)) < 1e-3:
                break
            size = new
        fit = [
            (abs(g - math.log(goal)), math.exp(g), v)
            for _, g, v in tried
            if RATIO[0] * 1.1 < math.exp(g) < RATIO[1] * 0.9
        ]
        return None if not fit else min(fit, key=lambda f: f[0])[1:][::-1]

    def check_together(self, kinds, added, relative):
        """Both of two hidden effects must be needed: without either the error exceeds the noise threefold."""
        values = {**self.base, **added}
        for kind in kinds:
            rest = {k: v for k, v in values.items() if not k.startswith(kind.id + ".")}
            error, spread = self.deviation(values, rest)
            if error < RATIO[0] * relative * spread:
                return None, 0.0
        error, spread = self.deviation(values)
        got = error / (relative * spread)
        return (added, got) if got <= RATIO[1] else (None, 0.0)

    def matters(self, truth, record):
        """Whether the hidden part shows on this record at all."""
        tied = "cubic_spring.stiffness" in self.base
        error = record.clean - self.run(self.base, record.u, start=record.clean[0] if tied else 0.0)["clean"]
        return np.std(error) > 2 * record.noise

    # records

    def record(self, truth, kind, name, velocity, sigma=None):
        rng = self.rng
        given = self.input if kind == self.excitation else self.make_input(kind)
        if sigma is None:
            spread = np.std(self.run(truth, given, closed=self.closed_loop)["clean"])
            sigma = 10 ** (-self.snr_db / 20) * float(spread)
        unit, quantum = _noise(rng, self.noise, self.n, self.dt)
        run = self.run(
            truth, given, closed=self.closed_loop, fine=True, noise=sigma * unit, quantum=sigma * quantum
        )  # fmt: skip
        if self.closed_loop and np.std(run["u"]) > 8 * self.effort:
            raise Lost
        t = self.dt * np.arange(self.n)
        v = None
        if velocity:
            v = run["v"] + 10 ** (-self.snr_db / 20) * np.std(run["v"]) * rng.standard_normal(self.n)
        return Record(
            t, run["u"], run["y"], v, given if self.closed_loop else None, run["clean"], sigma, kind, name,
            any(effect_class(i).turns for i in self.ids),
        )  # fmt: skip


def _noise(rng, kind, n, dt):
    """Return noise and encoder step for a total rms of one."""
    if kind == "white":
        return rng.standard_normal(n), 0.0
    if kind == "coloured":
        pole = math.exp(-2 * math.pi * float(rng.uniform(8, 60)) * dt)
        raw = rng.standard_normal(n + 2000) * math.sqrt(1 - pole**2)
        out = np.empty(n + 2000)
        last = 0.0
        for i, w in enumerate(raw):
            last = pole * last + w
            out[i] = last
        return out[2000:], 0.0
    step = float(rng.uniform(1.0, 3.0))  # over the rms of the noise before the encoder
    total = math.sqrt(1 + step**2 / 12)
    return rng.standard_normal(n) / total, step / total
