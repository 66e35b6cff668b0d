"""The range of static levels that a record leaves open."""

from types import SimpleNamespace

import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.identify.estimation.multistart import thresholds_known


@pytest.mark.parametrize(("low", "high"), [(0.91, 1.07), (0.797, 1.203)])
def test_the_range_that_a_record_leaves_open_is_found_to_its_ends(low, high):
    model = cdf.Mass(2.0, [cdf.Coulomb(1.0), cdf.Stiction(3.0)])

    def fit(model, names, **_):
        level = model.parameters["stiction.level"].value / 3.0
        return SimpleNamespace(rmse=1.0 if low <= level <= high else 2.0)

    told = {}
    found = SimpleNamespace(
        model=model, names=("stiction.level",), own={}, parameters={"stiction.level": 3.0}, starts=None,
        rmse=1.0, with_errors=lambda errors: told.update(errors) or SimpleNamespace(null=[]),
    )  # fmt: skip
    thresholds_known(found, fit)
    # the error of a value anywhere within: of the range, and of the value not being in its middle
    wide, off = 3.0 * (high - low), 3.0 * (0.5 * (low + high) - 1)
    assert told["stiction.level"] == pytest.approx(np.hypot(wide / np.sqrt(12), off), rel=0.06)
