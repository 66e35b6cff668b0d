"""A record of other quantities than the model's is refused; what is said of it is in its own units."""

import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.identify.residuals.regions import SPEEDS, error_regions

T = 2e-3 * np.arange(600)
U = 3 * np.sin(7 * T) + np.sin(19 * T)
LINE = cdf.Mass(1.0, [cdf.Coulomb(0.5), cdf.Viscous(2.0)])
AXIS = cdf.Inertia(1.0, [cdf.Coulomb(0.5), cdf.Viscous(2.0)])
Y = np.asarray(cdf.event_response(LINE, T, U, input_hold="zoh").outputs)[0]


def record(**units):
    return cdf.Measurement(T, U, Y, name="run 7", **units)


WRONG = [
    (LINE, dict(output_unit="m/s^2"), ["gives a position [m]", "run 7", "m/s^2", "channels="]),
    (LINE, dict(output_unit="rad/s"), ["and a velocity [m/s]", "rad/s"]),
    (LINE, dict(output_unit="deg"), ["gives a position [m]", "rad"]),
    (LINE, dict(input_unit="V"), ["takes a force [N]", "run 7", "is in V", "input_unit="]),
    (LINE, dict(input_unit="N m"), ["takes a force [N]", "N m"]),
    (AXIS, {}, ["gives an angle [rad]", "is in m", "output_unit="]),
    (AXIS, dict(output_unit="deg"), ["takes a torque [N m]", "is in N"]),
    (AXIS, dict(output_unit="deg", input_unit="A"), ["takes a torque [N m]", "is in A", "TorqueConstant"]),
]

ASKED = {
    "compare": lambda model, data: cdf.compare(model, data),
    "refit": lambda model, data: cdf.refit(model, data),
    "diagnose": lambda model, data: cdf.diagnose(model, data),
    "improve": lambda model, data: cdf.improve(model, data),
}


@pytest.mark.parametrize("asked", ASKED)
@pytest.mark.parametrize(("model", "units", "words"), WRONG)
def test_other_quantities_are_refused(asked, model, units, words):
    with pytest.raises(ValueError) as refusal:
        ASKED[asked](model, record(**units))
    assert all(word in str(refusal.value) for word in words), str(refusal.value)


def test_a_table_of_other_quantities_is_refused():
    table = cdf.FrequencyMeasurement([1.0, 2.0], [1.0, 2.0], [[1, 1j], [1, 1j]], output_unit="rad")
    with pytest.raises(ValueError, match="gives a position"):
        cdf.compare(LINE, table)


@pytest.mark.parametrize(
    ("model", "units"),
    [(LINE, dict(output_unit="um", input_unit="kN")), (AXIS, dict(output_unit="arcsec", input_unit="mN m"))],
)
def test_scaled_units_are_none_of_its_business(model, units):
    assert np.isfinite(cdf.compare(model, record(**units)).nrmse)


def test_a_loop_takes_its_reference_too():
    loop = cdf.closed_loop(cdf.pid(40, 0, 4), LINE)
    reference = cdf.Measurement(T, 0.1 * U, Y, input_unit="m")
    assert np.isfinite(cdf.compare(loop, reference).nrmse)
    with pytest.raises(ValueError, match="takes a force"):
        cdf.compare(loop, cdf.Measurement(T, U, Y, input_unit="V"))


def test_regions_speak_in_units_of_rotation():
    velocity = np.gradient(Y, T)
    regions = error_regions(
        T, np.sin(40 * T) * (Y > 0), position=Y, velocity=velocity, force=U, units=("rad", "N m")
    )
    labels = {kind: [r.label for r in regions.of(kind)] for kind in ("position", "load", *SPEEDS)}
    assert all(label.endswith(" rad") for label in labels["position"])
    assert all(label.endswith(" N m") for label in labels["load"])
    assert all(len(labels[kind]) == 1 and labels[kind][0].endswith(" rad/s") for kind in SPEEDS)
    assert ["<" in labels[kind][0] for kind in SPEEDS] == [True, True, False]


@pytest.mark.parametrize(("load", "motor"), [("x", "x_motor"), ("angle", "angle_motor")])
def test_motor_and_load_are_records_of_their_own(load, motor):
    with pytest.raises(ValueError, match=f"one body; got output '{motor}'.*as '{load}'.*measured='motor'"):
        cdf.Measurement(T, U, outputs={load: Y, motor: Y})
