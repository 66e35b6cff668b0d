"""A friction bump far narrower than the drive's speed must not be stepped over."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import ctrl_df as cdf


def reference(mass, coulomb, static, velocity, viscous, force, t_end):
    """DOP853 from reversal to reversal, each bump resolved by its step bound; too large a force to stick."""
    t, y, s = 0.0, np.array([0.0, 0.0]), 1.0
    while t < t_end:

        def flow(t, y, s=s):
            level = coulomb + (static - coulomb) * np.exp(-((y[1] / velocity) ** 2))
            return [y[1], (force(t) - s * level - viscous * y[1]) / mass]

        stop = lambda t, y, s=s: s * y[1] + (1e-300 if s > 0 else 1e-300)  # noqa: E731
        stop.terminal, stop.direction = True, -1
        acceleration = abs(flow(t, y)[1]) + 1e-9
        # out of the bump in small steps, then on
        time = velocity / acceleration
        span = (t, min(t + 8 * time, t_end))
        first = solve_ivp(flow, span, y, "DOP853", rtol=1e-12, atol=1e-15, max_step=time / 4)
        t, y = first.t[-1], first.y[:, -1]
        sol = solve_ivp(flow, (t, t_end), y, "DOP853", events=stop, rtol=1e-12, atol=1e-15, max_step=2e-3)
        t, y = sol.t[-1], sol.y[:, -1].copy()
        if sol.status == 1:
            y[1], s = 0.0, -s
            if abs(force(t)) < static:
                raise RuntimeError("the reference does not stick")
    return y


@pytest.mark.parametrize("seed", range(4))
def test_narrow_stribeck_against_dop853(seed):
    rng = np.random.default_rng(seed)
    velocity, omega = 10.0 ** rng.uniform(-2.3, -1.5), rng.uniform(2, 6)
    mass, coulomb, viscous, amplitude = 9.0, 5.0, 0.5, rng.uniform(40, 80)
    block = (
        cdf.Mass(mass).with_effect(cdf.Coulomb(coulomb)).with_effect(cdf.Viscous(viscous))
        .with_effect(cdf.Stribeck(6.5, velocity))
    )  # fmt: skip
    force = lambda t: amplitude * np.cos(omega * t)  # noqa: E731
    t_end = 2.7 * 2 * np.pi / omega
    expected = reference(mass, coulomb, 6.5, velocity, viscous, force, t_end)
    response = cdf.event_response(block, [0, t_end], force, max_step=1.0)
    size = amplitude / mass / omega**2
    # worst of 20 seeds 6e-9; with the bump stepped over 1e-4 to 1e-3
    assert abs(response.outputs[0, -1] - expected[0]) < 1e-7 * size
    assert abs(response.outputs[1, -1] - expected[1]) < 1e-7 * size * omega


def test_long_steps_agree_with_short_ones():
    rng = np.random.default_rng(1)
    for _ in range(6):
        velocity, omega, amplitude = 10.0 ** rng.uniform(-3.5, -1), rng.uniform(2, 10), rng.uniform(20, 60)
        block = cdf.Mass(9.0).with_effect(cdf.Coulomb(5.0)).with_effect(cdf.Stribeck(6.0, velocity))
        t = np.linspace(0, 6 * np.pi / omega, 7)
        force = lambda t, a=amplitude, w=omega: a * np.cos(w * t)  # noqa: E731
        coarse = cdf.event_response(block, t, force, max_step=10.0).outputs[0]
        fine = cdf.event_response(block, t, force, max_step=1e-3, rtol=1e-11).outputs[0]
        # worst of 40 draws 1.2e-7
        np.testing.assert_allclose(coarse, fine, atol=5e-7 * np.abs(fine).max())


@pytest.mark.parametrize("before", [1e-6, 3e-8, 1e-10])
def test_a_breakaway_just_before_a_sample(before):
    """Forces in balance set a mass free: what it moves by at first are their last digits."""
    level, ramp, t = 0.5, 0.8, np.arange(0, 1.2, 3e-3)
    block = cdf.Mass(1.1, [cdf.Coulomb(0.2), cdf.Stribeck(level, 7e-5)])
    u = ramp * (t - t[200]) + level + ramp * before  # breaks away so long before sample 200
    found = cdf.event_response(block, t, u)
    assert found.status.ok and found.events[0].kind == "breakaway"
    assert found.events[0].time == pytest.approx(t[200] - before, abs=1e-11)
    shifted = cdf.event_response(block, t, u + ramp * (1.5e-3 - before))  # midway between two samples
    late = np.interp(t[-1] + before - 1.5e-3, t, np.asarray(shifted.outputs)[1])
    assert np.asarray(found.outputs)[1, -1] == pytest.approx(late, rel=1e-4)
