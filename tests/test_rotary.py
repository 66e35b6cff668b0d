"""A machine that turns is the same machine, in words and units of rotation."""

import re

import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.blocks.coordinates import AXIS, LINE, moving_in
from ctrl_df.blocks.effect import stated_parameters
from ctrl_df.identify.arguments import check_limits, limit_units
from ctrl_df.identify.experiment import next_experiment
from ctrl_df.units import dimension, over, si_unit, turning

EFFECTS = [
    cdf.Coulomb(5.0),
    cdf.Viscous(0.5),
    cdf.Stribeck(6.0, 0.05),
    cdf.CubicSpring(30.0),
    cdf.HardStop(2.0),
]
T = np.linspace(0, 2, 400)
U = 20 * np.sin(7 * T)


def test_same_motion_other_words():
    line, axis = cdf.Mass(2.0, EFFECTS), cdf.Inertia(2.0, EFFECTS)
    a, b = (cdf.event_response(m, T, U) for m in (line, axis))
    assert np.array_equal(a.outputs, b.outputs) and a.events[0].kind == b.events[0].kind
    assert (axis.input_labels, axis.output_labels) == (["torque"], ["angle", "speed"])
    assert axis.signals == {"torque": "N m", "angle": "rad", "speed": "rad/s"}
    assert list(axis.parameters)[1:] == list(line.parameters)[1:]


def test_every_parameter_of_the_library_has_its_unit():
    units = {
        "N": "N m", "m": "rad", "m/s": "rad/s", "N/m": "N m/rad", "N s/m": "N m s/rad", "s": "s", "": "",
        "N/m^3": "N m/rad^3", "N s^2/m^2": "N m s^2/rad^2", "kg": "kg m^2", "rad": "rad",
        "N/A": "N m/A", "V/A": "V/A",
    }  # fmt: skip
    for k, p in cdf.Mass(1.0, EFFECTS).parameters.items():
        if k != "mass":
            assert cdf.Inertia(1.0, EFFECTS).parameters[k].unit == units[p.unit]
    for cls in cdf.effect_library().values():
        for field in cls.__dataclass_fields__.values():
            if "parameter" in field.metadata:
                assert AXIS.unit_of(field.metadata["parameter"]["unit"]) in units.values()
    assert cdf.Inertia(1.0).parameters["inertia"].unit == "kg m^2"


def test_limit_cycle_and_families_are_those_of_the_line():
    gains = cdf.pid(2000, 44250, 130)
    line, axis = cdf.friction_mass(9, 5, 0.5), cdf.Inertia(9, [cdf.Coulomb(5), cdf.Viscous(0.5)])
    a, b = (cdf.find_limit_cycle(cdf.closed_loop(gains, m), (11, 13.8)) for m in (line, axis))
    assert (
        a.omega == b.omega
        and a.loop.output_labels == ["x", "F"]
        and b.loop.output_labels == ["angle", "torque"]
    )
    family = cdf.describing_function_family(axis, [20.0, 30.0], [9.0, 10.0])
    assert np.array_equal(family.N, cdf.describing_function_family(line, [20.0, 30.0], [9.0, 10.0]).N)


def test_two_inertias():
    gap = cdf.Backlash(0.01, 0.2)
    line, axis = cdf.TwoMass(1.0, 8.0, [gap]), cdf.TwoInertias(1.0, 8.0, [gap])
    assert axis.output_labels == ["angle", "speed", "angle_motor", "speed_motor"]
    a, b = (cdf.describing_function_family(m, [20.0], [9.0]) for m in (line, axis))
    assert np.array_equal(a.N, b.N)
    assert axis.parameters["load_inertia"].unit == "kg m^2" and axis.parameters["backlash.gap"].unit == "rad"


def test_names_stay():
    for block in (cdf.Mass(1.0, name="axis"), cdf.Inertia(1.0, name="axis")):
        changed = block.with_effect(cdf.Coulomb(1.0)).with_parameters({"coulomb.level": 2.0})
        assert changed.name == changed.without_effect("coulomb").with_measured("motor").name == "axis"


def test_refusals_speak_of_rotation():
    with pytest.raises(ValueError, match=r"inertia.*kg m\^2"):
        cdf.Inertia(0.0)
    geared = cdf.TwoInertias(1.0, 8.0, [cdf.Backlash(0.01), cdf.Coulomb(0.5)])
    with pytest.raises(ValueError, match="unit rad.*got gap=-1"):
        geared.with_parameters({"backlash.gap": -1})
    with pytest.raises(TypeError, match=r"\[N m\]"):
        geared.with_parameters({"coulomb.level": "half"})
    with pytest.raises(ValueError, match="unit m.*got gap=-1"):
        cdf.TwoMass(1.0, 8.0, [cdf.Backlash(0.01)]).with_parameters({"backlash.gap": -1})


