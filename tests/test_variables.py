"""Parameters as a solver sees them."""

import math

import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.identify.estimation.segmented import prepare
from ctrl_df.identify.prediction.segments import facts
from ctrl_df.identify.shooting.variables import Variable, variables_of

FREE = cdf.Mass(2.0).with_effect(cdf.Hysteresis(4.0, stroke=0.1)).parameters["hysteresis.stroke"]


@pytest.mark.parametrize("low, high", [(0.02, math.inf), (0.0, 0.5), (0.02, 0.5), (0.0, math.inf)])
def test_a_positive_parameter_stays_within_its_limits(low, high):
    v = Variable("stroke", FREE, 0.1, (low, high))
    assert v.log
    for q in (-30.0, -1.0, 0.3, 30.0):
        assert math.isclose(v.p(v.clip(q)), min(max(v.p(q), low), high), rel_tol=1e-12)


def test_a_value_that_is_next_to_nothing_has_no_size():
    """A level of 5e-12 that the records bound to 125 N: scaled by itself no step would show in it."""
    level = cdf.friction_mass(2.0, 1.0, 1.0).parameters["coulomb.level"]
    bounded = Variable("level", level, 600.0, (125.0, 800.0), begin=5e-12)
    assert bounded.scale == 125.0 and Variable("level", level, 600.0, begin=5e-12).scale == 600.0


def test_a_small_value_moves_as_far_as_one_of_natural_size():
    level = cdf.friction_mass(2.0, 1.0, 1.0).parameters["coulomb.level"]
    for begin, move in ((0.5, 600.0), (0.0, 600.0), (2000.0, 2000.0)):
        v = Variable("level", level, 600.0, begin=begin)
        q = v.q(begin)
        assert v.p(q + v.step(q)) == pytest.approx(begin + move)


def _stroke():
    """Return a mass pushed to and fro against Coulomb friction of 12 N, in noise."""
    t = np.arange(0, 8, 0.01)
    force = 27 * np.sin(1.7 * t) + 15 * np.sin(4.1 * t + 1)
    x, _ = cdf.event_response(cdf.friction_mass(2.0, 12.0, 1.0), t, force).outputs
    return cdf.Measurement(t, force, x + 1e-3 * np.random.default_rng(1).standard_normal(t.size))


def test_a_level_that_was_all_but_lost_is_found_again_in_a_few_steps():
    """The step before had taken another effect for it; steps of its own size would each double it."""
    data = prepare(cdf.friction_mass(2.0, 3.0, 1.0), [_stroke()]).segmentations[0]
    found = data.fit(
        cdf.friction_mass(2.3, 0.26, 2.0), ("mass", "coulomb.level", "viscous.coefficient"), iterations=4
    )
    assert found.model.parameters["coulomb.level"].value == pytest.approx(12.0, rel=0.01)


def test_a_parameter_keeps_to_its_range_about_what_its_user_has_stated():
    run = _stroke()
    for coulomb, stated, span in (
        (2.0, 12.0, (1.0, 144.0)),
        (0.6, 12.0, (0.05, 7.2)),
        (2.0, 2.0, (1 / 6, 24.0)),
    ):
        data = prepare(cdf.friction_mass(2.0, coulomb, 1.0), [run], prior={"coulomb.level": (stated, None)})
        assert data.limits["coulomb.level"] == pytest.approx(span)


@pytest.mark.parametrize("stop", [cdf.HardStop(0.1), cdf.HardStop(0.3, lower=0.2)])
def test_stops_stay_apart_where_no_position_is_measured(stop):
    t = np.arange(0, 5, 0.01)
    run = cdf.Measurement(t, np.sin(t), np.cos(3 * t), output="velocity")
    block = cdf.Mass(2.0).with_effect(stop)
    (limit,) = variables_of(block, ["hard_stop.limit"], [run], facts(run))
    nearest = block.with_parameters({"hard_stop.limit": limit.p(limit.clip(-1e3))}).effects[0]
    assert nearest.span[1] - nearest.span[0] == pytest.approx(facts(run).speed * run.dt)
