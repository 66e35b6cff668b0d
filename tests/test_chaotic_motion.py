"""Motions that noise of the initial state leads apart: compared and fitted over segments, not as one run."""

import numpy as np
import pytest

import ctrl_df as cdf

STOPPED = cdf.Mass(1.0).with_effect(cdf.Viscous(0.1)).with_effect(cdf.LinearSpring(4.0))
STOPPED = STOPPED.with_effect(cdf.HardStop(0.2, 0.8))
DUFFING = cdf.Mass(1.0).with_effect(cdf.Viscous(0.3)).with_effect(cdf.LinearSpring(-1.0))
DUFFING = DUFFING.with_effect(cdf.CubicSpring(1.0))
TIME = np.arange(0, 150, 0.05)


def recorded(machine, force, noise=1e-3):
    """Return what a machine does under a force, with noise."""
    x = np.asarray(cdf.event_response(machine, TIME, force, input_hold="zoh").outputs)[0]
    return cdf.Measurement(TIME, force, x + noise * np.random.default_rng(1).standard_normal(TIME.size))


CHAOTIC = {
    "stops": (STOPPED, 2.0 * np.sin(2.3 * TIME)),
    "duffing": (DUFFING, 0.5 * np.sin(1.2 * TIME)),
}


@pytest.mark.parametrize("kind", CHAOTIC)
def test_the_true_model_errs_by_the_noise(kind):
    machine, force = CHAOTIC[kind]
    record = recorded(machine, force)
    assert cdf.compare(machine, record, mode="free").rmse > 20e-3  # no run follows it to its end
    assert cdf.compare(machine, record).rmse == pytest.approx(1e-3, rel=0.05)


@pytest.mark.parametrize("kind", CHAOTIC)
def test_parameters_are_found_within_their_standard_errors(kind):
    machine, force = CHAOTIC[kind]
    start = machine.with_parameters({k: 1.08 * p.value for k, p in machine.parameters.items() if p.value})
    fit = cdf.refit(start, recorded(machine, force))
    for name, found in fit.parameters.items():
        # 2.2 at most
        assert abs(found.value - machine.parameters[name].value) < 4 * found.standard_error, name
        assert found.standard_error < 0.03 * abs(found.value)


def test_a_periodic_motion_of_the_same_machine_is_one_free_run():
    record = recorded(STOPPED, 2.0 * np.sin(1.7 * TIME))
    assert cdf.compare(STOPPED, record).windows == 1
    assert cdf.compare(STOPPED, record).rmse == pytest.approx(1e-3, rel=0.05)
