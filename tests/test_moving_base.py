"""Motion of a base in, motion of the mass on it out: beside an independent integrator, in absolute places."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import ctrl_df as cdf

TIMES = np.arange(0.0, 6.0, 0.004)
PARTS = ((0.6, 0.02, 0.3), (1.3, 0.012, 2.0), (2.9, 0.005, 4.1), (6.1, 0.002, 1.2))
MASS, STIFFNESS, DAMPING, CUBIC = 2.0, 300.0, 6.0, 4e5
NOMINAL = cdf.Mass(MASS).with_effect(cdf.LinearSpring(270.0)).with_effect(cdf.Viscous(4.5))
TRUE = (
    cdf.Mass(MASS)
    .with_effect(cdf.LinearSpring(STIFFNESS))
    .with_effect(cdf.Viscous(DAMPING))
    .with_effect(cdf.CubicSpring(CUBIC))
)


def base(order, t=TIMES):
    """Return the position, velocity or acceleration of the base."""
    f, a, p = np.array(PARTS).T[:, :, None]
    return np.sum(a * (2 * np.pi * f) ** order * np.sin(2 * np.pi * f * t + p + order * np.pi / 2), axis=0)


def mass(t=TIMES):
    """Return position and velocity of the mass in space."""

    def rates(s, z):
        away, speed = z[0] - base(0, s)[0], z[1] - base(1, s)[0]
        return [z[1], -(STIFFNESS * away + DAMPING * speed + CUBIC * away**3) / MASS]

    start = [float(base(order, TIMES[:1])[0]) for order in (0, 1)]
    return solve_ivp(rates, (0, t[-1]), start, t_eval=t, rtol=1e-9, atol=1e-12).y


@pytest.fixture(scope="module")
def records():
    """Return the same run as it is told by a place, a speed and an accelerometer of the base."""
    rng, (x, v) = np.random.default_rng(3), mass()

    def noisy(y, size):
        return y + size * rng.standard_normal(len(y))

    return {
        "position": cdf.Measurement(
            TIMES, 1e3 * noisy(base(0), 2e-6), 1e3 * noisy(x, 5e-6), 
            input_unit="mm", output_unit="mm", name="shaker",
        ),
        "velocity": cdf.Measurement(
            TIMES, noisy(base(1), 1e-5), noisy(v, 1e-4), input_unit="m/s", output_unit="m/s"
        ),
        "acceleration": cdf.Measurement(
            TIMES, noisy(base(2), 1e-3) / 9.80665, noisy(x - base(0), 5e-6), input_unit="g0", output_unit="m"
        ),
    }  # fmt: skip


@pytest.mark.parametrize("quantity", ["position", "velocity", "acceleration"])
def test_the_true_model_follows_and_a_fit_finds_it(records, quantity):
    record = records[quantity]
    # worst measured: 0.0011, by what the low-pass takes from the motion of the base
    assert cdf.compare(TRUE, record).nrmse < 0.002
    fit = cdf.refit(
        TRUE.with_parameters({"cubic_spring.stiffness": 2.5e5, "viscous.coefficient": 8.0}), record
    )
    found = fit.parameters
    assert "mass" not in found and fit.model.mass == MASS
    assert found["linear_spring.stiffness"].value == pytest.approx(STIFFNESS, rel=2e-3)
    assert found["viscous.coefficient"].value == pytest.approx(DAMPING, rel=2e-3)
    assert found["cubic_spring.stiffness"].value == pytest.approx(CUBIC, rel=2e-3)


@pytest.mark.parametrize("quantity", ["velocity", "acceleration"])
def test_a_coarsely_sampled_base_is_read_without_bias(quantity):
    """Read straight between its samples an acceleration falls short by (w dt)^2 / 12 of itself, 0.9 %."""
    dt, w = 0.01, 33.0
    # of irregular clocks, too
    t = dt * (np.arange(400) + (0.0 if quantity == "velocity" else 0.2 * np.sin(np.arange(400))))
    turning = 2.0 * np.exp(1j * w * t)  # acceleration of the base
    away = -MASS * turning / (STIFFNESS - MASS * w**2 + 1j * w * DAMPING)
    u, y, unit = {
        "velocity": (turning / (1j * w), turning / (1j * w) + 1j * w * away, "m/s"),
        "acceleration": (turning, away, "m"),
    }[quantity]
    run = cdf.Measurement(t, u.real, y.real, input_unit=unit if unit == "m/s" else "m/s^2", output_unit=unit)
    assert cdf.compare(TRUE.without_effect("cubic_spring"), run).nrmse < 5e-4


def test_what_is_said_of_the_hold_is_what_is_done(records):
    assert "input [m/s^2] smooth," in repr(records["acceleration"])
    assert "input [m] zoh as a reference, smooth as the motion of a base," in repr(records["position"])


def test_what_is_missing_is_found(records):
    found = cdf.diagnose(NOMINAL, records["acceleration"])
    assert (found.verdict, found.best.id) == ("effect", "cubic_spring")
    assert found.best.parameters["stiffness"] == pytest.approx(CUBIC, rel=5e-3)
    tried = {c.id for c in found.ranking}
    assert not tried & {"compliance", "backlash", "input_lag", "input_saturation"}


def test_how_the_motion_was_read_is_said(records):
    said = str(cdf.compare(TRUE, records["position"]))
    assert "record 'shaker'" in said and "seen from its base, its motion low-passed at" in said
    assert "low-passed" not in str(cdf.compare(TRUE, records["acceleration"]))


def test_what_such_a_record_does_not_tell_is_refused(records):
    with pytest.raises(ValueError, match="a moving base shows forces per mass only"):
        cdf.refit(NOMINAL, records["position"], free=["mass"])
    with pytest.raises(ValueError, match="start needs parameters"):
        cdf.refit(NOMINAL, records["position"], start={"mass": 3.0})
    with pytest.raises(ValueError, match="got input_saturation, which acts on a force"):
        cdf.compare(NOMINAL.with_effect(cdf.InputSaturation(30.0)), records["position"])
    with pytest.raises(ValueError, match="got sensor_delay, which acts on the place in space"):
        cdf.compare(NOMINAL.with_effect(cdf.SensorDelay(0.01)), records["position"])
    assert cdf.compare(NOMINAL.with_effect(cdf.SensorDelay(0.01)), records["acceleration"]).nrmse > 0
    force = cdf.Measurement(TIMES, base(2), mass()[0])
    for mixed in ([force, records["position"]], [records["position"], force]):
        with pytest.raises(ValueError, match="cannot be combined"):
            cdf.compare(NOMINAL, mixed)
    with pytest.raises(ValueError, match="velocity of a base does not tell its position"):
        cdf.compare(NOMINAL, cdf.Measurement(TIMES, base(1), mass()[0], input_unit="m/s", output_unit="m"))
    with pytest.raises(ValueError, match="needs one body with a mass"):
        cdf.compare(cdf.TwoMass(1.0, 2.0, [cdf.Compliance(100.0)]), records["position"])
    with pytest.raises(ValueError, match="needs one body with a mass"):
        cdf.compare(cdf.Massless().with_effect(cdf.Viscous(1.0)), records["position"])
    with pytest.raises(ValueError, match="this model moves in rad"):
        cdf.compare(cdf.Inertia(1.0), records["position"])
