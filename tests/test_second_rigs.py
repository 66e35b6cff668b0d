"""The second generator of rigs: physics against SciPy, by hand, by shorter steps; always the same rigs."""

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))

import rigs_second as rigs
import second_physics as physics
import second_signals as signals
from second_table import share, table

import ctrl_df as cdf
from ctrl_df.blocks.effects import (
    Compliance,
    Coulomb,
    CubicSpring,
    InputDelay,
    InputSaturation,
    LinearSpring,
    QuadraticDrag,
    Stribeck,
)
from ctrl_df.identify.ladder.alternatives import begun_beside
from ctrl_df.identify.results.diagnosis import Baseline
from ctrl_df.identify.selection.structure_search import StructureSearch

TICK = 0.01
T = TICK * np.arange(200)
FORCE = 30 * np.sin(6 * T) + 8 * np.sin(17 * T)


def machine(**values):
    p = physics.blank()
    for name, value in values.items():
        p[physics.AT[name]] = value
    return p


def run(p, force=FORCE, start=(0.0,) * 8, fineness=1.0, linear=True, **other):
    h = physics.longest_step(p, TICK, 3.0, 40.0) / fineness
    late_in, late_out = other.get("late_in", 0.0), other.get("late_out", 0.0)
    return physics.run(
        p, np.array(start), force, other.get("closed", False), TICK, h, linear, late_in, late_out,
        other.get("load", False), other.get("pid", np.zeros(6)), np.zeros(len(force)), 0.0,
    )  # fmt: skip


def scipy_says(rates, states=2):
    return solve_ivp(
        rates, (0, T[-1]), np.zeros(states), "DOP853", T, rtol=1e-11, atol=1e-12, max_step=TICK
    ).y


def u(t):
    i = min(int(t / TICK), len(T) - 2)
    return FORCE[i] + (t / TICK - i) * (FORCE[i + 1] - FORCE[i])


SMOOTH = {
    "spring": (dict(spring=20.0, viscous=1.0), lambda t, x, v: -20 * x - v),
    "cubic": (dict(cubic=9.0, viscous=1.0), lambda t, x, v: -9 * x**3 - v),
    "drag": (dict(drag=2.0, constant=3.0), lambda t, x, v: 3 - 2 * v * abs(v)),
    "uneven": (dict(uneven_viscous=1.5, viscous=2.0), lambda t, x, v: -2 * v - 0.75 * abs(v)),
    "ripple": (
        dict(ripple=5.0, ripple_wave=0.4, ripple_phase=0.3),
        lambda t, x, v: 5 * np.sin(2 * np.pi * x / 0.4 + 0.3),
    ),
    "gravity": (dict(weight=15.0, hangs_at=0.5), lambda t, x, v: -15 * np.sin(x - 0.5)),
    "eddy": (dict(eddy=20.0, eddy_speed=0.6), lambda t, x, v: -20 * v / (1 + (v / 0.6) ** 2)),
    "hum": (dict(hum=6.0, hum_omega=9.0, spring=5.0), lambda t, x, v: 6 * np.sin(9 * t) - 5 * x),
    "cogging": (
        dict(cogging=8.0, cogging_wave=0.5, cogging_speed=1.0),
        lambda t, x, v: 8 * np.tanh(v) ** 2 * np.sin(4 * np.pi * x),
    ),
    "grease": (
        dict(greasy=3.0, greasy_wave=0.7),
        lambda t, x, v: -3 * v * (1 + np.sin(2 * np.pi * x / 0.7)),
    ),
}


@pytest.mark.parametrize("name", SMOOTH)
def test_smooth_machines_against_scipy(name):
    values, law = SMOOTH[name]
    place, speed, *_ = run(machine(**values))
    x, v = scipy_says(lambda t, y: [y[1], u(t) + law(t, *y)])
    assert np.max(np.abs(place - x)) < 2e-6 * np.ptp(x)
    assert np.max(np.abs(speed - v)) < 2e-6 * np.ptp(v)


