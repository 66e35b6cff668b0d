"""A run that has breaks, as several records."""

import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.identify.estimation.segmented import prepare

T = np.arange(0.0, 8.0, 0.004)
U = 9 * np.sin(2 * np.pi * 0.5 * T) + 5 * np.sin(2 * np.pi * 1.7 * T)
TRUE = cdf.friction_mass(2.2, 3.0, 6.0).with_effect(cdf.QuadraticDrag(8.0))
NOMINAL = cdf.friction_mass(2.0, 2.5, 5.0)


@pytest.fixture(scope="module")
def x():
    clean = np.asarray(cdf.event_response(TRUE, T, U, input_hold="zoh").outputs)[0]
    return clean + 2e-5 * np.random.default_rng(2).standard_normal(T.size)


def lengths(*args, **keywords):
    return [len(part) for part in cdf.Measurement.in_parts(*args, **keywords)]


def test_a_run_without_a_break_is_one_record(x):
    (part,) = cdf.Measurement.in_parts(T, U, x, name="run")
    whole = cdf.Measurement(T, U, x)
    assert part.name == "run [1]" and np.array_equal(part.y, whole.y) and np.array_equal(part.u, whole.u)


def test_breaks_of_every_kind(x):
    with pytest.warns(UserWarning, match="run': 55 of 2000 samples are left out"):
        y, u = x.copy(), U.copy()
        y[300:320], u[700:735] = np.nan, np.nan
        assert lengths(T, u, y, name="run") == [300, 380, 1265]
    kept = np.r_[0:500, 600:2000]  # a recorder that paused
    assert lengths(T[kept], U[kept], x[kept]) == [500, 1400]
    reset = x + 0.4 * (T > 3.0)  # an encoder that was reset
    assert lengths(T, U, reset) == [751, 1249]
    with pytest.warns(UserWarning, match="1 of 2000"):
        assert lengths(T, U, np.ma.masked_where(T == T[900], x)) == [900, 1099]
    twice = np.r_[T[:1000], T[:1000]]  # two runs in one file
    assert lengths(twice, U, x) == [1000, 1000]
    with pytest.warns(UserWarning, match="11 of 2000"):  # 9 samples between two that are missing
        y = x.copy()
        y[[400, 410]] = np.nan
        assert lengths(T, U, y) == [400, 1589]
    with pytest.warns(UserWarning, match="2 of 2000"):
        y = x.astype(object)
        y[[400, 1000]] = None
        assert lengths(T, U, y, velocity=U) == [400, 599, 999]


def test_channels_and_units_go_with_their_part(x):
    speed = np.gradient(x, T)
    speed[800] = np.nan
    with pytest.warns(UserWarning, match="1 of 2000"):
        first, second = cdf.Measurement.in_parts(
            1e3 * T,
            U,
            time_unit="ms",
            outputs={"x": (1e3 * x, "mm"), "v": speed},
            channels={"temperature": (T, "s")},
        )
    assert (len(first), len(second)) == (800, 1199)
    assert second.t[0] == pytest.approx(T[801])
    assert np.allclose(second.outputs["position"], x[801:]) and np.allclose(
        second.channels["temperature"], T[801:]
    )


def test_parts_are_fitted_and_diagnosed_together(x):
    y = x[:1200].copy()
    y[np.r_[400:405, 700]] = np.nan
    with pytest.warns(UserWarning, match="6 of 1200"):
        parts = cdf.Measurement.in_parts(T[:1200], U[:1200], y)
    assert len(parts) == 3
    fit = cdf.refit(TRUE.with_parameters({"quadratic_drag.coefficient": 5.0}), parts)
    assert fit.parameters["quadratic_drag.coefficient"].value == pytest.approx(8.0, rel=0.02)
    found = cdf.diagnose(NOMINAL, parts, candidates=["quadratic_drag", "linear_spring"])
    assert (found.verdict, found.best.id) == ("effect", "quadratic_drag")


def test_times_are_dates_or_numbers(x):
    dates = np.datetime64("2026-01-31T12:00:00") + (1e6 * T).astype("timedelta64[us]")
    first, second = cdf.Measurement.in_parts(dates, U, x + 0.4 * (T > 3.0))
    assert (first.t[0], second.t[0]) == pytest.approx((0.0, T[len(first)]))


