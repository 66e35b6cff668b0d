"""A spring and a damper in series beside what the library has: a force of the past of the motion."""

import numpy as np
from scipy.signal import lfilter

import ctrl_df as cdf

TIMES = np.arange(0.0, 10.0, 0.005)
DAMPER = cdf.Massless().with_effect(cdf.Coulomb(50.0)).with_effect(cdf.Viscous(200.0))
MOTION = 0.02 * np.sin(2.6 * TIMES) + 0.008 * np.sin(7.1 * TIMES + 1) + 0.003 * np.sin(18.2 * TIMES + 2)
NAMES = ["hysteresis", "linear_spring", "cubic_spring"]


def run(stiffness, seconds=0.15):
    """Return an imposed motion and the force that it takes, that of a Maxwell element in it."""
    rng = np.random.default_rng(7)
    x = MOTION
    v = np.gradient(x, TIMES)
    kept = np.exp(-TIMES[1] / seconds)
    relaxing = stiffness * lfilter([kept, -kept], [1, -kept], x - x[0])
    force = 60.0 * np.sign(v) + 240.0 * v + relaxing + 2.0 * rng.standard_normal(TIMES.size)
    x = x + 1e-6 * rng.standard_normal(TIMES.size)
    return cdf.Measurement(TIMES, x, force, input_unit="m", output_unit="N")


def test_a_force_that_relaxes_is_no_hysteresis():
    # three times the noise was left, slow as a coloured noise may be: "hysteresis, probability > 99.9%"
    found = cdf.diagnose(DAMPER, run(4e3), candidates=NAMES)
    assert found.verdict == "unknown" and found.regions[0] == "past_motion"
    assert "a force that relaxes after motion" in found.explanation


def test_without_it_nothing_relaxes():
    assert cdf.diagnose(DAMPER, run(0.0), candidates=NAMES).verdict == "none"


def test_what_a_candidate_explains_is_no_fault_of_the_clocks():
    # one elastic slider in the place of the Coulomb friction: its lag passed for a force recorded late
    slider, stiffness, level = np.zeros(TIMES.size), 3e4, 60.0
    for i, dx in enumerate(np.diff(MOTION)):
        slider[i + 1] = np.clip(slider[i] + stiffness * dx, -level, level)
    rng = np.random.default_rng(1)
    force = slider + 240.0 * np.gradient(MOTION, TIMES) + 2.0 * rng.standard_normal(TIMES.size)
    record = cdf.Measurement(TIMES, MOTION, force, input_unit="m", output_unit="N")
    found = cdf.diagnose(DAMPER, record, candidates=["hysteresis", "cubic_spring"])
    assert found.verdict == "ambiguous" and found.best.id == "hysteresis"
    assert any("bound of their range" in doubt for doubt in found.doubts)
    assert "recorded" not in found.explanation
