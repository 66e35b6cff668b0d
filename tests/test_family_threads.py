"""Families, scans of starts, Poincaré maps in one call: the numbers are those of one run after the other."""

import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.df import threads, work
from ctrl_df.df.dispatch import method_for
from ctrl_df.limit_cycles.finder import OrbitFinder
from ctrl_df.simulate.engine import Engine, constant_drive
from ctrl_df.simulate.kernel.run import reasons
from ctrl_df.simulate.mode_flow import flow
from ctrl_df.simulate.section import intervals

HARDENING = cdf.Mass(9.0, [cdf.Coulomb(5), cdf.Viscous(0.5), cdf.LinearSpring(200.0), cdf.CubicSpring(1e5)])
A, OMEGA = np.linspace(8, 60, 5), np.linspace(6, 30, 5)


@pytest.mark.filterwarnings("ignore:.*aperiodic:RuntimeWarning")
@pytest.mark.parametrize("block", [HARDENING, cdf.backlash_masses(1, 8, 0.018, 0.8)])
def test_a_family_does_not_depend_on_the_number_of_threads(block, monkeypatch):
    families = []
    for count in (1, 2, 3):
        monkeypatch.setattr(work, "processors", lambda count=count: count)
        families.append(cdf.describing_function_family(block, A, OMEGA))
    for other in families[1:]:
        assert np.array_equal(other.harmonics, families[0].harmonics, equal_nan=True)
        assert np.array_equal(other.regime, families[0].regime)
        assert np.array_equal(other.residual, families[0].residual, equal_nan=True)


def test_a_law_that_calls_python_is_asked_in_one_thread():
    block = cdf.friction_mass(9, 5, 0.5)
    assert method_for(HARDENING, "x").compiled() and method_for(block).compiled()
    assert not method_for(np.sin).compiled()


def test_work_on_threads_stops_where_one_part_fails():
    def part(k):
        if k == 1:
            raise ValueError("one")
        while True:
            threads.go_on()

    with pytest.raises(ValueError, match="one"):
        threads.on_threads(part, [(1,), (2,)], 2)


def test_crossings_are_those_of_single_runs():
    finder = OrbitFinder(cdf.closed_loop(cdf.pid(2000, 44250, 130), cdf.friction_mass(9, 5, 0.5, 5.5)))
    search, engine = finder.poincare, finder.engine
    state = search.start(search.starts.state(3 * search.starts.scale))
    mine = intervals(engine, state, search._signal, search.row, search.longest, np.inf, 1e-8)
    before = []
    for _ in range(70):  # more than are made in one call
        ahead = 4 * (before[-1] - before[-2]) if len(before) >= 2 else search.longest
        share = np.linspace(0.0, 1.0, 129)
        if len(before) < 2:  # any of six decades: nobody knows yet how long an interval is
            share[1:] = 10.0 ** (6.0 * (share[1:] - 1.0))
        times = state.time + share * ahead
        run = engine.run(
            state,
            state.time + ahead,
            times=times,
            rtol=1e-8,
            watch=search._signal,
            log=1,
            max_steps=400_000,
        )
        state, interval = run.state, next(mine)
        assert interval.crossed == (run.reason == reasons.SECTION)
        assert np.isclose(interval.time, state.time, rtol=1e-12, atol=0)
        assert np.allclose(interval.x, state.x, rtol=1e-9, atol=1e-12 * np.max(np.abs(state.x)))
        peak = np.max(np.abs(run.outputs[: run.recorded, search.row]))
        assert np.isclose(interval.peak, peak, rtol=1e-9)
        if interval.crossed:
            before.append(state.time)


def test_states_beside_one_another_go_where_each_goes_alone():
    engine = Engine(HARDENING)
    state = engine.run(engine.start([0.01, 0.3]), 0.05).state
    x = state.x + 1e-4 * np.array([[1, 0], [0, 1], [-1, 1]])
    drive, ends = constant_drive([0.0]), []
    for start in x:
        moved = state.copy()
        moved.x[:] = start
        ends.append(engine.run(moved, state.time + 0.1, drive, rtol=1e-11, locate=False).state.x)
    assert np.allclose(flow(engine, state, x, 0.1, drive, 1e-11), ends, rtol=1e-10)
