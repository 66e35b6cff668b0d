"""Exact limit cycles: the table of the paper's loops, Floquet multipliers, the search, and verify."""

import control as ct
import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.status import Status

FRICTION, BACKLASH = cdf.pid(2000, 44250, 130), cdf.pid(1800, 19500, 100)


def test_the_sliding_orbit_of_the_friction_loop():
    loop = cdf.closed_loop(FRICTION, cdf.friction_mass(9, 5, 0.5))
    orbit = cdf.find_limit_cycle(loop, guess=(11.082, 13.898))
    assert orbit.omega == pytest.approx(13.792124, rel=5e-8)
    assert orbit.amplitude == pytest.approx(10.850004, rel=5e-8)
    assert orbit.output_amplitude == pytest.approx(4.428281e-3, rel=2e-7)
    assert orbit.multiplier == pytest.approx(1.14361, rel=1e-5)
    assert orbit.stable is False and orbit.residual < 1e-9


@pytest.mark.parametrize(("static", "omega"), [(5.25, 8.600097), (5.5, 11.628680), (5.75, 13.175267)])
def test_hunting_is_found_by_search_alone(static, omega):
    loop = cdf.closed_loop(FRICTION, cdf.friction_mass(9, 5, 0.5, static=static))
    orbit = cdf.find_limit_cycle(loop)
    assert orbit.omega == pytest.approx(omega, rel=1e-7)
    assert orbit.stable is True
    assert min(abs(orbit.floquet)) < 1e-6  # sticking forgets the velocity
    assert {e.kind for e in orbit.events} == {"stick", "breakaway"}


def test_no_hunting_above_the_limit():
    answer = cdf.find_limit_cycle(cdf.closed_loop(FRICTION, cdf.friction_mass(9, 5, 0.5, static=6.0)))
    assert not answer and answer.status is Status.NOT_FOUND
    assert len(answer.tried) == 6 and {t.outcome for t in answer.tried} == {"diverges"}


def test_the_impact_orbit_with_chatter():
    loop = cdf.closed_loop(BACKLASH, cdf.backlash_masses(1, 8, 0.018, 0.2))
    orbit = cdf.find_limit_cycle(loop, guess=(17.75, 14.84))
    assert orbit.omega == pytest.approx(14.733968, rel=5e-8)
    assert orbit.amplitude == pytest.approx(20.459998, rel=5e-8)
    assert orbit.output_amplitude == pytest.approx(11.327442e-3, rel=1e-7)
    assert orbit.multiplier == pytest.approx(0.882148, rel=1e-6)


def test_the_rattle():
    loop = cdf.closed_loop(BACKLASH, cdf.backlash_masses(1, 8, 0.018, 0.8))
    orbit = cdf.find_limit_cycle(loop, guess=(10.278, 125.754))
    assert orbit.omega == pytest.approx(156.045031, rel=1e-8)
    assert orbit.amplitude == pytest.approx(12.717699, rel=5e-8)
    assert orbit.stable is True and len(orbit.events) == 2


def test_floquet_multiplier_is_the_rate_of_simulation():
    """A state beside the chattering orbit returns at the rate of the largest multiplier."""
    loop = cdf.closed_loop(BACKLASH, cdf.backlash_masses(1, 8, 0.018, 0.2))
    orbit = cdf.find_limit_cycle(loop, guess=(17.75, 14.84))
    start = orbit.states[:, 0].copy()
    start[0] += 1e-5
    times = np.arange(0, 25) * orbit.period
    states = cdf.event_response(loop, times, 0, start, return_states=True).states
    ahead = np.linalg.norm(np.diff(states, axis=1), axis=0)
    rate = (ahead[20] / ahead[8]) ** (1 / 12)
    assert rate == pytest.approx(orbit.multiplier, rel=2e-3)  # 0.8821


@pytest.mark.quick
def test_relay_cycle_of_tsypkin():
    """G = 1/((s + 1)(0.2 s + 1)), relay 1 with hysteresis 0.1: y(T/2) = 0.1 on the exact response."""
    from scipy.optimize import brentq

    def switching(half):
        # u = +1 over half a period, odd-symmetric steady state of modes 1.25 (e^-t) and 0.25 (e^-5t)
        return (1 - 1.25 * 2 / (1 + np.exp(half)) + 0.25 * 2 / (1 + np.exp(5 * half))) - 0.1

    omega = np.pi / brentq(switching, 0.05, 5)
    plant = ct.tf([1], [1, 1]) * ct.tf([1], [0.2, 1])
    response = cdf.describing_function_response(
        plant, cdf.relay_with_hysteresis(1, 0.1), np.geomspace(0.11, 5, 40)
    )
    check = cdf.verify(response)
    assert len(check) == 1
    assert check.rows[0].exact.omega == pytest.approx(omega, rel=1e-7)
    assert check.rows[0].exact.stable is True
    assert check.rows[0].in_band


def test_verify_confirms_and_denies():
    amplitudes, omega = np.geomspace(5.05, 50, 40), np.geomspace(5, 40, 40)
    response = cdf.describing_function_response(FRICTION, cdf.friction_mass(9, 5, 0.5), amplitudes, omega)
    check = cdf.verify(response)
    verdicts = {round(r.predicted.omega, 1): r.verdict for r in check}
    assert verdicts == {13.1: "no such orbit", 13.9: "confirmed"}
    text = check.table()
    assert "predicted" in text and "13.79212" in text and "leaves" in text


def test_verify_says_when_it_cannot_simulate():
    omega = np.geomspace(1, 50, 300)
    measured = ct.frd(np.asarray(FRICTION(1j * omega)), omega)
    response = cdf.describing_function_response(
        measured, cdf.friction_mass(9, 5, 0.5), np.geomspace(5.05, 50, 30), np.geomspace(5, 40, 30)
    )
    check = cdf.verify(response)
    assert len(check) == 2 and all(r.verdict == "not tested" for r in check)
    assert "FRD" in check.note


def test_sampled_loop_is_answered_by_averages():
    """At 2 ms the irregular 14.1 rad/s motion of the elastic gap is sustained, without a period."""
    loop = cdf.closed_loop(BACKLASH, cdf.backlash_masses(1, 8, 0.018, 0.8), dt=2e-3)
    orbit = cdf.find_limit_cycle(loop)
    assert orbit is not None and orbit.stable is None
    assert orbit.omega == pytest.approx(14.1, rel=0.02)
    assert not orbit.status.ok


def test_guess_of_the_wrong_kind():
    loop = cdf.closed_loop(FRICTION, cdf.friction_mass(9, 5, 0.5))
    with pytest.raises(TypeError, match="a guess must be"):
        cdf.find_limit_cycle(loop, guess="near 14 rad/s")
    other = cdf.find_limit_cycle(loop)
    with pytest.raises(TypeError, match="must have the 5 states of the loop; got one with"):
        cdf.find_limit_cycle(cdf.closed_loop(BACKLASH, cdf.backlash_masses(1, 8, 0.018, 0.8)), guess=other)


def test_a_guess_at_which_nothing_moves_finds_no_orbit():
    axis = cdf.Mass(20, [cdf.Coulomb(25), cdf.Viscous(20), cdf.Stiction(35)])
    loop = cdf.closed_loop(cdf.pid(2000, 3000, 130), axis)
    assert not cdf.find_limit_cycle(loop, guess=(0.01, 3))
    assert cdf.find_limit_cycle(loop, guess=(60, 3)).stable
