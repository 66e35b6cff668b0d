"""Measurements: units, sources, refusals, parts, derivatives, noise floor."""

import math
import warnings

import control as ct
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ctrl_df as cdf
from ctrl_df.identify.data.measurement import FrequencyMeasurement, Measurement
from ctrl_df.units import si_unit


def run(n=400, dt=1e-3, seed=0):
    t = dt * np.arange(n)
    rng = np.random.default_rng(seed)
    return t, np.sin(20 * t) + 0.1 * rng.standard_normal(n), 0.02 * np.cos(20 * t)


# --- units -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("unit", "factor", "si"),
    [
        ("mm", 1e-3, "m"), ("um", 1e-6, "m"), ("µm", 1e-6, "m"), ("kN", 1e3, "N"), ("mN", 1e-3, "N"),
        ("deg", math.pi / 180, "rad"), ("rpm", math.pi / 30, "rad/s"), ("ms", 1e-3, "s"),
        ("mm/s", 1e-3, "m/s"),
        ("deg/s^2", math.pi / 180, "rad/s^2"), ("N/mm", 1e3, "N/m"), ("m/min", 1 / 60, "m/s"),
        ("Nm", 1, "N m"),
        ("mrad", 1e-3, "rad"), ("V", 1, "V"), ("mm/s²", 1e-3, "m/s^2"), ("rev", 2 * math.pi, "rad"),
    ],
)  # fmt: skip
def test_units(unit, factor, si):
    assert si_unit(unit) == (pytest.approx(factor), si)


def test_units_convert_every_channel_and_nothing_twice():
    t, u, y = run()
    m = Measurement(
        1e3 * t, u, 1e3 * y, input_unit="kN", output_unit="mm", time_unit="ms", velocity=y,
        velocity_unit="mm/s",
        channels={"current": (u, "mA"), "raw": u},
    )  # fmt: skip
    assert np.allclose(m.t, t) and np.allclose(m.u, 1e3 * u) and np.allclose(m.y, y)
    assert np.allclose(m.velocity, 1e-3 * y) and np.allclose(m.channels["current"], 1e-3 * u)
    assert (m.input_unit, m.output_unit, m.velocity_unit, m.time_unit) == ("N", "m", "m/s", "s")
    again = m.slice(0.1, 0.3).windows(0.05)[0]
    assert np.allclose(again.y, y[100:150]) and np.allclose(again.velocity, 1e-3 * y[100:150])
    assert np.allclose(Measurement(t, u, 1e3 * y, output_unit="mm", velocity=1e3 * y).velocity, y)
    angle = Measurement(t, u, np.degrees(y), input_unit="Nm", output_unit="deg")
    assert angle.output_unit == "rad" and np.allclose(angle.y, y)


def test_a_measurement_is_a_value():
    t, u, y = run()
    m = Measurement(t, u, y)
    y[:] = 0
    assert np.ptp(m.y) > 0
    with pytest.raises(ValueError, match="read-only"):
        m.y[0] = 1
    with pytest.raises(AttributeError):
        m.name = "other"
    with pytest.raises(TypeError):
        m.channels["x"] = 1
    assert "400 samples" in repr(m) and "zoh" in repr(m)


# --- refusals --------------------------------------------------------------------------------------


def spoil(change):
    t, u, y = run()
    return change(t, u, y)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t, u, y: (t, u, np.where(t == t[7], np.nan, y)), r"y has 1 NaN.*sample 7"),
        (lambda t, u, y: (t, np.where(t > 0.3, np.inf, u), y), "u has .* infinite"),
        (lambda t, u, y: (t[::-1], u, y), "increasing times"),
        (lambda t, u, y: (np.where(t == t[9], t[8], t), u, y), "each time once.*sample 9"),
        (lambda t, u, y: (np.delete(t, range(100, 120)), u[20:], y[20:]), r"gap.*0.099 to 0.12 s \(21 int"),
        (lambda t, u, y: (np.delete(t, 100), u[1:], y[1:]), r"gap.*\(2 intervals\)"),
        (lambda t, u, y: (t, u[:-1], y), "equal length; t has 400 samples and u 399"),
        (lambda t, u, y: (t, 0 * u + 3, np.cos(1e9 * t**2)), "input that varies.* u is 3.*noise"),
        (lambda t, u, y: (t, u, 0 * y), "output that varies"),
        (lambda t, u, y: (t[:9], u[:9], y[:9]), "at least 10 samples; got 9"),
        (lambda t, u, y: (t, u, np.c_[y, y]), r"1-D array.*\(400, 2\)"),
        (lambda t, u, y: (t, u, y + 1j), "real numbers"),
    ],
)  # fmt: skip
def test_bad_records_are_refused_with_rule_value_remedy(change, message):
    with pytest.raises(ValueError, match=message) as error:
        Measurement(*spoil(change), name="run 3")
    assert "run 3" in str(error.value)


