"""What was asked before makes no difference to an answer: forced orbits take values and return them."""

import ast
from pathlib import Path

import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.df import forced_orbit
from ctrl_df.df.forced_orbit.damped import close_damped
from ctrl_df.df.forced_orbit.driven_block import DrivenBlock
from ctrl_df.df.forced_orbit.forced_map import Force, ForcedMap, Work
from ctrl_df.df.forced_orbit.orbit_search import close_orbit
from ctrl_df.df.forced_orbit.orbits import OrbitSolver
from ctrl_df.df.forced_orbit.periodic_response import PeriodicResponse

STRIBECK = cdf.Mass(9).with_effect(cdf.Coulomb(5)).with_effect(cdf.Viscous(0.5))
STRIBECK = STRIBECK.with_effect(cdf.Stribeck(7.5, 0.05))
DUFFING = cdf.Mass(1).with_effect(cdf.Viscous(0.3)).with_effect(cdf.CubicSpring(5.0))
GAP = cdf.backlash_masses(1, 8, 0.018, 0.2)

BLOCKS = pytest.mark.parametrize("block", [STRIBECK, DUFFING, GAP], ids=["stribeck", "duffing", "gap"])

WAVE, OMEGA = np.array([0.0, 20.0, 0.0, 3.0]), 6.0


def asked(response, how):
    if how == "any":
        return response(WAVE, OMEGA)
    return response.nearest(WAVE, OMEGA, lambda Y: abs(Y[1]), 1e-9)


@BLOCKS
def test_a_response_without_a_motion_is_that_of_the_first_call(block):
    used = PeriodicResponse(block, "x")
    for amplitude, omega in ((30.0, 5.0), (8.0, 40.0), (0.5, 2.0)):
        used([0.0, amplitude, 0.1, 0.0], omega)
    for how in ("any", "nearest"):
        (Y, motion), (first, of_first) = asked(used, how), asked(PeriodicResponse(block, "x"), how)
        assert first is not None and np.array_equal(Y, first)
        assert np.array_equal(motion.state.x, of_first.state.x)


@BLOCKS
def test_a_point_without_a_start_is_that_of_the_first_call(block):
    used, unused = OrbitSolver(DrivenBlock(block)), OrbitSolver(DrivenBlock(block))
    for A, omega in ((30.0, 5.0), (8.0, 40.0), (0.5, 2.0)):
        used.solve(A, omega, 5)
    point, first = used.solve(20.0, OMEGA, 5), unused.solve(20.0, OMEGA, 5)
    assert np.array_equal(point.harmonics, first.harmonics) and point.regime == first.regime


def test_damped_steps_leave_what_secant_steps_go_on_with():
    block = DrivenBlock(DUFFING)
    laws = block.laws_for(20.0, OMEGA)
    forced_map = ForcedMap(block, laws, Force.of([0.0, 20.0], OMEGA), Work(100_000))
    orbit, _ = close_orbit(forced_map, forced_map.after(forced_map.at_rest(), 20), orders=3)
    size, jacobian = (kept.copy() for kept in (laws.period_map.size, laws.period_map.jacobian))
    assert orbit is not None
    again = close_damped(forced_map, orbit.state, orders=3)
    assert again is not None
    np.testing.assert_allclose(again.state.x, orbit.state.x, rtol=1e-6)
    assert np.array_equal(laws.period_map.size, size)
    assert np.array_equal(laws.period_map.jacobian, jacobian)


def test_methods_of_forced_orbits_reassign_no_attributes():
    found = []
    for path in sorted(Path(forced_orbit.__file__).parent.glob("*.py")):
        for owner in ast.walk(ast.parse(path.read_text())):
            if not isinstance(owner, ast.ClassDef) or owner.name == "Work":  # the counter of steps
                continue
            methods = (f for f in owner.body if isinstance(f, ast.FunctionDef) and f.name != "__init__")
            found += [
                f"{path.name}: {owner.name}.{method.name} sets {node.attr}"
                for method in methods
                for node in ast.walk(method)
                if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store)
            ]
    assert not found, found
