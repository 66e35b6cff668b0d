"""Pure delays inside loops against the method of steps, a recursion and characteristic roots."""

import control as ct
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import ctrl_df as cdf
from ctrl_df.simulate.engine import Engine, State
from ctrl_df.status import Status


def method_of_steps(flow, history, delay, t_end):
    """Solve x' = flow(x, x(t - delay)) interval by interval; returns x as a function of time."""
    pieces, x = [], np.array(history, float)
    while len(pieces) * delay < t_end:
        past = pieces[-1] if pieces else (lambda t: np.array(history, float))
        span = len(pieces) * delay, (len(pieces) + 1) * delay
        late = lambda t, y, past=past: flow(y, past(t - delay))  # noqa: E731
        sol = solve_ivp(late, span, x, "DOP853", rtol=1e-12, atol=1e-14, dense_output=True)
        pieces.append(sol.sol)
        x = sol.y[:, -1]
    return lambda t: np.array([pieces[min(int(s / delay), len(pieces) - 1)](s) for s in t])


@pytest.mark.parametrize("seed", range(6))
def test_delayed_loop_against_the_method_of_steps(seed):
    rng = np.random.default_rng(seed)
    mass, viscous, kp = rng.uniform(0.5, 3), rng.uniform(0.5, 3), rng.uniform(1, 20)
    delay, start = rng.uniform(0.02, 0.3), [0.3, -0.2]
    effects = [
        (cdf.InputDelay(delay),),
        (cdf.SensorDelay(delay),),
        (cdf.InputDelay(0.6 * delay), cdf.SensorDelay(0.4 * delay)),
    ]
    plant = cdf.Mass(mass).with_effect(cdf.Viscous(viscous))
    for effect in effects[seed % 3]:
        plant = plant.with_effect(effect)
    loop = cdf.closed_loop(cdf.pid(kp), plant)
    t = np.linspace(0, 3, 61)
    response = cdf.event_response(
        loop, t, 0, np.append(start, np.zeros(loop.nstates - 2)), return_states=True
    )
    expected = method_of_steps(lambda y, p: [y[1], (-kp * p[0] - viscous * y[1]) / mass], start, delay, 3.0)(
        t
    )
    # worst of 40 seeds 1e-9
    np.testing.assert_allclose(
        np.asarray(response.states)[:2], expected.T, atol=1e-8 * np.abs(expected).max()
    )


def delayed_integrator(gain, delay):
    """An integrator fed back through a delay: s + gain exp(-s delay) = 0."""
    block = cdf.Mass(1.0).with_effect(cdf.SensorDelay(delay)).with_effect(cdf.Viscous(0.0))
    late = ct.NonlinearIOSystem(
        lambda t, x, u, params: (u - x) * 2 / delay,
        lambda t, x, u, params: 2 * x - u,
        inputs="u", outputs="y", states=1, name="late",
    )  # fmt: skip
    late.primitive = block.core.output_channel[0][0]
    integrator = ct.ss([[0]], [[1]], [[1]], [[0]], inputs="u", outputs="y", name="integrator")
    feedback = ct.ss([], [], [], [[-gain]], inputs="e", outputs="f", name="feedback")
    return ct.interconnect(
        [integrator, late, feedback],
        connections=[["late.u", "integrator.y"], ["feedback.e", "late.y"], ["integrator.u", "feedback.f"]],
        inplist=["integrator.u"], outlist=["integrator.y"], inputs=["r"], outputs=["y"],
    )  # fmt: skip


@pytest.mark.parametrize("relative", [0.99, 1.0, 1.01])
def test_delayed_integrator_follows_its_leading_root(relative):
    """At gain pi / (2 delay) the loop swings for ever at omega = pi / (2 delay)."""
    delay = 0.1
    gain = relative * np.pi / 2 / delay
    root = 1j * np.pi / 2 / delay
    for _ in range(50):
        root -= (root + gain * np.exp(-root * delay)) / (1 - gain * delay * np.exp(-root * delay))
    assert np.sign(np.round(root.real, 9)) == np.sign(relative - 1)
    t = np.linspace(0, 20, 2001)
    y = np.ravel(cdf.event_response(delayed_integrator(gain, delay), t, 0, [1.0, 0.0]).outputs)
    late = t > 5  # the other roots have died out
    waves = np.column_stack([np.exp(root * t[late]).real, np.exp(root * t[late]).imag])
    share = np.linalg.lstsq(waves, y[late], rcond=None)[0]
    # measured 5e-9
    assert np.abs(waves @ share - y[late]).max() < 3e-8 * np.abs(y[late]).max()


