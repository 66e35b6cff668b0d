"""The drives of `benchmarks/hunting_and_hums.py`: as the event engine moves them, and always the same."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))

import hunting_and_hums as drives

import ctrl_df as cdf
from ctrl_df.identify.estimation.segmented import prepare
from ctrl_df.identify.estimation.starts import begin_alike
from ctrl_df.identify.estimation.thresholds import SEGMENT_SCALES


@pytest.mark.parametrize("kind", ["hidden", "nothing", "silent"])
def test_drives_move_as_the_engine_says(kind):
    drive, _ = drives.drawn(kind, 0)
    mass, viscous, kinetic, static = drive.machine
    more = dict(static=static) if static > kinetic else {}
    block, record = cdf.friction_mass(mass, kinetic, viscous, **more), drive.record
    place = np.asarray(cdf.event_response(block, record.t, record.u, input_hold="zoh").outputs)[0]
    # steps of 1e-5 s; what the sensor adds is 3e-5 m at most
    assert np.std(record.y - place) < 1.1 * max(drive.facts["sensor"], 1e-5)


def test_a_hum_moves_the_drive_and_a_seed_draws_one_machine():
    hum, silent = drives.humming(3), drives.humming(3, hums=False)
    assert hum.machine == silent.machine == drives.humming(3).machine
    assert np.array_equal(hum.record.u, silent.record.u)
    assert np.ptp(hum.record.y - silent.record.y) > 10 * hum.facts["sensor"]


def test_drives_that_hunt_stick_most_of_the_time():
    assert all(drives.hunting(seed).facts["stuck"] > 0.5 for seed in range(3))


def test_a_hidden_static_level_is_named_where_no_start_is_near():
    # `unknown`: every fit kept a level that it began with, a constant force came first
    drive, model = drives.drawn("hidden", 103)
    found = cdf.diagnose(model, drive.record, candidates=("stiction", "constant_force"))
    assert found.verdict == "effect" and found.best.id == "stiction"
    assert found.best.parameters["level"] == pytest.approx(drive.machine[3], rel=0.01)


def test_parameters_are_not_moved_to_make_up_for_segments_that_begin_wrongly():
    # one segment that begins where no short one does took the static level to its bound: 324 times the noise
    drive, model = drives.drawn("given", 301)
    mass, viscous, kinetic, static = drive.machine
    names = ("mass", "coulomb.level", "viscous.coefficient", "stiction.level")
    true = model.with_parameters(dict(zip(names, (mass, kinetic, viscous, static), strict=True)))
    data = prepare(model, [drive.record])
    shortest, longer = (data.level(factor).fine for factor in SEGMENT_SCALES[:2])
    near = shortest.fit(true, names)
    assert not begin_alike(near, longer.train.segments)
    assert longer.moved(near).rmse < 2 * longer.noise
