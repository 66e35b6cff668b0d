"""Constant propagators between samples: the same answers as the general steps, no event missed."""

import numpy as np
import pytest
from steps import compared, record

import ctrl_df as cdf
from ctrl_df.simulate.kernel import driver

STEP = 2e-3
SHORT = 0.9e-3  # a longest step that leaves no propagator to use


def rigs(rng):
    """Mechanisms and loops that are affine between events, sizes drawn."""

    def size(low, high):
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    mass = cdf.Mass(size(0.5, 5))
    dry = mass.with_effect(cdf.Coulomb(size(1, 4)))
    damped = dry.with_effect(cdf.Viscous(size(0.1, 2)))
    gap = cdf.backlash_masses(size(0.5, 2), size(0.5, 2), size(2e-3, 2e-2), size(0.2, 0.8))
    gains = cdf.pid(size(300, 900), size(200, 2000), size(10, 40), tf=4e-3)
    return {
        "coulomb": dry,
        "viscous": damped,
        "static level": damped.with_effect(cdf.Stiction(size(5, 7))),
        "spring": damped.with_effect(cdf.LinearSpring(size(50, 500))),
        "unequal": mass.with_effect(cdf.AsymmetricCoulomb(0.7)).with_effect(cdf.Coulomb(2.0)),
        "stop": damped.with_effect(cdf.LinearSpring(30.0)).with_effect(cdf.HardStop(size(0.02, 0.2), 0.4)),
        "gap": gap,
        "joint": damped.with_effect(cdf.Compliance(size(2e3, 2e4), size(1, 10))),
        "lag": damped.with_effect(cdf.InputLag(size(5e-3, 5e-2))),
        "saturation": damped.with_effect(cdf.InputSaturation(size(4, 9))),
        "dead zone": damped.with_effect(cdf.InputDeadZone(size(0.5, 3))),
        "drift": damped.with_effect(cdf.Drift(0.1)),
        "loop": cdf.closed_loop(gains, damped),
        "loop with gap": cdf.closed_loop(gains, gap),
        "sampled": cdf.closed_loop(gains, damped, dt=4e-3),
        "sampled off the grid": cdf.closed_loop(gains, damped, dt=7e-3),
    }


@pytest.mark.parametrize("hold", ["zoh", "linear"])
@pytest.mark.parametrize("name", list(rigs(np.random.default_rng(0))))
def test_the_same_as_the_general_steps(name, hold):
    for seed in range(3):
        rng = np.random.default_rng([seed, 5])
        system = rigs(rng)[name]
        t = np.arange(1500) * STEP
        u = record(rng, t, 0.01 if "loop" in name or "sampled" in name else 15.0)
        error = compared(system, t, u, hold, SHORT, 200, 1e-8)
        assert error < 2e-7, error


@pytest.mark.parametrize(("late", "every"), [(0.3e-3, 1), (0.0, 4), (0.0, 0.25), (0.7e-3, 1)])
def test_outputs_off_the_samples(late, every):
    """Outputs between the samples, some of them, or several a sample."""
    from ctrl_df.simulate.engine import Engine, sampled_drive

    block = cdf.friction_mass(2, 3, 0.4)
    t = np.arange(1500) * STEP
    u = record(np.random.default_rng(3), t, 15.0)
    times = np.arange(late, t[-1], every * STEP)
    engine = Engine(block)
    drive = sampled_drive(t, u, "linear")
    fast = engine.run(engine.start(), times[-1], drive, times)
    slow = engine.run(engine.start(), times[-1], drive, times, max_step=0.2 * STEP, rtol=1e-10)
    assert fast.propagated > len(times) // 2
    np.testing.assert_allclose(fast.outputs, slow.outputs, atol=1e-8 * np.max(np.abs(slow.outputs)))
    np.testing.assert_allclose(fast.states, slow.states, atol=1e-8 * np.max(np.abs(slow.states)))


