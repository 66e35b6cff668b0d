"""A refit of a law with many minima keeps the best of three ways to it."""

import numpy as np

import ctrl_df as cdf
from ctrl_df.identify.estimation import refit_records

TIMES = 5e-3 * np.arange(600)
SPINDLE = cdf.friction_mass(2.0, 1.0, 6.0).with_effect(cdf.PositionRipple(2.0, 0.03, 0.4))


def test_the_way_over_the_segments_of_a_diagnosis_is_taken_where_it_ends_best(monkeypatch):
    force = 9 * np.sin(3 * TIMES) + 7 * np.sin(7.3 * TIMES)
    x = np.asarray(cdf.event_response(SPINDLE, TIMES, force, input_hold="zoh").outputs)[0]
    record = cdf.Measurement(TIMES, force, x + 1e-5 * np.random.default_rng(1).standard_normal(TIMES.size))
    names = ["mass", "viscous.coefficient", "position_ripple.wavelength"]
    stated = SPINDLE.with_parameters({"mass": 1.7, "position_ripple.wavelength": 0.041})
    found = {}
    for led in (stated, SPINDLE):
        monkeypatch.setattr(refit_records, "_led_by_segments", lambda *_, led=led: led)
        found[led is SPINDLE] = cdf.refit(stated, record, names).comparison.rmse
    assert found[True] < 1.2e-5 < found[False]
