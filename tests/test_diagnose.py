"""Diagnosis: the right effect on a few rigs, nothing where nothing is, equivalents together, clear errors."""

import numpy as np
import pytest
import rigs

import ctrl_df as cdf
from ctrl_df.identify.diagnose import diagnose
from ctrl_df.identify.equivalence import coloured_floor
from ctrl_df.identify.measurement import Measurement
from ctrl_df.identify.trial import as_run, first_starts, fit, scales_of, windowed

FEW = ("constant_force", "asymmetric_coulomb", "linear_spring", "input_delay", "sensor_delay")


def of(rig):
    return rig.train[0].measurement(), rig.holdout[0].measurement()


def test_a_true_model_is_fitted_to_the_noise():
    rig = rigs.draw_wrong_parameters(4, excitation="chirp", snr_db=60)
    run = windowed(as_run(of(rig)[0], 5))
    found = fit(rig.baseline, [run], list(rig.baseline.parameters), scales_of(rig.baseline, [run]))
    assert found.rms < 1.1 * rig.train[0].noise  # worst seen 1.02
    assert found.block.parameters["mass"].value == pytest.approx(rig.truth["mass"], rel=0.02)


def test_starts_are_read_off_the_record():
    rig = rigs.draw_none(4, excitation="chirp", snr_db=60)
    run = windowed(as_run(of(rig)[0], 5))
    at = run.windows.edges[:-1] * 5
    starts = first_starts([run])[0]
    assert np.max(np.abs(starts[:, 0] - rig.train[0].clean[at])) < 5 * rig.train[0].noise


@pytest.mark.parametrize("effect", ["linear_spring", "input_delay"])
def test_a_single_effect_is_named_first(effect):
    rig = rigs.draw(effect, 11, snr_db=60)
    train, held = of(rig)
    found = diagnose(rig.baseline, train, holdout=held, candidates=FEW)
    assert found.verdict == "effect"
    assert effect in {found.best.id, *found.best.equivalents}
    assert found.best.nrmse_holdout < 1.2 * rig.holdout[0].noise / np.std(held.y)
    assert found.best.probability > 0.3
    assert found.best.effect in found.best.model.effects
    assert effect.replace("_", " ") in found.explanation


def test_equal_maps_are_one_class():
    rig = rigs.draw("constant_force", 12, snr_db=60)
    train, held = of(rig)
    found = diagnose(rig.baseline, train, holdout=held, candidates=FEW)
    assert {found.best.id, *found.best.equivalents} == {"constant_force", "asymmetric_coulomb"}


@pytest.mark.parametrize("draw", [rigs.draw_none, rigs.draw_wrong_parameters])
def test_nothing_hidden_is_none(draw):
    rig = draw(13, snr_db=60)
    train, held = of(rig)
    found = diagnose(rig.baseline, train, holdout=held, candidates=FEW)
    assert found.verdict == "none"
    assert found.best is None
    assert found.next_experiment is None


def test_one_record_alone():
    rig = rigs.draw("linear_spring", 14, snr_db=60)
    found = diagnose(rig.baseline, of(rig)[0], candidates=("linear_spring", "constant_force"))
    assert found.best.id == "linear_spring"


def test_structure_is_told_from_coloured_noise():
    rng = np.random.default_rng(1)
    t = np.arange(10_000) * 1e-3
    white = rng.standard_normal(len(t))
    noise, structure = coloured_floor(white, np.cos(6 * t), 1e-3)
    assert noise == pytest.approx(1.0, rel=0.05) and structure < 0.3
    noise, structure = coloured_floor(white + 5 * np.sin(6 * t + 1), np.cos(6 * t), 1e-3)
    assert structure == pytest.approx(5 / np.sqrt(2), rel=0.1)


def test_errors_are_clear():
    t = np.linspace(0, 1, 100)
    data = Measurement(t, np.sin(t), t**2)
    with pytest.raises(TypeError, match="Measurement"):
        diagnose(cdf.Mass(1), (t, t, t))
    with pytest.raises(TypeError, match="unrecognized keyword"):
        diagnose(cdf.Mass(1), data, colour="red")
    with pytest.raises(ValueError, match="effect id"):
        diagnose(cdf.Mass(1), data, candidates=["gremlin"])
    with pytest.raises(TypeError, match="inertia"):
        diagnose(3.0, data)