def test_lag_bristle_and_pad_against_scipy():
    lag = run(machine(lag=0.05, spring=10.0))[0]
    x = scipy_says(lambda t, y: [y[1], y[2] - 10 * y[0], (u(t) - y[2]) / 0.05], 3)[0]
    assert np.max(np.abs(lag - x)) < 1e-6 * np.ptp(x)

    def lugre(t, y):
        rate = y[1] - 400 * abs(y[1]) * y[2] / 5
        return [y[1], u(t) - 400 * y[2] - 12 * rate, rate]

    bristle = run(machine(coulomb=5.0, bristle=400.0, bristle_damping=12.0))[0]
    assert np.max(np.abs(bristle - scipy_says(lugre, 3)[0])) < 1e-6

    def bouc(t, y):
        return [y[1], u(t) - 6 * y[2], (y[1] - abs(y[1]) * abs(y[2]) * y[2]) / 0.2]

    pad = run(machine(pad=6.0, pad_stroke=0.2))[0]
    assert np.max(np.abs(pad - scipy_says(bouc, 3)[0])) < 1e-5


def test_two_bodies_on_a_shaft_against_scipy():
    p = machine(
        motor=0.6, load=0.4, joint=physics.SPRUNG, joint_stiffness=90.0, joint_damping=0.3, spring=8.0
    )

    def rates(t, y):
        pull = 90 * (y[0] - y[2]) + 0.3 * (y[1] - y[3])
        return [y[1], (u(t) - pull - 8 * y[0]) / 0.6, y[3], pull / 0.4]

    x = scipy_says(rates, 4)
    assert np.max(np.abs(run(p, load=True)[0] - x[2])) < 1e-5
    assert np.max(np.abs(run(p, load=True, fineness=4.0)[0] - x[2])) < 1e-7
    assert np.max(np.abs(run(p)[0] - x[0])) < 1e-5


def test_dry_friction_by_hand():
    level, push = 4.0, np.where(TICK * np.arange(400) < 1.0, 9.0, 0.0)
    place, speed, *_ = run(machine(coulomb=level), push, linear=False)
    assert speed[100] == pytest.approx(5.0, abs=1e-12)  # (9 - 4) N / 1 kg for a second
    assert place[-1] == pytest.approx(2.5 + 25.0 / 8.0, abs=1e-9)  # then braked by 4 N
    assert speed[-1] == 0.0
    held = run(machine(coulomb=level, breakaway=9.5), push, linear=False)[0]
    assert np.all(held == 0.0)


def test_impacts_by_hand():
    # thrown at 2 m/s over a gap of a metre, at once after the load has stopped counting
    p = machine(motor=1.0, load=3.0, joint=physics.LOOSE, gap=1.0, gap_restitution=0.5)
    _, _, _, states = run(p, np.zeros(100), (0.0, 2.0, 0.0, 2.0, 0, 0, 0, 0), linear=False)
    motor, apart = states[-1, 1], states[-1, 3]
    assert motor == pytest.approx((2.0 - 3.0 * 0.5 * 2.0) / 4.0, abs=1e-12)
    assert apart == pytest.approx(-1.0, abs=1e-12)
    bounced = run(machine(stop_high=1.0, stop_low=-1.0, stop_restitution=0.5), np.zeros(100),
                  (0.0, 2.0, 0, 0, 0, 0, 0, 0), linear=False)  # fmt: skip
    assert bounced[1][-1] == pytest.approx(-1.0, abs=1e-12)
    assert bounced[0][-1] == pytest.approx(1.0 - 0.49, abs=1e-9)


def test_delays_shift():
    p = machine(spring=15.0, viscous=1.0)
    plain, late = run(p)[0], run(p, late_in=0.037)[0]
    seen = run(p, late_out=0.037)[0]
    assert np.max(np.abs(late - seen)) < 1e-9
    whole = run(p, late_in=0.04)[0]
    assert np.max(np.abs(whole[4:] - plain[:-4])) < 1e-9


LOOSE = dict(motor=0.6, load=0.4, joint=physics.LOOSE, gap=0.1)
ROUGH = [
    dict(coulomb=5.0), dict(coulomb=5.0, static=9.0, stribeck_speed=0.1),
    dict(coulomb=3.0, uneven_coulomb=2.0), dict(coulomb=3.0, place=2.0, place_wave=0.4),
    dict(coulomb=2.0, carried=0.2), dict(dead=4.0, coulomb=1.0),
    dict(**LOOSE, gap_restitution=0.3, coulomb=3.0, load_coulomb=1.0), dict(**LOOSE, coulomb=3.0),
    dict(stop_high=0.4, stop_low=-0.4, stop_restitution=0.4, coulomb=2.0),
]  # fmt: skip