@pytest.mark.parametrize("closed", [False, True])
def test_starts_are_refused_in_words_of_rotation(closed):
    gear, arm = cdf.TwoInertias(0.001, 0.02, [cdf.Backlash(0.01)]), cdf.Inertia(0.001, [cdf.HardStop(1.0)])
    if closed:
        gear, arm = (cdf.closed_loop(cdf.pid(1.0, 0.0, 0.1), m) for m in (gear, arm))
    with pytest.raises(ValueError, match=r"0 <= angle_motor - angle <= 0.01 rad"):
        cdf.event_response(gear, T, 0.1, [0, 0, 0.5, 0])
    with pytest.raises(ValueError, match=r"initial angle of .* its stops -1 and 1 rad"):
        cdf.event_response(arm, T, 0.1, [3.0, 0])


def test_records_are_refused_in_words_of_rotation():
    driven = cdf.Measurement(T, U, np.sin(T), input_unit="N m", output_unit="rad")
    moved = cdf.Measurement(T, np.sin(T), U, input_unit="rad", output_unit="N m")
    hinge = cdf.Massless(rotary=True).with_effect(cdf.Viscous(0.2))
    with pytest.raises(ValueError, match="torque in, motion out give the block an inertia"):
        cdf.compare(hinge, driven)
    with pytest.raises(ValueError, match="with records with torque as input"):
        cdf.compare(hinge, [moved, driven])


def test_sentences_speak_of_rotation():
    said = "A force bound to a position; forces grow with the mass, masses and velocities."
    assert LINE.text(said) == said
    assert AXIS.text(said) == (
        "A torque bound to an angle; torques grow with the inertia, inertias and speeds."
    )
    assert AXIS.text("constant_force is forced") == "constant_force is forced"
    assert moving_in("rad") is moving_in("rad/s") is AXIS and moving_in("m") is LINE
    for effect in cdf.effect_library().values():
        assert not re.search(r"\b(force|position|velocity|mass)", AXIS.text(effect.shows)), effect
        stated = dict(stated_parameters(effect))
        assert not any(re.search(r"\b[xv]\b", spec["meaning"]) for spec in stated.values()), effect


@pytest.mark.parametrize("unit", ["furlong", "N//m", "N/", "N/m^x", "(m", "m s)", "5", "m^"])
def test_unknown_units_are_refused(unit):
    with pytest.raises(ValueError, match="a unit must be one of"):
        si_unit(unit)
    with pytest.raises(ValueError, match="a unit must be one of"):
        cdf.parameter(unit)


@pytest.mark.parametrize(
    ("unit", "factor", "si"),
    [
        ("N m s/rad", 1.0, "N m s/rad"), ("mN·m/A", 1e-3, "N m/A"), ("N-m", 1.0, "N m"),
        ("N*s**2/m**2", 1.0, "N s^2/m^2"),
        ("V/(rad/s)", 1.0, "V s/rad"), ("V s/rad", 1.0, "V s/rad"), ("m/(N s)", 1.0, "m/(N s)"),
        ("1/s", 1.0, "1/s"),
        ("N/mm^3", 1e9, "N/m^3"), ("stone", None, None), ("kHz", 1e3, "1/s"), ("m/s/s", 1.0, "m/s^2"),
        ("N s^0.5/mm^0.5", 1e3**0.5, "N s^0.5/m^0.5"), ("N.m^1.50", 1.0, "N m^1.5"),
        ("m^-1.5", 1.0, "1/m^1.5"),
        ("m^0.333333", 1.0, "m^0.333333"), ("m^0.123", None, None), ("m^1/2", None, None),
    ],
)  # fmt: skip
def test_products_of_units(unit, factor, si):
    if si is None:
        with pytest.raises(ValueError, match="a unit must be one of"):
            si_unit(unit)
    else:
        assert si_unit(unit) == (pytest.approx(factor), si)
        assert si_unit(si) == (1.0, si)


def test_a_third_of_a_power_three_times_is_a_whole_one():
    assert dimension("m^0.33333 m^0.33333 m^0.33333") == {"m": 1}
    assert turning("N s^0.5/m^0.5") == "N m s^0.5/rad^0.5"


def test_dimensions():
    assert dimension("N s^2/m^2") == {"N": 1, "s": 2, "m": -2}
    assert (
        over("m", "N s") == "m/(N s)"
        and over("rad", "N m") == "rad/(N m)"
        and turning("m/(N s)") == "rad/(N m s)"
    )


