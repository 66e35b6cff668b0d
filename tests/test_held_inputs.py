"""Inputs held between samples: elements answer to the new value, controllers read it at their tick."""

import control as ct
import numpy as np
import pytest

import ctrl_df as cdf

T = 0.02 * np.arange(250)


def inputs():
    rng = np.random.default_rng(7)
    wave = 3 * np.sin(2 * T)
    walk = 0.3 * rng.standard_normal(T.size).cumsum()
    return {
        "wave": wave,
        "steps": np.round(wave, 1) + 0.03,
        "walk": walk,
        "noise": 2 * rng.normal(size=T.size),
    }


def play(u, half, place=0.0):
    found = []
    for value in u:
        place = min(max(place, value - half), value + half)
        found.append(place)
    return np.array(found)


def relay(u, width, side=1.0):
    found = []
    for value in u:
        side = 1.0 if value > width else (-1.0 if value < -width else side)
        found.append(side)
    return np.array(found)


ELEMENTS = {
    "play": (cdf.play(0.5), lambda u: play(u, 0.25)),
    "hysteresis": (cdf.relay_with_hysteresis(1, 0.5), lambda u: relay(u, 0.5)),
    "saturation": (cdf.saturation(1.0), lambda u: np.clip(u, -1, 1)),
    "quantizer": (cdf.quantizer(0.3), lambda u: 0.3 * np.round(u / 0.3)),
}


@pytest.mark.parametrize("signal", inputs())
@pytest.mark.parametrize("name", ELEMENTS)
def test_elements_follow_jumps(name, signal):
    element, recursion = ELEMENTS[name]
    u = inputs()[signal]
    run = cdf.event_response(element, T, u, input_hold="zoh")
    assert run.status.ok
    assert np.asarray(run.outputs).ravel() == pytest.approx(recursion(u), abs=1e-12)


def test_a_play_behind_a_relay_lets_go_at_its_jumps():
    # the input of the play jumps at events, not at samples
    chain = ct.series(cdf.relay(1.0), cdf.play(0.5))
    y = np.asarray(cdf.event_response(chain, T, np.sin(3 * T + 0.1)).outputs).ravel()
    assert y == pytest.approx(play(np.sign(np.sin(3 * T + 0.1)), 0.25), abs=1e-12)


def test_a_sampled_controller_reads_the_reference_at_its_tick():
    dt, m, c, kp, kd = T[1], 2.0, 3.0, 30.0, 6.0
    controller = ct.tf([kp + kd / dt, -kd / dt], [1, 0], dt)
    loop = cdf.closed_loop(controller, cdf.Mass(m, [cdf.Viscous(c)]), dt)
    r = 0.1 * np.random.default_rng(0).standard_normal(T.size)
    y, force = np.asarray(cdf.event_response(loop, T, r, input_hold="zoh").outputs)
    x = v = last = 0.0
    fades, places, forces = np.exp(-c / m * dt), [], []
    for value in r:
        error = value - x
        u, last = kp * error + kd / dt * (error - last), error
        places.append(x)
        forces.append(u)
        x, v = x + u / c * dt + (v - u / c) * (1 - fades) * m / c, u / c + (v - u / c) * fades
    # 0.12 of the motion where it read the reference of the sample before
    assert y == pytest.approx(places, abs=1e-12) and force == pytest.approx(forces, abs=1e-10)


def test_a_sampled_controller_reads_what_a_law_before_it_gives_at_once():
    gain = cdf.sampled(ct.tf([2.0], [1.0], T[1])).copy(name="gain")
    law = cdf.saturation(1.0).copy(name="law")
    chain = ct.series(law, gain)
    y = np.asarray(cdf.event_response(chain, T, np.full(T.size, 5.0), input_hold="zoh").outputs).ravel()
    assert y == pytest.approx(np.full(T.size, 2.0))


def test_outputs_that_answer_at_once_are_those_after_a_jump():
    # force of a continuous controller, which has a direct path from the reference
    loop = cdf.closed_loop(cdf.pid(30, 0, 6), cdf.Mass(2.0, [cdf.Viscous(3.0)]))
    r = np.where(T < 1.0, 0.0, 0.1)
    y, force = np.asarray(cdf.event_response(loop, T, r, input_hold="zoh").outputs)
    first = int(np.argmax(r > 0))
    assert np.all(y[: first + 1] == 0) and np.all(force[:first] == 0)
    assert force[first] == pytest.approx(30 * 0.1)


@pytest.mark.parametrize("name", ["play", "saturation"])
def test_an_element_is_compared_and_fitted_like_a_block(name):
    u, (element, recursion) = inputs()["noise"], ELEMENTS[name]
    y = recursion(u) + 1e-3 * np.random.default_rng(2).standard_normal(u.size)
    record = cdf.Measurement(T, u, y)
    assert cdf.compare(element, record).rmse < 1.1e-3
    start = cdf.play(0.4) if name == "play" else cdf.saturation(0.8)
    for found in cdf.refit(start, record).parameters.values():
        true = dict(gap=0.5, ub=1.0, lb=-1.0)[found.name]
        assert found.value == pytest.approx(true, abs=5e-4)
