"""Random loops of seven families, with the units in which they are written free to choose."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import control as ct
import numpy as np

import ctrl_df as cdf

FAMILIES = ("friction", "gap", "saturation", "dead zone", "relay", "steps", "user function")


@dataclass(frozen=True)
class Units:
    """Factors by which force, length and time are written larger."""

    force: float = 1.0
    length: float = 1.0
    time: float = 1.0


@dataclass(frozen=True)
class Loop:
    """One loop to analyse: linear part, block, box; `scaled` writes it in other units."""

    family: str
    name: str
    H: Any
    block: Any
    A: tuple[float, float]
    omega: tuple[float, float]
    make: Callable
    dt: float = 0.0

    def box(self, na=30, nw=40):
        """Return the grid to search."""
        return np.geomspace(*self.A, na), np.geomspace(*self.omega, nw)

    def scaled(self, units: Units) -> Loop:
        """Return the same loop in other units."""
        return self.make(units)


def draw(family: str, rng: np.random.Generator) -> Loop:
    """Draw one loop of a family."""
    maker = {
        "friction": _friction, "gap": _gap, "saturation": _saturation, "dead zone": _dead_zone,
        "relay": _relay, "steps": _steps, "user function": _user,
    }[family](rng)  # fmt: skip
    return maker(Units())


def _log(rng, low, high):
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _pid(rng, mass):
    """Gains of a PID on a mass, relative to its own corner; often conditionally stable."""
    pace = _log(rng, 1.0, 60.0)
    return (
        mass * pace**2 * rng.uniform(0.5, 1.5), mass * pace**3 * rng.uniform(0.1, 1.0),
        mass * pace * rng.uniform(0.2, 1.2), pace,
    )  # fmt: skip


def _controller(gains, u):
    kp, ki, kd, _ = gains
    s = u.force / u.length
    return cdf.pid(kp * s, ki * s / u.time, kd * s * u.time)


def _friction(rng):
    mass, level = _log(rng, 0.3, 30.0), _log(rng, 0.5, 20.0)
    gains = _pid(rng, mass)
    viscous = mass * gains[3] * _log(rng, 1e-3, 0.1)
    static = level * rng.uniform(1.02, 1.5) if rng.random() < 0.5 else None

    def make(u):
        block = cdf.friction_mass(
            mass=mass * u.force * u.time**2 / u.length, coulomb=level * u.force,
            viscous=viscous * u.force * u.time / u.length,
            static=None if static is None else static * u.force,
        )  # fmt: skip
        least = 1.01 * (static or level) * u.force
        omega = (0.1 * gains[3] / u.time, 6 * gains[3] / u.time)
        name = "friction with static level" if static else "friction"
        return Loop("friction", name, _controller(gains, u), block, (least, 30 * least), omega, make)

    return make


def _gap(rng):
    motor, load = _log(rng, 0.3, 5.0), _log(rng, 0.3, 10.0)
    gains, gap = _pid(rng, motor + load), _log(rng, 1e-4, 0.05)
    restitution = rng.uniform(0.05, 0.6)

    def make(u):
        m = u.force * u.time**2 / u.length
        block = cdf.backlash_masses(motor * m, load * m, gap * u.length, restitution)
        size = motor * gap * gains[3] ** 2 * u.force
        omega = (0.15 * gains[3] / u.time, 5 * gains[3] / u.time)
        return Loop("gap", "gap", _controller(gains, u), block, (0.6 * size, 60 * size), omega, make)

    return make


def _plant(rng, gain_over_critical):
    """Third or fourth order, real and complex poles, with a gain relative to the critical one."""
    pace = _log(rng, 0.3, 30.0)
    den = np.array([1.0])
    for _ in range(int(rng.integers(1, 3))):
        den = np.polymul(den, [1.0, pace * _log(rng, 0.3, 3.0)])
    damping, own = rng.uniform(0.15, 1.0), pace * _log(rng, 0.5, 2.0)
    den = np.polymul(den, [1.0, 2 * damping * own, own**2])
    num = np.array([den[-1]])
    w = pace * np.geomspace(1e-2, 1e2, 20001)
    h = np.polyval(num, 1j * w) / np.polyval(den, 1j * w)
    turns = np.flatnonzero((h.imag[:-1] < 0) & (h.imag[1:] >= 0) & (h.real[:-1] < 0))
    critical = 1.0 / max(-h.real[turns].min(initial=-1e-9), 1e-9) if turns.size else 10.0
    return num * critical * gain_over_critical, den, pace


def _linear(num, den, u, gain=1.0):
    order = np.arange(len(den) - 1, -1, -1)
    return ct.tf(num * gain * u.time ** -float(len(den) - 1), den * u.time ** (order - float(len(den) - 1)))


def _element(rng, family, name, parts, factor, reach, pace, build, sampled=None):
    num, den = parts
    dt = sampled / pace if sampled else 0.0

    def make(u):
        block = build(u)
        H = _linear(num, den, u)
        if dt:
            # sampled first, then written in other units: small coefficients are zero to SciPy
            H = ct.sample_system(_linear(num, den, Units()), dt, "zoh")
            H = ct.tf(H.num, H.den, dt * u.time)
        # signals of elements are written in units of force
        box = (reach[0] * factor * u.force, reach[1] * factor * u.force)
        top = 30.0 if not dt else min(30.0, 0.9 * np.pi / sampled)
        omega = (0.03 * pace / u.time, top * pace / u.time)
        return Loop(family, name, H, block, box, omega, make, dt * u.time)

    return make


def _maybe_sampled(rng):
    return rng.uniform(0.02, 0.15) if rng.random() < 0.25 else None


def _saturation(rng):
    num, den, pace = _plant(rng, rng.uniform(1.1, 6.0))
    level = _log(rng, 0.1, 10.0)
    sampled = _maybe_sampled(rng)
    name = "saturation, sampled" if sampled else "saturation"
    return _element(rng, "saturation", name, (num, den), level, (1.01, 40.0), pace,
                    lambda u: cdf.saturation(level * u.force), sampled)  # fmt: skip


def _dead_zone(rng):
    num, den, pace = _plant(rng, rng.uniform(1.1, 6.0))
    width = _log(rng, 0.1, 10.0)
    return _element(rng, "dead zone", "dead zone", (num, den), width, (1.01, 40.0), pace,
                    lambda u: cdf.dead_zone(width * u.force))  # fmt: skip


def _relay(rng):
    num, den, pace = _plant(rng, _log(rng, 1.0, 5.0))
    level, kind = _log(rng, 0.1, 10.0), int(rng.integers(0, 3))
    width = level * _log(rng, 0.05, 0.6)
    gain = float(np.abs(np.polyval(num, 1j * pace) / np.polyval(den, 1j * pace)))
    if kind == 0:
        return _element(rng, "relay", "relay", (num, den), level, (1e-3, 1e2), pace,
                        lambda u: cdf.relay(level * u.force), _maybe_sampled(rng))  # fmt: skip
    if kind == 1:
        return _element(rng, "relay", "relay with hysteresis", (num, den), width, (1.01, 200.0), pace,
                        lambda u: cdf.relay_with_hysteresis(level * u.force, width * u.force))  # fmt: skip
    width *= 0.5 * gain
    return _element(rng, "relay", "relay with dead zone", (num, den), width, (1.001, 200.0), pace,
                    lambda u: cdf.relay_with_dead_zone(level * u.force, width * u.force))  # fmt: skip


def _steps(rng):
    if rng.random() < 0.5:
        num, den, pace = _plant(rng, rng.uniform(0.8, 4.0))
        step = _log(rng, 0.01, 1.0)
        return _element(rng, "steps", "quantizer", (num, den), step, (0.501, 30.0), pace,
                        lambda u: cdf.quantizer(step * u.force))  # fmt: skip
    gap, pace = _log(rng, 0.01, 1.0), _log(rng, 0.3, 30.0)
    den = np.polymul([1.0, 0.0], [1.0, pace])
    if rng.random() < 0.5:
        den = np.polymul(den, [1.0, pace * _log(rng, 1.0, 8.0)])
    num = np.array(
        [float(np.prod(np.abs(np.roots(den)[np.abs(np.roots(den)) > 0]))) * pace * _log(rng, 0.6, 4.0)]
    )
    return _element(rng, "steps", "play", (num, den), 0.5 * gap, (1.02, 200.0), pace,
                    lambda u: cdf.play(gap * u.force))  # fmt: skip


def _user(rng):
    num, den, pace = _plant(rng, rng.uniform(1.2, 5.0))
    size, kind = _log(rng, 0.1, 10.0), int(rng.integers(0, 4))
    laws = (np.tanh, lambda v: v**3, lambda v: v / (1 + np.abs(v)), lambda v: v * np.abs(v) + 0.3 * v)
    law = laws[kind]

    def build(u):
        scale = size * u.force
        return lambda v: scale * law(v / scale)

    name = ("tanh", "cubic", "soft saturation", "progressive")[kind]
    return _element(rng, "user function", name, (num, den), size, (0.05, 60.0), pace, build)
