"""Gravity, hysteresis, friction over place and load, motors, springs that push away, by other numbers."""

from types import SimpleNamespace

import numpy as np
import pytest
from brute_force import Dry
from scipy.integrate import solve_ivp
from scipy.special import ellipk

import ctrl_df as cdf

T = np.linspace(0, 6, 1201)


def push(t):
    return 9.0 * np.sin(4.0 * t) + 2.0 * np.sin(1.3 * t)


def compared(block, truth, limit, drive=push):
    """Worst difference of position over the range of the truth, by events and from sample to sample."""
    run = cdf.event_response(block, T, lambda t: [drive(t)])
    error = np.max(np.abs(run.outputs[0] - truth)) / np.ptp(truth)
    assert error < limit, error
    return run


def solved(rates, n):
    return solve_ivp(rates, (0, T[-1]), np.zeros(n), "DOP853", T, rtol=1e-11, atol=1e-13).y


def fundamental(rates, n, a, omega, laps=60):
    """N by brute force: laps until the start is forgotten, then one more."""
    t = np.linspace(0, laps * 2 * np.pi / omega, laps * 500 + 1)
    run = solve_ivp(rates, (0, t[-1]), np.zeros(n), "DOP853", t[-501:], rtol=1e-11, atol=1e-13)
    return 2 / a * np.mean((run.y[0] * np.exp(-1j * omega * t[-501:]))[:-1])


# --- gravity ----------------------------------------------------------------------------------------------


def test_a_pendulum_swings_with_the_period_of_the_elliptic_integral():
    inertia, torque, top = 0.3, 1.7, 2.4
    period = 4 * ellipk(np.sin(top / 2) ** 2) * np.sqrt(inertia / torque)
    block = cdf.Inertia(inertia, [cdf.Gravity(torque, 0.4)])
    run = cdf.event_response(block, [0, period / 2, period], 0.0, [0.4 + top, 0.0])
    assert run.outputs[0] == pytest.approx([0.4 + top, 0.4 - top, 0.4 + top], abs=1e-8)
    energy = 0.5 * inertia * run.outputs[1] ** 2 - torque * np.cos(run.outputs[0] - 0.4)
    assert np.ptp(energy) < 1e-9


def test_gravity_against_scipy():
    block = cdf.Inertia(0.3, [cdf.Gravity(1.7, 0.4), cdf.Viscous(0.2), cdf.Coulomb(0.3)])
    dry = Dry(lambda *a: 0.3, lambda *a: 0.3, lambda x, v: -1.7 * np.sin(x - 0.4) - 0.2 * v, 0.3,
              lambda t: 0.2 * push(t))  # fmt: skip
    compared(block, dry.run(T), 1e-7, lambda t: 0.2 * push(t))


def test_the_describing_function_of_a_pendulum():
    block = cdf.Inertia(0.3, [cdf.Gravity(1.7, 0.2), cdf.Viscous(0.4)])
    a, w = 0.8, 2.5
    brute = fundamental(
        lambda t, s: [s[1], (a * np.cos(w * t) - 1.7 * np.sin(s[0] - 0.2) - 0.4 * s[1]) / 0.3], 2, a, w
    )
    family = cdf.describing_function_family(block, [0.2, a], [w, 4.0])
    assert abs(family.N[1, 0] / brute - 1) < 1e-6
    # small swings: the linear pendulum
    small = 1 / (1.7 - 0.3 * 16.0 + 0.4j * 4.0)
    assert abs(cdf.describing_function(block, 1e-4, 4.0) / small - 1) < 1e-6


def test_an_inverted_pendulum_hunts_as_predicted_and_verified():
    block = cdf.Inertia(0.3, [cdf.Gravity(1.7, np.pi), cdf.Coulomb(0.05), cdf.Stiction(0.12)])
    loop = cdf.closed_loop(cdf.pid(12.0, 15.0, 1.2), block)
    orbit = cdf.find_limit_cycle(loop, guess=(0.4, 3.0))
    if orbit:
        assert orbit.residual < 1e-8


def test_gravity_is_of_machines_that_turn():
    with pytest.raises(ValueError, match="ConstantForce"):
        cdf.Mass(1.0, [cdf.Gravity(2.0)])
    with pytest.raises(ValueError, match="torque"):
        cdf.Gravity(-1.0)
    table = cdf.Inertia(0.3, [cdf.Gravity(1.7)]).parameters
    assert (table["gravity.torque"].unit, table["gravity.angle0"].unit) == ("N m", "rad")


# --- springs that soften or push away ---------------------------------------------------------------------


