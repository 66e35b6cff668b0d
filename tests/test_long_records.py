"""Records of very many samples."""

import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.identify.prediction.segments import facts


def test_a_long_record_is_decimated_where_nothing_is_lost_and_says_so():
    t = np.arange(0.0, 12.0, 5e-5)  # 240,000 samples
    u = 9 * np.sin(3 * t) + 5 * np.sin(8 * t)
    true = cdf.Mass(2.0).with_effect(cdf.LinearSpring(40.0)).with_effect(cdf.Viscous(6.0))
    x = np.asarray(cdf.event_response(true, t, u, input_hold="zoh").outputs)[0]
    x = x + 1e-4 * np.random.default_rng(0).standard_normal(t.size)
    comparison = cdf.compare(true, cdf.Measurement(t, u, x, name="long"))
    used = comparison.records[0].record
    assert len(used) == 80_000 and used.band == 0.7
    # white up to where the low-pass ends: seen p of 0.08 to 0.98 in five records (0 over the whole band)
    assert (
        comparison.white and not cdf.compare(true.with_parameters({"viscous.coefficient": 6.02}), used).white
    )
    # of white noise that a third of the band is left of, and what the low-pass lets through above: 0.513
    assert comparison.rmse / 1e-4 == pytest.approx(np.sqrt(0.75 / 3), rel=0.05)
    assert facts(used).noise == pytest.approx(comparison.rmse, rel=0.05)  # seen: 0.98
    assert "record 'long'" in str(comparison) and "1 of 3 samples, of what is below 2.33e+03 Hz" in str(
        comparison
    )
    # all of its band is motion
    noisy = np.cumsum(np.random.default_rng(1).standard_normal(120_000))
    whole = cdf.Measurement(t[:120_000], u[:120_000], noisy)
    assert len(cdf.compare(true, whole).records[0].record) == 120_000
