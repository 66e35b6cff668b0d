"""How large each hidden effect is: one number, its size, to the effect's parameters.

`size` grows with the error it makes. Scales of the drawn base model: ``peak`` force, ``speed``, ``stroke``,
``w`` [rad/s], ``kinetic`` friction level.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

# Effects of one rig act in this order (it matters for friction laws that build on each other and for drives).
ORDER = (
    "coulomb", "load_dependent_friction", "position_dependent_friction",
    "stribeck", "stiction", "asymmetric_coulomb", "load_friction", "bristle", "viscous",
    "quadratic_drag", "asymmetric_viscous", "linear_spring", "cubic_spring", "position_ripple", "gravity",
    "hysteresis", "constant_force", "hard_stop", "backlash", "compliance", "input_gain", "input_saturation",
    "input_dead_zone", "input_delay", "input_lag", "sensor_delay", "sensor_quantization", "sensor_offset",
    "drift",
)  # fmt: skip


@dataclass(frozen=True)
class Kind:
    """A hidden effect: its id, the law from size to parameters, a typical size and the sizes allowed."""

    id: str
    draw: Callable
    typical: float
    span: tuple[float, float]
    regions: tuple[str, ...] = ()


EFFECTS: dict[str, Kind] = {}
OUTSIDE: dict[str, Kind] = {}


def _kind(table, id, typical, span, regions=()):
    def keep(law):
        def draw(rng, c, size):
            head = "outside" if table is OUTSIDE else id
            return {f"{head}.{k}": float(v) for k, v in law(rng, c, size).items()}

        table[id] = Kind(id, draw, typical, span, regions)
        return law

    return keep


def _effect(id, typical, span):
    return _kind(EFFECTS, id, typical, span)


def _outside(id, typical, span, *regions):
    return _kind(OUTSIDE, id, typical, span, regions)


@dataclass(frozen=True)
class Needs:
    """What the base model must be like for the hidden effects to show."""

    effects: tuple[str, ...] = ()
    dry: tuple[float, float] = (0.08, 0.3)  # kinetic level over inertia force
    drive: tuple[float, float] = (1.2, 2.5)  # peak force over inertia force
    stroke: tuple[float, float] | None = None  # swing [rad], where it matters


def base_needs(ids, outside) -> Needs:
    """Return the base model these effects need."""
    effects = []
    if "load_friction" in ids and "compliance" not in ids and "backlash" not in ids:
        effects.append("compliance")
    if "sensor_offset" in ids and not {"cubic_spring", "hard_stop"} & set(ids):
        effects.append("cubic_spring")
    slow = {"stiction", "stribeck", "bristle"} & set(ids)
    if slow:
        return Needs(tuple(effects), (0.3, 0.6), (0.7, 1.4))
    return Needs(tuple(effects), stroke=(0.5, 1.5) if "gravity" in ids else None)


# --- friction -------------------------------------------------------------------------------------


@_effect("viscous", 0.1, (1e-4, 0.8))
def _(rng, c, s):
    return {"coefficient": s * c.peak / c.speed}


@_effect("coulomb", 0.1, (1e-4, 0.4))
def _(rng, c, s):
    return {"level": s * c.peak}


@_effect("stiction", 0.4, (0.02, 2.0))
def _(rng, c, s):
    return {"level": c.kinetic * (1 + s)}


@_effect("stribeck", 0.4, (0.01, 1.2))
def _(rng, c, s):
    return {"level": c.kinetic * (1 + s), "velocity": c.speed * rng.uniform(0.05, 0.3)}


@_effect("bristle", 0.02, (5e-4, 0.4))
def _(rng, c, s):
    k = c.kinetic / (s * c.stroke)
    return {"stiffness": k, "damping": rng.uniform(0.2, 0.8) * math.sqrt(k * c.base["mass"])}


@_effect("quadratic_drag", 0.1, (1e-4, 0.8))
def _(rng, c, s):
    return {"coefficient": s * c.peak / c.speed**2}


@_effect("asymmetric_coulomb", 0.05, (1e-5, 1.0))
def _(rng, c, s):
    return {"difference": rng.choice([-1, 1]) * s * c.kinetic}


@_effect("asymmetric_viscous", 0.05, (1e-5, 0.8))
def _(rng, c, s):
    return {"difference": rng.choice([-1, 1]) * s * c.peak / c.speed}


@_effect("load_friction", 0.1, (1e-3, 0.3))
def _(rng, c, s):
    return {"level": s * c.peak}


@_effect("load_dependent_friction", 0.1, (1e-3, 0.6))
def _(rng, c, s):
    return {"coefficient": s}


@_effect("position_dependent_friction", 0.3, (0.01, 1.0))
def _(rng, c, s):
    wavelength = c.stroke * math.exp(rng.uniform(math.log(0.3), math.log(5.0)))
    return {"amplitude": s * c.kinetic, "wavelength": wavelength, "phase": rng.uniform(-math.pi, math.pi)}


# --- forces over position -------------------------------------------------------------------------


@_effect("position_ripple", 0.05, (1e-4, 0.5))
def _(rng, c, s):
    wavelength = c.stroke * rng.uniform(0.15, 0.8)
    return {"amplitude": s * c.peak, "wavelength": wavelength, "phase": rng.uniform(-math.pi, math.pi)}


@_effect("gravity", 0.2, (1e-4, 2.0))
def _(rng, c, s):
    return {"torque": s * c.peak, "angle0": rng.uniform(-0.5, 0.5)}


@_effect("hysteresis", 0.1, (1e-3, 1.0))
def _(rng, c, s):
    return {"force": s * c.peak, "stroke": c.stroke * rng.uniform(0.1, 0.8)}


@_effect("constant_force", 0.01, (1e-6, 0.3))
def _(rng, c, s):
    return {"force": rng.choice([-1, 1]) * s * c.peak}


@_effect("linear_spring", 0.05, (1e-5, 1.0))
def _(rng, c, s):
    return {"stiffness": s * c.peak / c.stroke}


@_effect("cubic_spring", 0.1, (1e-6, 2.0))
def _(rng, c, s):
    return {"stiffness": s * c.peak / c.stroke**3}


@_effect("hard_stop", 0.2, (0.003, 0.8))
def _(rng, c, s):
    return {"limit": c.reach * (1 - s), "restitution": rng.uniform(0.0, 0.6)}


# --- joint ----------------------------------------------------------------------------------------


@_effect("backlash", 0.05, (2e-4, 0.6))
def _(rng, c, s):
    return {"gap": s * c.stroke, "restitution": rng.uniform(0.0, 0.5), "load_fraction": rng.uniform(0.2, 0.7)}


@_effect("compliance", 0.05, (2e-4, 0.6))
def _(rng, c, s):
    share = rng.uniform(0.2, 0.7)
    k = share * c.peak / (s * c.stroke)
    reduced = share * (1 - share) * c.base["mass"]
    return {
        "stiffness": k,
        "damping": 2 * rng.uniform(0.03, 0.12) * math.sqrt(k * reduced),
        "load_fraction": share,
    }


# --- drive ----------------------------------------------------------------------------------------


@_effect("input_gain", 0.05, (1e-3, 0.5))
def _(rng, c, s):
    return {"gain": 1 + rng.choice([-1, 1]) * s}


@_effect("input_saturation", 0.3, (0.02, 0.8))
def _(rng, c, s):
    return {"level": c.force_reach * (1 - s)}


@_effect("input_dead_zone", 0.1, (1e-3, 0.3))
def _(rng, c, s):
    return {"threshold": s * c.peak}


@_effect("input_delay", 0.05, (1e-3, 0.3))
def _(rng, c, s):
    return {"delay": s / c.w}


@_effect("input_lag", 0.05, (1e-3, 0.3))
def _(rng, c, s):
    return {"time_constant": s / c.w}


# --- sensor ---------------------------------------------------------------------------------------


@_effect("sensor_delay", 0.05, (1e-3, 0.3))
def _(rng, c, s):
    return {"delay": s / c.w}


@_effect("sensor_quantization", 0.05, (1e-4, 0.8))
def _(rng, c, s):
    return {"step": s * c.stroke}


@_effect("sensor_offset", 0.2, (1e-3, 1.0))
def _(rng, c, s):
    return {"offset": rng.choice([-1, 1]) * s * c.stroke}


@_effect("drift", 0.05, (1e-4, 1.0))
def _(rng, c, s):
    return {"rate": rng.choice([-1, 1]) * s * c.stroke / (c.n * c.dt)}


# --- what the library does not have ---------------------------------------------------------------


@_outside("time_varying_mass", 0.2, (0.01, 2.0), "time")
def _(rng, c, s):
    return {"mass_rate": s / (c.n * c.dt)}


@_outside("friction_rising_in_time", 0.5, (0.02, 5.0), "time")
def _(rng, c, s):
    return {"coulomb_rate": s / (c.n * c.dt)}


@_outside("friction_warming", 0.5, (0.02, 5.0), "time")
def _(rng, c, s):
    return {"warming": s * c.kinetic / (c.kinetic * c.speed * c.n * c.dt)}


@_outside("friction_zone", 0.5, (0.02, 6.0), "position")
def _(rng, c, s):
    middle, width = rng.uniform(-0.5, 0.5) * c.reach, rng.uniform(0.15, 0.35) * c.reach
    return {"zone": s * c.kinetic, "zone_low": middle - width, "zone_high": middle + width}


@_outside("detent", 0.1, (1e-3, 1.0), "position")
def _(rng, c, s):
    return {
        "well": s * c.peak,
        "well_x": rng.uniform(-0.5, 0.5) * c.reach,
        "well_width": rng.uniform(0.06, 0.15) * c.reach,
    }


@_outside("hum", 0.02, (1e-4, 0.3), "frequency", "time")
def _(rng, c, s):
    return {"hum": s * c.peak, "hum_omega": c.w * rng.uniform(1.3, 4.0), "hum_phase": rng.uniform(0, 6.28)}


@_outside("push", 0.1, (1e-3, 1.0), "time")
def _(rng, c, s):
    start, span = rng.uniform(0.25, 0.7) * c.n * c.dt, rng.uniform(0.05, 0.15) * c.n * c.dt
    return {"push": s * c.peak, "push_from": start, "push_to": start + span}


@_outside("drive_gain_over_position", 0.1, (1e-3, 0.6), "position", "load")
def _(rng, c, s):
    return {"gain_ripple": s, "gain_length": rng.uniform(0.4, 1.0) * c.reach}