def test_springs_that_push_away_and_soften():
    # Duffing's double well: -3 x + 8 x^3
    block = cdf.Mass(1.5, [cdf.LinearSpring(-3.0), cdf.CubicSpring(8.0), cdf.Viscous(0.8)])
    truth = solved(lambda t, s: [s[1], (push(t) + 3 * s[0] - 8 * s[0] ** 3 - 0.8 * s[1]) / 1.5], 2)
    compared(block, truth[0], 1e-8)
    still = cdf.event_response(block, [0, 60.0], 0.0, [0.01, 0.0]).outputs[0][-1]
    assert still == pytest.approx(np.sqrt(3 / 8), rel=1e-6)
    soft = cdf.Mass(1.0, [cdf.LinearSpring(30.0), cdf.CubicSpring(-4.0), cdf.Viscous(0.8)])
    a, w = 6.0, 7.0
    brute = fundamental(
        lambda t, s: [s[1], a * np.cos(w * t) - 30 * s[0] + 4 * s[0] ** 3 - 0.8 * s[1]], 2, a, w
    )
    assert abs(cdf.describing_function(soft, a, w) / brute - 1) < 1e-6


# --- hysteresis -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [1.0, 2.0, 3.5])
def test_hysteresis_against_scipy(shape):
    block = cdf.Mass(1.5, [cdf.Hysteresis(4.0, 0.2, shape), cdf.Viscous(0.8)])

    def rates(t, s):
        z = s[2]
        return [
            s[1], (push(t) - 0.8 * s[1] - 4 * z) / 1.5, (s[1] - abs(s[1]) * abs(z) ** (shape - 1) * z) / 0.2
        ]  # fmt: skip

    compared(block, solved(rates, 3)[0], 1e-6)


def test_the_loop_of_a_hysteresis_has_a_closed_form():
    # From rest z = tanh(x / stroke) at shape 2, and on the way back z = tan until it is zero.
    law, p = cdf.Hysteresis.law, (4.0, 0.2, 2.0)

    def swept(start, way, x):
        def rate(s, z):
            dz = np.zeros(1)
            law(0.0, 0.0, way, z, p, dz)
            return dz

        return solve_ivp(rate, (0, x), [start], "DOP853", rtol=1e-10, atol=1e-12).y[0, -1]

    up = swept(0.0, 1.0, 0.3)
    assert up == pytest.approx(np.tanh(1.5), abs=1e-8)
    zero = 0.2 * np.arctan(up)
    assert swept(up, -1.0, zero) == pytest.approx(0.0, abs=1e-8)
    assert swept(up, -1.0, zero + 0.3) == pytest.approx(-np.tanh(1.5), abs=1e-8)
    assert cdf.Hysteresis(4.0, 0.2).steady(0.0) == (1.0,)


def test_fits_take_no_bend_that_is_a_corner():
    # beyond, steps are 1/shape of the stroke, and nobody sees why: one fit went to a shape of 480,000
    _, most = cdf.Hysteresis(1.0).ranges(SimpleNamespace(speed=1.0, dt=1e-3))["shape"]
    rate = lambda x, z: [1 - abs(z[0]) ** (most - 1) * z[0]]  # noqa: E731
    bend = solve_ivp(rate, (0, 1), [0.0], "LSODA", rtol=1e-9, atol=1e-11).y[0, -1]
    assert 1 - bend == pytest.approx(np.log(2) / most, rel=0.02) and 1 - bend < 0.01


def test_the_describing_function_of_a_hysteresis():
    block = cdf.Mass(1.5, [cdf.Hysteresis(4.0, 0.2), cdf.LinearSpring(20.0), cdf.Viscous(0.3)])
    a, w = 8.0, 3.0

    def rates(t, s):
        z = s[2]
        force = a * np.cos(w * t) - 20 * s[0] - 0.3 * s[1] - 4 * z
        return [s[1], force / 1.5, (s[1] - abs(s[1] * z) * z) / 0.2]

    assert abs(cdf.describing_function(block, a, w) / fundamental(rates, 3, a, w) - 1) < 1e-6


# --- friction over place and load -------------------------------------------------------------------------


def place(x):
    return 2.0 + 1.5 * np.sin(2 * np.pi * x / 0.7 + 0.4)


def test_friction_over_the_place():
    law = cdf.PositionDependentFriction(1.5, 0.7, 0.4)
    block = cdf.Mass(1.5, [cdf.Coulomb(2.0), law, cdf.Viscous(0.8)])
    dry = Dry(lambda x, *_: place(x), lambda x, *_: place(x), lambda x, v: -0.8 * v, 1.5, push)
    compared(block, dry.run(T), 1e-8)


