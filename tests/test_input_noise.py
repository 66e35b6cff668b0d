"""A force is measured, too: its noise never acted, and is no missing effect."""

import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.identify.residuals.input_noise import input_noise

T = np.arange(0, 4, 0.004)
AXIS = cdf.friction_mass(9.0, 6.0, 15.0)
SINES = (
    20 * np.sin(2 * np.pi * 0.6 * T) + 12 * np.sin(2 * np.pi * 1.7 * T + 1) + 6 * np.sin(2 * np.pi * 4.1 * T)
)
INPUTS = {
    "sines": SINES,
    "steps": 15 * np.sign(np.sin(2 * np.pi * 0.8 * T)),
    "chirp": 20 * np.sin(2 * np.pi * (0.5 * T + 1.5 * T**2)),
}


def record(u, sensor=2e-6, force=0.0, seed=3):
    rng = np.random.default_rng(seed)
    x = np.asarray(cdf.event_response(AXIS, T, u, input_hold="zoh").outputs)[0]
    noisy = u + force * np.std(u) * rng.standard_normal(T.size)
    return cdf.Measurement(T, noisy, x + sensor * rng.standard_normal(T.size))


@pytest.mark.parametrize("name", INPUTS)
def test_noise_of_an_input_is_told_from_the_input(name):
    spread = np.std(INPUTS[name])
    assert input_noise(record(INPUTS[name])) < 1e-3 * spread
    # measured 0.93 to 1.09 of it, over eight seeds
    assert input_noise(record(INPUTS[name], force=0.005)) == pytest.approx(0.005 * spread, rel=0.15)


def test_what_a_controller_feeds_back_is_no_noise():
    rng = np.random.default_rng(2)
    x = np.cumsum(np.cumsum(SINES)) * 1e-7 + 1e-4 * rng.standard_normal(T.size)
    u = SINES - 3e4 * x - 400 * np.gradient(x, T)
    u[2:] = SINES[2:] - 3e4 * x[2:] - 400 * (x[2:] - x[1:-1]) / 0.004
    assert input_noise(cdf.Measurement(T, u, x)) < 1e-3 * np.std(u)


def test_noise_of_the_force_is_no_missing_effect():
    noisy = record(SINES, force=0.01)
    found = cdf.diagnose(cdf.friction_mass(8, 5, 18), noisy, candidates=["quadratic_drag"])
    assert found.verdict == "none", found


def test_a_force_that_acts_is_still_missed():
    u = record(SINES, force=0.003).u
    hidden = SINES + np.sin(2 * np.pi * 0.35 * T) * (T > 1)
    x = np.asarray(cdf.event_response(AXIS, T, hidden, input_hold="zoh").outputs)[0]
    x = x + 2e-6 * np.random.default_rng(5).standard_normal(T.size)
    found = cdf.diagnose(cdf.friction_mass(8, 5, 18), cdf.Measurement(T, u, x), candidates=["quadratic_drag"])
    assert found.verdict == "unknown", found