def test_a_free_motion_is_a_record_and_one_imposed_that_rests_is_none():
    t, _, y = run()
    assert len(Measurement(t, 0 * t, y)) == len(Measurement(t, 0 * t + 3, y)) == len(t)
    first, second = Measurement.in_parts(t, 0 * t, np.where(t > 0.2, y + 5, y))
    assert len(first) + len(second) == len(t)
    with pytest.raises(ValueError, match="a motion that is imposed"):
        Measurement(t, 0 * t + 3, y, input_unit="m", output_unit="N")


def test_a_column_given_twice_is_refused():
    t, _, y = run()
    with pytest.raises(ValueError, match="differ; got the same position as both.*given twice"):
        Measurement(t, 1e3 * y, y, input_unit="mm", output_unit="m")
    assert len(Measurement(t, y, y)) == len(t)  # a force in N may well equal a place in m


@pytest.mark.parametrize("rpm", [60, 300, 1300, 1600, 2000, 4000, -4400])
@pytest.mark.parametrize(("unit", "turn"), [("rad", 2 * np.pi), ("deg", 360), ("rev", 1)])
def test_angles_that_wrap_are_refused_at_any_speed(rpm, unit, turn):
    t = np.arange(0, 4, 0.005)
    turns = rpm / 60 * (t + 0.15 * np.sin(2 * t))
    noise = 1e-3 * np.random.default_rng(0).standard_normal(t.size)
    wrapped = turn * np.mod(turns + noise, 1)
    with pytest.raises(ValueError, match="falls back by a turn.*np.unwrap") as error:
        Measurement(t, np.sin(2 * t), wrapped, input_unit="N m", output_unit=unit)
    period = float(str(error.value).split("period=")[1].split(")")[0])
    going_on = np.unwrap(wrapped, period=period)
    assert len(Measurement(t, np.sin(2 * t), going_on, input_unit="N m", output_unit=unit)) == len(t)


def test_a_quick_swing_within_a_turn_does_not_wrap():
    t = np.arange(0, 4, 0.005)
    swing = 3.1 * np.sin(2 * np.pi * 70.3 * t)  # under three samples a period
    assert len(Measurement(t, np.sin(2 * t), swing, input_unit="N m", output_unit="rad")) == len(t)


def test_other_refusals():
    t, u, y = run()
    with pytest.raises(ValueError, match="unit must be one of"):
        Measurement(t, u, y, output_unit="furlong")
    with pytest.raises(ValueError, match="unit of time"):
        Measurement(t, u, y, time_unit="mm")
    with pytest.raises(ValueError, match="input_hold"):
        Measurement(t, u, y, input_hold="cubic")
    with pytest.raises(TypeError, match="numbers in u"):
        Measurement(t, ["a"] * len(t), y)
    with pytest.raises(TypeError, match="unrecognized keyword: units=.mm.; it takes t, u, y, name"):
        cdf.Measurement(t, u, y, units="mm")
    with pytest.raises(TypeError, match="1-D array of numbers"):
        Measurement(t, None, y)


@given(st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_irregular_sampling_is_accepted(seed):
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.exponential(1e-3, 300) + 1e-5)
    m = Measurement(t, np.sin(t * 30), np.cos(t * 30))
    assert not m.regular and m.dt > 0
    jitter = 1e-3 * np.arange(300) + 1e-4 * rng.uniform(-1, 1, 300)
    assert len(Measurement(jitter, np.sin(t * 30), np.cos(t * 30))) == 300


