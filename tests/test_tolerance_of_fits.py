"""Simulations that are fitted to a record err by a thousandth of its noise, about."""

import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.identify.prediction.segments import equal_segments, facts
from ctrl_df.identify.prediction.simulator import Simulator
from ctrl_df.identify.prediction.simulators import tolerance
from ctrl_df.identify.thresholds import RTOL_COARSE, RTOL_FINEST

T = np.arange(0, 10, 0.002)
FORCE = 9 * np.sin(2 * np.pi * 0.4 * T) + 6 * np.sin(2 * np.pi * 1.1 * T)
MACHINES = {
    "gap": cdf.backlash_masses(2.0, 1.0, 2e-3, 0.3).with_effect(cdf.QuadraticDrag(8.0)),
    "curve": cdf.friction_mass(2.0, 3.0, 6.0).with_effect(cdf.Stribeck(4.5, velocity=0.05)),
    "teeth": cdf.friction_mass(2.0, 3.0, 6.0).with_effect(cdf.PositionRipple(1.0, 0.01)),
}


def recorded(machine, decibel) -> cdf.Measurement:
    """Return a record with noise so far below the motion."""
    x = np.asarray(cdf.event_response(machine, T, FORCE, input_hold="zoh").outputs)[0]
    noise = np.std(x) * 10 ** (-decibel / 20) * np.random.default_rng(3).standard_normal(T.size)
    return cdf.Measurement(T, FORCE, x + noise)


@pytest.mark.parametrize(("decibel", "expected"), [(60, 1e-6), (30, RTOL_COARSE), (200, RTOL_FINEST)])
def test_it_follows_the_noise(decibel, expected):
    record = recorded(MACHINES["curve"], decibel)
    assert tolerance(record) == pytest.approx(expected, rel=0.1)
    # second differences magnify what simulations err by
    assert tolerance(record, accelerations=True) == RTOL_FINEST


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("decibel", [40, 60])
def test_errors_are_far_below_the_noise(name, decibel):
    record = recorded(MACHINES[name], decibel)
    segments = equal_segments(record, 16)
    fast, exact = (Simulator(MACHINES[name], record, rtol=r) for r in (tolerance(record), 1e-11))
    starts = np.zeros((len(segments), len(exact.free_states)))
    error = fast.run(segments, None, starts) - exact.run(segments, None, starts)
    assert np.sqrt(np.mean(error**2)) < 1e-3 * facts(record).noise  # measured: 2e-4 at most
