"""Forces and friction on the load of two bodies: their physics, and a joint found in front of a weight."""

import math
import pickle

import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.identify.fits.attempts import as_divided
from ctrl_df.identify.starting.extend import divisions
from ctrl_df.model_file import read_model

GEAR = [cdf.Viscous(0.3), cdf.Coulomb(0.2), cdf.Gravity(2.0)]


def test_an_effect_says_on_which_body_it_acts():
    spring = cdf.LinearSpring(300.0, side="load")
    assert repr(spring) == "LinearSpring(stiffness=300.0, center=0.0, side='load')"
    assert repr(cdf.LinearSpring(300.0)) == "LinearSpring(stiffness=300.0, center=0.0)"
    assert spring != cdf.LinearSpring(300.0) and pickle.loads(pickle.dumps(spring)) == spring
    assert spring.replace(stiffness=2.0) == cdf.LinearSpring(2.0, side="load")
    drive = cdf.TwoMass(1.0, 2.0, [spring, cdf.Backlash(0.01)])
    assert drive.with_parameters({"linear_spring.stiffness": 5.0}).effects[0].side == "load"
    assert drive.parameters["linear_spring.stiffness"].meaning == "spring stiffness, on the load"
    assert cdf.Mass(1.0, [spring]).parameters["linear_spring.stiffness"].meaning == "spring stiffness"


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda: cdf.Viscous(1.0, side="arm"), "side='motor' or 'load'; got 'arm'"),
        (lambda: cdf.Viscous(1.0, side=None), "side='motor' or 'load'; got None"),
        (lambda: cdf.Backlash(0.1, side="load"), "takes no side but the motor's; got 'load'"),
        (lambda: cdf.InputDelay(0.1, side="load"), "takes no side but the motor's; got 'load'"),
    ],
)
def test_no_other_side_is_accepted(made, words):
    with pytest.raises(ValueError, match=words):
        made()


def test_a_parameter_has_a_name_of_its_own():
    with pytest.raises(ValueError, match="names of their own; got 'side', which every effect has"):

        class Shaft(cdf.Effect):
            side: float = cdf.parameter("N/m")


def test_forces_on_the_load_are_those_of_the_linear_two_mass_system():
    m1, m2, k, c, kl, b, w = 8.0, 1.5, 900.0, 2.0, 120.0, 0.7, 9.0
    drive = cdf.TwoMass(
        m2, m1, [cdf.Compliance(k, c), cdf.LinearSpring(kl, side="load"), cdf.Viscous(b, side="load")]
    )
    s = 1j * w
    joint = k + c * s
    load = m1 * s**2 + b * s + kl + joint
    exact = joint / (load * (m2 * s**2 + joint) - joint**2)
    assert cdf.describing_function(drive, 2.0, w) == pytest.approx(exact, rel=1e-6)
    a = np.asarray(drive.dynamics(0.0, [0.1, 0.3, 0.2, -0.4], [1.5])).ravel()
    pull = k * 0.1 + c * -0.7
    assert a[1] == pytest.approx((pull - kl * 0.1 - b * 0.3) / m1)
    assert a[3] == pytest.approx((1.5 - pull) / m2)


def test_gravity_on_the_load_closes_the_gap():
    """Hung at a quarter turn with the motor held still, the arm falls through the gap and onto its face."""
    arm = cdf.TwoInertias(0.5, 1.0, [cdf.Gravity(3.0, side="load"), cdf.Coulomb(50.0), cdf.Backlash(0.2)])
    t = np.linspace(0.0, 2.0, 201)
    fall = cdf.event_response(arm, t, 0.0, initial_state=[np.pi / 2, 0.0, np.pi / 2 + 0.1, 0.0])
    angle, _, motor, _ = np.asarray(fall.outputs)
    first = t < 0.2
    assert angle[first] == pytest.approx(np.pi / 2 - 1.5 * t[first] ** 2, abs=1e-4)
    assert angle[-1] == pytest.approx(motor[-1] - 0.2, abs=1e-9) and motor[-1] < np.pi / 2 + 0.1


def test_of_one_body_both_sides_are_the_same():
    motor, load = (
        cdf.Mass(2.0, [cdf.LinearSpring(50.0, side=s), cdf.Viscous(1.0)]) for s in ("motor", "load")
    )
    t = np.linspace(0.0, 1.0, 50)
    a, b = (np.asarray(cdf.event_response(m, t, np.sin(9 * t)).outputs) for m in (motor, load))
    assert np.array_equal(a, b)


def test_a_model_file_tells_the_side(tmp_path):
    path = tmp_path / "arm.toml"
    told = (
        '[plant]\nkind = "two_inertias"\nmotor_inertia = 1\nload_inertia = 1\n[effects.gravity]\ntorque = 2\n'
    )
    path.write_text(told + 'side = "load"\n')
    assert read_model(path).plant.effects == (cdf.Gravity(2.0, side="load"),)
    path.write_text(told + 'side = "arm"\n')
    with pytest.raises(ValueError, match="takes side='motor' or 'load'; got 'arm'"):
        read_model(path)