def test_what_cannot_be_used_is_refused(x):
    with pytest.raises(ValueError, match="needs a part without a break of 10 samples or more"):
        cdf.Measurement.in_parts(T, U, np.full(T.size, np.nan))
    with pytest.raises(ValueError, match="arrays of equal length"):
        cdf.Measurement.in_parts(T, U[1:], x)
    with pytest.raises(TypeError, match="numbers"):
        cdf.Measurement.in_parts(T, U.astype(str), x)
    with pytest.raises(TypeError, match="colour"):
        cdf.Measurement.in_parts(T, U, x, colour=3)
    with pytest.raises(ValueError, match="in_parts"):
        cdf.Measurement(T, U, np.where(T > 3, np.nan, x))
    with pytest.raises(ValueError, match="in_parts"):
        cdf.Measurement(T, U, x + 0.4 * (T > 3.0))


def test_the_steps_of_a_coarse_sensor_are_no_resets():
    rng, t = np.random.default_rng(3), np.arange(0, 4, 1e-3)
    x = 0.1 * np.round(3.2 * np.sin(2 * t))
    slow = np.cumsum(rng.standard_normal(t.size)) * 1e-5
    for noise in (0 * t, 1e-4 * rng.standard_normal(t.size), slow):
        cdf.Measurement(t, np.sin(2 * t), x + noise)
    with pytest.raises(ValueError, match="without jumps"):
        cdf.Measurement(t, np.sin(2 * t), np.sin(2 * t) - 0.5 * (t > 1) - 0.9 * (t > 2) + 0.7 * (t > 3))


def test_a_small_reset_amid_large_motion_is_seen(x):
    """Of 200 times the noise, where the machine moves as far from sample to sample."""
    size, found = 200 * 2e-5, []
    assert np.max(np.abs(np.diff(x))) > 0.6 * size
    for at in range(40, 1960, 80):
        found.append(lengths(T, U, x + size * (T >= T[at])) == [at, 2000 - at])
    assert all(found)  # seen: all of 100 at 200 times the noise, 99 at 100 times, 12 at 50 times
    with pytest.raises(ValueError, match=f"at t = {T[800]:.6g} s.*in_parts"):
        cdf.Measurement(T, U, x - size * (T >= T[800]))


STOPPED = cdf.Mass(2.0).with_effect(cdf.Coulomb(1.0)).with_effect(cdf.HardStop(0.05))
SLIPS = cdf.friction_mass(2.0, 3.0, 2.0, static=8.0)


@pytest.mark.parametrize(
    "block", [STOPPED, SLIPS, cdf.backlash_masses(1, 8, 0.018, 0.9)], ids=["stop", "slip", "gap"]
)
def test_impacts_and_slips_are_no_resets(block):
    """At any rate, with noise and rounded: none of 1438 records was refused."""
    force = U + 3 * np.sin(2 * np.pi * 3.1 * T)
    clean = np.asarray(cdf.event_response(block, T, force, input_hold="zoh").outputs)[0]
    rng = np.random.default_rng(1)
    for every in (1, 4, 10, 25):
        t, u, y = T[::every], force[::every], clean[::every]
        for seen in (y, y + 1e-5 * rng.standard_normal(y.size), 1e-3 * np.round(y / 1e-3)):
            cdf.Measurement(t, u, seen)


def test_times_that_are_uneven_make_no_resets(x):
    for seed in range(5):
        kept = np.sort(np.random.default_rng(seed).choice(T.size, 700, replace=False))
        cdf.Measurement(T[kept], U[kept], x[kept])


def test_every_third_of_the_parts_too_short_to_be_divided_is_held_out():
    """A run from which single samples were dropped was refused: one of its parts had too few of them."""
    t = 0.01 * np.arange(800)
    force, x = np.sin(9 * t), np.cos(9 * t)
    lengths, first = [61, 31, 229, 134, 163, 151, 25], 0
    parts = []
    for n in lengths:
        here = slice(first, first + n)
        parts.append(cdf.Measurement(t[here], force[here], x[here], name=f"run [{first}]"))
        first += n
    model = cdf.friction_mass(2.0, 2.5, 5.0)
    data = prepare(model, parts)
    fitted, held_out = (
        {r.name: sum(w.counts) for r, w in zip(v.records, v.segments, strict=True)}
        for v in (data.train, data.validation)
    )
    assert all(fitted.get(p.name, 0) + held_out.get(p.name, 0) == len(p) for p in parts)
    whole = [p.name for p in parts if not (p.name in fitted and p.name in held_out)]
    assert parts[2].name not in whole and len(whole) >= 3  # the one of 229 samples is divided
    assert [name for name in whole if name in held_out] == whole[2::3]
    with pytest.raises(ValueError, match="180 samples, or three shorter ones.*got 2, of up to 61 samples"):
        prepare(model, parts[:2])