def test_friction_over_the_place_takes_as_much_energy_as_its_level_over_the_way():
    block = cdf.Mass(1.5, [cdf.Coulomb(2.0), cdf.PositionDependentFriction(1.5, 0.7, 0.4)])
    stop = cdf.event_response(block, [0, 30.0], 0.0, [0.0, 3.0]).outputs[0][-1]
    x = np.linspace(0, stop, 200_001)
    assert np.trapezoid(place(x), x) == pytest.approx(0.5 * 1.5 * 9.0, rel=1e-8)


@pytest.mark.parametrize("share", [1.0, 0.6])
def test_friction_over_the_load(share):
    law = cdf.LoadDependentFriction(0.3, share)
    block = cdf.Mass(1.5, [cdf.Coulomb(1.0), law, cdf.LinearSpring(25.0), cdf.Viscous(0.8)])

    def level(x, drive, load):
        return 1.0 + 0.3 * abs(share * drive + (1 - share) * load)

    dry = Dry(level, level, lambda x, v: -25 * x - 0.8 * v, 1.5, push)
    compared(block, dry.run(T), 1e-7)


def test_what_a_load_holds_by_itself():
    # worm gear: friction that grows with the load carries it whatever it is, above a coefficient of one
    for coefficient, holds in ((0.99, False), (1.01, True)):
        block = cdf.Mass(1.0, [cdf.ConstantForce(5.0), cdf.LoadDependentFriction(coefficient, 0.0)])
        run = cdf.event_response(block, [0, 1.0], 0.0)
        assert (run.outputs[0][-1] == 0.0) == holds


def test_back_emf_belongs_to_the_drive():
    motor = cdf.TorqueConstant(0.5, 2.0)
    block = cdf.Mass(1.5, [motor, cdf.LoadDependentFriction(0.3), cdf.Coulomb(0.2)])

    def rates(t, s):
        drive = 0.5 * (20 * np.cos(t) + 30 - 0.5 * s[1]) / 2.0
        return [s[1], (drive - 0.2 - 0.3 * abs(drive)) / 1.5]

    t = np.linspace(0, 3, 301)
    truth = solve_ivp(rates, (0, 3), [0.0, 0.0], "DOP853", t, rtol=1e-11, atol=1e-13).y[0]
    run = cdf.event_response(block, t, lambda t: [20 * np.cos(t) + 30])
    assert np.max(np.abs(run.outputs[0] - truth)) < 1e-9 * np.ptp(truth)


def test_two_bodies_with_friction_over_place_and_load():
    effects = [cdf.LoadDependentFriction(0.2), cdf.PositionDependentFriction(0.5, 0.3), cdf.Coulomb(1.0)]
    two = cdf.TwoMass(0.9, 0.6, [*effects, cdf.Compliance(4e5, 200.0)], measured="motor")
    # a joint nearly rigid: half of the inertia behind it, all friction on the motor
    one = cdf.Mass(1.5, effects)
    a, b = (cdf.event_response(m, T, lambda t: [push(t)]) for m in (one, two))
    assert np.max(np.abs(a.outputs[0] - b.outputs[0])) < 1e-3 * np.ptp(a.outputs[0])


# --- motor ------------------------------------------------------------------------------------------------


def test_what_limits_the_voltage_is_in_volts():
    amplifier = cdf.Mass(2.0, [cdf.InputSaturation(12.0), cdf.TorqueConstant(20.0, 4.0), cdf.Coulomb(1.0)])
    behind = cdf.Mass(2.0, [cdf.TorqueConstant(20.0, 4.0), cdf.InputSaturation(60.0)])
    assert amplifier.parameters["input_saturation.level"].unit == "V"
    assert behind.parameters["input_saturation.level"].unit == "N"
    volts = 20 * np.sin(3 * T) + 8 * np.sin(11 * T)
    x = np.asarray(cdf.event_response(amplifier, T, volts, input_hold="zoh").outputs)[0]
    noisy = x + 1e-4 * np.std(x) * np.random.default_rng(0).standard_normal(T.size)
    start = amplifier.with_parameters({"input_saturation.level": 9.0, "coulomb.level": 1.3})
    for scale, unit in ((1.0, "V"), (1e3, "mV")):
        fit = cdf.refit(start, cdf.Measurement(T, scale * volts, noisy, input_unit=unit))
        level = fit.parameters["input_saturation.level"]
        assert level.unit == "V" and abs(level.value - 12.0) < 3 * level.standard_error < 0.05