@pytest.mark.parametrize("delay", [0.048, 0.0981, 0.1, 0.2845])
def test_sampled_controller_with_a_delay_is_a_recursion(delay):
    mass, kp, dt = 2.0, 3.0, 0.1
    loop = cdf.closed_loop(cdf.pid(kp), cdf.Mass(mass).with_effect(cdf.InputDelay(delay)), dt=dt)
    t = np.linspace(0, 3, 31)
    start = np.zeros(loop.nstates)
    at = loop.state_labels.index("plant_x")
    start[at] = 0.3
    response = cdf.event_response(loop, t, 0, start)
    x, v, commands, expected = 0.3, 0.0, [], {0: 0.3}
    breaks = sorted(
        {round(k * dt, 9) for k in range(31)}
        | {round(k * dt + delay, 9) for k in range(31) if k * dt + delay < 3}
    )
    for a, b in zip(breaks, breaks[1:], strict=False):
        if abs(a / dt - round(a / dt)) < 1e-6:
            commands.append(-kp * x)
        force = commands[max(int(np.floor((a - delay) / dt + 1e-6)), 0)]
        x, v = x + v * (b - a) + 0.5 * force / mass * (b - a) ** 2, v + force / mass * (b - a)
        if abs(b / dt - round(b / dt)) < 1e-6:
            expected[round(b / dt)] = x
    np.testing.assert_allclose(response.outputs[0], [expected[k] for k in range(31)], atol=1e-12)


def test_jumps_arrive_on_time():
    """Impacts and sticking under a delayed PID: long steps agree with short, tight ones."""
    drive = cdf.backlash_masses(1, 8, 0.018, 0.6).with_effect(cdf.SensorDelay(0.004))
    stuck = cdf.friction_mass(9, 5, 0.5, static=5.5).with_effect(cdf.InputDelay(0.003))
    for gains, plant, start, t_end in (
        ((1800, 19500, 100), drive, [0, 0.004, 0, 0.010, 0.3, 0], 0.25),
        ((2000, 44250, 130), stuck, [0, 0.004, 0, 0], 3.0),
    ):
        loop, t = cdf.closed_loop(cdf.pid(*gains), plant), np.linspace(0, t_end, 26)
        free = cdf.event_response(loop, t, 0, start, return_states=True)
        fine = cdf.event_response(loop, t, 0, start, return_states=True, max_step=2e-4, rtol=1e-11)
        assert free.event_count == fine.event_count >= 3
        sizes = np.abs(fine.states).max(axis=1, keepdims=True) + 1e-300
        assert (
            np.max(np.abs(np.asarray(free.states) - np.asarray(fine.states)) / sizes) < 1e-7
        )  # measured 1e-9


@pytest.mark.parametrize("hold", ["zoh", "linear"])
def test_a_record_is_shifted(hold):
    plain = cdf.friction_mass(9, 5, 0.5)
    late = plain.with_effect(cdf.InputDelay(0.02)).with_effect(cdf.SensorDelay(0.05))
    t = np.linspace(0, 5, 501)
    u = 20 * np.sin(3 * t)
    there = cdf.event_response(late, t, u, input_hold=hold).outputs[0]
    here = cdf.event_response(plain, t, u, input_hold=hold).outputs[0]
    np.testing.assert_allclose(there[7:], here[:-7], atol=1e-11)  # measured 9e-15


def test_a_state_carries_its_history():
    loop = cdf.closed_loop(
        cdf.pid(5.0), cdf.Mass(2.0).with_effect(cdf.Viscous(1.0)).with_effect(cdf.InputDelay(0.1))
    )
    engine = Engine(loop)
    start = engine.start([0.3, 0.0, 0.0])
    through = engine.run(start, 2.0).state.x
    half = engine.run(start, 1.0).state
    engine.run(engine.start([1.0, 2.0, 0.0]), 1.3)  # another motion in between
    np.testing.assert_allclose(engine.run(half, 2.0).state.x, through, atol=1e-10)
    with pytest.raises(ValueError, match="its history as well"):
        engine.run(State(1.0, half.x, half.mode, fresh=False), 2.0)


def test_exact_orbits_of_delayed_loops_are_refused():
    loop = cdf.closed_loop(
        cdf.pid(2000, 44250, 130), cdf.friction_mass(9, 5, 0.5).with_effect(cdf.InputDelay(0.003))
    )
    with pytest.raises(ValueError, match="by simulation"):
        cdf.find_limit_cycle(loop)


def test_a_full_history_is_told():
    plant = cdf.friction_mass(9, 5, 0.5).with_effect(cdf.InputDelay(5.0))
    with pytest.warns(RuntimeWarning, match="history has room"):
        response = cdf.event_response(plant, np.linspace(0, 20, 41), lambda t: np.sin(3 * t), max_step=1e-3)
    assert response.status is Status.HISTORY_FULL
    assert 4.0 <= response.time[-1] < 5.0
