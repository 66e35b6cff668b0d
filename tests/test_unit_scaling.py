"""Units are a matter of writing: others alter neither verdict nor evidence nor, converted, parameters.

Of a third of the effects, and of the order of rivals, `test_own_effects` holds it; here are parameters of
other dimensions, models of other kinds and events. Of all effects: ``benchmarks/copies.py --units``.
"""

import functools

import pytest
import scaled
from test_frequency import FEW, MIDDLE, table, user_block
from units_apart import SCALES, alike, candidate, diagnosed, drawn, scales_of
from user_copies import copied

import ctrl_df as cdf

# a stiffness of another power, a time, an imposed motion, a voltage
KINDS = ("cubic_spring", "input_lag", "loose_linkage", "torque_constant")


@functools.cache
def first(hidden):
    return diagnosed(hidden, (candidate(hidden),))


@pytest.mark.slow
@pytest.mark.parametrize(("hidden", "scale"), [(e, scales_of(e)[i % 3]) for i, e in enumerate(KINDS)])
def test_other_units_alter_nothing(hidden, scale):
    found = first(hidden)
    assert found.verdict == "effect" and found.best.id == candidate(hidden)
    alike(found, diagnosed(hidden, (candidate(hidden),), *scale), scale)


@pytest.mark.slow
def test_other_units_alter_nothing_of_a_table():
    data, scale, few = table(grid=MIDDLE, DRAG=60.0), SCALES[2], FEW[:2]
    found = cdf.diagnose(user_block(), data, candidates=few)
    again = cdf.diagnose(scaled.block(user_block(), *scale), scaled.frequency(data, *scale), candidates=few)
    assert found.verdict == "effect"
    alike(found, again, scale)


@pytest.mark.slow
def test_events_are_no_matter_of_rounding():
    alike(first("stiction"), diagnosed("stiction", ("stiction",), *SCALES[0]), SCALES[0])


@pytest.mark.slow
def test_a_copy_of_a_gap_in_units_that_round_is_found_as_the_original_is(tmp_path):
    original = first("backlash")
    with copied(cdf.Backlash, tmp_path) as own:
        copy = diagnosed("backlash", (own,), *SCALES[2])
    assert original.verdict == "effect" and original.best.id == "backlash" and copy.best.id == own.id
    alike(original, copy, SCALES[2])
    # over the segments that judge a gap of 2.6 mm, with three times the errors, does as well as the true one:
    # what is named has the parameters of a whole refit
    truth = drawn("backlash").truth
    for name, value in original.best.parameters.items():
        assert abs(value - truth[f"backlash.{name}"]) < 3 * original.best.errors[name]  # measured: 0.1 to 1.2
