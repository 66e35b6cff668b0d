"""The event engine against independent integration, exact motions and bad input."""

import math

import control as ct
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import ctrl_df as cdf
from ctrl_df.simulate.engine import Engine, sampled_drive
from ctrl_df.status import Status


def friction_reference(mass, coulomb, viscous, static, a, omega, t_end):
    """One mass under a cos wt: DOP853 with stick and slip phases switched by hand."""
    t, x, v, stuck = 0.0, 0.0, 0.0, True
    while t < t_end:
        if stuck:
            force = a * math.cos(omega * t)
            if abs(force) <= static * (1 + 1e-12):
                # the next time |F| reaches the static level
                phases = [
                    (s * math.acos(static / a) + k * math.pi) / omega for k in range(1000) for s in (1, -1)
                ]
                later = (
                    p for p in phases if p > t + 1e-12 and abs(a * math.cos(omega * (p + 1e-9))) > static
                )
                t_next = min(later, default=t_end)
                t = min(t_next, t_end)
            stuck = False
            sign = math.copysign(1.0, math.cos(omega * t))
            continue
        stop = lambda t, y, s=sign: s * y[1]  # noqa: E731
        stop.terminal, stop.direction = True, -1
        flow = lambda t, y, s=sign: [y[1], (a * math.cos(omega * t) - s * coulomb - viscous * y[1]) / mass]  # noqa: E731
        sol = solve_ivp(
            flow, (t, t_end), [x, v], "DOP853", events=stop, rtol=1e-12, atol=1e-14, max_step=0.05 / omega
        )
        t, (x, v) = sol.t[-1], sol.y[:, -1]
        if sol.status == 1:
            v = 0.0
            force = a * math.cos(omega * t)
            stuck = abs(force) <= static
            sign = math.copysign(1.0, force)
    return x, v


@pytest.mark.parametrize("seed", range(6))
def test_friction_mass_against_dop853(seed):
    rng = np.random.default_rng(seed)
    mass, viscous, coulomb = rng.uniform(0.5, 20), rng.uniform(0, 3), rng.uniform(0.5, 10)
    static = coulomb * rng.uniform(1, 1.6)
    a, omega = static * rng.uniform(1.1, 4), rng.uniform(2, 30)
    t_end = 5.3 * 2 * np.pi / omega
    x, v = friction_reference(mass, coulomb, viscous, static, a, omega, t_end)
    plant = cdf.friction_mass(mass, coulomb, viscous, static=static)
    response = cdf.event_response(plant, [0, t_end], lambda t: a * np.cos(omega * t), max_step=0.1 / omega)
    size = a / mass / omega**2
    # worst of 200 seeds 3e-8 (the reference's own restarts)
    assert abs(response.outputs[0, -1] - x) < 3e-7 * size
    assert abs(response.outputs[1, -1] - v) < 3e-7 * size * omega


def backlash_reference(x0, gains, m0, m1, gap, e, t_end):
    """Two masses under an ideal PID, impacts by hand, no sustained contact."""
    kp, ki, kd = gains
    force = lambda y: -kp * y[1] + ki * y[0] - kd * y[2]  # noqa: E731
    flow = lambda t, y: [-y[1], y[2], 0.0, y[4], force(y) / m1]  # noqa: E731
    t, y, impacts = 0.0, np.array(x0, float), []
    while t < t_end:
        low = lambda t, y: y[3] - y[1]  # noqa: E731
        high = lambda t, y: gap - (y[3] - y[1])  # noqa: E731
        low.terminal = high.terminal = True
        low.direction = high.direction = -1
        sol = solve_ivp(
            flow, (t, t_end), y, "DOP853", events=[low, high], rtol=1e-12, atol=1e-15, max_step=2e-3
        )
        t, y = sol.t[-1], sol.y[:, -1].copy()
        if sol.status != 1:
            break
        impacts.append(t)
        common, rebound = (m0 * y[2] + m1 * y[4]) / (m0 + m1), -e * (y[4] - y[2])
        y[2], y[4] = common - m1 / (m0 + m1) * rebound, common + m0 / (m0 + m1) * rebound
        y[3] = y[1] + (gap * (1 + 1e-15) if len(sol.t_events[1]) else 0.0)
        # leave the face, so that the event is not met again at once
        sol = solve_ivp(flow, (t, t + 1e-7), y, "DOP853", rtol=1e-12, atol=1e-15)
        t, y = sol.t[-1], sol.y[:, -1]
    return y, impacts


