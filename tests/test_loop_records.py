"""Records of a loop's reference: the force of the controller is worked out, and the block diagnosed by it."""

import warnings

import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.identify.prediction.loop_force import driven_by_force
from ctrl_df.identify.smoothing.missing_force import missing_force

T = np.arange(0, 4, 0.005)
REFERENCE = 0.1 * np.sin(2 * T) + 0.03 * np.sin(9 * T)
PLAIN = cdf.friction_mass(2.0, 2.5, 5.0)
SPRUNG = cdf.friction_mass(2.0, 3.0, 5.0).with_effect(cdf.LinearSpring(300.0))
CONTROLLERS = {
    "filtered": (cdf.pid(2e3, 1e3, 200, 0.01), 0.0, 0.02),
    "ideal": (cdf.pid(2e3, 1e3, 200), 0.0, 0.02),
    "sampled": (cdf.pid(2e3, 1e3, 100), 0.005, 0.02),
}


FINE = 60


def recorded(kind, noise=1e-6, **keywords):
    """Return the loop with the plain model, the record of one with a spring, and its mean force by sample."""
    pid, dt, _ = CONTROLLERS[kind]
    t, reference = 0.005 / FINE * np.arange(FINE * T.size), np.repeat(REFERENCE, FINE)
    run = cdf.event_response(cdf.closed_loop(pid, SPRUNG, dt), t, reference, input_hold="zoh")
    x, force = np.asarray(run.outputs)
    x = x[::FINE] + noise * np.random.default_rng(0).standard_normal(T.size)
    mean = force.reshape(-1, FINE).mean(axis=1)
    return cdf.closed_loop(pid, PLAIN, dt), cdf.Measurement(T, REFERENCE, x, **keywords), mean


@pytest.mark.parametrize("kind", CONTROLLERS)
def test_the_force_is_that_of_the_controller(kind):
    """Measured: 1.3 % (of it 1 % the mean that it is compared with), 0.8 and 0.2 %."""
    loop, record, mean = recorded(kind, input_unit="m")
    known = driven_by_force(loop, record)
    assert known.input_unit == "N" and "worked out" in known.note

    assert np.std((known.u - mean)[20:-20]) < CONTROLLERS[kind][2] * np.std(mean)


def test_what_the_block_lacks_is_found():
    loop, record, _ = recorded("filtered", noise=1e-5, input_unit="m")
    found = cdf.diagnose(loop, record, candidates=["linear_spring", "drift"])
    assert found.ranking[0].id == "linear_spring"
    assert found.ranking[0].parameters["stiffness"] == pytest.approx(300.0, rel=0.02)
    assert missing_force(loop, record).shares["position"] > 0.9


def test_a_reference_that_is_called_a_force_is_refused():
    loop, record, _ = recorded("filtered")
    for ask in (cdf.diagnose, cdf.improve, missing_force):
        with pytest.raises(ValueError, match="input is in N|is in N, but the output follows"):
            ask(loop, record)


def test_a_reference_of_what_was_not_measured_is_refused():
    loop, record, _ = recorded("filtered")
    speed = cdf.Measurement(T, REFERENCE, np.gradient(record.y, T), input_unit="m", output_unit="m/s")
    with pytest.raises(ValueError, match="reference .* position, which was not measured"):
        cdf.diagnose(loop, speed)


def test_a_force_that_is_taken_for_a_reference_is_warned_of():
    loop, record, _ = recorded("filtered")
    force = driven_by_force(loop, record.noted("", input_unit="m"))
    without = cdf.Measurement(T, force.u, record.y)
    with pytest.warns(UserWarning, match=r"taken for the reference of the loop, in m.*loop\.parts\.block"):
        cdf.compare(loop, without)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cdf.compare(loop, record)
