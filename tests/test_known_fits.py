"""Fits are made once: what is asked again, and follows from the same, is what was found before."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.identify.estimation import segmented
from ctrl_df.identify.estimation.segmented import prepare
from ctrl_df.identify.shooting import known_fits
from ctrl_df.identify.shooting.known_fits import KnownFits, by_value
from ctrl_df.values.per_record import PerRecord

MODEL = cdf.Mass(2.0).with_effect(cdf.Coulomb(3.0)).with_effect(cdf.Viscous(5.0))
FREE = ("mass", "coulomb.level")
T = 0.005 * np.arange(1200)


def run(name):
    force = 12 * np.sin(3 * T) + 8 * np.sin(11 * T)
    true = cdf.Mass(2.4).with_effect(cdf.Coulomb(2.0)).with_effect(cdf.Viscous(5.0))
    y = cdf.event_response(true, T, force, input_hold="zoh").outputs[0]
    return cdf.Measurement(T, force, y + 1e-4 * np.random.default_rng(1).standard_normal(T.size), name=name)


@pytest.fixture(scope="module")
def record():
    return run("first")


@pytest.fixture
def made(monkeypatch):
    """The fits that are made, in the order in which they are."""
    found, fit = [], segmented.fit_segments

    def counted(*args, **keywords):
        found.append(fit(*args, **keywords))
        return found[-1]

    monkeypatch.setattr(segmented, "fit_segments", counted)
    return found


def test_what_is_asked_again_is_not_fitted_again(record, made):
    data = prepare(MODEL, [record])
    first = data.sampled.fit(MODEL, FREE, iterations=4)
    assert data.sampled.fit(MODEL, FREE, iterations=4) is first  # segments made anew, of the same values
    assert len(made) == 1
    for other in (
        lambda: data.fit(MODEL, FREE, iterations=4),
        lambda: data.sampled.fit(MODEL, FREE, iterations=5),
        lambda: data.sampled.fit(MODEL, FREE[:1], iterations=4),
        lambda: data.sampled.fit(MODEL.with_parameters({"mass": 2.1}), FREE, iterations=4),
        lambda: data.sampled.fit(MODEL, FREE, iterations=4, starts=[0.5 * s for s in first.starts]),
        lambda: replace(data.sampled, limits={"mass": (1.0, 3.0)}).fit(MODEL, FREE, iterations=4),
    ):
        before = len(made)
        other()
        assert len(made) == before + 1


def test_a_fit_that_its_limit_has_ended_is_made_again_for_another_limit(record, made):
    data = prepare(MODEL, [record])

    def fit(give_up):
        return data.fit(MODEL, FREE, iterations=6, give_up=give_up)

    low = 1e-3 * data.noise
    assert fit(low).given_up and fit(low) is made[0]
    whole = fit(math.inf)
    assert len(made) == 2 and not whole.given_up and whole.rmse < made[0].rmse
    far = 2 * fit(math.inf).rmse
    assert not fit(far).given_up and len(made) == 3  # a lower limit may end it
    assert fit(10 * far) is made[2] and len(made) == 3  # a higher one does not
    assert fit(low).given_up and fit(math.inf) is made[2]  # nor is it lost


def test_a_value_of_each_record_is_not_its_mean(record, made):
    """As numbers the two are equal, and so are the models."""
    data = prepare(MODEL, [record, run("second")])
    each = MODEL.with_parameters({"mass": PerRecord(2.0, {"first": 1.5, "second": 2.5})})
    assert each == MODEL
    shared = data.fit(MODEL, FREE, iterations=3)
    assert data.fit(each, FREE, iterations=3) is not shared and len(made) == 2


def test_so_many_bytes_are_kept_and_none_go_to_another_process(record, made, monkeypatch):
    data = prepare(MODEL, [record])
    first = data.fit(MODEL, FREE, iterations=2)
    monkeypatch.setattr(known_fits, "KNOWN_BYTES", 1.5 * first.bytes)
    data.fit(MODEL, FREE, iterations=3)
    assert data.fit(MODEL, FREE, iterations=2) is not first and len(made) == 3
    there = pickle.loads(pickle.dumps(data.known))
    assert isinstance(there, KnownFits)
    assert there.of("asked", math.inf, lambda: first) is first


def test_things_of_equal_values_are_equal():
    pair = [(MODEL, {"b": np.arange(3.0), "a": [1, (2.0, None)]}) for _ in range(2)]
    assert by_value(pair[0]) == by_value(pair[1]) and hash(by_value(pair[0])) == hash(by_value(pair[1]))
    assert by_value(np.arange(3.0)) != by_value(np.arange(3)) != by_value(np.arange(3).reshape(3, 1))
