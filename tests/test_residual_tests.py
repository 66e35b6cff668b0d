"""Residual tests and regions of error: right levels under noise of any colour, right regions under faults."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import binom

from ctrl_df.identify.residuals import regions as where
from ctrl_df.identify.residuals import residual_tests as tests
from ctrl_df.identify.shooting.noise_model import noise_model

T = 1e-3 * np.arange(6000)


def coloured(rng, pole, n=6000):
    return lfilter([1.0], [1.0, -pole], rng.standard_normal(n + 2000))[2000:]


def multisine(rng):
    f = np.arange(0.3, 6, 0.4)
    return np.sum(
        np.sin(2 * np.pi * f[:, None] * T + rng.uniform(0, 6.28, (len(f), 1))) / f[:, None] ** 0.5, axis=0
    )


def level_is_right(p_values, level):
    """Whether the number of false alarms could come (1 in 1e4) from a test of that level."""
    return np.sum(np.array(p_values) < level) <= binom.ppf(1 - 1e-4, len(p_values), level)


def test_sizes_of_error():
    rng = np.random.default_rng(0)
    y, e = 3 + rng.standard_normal(1000), 0.1 * rng.standard_normal(1000)
    assert tests.rmse(e) == pytest.approx(math.sqrt(np.mean(e**2)))
    expected = 100 * (1 - np.linalg.norm(e) / np.linalg.norm(y - y.mean()))
    assert tests.fit_percent(y, y - e) == pytest.approx(expected)
    assert tests.nrmse(y, y - e) == pytest.approx(1 - expected / 100)
    assert tests.nrmse(y, np.full(1000, y.mean())) == pytest.approx(1)
    assert tests.nrmse(np.ones(9), np.zeros(9)) == math.inf


def test_white_noise_is_called_white_at_the_stated_level():
    rng = np.random.default_rng(1)
    p = [tests.whiteness(rng.standard_normal(2000)).p_value for _ in range(300)]
    assert level_is_right(p, 0.01) and level_is_right(p, 0.05)
    assert 0.4 < np.mean(p) < 0.6


def test_statistic_is_ljung_and_boxes():
    r = np.random.default_rng(2).standard_normal(50)
    d = r - r.mean()
    rho = [np.sum(d[k:] * d[: 50 - k]) / np.sum(d * d) for k in range(1, 6)]
    q = 50 * 52 * sum(x**2 / (50 - k) for k, x in enumerate(rho, 1))
    result = tests.whiteness(r, 5)
    assert result.statistic == pytest.approx(q, rel=1e-10) and np.allclose(result.autocorrelation, rho)
    assert not tests.whiteness(coloured(np.random.default_rng(2), 0.5))
    with pytest.raises(ValueError, match="lags"):
        tests.whiteness(r, 60)


@pytest.mark.parametrize("pole", [0.0, 0.6, 0.97])
def test_noise_models(pole):
    rng = np.random.default_rng(3)
    r = coloured(rng, pole, 20_000)
    model = noise_model(r)
    assert model.sigma == pytest.approx(1, rel=0.03)
    assert tests.whiteness(model.whiten(r)[model.order :]).p_value > 1e-3
    if pole:
        assert model.a[0] == pytest.approx(pole, abs=0.03)
        assert model.spectrum(0.0) == pytest.approx(1 / (1 - pole) ** 2, rel=0.5)


@pytest.mark.parametrize("pole", [0.0, 0.8, 0.98])
def test_input_test_keeps_its_level_for_smooth_inputs_and_coloured_noise(pole):
    rng = np.random.default_rng(4)
    p = [tests.input_residual_test(multisine(rng), coloured(rng, pole)).p_value for _ in range(120)]
    assert level_is_right(p, 0.01) and level_is_right(p, 0.05)


@pytest.mark.parametrize("delay", [0, 7, 40])
def test_input_test_finds_what_the_model_left(delay):
    rng = np.random.default_rng(5)
    u = multisine(rng)
    missed = np.roll(u, delay) * 0.3
    result = tests.input_residual_test(u, missed + coloured(rng, 0.5))
    assert not result and result.p_value < 1e-6


def test_a_controller_that_answers_noise_within_its_sample_is_no_missing_physics():
    """The right model of every machine under a sampled PID lacked something (p < 1e-50)."""
    rng = np.random.default_rng(6)
    noise = coloured(rng, 0.0)
    answered = multisine(rng) - 30.0 * noise
    assert tests.input_residual_test(answered, noise).p_value > 0.01
    assert tests.input_residual_test(answered, noise, [0]).p_value < 1e-50


def test_series_are_checked():
    with pytest.raises(ValueError, match="NaN"):
        tests.rmse([0.0, np.nan])
    with pytest.raises(ValueError, match="1-D"):
        tests.whiteness(np.zeros((4, 4)))
    with pytest.raises(ValueError, match="equal lengths"):
        tests.input_residual_test(np.ones(9), np.ones(8))


# --- where -------------------------------------------------------------------------------------------------


def motion(rng):
    u = multisine(rng)
    velocity = lfilter([1e-3], [1, -1 + 3e-3], u)
    return dict(position=np.cumsum(velocity) * 1e-3, velocity=velocity, force=u)


@pytest.mark.parametrize("pole", [0.0, 0.99])
def test_only_noise_has_no_region(pole):
    rng = np.random.default_rng(6)
    alarms = []
    for _ in range(25):
        regions = where.error_regions(T, coloured(rng, pole), **motion(rng))
        alarms.append(min(r.p_value for r in regions))
        assert {r.kind for r in regions} == set(where.KINDS)
    assert level_is_right(alarms, 0.01) and level_is_right(alarms, 0.05)


FAULTS = {
    "time": lambda m, turns: (T > 2) & (T < 2.7),
    "direction": lambda m, turns: m["velocity"] > 0,
    "low_speed": lambda m, turns: np.abs(m["velocity"]) < 0.1 * np.quantile(np.abs(m["velocity"]), 0.95),
    "after_reversal": lambda m, turns: where.time_since(T, turns) < 0.02,
    "position": lambda m, turns: (
        np.abs(m["position"] - np.quantile(m["position"], 0.3)) < 0.05 * np.ptp(m["position"])
    ),
    "load": lambda m, turns: np.abs(m["force"]) > 0.6 * np.max(np.abs(m["force"])),
}


@pytest.mark.parametrize("kind", FAULTS)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_faults_are_found_where_they_are(kind, seed):
    rng = np.random.default_rng([seed, 7])
    m = motion(rng)
    turns = where.reversals(m["velocity"], 0.1 * np.quantile(np.abs(m["velocity"]), 0.95))
    bad = FAULTS[kind](m, turns)
    residual = coloured(rng, 0.5) * (1 + 3 * bad)
    regions = where.error_regions(T, residual, **m)
    assert kind in (regions.kinds if kind == "time" else regions.kinds[:2])
    worst = next(r for r in regions if r.kind == kind)
    assert worst.share > 1.3 * worst.expected_share and worst.p_value < 1e-6
    assert f"{worst.share:.0%}" in worst.sentence and kind in regions.table()


def test_a_hum_shows_as_a_band_and_a_bias_in_words():
    rng = np.random.default_rng(8)
    r = coloured(rng, 0.9) + 1.0 * np.sin(2 * np.pi * 33 * T)
    best = where.error_regions(T, r)[0]
    assert best.kind == "frequency" and best.span[0] <= 33 <= best.span[1] * 1.03
    m = motion(rng)
    r = rng.standard_normal(len(T)) + 2.0 * (m["velocity"] > 0)
    regions = where.error_regions(T, r, **m)
    up = next(x for x in regions if x.label == "v > 0")
    assert up.bias > 0.5 and up.bias_p_value < 1e-6 and "above the model" in up.sentence


def test_shares_add_up_and_noise_says_so():
    rng = np.random.default_rng(9)
    regions = where.error_regions(T, rng.standard_normal(len(T)), **motion(rng))
    for kinds in (("time",), ("position",), ("load",), ("amplitude",), where.SPEEDS):
        assert sum(r.share for kind in kinds for r in regions.of(kind)) == pytest.approx(1)
    assert regions.sentences == ("No region holds more of the squared error than chance would leave there.",)
    with pytest.raises(ValueError, match="kind of region"):
        regions.of("weather")
    with pytest.raises(ValueError, match="equal length"):
        where.error_regions(T, T[:-1])
    assert where.error_regions(T, np.zeros(len(T))) == ()


def test_reversals_ignore_noise_around_zero():
    rng = np.random.default_rng(10)
    v = np.sin(2 * np.pi * 2 * T) + 0.02 * rng.standard_normal(len(T))
    turns = where.reversals(v, 0.1)
    assert len(turns) == 23  # 24 half periods in 6 s
    assert np.max(np.abs(np.mod(T[turns] + 0.125, 0.25) - 0.125)) < 0.01
    assert np.allclose(
        where.half_stroke(np.sin(2 * np.pi * T - 0.3), [500, 1000])[600],
        0.5 * np.ptp(np.sin(2 * np.pi * T - 0.3)[500:1000]),
    )