def test_a_touch_inside_a_sample_is_met():
    """A mass swings against a stop for a small part of one sample; the samples themselves see nothing."""
    omega = 10.0
    swing = cdf.Mass(1.0).with_effect(cdf.LinearSpring(omega**2))
    hits = []
    for phase in np.linspace(0, 1, 41):
        # highest point 1e-4 beyond the stop, somewhere between two samples
        step = 0.11
        t = np.arange(6) * step
        begin = -(2 + phase) * step * omega
        block = swing.with_effect(cdf.HardStop(np.cos(0.02), 0.0, lower=-2.0))
        response = cdf.event_response(block, t, 0.0, [np.cos(begin), -omega * np.sin(begin)])
        hits.append(response.event_count > 0)
        assert np.max(response.outputs[0]) <= np.cos(0.02) + 1e-12
    assert all(hits)


@pytest.mark.parametrize("hold", ["zoh", "linear"])
def test_modes_far_faster_than_the_samples(hold):
    """Margins bend within a part of a step: a joint of 400 Hz, a speed that follows a force in 0.4 ms."""
    dry = cdf.friction_mass(1.5, 3.0, 0.5)
    joint = dry.with_effect(cdf.Compliance(2.4e6, 40.0, load_fraction=0.6))
    held = cdf.friction_mass(1.5, 3.0, 4000.0).with_effect(cdf.LinearSpring(3e4))
    t = np.arange(1500) * STEP
    for seed, system in enumerate((joint, held)):
        u = record(np.random.default_rng(seed), t, 15.0)
        error = compared(system, t, u, hold, SHORT, 900, 1e-8)
        assert error < 1e-9, error


def test_bodies_in_contact_stay_there_to_the_last_digit():
    """What a step adds to both differed by rounding, grew, and at their release they hit each other."""
    loop = rigs(np.random.default_rng([1, 5]))["loop with gap"]
    t = np.arange(1500) * STEP
    response = cdf.event_response(loop, t, record(np.random.default_rng(6), t, 0.01))
    assert response.propagated > 1000
    x, v, x_motor, v_motor = np.asarray(response.states)[-4:]
    assert np.sum(v == v_motor) > 200
    near = np.abs(v - v_motor) < 1e-9 * np.max(np.abs(v))
    assert np.array_equal(v[near], v_motor[near])


def test_units_do_not_matter():
    """Lengths and forces in other units by 1e9: the same steps, the same answers."""
    t = np.arange(1500) * STEP
    u = record(np.random.default_rng(4), t, 15.0)
    found = []
    for unit in (1e-9, 1.0, 1e9):
        block = cdf.Mass(2.0).with_effect(cdf.Coulomb(3.0 * unit)).with_effect(cdf.LinearSpring(80.0))
        found.append(cdf.event_response(block, t, unit * u))
    for one in found[::2]:
        assert one.propagated == found[1].propagated and one.event_count == found[1].event_count
    for one, unit in ((found[0], 1e-9), (found[2], 1e9)):
        np.testing.assert_allclose(
            one.outputs / unit, found[1].outputs, atol=1e-11 * np.max(np.abs(found[1].outputs))
        )


def test_more_modes_than_are_kept():
    """A staircase has more modes than propagators are kept for: those that come back are made again."""
    corners = np.arange(1, 15) * 1.0
    points = [(-1.0, -1.0), *[(c, c + 0.3 * (-1) ** i) for i, c in enumerate(corners)]]
    law = cdf.piecewise_linear([p[0] for p in points], [p[1] for p in points])
    from control import tf

    loop = cdf.closed_loop(tf([1], [1, 1]), law)
    t = np.arange(4000) * STEP
    u = 16 * np.sin(0.9 * t) + 10
    fast = cdf.event_response(loop, t, u)
    slow = cdf.event_response(loop, t, u, max_step=SHORT)
    assert fast.event_count == slow.event_count > 20
    np.testing.assert_allclose(fast.outputs, slow.outputs, atol=1e-8)


def test_the_engine_is_compiled_once():
    assert driver.address() == driver.address()
    assert len(driver.advance.overloads) == 1
