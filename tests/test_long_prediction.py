"""A candidate that long horizons refute is left out, and the search repeated without it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from test_ladder import Data, Given, ladder_of

import ctrl_df as cdf
from ctrl_df.identify.residuals.horizons import error_by_horizon
from ctrl_df.identify.selection import verdict
from ctrl_df.identify.selection.long_prediction import LongPrediction, long_prediction

T = np.arange(0, 4, 0.01)
RECORD = cdf.Measurement(
    T, np.sin(3 * T), np.sin(2 * T) + 1e-4 * np.random.default_rng(0).standard_normal(T.size)
)


def model(id, *errors, by_noise=(0.0, 0.0, 0.0)):
    curve = SimpleNamespace(
        nrmse=np.array(errors), horizon=np.array([0.5, 1.0, 2.0]), by_noise=np.array(by_noise)
    )
    return SimpleNamespace(
        id=id, error_by_horizon=curve, predicted=(None, (RECORD,)), confirmed=True, evidence=100.0,
        equivalents=(),
    )  # fmt: skip


@pytest.mark.parametrize(
    "first, rival, base, ahead, refuted",
    [
        ((1.4, 2.6, 1.1), (0.07, 0.4, 0.6), (0.2, 0.4, 0.7), False, True),  # worse than nothing
        ((0.04, 0.15, 0.7), (0.03, 0.1, 0.18), (1.0, 1.0, 1.0), False, True),  # explains nothing in the end
        (
            (0.04, 0.15, 0.4),
            (0.03, 0.1, 0.18),
            (1.0, 1.0, 1.0),
            False,
            False,
        ),  # behind, and still in question
        (
            (0.005, 0.015, 0.32),
            (0.01, 0.03, 0.3),
            (0.04, 0.09, 0.11),
            True,
            False,
        ),  # off by a period at the end
        ((0.04, 0.05, 0.06), (0.05, 0.12, 0.18), (1.0, 1.0, 1.0), True, False),
    ],
)
def test_who_is_refuted(first, rival, base, ahead, refuted):
    found = long_prediction([model("compliance", *first), model("gravity", *rival)], model("", *base), 20.0)
    assert found is not None and found.refuted == refuted and found.ahead == ahead


def test_what_noise_at_the_start_makes_refutes_nobody():
    # an unstable machine held by a controller: the right model runs away, with the start off by its noise
    errors, base = (0.004, 0.01, 300.0), model("", 0.1, 0.15, 0.18)
    for by_noise, better in (((0.001, 0.1, 40.0), ()), ((0.001, 0.002, 0.003), ("",))):
        unstable = model("linear_spring", *errors, by_noise=by_noise)
        first = long_prediction([unstable], base, 20.0)
        assert first is not None and first.better == better and first.ahead == (not better)
        # nor does it make a rival worse than it is where it tells something
        behind = long_prediction([model("compliance", 0.1, 0.15, 0.2), unstable], base, 20.0)
        assert behind is not None and behind.better == (() if better else ("linear_spring",))


def test_the_start_of_an_unstable_machine_is_open():
    t = np.arange(0, 2, 0.005)
    noise = 1e-4 * np.random.default_rng(1).standard_normal(t.size)
    record = cdf.Measurement(t, np.sin(5 * t), 0.01 * np.sin(5 * t) + noise)
    held, loose = (
        error_by_horizon(cdf.Mass(1.0, [cdf.Viscous(1.0), cdf.LinearSpring(k)]), [record]).by_noise
        for k in (100.0, -100.0)
    )
    assert np.all(held < 0.1) and loose[-1] > 100 and loose[0] < 0.1


def refuting(*ids):
    """Return the long prediction of a ranking where these effects explain nothing over long horizons."""

    def judged(ranking, base, significant):
        first, better = ranking[0].id, ("",)
        if first not in ids:
            return LongPrediction(2.0, {first: 0.1, "": 0.5}, ())
        return LongPrediction(2.0, {first: 0.9, "": 0.5}, better, True)

    return judged


def level(added):
    """Return the likelihood of models in which the two do not add up."""
    return 500.0 if "linear_spring" in added else 600.0 if "hysteresis" in added else 0.0


def test_the_search_is_repeated_without_what_is_refuted(monkeypatch):
    monkeypatch.setattr(verdict, "long_prediction", refuting("hysteresis"))
    data = Data({"": 0, "hysteresis": 600, "linear_spring": 500})
    data.top = 500
    monkeypatch.setattr(Data, "level", lambda self, block: level(self.added(block)))
    study = ladder_of(data)
    assert study.effects == ("linear_spring",)
    first = study.steps[0].diagnosis
    assert first.verdict == "effect" and "hysteresis" not in [c.id for c in first.ranking]
    assert "repeated without hysteresis" in first.explanation


def test_what_is_refuted_is_not_searched_again_where_a_provisional_one_is_set_aside(monkeypatch):
    monkeypatch.setattr(verdict, "long_prediction", refuting("hysteresis"))
    monkeypatch.setattr(Given, "undetermined", lambda self, t: ("level",) if t.key == "stribeck" else ())
    asked, candidates = [], Given.candidates

    def noted(self, classes, *others):
        asked.append({c.id for c in classes} & {"hysteresis", "stribeck"})
        return candidates(self, classes, *others)

    monkeypatch.setattr(Given, "candidates", noted)
    data = Data({"": 0, "hysteresis": 600, "stribeck": 550, "linear_spring": 500})
    data.top = 500
    assert ladder_of(data).steps[1].effect == "linear_spring"
    assert asked[:3] == [{"hysteresis", "stribeck"}, {"stribeck"}, set()]


def test_where_nothing_else_explains_it_something_is_missing(monkeypatch):
    monkeypatch.setattr(verdict, "long_prediction", refuting("hysteresis"))
    first = ladder_of(Data({"": 0, "hysteresis": 900})).steps[0].diagnosis
    assert first.verdict == "unknown" and first.ranking[0].id == "hysteresis"


@pytest.mark.parametrize(("evidence", "words"), [(18.0, "may be missing, but"), (60.0, "is missing, and")])
def test_what_is_less_likely_than_nothing_may_be_missing(evidence, words):
    """With 2 % for hysteresis, which held-out data did not confirm, it said that an effect is missing."""

    class Unheld(Given):
        def ranked(self, base, judged):
            return [
                replace(t, evidence=evidence, evidence_fitted=evidence + 5, evidence_validation=-2.0)
                for t in judged
            ]

    data = Data({"": 0, "hysteresis": 30})
    found = verdict.diagnosed(Unheld(data, data.start, ()), [cdf.effect_class("hysteresis")]).diagnosis
    assert found.verdict == "ambiguous"
    assert f"An effect {words} these data do not confirm it" in found.explanation


def test_what_errs_more_on_held_out_data_has_no_probability():
    """Beside the verdict none hysteresis was stated with 100 %: it whitened what a filtered speed left."""

    class Slower(Given):
        def errors(self, judged):
            return 0.01, 0.012 if judged.key else 0.01

    data = Data({"": 0, "hysteresis": 2000})
    found = verdict.diagnosed(Slower(data, data.start, ()), [cdf.effect_class("hysteresis")]).diagnosis
    first = found.ranking[0]
    assert found.verdict != "effect" and first.evidence > 1000 and first.probability < 1e-9
