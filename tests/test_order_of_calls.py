"""What was asked before makes no difference to an answer: methods take values and return them."""

import ast
import functools
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


PACKAGES = ("identify", "gains", "limit_cycles", "df", "simulate")

BEGINNINGS = {"__init__", "__post_init__", "__setstate__"}

HOLD = {
    # what a user waits for
    "identify/monitor.py: Monitor": "how far a computation came, and the last result known",
    "identify/interrupts.py: Interrupts": "whether Ctrl-C was received",
    "simulate/compiler/notice.py: _Wait": "whether it was said that a function is compiled",
    # work on its way, each object made for one piece of it
    "df/work.py: Work": "the parts of a family that are done",
    "df/forced_orbit/forced_map.py: Work": "steps that are left for one point",
    "df/saving/fingerprint.py: _Walk": "where one descent through objects stands",
    "identify/shooting/problem.py: Problem": "simulations that one fit has made",
    "identify/shooting/states.py: _Record": "segments that are open in one search for initial states",
    "identify/tables/fit.py: _Fit": "tables that one fit has computed, and the best",
    # what is kept because it is asked for again: the same whoever asks
    "identify/prediction/batch.py: Batch": "the last inputs, as the engine takes them",
    "identify/prediction/beginnings.py: Beginnings": "accelerations where the last segments begin",
    # the compiler's
    "simulate/compiler/garbage.py: FewerCollections": "whether a function is being compiled",
    "simulate/compiler/packed.py: Layout": "types, learnt from the first tuple",
    "simulate/compiler/parts.py: PartLibrary": "numba's own mark of a library that is complete",
    "simulate/program/pointers.py: _Guarded": "that the motion left the range of floats just before",
}
"""Classes whose methods assign attributes, and what these say."""


@functools.cache
def assigned():
    """Return (class, method, what) of all attributes that methods assign on their own object or its parts.

    Not what they fill in place: arrays of a workspace, dictionaries of what is kept.
    """
    root, found = Path(cdf.__file__).parent, []
    for path in (p for package in PACKAGES for p in sorted((root / package).rglob("*.py"))):
        for owner in ast.walk(ast.parse(path.read_text())):
            if isinstance(owner, ast.ClassDef):
                name = f"{path.relative_to(root).as_posix()}: {owner.name}"
                found += [(name, method, what) for method, what in assignments(owner)]
    return found


def assignments(owner):
    """Yield method and attribute of all that a class assigns on `self`."""
    for method in owner.body:
        if not isinstance(method, ast.FunctionDef) or method.name in BEGINNINGS or not method.args.args:
            continue
        own = method.args.args[0].arg
        for node in ast.walk(method):
            if isinstance(node, ast.Attribute) and not isinstance(node.ctx, ast.Load):
                written = ast.unparse(node)
            elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith("setattr__"):
                written = f"{ast.unparse(node.args[0])}.{ast.unparse(node.args[1])}"
            else:
                continue
            if written.startswith(f"{own}."):
                yield method.name, written


def test_methods_assign_no_attributes_but_where_these_are_progress():
    found = [f"{name}.{method} sets {what}" for name, method, what in assigned() if name not in HOLD]
    assert not found, "\n".join(found)


def test_every_class_named_as_holding_progress_does():
    assert {*HOLD} == {name for name, _, _ in assigned()} and len(HOLD) <= 15


def test_methods_of_forced_orbits_assign_no_attributes_of_anything():
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
