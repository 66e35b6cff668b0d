"""Loops that need more than the plain orbit: pure delays, free positions, sampled laws."""

import control as ct
import numpy as np
import pytest
from scipy.optimize import brentq

import ctrl_df as cdf

RNG = np.random.default_rng(7)


def delayed_relay(mass, drag, level, delay):
    """Exact symmetric cycle of -level sign(x) driving a mass with drag after a delay: omega and peak of x.

    Under a square wave of half period T the velocity is known in closed form; x must vanish one delay before
    the force switches.
    """
    rate = drag / mass

    def travel(t, half):  # from the instant of a switch to +level
        fade = 2 * (1 - np.exp(-rate * t)) / rate / (1 + np.exp(-rate * half))
        return level / drag * (t - fade)

    def missed(half):
        return travel(half - delay, half) - travel(half, half) / 2

    half = brentq(missed, 1.0001 * delay, 200 * delay, xtol=1e-14)
    turn = np.log(2 / (1 + np.exp(-rate * half))) / rate  # v = 0
    return np.pi / half, abs(travel(turn, half) - travel(half, half) / 2)


DRAWS = [(0.8, 2.9, 4.0, 0.31), *RNG.uniform([0.5, 0.5, 0.5, 0.1], [3, 3, 8, 0.4], (3, 4))]


@pytest.mark.parametrize("draw", DRAWS)
def test_relay_with_a_delay(draw):
    mass, drag, level, delay = draw
    omega, peak = delayed_relay(mass, drag, level, delay)
    w = np.geomspace(omega / 10, 10 * omega, 400)
    measured = ct.frd(np.exp(-1j * w * delay) / (1j * w * (1j * w * mass + drag)), w)
    response = cdf.describing_function_response(measured, cdf.relay(level), np.geomspace(1e-3, 30, 60))
    plant = cdf.Mass(mass).with_effect(cdf.Viscous(drag)).with_effect(cdf.InputDelay(delay))
    relay, plant = cdf.relay(level).copy(name="relay"), plant.copy(name="plant")
    loop = ct.interconnect(
        [relay, plant], connections=[["relay.u", "-plant.x"], ["plant.F", "relay.y"]], inplist=["relay.u"],
        inputs=["r"], outlist=["plant.x", "relay.u"], outputs=["x", "e"], check_unused=False,
    )  # fmt: skip
    check = cdf.verify(response, loop=loop)
    row = next(row for row in check if row.simulated)
    assert row.exact is None and check.orbits == []
    assert row.verdict in ("confirmed", "shifted")
    assert row.simulated[0] == pytest.approx(omega, rel=1e-7)  # measured 2e-9
    assert row.motion.peak == pytest.approx(peak, rel=1e-4)  # of samples of the period
    assert row.omega_error == pytest.approx(row.predicted.omega / omega - 1, abs=1e-7)
    assert "settles on it" in row.why and "pure delay" in check.table()


