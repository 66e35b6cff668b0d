"""Exact orbits of plays, rate limiters and fast relays, against multipliers and periods from elsewhere."""

import control as ct
import numpy as np
import pytest

import ctrl_df as cdf


# eigenvalues of a Poincaré map of exact pieces (expm), switches by bisection
@pytest.mark.parametrize(("gain", "multiplier"), [(1.6, 0.7975), (1.8, 0.8879)])
def test_a_play_in_a_loop_is_stable(gain, multiplier):
    orbit = cdf.find_limit_cycle(cdf.closed_loop(ct.tf([gain], [1, 2, 1, 0]), cdf.play(1.0)))
    assert orbit.stable and orbit.floquet[0] == pytest.approx(multiplier, abs=2e-4)


@pytest.mark.parametrize("gain", [12, 40])
def test_a_limiter_that_cannot_follow_as_it_catches_up_is_one_event(gain):
    """It catches an input that moves seven times as fast as it may: both events fall on one instant."""
    loop = cdf.closed_loop(ct.tf([gain], [1, 3, 3, 1]), cdf.rate_limiter(1.0))
    orbit = cdf.find_limit_cycle(loop)
    assert orbit.stable and abs(orbit.floquet[0]) < 0.2  # 28 and 365, unstable, before
    begun, period = np.array(orbit.states)[:, 0], 2 * np.pi / orbit.omega
    t = np.linspace(0, 6 * period, 4001)
    run = cdf.event_response(loop, t, 0, 1.02 * begun)
    late = np.asarray(run.outputs)[0][t > 5 * period]
    assert np.ptp(late) / 2 == pytest.approx(np.ptp(orbit.outputs[0]) / 2, rel=5e-3)  # peaks between samples


def test_fast_relays_do_not_come_to_rest():
    thermostat = cdf.closed_loop(ct.tf([2.0], [0.1, 1]), cdf.relay_with_hysteresis(1, 0.1))
    half = 0.1 * np.log(2.1 / 1.9)  # of a period: from -0.1 to 0.1
    assert cdf.find_limit_cycle(thermostat).omega == pytest.approx(np.pi / half, rel=1e-6)
    slow = np.polymul([1, 1e-4], np.polymul([0.1, 1], [0.05, 1]))  # a pole ten thousand times as slow
    cycle = cdf.find_limit_cycle(cdf.closed_loop(ct.tf([1], slow), cdf.relay(1)))
    assert cycle.omega == pytest.approx(13.806, rel=1e-4)


def test_states_of_a_play_are_its_outputs_within_steps_too():
    loop = cdf.closed_loop(ct.tf([1.2], [1, 2, 1, 0]), cdf.play(1.0))
    run = cdf.event_response(loop, np.linspace(0, 20, 21), 0, [1, 0.3, -0.2, 0.4], return_states=True)
    place = np.asarray(run.states)[list(run.state_labels or ()).index("plant_y")]
    assert place == pytest.approx(np.asarray(run.outputs)[0], abs=1e-12)