@pytest.mark.parametrize("start", [0.0, 1.7e9])
@pytest.mark.parametrize(("rate", "digits"), [(300, 3), (240, 4), (600, 3), (1024, 4)])
def test_rounded_times_of_a_regular_clock_are_read_as_that_clocks(rate, digits, start):
    """Taken as they stood, 300 Hz in whole milliseconds doubled the error of the true model of an arm."""
    clock = start + np.arange(400) / rate
    for times in (np.round(clock, digits), np.floor(clock * 10**digits) / 10**digits):
        m = Measurement(times, np.sin(30 * clock), np.cos(30 * clock))
        assert m.regular and m.dt == pytest.approx(1 / rate, rel=1e-3)
        assert np.ptp(m.t - clock) < 0.2 * 10**-digits  # 0.08 of it for most
        assert "regular clock" in m.note


def test_the_grid_of_rounded_times_with_a_gap_is_that_of_the_clock():
    times = np.delete(np.round(np.arange(3000) / 300, 3), [700, 2000])
    with pytest.raises(ValueError, match=r"2 gap\(s\) in a regular 0\.00333\d* s grid.*2\.1 intervals"):
        Measurement(times, np.sin(3 * times), np.cos(3 * times))


def test_times_that_no_regular_clock_makes_are_left_as_they_are():
    clock = np.arange(400) / 300
    late = np.where(np.arange(400) < 200, clock, clock + 0.5 / 300)  # waited once
    shuffled = np.cumsum(np.random.default_rng(0).permutation(np.diff(np.round(clock, 3))))
    jitter = np.round(clock + 1e-3 * np.random.default_rng(1).uniform(-1, 1, 400), 3)
    for times in (late, shuffled, jitter):
        m = Measurement(times, np.sin(3 * times), np.cos(3 * times))
        assert np.array_equal(m.t, times) and not m.note


# --- sources ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("mark", [",", ";", "\t", " "])
def test_csv_with_any_delimiter(tmp_path, mark):
    t, u, y = run(50)
    rows = "\n".join(mark.join(f"{v:.9g}" for v in row) for row in zip(t, u, y, strict=True))
    path = tmp_path / "run3.csv"
    path.write_text("# bench 2\n" + mark.join(["t", "F", "x"]) + "\n" + rows + "\n")
    m = Measurement.from_csv(path, time="t", input="F", output="x")
    assert m.name == "run3" and np.allclose(m.u, u) and np.allclose(m.y, y)
    assert np.allclose(Measurement.from_csv(path, time=0, input=1, output=2, name="a").y, y)


def test_csv_units_in_the_header_decimal_commas_and_text_columns(tmp_path):
    t, u, y = run(50)
    lines = [
        f"{a:.6f};{b:.6f};{c:.6f};ok".replace(".", ",") for a, b, c in zip(1e3 * t, u, 1e3 * y, strict=True)
    ]
    path = tmp_path / "r.csv"
    path.write_text("time [ms];F (kN);x [mm];state\n" + "\n".join(lines))
    m = Measurement.from_csv(path, time="time", input="F", output="x")
    assert np.allclose(m.t, t) and np.allclose(m.u, 1e3 * u, atol=1e-3) and np.allclose(m.y, y, atol=1e-8)
    with pytest.warns(UserWarning, match="the header of output says mm, output_unit='m' is taken"):
        forced = Measurement.from_csv(path, time="time", input="F", output="x", output_unit="m")
    assert np.allclose(forced.y, 1e3 * y, atol=1e-5)


@pytest.mark.parametrize(
    ("header", "said"),
    [
        ("t_ms,F_N,x_m", ["'t_ms' looks like ms; the column is read as s", "time_unit='ms'", "'t [ms]'"]),
        ("t_s,F_kN,x_m", ["'F_kN' looks like kN", "input_unit='kN'"]),
        ("t,F,x_mm", ["'x_mm' looks like mm; the column is read as m", "output_unit='mm'", "'x [mm]'"]),
        ("t,M,phi_deg", ["looks like deg"]), ("t,x_mm,F [N]", ["looks like mm; the column is read as N"]),
        ("t,F,x,v_mm/s", ["'v_mm/s' looks like mm/s; the column is read as m/s", "velocity_unit"]),
        ("t_s,F_N,x_m", []), ("t_h1,F_in,x_A", []), ("t,F_g,x_1", []),
    ],
)  # fmt: skip
def test_units_after_an_underscore_are_not_guessed_in_silence(tmp_path, header, said):
    columns = header.split(",")
    path = tmp_path / "s.csv"
    np.savetxt(
        path,
        np.column_stack([*run(), run()[2]])[:, : len(columns)],
        delimiter=",",
        header=header,
        comments="",
    )
    names = dict(zip(("time", "input", "output", "velocity"), columns, strict=False))
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        Measurement.from_csv(path, **names)
    assert len(told) == bool(said) and all(text in str(told[0].message) for text in said)
    assert all(w.filename == __file__ for w in told)