def test_a_diagnosis_is_that_of_the_line_in_units_of_rotation():
    rng, t = np.random.default_rng(0), np.arange(0, 4, 8e-3)
    u = sum(0.3 * np.sin(w * t + p) for w, p in zip((2.1, 5.3, 9.7, 17.0), rng.uniform(0, 6, 4), strict=True))
    noise = rng.normal(size=t.size)
    found = []
    for cls, units in ((cdf.Mass, {}), (cdf.Inertia, dict(input_unit="N m", output_unit="rad"))):
        true = cls(0.02, [cdf.Coulomb(0.05), cdf.Viscous(0.03), cdf.LinearSpring(0.4)])
        y = np.asarray(cdf.event_response(true, t, u, input_hold="zoh").outputs)[0]
        data = cdf.Measurement(t, u, y + 1e-3 * y.std() * noise, **units)
        model = cls(0.022, [cdf.Coulomb(0.04), cdf.Viscous(0.04)])
        found.append(cdf.diagnose(model, data, candidates=["linear_spring"]))
    line, axis = found
    compared = cdf.compare(model, data)
    assert line.best.id == axis.best.id == "linear_spring" and line.verdict == axis.verdict
    assert axis.best.evidence == pytest.approx(line.best.evidence, rel=1e-3)
    assert "N m/rad" in axis.explanation and "N/m" not in axis.explanation
    assert axis.best.model.parameters["inertia"].value == pytest.approx(0.02, rel=5e-3)
    told = " ".join(compared.places) + compared.missing_force.summary() + axis.explanation
    assert "error proportional to angle" in told and "torque recorded" in told
    assert not re.search(r"\b(force|position|velocity|F|v|N/m)\b", told)
    ax = compared.missing_force.plot("velocity").axes[0, 0]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("speed [rad/s]", "missing torque [N m]")


def spring_unknown(dt):
    """A record of a shaft on a spring, sampled every `dt` [s], and a model without the spring."""
    t = np.arange(0, 4, dt)
    u = sum(0.3 * np.sin(w * t + w) for w in (2.1, 5.3, 9.7, 17.0))
    true = cdf.Inertia(0.02, [cdf.Coulomb(0.05), cdf.Viscous(0.03), cdf.LinearSpring(0.4)])
    y = np.asarray(cdf.event_response(true, t, u, input_hold="zoh").outputs)[0]
    noise = 1e-3 * y.std() * np.random.default_rng(0).normal(size=t.size)
    record = cdf.Measurement(t, u, y + noise, input_unit="N m", output_unit="rad")
    model = cdf.Inertia(0.022, [cdf.Coulomb(0.04), cdf.Viscous(0.04)])
    return record, model


def test_what_nothing_explains_is_said_in_torques():
    """Over the whole library's silence: the free torques that fit what remains."""
    record, model = spring_unknown(8e-3)
    found = cdf.diagnose(model, record, candidates=["quadratic_drag"])
    assert found.verdict == "unknown" and "behaves like a torque" in found.remains


def test_limits_of_an_experiment_are_those_of_the_motion():
    turning, driven = cdf.Inertia(0.02), cdf.Inertia(0.02, [cdf.TorqueConstant(0.1)])
    assert limit_units(cdf.Mass(1.0)) == {"force": "N", "stroke": "m"}
    assert (
        limit_units(turning) == limit_units(cdf.TwoInertias(0.01, 0.02)) == {"torque": "N m", "angle": "rad"}
    )
    assert limit_units(driven) == {"current": "A", "angle": "rad"}
    assert check_limits("diagnose", turning, {"torque": 2, "angle": 0.5}) == {"torque": 2.0, "angle": 0.5}
    assert check_limits("diagnose", turning, None) == {}
    with pytest.raises(ValueError, match=r"limits out of torque, angle; got 'force'"):
        check_limits("diagnose", turning, {"force": 2})
    with pytest.raises(ValueError, match=r"torque > 0 .*N m"):
        check_limits("diagnose", turning, {"torque": -2})
    with pytest.raises(ValueError, match=r"limits out of force, stroke; got 'angle'"):
        check_limits("diagnose", cdf.Mass(1.0), {"angle": 2})


def test_an_experiment_keeps_limits_of_rotation():
    record, model = spring_unknown(8e-3)
    limits = {"torque": 0.5, "angle": 0.5}
    found = cdf.diagnose(model, record, candidates=["linear_spring"], limits=limits)
    for given, expected in ((dict(), 0.5), (dict(torque=0.3), 0.3)):
        plan = next_experiment(found, **given)
        assert plan.force <= expected and plan.stroke <= 0.5
        assert "N m" in plan.reason and " rad " in plan.reason
    with pytest.raises(ValueError, match=r"leaves the range of ±1e-09 rad \(angle\).* N m"):
        next_experiment(found, angle=1e-9)
    with pytest.raises(ValueError, match="next_experiment needs limits out of torque, angle"):
        next_experiment(found, stroke=1.0)
