"""The ladder: it climbs, it stops, it reports."""

import matplotlib as mpl
import numpy as np
import pytest
import rigs

mpl.use("Agg")

import matplotlib.pyplot as plt

import ctrl_df as cdf
from ctrl_df.identify.experiment import next_experiment
from ctrl_df.identify.improve import improve


@pytest.fixture(scope="module")
def study():
    """A ladder of Coulomb friction and drag, both hidden; the rig, its record held out and the study."""
    rig = rigs.draw(("coulomb", "quadratic_drag"), 1002, excitation="multisine", snr_db=60)
    free = [k for k, p in rig.baseline.parameters.items() if p.free and k not in rig.known]
    train, held = (record[0].measurement().slice(0, 4).decimate(5) for record in (rig.train, rig.holdout))
    return rig, held, improve(
        rig.baseline, train, held, free=free,
        candidates=("coulomb", "stribeck", "quadratic_drag"), max_effects=2,
    )  # fmt: skip


def test_both_effects_are_found(study):
    rig, held, found = study
    assert set(found.effects) == {"coulomb", "quadratic_drag"}
    assert found.verdict == "effect"
    errors = [s.nrmse_holdout for s in found.steps]
    # the mean of five samples has so much less noise
    assert errors[-1] < 1.3 * rig.holdout[0].noise / np.sqrt(5) / np.std(held.y)
    assert all(a > b for a, b in zip(errors[:-1], errors[1:], strict=True))
    for name in ("coulomb.level", "quadratic_drag.coefficient"):
        assert found.model.parameters[name].value == pytest.approx(rig.truth[name], rel=0.05)


def test_an_effect_that_stood_in_for_two_gives_way(study):
    *_, found = study
    first, last = found.steps[1], found.steps[-1]
    # one Stribeck curve looks most like Coulomb friction and drag together, until drag is there
    assert first.effect == "stribeck"
    assert last.dropped == ("stribeck",) and last.instead == ("coulomb",)
    assert "coulomb" in found.summary()


def test_pictures_show_every_step(study):
    *_, found = study
    drawn = found.plot()
    assert [len(line.get_xdata()) for (line,) in drawn.lines[:2]] == 2 * [len(found.steps)]
    plt.close("all")
    drawn = found.steps[0].diagnosis.plot()
    assert len(drawn.lines[0]) == 1 + len(found.steps[0].diagnosis.ranking)
    plt.close("all")


def test_an_experiment_keeps_its_limits(study):
    diagnosis = study[2].steps[0].diagnosis
    plan = next_experiment(diagnosis, force=2.0 * np.max(np.abs(study[0].train[0].u)))
    t, u = plan
    assert len(t) == len(u) and np.max(np.abs(u)) <= 2.0 * np.max(np.abs(study[0].train[0].u))
    assert plan.separation > 0 and plan.reason


def test_summary_tells_the_outcome(study):
    text = study[2].summary()
    assert "held-out" in text and "noise floor" in text


EFFECTS = ("linear_spring", "stribeck", "stiction", "quadratic_drag")


@pytest.fixture(scope="module")
def spring_and_stribeck():
    t = np.arange(0, 5, 0.005)
    force = sum(a * np.sin(w * t + w**2) for a, w in ((9, 1.9), (6, 6.9), (4, 14.5)))
    machine = cdf.friction_mass(2.2, 2.0, 5.0).with_effect(cdf.LinearSpring(35.0))
    machine = machine.with_effect(cdf.Stribeck(3.5, velocity=0.06))
    x = np.asarray(cdf.event_response(machine, t, force, input_hold="zoh").outputs)[0]
    return cdf.Measurement(t, force, x + 5e-5 * np.random.default_rng(4).standard_normal(t.size))


@pytest.mark.parametrize(
    ("every", "size", "candidates"),
    [(2, 1.0, EFFECTS), (1, 1.3, EFFECTS), (1, 0.7, EFFECTS[::-1])],
    ids=["half_the_rate", "more", "less"],
)
def test_it_ends_alike_at_any_rate_from_any_start_in_any_order(spring_and_stribeck, every, size, candidates):
    start = cdf.friction_mass(2.2 * size, 2.0 * size, 5.0 * size)
    found = improve(start, spring_and_stribeck.decimate(every), candidates=candidates)
    values = {k: p.value for k, p in found.model.parameters.items()}
    assert found.verdict == "effect" and set(found.effects) == {"linear_spring", "stribeck"}
    assert values.pop("linear_spring.center") == pytest.approx(0, abs=1e-6)
    # measured: 1.1 % (the speed), 0.2 % (the level), 0.07 %
    assert values == pytest.approx(
        {
            "mass": 2.2, "coulomb.level": 2.0, "viscous.coefficient": 5.0,
            "linear_spring.stiffness": 35.0, "stribeck.level": 3.5, "stribeck.velocity": 0.06,
        },
        rel=0.02,
    )  # fmt: skip