def test_where_a_joint_is_new_weights_and_friction_may_act_on_the_load():
    def sides(*effects):
        return ["".join(e.side[0] for e in b.effects) for b in divisions(cdf.Inertia(1.0, effects))]

    assert sides(*GEAR) == ["mml", "lml", "mll", "lll"]
    assert sides(*GEAR[:2]) == ["lm", "ml", "ll"]
    assert sides(cdf.Viscous(0.3)) == ["l"]
    assert sides(cdf.PositionRipple(0.1, 0.2)) == []  # of the motor, as its magnets are
    assert sides(cdf.Viscous(0.3, side="load"), cdf.Coulomb(0.2)) == ["ll"]


def test_friction_whose_class_states_its_side_stays_there():
    rigid = cdf.Inertia(1.0, [cdf.Viscous(0.3), cdf.LoadFriction(0.2)])
    joined = rigid.with_effect(cdf.Backlash(0.1))
    (only,) = divisions(rigid)
    assert [e.side for e in as_divided(joined, only).effects] == ["load", "load", "motor"]


def _record(truth, seed):
    """Return the motor's motion while a controller swings the arm, with noise, and the torque held."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, 6.0, 4e-3)
    turns = 0.8 * np.sin(2.1 * t + seed) + 0.3 * np.sin(7.3 * t) + 0.1 * np.sin(19.0 * t)
    loop = cdf.closed_loop(cdf.pid(60.0, 0.0, 4.0), truth, dt=4e-3)
    start = [turns[0] - 0.006, 0.0, turns[0], 0.0]
    angle, torque = np.asarray(
        cdf.event_response(loop, t, turns, initial_state=[*start, 0.0, 0.0][: loop.nstates]).outputs
    )
    return cdf.Measurement(
        t,
        torque,
        angle + 1e-4 * rng.standard_normal(t.size),
        input_unit="N m",
        output_unit="rad",
        input_hold="zoh",
    )


def test_a_gap_is_found_in_front_of_an_arm():
    """The weight keeps a gear's gap closed but for fast reversals: with it on the motor no gap fits."""
    arm = [cdf.Viscous(0.12), cdf.Coulomb(0.35)]
    gear = cdf.TwoInertias(
        0.02, 0.11, [*arm, cdf.Gravity(4.2, side="load"), cdf.Backlash(0.012, 0.3)], measured="motor"
    )
    rigid = cdf.Inertia(0.12, [*arm, cdf.Gravity(3.9)], measured="motor")
    found = cdf.diagnose(
        rigid, _record(gear, 1), holdout=_record(gear, 2), candidates=["backlash", "compliance", "hysteresis"]
    )
    assert found.verdict == "effect" and found.best.id == "backlash"
    assert found.best.model.named_effects["gravity"].side == "load"
    assert found.best.parameters["gap"] == pytest.approx(0.012, rel=0.05)
    assert "With backlash gravity acts on the load." in found.explanation


def test_a_gap_is_found_in_front_of_a_load_in_oil():
    """What drags the load holds the faces of a gap together while it moves; on the motor it does not."""
    dry = cdf.Coulomb(0.2)
    gear = cdf.TwoInertias(
        0.03, 0.1, [dry, cdf.Viscous(0.8, side="load"), cdf.Backlash(0.02, 0.4)], measured="motor"
    )
    rigid = cdf.Inertia(0.13, [dry, cdf.Viscous(0.7)], measured="motor")
    found = cdf.diagnose(
        rigid, _record(gear, 1), holdout=_record(gear, 2), candidates=["backlash", "compliance"]
    )
    assert found.verdict == "effect" and found.best.id == "backlash"
    assert [found.best.model.named_effects[k].side for k in ("coulomb", "viscous")] == ["motor", "load"]
    assert found.best.parameters["gap"] == pytest.approx(0.02, rel=0.05)
    assert "With backlash viscous acts on the load." in found.explanation


def test_both_bodies_have_viscous_friction_of_their_own():
    """A drive of two masses has bearings on either side; a block took one viscous friction."""
    from scipy.integrate import solve_ivp

    effects = [cdf.Viscous(12), cdf.QuadraticDrag(3), cdf.Viscous(25, side="load"), cdf.Compliance(8e4, 5)]
    block = cdf.TwoMass(1.5, 4.2, effects)
    assert block.parameters["viscous.coefficient"].value == 12
    assert block.parameters["viscous_2.coefficient"].value == 25

    def rates(t, z):
        x, v, x_motor, v_motor = z
        joint = 8e4 * (x_motor - x) + 5 * (v_motor - v)
        own = 20 * math.sin(8 * t) - 12 * v_motor - 3 * v_motor * abs(v_motor)
        return [v, (joint - 25 * v) / 4.2, v_motor, (own - joint) / 1.5]

    t = np.linspace(0, 2, 400)
    found = cdf.event_response(block, t, lambda t: 20 * np.sin(8 * t))
    true = solve_ivp(rates, (0, 2), [0.0] * 4, "LSODA", t, rtol=1e-10, atol=1e-12).y
    np.testing.assert_allclose(found.states, true, atol=1e-7 * np.max(np.abs(true)))  # 3e-8
    with pytest.raises(ValueError, match="one Viscous on a side; got two on the load"):
        block.with_effect(cdf.Viscous(1, side="load"))
