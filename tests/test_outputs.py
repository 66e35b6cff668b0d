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
    thin = record.decimate(4)
    assert np.allclose(thin.outputs["velocity"], V[::4], atol=0.02) and len(thin.y) == len(thin) == 250
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