def test_impacts_against_dop853():
    gains, start = (1800, 19500, 100), [0, 0.004, 0, 0.010, 0.3]
    y, impacts = backlash_reference(start, gains, 8.0, 1.0, 0.018, 0.8, 0.25)
    loop = cdf.closed_loop(cdf.pid(*gains), cdf.backlash_masses(1, 8, 0.018, 0.8))
    response = cdf.event_response(loop, [0, 0.25], 0, start, return_states=True)
    times = [e.time for e in response.events if e.kind == "impact"]
    assert len(times) == len(impacts) >= 4
    np.testing.assert_allclose(times, impacts, atol=1e-8)
    np.testing.assert_allclose(response.states[:, -1], y, atol=1e-6 * np.abs(y).max())


def test_chatter_ends_in_contact_with_finite_work():
    """A motor pressed on its load: rebounds shrink geometrically and end; momentum then tells the speed."""
    drive = cdf.backlash_masses(1, 8, 0.018, 0.5)
    response = cdf.event_response(drive, np.linspace(0, 0.5, 51), 20.0, [0, 0, 0.009, 0])
    kinds = [e.kind for e in response.events]
    assert kinds[-1] == "contact"
    assert response.event_count < 60
    # the force acts on both in sum: total momentum is F t
    v, v_motor = response.outputs[1, -1], response.outputs[3, -1]
    assert v == pytest.approx(v_motor, abs=1e-12)
    assert 8 * v + v_motor == pytest.approx(20.0 * 0.5, rel=1e-9)


def test_elastic_impacts_keep_energy_and_momentum():
    drive = cdf.backlash_masses(1, 8, 0.018, 1.0)
    response = cdf.event_response(drive, np.linspace(0, 5, 11), 0, [0, 0, 0.009, 0.5])
    energy = 0.5 * 8 * response.outputs[1] ** 2 + 0.5 * response.outputs[3] ** 2
    assert response.event_count > 50
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)  # worst 1e-12
    np.testing.assert_allclose(8 * response.outputs[1] + response.outputs[3], 0.5, rtol=1e-9)


def test_bouncing_on_a_stop_has_its_closed_form():
    """Thrown on a stop by a constant force: rebound k peaks at e^2k of the height."""
    plant = cdf.Mass(1.0).with_effect(cdf.HardStop(0.0, 0.6, lower=-2.0))
    t = np.linspace(0, 6, 6001)
    response = cdf.event_response(plant, t, 9.81, [-1.0, 0.0])
    x = response.outputs[0]
    first = math.sqrt(2 / 9.81)
    flight = 2 * 0.6 * math.sqrt(2 * 9.81) / 9.81
    peak = x[(t > first) & (t < first + flight)].min()
    assert peak == pytest.approx(-0.36, rel=1e-5)
    total = first + 2 * first * 0.6 / (1 - 0.6)
    last = next(e.time for e in response.events if e.kind == "stop contact")
    assert last == pytest.approx(total, rel=1e-3)
    assert abs(x[-1]) < 1e-12


def test_stuck_mass_waits_for_the_static_level():
    plant = cdf.friction_mass(2.0, 5.0, 0.0, static=7.5)
    response = cdf.event_response(plant, np.linspace(0, 2, 21), lambda t: 5.0 * t, 0)
    breakaway = next(e for e in response.events if e.kind == "breakaway")
    assert breakaway.time == pytest.approx(1.5, abs=1e-9)
    # afterwards m v' = 5 t - 5
    expected = (0.5 * 5 * (2.0**2 - 1.5**2) - 5 * 0.5) / 2
    assert response.outputs[1, -1] == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("hold", ["zoh", "linear"])
def test_sampled_inputs_are_read_as_said(hold):
    t = np.linspace(0, 1, 11)
    u = np.sin(7 * t) + 1
    response = cdf.event_response(cdf.Mass(2.0), t, u, input_hold=hold)
    steps = np.diff(t) * (u[:-1] if hold == "zoh" else (u[:-1] + u[1:]) / 2)
    assert response.outputs[1, -1] == pytest.approx(steps.sum() / 2, rel=1e-9)


