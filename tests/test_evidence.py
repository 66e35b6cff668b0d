"""What speaks for an effect: no single segment held out, whatever it says."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2, multivariate_normal

import ctrl_df as cdf
from ctrl_df.identify.estimation.from_others import no_worse_than
from ctrl_df.identify.estimation.segmented import CandidateFit, prepare
from ctrl_df.identify.prediction.simulator import free_run
from ctrl_df.identify.selection import evidence
from ctrl_df.identify.selection.evidence import ranked
from ctrl_df.identify.selection.predictive import held_out, power_of
from ctrl_df.identify.selection.verdict import favoured_held_out, is_significant
from ctrl_df.identify.shooting.noise_model import NoiseModel
from ctrl_df.identify.shooting.sigma_points import sigma_points
from ctrl_df.identify.shooting.variables import Variable

PLAIN = cdf.Mass(2.0).with_effect(cdf.Coulomb(0.4)).with_effect(cdf.Viscous(3.0))


def made(block, seed, size=1.0, n=2500, dt=2e-3):
    """Return a record of a block with noise."""
    rng, t = np.random.default_rng(seed), dt * np.arange(n)
    u = size * (5 * np.sin((9 + seed) * t) + 3 * np.sin((31 - seed) * t))
    blank = cdf.Measurement(t, u, np.sin(t))
    return cdf.Measurement(t, u, free_run(block, blank) + 1e-4 * rng.normal(size=n))


@pytest.fixture(scope="module")
def fitted():
    """Baseline, and one with the spring that is missing, fitted and validated; the data."""
    true = PLAIN.with_effect(cdf.LinearSpring(20.0))
    data = prepare(PLAIN, [made(true, 0)], [made(true, 1)]).segmentations[1].fine
    names = tuple(PLAIN.parameters)
    base = data.validate(CandidateFit("", data.fit(PLAIN, names)))
    sprung = PLAIN.with_effect(cdf.LinearSpring(10.0))
    spring = CandidateFit("linear_spring", data.fit(sprung, tuple(sprung.parameters)), extra=1)
    return data, base, data.validate(spring)


@pytest.mark.parametrize("lost", [cdf.QuadraticDrag(0.3), cdf.Compliance(400.0, 2.0, 0.3)])
def test_a_candidate_that_has_lost_its_minimum_begins_again_from_the_model_without_it(fitted, lost):
    # a spring is missing: neither explains it; with masses far off both err more than the model without them
    data, base, _ = fitted
    block = base.block.with_parameters({"mass": 6.0}).with_effect(lost)
    tried = data.fit(block, tuple(block.parameters), iterations=0)
    assert tried.rmse > 1.5 * base.train.rmse
    again, none = no_worse_than(base.train, [tried, None], data)
    assert again.rmse < 1.01 * base.train.rmse and none is None


def with_error(tried, segment, times):
    """Return a model that errs so many times as much in one of the segments held out."""
    held = tried.validation
    errors = [e.copy() for e in held.residual]
    errors[0][held.segments[0].slices[segment]] *= times
    return replace(tried, validation=replace(held, residual=errors))


@pytest.mark.parametrize("stiffness, damping, least, most", [(4e4, 20.0, 8, 20), (4e3, 4.0, 28, 32)])
def test_initial_states_that_explain_nothing_cost_what_they_take_of_the_noise(
    stiffness, damping, least, most, monkeypatch
):
    """A joint has two states more in each of 16 segments; those of a stiff one are known well beforehand."""
    data = prepare(PLAIN, [made(PLAIN, 1)], [made(PLAIN, 11)]).segmentations[1].fine
    base = data.validate(CandidateFit("", data.fit(PLAIN, tuple(PLAIN.parameters))))
    joint = PLAIN.with_effect(cdf.Compliance(stiffness, damping, 0.3))
    tried = data.validate(CandidateFit("compliance", data.fit(joint, tuple(PLAIN.parameters))))
    taken = [f.train.sensitivity.taken_by_starts for f in (base, tried)]
    dense = [np.sum(f.train.sensitivity.absorbed_by_starts(0) ** 2) for f in (base, tried)]
    assert taken == pytest.approx(dense, rel=1e-9)
    more = taken[1] - taken[0]
    assert least < more < most
    held = np.diff([f.validation_slopes.sensitivity.taken_by_starts for f in (base, tried)])[0]
    (priced,), _ = ranked(base, [tried])
    monkeypatch.setattr(evidence, "_taken", lambda *_: 0.0)
    (free,), _ = ranked(base, [tried])
    gains = chi2(more + held), chi2(more), chi2(held)
    costs = (
        free.evidence - priced.evidence,
        free.evidence_fitted - priced.evidence_fitted,
        free.evidence_validation - priced.evidence_validation,
    )
    for gain, cost in zip(gains, costs, strict=True):
        assert gain.ppf(0.98) < 2 * cost < gain.ppf(0.9999)


def test_one_segment_held_out_speaks_for_no_effect(fitted):
    _, base, spring = fitted
    held = len(base.validation.segments[0])
    assert held >= 4
    for segment in range(held):
        unlucky = with_error(base, segment, 100.0)
        lucky = replace(base, key="linear_spring", extra=1)
        ranking = ranked(unlucky, [lucky])[0][0]
        assert ranking.evidence < 0 and ranking.evidence_validation == pytest.approx(0, abs=1e-6)
        # what all segments speak for is found all the same, whatever the baseline does in one of them
        assert ranked(unlucky, [spring])[0][0].evidence > 100


def test_a_failure_in_one_segment_counts(fitted):
    _, base, spring = fitted
    failed = with_error(spring, 0, 1e4)
    ranking = ranked(base, [failed])[0][0]
    assert ranking.evidence < 0 and ranking.evidence_validation < 0


def test_evidence_is_the_least_of_those_without_one_segment(fitted):
    data, base, spring = fitted
    ranking = ranked(base, [spring])[0][0]
    # white noise: what all tell, less the share of one segment
    total = np.concatenate(base.residuals), np.concatenate(spring.residuals)
    whole = 0.5 * len(total[0]) * np.log(np.sum(total[0] ** 2) / np.sum(total[1] ** 2))
    count = sum(map(len, (data.train.segments[0], data.validation.segments[0])))
    assert 0.6 * (1 - 1 / count) * whole < ranking.evidence < whole


def test_held_out_residuals_have_the_covariance_of_noise_and_of_what_parameters_are_uncertain_by():
    rng, white = np.random.default_rng(0), NoiseModel(np.zeros(0), 1.0)
    fitted, held = rng.normal(size=(40, 3)), 5 * rng.normal(size=(25, 3))
    residual = 4 * rng.normal(size=25)

    def at(pieces, residual):
        return SimpleNamespace(response_pieces=[pieces], residual_pieces=[residual], slopes=np.ones(3))

    tried = SimpleNamespace(
        train=at(fitted, np.zeros(40)), validation=at(held, residual), validation_slopes=at(held, residual)
    )
    found = held_out(tried, white)
    power = power_of(found.white[0], found.changes[0])
    covariance = np.eye(25) + held @ np.linalg.solve(fitted.T @ fitted, held.T)
    expected = multivariate_normal(np.zeros(25), covariance).logpdf(residual)
    assert -0.5 * (power.squares + 25 * np.log(2 * np.pi)) - power.widening == pytest.approx(
        expected, rel=1e-9
    )
    # which is the error of a fit to both
    both, error = np.vstack((fitted, held)), np.concatenate((np.zeros(40), residual))
    assert power.squares == pytest.approx(np.linalg.lstsq(both, error)[1][0], rel=1e-9)


def test_a_parameter_that_is_off_by_two_standard_errors_speaks_for_no_effect():
    # on a record that moves ten times as far it makes more than the noise
    true = cdf.Mass(2.0).with_effect(cdf.Viscous(3.0)).with_effect(cdf.LinearSpring(20.0))
    data = prepare(true, [made(true, 0, 0.1)], [made(true, 1)]).segmentations[1].fine
    stiffness, names = "linear_spring.stiffness", tuple(true.parameters)
    fit = data.fit(true, names)
    there = fit.parameters[stiffness] + 2 * fit.standard_errors[stiffness]
    near = data.fit(
        fit.model.with_parameters({stiffness: there}), [n for n in names if n != stiffness], starts=fit.starts
    )
    off = data.fit(near.model, names, starts=near.starts, iterations=0)
    least, moved = (data.validate(CandidateFit(key, f)) for key, f in (("", fit), ("off", off)))
    held = least.validation.count
    assert held * np.log(moved.validation_rmse / least.validation_rmse) > 50  # of noise alone
    fitted = fit.count * np.log(off.rmse / fit.rmse)  # 2.5
    assert ranked(least, [moved])[0][0].evidence == pytest.approx(-fitted, abs=5.0)


def test_sigma_points_are_a_standard_deviation_off():
    table = PLAIN.parameters
    variables = [Variable(n, table[n], table[n].value) for n in table]
    theta = np.array([v.q(table[v.name].value) for v in variables])
    jacobian = np.random.default_rng(3).normal(size=(200, 3)) * (1.0, 20.0, 3.0)
    curvature = jacobian.T @ jacobian
    found = sigma_points(variables, theta, np.zeros(3), curvature, 0.01)
    steps = np.array(found) - theta
    assert len(found) == 6
    assert np.einsum("ij,jk,ik->i", steps, curvature / 0.01, steps) == pytest.approx(1, rel=1e-9)
    assert steps[::2] == pytest.approx(-steps[1::2])
    assert steps.T @ steps / 2 == pytest.approx(np.linalg.inv(curvature / 0.01), rel=1e-9)
    # what data do not determine, and nothing else is known of, moves by a factor of e at most
    loose = sigma_points(variables, theta, np.zeros(3), 0 * curvature, 0.01)
    assert max(variables[0].p(q[0]) for q in loose) == pytest.approx(2.0 * np.e)


def test_a_fit_has_the_sigma_points_of_its_covariance(fitted):
    _, _, spring = fitted
    fit = spring.train
    steps = np.array([[p[n] for n in fit.names] for p in fit.sigma_points]) - fit.values
    spread = np.sqrt(np.einsum("ij,ij->j", steps, steps) / 2)
    # its standard errors are of the noise's own colour
    assert spread == pytest.approx(np.sqrt(np.diag(fit.covariance)), rel=0.3)


def test_whole_steps_of_a_sensor_are_no_growing_error():
    """A model right to a part of a step errs by whole ones: the probability of the lines has judged it."""
    search = SimpleNamespace(
        base=None, errors=lambda ranking: (1.0, 1.0), significant=20, significant_validation=5
    )
    told = dict(nrmse_holdout=1.1, evidence_fitted=100.0, evidence_holdout=50.0)
    assert is_significant(SimpleNamespace(effect=cdf.SensorQuantization(1e-3), **told), search)  # type: ignore[arg-type]
    assert not is_significant(SimpleNamespace(effect=cdf.LinearSpring(1.0), **told), search)  # type: ignore[arg-type]


def test_an_encoder_fitted_to_small_motions_is_found_in_large_ones():
    """Parameters of small motions err by whole lines in large ones, over segments that are long enough."""
    t, step = 2e-3 * np.arange(1200), 5e-4
    records = []
    for size, seed in ((1.0, 0), (8.0, 1)):
        force = size * (np.sin(9 * t + seed) + 0.7 * np.sin(31 * t))
        rng, blank = np.random.default_rng(seed), cdf.Measurement(t, force, np.sin(t))
        x = step * np.round(free_run(PLAIN, blank) / step) + 0.02 * step * rng.normal(size=t.size)
        records.append(cdf.Measurement(t, force, x))
    found = cdf.diagnose(PLAIN, records[0], holdout=records[1], candidates=["sensor_quantization"])
    assert found.verdict == "effect" and found.ranking[0].parameters["step"] == pytest.approx(step, rel=1e-3)


def candidate(id, fitted, held, same=()):
    """Return a candidate of a ranking with these log-likelihoods of its records."""
    return SimpleNamespace(
        id=id, evidence=fitted + held, evidence_fitted=fitted, evidence_holdout=held, confirmed=True,
        equivalents=same, effect=id,
    )  # fmt: skip


@pytest.mark.parametrize(
    "rival, favoured",
    [
        (candidate("bristle", 100.0, 90.0), ["bristle"]),  # the records contradict each other
        (candidate("bristle", 100.0, 52.0), []),  # by chance
        (candidate("bristle", 400.0, 20.0), []),
        (candidate("bristle", 100.0, 90.0, same=("backlash",)), []),
        (candidate("alike", 100.0, 90.0), []),  # the first in a wrong minimum
    ],
)
def test_a_rival_that_the_held_out_data_favour(rival, favoured):
    first = candidate("backlash", 500.0, 50.0, same=("bristle",) if rival.equivalents else ())
    search = SimpleNamespace(
        significant_validation=5.0, acting_as=lambda _, other: other if other == "alike" else None
    )
    assert [c.id for c in favoured_held_out([first, rival], search)] == favoured


def test_what_acts_in_held_out_data_alone_is_told_and_nothing_is_added_for_it():
    """A stop that the record fitted does not reach: no effect of the fitted data stands in for it."""
    t, rng = 4e-3 * np.arange(800), np.random.default_rng(3)
    machine = cdf.friction_mass(mass=2, coulomb=1, viscous=3).with_effect(cdf.HardStop(0.05))
    records = []
    for size, rate in ((2.0, 8.2), (6.5, 4.4)):
        force = size * (np.sin(rate * t) + 0.5 * np.sin(2.7 * rate * t + 1))
        x = cdf.event_response(machine, t, force).outputs[0] + 2e-5 * rng.normal(size=t.size)
        records.append(cdf.Measurement(t, force, x, input_hold="linear"))
    small, large = records
    assert np.max(np.abs(small.y)) < 0.045 < np.max(np.abs(large.y))
    names = ["hard_stop", "sensor_delay"]
    study = cdf.improve(machine.without_effect("hard_stop"), small, holdout=large, candidates=names)
    last = study.steps[-1].diagnosis
    assert study.verdict == "unknown" and study.effects == () and last.held_out_only
    assert "but not the held-out data" in study.summary()
    assert all(c.evidence_fitted < 20 for c in last.ranking)
    exchanged = cdf.diagnose(study.model, large, holdout=small, candidates=names)
    assert exchanged.ranking[0].id == "hard_stop" and exchanged.verdict in ("effect", "ambiguous")
