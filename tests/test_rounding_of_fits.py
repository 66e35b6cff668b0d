"""Rounding of the arithmetic decides nothing in a fit: neither which step it takes nor where it ends."""

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.identify.prediction.segments import equal_segments
from ctrl_df.identify.shooting.elimination import rounded_moves
from ctrl_df.identify.shooting.least_squares import Stage
from ctrl_df.identify.shooting.problem import Problem, Settings
from ctrl_df.identify.shooting.restarts import _ends
from ctrl_df.identify.shooting.variables import Variable

rng = np.random.default_rng(3)
CURVATURE, POWER = 10.0 ** rng.uniform(2, 8, 50), 0.3
MOVES = rng.standard_normal(50) / np.sqrt(CURVATURE)


def test_steps_do_not_hang_on_the_last_digits():
    steps = rounded_moves(MOVES, 1.0, CURVATURE, POWER)
    again = rounded_moves(MOVES * (1 + 1e-10), 1.0, CURVATURE * (1 - 1e-10), POWER * (1 + 1e-10))
    assert np.array_equal(steps, again)
    # in another unit the same, to the last digit that a product has
    other = rounded_moves(1e-6 * MOVES, 1e-6, 1e12 * CURVATURE, POWER)
    assert 1e6 * other == pytest.approx(steps, rel=1e-15)


def test_rounded_steps_cost_next_to_nothing():
    lost = CURVATURE * (rounded_moves(MOVES, 1.0, CURVATURE, POWER) - MOVES) ** 2
    assert np.mean(lost) < POWER / 1000 and np.max(lost) < POWER / 500
    assert not np.any(rounded_moves(np.zeros(3), 1.0, np.array([0.0, 1e-300, 1.0]), 0.0))


def test_a_level_that_nothing_passes_has_no_derivative():
    # it begins to move and never stops: where it sticks no more, rounding is all that the level changes
    t = np.linspace(0, 2, 400)
    model = cdf.Mass(2.0, [cdf.Coulomb(1.0), cdf.Stiction(1.31)])
    force = 7.3 + np.sin(9 * t)
    x = np.asarray(cdf.event_response(model, t, force).outputs)[0]
    record = cdf.Measurement(
        t, force, x + 1e-5 * rng.standard_normal(t.size), input_unit="N", output_unit="m"
    )
    problem = Problem(model, [record], ("coulomb.level", "stiction.level"), 100)
    stage = Stage(problem, [equal_segments(record, 4)], 1)
    theta, states = problem.start(), stage.initial_states
    base = stage.simulate(theta, states.values)
    (columns,), _ = stage.jacobian(theta, states, base)
    assert np.max(np.abs(columns[:, 0])) > 0 and not columns[:, 1].any()
    for digits, seen in ((1e-15, False), (1e-9, True)):
        moved = [y + digits * np.max(np.abs(y)) * rng.standard_normal(y.size) for y in base]
        (column,) = stage._columns(1, moved, base, [1e-3, 1e-3])
        assert column.any() == seen


@pytest.mark.parametrize("digits", [-2e-16, 0.0, 2e-16])
def test_what_stands_on_a_bound_has_no_room_beyond(digits):
    # rounded below its bound or above: the next step may not hang on it
    limit = 0.3
    table = cdf.Mass(2.0, [cdf.Viscous(limit)]).parameters
    variable = Variable("viscous.coefficient", table["viscous.coefficient"], 1.0, (limit, 20.0))
    q = variable.clip(variable.q(limit)) + digits
    assert not variable.has_room(q, -1e-9) and variable.has_room(q, 1e-9)


def test_tries_that_come_to_the_same_are_taken_in_their_order():
    stage = SimpleNamespace(problem=SimpleNamespace(settings=Settings()))
    trials = np.arange(3.0)[:, None, None] * np.ones((2, 1))
    for digits in (-1e-12, 0.0, 1e-12):
        powers = np.array([[2.0, 3.0], [1.0, 0.5], [1.0 + digits, 0.4]])
        ((start, _),) = _ends(stage, None, 0, None, trials, powers)
        assert start.ravel().tolist() == [1.0, 2.0]


@pytest.mark.parametrize("error, given_up", [(1.0, False), (3.0, True)])
def test_an_exact_start_has_no_pace(error, given_up):
    """From an error of zero any step errs infinitely more, and powers of that are no numbers."""
    residual = [np.full(4, error)]
    problem = SimpleNamespace(settings=SimpleNamespace(give_up=2.0), given_up=[])
    problem.gives_up = partial(Problem.gives_up, problem)
    stage = SimpleNamespace(problem=problem, power=lambda r: (np.sum(r[0] ** 2), 4))
    assert bool(Stage.too_far(stage, residual, 1e300, 8)) is given_up
    assert bool(problem.given_up) is given_up