def test_a_motor_on_voltage_and_on_current():
    plain = cdf.Mass(1.5, [cdf.Viscous(0.8 + 0.125), cdf.Coulomb(1.0)])
    volts = cdf.Mass(1.5, [cdf.TorqueConstant(0.5, 2.0), cdf.Viscous(0.8), cdf.Coulomb(1.0)])
    a = cdf.event_response(plain, T, push(T))
    b = cdf.event_response(volts, T, 4 * push(T))
    assert np.max(np.abs(a.outputs[0] - b.outputs[0])) < 1e-9
    amperes = cdf.Mass(1.5, [cdf.TorqueConstant(0.5), cdf.Viscous(0.8 + 0.125), cdf.Coulomb(1.0)])
    c = cdf.event_response(amperes, T, 2 * push(T))
    assert np.max(np.abs(a.outputs[0] - c.outputs[0])) < 1e-9
    assert (volts.signals["F"], amperes.signals["F"], plain.signals["F"]) == ("V", "A", "N")
    turning = cdf.Inertia(1e-4, [cdf.TorqueConstant(0.02, 1.5)])
    assert turning.signals["torque"] == "V" and turning.parameters["torque_constant.constant"].unit == "N m/A"
    assert cdf.describing_function(volts, 40.0, 5.0) * 4 == pytest.approx(
        cdf.describing_function(plain, 10.0, 5.0), rel=1e-6
    )
    many = cdf.batch_response(
        volts, T, 4 * push(T), params={"torque_constant.constant": np.array([0.5, 0.6])}
    )
    assert np.max(np.abs(many.outputs[0, 0] - b.outputs[0])) < 1e-9


@pytest.mark.parametrize("made", [
    lambda: cdf.TorqueConstant(0.0),
    lambda: cdf.TorqueConstant(1.0, -2.0),
    lambda: cdf.Hysteresis(1.0, 0.0),
    lambda: cdf.Hysteresis(1.0, 1.0, 0.5),
    lambda: cdf.Hysteresis(-1.0),
    lambda: cdf.LoadDependentFriction(-0.1),
    lambda: cdf.LoadDependentFriction(0.1, 1.5),
    lambda: cdf.PositionDependentFriction(1.0, 0.0),
    lambda: cdf.Gravity(float("nan")),
])  # fmt: skip
def test_bad_parameters_are_refused(made):
    with pytest.raises(ValueError, match="needs"):
        made()


# --- found in records -------------------------------------------------------------------------------------


def recorded(block, t, u, seed=0):
    y = cdf.event_response(block, t, u, 0.0, input_hold="zoh").outputs[0]
    y = y + 1e-3 * np.std(y) * np.random.default_rng(seed).standard_normal(len(t))
    units = {
        k: block.signals[name] for k, name in zip(("input_unit", "output_unit"), block.signals, strict=False)
    }
    return cdf.Measurement(t, u, y, **units)


@pytest.mark.parametrize(
    "hidden",
    [
        cdf.LinearSpring(-12.0),
        cdf.CubicSpring(-40.0),
        # at 5 ms over 4 s, three waves follow the segments fitted alike: those held out decide
        cdf.PositionDependentFriction(0.8, 0.3, 0.5),
        cdf.Hysteresis(1.5, 0.02),
    ],
    ids=lambda e: e.id,
)
def test_it_is_named_among_its_likes(hidden):
    likes = {"linear_spring": "cubic_spring", "cubic_spring": "linear_spring", "hysteresis": "linear_spring",
             "position_dependent_friction": "load_dependent_friction"}  # fmt: skip
    rng, t = np.random.default_rng(3), np.arange(0, 4, 5e-3)
    tones, phases = rng.uniform(0.3, 3, 8), rng.uniform(0, 6, 8)
    u = sum(4 * np.sin(2 * np.pi * f * t + p) for f, p in zip(tones, phases, strict=True))
    base = cdf.Mass(3.0, [cdf.Coulomb(2.0), cdf.Viscous(6.0), cdf.LinearSpring(40.0, 0.05)])
    if hidden.id == "linear_spring":
        base = cdf.Mass(3.0, [cdf.Coulomb(2.0), cdf.Viscous(6.0), cdf.CubicSpring(60.0)])
    data = recorded(base.with_effect(hidden), t, u)
    off = base.with_parameters({"mass": 2.6, "coulomb.level": 2.4})
    found = cdf.diagnose(off, data, candidates=(hidden.id, likes[hidden.id]))
    assert found.verdict == "effect" and found.best.id == hidden.id
    name, p = next(iter(hidden.parameters.items()))
    assert found.best.parameters[name] == pytest.approx(p.value, rel=0.1)
