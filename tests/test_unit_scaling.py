"""Units are a matter of writing: others alter neither verdict nor evidence nor, converted, parameters.

Of a third of the effects beside those that `test_own_effects` sees; of all: ``benchmarks/copies.py --units``.
"""

import functools

import pytest
import rigs
import test_own_effects as copies
from units_apart import OTHER, SCALES, alike, candidate, diagnosed, drawn, near, scales_of

RIVALS = ("quadratic_drag", "asymmetric_coulomb")
# a threshold, a damping, a stiffness of another power, a channel's level, a time
KINDS = [e for e in rigs.ORDER if e not in (*copies.FAST, *copies.SLOW)][2::3]


@functools.cache
def first(hidden, *rivals):
    return diagnosed(hidden, (candidate(hidden), *rivals))


@pytest.mark.parametrize("scale", SCALES)
def test_rivals_are_ranked_alike(scale):
    before = first("linear_spring", *RIVALS)
    after = diagnosed("linear_spring", ("linear_spring", *RIVALS), *scale)
    assert [c.id for c in after.ranking] == [c.id for c in before.ranking]
    alike(before, after, scale)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hidden", "scale"), [(e, scales_of(e)[i % 3]) for i, e in enumerate((*KINDS, *OTHER))]
)
def test_other_units_alter_nothing(hidden, scale):
    found = first(hidden)
    assert found.verdict == "effect" and found.best.id == candidate(hidden)
    alike(found, diagnosed(hidden, (candidate(hidden),), *scale), scale)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hidden", "scale"), [("stiction", SCALES[0]), ("loose_linkage", SCALES[1]), ("backlash", SCALES[2])]
)
def test_events_are_no_matter_of_rounding(hidden, scale):
    near(first(hidden), diagnosed(hidden, (candidate(hidden),), *scale), scale)


@pytest.mark.slow
def test_what_is_named_has_the_parameters_of_a_whole_refit():
    # over the segments that judge a gap of 2.6 mm, with three times the errors, does as well as the true one
    truth = drawn("backlash").truth
    best = first("backlash").best
    for name, value in best.parameters.items():
        assert abs(value - truth[f"backlash.{name}"]) < 3 * best.errors[name]  # measured: 0.1 to 1.2
