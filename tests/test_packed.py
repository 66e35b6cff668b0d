"""What runs work in, laid out in memory for compiled code; engines kept, steps at a pace made on demand."""

from typing import NamedTuple

import numpy as np

import ctrl_df as cdf
from ctrl_df.simulate.compiler.compiled import njit
from ctrl_df.simulate.compiler.packed import Layout, address_of
from ctrl_df.simulate.engine import Engine, sampled_drive

T = 1e-3 * np.arange(2000)
FORCE = 20 * np.sin(8.2 * T) + 8 * np.sin(23.3 * T + 1)
AXIS = cdf.friction_mass(2, 5, 0.5)


class Inner(NamedTuple):
    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    d: np.ndarray
    e: np.ndarray
    f: np.ndarray
    g: np.ndarray
    h: np.ndarray
    i: np.ndarray


class Outer(NamedTuple):
    count: int
    table: np.ndarray
    both: tuple
    inner: Inner
    last: np.ndarray


LAYOUT = Layout()
outer_at = LAYOUT.opener()


@njit(cache=False)
def _read(address):
    outer = outer_at(address)
    wide = outer.inner
    wide.i[0] = 7.0
    return (
        outer.count + outer.table[1, 2] + outer.both[1][0] + wide.b[1] + outer.last[1] + outer.table.shape[0]
    )


def test_fields_are_read_and_written_where_they_lie():
    inner = Inner(*(np.arange(2.0) + 10 * k for k in range(9)))
    both = (np.zeros(1), np.array([3], np.int64))
    outer = Outer(5, np.arange(6.0).reshape(2, 3), both, inner, np.array([0.0, 0.5]))
    words = LAYOUT.pack(outer)
    assert _read(address_of(words)) == 5 + 5 + 3 + 11 + 0.5 + 2
    assert inner.i[0] == 7.0


def test_words_keep_their_arrays_alive():
    inner = Inner(*(np.full(100_000, float(k)) for k in range(9)))
    words = LAYOUT.pack(Outer(0, np.zeros((2, 3)), (np.zeros(1), np.zeros(1, np.int64)), inner, np.zeros(2)))
    del inner
    other = [np.full(100_000, -1.0) for _ in range(9)]
    assert _read(address_of(words)) == 1.0 + 2 and len(other) == 9


def test_steps_at_a_pace_are_asked_for_by_runs_that_have_one():
    engine = Engine(AXIS)
    engine.run(engine.start(), 0.1)
    assert engine.space.paced[0] == 0
    engine.run(engine.start(), 0.1, None, np.linspace(0, 0.1, 20))
    assert engine.space.paced[0] != 0


def test_samples_with_and_without_outputs_give_the_same_bits():
    engine = Engine(AXIS)
    for hold in ("zoh", "linear"):
        drive = sampled_drive(T, FORCE, hold)
        every = engine.run(engine.start(), T[-1], drive, T)
        third = engine.run(engine.start(), T[-1], drive, T[::3])
        late = engine.run(engine.start(), T[-1], drive, T[1500:])
        assert every.propagated == third.propagated == late.propagated > 1900
        np.testing.assert_array_equal(every.outputs[::3], third.outputs)
        np.testing.assert_array_equal(every.states[1500:], late.states)


def test_a_response_is_the_same_again_and_after_others():
    def once(block):
        run = cdf.event_response(block, T, FORCE, input_hold="zoh")
        return np.asarray(run.states), np.asarray(run.outputs)

    first = once(AXIS)
    again = once(AXIS)
    once(cdf.friction_mass(3, 4, 0.1))
    cdf.event_response(AXIS, T[:50], 3.0, {"x": 0.1})
    for run in (again, once(AXIS), once(cdf.friction_mass(2, 5, 0.5))):
        np.testing.assert_array_equal(run[0], first[0])
        np.testing.assert_array_equal(run[1], first[1])


def test_results_do_not_share_memory_with_each_other_or_the_input():
    one = cdf.event_response(AXIS, T, FORCE)
    two = cdf.event_response(AXIS, T, FORCE)
    kept, states = FORCE.copy(), np.array(two.states)
    one.x[:], one.y[:], one.u[:] = 0.0, 0.0, 0.0
    np.testing.assert_array_equal(FORCE, kept)
    np.testing.assert_array_equal(two.states, states)


def test_an_input_may_simulate_the_same_mechanism():
    axis, t = cdf.friction_mass(2, 5, 0.5), np.linspace(0, 0.2, 5)

    def plain(time):
        return 8.0 + 10.0 * time

    def simulating(time):
        cdf.event_response(axis, [0.0, 0.1], 20.0)
        return plain(time)

    a, b = (cdf.event_response(axis, t, u) for u in (plain, simulating))
    np.testing.assert_array_equal(a.states, b.states)
