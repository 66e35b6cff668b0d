"""What records may hold: quantities named or told by their units, several outputs, voltage and current."""

import pickle

import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.model_file import read_model

T = 2e-3 * np.arange(1000)
U = 3 * np.sin(7 * T) + np.sin(19 * T)
MOTOR = cdf.Inertia(1.0, [cdf.TorqueConstant(0.5, 2.0), cdf.Coulomb(0.05), cdf.Viscous(0.2)])
X, V = np.asarray(cdf.event_response(MOTOR, T, U, input_hold="zoh").outputs)


# --- what a record holds ---------------------------------------------------------------------------


def test_a_quantity_is_named_or_told_by_its_unit():
    told = cdf.Measurement(T, U, V, input_unit="mV", output_unit="rpm")
    assert (told.input, told.output, told.input_unit, told.output_unit) == (
        "voltage", "velocity", "V", "rad/s"
    )  # fmt: skip
    for word, quantity, unit in (
        ("x", "position", "m"), ("angle", "position", "rad"), ("v", "velocity", "m/s"),
        ("speed", "velocity", "rad/s"), ("torque", "force", "N m"), ("current", "current", "A"),
    ):  # fmt: skip
        named = cdf.Measurement(T, U, V, output=word)
        assert (named.output, named.output_unit, dict(named.units)) == (quantity, unit, {quantity: unit})
    assert cdf.Measurement(T, U, V, output="velocity", output_unit="deg/s").output_unit == "rad/s"
    assert cdf.Measurement(T, U, V, input="motion", output="force").input == "position"
    assert cdf.Measurement(T, U, V, input="motion", input_unit="mm/s").input == "velocity"
    plain = cdf.Measurement(T, U, X)
    assert (plain.input, plain.output, plain.input_unit, plain.output_unit) == ("force", "position", "N", "m")


def test_several_outputs_are_one_record():
    record = cdf.Measurement(T, U, outputs={"speed": (np.degrees(V), "deg/s"), "angle": X}, input="voltage")
    assert list(record.outputs) == ["velocity", "position"] and record.output == "position"
    assert np.allclose(record.y, X) and np.allclose(record.outputs["velocity"], V)
    assert dict(record.units) == {"velocity": "rad/s", "position": "rad"}
    for part in (record.slice(0.4, 0.8), record.windows(0.5)[1], pickle.loads(pickle.dumps(record))):
        assert len(part.outputs["velocity"]) == len(part.y) == len(part)
    decimation = record.decimate(4)
    assert (
        np.allclose(decimation.outputs["velocity"], V[::4], atol=0.02)
        and len(decimation.y) == len(decimation) == 250
    )
    alone = record.only("velocity")
    assert alone.output == "velocity" and list(alone.outputs) == ["velocity"] and alone.y is not None
    assert "rad/s, rad" in repr(record)
    with pytest.raises(ValueError, match="read-only"):
        record.outputs["velocity"][0] = 1.0


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        (dict(y=X, output="velocity", output_unit="m"), ["output='velocity'", "m/s or rad/s", "'m'"]),
        (dict(y=X, output="speedo"), ["'speedo'", "'velocity'"]),
        (dict(y=X, input="motion", input_unit="V"), ["input='motion'", "m/s"]),
        (dict(y=X, outputs={"x": X}), ["either y", "both"]),
        (dict(outputs={}), ["no output"]),
        (dict(outputs={"x": X, "angle": X}), ["each quantity once", "'angle'"]),
        (dict(outputs={"x": X, "v": V[:-1]}), ["output 'v'", "999"]),
        (dict(outputs={"x": X, "v": 0 * V}), ["varies"]),
    ],
)
def test_what_does_not_fit_is_refused(keywords, words):
    with pytest.raises(ValueError) as refusal:
        cdf.Measurement(T, U, **keywords)
    assert all(word in str(refusal.value) for word in words), str(refusal.value)


def test_files_and_responses_hold_several_outputs(tmp_path):
    file = tmp_path / "run.csv"
    table = np.column_stack([T, U, 1e3 * X, V])
    np.savetxt(file, table, delimiter=",", header="t [s],u [V],pos [mrad],tacho", comments="")
    record = cdf.Measurement.from_csv(file, outputs={"x": "pos", "v": ("tacho", "rad/s")})
    assert dict(record.units) == {"position": "rad", "velocity": "rad/s"} and record.input == "voltage"
    assert np.allclose(record.y, X) and np.allclose(record.outputs["velocity"], V)
    alone = cdf.Measurement.from_csv(file, output="tacho", output_unit="rad/s")
    assert alone.output == "velocity"
    with pytest.raises(ValueError, match="need a column each"):
        cdf.Measurement.from_csv(file, outputs={"x": "pos", "v": ("pos", "rad/s")})
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame({"t": T, "u": U, "a": X, "w": V})
    same = cdf.Measurement.from_dataframe(frame, outputs={"angle": "a", "speed": "w"}, input_unit="V")
    assert np.allclose(same.outputs["velocity"], V)
    response = cdf.event_response(MOTOR, T, U, input_hold="zoh")
    again = cdf.Measurement.from_response(response, outputs={"angle": "angle", "speed": 1}, input_unit="V")
    assert np.allclose(again.outputs["velocity"], V) and np.allclose(again.y, X)


