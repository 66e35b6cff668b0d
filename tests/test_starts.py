"""Where segments begin, what drives them, what a rounding sensor tells: parts of the measurement half."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.identify.estimation.segmented import CandidateFit, prepare
from ctrl_df.identify.fits.attempts import Places, attempts_of
from ctrl_df.identify.fits.compared import indistinguishable
from ctrl_df.identify.fits.thresholds import LOAD_SHARES
from ctrl_df.identify.prediction import initial_states
from ctrl_df.identify.prediction.segments import make_segments
from ctrl_df.identify.prediction.simulator import Simulator, free_run
from ctrl_df.identify.residuals.rounding import rounding_evidence
from ctrl_df.identify.selection import confirmation, structure_search
from ctrl_df.identify.selection.equivalence import (
    about_zero,
    acts_as,
    restarted_from_better,
)
from ctrl_df.identify.selection.evidence import ranked
from ctrl_df.identify.selection.reference import input_steps, refitted_from
from ctrl_df.identify.selection.structure_search import StructureSearch
from ctrl_df.identify.shooting.noise_model import prediction_errors
from ctrl_df.identify.shooting.variables import default_free
from ctrl_df.identify.starting.extend import applicable
from ctrl_df.identify.starting.like_another import like_another
from ctrl_df.identify.starting.pairs import pairs
from ctrl_df.identify.starting.read_again import read_again
from ctrl_df.identify.starting.regression import force_fit, motion_of, regressed
from ctrl_df.identify.starting.resonance_grid import resonating
from ctrl_df.identify.starting.screen import Screen
from ctrl_df.simulate.engine import Engine, sampled_drive

PLAIN = cdf.Mass(2.0).with_effect(cdf.Coulomb(0.4)).with_effect(cdf.Viscous(3.0))
BLOCKS = {
    "mass": PLAIN,
    "gap": PLAIN.with_effect(cdf.Backlash(0.01, 0.3, 0.4)),
    "joint": PLAIN.with_effect(cdf.Compliance(900.0, 2.0, 0.4)),
    "bristle": PLAIN.with_effect(cdf.Bristle(4000.0, 30.0)),
}


def record(block, steps=True, n=3000, dt=1e-3):
    """A record from rest: force steps of 0.1 s, or a multisine that changes at every sample."""
    rng, t = np.random.default_rng(5), dt * np.arange(n)
    u = np.repeat(rng.uniform(-6, 6, n // 100), 100) if steps else 5 * np.sin(9 * t) + 3 * np.sin(31 * t)
    blank = cdf.Measurement(t, u, np.sin(t))
    return cdf.Measurement(t, u, free_run(block, blank, slack=0.5))


@pytest.mark.parametrize("name", BLOCKS)
def test_initial_states_and_their_corrections_are_one_map(name):
    core, rng = BLOCKS[name].core, np.random.default_rng(1)
    for _ in range(50):
        usual = rng.normal(size=3) * (0.1, 0.5, 5.0)
        given = {k: 0.3 * rng.normal() for k in initial_states.names(core)}
        given |= {"slack": rng.uniform(), "bristle": 0.0}
        states = np.zeros(6)
        initial_states.fill(states[None], core, given, usual, 0.5)
        back = initial_states.corrections(states, core, usual, 0.5)
        for k in initial_states.names(core):
            assert back[k] == pytest.approx(given[k], abs=1e-9)


@pytest.mark.parametrize("name", BLOCKS)
def test_segments_that_go_on_from_one_another_are_one_run(name):
    block = BLOCKS[name]
    data = record(block)
    simulator, segments = Simulator(block, data), make_segments(data, 0.5)
    starts = simulator.beginnings.at_rest(segments, None)
    if name == "gap":
        starts[:, 2] = 0.5
    for w in range(1, len(segments)):
        starts[w] = simulator.continued_from(segments, None, starts)[w]
    # worst of these four: 6.2e-8, of the bristle
    assert simulator.run(segments, None, starts) == pytest.approx(data.y[segments.samples], abs=2e-7)


GOES_ON = [("joint", initial_states.CONTINUED), ("bristle", initial_states.CONTINUED)]
GOES_ON += [(name, initial_states.MEASURED) for name in ("gap", "joint", "bristle")]


@pytest.mark.parametrize(("name", "initial"), GOES_ON)
def test_hidden_states_go_on_through_segments_and_pauses(name, initial):
    rest, late = record(BLOCKS[name]), 0.003
    t, u = rest.t, np.where(rest.t < 0.1, 0.0, rest.u)
    engine = Engine(BLOCKS[name])
    run = engine.run(engine.start(), t[-1], sampled_drive(t, u, "zoh"), t)
    seen = {"position": np.interp(t - late, t, run.outputs[:, 0]), "velocity": run.outputs[:, 1]}
    data = cdf.Measurement(t, u, outputs=seen)
    simulator = Simulator(BLOCKS[name].with_effect(cdf.SensorDelay(late)), data, initial=initial)
    segments = make_segments(data, 0.1)
    segments = segments.only(np.arange(len(segments)) % 3 != 1)  # one of three is a pause
    x, v = (np.interp(t[segments.first] - late, t, s) for s in run.states[:, :2].T)
    segments = replace(segments, x=x, v=v, a=0 * x)
    assert simulator.continued
    found = simulator.run(segments).reshape(2, -1) / np.reshape(simulator.sensed.weights, (2, 1))
    for got, want in zip(found, seen.values(), strict=True):
        # worst of these five: 3.7e-9, of the bristle
        assert got == pytest.approx(want[segments.samples], abs=1e-8 * np.ptp(want))


def test_an_input_of_steps_is_decimated_without_loss():
    # measured 1.2e-12, and 7.9e-6 where the input changes at every sample
    for steps, bound in ((True, 1e-11), (False, 3e-5)):
        data = record(PLAIN, steps)
        error = np.max(np.abs(free_run(PLAIN, data, decimation=4) - free_run(PLAIN, data)))
        assert error < bound * np.ptp(data.y)


def test_a_step_of_the_input_is_as_long_as_the_noise_lets_it_be():
    # a drive under a stiff controller, whose force changes at every sample: 6,000 of them
    data = record(PLAIN, steps=False, n=6000)
    rng, size = np.random.default_rng(1), np.std(data.y)
    steps = []
    for noise in (1e-3, 1e-6):
        noisy = cdf.Measurement(data.t, data.u, data.y + noise * size * rng.standard_normal(len(data)))
        search = StructureSearch(PLAIN, [noisy], (), default_free(PLAIN))
        assert input_steps(search.at) == search.at.data.decimation
        steps.append(search.at.data.decimation)
        far, near = (
            replace(search.at.data, decimation=k).fit(PLAIN, (), iterations=0) for k in (steps[-1], 1)
        )
        off = np.std(np.concatenate(far.simulated) - np.concatenate(near.simulated))
        assert off < 0.25 * search.at.nearest.rmse
    assert steps == [2, 1]


def test_rounding_is_told_from_noise_of_the_same_size():
    rng = np.random.default_rng(2)
    x = np.cumsum(rng.normal(size=4000)) * 0.02
    for step in (0.1, 0.5):
        rounded = [step * np.round(x / step) + 0.01 * step * rng.normal(size=len(x))]
        noisy = [x + step / math.sqrt(12) * rng.normal(size=len(x))]
        gauss = -0.5 * len(x) * math.log(2 * math.pi * math.e * step**2 / 12)
        assert rounding_evidence(rounded, [x], step) > gauss + 1000
        assert rounding_evidence(noisy, [x], step) < gauss + 20
    # an encoder finer than the noise is part of the noise
    assert rounding_evidence([0.01 * np.round(x / 0.01)], [x + 0.02], 0.01) == -math.inf


def test_a_joint_is_found_by_its_resonance():
    data = prepare(PLAIN, [record(BLOCKS["joint"], n=1500)]).level(4)
    screen = Screen(data.fit(PLAIN, default_free(PLAIN)), data)
    found = [f for share in LOAD_SHARES for f in resonating(cdf.Compliance, screen, share, 1)]
    joint = min(found, key=lambda f: f.rmse).model.effects[-1]

    def frequency(effect, mass):
        return math.sqrt(effect.stiffness / mass / effect.load_fraction / (1 - effect.load_fraction))

    # the grid steps by 1.35; measured 0.90
    ratio = frequency(joint, screen.scales.mass) / frequency(BLOCKS["joint"].effects[-1], 2.0)
    assert 1 / 1.35 < ratio < 1.35


def test_an_offset_of_the_sensor_needs_a_law_of_the_place():
    assert not applicable(cdf.SensorOffset, PLAIN)
    assert applicable(cdf.SensorOffset, PLAIN.with_effect(cdf.LinearSpring(20.0)))
    assert not applicable(cdf.Bristle, cdf.Mass(2.0)) and applicable(cdf.Bristle, PLAIN)


def test_a_pendulum_starts_from_its_own_inertia():
    # without gravity in the model a slow swing takes it for inertia: both are sought together
    t = np.arange(0, 12, 5e-3)
    torque = 0.5 * np.sin(1.5 * t) + 0.5 * np.sin(5 * t + 1)
    true = cdf.Inertia(0.01, [cdf.Gravity(0.5), cdf.Coulomb(0.05), cdf.Viscous(0.02)])
    y = np.asarray(cdf.event_response(true, t, torque, input_hold="zoh").outputs)[0]
    run = cdf.Measurement(
        t, torque, y + 1e-4 * np.random.default_rng(0).normal(size=t.size), input_unit="N m",
        output_unit="rad",
    )  # fmt: skip
    bare = cdf.Inertia(0.01, [cdf.Coulomb(0.05), cdf.Viscous(0.02)])
    data = prepare(bare, [run]).segmentations[0]
    screen = Screen(data.fit(bare, default_free(bare)), data)
    begun = next(s for s in regressed(cdf.Gravity, screen))
    assert begun.effect.values[0] == pytest.approx(0.5, rel=0.05)
    assert dict(begun.values)["inertia"] == pytest.approx(0.01, rel=0.15)

    # the laws that a model has already take their share of the force
    fit = force_fit(motion_of(data.train, data.decimation, true), data.scales, true, [])
    assert fit.values["gravity.torque"] == pytest.approx(0.5, rel=0.05)
    assert fit.values["inertia"] == pytest.approx(0.01, rel=0.15)


def test_a_true_model_follows_what_is_held_out():
    """Past many periods of a ripple the error of a long segment has many minima over where it begins."""
    true, noise = cdf.Mass(0.5, [cdf.Viscous(2.0), cdf.PositionRipple(3.0, wavelength=0.02)]), 2e-5
    for seed in (6, 10):
        records = []
        for which in (seed, seed + 1):
            rng, t = np.random.default_rng(which), 2e-3 * np.arange(2400)
            phases = rng.uniform(0, 6, 3)
            u = sum(2.2 * np.sin(w * t + p) for w, p in zip((3.0, 7.0, 19.0), phases, strict=True))
            x = np.asarray(cdf.event_response(true, t, u, input_hold="zoh").outputs)[0]
            records.append(cdf.Measurement(t, u, x + noise * rng.standard_normal(t.size)))
        data = prepare(true, records[:1], records[1:]).segmentations[-1].fine
        found = data.validate(CandidateFit("", data.fit(true, (), iterations=1)))
        # 1.2, 1.6 times the noise; with one damping for all segments 15, 52
        assert found.validation_rmse < 3 * noise


def test_a_law_in_the_place_of_another():
    t = np.linspace(0.0, 10.0, 2000)
    x, v = 3.0 * np.sin(t), 3.0 * np.cos(t)
    # a pendulum is a ripple as long as a turn: -T sin(x - a) = A sin(2 pi x / L + p)
    ripple = cdf.PositionRipple(0.55, 2 * np.pi, 2.81)
    pendulum = like_another(cdf.Gravity(0.4, 0.2), ripple, x, v)
    assert pendulum is not None and pendulum.values == pytest.approx((0.55, np.pi - 2.81), rel=1e-6)
    # at no speed does it grow with the place, and a spring over a small stroke is a pendulum
    assert like_another(cdf.Viscous(1.0), ripple, x, v) is None
    spring = like_another(cdf.LinearSpring(1.0), cdf.Gravity(2.0), 0.1 * x, v)
    assert spring is not None and spring.values[0] == pytest.approx(2.0, rel=0.02)
    # a Stribeck curve beyond all speeds is Coulomb friction
    dry = like_another(cdf.Coulomb(1.0), cdf.Stribeck(5.0, 1e3), x, v)
    assert dry is not None and dry.values[0] == pytest.approx(5.0, rel=1e-3)
    # dry friction knows no place, and motion alone does not tell what goes with a load, or has states
    assert like_another(cdf.Coulomb(1.0), ripple, x, v) is None
    for other in (cdf.LoadDependentFriction(0.1), cdf.Bristle(1e4)):
        assert like_another(cdf.Coulomb(1.0), other, x, v) is None


def test_what_breaks_away_begins_as_the_narrow_bump_that_was_found():
    """The limit of a Stribeck bump is a law of its own, whose fit may end far off: it lost the first look."""
    truth, t = PLAIN.with_effect(cdf.Stiction(0.9)), 4e-3 * np.arange(1500)
    force = 1.2 * np.sin(2 * t) + 0.4 * np.sin(5.3 * t)
    x = free_run(truth, cdf.Measurement(t, force, np.sin(t)))
    record = cdf.Measurement(t, force, x + 1e-5 * np.random.default_rng(1).normal(size=t.size))
    data = prepare(PLAIN, [record]).segmentations[1]
    # the bump as it was found, and a fit that was lost
    bump, lost = PLAIN.with_effect(cdf.Stribeck(0.9, 1e-3)), PLAIN.with_effect(cdf.Stiction(0.5))
    found = [CandidateFit(b.newest, data.fit(b, tuple(b.parameters), iterations=0)) for b in (bump, lost)]
    again = {t.key: t.train for t in restarted_from_better(found, data, PLAIN)}
    # and so where only longer segments tell that it was lost; what nothing can act as stays
    fits = [data.fit(PLAIN, ()), *(t.train for t in found), None]
    base, first, second, none = confirmation._from_better(fits, data, PLAIN)
    assert (base, first, none) == (fits[0], fits[1], None)
    assert second.rmse == pytest.approx(again["stiction"].rmse, rel=1e-9)
    # 26 times the noise as it was lost, 0.95 begun again
    assert again["stiction"].rmse < 1.1 * data.noise < found[1].train.rmse / 10


@pytest.mark.parametrize("wide", [False, True])
def test_laws_that_do_the_same_are_equal_although_their_fits_are_not(wide):
    """A spring is a pendulum over a small angle, and where one fit has ended farther off than noise, too."""
    scale, t = 1.0 if wide else 1e-3, 4e-3 * np.arange(1000)
    block = cdf.Inertia(2.0).with_effect(cdf.Coulomb(0.4 * scale)).with_effect(cdf.Viscous(3.0))
    force = scale * (6 * np.sin(2 * t) + 3 * np.sin(5.3 * t))
    spring, pendulum = (block.with_effect(e) for e in (cdf.LinearSpring(8.0), cdf.Gravity(8.1, 0.0)))
    x = free_run(spring, cdf.Measurement(t, force, np.sin(t), input_unit="N m", output_unit="rad"))
    noise = 1e-4 * scale * np.random.default_rng(1).normal(size=t.size)
    data = prepare(block, [cdf.Measurement(t, force, x + noise, input_unit="N m", output_unit="rad")]).fine
    first, other = (data.validate(CandidateFit(b.newest, data.fit(b, ()))) for b in (spring, pendulum))
    sigma = ranked(first, [other])[1]
    assert not indistinguishable(first.outputs, other.outputs, sigma)
    assert acts_as(other, first, data, block, sigma) != wide


def test_what_drove_a_lag_before_the_record_is_found():
    """A machine at rest, and a record that begins with a step: the lag has not settled there."""
    t = 2e-3 * np.arange(1500)
    force = np.where(t % 1.0 < 0.5, 3.0, -2.0)
    machine = cdf.Mass(2.0).with_effect(cdf.Viscous(5.0))
    lagged = machine.with_effect(cdf.InputLag(0.04))
    x = np.asarray(cdf.event_response(lagged, t, force, input_hold="zoh").outputs)[0]
    noise = 1e-5 * np.random.default_rng(3).standard_normal(t.size)
    record = cdf.Measurement(t, force, x + noise)
    fit = cdf.refit(lagged.with_parameters({"input_lag.time_constant": 0.06, "mass": 2.2}), record)
    found = fit.parameters["input_lag.time_constant"]
    assert abs(found.value - 0.04) < 3 * found.standard_error < 1e-3
    assert fit.comparison.white and fit.comparison.rmse < 1.1e-5


def _recorded_early(by: float, seed: int = 0) -> cdf.Measurement:
    """A machine that was moving before the record began, its force recorded too early [s]."""
    rng, t = np.random.default_rng(seed), 0.01 * np.arange(601)
    waves = list(zip((0.25, 0.55, 0.9, 1.4, 1.9), rng.uniform(0, 6, 5), rng.uniform(3, 8, 5), strict=True))

    def force(s):
        return sum(a * np.sin(2 * np.pi * f * s + p) for f, p, a in waves)

    x = np.asarray(cdf.event_response(cdf.friction_mass(2, 3, 4), t, force(t), input_hold="zoh").outputs)[0]
    return cdf.Measurement(t, force(t + by), x + 2e-3 * np.std(x) * rng.standard_normal(len(t)))


@pytest.mark.parametrize("delay", [cdf.InputDelay, cdf.SensorDelay])
def test_what_a_dead_time_lets_act_of_the_time_before_the_record_is_found(delay):
    fit = cdf.refit(cdf.friction_mass(2.2, 2.5, 4.5).with_effect(delay(0.28)), _recorded_early(0.3))
    assert fit.comparison.nrmse < 2.1e-3  # 1.98e-3; 15e-3 where the first force holds before the record
    assert fit.parameters[f"{delay.id}.delay"].value == pytest.approx(0.3, abs=1e-3)
    assert fit.parameters["mass"].value == pytest.approx(2, rel=2e-3)


def test_a_force_recorded_more_than_a_period_early_is_called_a_dead_time():
    few = ["input_delay", "sensor_delay", "input_lag", "backlash"]
    found = cdf.diagnose(cdf.friction_mass(1.8, 3.3, 3.5), _recorded_early(0.6), candidates=few)
    assert found.verdict == "effect" and {found.ranking[0].id, *found.ranking[0].equivalents} == {
        "input_delay",
        "sensor_delay",
    }
    assert found.best.model.effects[-1].delay == pytest.approx(0.6, abs=1e-3)


def test_a_force_recorded_late_is_told_where_no_effect_is_named():
    """A load that rattles in a gap errs less, and faster than was measured: that is no noise."""
    record = _recorded_early(-0.3).slice(0, 3)
    found = cdf.diagnose(cdf.friction_mass(1.8, 3.3, 3.5), record, candidates=["backlash"])
    assert found.verdict in ("unknown", "ambiguous")
    assert "A force recorded 0.3 s earlier" in found.explanation


def test_no_noise_is_harder_to_predict_than_a_record_that_has_it():
    rng, t = np.random.default_rng(4), np.arange(4000)
    noise = rng.standard_normal(len(t))
    slow = np.convolve(rng.standard_normal(len(t)), np.ones(10) / 10, "same")
    for signal in (noise, slow):
        of_record = prediction_errors([signal + 20 * np.sin(t / 90)], 12)
        assert np.all(of_record > 0.98 * prediction_errors([signal], 12))
    # twice the noise: this residual has something else in it
    assert np.min(prediction_errors([noise + 20 * np.sin(t / 90)], 12)) < 0.6 * np.min(
        prediction_errors([2 * noise], 12)
    )


def test_a_model_bent_by_other_segments_is_refitted_from_the_best_candidates():
    run = record(PLAIN)
    data, free = prepare(PLAIN, [run]).segmentations[-1], default_free(PLAIN)
    bent = data.fit(PLAIN.with_parameters({"mass": 3.5, "viscous.coefficient": 1.0}), free, iterations=0)
    found = CandidateFit("constant_force", data.fit(PLAIN.with_effect(cdf.ConstantForce(0.0)), free))
    assert refitted_from([found], bent, data, free).rmse < 1e-3 * bent.rmse
    assert refitted_from([], bent, data, free) is bent


def test_plain_friction_begins_at_the_regression_of_the_model_that_has_it():
    slick, run = cdf.Mass(2.0).with_effect(cdf.Viscous(3.0)), record(PLAIN, steps=False)
    data = prepare(slick, [run]).segmentations[-1]
    bent = data.fit(slick.with_parameters({"viscous.coefficient": 20.0}), (), iterations=0)
    (start,) = regressed(cdf.Coulomb, Screen(bent, data))
    values = dict(start.values)
    assert start.effect.level == pytest.approx(0.4, rel=0.1)
    assert values["mass"] == pytest.approx(2, rel=0.05)
    assert values["viscous.coefficient"] == pytest.approx(3, rel=0.05)


def test_a_dead_zone_begins_with_friction_that_is_less_by_it():
    # where a damped machine moves the two are one: the model without a dead zone has both for its friction
    damped = PLAIN.with_parameters({"mass": 0.1, "viscous.coefficient": 60.0})
    zone = damped.with_effect(cdf.InputDeadZone(0.3))
    data = prepare(damped, [record(zone, steps=False)])
    screen = Screen(data.fit(damped, default_free(damped)), data)
    starts = list(regressed(cdf.InputDeadZone, screen))
    assert len(starts) == 3
    for start in starts:
        assert start.effect.threshold + dict(start.values)["coulomb.level"] == pytest.approx(0.7, rel=0.1)


def test_a_general_law_begins_as_its_special_case():
    bristle = cdf.Bristle(4000.0, 30.0)
    assert cdf.MaxwellSlip.from_special(bristle) == cdf.MaxwellSlip(4000.0, 3.0, 30.0)
    assert cdf.Compliance.from_special(bristle) == cdf.Compliance(4000.0, 30.0)  # what both have
    assert cdf.Viscous.from_special(bristle) is None


def test_an_effect_stronger_than_all_else_begins_beside_the_users_values():
    """Refitted without the drift the model is bent: what is small beside that explains nothing."""
    rng = np.random.default_rng(2)
    t = 2.4e-3 * np.arange(2500)
    machine = cdf.Inertia(1e-5).with_effect(cdf.Viscous(1.6e-4)).with_effect(cdf.LinearSpring(0.01))
    u = 0.02 * np.interp(t, t[::125], rng.uniform(-1, 1, 20))
    blank = cdf.Measurement(t, u, np.sin(t), input_unit="N m", output_unit="rad")
    y = free_run(machine.with_effect(cdf.Drift(1.1)), blank)
    run = blank.replaced(y=y + 0.01 * rng.standard_normal(len(t)))
    data, free = prepare(machine, [run], [run]).segmentations[-1], default_free(machine)
    user, bent = (Screen(data.fit(machine, free, iterations=n), data) for n in (0, 12))
    assert bent.base.model.parameters["viscous.coefficient"].value > 5 * 1.6e-4
    places = Places(bent, None, user, tuple((k, machine.parameters[k].value) for k in free))
    _, begun = attempts_of((cdf.Drift, bent, places, free))
    rates = [a.block.effects[-1].rate for a in begun if a.nominal]
    assert len(rates) == 1 and abs(rates[0] - 1.1) < 0.1


def test_where_a_parameter_was_driven_to_its_bound_an_effect_begins_beside_the_users_values():
    """Mass and damping of a valve stand in for a lag of its pressure; about them no start promises much."""
    rng = np.random.default_rng(5)
    t = 5e-3 * np.arange(600)
    valve = cdf.friction_mass(1.5, 90.0, 900.0).with_effect(cdf.LinearSpring(6e4))
    waves = zip((0.12, 0.31, 0.7), rng.uniform(0, 6, 3), strict=True)
    u = sum(200 * np.sin(2 * np.pi * f * t + k) for f, k in waves)
    blank = cdf.Measurement(t, u, np.sin(t))
    y = free_run(valve.with_effect(cdf.InputLag(0.06)), blank)
    run = blank.replaced(y=y + 3e-6 * rng.standard_normal(len(t)))
    model = valve.with_parameters({"mass": 1.7, "viscous.coefficient": 1100.0, "coulomb.level": 70.0})
    data, free = prepare(model, [run], [run]).segmentations[0], default_free(model)
    user, bent = (Screen(data.fit(model, free, iterations=n), data) for n in (0, 12))
    places = Places(bent, None, user, tuple((k, model.parameters[k].value) for k in free))
    _, begun = attempts_of((cdf.InputLag, bent, places, free))
    assert bent.base.names_at_bound == {"mass"}
    assert [a.block.parameters["mass"].value for a in begun if a.nominal] == [1.7]


def test_a_ripple_of_the_model_is_read_again_beside_what_is_missing():
    rng, t = np.random.default_rng(1), 0.01 * np.arange(800)
    waves = zip((9, 7, 5), (0.3, 0.8, 1.5), rng.uniform(0, 6, 3), strict=True)
    force = sum(a * np.sin(2 * np.pi * f * t + k) for a, f, k in waves)
    axis = cdf.friction_mass(2.0, 2.0, 5.0).with_effect(cdf.PositionRipple(2.0, wavelength=0.1, phase=1.0))
    machine = axis.with_effect(cdf.ConstantForce(-0.8))
    x = np.asarray(cdf.event_response(machine, t, force, input_hold="zoh").outputs)[0]
    rec = cdf.Measurement(t, force, x + 1e-4 * rng.standard_normal(t.size))
    nominal = {
        "mass": 2.6,
        "coulomb.level": 2.3,
        "viscous.coefficient": 6.4,
        "position_ripple.amplitude": 1.8,
    }
    model = axis.with_parameters(nominal)
    read = read_again(model, prepare(model, [rec], []))
    assert read["position_ripple.wavelength"] == pytest.approx(0.1, rel=2e-3)
    assert read["mass"] == pytest.approx(2.0, rel=0.01)
    search = StructureSearch(model, [rec], (), default_free(model))
    _, (found,) = search.candidates([cdf.ConstantForce])  # the model alone slips by a period
    assert found.train.rmse < 2e-4
    assert found.block.parameters["constant_force.force"].value == pytest.approx(-0.8, rel=0.03)


def test_a_joint_in_presliding_has_bristles():
    """Stuck but for half a milliradian: over short segments, begun again each, bristles fit any inertia."""
    t = np.arange(0, 2, 0.004)
    torque = sum(a * np.sin(2 * np.pi * f * t) for a, f in ((5.0, 0.5), (2.0, 1.3), (1.2, 3.1)))
    joint = cdf.Inertia(2.5, [cdf.Coulomb(10.5), cdf.Viscous(12), cdf.Bristle(4e4, 150)])
    angle = np.asarray(cdf.event_response(joint, t, torque, input_hold="zoh").outputs)[0]
    angle = angle + 5e-7 * np.random.default_rng(4).standard_normal(t.size)
    record = cdf.Measurement(t, torque, angle, input_unit="N m", output_unit="rad")
    model = cdf.Inertia(3.0, [cdf.Coulomb(8), cdf.Viscous(8)])
    found = cdf.diagnose(model, record, candidates=["bristle", "compliance"])
    assert found.verdict == "effect" and found.best.id == "bristle" and found.best.determined, found
    assert found.best.error_by_horizon.whole < 0.05
    assert found.best.parameters["stiffness"] == pytest.approx(4e4, rel=5e-3)  # measured 5e-4


def test_stops_need_not_stand_about_the_zero_of_the_encoder():
    """Of a real axis hardly any do; only stops at plus and minus one place were tried."""
    t = np.arange(0, 5, 0.005)
    force = 0.9 * np.sin(3.46 * t) + 0.6 * np.sin(8.17 * t + 1) + 0.25 * np.sin(1.32 * t)
    axis = cdf.friction_mass(1.0, 0.12, 0.5).with_effect(cdf.HardStop(0.09, 0.3, lower=-0.15))
    x = np.asarray(cdf.event_response(axis, t, force, input_hold="zoh").outputs)[0]
    record = cdf.Measurement(t, force, x + 1e-5 * np.random.default_rng(0).standard_normal(t.size))
    few = ("hard_stop", "cubic_spring")
    found = cdf.diagnose(cdf.friction_mass(1.1, 0.14, 0.45), record, candidates=few)
    assert (found.verdict, found.best.id) == ("effect", "hard_stop")
    assert found.best.effect.span == pytest.approx((-0.15, 0.09), rel=1e-4)
    assert cdf.HardStop(0.12, center=-0.03).span == pytest.approx((-0.15, 0.09))


def test_a_cubic_spring_need_not_have_its_center_at_the_zero_of_the_encoder():
    """It was `unknown` or a linear spring: fits held the center at zero."""
    t = np.arange(0, 4, 0.005)
    force = 9.0 * np.sin(3.46 * t) + 6.0 * np.sin(8.17 * t + 1) + 2.5 * np.sin(1.32 * t)
    axis = cdf.friction_mass(2.0, 3.0, 5.0).with_effect(cdf.CubicSpring(600.0, 0.7))
    x = np.asarray(cdf.event_response(axis, t, force, [0.7, 0.0], input_hold="zoh").outputs)[0]
    record = cdf.Measurement(t, force, x + 1e-5 * np.random.default_rng(0).standard_normal(t.size))
    few = ("hard_stop", "cubic_spring", "linear_spring", "constant_force")
    found = cdf.diagnose(cdf.friction_mass(2.2, 2.7, 4.5), record, candidates=few)
    assert (found.verdict, found.best.id) == ("effect", "cubic_spring")
    assert found.best.parameters["stiffness"] == pytest.approx(600.0, rel=2e-3)
    assert found.best.parameters["center"] == pytest.approx(0.7, abs=1e-4)


@pytest.mark.parametrize("spring", [cdf.LinearSpring, cdf.CubicSpring])
def test_a_spring_whose_force_hardly_changes_is_no_spring(spring):
    """A constant force had been a spring of 0.0002 N/m, 330 m away from an axis of 2 m."""
    seen = SimpleNamespace(lowest=-1.0, highest=3.0, stroke=4.0)
    assert spring(1.0).ranges(seen) == {"center": (-39.0, 41.0)}
    assert not spring(1.0).distinct(4.0, {"center"})
    assert spring(1.0, 30.0).distinct(4.0, set())
    assert spring(1.0).ranges(SimpleNamespace(stroke=-np.inf)) == {}  # the sensor tells no places


@pytest.mark.parametrize("seed", [105, 163])
def test_where_segments_begin_in_a_gap_with_elastic_faces(seed):
    drive = cdf.TwoInertias(
        2e-3, 6e-3, [cdf.Coulomb(0.06), cdf.Viscous(0.02), cdf.Backlash(0.02), cdf.Compliance(60, 0.02)],
        measured="motor",
    )  # fmt: skip
    rng, t = np.random.default_rng(seed), 2e-3 * np.arange(1200)
    tones = zip((1.2, 0.8, 0.5), (0.9, 2.3, 5.7), rng.uniform(0, 6, 3), strict=True)
    torque = sum(a * np.sin(2 * np.pi * f * t + p) for a, f, p in tones)
    angle = cdf.event_response(drive, t, torque, input_hold="zoh").outputs[0]
    noise = 1e-4 * rng.standard_normal(t.size)
    record = cdf.Measurement(t, torque, angle + noise, input_unit="N m", output_unit="rad")
    _, *errors = prepare(drive, [record]).evaluated(drive)
    # of the noise; 10 and 11 times it where the load was sought as behind a joint without a gap
    assert max(errors) * np.std(record.y) < 2e-4


def test_a_joint_is_found_where_the_drive_runs_far():
    t, rng = np.arange(0, 4, 0.002), np.random.default_rng(10)
    torque = np.repeat(rng.uniform(-3, 3, 20), 100)
    plain = cdf.Inertia(0.009, [cdf.Viscous(0.012), cdf.Coulomb(0.08)], measured="motor")
    true = plain.with_effect(cdf.Compliance(60.0, 0.01, 0.75))
    angle = np.asarray(cdf.event_response(true, t, torque, input_hold="zoh").outputs)[0]
    angle = angle + 1e-4 * rng.standard_normal(t.size)
    run = cdf.Measurement(t, torque, angle, input_unit="N m", output_unit="rad")
    # its resonance is 300 times its speed over its stroke; up to 40 times were tried, 0.23 of the load found
    found = cdf.diagnose(plain, run, candidates=["compliance"])
    assert found.verdict == "effect"
    assert found.best.parameters["load_fraction"] == pytest.approx(0.75, rel=0.01)


def test_a_segment_may_begin_where_a_valve_breaks_away():
    rng, t = np.random.default_rng(3), np.arange(0, 20, 0.01)
    valve = cdf.Mass(
        1.36, [cdf.Coulomb(130.0), cdf.Viscous(600.0), cdf.LinearSpring(5e4), cdf.Stiction(170.0)]
    )
    tones = zip((0.1, 0.23, 0.41), rng.uniform(0, 6, 3), strict=True)
    force = 900 + 240 * sum(np.sin(2 * np.pi * f * t + p) for f, p in tones)
    force = force + np.interp(t, np.arange(0, 21, 2), rng.uniform(-300, 300, 11))
    stem = np.asarray(cdf.event_response(valve, t, force, [0.018, 0.0], input_hold="zoh").outputs)[0]
    record = cdf.Measurement(t, force, stem + 1e-5 * rng.standard_normal(t.size))
    data = prepare(valve, [record]).fine
    segments, found = data.train.segments[0], data.states_of(valve)
    error = np.sqrt(segments.means(np.concatenate(found.residual_pieces) ** 2))
    # three began where the parabola through their neighbours was, 40 micrometres off; the one left breaks
    # away at its last sample, by what noise leaves open of its place
    assert np.sum(error > 2e-5) <= 1


def test_two_effects_at_once_are_told_by_what_each_changes():
    machine = PLAIN.with_effect(cdf.ConstantForce(1.5)).with_effect(cdf.CubicSpring(400.0))
    data = prepare(PLAIN, [record(machine, n=3000)]).segmentations[1]
    screen = Screen(data.fit(PLAIN, default_free(PLAIN)), data)
    classes = [cdf.effect_class(c) for c in ("constant_force", "cubic_spring", "quadratic_drag", "input_lag")]
    first, *others = pairs(classes, screen, 3)
    assert {e.id for e in first.block.effects[-2:]} == {"constant_force", "cubic_spring"}
    assert first.left < 0.2 and all(first.left <= p.left for p in others) and len(others) <= 2
    # of a class that the block has but takes once there is no second one
    assert not pairs([cdf.Coulomb, cdf.ConstantForce], screen, 3)


def test_a_stop_of_which_one_end_is_reached_is_counted_from_zero():
    """The other end stood where the fit had begun, and records held out came to it."""
    rng, t = np.random.default_rng(5), np.arange(0.0, 3.0, 0.002)
    plain = cdf.Mass(2.0).with_effect(cdf.Viscous(8.0))

    def run(stop, force):
        y = cdf.event_response(plain.with_effect(stop), t, force).y[0] + 1e-4 * rng.standard_normal(t.size)
        return cdf.Measurement(t, force, y, input_unit="N", output_unit="m")

    def counted(records, stop):
        data = prepare(plain, *records).fine
        names = ("mass", "viscous.coefficient", "hard_stop.limit", "hard_stop.center")
        found = data.fit(plain.with_effect(stop), names)
        found = about_zero(CandidateFit("hard_stop", found, extra=2), data)
        return found.block.effects[-1], data.validate(found).validation_rmse

    up = 2.6 * np.sin(2 * np.pi * 0.8 * t + 0.5) + 0.5
    records = [run(cdf.HardStop(0.1, 0.3), up)], [run(cdf.HardStop(0.1, 0.3), -up)]
    for center in (0.03, -0.03):
        stop, error = counted(records, cdf.HardStop(0.1 - center, 0.3, center=center))
        assert (stop.limit, stop.center) == (pytest.approx(0.1, rel=1e-3), 0.0)
        assert error < 2e-4
    # with both ends reached the middle is where it is
    aside = cdf.HardStop(0.07, 0.3, center=0.03)
    stop, _ = counted(([run(aside, 2 * up - 1)], [run(aside, -up)]), aside)
    assert stop.center == pytest.approx(0.03, abs=1e-4)


def test_a_joint_that_goes_on_begins_as_the_record_does():
    """A belt at rest under a sudden torque: the motor's acceleration says nothing of how far it is bent."""
    belt = cdf.TwoInertias(5e-4, 1.4e-3, [cdf.Viscous(2e-3), cdf.Compliance(22.0, 0.012)], measured="motor")
    rng, t, noise = np.random.default_rng(4), np.arange(3000) * 1e-3, 2e-4
    torque = np.where(t < 0.4, 0.3, 0.1 * np.sin(9 * t))
    angle = np.asarray(cdf.event_response(belt, t, torque).outputs)[0] + noise * rng.standard_normal(3000)
    record = cdf.Measurement(
        t, torque, angle, input_unit="N m", output_unit="rad", input_hold="zoh", name="belt"
    )
    found = prepare(belt, [record]).segmentations[0].continued.states_of(belt, effort=(8, 1e-4))
    (segments,), (left,), (starts,) = found.segments, found.residual, found.starts
    # 1.0 of the noise over the first 55 samples; 7.5, had the joint begun as the acceleration says
    assert math.sqrt(segments.means(left**2)[0]) < 1.3 * noise
    assert np.all(starts[segments.follow, 2:] == 0.0) and np.any(starts[0, 2:] != 0.0)  # others go on