def test_linear_loop_agrees_with_forced_response():
    rng = np.random.default_rng(4)
    system = ct.rss(3, 1, 1, strictly_proper=True)
    t = np.linspace(0, 4, 201)
    u = rng.normal(size=t.size)
    expected = ct.forced_response(system, t, u)
    got = cdf.event_response(system, t, u)
    np.testing.assert_allclose(got.outputs, expected.outputs, atol=1e-7 * np.abs(expected.outputs).max())


def test_a_transfer_function_is_run_by_its_states():
    response = cdf.event_response(ct.tf([1], [1, 1]), [0, 1], 1.0)
    assert np.ravel(response.outputs)[-1] == pytest.approx(1 - math.exp(-1), rel=1e-8)


def test_relay_switches_are_located():
    """An integrator driven by a constant crosses the relay's hysteresis at a time known exactly."""
    relay = cdf.relay_with_hysteresis(1.0, 0.25)
    response = cdf.event_response(relay, np.linspace(0, 1, 5), lambda t: t - 0.5)
    switch = [e for e in response.events if e.kind == "switch"]
    assert [e.time for e in switch] == pytest.approx([0.75], abs=1e-9)


def test_play_holds_and_follows():
    t = np.linspace(0, 2 * np.pi, 201)
    response = cdf.event_response(cdf.play(0.5), t, np.sin)
    center, expected = 0.0, []
    fine = np.linspace(0, 2 * np.pi, 200001)
    for u in np.sin(fine):
        center = min(max(center, u - 0.25), u + 0.25)
        expected.append(center)
    np.testing.assert_allclose(np.ravel(response.outputs), np.interp(t, fine, expected), atol=1e-6)


@pytest.mark.parametrize("force, time", [(1.0, 1.0), (1e-6, 10.0), (1e3, 1e-4)])
@pytest.mark.parametrize("start", [(0.0, 6.9), (-1.2, 3.4), (2.5, -0.3)])
def test_a_play_lets_go_at_every_peak(force, time, start):
    """Against exact steps of the linear part with the law of the play between them, in several units."""
    gain, pole, gap = 0.6224, 0.4192, 0.42841
    H = ct.tf([gain / time**2], [1, pole / time, 0])
    loop = cdf.closed_loop(H, cdf.play(gap * force))
    a, b, c = (np.asarray(m) for m in (loop.syslist[0].A, loop.syslist[0].B, loop.syslist[0].C))
    # the same motion whatever the realization: u and its rate are given
    u, rate = start[1] * gain, start[0] * gain
    x0 = np.linalg.solve(np.vstack([c, c @ a]), [u * force, rate * force / time])
    end, count = 60.0 * time, 60_000
    run = cdf.event_response(loop, np.linspace(0, end, 61), 0, np.append(x0, 0.0))
    h = end / count
    big = expm(np.block([[a, -b], [np.zeros((1, 3))]]) * h)
    x, y, play, seen = x0, 0.0, cdf.play(gap * force), []
    for k in range(count + 1):
        if k % 1000 == 0:
            seen.append(float((c @ x)[0]))
        y, _ = play.step(float((c @ x)[0]), y)
        x = big[:2, :2] @ x + big[:2, 2] * y
    assert np.abs(np.asarray(run.outputs)[-1] - seen).max() < 5e-3 * np.abs(seen).max()
    kinds = [event.kind for event in run.events]
    assert all(one != other for one, other in zip(kinds[:-1], kinds[1:], strict=True))


def test_sampled_controller_is_a_difference_equation():
    """P control of a bare mass at 0.1 s: the exact discrete recursion."""
    kp, dt, mass = 3.0, 0.1, 2.0
    loop = cdf.closed_loop(cdf.pid(kp), cdf.Mass(mass), dt=dt)
    t = np.arange(0, 21) * dt
    response = cdf.event_response(loop, t, 1.0)
    x = v = 0.0
    expected = [0.0]
    for _ in t[1:]:
        f = kp * (1.0 - x)
        x, v = x + v * dt + 0.5 * f / mass * dt**2, v + f / mass * dt
        expected.append(x)
    np.testing.assert_allclose(response.outputs[0], expected, atol=1e-9)


