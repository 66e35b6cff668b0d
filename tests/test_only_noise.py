"""A model that leaves only noise: how that is told, and what is then not tried."""

import sys
from pathlib import Path

import numpy as np
import pytest
import rigs

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))

import rigs_second

import ctrl_df as cdf
from ctrl_df.blocks.effects import LoadDependentFriction
from ctrl_df.identify.arguments import default_free
from ctrl_df.identify.estimation import refit_records
from ctrl_df.identify.fits import rounds
from ctrl_df.identify.selection.structure_search import StructureSearch
from ctrl_df.identify.selection.thresholds import PROMISING
from ctrl_df.identify.thresholds import SIGNIFICANT


@pytest.fixture(scope="module")
def record():
    t = np.arange(0, 6, 0.02)
    force = 8 * np.sin(2 * np.pi * 0.3 * t) + 6 * np.sin(2 * np.pi * 0.9 * t)
    x = np.asarray(cdf.event_response(cdf.friction_mass(2.0, 3.0, 5.0), t, force, input_hold="zoh").outputs)
    return cdf.Measurement(t, force, x[0] + 1e-4 * np.random.default_rng(5).standard_normal(t.size))


def search(block, fitted, held_out):
    return StructureSearch(block, [fitted], [held_out], default_free(block))


def nothing(record):
    return np.zeros_like(record.y)


def slow_noise(record):
    white = np.random.default_rng(6).standard_normal(len(record.t) + 40)
    return 4e-5 * np.convolve(white, np.exp(-np.arange(41) / 8), "valid")


def slips(record):
    """Noise of that spectrum whose kicks are few and large, as of a machine that slips at other times."""
    rng = np.random.default_rng(7)
    kicks = rng.standard_normal(len(record.t) + 40) * (rng.random(len(record.t) + 40) < 0.1) / np.sqrt(0.1)
    return 4e-4 * np.convolve(kicks, np.exp(-np.arange(41) / 8), "valid")


def square(record):
    return 0.05 * np.square(record.y)


@pytest.mark.parametrize(
    ("added", "alone"), [(nothing, True), (slow_noise, True), (slips, False), (square, False)]
)
def test_noise_may_be_slow_but_has_no_tails_and_does_not_go_with_the_motion(record, added, alone):
    here = record.replaced(y=record.y + added(record))
    found = search(cdf.friction_mass(1.8, 3.3, 5.5), here.slice(0, 3), here.slice(3, 6))
    assert found.leaves_only_noise(found.base) is alone


def test_every_effect_is_fitted_once_and_none_is_confirmed(record, monkeypatch):
    begun = []
    first = rounds._first_steps
    monkeypatch.setattr(rounds, "_first_steps", lambda job: begun.append(job[0].key) or first(job))
    found = cdf.diagnose(cdf.friction_mass(1.8, 3.3, 5.5), record)
    assert found.verdict == "none" and not any(c.confirmed for c in found.ranking)
    assert len(found.ranking) > 20 and max(map(begun.count, begun)) <= 2


def test_long_segments_of_held_out_data_tell_what_those_fitted_do_not():
    # a spring that two seconds of a small motion do not show
    rig = rigs.draw("linear_spring", 14, snr_db=60, n=4000)
    parts = (record[0].measurement().slice(0, 2).decimate(2) for record in (rig.train, rig.holdout))
    found = search(rig.baseline, *parts)
    assert found.errs_as_sensor(found.base) and not found.leaves_only_noise(found.base)


def test_what_an_encoder_rounds_is_noise_though_it_jumps():
    rig = rigs_second.rig("nothing", 407)
    found = StructureSearch(rig.baseline, [rig.train], [rig.held], list(rig.free))
    assert found.leaves_only_noise(found.base)


def test_what_acts_in_few_segments_is_no_noise():
    rig = rigs_second.rig("single", 1244)
    found = StructureSearch(rig.baseline, [rig.train], [rig.held], list(rig.free))
    assert found.leaves_only_noise(found.base)  # errors of a few moves look like noise with a long memory
    after, (best,) = found.candidates([LoadDependentFriction])
    assert not after.at.leaves_only_noise and best.evidence > PROMISING * SIGNIFICANT


def test_a_model_that_leaves_noise_alone_is_refitted_in_its_minimum(record, monkeypatch):
    def sought(*_):
        raise AssertionError("other minima are sought")

    machine = cdf.friction_mass(2.0, 3.0, 5.0).with_effect(cdf.Stribeck(4.5, velocity=0.05))
    x = np.asarray(cdf.event_response(machine, record.t, record.u, input_hold="zoh").outputs)[0]
    here = record.replaced(y=x + 1e-4 * np.random.default_rng(8).standard_normal(x.size))
    found = search(machine, here.slice(0, 4), here.slice(4, 6))
    after, candidates = found.candidates([])
    after, _ = after.confirm(candidates)
    assert after.at.leaves_only_noise
    monkeypatch.setattr(refit_records, "restarted", sought)
    monkeypatch.setattr(refit_records, "with_levels_scanned", sought)
    again = after.in_full()
    assert again is None or again.parameters["stribeck.level"].value == pytest.approx(4.5, rel=0.05)