@pytest.mark.parametrize("values", ROUGH, ids=lambda v: "+".join(v))
def test_shorter_steps_change_nothing(values):
    p = machine(**values)
    coarse, fine = run(p, linear=False)[0], run(p, linear=False, fineness=4.0)[0]
    assert np.max(np.abs(coarse - fine)) < 3e-6 * np.ptp(fine)


def test_a_controller_follows():
    pid = np.array([400.0, 600.0, 30.0, 0.004, 1, 1e9])
    place, _, force, _ = run(
        machine(coulomb=2.0, viscous=1.0), np.sin(2 * T), closed=True, pid=pid, linear=False
    )
    assert np.std(place - np.sin(2 * T)) < 0.15
    again = run(machine(coulomb=2.0, viscous=1.0), force, linear=False)[0]
    assert np.max(np.abs(again - place)) < 1e-9  # driven by its own force it does the same


@pytest.mark.parametrize("kind, number", [("single", 9), ("nothing", 3), ("double", 10)])
def test_a_rig_is_the_same_for_ever(kind, number):
    a, b = rigs.rig(kind, number), rigs.rig(kind, number)
    assert a.hidden == b.hidden and a.baseline == b.baseline and a.truth == b.truth
    assert np.array_equal(a.train.y, b.train.y) and np.array_equal(a.held.u, b.held.u)


def test_what_is_hidden_shows_beside_the_rest():
    # as first drawn the stop stood where the machine no longer came once drag acted, too
    rig = rigs.rig("double", 222)
    stop = next(e for e in rig.truth.effects if e.id == "hard_stop")
    assert np.max(np.abs(rig.train.y)) >= stop.limit


def test_every_effect_is_hidden_once_in_a_round():
    assert len(rigs.EFFECTS) == 29
    first = rigs.rig("single", 0)
    assert first.hidden == ("viscous",) and "viscous" in {e.id for e in first.truth.effects}
    off = [p.value / first.truth.parameters[k].value for k, p in first.baseline.parameters.items()]
    assert all(0.69 < x < 1.31 for x in off)


@pytest.mark.parametrize("kind", ["white", "coloured", "pink", "encoder"])
def test_noise_has_unit_size(kind):
    assert np.std(signals.noise(kind, np.random.default_rng(0), 4000)) == pytest.approx(1.0)


@pytest.mark.parametrize("kind", signals.FORCES)
def test_forces_leave_no_impulse(kind):
    t = 0.02 * np.arange(1000)
    s = signals.excitation(kind, np.random.default_rng(1), t, False)
    push = np.cumsum(s) * 0.02
    assert np.max(np.abs(s)) == pytest.approx(1.0)
    assert abs(np.polyfit(t, push, 1)[0]) < 1e-9


def test_tables():
    rows = [
        dict(job=["single", 0], verdict="effect", first=True, three=True, said=0.99, ranking=[]),
        dict(job=["single", 1], stopped=300.0),
        dict(job=["nothing", 0], verdict="effect", said=0.999, ranking=[]),
    ]
    text = table(rows)
    assert "| one hidden, all: first | 95 % | 1/2 = 50%" in text
    assert "| said at 95 % or more: right | 95 % | 1/2 = 50%" in text
    assert "| single 1:" in text and "stopped" in text
    assert share(19, 20).startswith("19/20 = 95% (76% to 99%)")


def test_a_rival_begins_where_it_acts_as_what_it_replaces():
    # Coulomb friction begun by itself ends 250 nats behind a Stribeck curve whose speed is never reached
    rig = rigs.rig("double", 100)
    base = rig.baseline.with_effect(CubicSpring(1.54e11))
    names = (*rig.free, "cubic_spring.stiffness")
    search = StructureSearch(base, [rig.train], [rig.held], names)
    model = base.with_effect(Stribeck(2.2e-3, 0.074))
    (rival,) = search.rivals(model, (*names, "stribeck.level", "stribeck.velocity"), [Coulomb])
    assert rival.evidence > 0
    assert rival.block.effects[-1].level == pytest.approx(2.21e-3, rel=0.05)