def test_friction_of_the_load_begins_as_a_share_of_the_motors():
    """Both reverse nearly together: beside all of the motor's friction none of the load's has room."""
    drive = cdf.TwoMass(1.0, 2.0, [cdf.Coulomb(4.0), cdf.Compliance(900.0, 2.0)], measured="motor")
    t = np.arange(800) * 5e-3
    force = 9.0 * np.sin(5.0 * t)
    run = np.asarray(cdf.event_response(drive, t, force, input_hold="zoh").outputs)[0]
    data = prepare(drive, [cdf.Measurement(t, force, run + 1e-5 * np.sin(77 * t), input_hold="zoh")])
    screen = Screen(data.fit(drive, (), iterations=0), data)
    starts = list(regressed(cdf.LoadFriction, screen))
    assert [dict(s.values)["coulomb.level"] + s.effect.level for s in starts] == pytest.approx([4.0] * 3)
    assert not list(regressed(cdf.Gravity, screen)) and not list(regressed(cdf.Stribeck, screen))


def test_what_takes_more_than_noise_is_not_taken_for_it():
    """With a joint the error halves where its states absorb a tenth of the noise: something is missing."""

    def fit(rmse, left):
        return SimpleNamespace(rmse=rmse, sensitivity=SimpleNamespace(left_by_starts=lambda noise: left))

    def only_noise(rmse, left):
        base = CandidateFit("", fit(1.0, 0.8))
        at = SimpleNamespace(base=base, noise_model=lambda noise: noise)
        asked = SimpleNamespace(at=at)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(structure_search, "ranked", lambda base, found: ((), None))
            return StructureSearch.takes_only_noise(asked, CandidateFit("joint", fit(rmse, left)))

    assert only_noise(0.95, 0.72) and only_noise(0.5, 0.2) and not only_noise(0.55, 0.72)