def test_csv_refusals(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text("t,F,x\n0,1,2\n1,2\n")
    with pytest.raises(ValueError, match="line 3: needs 3 cells.*got 2"):
        Measurement.from_csv(path)
    t, u, y = run(30)
    np.savetxt(path, np.c_[t, u, y], delimiter=",", header="t,F,x", comments="")
    with pytest.raises(ValueError, match="got 'force'.*Columns.*t, F, x"):
        Measurement.from_csv(path, input="force", output="x")
    with pytest.raises(ValueError, match="column number must be 0 to 2"):
        Measurement.from_csv(path, input=7, output="x")
    path.write_text("t,F,x\n" + "\n".join(f"{i},{i % 3},{'oops' if i == 4 else i}" for i in range(20)))
    with pytest.raises(ValueError, match="column 'x'.*line 6 has 'oops'"):
        Measurement.from_csv(path, input="F", output="x")
    path.write_text("t,x,x\n0,1,2\n")
    with pytest.raises(ValueError, match="more than once"):
        Measurement.from_csv(path)
    path.write_text("")
    with pytest.raises(ValueError, match="is empty"):
        Measurement.from_csv(path)


def test_mat_files_and_their_structs(tmp_path):
    from scipy.io import savemat

    t, u, y = run(60)
    path = tmp_path / "run.mat"
    savemat(path, {"t": t[:, None], "data": {"F": u, "x": 1e3 * y}, "note": "text"})
    m = Measurement.from_mat(path, input="data.F", output="data.x", output_unit="mm")
    assert np.allclose(m.u, u) and np.allclose(m.y, y) and m.name == "run"
    with pytest.raises(ValueError, match="Columns.*t, data.F, data.x"):
        Measurement.from_mat(path, input="F", output="x")


def test_dataframes():
    pd = pytest.importorskip("pandas")
    t, u, y = run(60)
    frame = pd.DataFrame({"F": u, "x [mm]": 1e3 * y, "i": u}, index=t)
    m = Measurement.from_dataframe(frame, time=None, input="F", output="x", channels=["i"])
    assert np.allclose(m.t, t) and np.allclose(m.y, y) and np.allclose(m.channels["i"], u)
    clock = frame.set_index(pd.to_timedelta(t, unit="s"))
    assert np.allclose(Measurement.from_dataframe(clock, time=None, input="F", output="x").t, t)
    dated = frame.assign(at=pd.Timestamp("2026-01-31") + pd.to_timedelta(t, unit="s"), i=list(u))
    dated["i"] = dated["i"].astype(object)
    m = Measurement.from_dataframe(dated, time="at", input="i", output="x")
    assert np.allclose(m.t, t) and np.array_equal(m.u, u)
    dated.iloc[7, dated.columns.get_loc("i")] = "n/a"
    with pytest.raises(ValueError, match="column 'i' of the DataFrame needs numbers; row 7 has 'n/a'"):
        Measurement.from_dataframe(dated, time="at", input="i", output="x")
    with pytest.raises(ValueError, match="got 'v'.*F, x"):
        Measurement.from_dataframe(frame, time=None, input="v", output="x")
    with pytest.raises(TypeError, match="pandas DataFrame"):
        Measurement.from_dataframe({"t": t}, input="F", output="x")


def test_responses_of_python_control():
    t, u, _ = run(200)
    plant = ct.ss([[0, 1], [-4, -1]], [[0], [1]], np.eye(2), 0, inputs="F", outputs=["x", "v"])
    response = ct.forced_response(plant, t, u)
    m = Measurement.from_response(response, output="v")
    assert np.allclose(m.y, response.outputs[1]) and np.allclose(m.u, u) and m.input_hold == "linear"
    assert np.allclose(Measurement.from_response(response).y, response.outputs[0])
    with pytest.raises(ValueError, match="one of x, v; got 'a'"):
        Measurement.from_response(response, output="a")
    with pytest.raises(ValueError, match="0 to 1"):
        Measurement.from_response(response, output=5)


# --- parts -----------------------------------------------------------------------------------------


@given(st.floats(0.05, 0.5), st.floats(0, 0.8), st.integers(0, 100))
@settings(max_examples=40, deadline=None)
def test_windows_cover_the_record(length, overlap, seed):
    t, u, y = run(1000, seed=seed)
    parts = Measurement(t, u, y).windows(length, overlap)
    assert parts[0].t[0] == t[0] and parts[-1].t[-1] == t[-1]
    covered = np.zeros(1000, bool)
    for part in parts:
        i = int(round(part.t[0] / 1e-3))
        assert np.array_equal(part.y, y[i : i + len(part)])
        covered[i : i + len(part)] = True
    assert covered.all()
    if overlap == 0:
        assert sum(map(len, parts)) == 1000


def test_slices():
    t, u, y = run()
    m = Measurement(t, np.where(t < 0.2, 0.0, u), y)
    part = m.slice(0.05, 0.1)  # the input is constant there: parts are not judged again
    assert len(part) == 51 and part.t[0] == pytest.approx(0.05)
    with pytest.raises(ValueError, match="10 samples or more"):
        m.slice(0.3, 0.3005)
    with pytest.raises(ValueError, match="overlap"):
        m.windows(0.1, 1.0)
    with pytest.raises(ValueError, match="length"):
        m.windows(0.001)


def test_decimation_keeps_the_signal_and_removes_what_would_alias():
    t = 1e-3 * np.arange(4000)
    slow, fast = np.sin(2 * np.pi * 3 * t), np.sin(2 * np.pi * 180 * t)
    u = np.repeat(np.random.default_rng(0).standard_normal(400), 10)
    m = Measurement(t, u, slow + fast, velocity=slow).decimate(10)
    assert len(m) == 400 and m.dt == pytest.approx(0.01)
    # Inside; seen 1.6e-4, from the residue of the fast sine at the ends.
    assert np.max(np.abs(m.y - slow[::10])[30:-30]) < 1e-3
    assert np.allclose(m.u, u[::10])  # a held input keeps its steps
    with pytest.raises(ValueError, match="factor as an integer"):
        m.decimate(2.5)
    with pytest.raises(ValueError, match="regular"):
        Measurement(np.cumsum(np.random.default_rng(1).exponential(1, 4000)), u, slow).decimate(2)


def test_derivatives_have_no_lag_and_survive_noise():
    rng = np.random.default_rng(3)
    t = 1e-3 * np.arange(8000)
    w = 2 * np.pi * rng.uniform(0.8, 2.0)
    y = 0.05 * np.sin(w * t) + 0.01 * np.sin(3.1 * w * t + 1) + 0.3 * t
    v = 0.05 * w * np.cos(w * t) + 0.01 * 3.1 * w * np.cos(3.1 * w * t + 1) + 0.3
    a = -0.05 * w**2 * np.sin(w * t) - 0.01 * (3.1 * w) ** 2 * np.sin(3.1 * w * t + 1)
    inner = slice(400, -400)
    clean = Measurement(t, v, y)
    noisy = Measurement(t, v, y + 2e-5 * rng.standard_normal(8000))
    for m, tol in ((clean, 1e-4), (noisy, 0.01)):  # seen 2e-7 and 3e-3
        assert np.std((m.velocity_estimate() - v)[inner]) < tol * np.std(v)
    assert np.std((clean.acceleration_estimate() - a)[inner]) < 3e-4 * np.std(a)  # seen 3e-6
    assert np.std((noisy.acceleration_estimate() - a)[inner]) < 0.1 * np.std(a)  # seen 0.04
    jitter = t + 2e-4 * rng.uniform(-1, 1, 8000)
    odd = Measurement(jitter, v, np.interp(jitter, t, y))
    assert np.std((odd.velocity_estimate(20.0) - np.interp(jitter, t, v))[inner]) < 0.01 * np.std(v)
    with pytest.raises(ValueError, match="Nyquist"):
        clean.velocity_estimate(600.0)


@given(st.integers(0, 10_000), st.floats(1e-6, 1e-3))
@settings(max_examples=25, deadline=None)
def test_noise_floor_of_white_noise(seed, sigma):
    rng = np.random.default_rng(seed)
    t = 1e-3 * np.arange(10_000)
    y = 0.1 * np.sin(2 * np.pi * rng.uniform(0.3, 3) * t) + 0.05 * np.sin(2 * np.pi * rng.uniform(3, 9) * t)
    m = Measurement(t, np.sin(t), y + sigma * rng.standard_normal(len(t)))
    assert m.noise_floor() == pytest.approx(sigma, rel=0.1)  # seen 4 %


@pytest.mark.parametrize("step", [1e-5, 1e-4, 2e-3])
def test_noise_floor_of_an_encoder(step):
    t = 1e-3 * np.arange(10_000)
    y = step * np.round(0.1 * np.sin(2 * np.pi * 0.7 * t) / step)
    assert Measurement(t, np.sin(t), y).noise_floor() == pytest.approx(step / math.sqrt(12), rel=0.3)


# --- frequency responses ---------------------------------------------------------------------------


def test_frequency_measurements(tmp_path):
    A, w = np.array([1.0, 2.0, 5.0]), np.array([3.0, 10.0])
    N = (1 / A[:, None]) / (1j * w + 1)
    m = FrequencyMeasurement(A, w, 1e3 * N, output_unit="mm")
    assert np.allclose(m.N, N) and m.output_unit == "m" and "3 amplitudes" in repr(m)
    rows = [
        (a, x / (2 * np.pi), abs(n), np.degrees(np.angle(n)))
        for a, r in zip(A, N, strict=True)
        for x, n in zip(w, r, strict=True)
    ]
    path = tmp_path / "n.csv"
    np.savetxt(path, rows[1:], delimiter=",", header="A,f,mag,phase", comments="")
    read = FrequencyMeasurement.from_csv(path, frequency="f", magnitude="mag", phase="phase")
    assert np.isnan(read.N[0, 0]) and np.allclose(read.N[1:], N[1:])
    a, x, n = read.points
    assert len(a) == len(x) == len(n) == 5
    assert np.allclose(m.frd(2.1)(1j * w), N[1])
    for bad, message in [
        (([1.0, -1], w, N[:2]), "A finite, > 0 and increasing"),
        ((A, w, N.T), "Transpose"),
        ((A, w, N * np.nan), "one point at least"),
    ]:
        with pytest.raises(ValueError, match=message):
            FrequencyMeasurement(*bad)
    with pytest.raises(ValueError, match="either real="):
        FrequencyMeasurement.from_csv(path, frequency="f", magnitude="mag")


def test_it_travels_to_worker_processes():
    import pickle

    t = np.linspace(0, 1, 50)
    m = Measurement(t, np.sin(9 * t), t**2, channels={"reference": 2 * t}, velocity=2 * t)
    again = pickle.loads(pickle.dumps(m))
    for name in ("t", "u", "y", "velocity"):
        assert np.array_equal(getattr(again, name), getattr(m, name))
        assert not getattr(again, name).flags.writeable
    assert np.array_equal(again.channels["reference"], 2 * t)
    with pytest.raises(TypeError):
        again.channels["reference"] = t


@pytest.mark.parametrize(
    ("unit", "factor", "si"),
    [
        ("oz in", 0.0070615518, "N m"),
        ("lb ft", 1.3558179, "N m"),
        ("ozf", 0.27801385, "N"),
        ("ft/s", 0.3048, "m/s"),
        ("Nmm", 1e-3, "N m"),
        ("mohm", 1e-3, "V/A"),
        ("kW", 1e3, "N m/s"),
        ("V/(rad/s)", 1.0, "V s/rad"),
        ("N/(mm/s)", 1e3, "N s/m"),
        ("N/(m/s)^2", 1.0, "N s^2/m^2"),
        ("g cm2", 1e-7, "kg m^2"),
        ("V/krpm", 0.0095492966, "V s/rad"),
    ],
)
def test_units_of_motor_makers(unit, factor, si):
    assert si_unit(unit) == (pytest.approx(factor, rel=1e-7), si)


@pytest.mark.parametrize("unit", ["N/(m/(s))", "(N", "N (m)"])
def test_parentheses_hold_one_quotient(unit):
    with pytest.raises(ValueError, match="a unit must be one of those known"):
        si_unit(unit)


@pytest.mark.parametrize(("unit", "apart"), [("gcm^2", "g cm"), ("Nms/rad", "Nm s"), ("kgcm²", "kg cm")])
def test_symbols_stand_apart(unit, apart):
    with pytest.raises(ValueError, match=rf"Did you mean {apart}( or \w+)?\?"):
        si_unit(unit)


@pytest.mark.parametrize("unit", ["counts", "ticks", "encoder steps", "LSB"])
def test_counts_are_no_unit(unit):
    with pytest.raises(ValueError, match="Convert counts"):
        si_unit(unit)
