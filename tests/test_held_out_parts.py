"""What acts in the parts that are held out alone, and what fits that have seen them say of these."""

from dataclasses import replace

import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.identify.estimation.segmented import prepare
from ctrl_df.identify.monitor import Monitor
from ctrl_df.identify.selection.structure_search import StructureSearch

MODEL = cdf.friction_mass(2.0, 3.0, 5.0)
TIMES = np.arange(0.0, 9.0, 0.01)
LIMIT, WEAK = 14.0, 24.0


def run(limit=LIMIT):
    """Return a record whose force meets a limit in its third second alone, the first part held out."""
    force = 9 * np.sin(2 * np.pi * 0.7 * TIMES) + 3 * np.sin(2 * np.pi * 1.9 * TIMES)
    force[200:300] *= 2.5
    axis = cdf.friction_mass(2.2, 3.3, 6.0).with_effect(cdf.InputSaturation(limit))
    x = np.asarray(cdf.event_response(axis, TIMES, force, input_hold="zoh").outputs)[0]
    return cdf.Measurement(TIMES, force, x + 3e-4 * np.random.default_rng(0).standard_normal(TIMES.size))


@pytest.fixture(scope="module")
def record():
    return run()


def test_every_third_part_may_be_held_out(record):
    parts = [prepare(MODEL, [record], out=i).validation.segments[0] for i in range(3)]
    seen = np.concatenate([w.samples for w in parts])
    assert len(np.unique(seen)) == len(seen) == len(record)
    assert [w.samples[0] for w in parts] == [0, 100, 200]


def test_a_fit_that_has_seen_what_is_held_out_is_no_excuse_for_the_error_there():
    # refitted to the whole record the model is as uncertain as the force that is missing there makes it
    search, _ = StructureSearch(MODEL, [run(WEAK)], (), tuple(MODEL.parameters)).confirm([], Monitor())
    fit = search.base.train
    seen = replace(search.base, train=replace(fit, covariance=1e4 * fit.covariance))
    assert not search.remainder(seen, False).unexplained
    assert search.remainder(replace(seen, unseen=fit), False).unexplained


def test_an_effect_in_parts_held_out_alone_is_found(record):
    found = cdf.diagnose(MODEL, record, candidates=["input_saturation", "constant_force"])
    assert found.verdict in ("effect", "ambiguous") and found.best.id == "input_saturation"
    assert abs(found.best.parameters["level"] - LIMIT) < 0.1  # measured: 0.01