def test_user_system_runs_and_its_error_is_reported():
    cubic = ct.nlsys(
        lambda t, x, u, p: [-(x[0] ** 3) + u[0]], lambda t, x, u, p: x, inputs=1, outputs=1, states=1
    )
    response = cdf.event_response(cubic, np.linspace(0, 1, 11), 0, [1.0])
    np.testing.assert_allclose(np.ravel(response.outputs)[-1], 1 / math.sqrt(3), rtol=1e-7)

    def broken(t, x, u, params):
        raise ZeroDivisionError("user's own fault")

    bad = ct.nlsys(broken, lambda t, x, u, p: x, inputs=1, outputs=1, states=1)
    with pytest.raises(RuntimeError, match="user's own fault"):
        cdf.event_response(bad, [0, 1], 0, [1.0])


def test_diverging_loop_ends_early_and_says_so():
    loop = cdf.closed_loop(ct.tf([-500.0], [1.0]), cdf.Mass(1e-3))
    with pytest.warns(RuntimeWarning, match="left every bound"):
        response = cdf.event_response(loop, np.linspace(0, 10, 101), 0, [1.0, 0.0])
    assert response.status is Status.DIVERGED
    assert 0 < len(response.time) < 101
    assert np.all(np.isfinite(response.outputs))


def test_work_is_bounded():
    with pytest.warns(RuntimeWarning, match="bound on work"):
        response = cdf.event_response(
            cdf.Mass(1.0).with_effect(cdf.LinearSpring(1e6)),
            np.linspace(0, 100, 11),
            0,
            [1.0, 0],
            max_steps=1000,
        )
    assert response.status is Status.WORK_LIMIT
    assert len(response.time) < 11


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: cdf.event_response(cdf.Mass(1), [0, 0, 1]), "ascending"),
        (lambda: cdf.event_response(cdf.Mass(1), [0, 1], np.nan * np.ones(2)), "finite"),
        (lambda: cdf.event_response(cdf.Mass(1), [0, 1], np.ones(3)), "shape"),
        (lambda: cdf.event_response(cdf.Mass(1), [0, 1], 0, [1, 2, 3]), "initial_state needs 2"),
        (
            lambda: cdf.event_response(cdf.backlash_masses(1, 8, 0.02), [0, 1], 0, [0, 0, 0.03, 0]),
            "clearance",
        ),
        (
            lambda: cdf.event_response(cdf.Mass(1).with_effect(cdf.HardStop(0.1)), [0, 1], 0, [0.2, 0]),
            "stops",
        ),
        (lambda: cdf.closed_loop(cdf.pid(1, 1, 1), cdf.saturation(1)), "velocity output"),
        (lambda: cdf.closed_loop(ct.tf([1, 0, 0], [1]), cdf.Mass(1)), "one degree"),
        (lambda: cdf.closed_loop(ct.frd([1, 1], [1, 2]), cdf.Mass(1)), "fit a transfer function"),
        (
            lambda: cdf.event_response(cdf.closed_loop(ct.tf([1], [1]), cdf.saturation(1)), [0, 1]),
            "algebraic loop",
        ),
    ],
)
def test_bad_input_is_told(call, says):
    with pytest.raises(ValueError, match=says):
        call()


def test_unknown_keyword_is_refused():
    with pytest.raises(TypeError, match="unrecognized keyword"):
        cdf.event_response(cdf.Mass(1), [0, 1], nonsense=1)


def test_a_run_leaves_nothing_behind_that_the_next_one_sees():
    """Inputs that rise, then some that are held: what the first were over a step is not what these are."""
    block = cdf.Mass(1.0).with_effect(cdf.Coulomb(1.0))
    time, force = np.array([0.0, 0.13, 0.31, 0.6, 1.0]), np.array([0.5, 2.0, 0.9, 1.5, -0.7])
    used, outputs = Engine(block), []
    used.run(used.start(), 1.0, sampled_drive(time, 3 * force, "linear"))
    for engine in (used, Engine(block)):
        run = engine.run(engine.start(), 1.0, sampled_drive(time, force, "zoh"), np.linspace(0, 1, 50))
        outputs.append(run.outputs)
    assert np.array_equal(*outputs)
