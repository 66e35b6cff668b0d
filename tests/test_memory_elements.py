"""Elements with memory: behind other elements, at jumps within a step, begun where their state says."""

import itertools

import control as ct
import numpy as np
import pytest

import ctrl_df as cdf

T = np.arange(60.0)


def play(u, half):
    place, found = 0.0, []
    for value in u:
        place = min(max(place, value - half), value + half)
        found.append(place)
    return np.array(found)


def relay(u, width, level):
    side, found = 1.0, []
    for value in u:
        side = 1.0 if value > width else (-1.0 if value < -width else side)
        found.append(level * side)
    return np.array(found)


FIRST = {
    "saturation": (lambda: cdf.saturation(1.0), lambda u: np.clip(u, -1, 1)),
    "dead zone": (lambda: cdf.dead_zone(1.0), lambda u: u - np.clip(u, -0.5, 0.5)),
    "play": (lambda: cdf.play(0.5), lambda u: play(u, 0.25)),
    "relay": (lambda: cdf.relay_with_hysteresis(2.0, 0.4), lambda u: relay(u, 0.4, 2.0)),
}
SECOND = {
    "play": (lambda: cdf.play(0.7), lambda u: play(u, 0.35)),
    "relay": (lambda: cdf.relay_with_hysteresis(1.0, 0.3), lambda u: relay(u, 0.3, 1.0)),
}


@pytest.mark.parametrize(("first", "second"), list(itertools.product(FIRST, SECOND)))
def test_memory_behind_another_element(first, second):
    """Signals settle in the order of the chain: memory must not see what a law before it was to give."""
    u = 2 * np.random.default_rng(3).standard_normal(T.size)
    (one, law), (other, memory) = FIRST[first], SECOND[second]
    chain = ct.series(one().copy(name="first"), other().copy(name="second"))
    for hold in ("zoh", "linear"):  # what these laws come to at a sample is the same of both
        run = cdf.event_response(chain, T, u, input_hold=hold)
        assert run.status.ok
        assert np.asarray(run.outputs).ravel() == pytest.approx(memory(law(u)), abs=1e-10)  # worst 6e-12


@pytest.mark.parametrize("step", [1e-2, 1e-5])
def test_a_quantizer_counts_every_step_once(step):
    count = 30_000
    run = cdf.event_response(cdf.quantizer(step), [0.0, 1.0], [0.0, count * step])
    assert run.status.ok and run.event_count == count  # 2,002 at one threshold, and an end, before
    sensor = cdf.Mass(2.0).with_effect(cdf.SensorQuantization(step))
    run = cdf.event_response(sensor, [0, 1.0], 0, {"x": 12_490 * step, "v": 100 * step})
    assert run.status.ok and run.event_count == 100


@pytest.mark.parametrize(
    "effect", [cdf.InputDelay(1e-3), cdf.QuadraticDrag(3.0), cdf.SensorQuantization(1e-3)]
)
def test_ticks_and_samples_that_rounding_parts_are_one(effect):
    # 3 * 0.05 is an ulp more than 15 * 0.01
    loop = cdf.closed_loop(cdf.pid(40, 0, 18), cdf.Mass(2.0, [cdf.Coulomb(0.1), effect]), 0.01)
    t, r = np.arange(41) * 0.05, 0.1 * np.random.default_rng(0).standard_normal(41)
    for hold in ("zoh", "linear"):
        runs = [cdf.event_response(loop, times, r, input_hold=hold).outputs for times in (t, np.round(t, 12))]
        assert np.asarray(runs[0]) == pytest.approx(np.asarray(runs[1]), abs=1e-9)


def test_a_relay_begins_on_the_branch_of_its_state():
    element = cdf.relay_with_hysteresis(1.0, 1.0)
    for begun, branch in ((-1.0, -1.0), (-0.2, -1.0), (0.0, 1.0), (1.0, 1.0)):
        run = cdf.event_response(element, [0, 1.0, 2.0], 0.0, begun)
        assert np.all(np.asarray(run.outputs) == branch)
    run = cdf.event_response(element, np.arange(4.0), [0, -2, 0, 2], input_hold="zoh", return_states=True)
    assert np.asarray(run.states)[0].tolist() == [1, -1, -1, 1]
    many = cdf.batch_response(element, [0, 1.0, 2.0], 0.0, [[-1.0], [0.0]])
    assert np.asarray(many.outputs)[:, 0, -1].tolist() == [-1, 1]


def test_jumps_of_an_input_that_is_a_function_are_found():
    t = np.linspace(0, 2, 5)
    back = cdf.event_response(cdf.play(1.0), t, lambda s: 3.0 if s < 1.2 else 1.0)
    assert np.asarray(back.outputs).ravel() == pytest.approx([2.5, 2.5, 2.5, 1.5, 1.5])
    up = cdf.event_response(cdf.rate_limiter(1.0), t, lambda s: 0.0 if s < 1.2 else 3.0)
    assert np.asarray(up.outputs).ravel() == pytest.approx([0, 0, 0, 0.3, 0.8])


def test_friction_keeps_its_direction_through_pauses_of_an_imposed_motion():
    t = 0.1 * np.arange(80)
    x = np.interp(t, [0, 1, 3, 4, 6, 7, 8], [0, 1, 1, 0, 0, 0.5, 0.5])
    force = np.asarray(cdf.imposed_response(cdf.Massless([cdf.Coulomb(5.0)]), t, x).outputs)[0]
    # a spline through all of it rang in the pauses: the sign changed at every sample
    assert np.all(force == np.where((t < 3.05) | (t > 6.05), 5.0, -5.0))
