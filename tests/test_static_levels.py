"""Static levels of drives that stick most of the time: slopes tell nothing of them."""

import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.identify.estimation.segmented import CandidateFit, prepare
from ctrl_df.identify.residuals.missing_forces import missing_forces
from ctrl_df.identify.selection.evidence import ranked
from ctrl_df.identify.selection.reference import reference_of
from ctrl_df.identify.shooting.variables import default_free

TIMES = np.arange(0.0, 20.0, 0.005)
TRUE = cdf.friction_mass(5.0, 4.0, 30.0, static=6.0)


def hunting(seed):
    """Return the force of a PID that hunts about steps of its reference, and where the drive comes to."""
    rng = np.random.default_rng(seed)
    dt, parts = TIMES[1], 25
    reference = rng.uniform(-0.05, 0.05, 5)
    place = speed = integral = rate = before = 0.0
    force = np.empty(TIMES.size)
    for k, t in enumerate(TIMES):
        error = reference[int(t / 4)] - place
        rate = 0.8 * rate - 0.2 * 120 * (place - before) / dt
        force[k] = 1200 * error + integral + rate
        integral, before = integral + 3000 * error * dt, place
        for _ in range(parts):
            free = speed + dt / parts * (force[k] - 30 * speed) / 5
            dry = dt / parts * (4 if speed else 6) / 5
            slides = abs(free) > dry if speed else abs(force[k]) > 6
            speed = free - np.copysign(dt / parts * 4 / 5, free) if slides else 0.0
            place += dt / parts * speed
    return force, np.asarray(cdf.event_response(TRUE, TIMES, force, input_hold="zoh").outputs)[0]


def test_a_static_level_is_found_from_far_off():
    force, place = hunting(1)
    assert np.mean(np.diff(place) == 0) > 0.5
    noise = 1e-5 * np.random.default_rng(2).standard_normal(TIMES.size)
    model = cdf.friction_mass(4.0, 4.5, 24.0, static=7.0)
    data = prepare(model, [cdf.Measurement(TIMES, force, place + noise)]).fine
    base = reference_of(model, data.segmentations, default_free(model)).base.train
    # it stayed where it began, with an error of 36 times the noise (of two other seeds 24 and 20)
    assert base.rmse < 1.1 * data.noise
    assert base.parameters["stiction.level"] == pytest.approx(6.0, rel=0.01)


def test_what_is_rounded_at_rest_is_no_force():
    def most_telling(model):
        base = data.validate(CandidateFit("", data.fit(model, default_free(model))))
        return missing_forces(base, data, ranked(base, ())[1])[0]

    force, place = hunting(6)
    data = prepare(TRUE, [cdf.Measurement(TIMES, force, 2e-5 * np.round(place / 2e-5))]).fine
    # with the true structure 26 nats for a force that varies over time, of which chance makes 20 once
    found = most_telling(TRUE)
    assert found.rms < found.by_rounding
    missed = most_telling(cdf.friction_mass(5.0, 4.0, 30.0))
    assert missed.rms > missed.by_rounding
