"""What is known of parameters besides the records: value and standard deviation."""

import numpy as np
import pytest

import ctrl_df as cdf

T = np.arange(0.0, 6.0, 0.01)
FORCE = 9 * np.sin(3 * T) + 5 * np.sin(8 * T)
TRUE = cdf.friction_mass(2.2, 3.0, 6.0)


@pytest.fixture(scope="module")
def record():
    x = np.asarray(cdf.event_response(TRUE, T, FORCE, input_hold="zoh").outputs)[0]
    return cdf.Measurement(T, FORCE, x + 1e-4 * np.random.default_rng(1).standard_normal(T.size))


def test_it_tells_what_the_records_leave_open(record):
    # the gain of the drive and all forces are known up to one factor
    model = TRUE.with_effect(cdf.InputGain(1.0)).with_parameters({"mass": 2.0})
    alone = cdf.refit(model, record)
    assert alone.parameters["mass"].standard_error == np.inf and not alone.parameters["mass"].identifiable
    for mass in (2.2, 2.4):
        found = cdf.refit(model, record, prior={"mass": (mass, 0.05)}).parameters
        assert found["mass"].value == pytest.approx(mass, abs=0.01)
        assert found["mass"].standard_error == pytest.approx(0.05, rel=0.1)
        assert found["input_gain.gain"].value == pytest.approx(mass / 2.2, abs=0.005)
        assert found["input_gain.gain"].standard_error == pytest.approx(0.05 / 2.2, rel=0.1)


def test_it_weighs_as_it_is_sure(record):
    plain = cdf.refit(TRUE, record).parameters["mass"]
    weak = cdf.refit(TRUE, record, prior={"mass": (2.5, 0.5)}).parameters["mass"]
    assert weak.value == pytest.approx(plain.value, abs=0.1 * plain.standard_error)
    assert weak.standard_error == pytest.approx(plain.standard_error, rel=0.01)
    sure = cdf.refit(TRUE, record, prior={"mass": (2.5, 1e-9)}).parameters["mass"]
    assert sure.value == pytest.approx(2.5, abs=1e-6)
    # the mean of both, each over its variance
    nearby = plain.value + 2 * plain.standard_error
    both = cdf.refit(TRUE, record, prior={"mass": (nearby, plain.standard_error)}).parameters["mass"]
    assert both.value == pytest.approx(plain.value + plain.standard_error, abs=0.3 * plain.standard_error)
    assert both.standard_error == pytest.approx(plain.standard_error / np.sqrt(2), rel=0.15)


def test_a_diagnosis_and_a_ladder_take_it(record):
    known = {"mass": (2.2, 0.01), "stribeck.level": (3.0, 1.0)}
    start = cdf.friction_mass(2.0, 2.5, 5.0)
    few = ["stribeck", "linear_spring"]
    assert cdf.diagnose(start, record, prior=known, candidates=few).verdict == "none"
    assert cdf.improve(start, record, prior=known, candidates=few).effects == ()


@pytest.mark.parametrize(
    "prior, said",
    [
        ({"mas": (1, 2)}, "names out of mass"),
        ({"stribeck.level": (9, 1)}, "Add its effect to the model"),
        ({"mass": 2.0}, "value and its standard deviation"),
        ({"mass": (2.0, 0.0)}, "standard deviation of mass > 0"),
        ({"mass": (2.0, "a")}, "one real number"),
        (3, "mapping"),
    ],
)
def test_what_it_needs(record, prior, said):
    with pytest.raises((TypeError, ValueError), match=said):
        cdf.refit(TRUE, record, prior=prior)


@pytest.mark.parametrize("asked", [cdf.refit, cdf.diagnose, cdf.improve])
def test_of_what_keeps_its_value_there_is_none(record, asked):
    with pytest.raises(ValueError, match="got 'mass', which keeps its value. Name it in free"):
        asked(TRUE, record, free=["coulomb"], prior={"mass": (2.0, 0.1)})


def test_tables_take_none():
    omega = np.array([2.0, 4.0, 8.0])
    table = cdf.FrequencyMeasurement(
        [8.0, 20.0], omega, cdf.describing_function_family(TRUE, [8.0, 20.0], omega).N
    )
    with pytest.raises(ValueError, match="prior needs records over time"):
        cdf.refit(TRUE, table, prior={"mass": (2.0, 0.1)})
