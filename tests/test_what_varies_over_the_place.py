"""Damping that varies over the place: no force over the place, and no other friction, is like it."""

import numpy as np
import pytest

import ctrl_df as cdf

TIMES = np.arange(0.0, 6.0, 0.005)


@pytest.mark.parametrize("damping", [True, False])
def test_damping_that_varies_over_the_place_is_located_there(damping):
    # "a force that varies over time", three times as much of it noise as structure
    rng = np.random.default_rng(7)
    waves = ((0.022, 0.6, 0), (0.01, 1.7, 1), (0.004, 4.3, 2))
    x, v = (
        sum(wave)
        for wave in zip(
            *(
                (a * np.sin(w * TIMES + k), a * w * np.cos(w * TIMES + k))
                for a, w, k in ((a, 2 * np.pi * f, k) for a, f, k in waves)
            ),
            strict=True,
        )
    )
    rising = 400.0 * (x / 0.02) ** 2 * v if damping else 0.0
    force = 30.0 * np.sign(v) + 240.0 * v + rising + 0.5 * rng.standard_normal(TIMES.size)
    record = cdf.Measurement(TIMES, x, force, input_unit="m", output_unit="N")
    damper = cdf.Massless().with_effect(cdf.Coulomb(25.0)).with_effect(cdf.Viscous(300.0))
    found = cdf.diagnose(damper, record, candidates=["linear_spring", "quadratic_drag"])
    if damping:
        assert found.verdict == "unknown" and found.regions == ("position",)
        assert "depends on the position, in proportion to the velocity" in found.explanation
    else:
        assert found.verdict == "none"