def test_two_effects_at_once_are_sought_where_disturbance_forces_seem_to_act():
    # of three that are missing none explains much alone: so disturbance forces look
    rig = rigs.rig("triple", 36)
    found = StructureSearch(rig.baseline, [rig.train], [rig.held], list(rig.free))
    forced = found.after(at=found.at.by_accelerations(found.free))
    assert forced.at.data.disturbed
    kinds = [LinearSpring, CubicSpring, QuadraticDrag, InputDelay, InputSaturation, Compliance, Stribeck]
    best, left = forced.pairs(kinds)[0]
    assert {e.id for e in best.effects[-2:]} <= set(rig.hidden) and left < 0.25  # 0.21


def test_a_joint_begun_beside_friction_is_the_right_one():
    # begun without the friction it ends as a soft one with hardly any load, 7,000 N/m and 0.08 of the mass
    rig = rigs.rig("double", 103)
    others = rig.baseline.with_effect(Coulomb(0.032))
    soft = Compliance(stiffness=7000.0, damping=1e-3, load_fraction=0.08)
    own = {f"compliance.{name}" for name in soft.parameters}

    def free(block):
        return (*rig.free, "coulomb.level", *(own & set(block.parameters)))

    search = StructureSearch(rig.baseline, [rig.train], [rig.held], rig.free)
    less = search.begun(others, free(others), 8)
    (joint,), errors = begun_beside(others, soft, less, search, free, [Compliance])
    assert errors(joint)[0] < 0.002  # measured: 0.0013; from where the soft one is, 0.0032
    assert joint.block.parameters["compliance.stiffness"].value == pytest.approx(184718, rel=0.1)
    assert joint.block.parameters["compliance.load_fraction"].value == pytest.approx(0.822, rel=0.1)


def test_a_true_model_of_many_minima_is_not_fitted_away_from_what_it_is():
    """A ripple under a spring: longer steps of the input, and shorter segments, led into other minima.

    The fits ended with 1.3 and 1.9 times the error of the true values.
    """
    rig = rigs.rig("double", 141)
    stated = cdf.compare(rig.truth, rig.train)
    assert cdf.refit(rig.truth, rig.train, free=list(rig.free)).nrmse <= stated.nrmse
    at = StructureSearch(rig.truth, [rig.train], [rig.held], tuple(rig.free)).at
    assert at.base.train.rmse < stated.rmse


def test_a_true_model_is_followed_to_where_it_rests_on_a_tooth():
    """A short ripple over a spring: the motion rests before a ridge or beyond it by 1e-3 of its speed.

    The fits ended with 14 times the noise on the data fitted, and with 4 times on those held out.
    """
    rig = rigs.rig("double", 183)
    free = tuple(k for k, p in rig.truth.parameters.items() if p.free and (k in rig.free or "." in k))
    found = StructureSearch(rig.truth, [rig.train], [rig.held], free)
    at = found.at
    noise = at.nearest.rmse
    assert at.base.train.rmse < 1.2 * noise
    assert at.data.fine.validate(at.base).validation_rmse < 1.2 * noise
    # over the longest segments another period is within what is known, and a fit over them ends there
    assert at.segmentations[-1].reached(at.base.train).rmse > 10 * noise
    assert found.leaves_only_noise(found.base)


def test_free_prediction_of_a_true_model_begins_where_the_machine_did():
    """Fitted all at once, initial states of an elastic joint over a short ripple end in wrong minima.

    The true model then erred by 0.3 to 3.7 %, a joint that was missing was refuted; the noise is 0.24 %.
    """
    rig = rigs.rig("triple", 27)
    found = Baseline(rig.truth, 0.0, 0.0, predicted=(rig.truth, (rig.held,))).error_by_horizon
    assert len(found.nrmse) == 5 and np.all(found.nrmse < 0.01)
    assert np.median(found.nrmse) < 0.0028  # 0.26, 0.26, 0.26, 0.27 and 0.57 %


def test_segments_left_out_lead_out_of_a_wrong_minimum():
    """A gap under a PID: restitution and inertia were 20 and 8 % off, and something seemed to be missing."""
    rig = rigs.rig("nothing", 474)
    free = list(rig.free)
    found = cdf.diagnose(rig.baseline, rig.train, holdout=rig.held, free=free, candidates=["linear_spring"])
    assert found.verdict == "none", found.explanation
    assert found.nrmse < 1.02 * cdf.compare(rig.truth, rig.train).nrmse  # 0.99 to 1.011: minima side by side
    values = found.model.parameters
    assert values["motor_inertia"].value == pytest.approx(
        rig.truth.parameters["motor_inertia"].value, rel=0.04
    )