def saturated_balance(H, level, omega, amplitude, orders=200):
    """Exact symmetric cycle of a saturation around H, by collocation with `orders` odd harmonics."""
    from scipy.optimize import least_squares

    k = np.arange(1, 2 * orders, 2)
    t = 2 * np.pi * np.arange(100 * orders) / (100 * orders)
    waves = np.exp(1j * np.outer(t, k))

    def mismatch(z):
        c = z[1 : orders + 1] + 1j * np.append(0.0, z[orders + 1 :])
        y = np.clip((waves @ c).real, -level, level)
        Y = 2 * np.fft.rfft(y)[k] / len(t)
        error = c + H(1j * k * z[0]) * Y
        return np.concatenate([error.real, error.imag])

    start = np.zeros(2 * orders)
    start[0], start[1] = omega, amplitude
    z = least_squares(mismatch, start, xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    return z[1], z[0]


@pytest.mark.parametrize("where", [cdf.InputDelay, cdf.SensorDelay])
def test_saturated_mass_with_a_delay(where):
    mass, drag, level, delay = 1.5, 0.8, 4.0, 0.06
    pid = cdf.pid(60, 0, 3, tf=0.02)
    plant = cdf.Mass(mass).with_effect(cdf.Viscous(drag)).with_effect(cdf.InputSaturation(level))
    block = plant.with_effect(where(delay))
    response = cdf.describing_function_response(
        pid, block, np.geomspace(4.1, 100, 15), np.geomspace(1, 30, 40)
    )
    check = cdf.verify(response)
    row = check.rows[0]

    def H(s):
        return pid(s) * np.exp(-s * delay) / (s * (mass * s + drag))

    amplitude, omega = saturated_balance(H, level, row.predicted.omega, row.predicted.amplitude, 40)
    assert row.verdict == "confirmed" and row.in_band
    assert row.simulated[0] == pytest.approx(omega, rel=2e-6)  # the collocation is good to 5e-7
    assert row.motion.amplitude == pytest.approx(amplitude, rel=5e-6)
    with pytest.raises(ValueError, match="rows of verify"):
        cdf.find_limit_cycle(check.loop, guess=row.predicted)


def test_another_cycle_is_no_partner_of_an_unstable_prediction():
    """A simulation from an unstable cycle settles on one of a fifth of its frequency, 100 times its size."""
    mass, omega, coulomb = 7.7, 10.5, 0.145
    axis = cdf.Mass(mass).with_effect(cdf.Coulomb(coulomb)).with_effect(cdf.InputDelay(0.1125))
    axis = axis.with_effect(cdf.InputSaturation(1.93))
    forces, frequencies = np.geomspace(1.05 * coulomb, 100 * coulomb, 25), np.geomspace(1, 50, 40)
    controller = cdf.pid(mass * omega**2, 0, mass * omega)
    check = cdf.verify(cdf.describing_function_response(controller, axis, forces, frequencies))
    (predicted,) = [row for row in check if row.verdict == "not tested"]
    (found,) = [row for row in check if row.verdict == "missed by the describing function"]
    assert predicted.predicted.stable is False and predicted.simulated is None
    assert found.predicted is None and found.simulated[0] < predicted.predicted.omega / 3


def test_what_a_simulation_cannot_settle_is_said():
    """A saturated drive with an integrator winds up beyond an unstable cycle, and comes to rest within it."""
    block = cdf.Mass(1.5).with_effect(cdf.InputSaturation(4.0)).with_effect(cdf.InputDelay(0.005))
    response = cdf.describing_function_response(
        cdf.pid(60, 60, 20), block, np.geomspace(4.1, 1000, 15), np.geomspace(0.3, 30, 40)
    )
    check = cdf.verify(response)
    assert [(row.verdict, row.predicted.stable) for row in check] == [("not tested", False)]
    assert "unstable" in check.rows[0].why


# --- free position ------------------------------------------------------------


@pytest.mark.parametrize("push", [0.0, 0.8])
def test_a_free_position_is_no_instability(push):
    """A saturated mass under velocity control is a law around 1/(m s + b): the same orbit, without position.

    Under a constant push it travels a little every period: the orbit closes up to that drift.
    """
    mass, drag, level = 2.0, 0.1, 5.0
    controller = 400 * ct.tf([1], [0.05, 1]) ** 2
    corners = np.array([-2, -1, 1, 2]) * level
    law = cdf.piecewise_linear(corners, np.clip(corners, -level, level) + push)
    reference = cdf.find_limit_cycle(cdf.closed_loop(controller * ct.tf([1], [mass, drag]), law))
    plant = cdf.Mass(mass).with_effect(cdf.Viscous(drag)).with_effect(cdf.InputSaturation(level))
    plant = plant.with_effect(cdf.ConstantForce(push)) if push else plant
    loop = cdf.closed_loop(controller, plant, output="v")
    orbit = cdf.find_limit_cycle(loop)
    assert reference.stable is True and orbit.stable is True
    assert orbit.omega == pytest.approx(reference.omega, rel=1e-9)
    assert orbit.amplitude == pytest.approx(reference.amplitude, rel=1e-8)
    assert len(orbit.floquet) == 2  # of four states: not the shift in time, not the position
    assert np.allclose(np.abs(orbit.floquet), np.abs(reference.floquet), atol=1e-7)
    position = orbit.states[list(loop.state_labels).index("plant_x")]
    drift = abs(position[-1] - position[0])
    assert (drift > 1e-3) if push else (drift < 1e-9)


def test_a_position_that_is_felt_counts():
    """A spring too weak to matter still answers: its multiplier is kept, and is below 1."""
    controller = 400 * ct.tf([1], [0.05, 1]) ** 2
    plant = cdf.Mass(2).with_effect(cdf.Viscous(0.1)).with_effect(cdf.InputSaturation(5))
    free = cdf.find_limit_cycle(cdf.closed_loop(controller, plant, output="v"))
    sprung = cdf.closed_loop(controller, plant.with_effect(cdf.LinearSpring(0.05)), output="v")
    orbit = cdf.find_limit_cycle(sprung, guess=free)
    assert len(orbit.floquet) == 3 and orbit.stable is True
    assert 0.9 < orbit.multiplier < 1


# --- sampled ------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_a_discrete_controller_around_a_law_is_the_recursion(seed):
    rng = np.random.default_rng(seed)
    n, dt = 3, 0.1
    a = rng.normal(size=(n, n))
    a *= 1.1 / np.max(np.abs(np.linalg.eigvals(a)))
    b, c = rng.normal(size=(n, 1)), rng.normal(size=(1, n))
    loop = cdf.closed_loop(ct.ss(a, b, c, 0, dt), cdf.saturation(0.7))
    x, r = rng.normal(size=n), rng.normal(size=60)
    start = np.zeros(loop.nstates)
    start[:n] = x
    t = dt * np.arange(60)
    # looked at between the ticks; the reference is held over the sample that ends with a tick
    seen = cdf.event_response(loop, np.append(0, t + 0.5 * dt), np.append(0, r), start, input_hold="zoh")
    expected = []
    held = 0.0
    for k in range(60):
        u = c[0] @ x
        expected.append((np.clip(u, -0.7, 0.7), u))
        x = a @ x + b[:, 0] * ((held if k else 0.0) - np.clip(u, -0.7, 0.7))
        held = r[k]
    np.testing.assert_allclose(seen.outputs[:, 1:].T, expected, atol=1e-11)


def test_direct_path_around_a_law_is_an_algebraic_loop():
    with pytest.raises(ValueError, match="one sample of delay"):
        cdf.closed_loop(ct.tf([1, 0.5], [1, -0.5], 0.1), cdf.saturation(1))


@pytest.mark.parametrize("dt", [0.2, 0.8])
def test_amplitude_of_a_sampled_orbit_is_that_of_the_sequence(dt):
    """The law sees values, not steps: the recursion's own sequence, its fundamental by a sum over samples."""
    sampled = ct.sample_system(ct.tf([8], [1, 2, 2, 1]), dt, "zoh")
    response = cdf.describing_function_response(sampled, cdf.saturation(1), np.geomspace(1.05, 20, 30))
    check = cdf.verify(response)
    orbit = check.orbits[0]
    ss, x, u = ct.ss(sampled), np.ones(3), []
    for _ in range(6000):
        u.append((ss.C @ x).item())
        x = ss.A @ x - ss.B[:, 0] * np.clip(u[-1], -1, 1)
    u = np.array(u[2000:])
    window = np.hanning(len(u))
    amplitude = (
        2 * abs(np.sum(window * u * np.exp(-1j * orbit.omega * dt * np.arange(len(u))))) / window.sum()
    )
    assert orbit.amplitude == pytest.approx(amplitude, rel=3e-4)  # 7e-5: forty swings end between samples
    assert [row.verdict for row in check] == ["confirmed"]
