"""Parameters as a solver sees them."""

import math

import pytest

import ctrl_df as cdf
from ctrl_df.identify.shooting.variables import Variable

FREE = cdf.Mass(2.0).with_effect(cdf.Hysteresis(4.0, stroke=0.1)).parameters["hysteresis.stroke"]


@pytest.mark.parametrize("low, high", [(0.02, math.inf), (0.0, 0.5), (0.02, 0.5), (0.0, math.inf)])
def test_a_positive_parameter_stays_within_its_limits(low, high):
    v = Variable("stroke", FREE, 0.1, (low, high))
    assert v.log
    for q in (-30.0, -1.0, 0.3, 30.0):
        assert math.isclose(v.p(v.clip(q)), min(max(v.p(q), low), high), rel_tol=1e-12)
