"""Laws that `rigs` does not draw, hidden in machines that no code of the library simulates."""

import math

import numpy as np
import pytest
import rig_physics as physics
from numba import njit

import ctrl_df as cdf


def measured(u, y, dt, noise, seed, **units):
    t = dt * np.arange(len(u))
    return cdf.Measurement(t, u, y + noise * np.random.default_rng(seed).standard_normal(len(u)), **units)


def pushes(dt, count, seed, parts):
    """Return a sum of sines (amplitude, frequency [Hz])."""
    t, rng = dt * np.arange(count), np.random.default_rng(seed)
    return sum(a * np.sin(2 * math.pi * f * t + rng.uniform(0, 6)) for a, f in parts)


def test_a_spring_of_negative_stiffness():
    """An arm that a spring pulls away from the middle; the cubic one, which holds it, is known."""
    u = pushes(4e-3, 1500, 1, [(6, 0.4), (4, 1.1), (3, 2.6)])
    p = physics.numbers(MOTOR=2.2, COULOMB=1.5, VISCOUS=6.0, SPRING=-14.0, CUBIC=90.0)
    record = measured(u, physics.run(p, u, dt=4e-3)["x"], 4e-3, 1e-4, 2)
    model = cdf.friction_mass(2.0, 1.8, 5.0).with_effect(cdf.CubicSpring(75.0))
    found = cdf.diagnose(model, record, candidates=("linear_spring", "quadratic_drag", "hysteresis"))
    assert found.verdict == "effect" and found.best.id == "linear_spring"
    assert found.best.parameters["stiffness"] == pytest.approx(-14.0, rel=0.01)


def test_a_motor_on_volts():
    """A motor pushes k V/R less k^2 v/R: the second is viscous friction, as any physics has it."""
    k, r = 0.8, 1.6
    volts = pushes(4e-3, 1500, 3, [(12, 0.4), (8, 1.1), (5, 2.6)])
    p = physics.numbers(
        MOTOR=0.3, COULOMB=1.2, VISCOUS=0.5 + k * k / r, STRIBECK=2.0, STRIBECK_V=0.4, GAIN=k / r
    )
    y = physics.run(p, volts, dt=4e-3, substeps=40)["x"]
    record = measured(volts, y, 4e-3, 3e-4, 4, input_unit="V", output_unit="rad")
    model = cdf.Inertia(0.33, [cdf.TorqueConstant(k, resistance=r), cdf.Coulomb(1.5), cdf.Viscous(0.6)])
    free = ["inertia", "coulomb", "viscous"]
    few = ("stribeck", "quadratic_drag", "linear_spring")
    found = cdf.diagnose(model, record, free=free, candidates=few)
    assert found.verdict == "effect" and found.best.id == "stribeck"
    values = {key: p.value for key, p in found.best.model.parameters.items()}
    assert values["inertia"] == pytest.approx(0.3, rel=0.01)
    assert values["viscous.coefficient"] == pytest.approx(0.5, rel=0.05)
    assert values["stribeck.level"] == pytest.approx(2.0, rel=0.02)


@njit(error_model="numpy")
def slides(u, dt, pieces, mass, level, viscous, stiffness, damping):
    """Return the place of a mass on elements that slip one after another, by classical Runge-Kutta steps."""
    n = len(stiffness)
    state, x = np.zeros(2 + n), np.zeros(len(u))
    k, at, h = np.zeros((4, 2 + n)), np.zeros(2 + n), dt / pieces
    for i in range(len(u)):
        x[i] = state[0]
        for _ in range(pieces):
            for stage in range(4):
                at[:] = state
                if stage > 0:
                    at += (h if stage == 3 else 0.5 * h) * k[stage - 1]
                force, v = u[i] - viscous * at[1], at[1]
                for j in range(n):
                    share = stiffness[j] * at[2 + j] * n / level
                    k[stage, 2 + j] = v - abs(v) * abs(share) * share
                    force -= stiffness[j] * at[2 + j] + damping / n * k[stage, 2 + j]
                k[stage, 0], k[stage, 1] = v, force / mass
            state += h / 6 * (k[0] + 2 * k[1] + 2 * k[2] + k[3])
    return x


def test_presliding_by_elements_that_slip_one_after_another():
    """Four of them, of stiffnesses 1 to 27, below the level that breaks the joint loose and above it."""
    dt, stiffness = 2e-3, 3e4 * np.array([27.0, 9.0, 3.0, 1.0]) / 40
    u = pushes(dt, 1000, 5, [(4.5, 0.6), (3.0, 1.7), (1.5, 3.9)])
    y = slides(u, dt, 60, 1.5, 6.0, 4.0, stiffness, 20.0)
    record = measured(u, y, dt, 2e-7, 6)
    model = cdf.friction_mass(1.7, 5.0, 5.0)
    found = cdf.diagnose(model, record, candidates=("maxwell_slip", "bristle"))
    assert found.verdict == "effect" and found.best.id == "maxwell_slip"
    values = found.best.parameters
    # measured 4e-4 (the damping)
    assert values == pytest.approx({"stiffness": 3e4, "spread": 27.0, "damping": 20.0}, rel=2e-3)