def test_a_model_file_names_outputs(tmp_path):
    path = tmp_path / "model.toml"
    head = '[plant]\nkind = "mass"\nmass = 1.0\n[data]\n'
    path.write_text(head + 'outputs = { x = "x", v = ["tacho", "mm/s"] }\n')
    assert read_model(path).columns["outputs"] == {"x": "x", "v": ["tacho", "mm/s"]}
    path.write_text(head + "outputs = { x = 1.5 }\n")
    with pytest.raises(ValueError, match="columns by quantity"):
        read_model(path)


# --- voltage and current ---------------------------------------------------------------------------


def test_a_record_of_voltage_is_judged_with_its_motor():
    rng = np.random.default_rng(1)
    record = cdf.Measurement(T, U, X + 1e-5 * rng.standard_normal(T.size), input_unit="V", output_unit="rad")
    assert cdf.compare(MOTOR, record).white
    wrong = MOTOR.with_parameters({"viscous.coefficient": 0.3, "coulomb.level": 0.03})
    fit = cdf.refit(wrong, record, ["viscous", "coulomb"])
    assert fit.parameters["viscous.coefficient"].value == pytest.approx(0.2, rel=0.02)
    with pytest.raises(ValueError, match="takes a torque .N m.*TorqueConstant"):
        cdf.compare(MOTOR.without_effect("torque_constant"), record)
    with pytest.raises(ValueError, match="takes a voltage .V.*is in A"):
        cdf.compare(MOTOR, cdf.Measurement(T, U, X, input_unit="A", output_unit="rad"))


# --- velocity, and position beside it --------------------------------------------------------------

TIME = 2e-3 * np.arange(3000)
FORCE = 9 * np.sin(2 * np.pi * 0.5 * TIME) + 5 * np.sin(2 * np.pi * 1.7 * TIME)
TRUE = cdf.friction_mass(2.2, 3.0, 6.0)
START = cdf.friction_mass(2.0, 2.5, 5.0)


def records(machine, seed=3, every=1):
    """Return records of position, of velocity and of both."""
    rng, t, force = np.random.default_rng(seed), TIME[::every], FORCE[::every]
    x, v = np.asarray(cdf.event_response(machine, t, force, input_hold="zoh").outputs)
    x, v = x + 1e-4 * rng.standard_normal(x.size), v + 1e-3 * rng.standard_normal(v.size)
    return {
        "position": cdf.Measurement(t, force, x),
        "velocity": cdf.Measurement(t, force, v, output="velocity"),
        "both": cdf.Measurement(t, force, outputs={"x": x, "v": v}),
    }


def test_the_true_model_errs_by_the_noise_of_each_output():
    found = {name: cdf.compare(TRUE, record) for name, record in records(TRUE).items()}
    assert found["velocity"].rmse == pytest.approx(1e-3, rel=0.05)
    assert "m/s" in str(found["velocity"]) and found["velocity"].white.p_value > 1e-4
    both = found["both"].records[0].by_output
    assert both["position"].rmse == pytest.approx(1e-4, rel=0.05)
    assert both["velocity"].rmse == pytest.approx(1e-3, rel=0.05)
    assert " m and " in str(found["both"]) and found["both"].rmse == pytest.approx(
        both["position"].rmse, rel=1e-12
    )
    errors = [both[q].nrmse for q in ("position", "velocity")]
    assert found["both"].nrmse == pytest.approx(np.sqrt(np.mean(np.square(errors))))


@pytest.mark.parametrize("kind", ["velocity", "both"])
def test_parameters_are_found_within_their_errors(kind):
    fit = cdf.refit(START, records(TRUE)[kind])
    for name, true in (("mass", 2.2), ("coulomb.level", 3.0), ("viscous.coefficient", 6.0)):
        p = fit.parameters[name]
        assert abs(p.value - true) < 4 * p.standard_error < 0.01 * true, name


@pytest.mark.parametrize(
    ("effect", "id"), [(cdf.QuadraticDrag(3.0), "quadratic_drag"), (cdf.LinearSpring(20.0), "linear_spring")]
)
def test_a_tachometer_shows_what_is_missing(effect, id):
    record = records(TRUE.with_effect(effect), every=4)["velocity"]
    found = cdf.diagnose(START, record, candidates=["quadratic_drag", "linear_spring", "sensor_delay"])
    assert found.verdict == "effect" and found.best.id == id
    assert all(c.id != "sensor_delay" for c in found.ranking)  # of a sensor that was not there
    value = next(iter(effect.parameters.values())).value
    assert next(iter(found.best.parameters.values())) == pytest.approx(value, rel=0.03)


DELAYS = ["input_delay", "sensor_delay"]


def test_position_alone_does_not_tell_whose_delay_it_is():
    pair = (cdf.InputDelay(0.01), cdf.SensorDelay(0.01))
    first, second = (records(TRUE.with_effect(delay), every=4) for delay in pair)
    assert np.allclose(first["position"].y, second["position"].y, rtol=0, atol=1e-9)  # one record
    assert cdf.diagnose(START, first["position"], candidates=DELAYS).best.equivalents


@pytest.mark.parametrize("cls", [cdf.InputDelay, cdf.SensorDelay])
def test_velocity_beside_position_tells_whose_delay_it_is(cls):
    held = records(TRUE.with_effect(cls(0.01)), every=4)
    found = cdf.diagnose(START, held["both"], candidates=DELAYS)
    assert found.verdict == "effect" and found.best.id == cls.id and not found.best.equivalents
    assert found.best.parameters["delay"] == pytest.approx(0.01, rel=0.02)


def test_the_place_of_a_velocity_record_is_found_where_a_law_knows_it():
    machine = TRUE.with_effect(cdf.LinearSpring(20.0))
    x, v = np.asarray(
        cdf.event_response(machine, TIME, FORCE, [0.1, 0.0], input_hold="zoh").outputs
    )  # begins 0.1 m off the spring's rest
    noise = 1e-3 * np.random.default_rng(1).standard_normal(v.size)
    record = cdf.Measurement(TIME, FORCE, v + noise, output="velocity")
    assert cdf.compare(machine, record).rmse == pytest.approx(1e-3, rel=0.05)


def test_the_missing_force_is_seen_through_a_tachometer():
    machine = TRUE.with_effect(cdf.ConstantForce(0.5))
    for kind in ("velocity", "both"):
        missing = cdf.compare(TRUE, records(machine, every=4)[kind]).missing_force
        assert np.median(missing.force) == pytest.approx(0.5, abs=0.05)
        assert missing.units["position"] == "m"


def test_pictures_name_the_output():
    import matplotlib.pyplot as plt

    comparison = cdf.compare(TRUE, records(TRUE)["both"])
    assert comparison.plot().axes.flat[0].get_ylabel() == "position [mm]"
    assert comparison.plot(output="velocity").axes.flat[0].get_ylabel() == "velocity [m/s]"
    with pytest.raises(ValueError, match="position, velocity"):
        comparison.plot(output="force")
    plt.close("all")


def test_records_of_different_outputs_are_studied_apart():
    held = records(TRUE)
    with pytest.raises(ValueError, match="need the same outputs"):
        cdf.compare(TRUE, [held["position"], held["velocity"]])


# --- records as they come --------------------------------------------------------------------------


@pytest.mark.parametrize("at", [700, 1503, 2700])
def test_an_encoder_that_was_reset_is_refused(at):
    x = records(TRUE)["position"].y.copy()
    x[at:] -= 0.25
    with pytest.raises(ValueError, match="jumps; it has 1.*encoder reset"):
        cdf.Measurement(TIME, FORCE, x)
    angle = np.angle(np.exp(1j * 40 * records(TRUE)["position"].y))  # wraps
    with pytest.raises(ValueError, match="unwrap"):
        cdf.Measurement(TIME, FORCE, angle, output="angle")


def test_what_only_looks_like_a_leap_is_taken():
    x = records(TRUE)["position"].y
    coarse = np.round(x / 0.02) * 0.02
    rested = np.where(TIME < 3.0, x[1500], x)  # at rest, then moving
    spike = x.copy()
    spike[900] += 0.3
    noise = 1e-5 * np.random.default_rng(2).standard_normal(x.size)
    # a sensor of few steps, noise behind it
    for y in (coarse, rested, spike, np.round(x / 0.08) * 0.08 + noise):
        cdf.Measurement(TIME, FORCE, y)


@pytest.mark.parametrize(("dt", "count"), [(0.01, 600), (2e-3, 500), (5e-5, 120_000)])
def test_low_rates_short_and_long_records_are_fitted(dt, count):
    t = dt * np.arange(count)
    force = 9 * np.sin(2 * np.pi * 0.5 * t) + 5 * np.sin(2 * np.pi * 1.7 * t)
    x = np.asarray(cdf.event_response(TRUE, t, force, input_hold="zoh").outputs)[0]
    x = x + 1e-4 * np.random.default_rng(5).standard_normal(count)
    fit = cdf.refit(START, cdf.Measurement(t, force, x))
    assert fit.parameters["mass"].value == pytest.approx(2.2, rel=2e-3)
    # a long record is decimated: the low-pass leaves 70 % of the new band
    share = 0.7 * len(fit.comparison.records[0].record) / count if count > 100_000 else 1.0
    assert fit.comparison.rmse == pytest.approx(1e-4 * np.sqrt(share), rel=0.1)


def test_a_pause_of_the_drive_does_no_harm():
    force = np.where((TIME > 2.0) & (TIME < 4.0), 0.0, FORCE)
    x = np.asarray(cdf.event_response(TRUE, TIME, force, input_hold="zoh").outputs)[0]
    x = x + 1e-4 * np.random.default_rng(5).standard_normal(x.size)
    fit = cdf.refit(START, cdf.Measurement(TIME, force, x))
    assert fit.parameters["coulomb.level"].value == pytest.approx(3.0, rel=2e-3)
