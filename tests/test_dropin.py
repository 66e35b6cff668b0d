"""ctrl_df in python-control's place: its own tests pass, and its known faults are right here."""

import importlib.util
import os
import subprocess
import sys
import warnings

import control as ct
import numpy as np
import pytest

from ctrl_df.blocks.elements.hysteresis import (
    friction_backlash_nonlinearity,
    play,
    relay_hysteresis_nonlinearity,
)
from ctrl_df.blocks.elements.memoryless import (
    DescribingFunctionNonlinearity,
    saturation,
    saturation_nonlinearity,
)
from ctrl_df.blocks.mechanism import Mass
from ctrl_df.df.describing import describing_function
from ctrl_df.limit_cycles.predicted.predict import DescribingFunctionResponse, describing_function_response
from ctrl_df.plot.describing import describing_function_plot

NAMES = {
    "describing_function": describing_function,
    "describing_function_plot": describing_function_plot,
    "describing_function_response": describing_function_response,
    "DescribingFunctionResponse": DescribingFunctionResponse,
    "DescribingFunctionNonlinearity": DescribingFunctionNonlinearity,
    "friction_backlash_nonlinearity": friction_backlash_nonlinearity,
    "relay_hysteresis_nonlinearity": relay_hysteresis_nonlinearity,
    "saturation_nonlinearity": saturation_nonlinearity,
}
PLUGIN = """
import matplotlib
matplotlib.use("Agg")
import control
import control.descfcn
from {module} import NAMES
for name, ours in NAMES.items():
    setattr(control, name, ours)
    setattr(control.descfcn, name, ours)
"""

H = ct.tf([8], [1, 2, 2, 1])
A_EXACT, W_EXACT = 3.343998730206496, np.sqrt(2)  # N(a) = 3/8 under saturation 1


def test_names_are_the_public_names_of_python_control():
    assert set(NAMES) == set(ct.descfcn.__all__)


def test_python_controls_own_tests_pass(tmp_path):
    if importlib.util.find_spec("control.tests") is None:
        pytest.skip("this installation of python-control has no tests")
    (tmp_path / "dropin_plugin.py").write_text(PLUGIN.format(module="test_dropin"))
    (tmp_path / "pytest.ini").write_text("[pytest]\n")
    here = os.path.dirname(__file__)
    path = os.pathsep.join([str(tmp_path), here, os.path.dirname(here), os.environ.get("PYTHONPATH", "")])
    outcome = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "dropin_plugin", "-p", "no:cacheprovider"]
        + ["-c", str(tmp_path / "pytest.ini"), "--pyargs", "control.tests.descfcn_test"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": path, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert outcome.returncode == 0, outcome.stdout + outcome.stderr
    assert "failed" not in outcome.stdout and "passed" in outcome.stdout


# --- the faults of python-control 0.10.2, each with the exact case ------------------------------------------


def only(response):
    (cycle,) = response.limit_cycles
    return cycle


def test_crossing_survives_scaling_of_H():
    cycle = only(
        describing_function_response(1e-4 * H, lambda u: 1e4 * np.clip(u, -1, 1), np.linspace(1, 4, 10))
    )
    assert cycle.amplitude == pytest.approx(A_EXACT, rel=1e-9)
    assert cycle.omega == pytest.approx(W_EXACT, rel=1e-9)


def test_discrete_H_is_evaluated_on_the_unit_circle():
    dt = 0.01
    Hd = ct.sample_system(ct.ss(H), dt)
    cycle = only(describing_function_response(Hd, saturation(1), np.linspace(1, 4, 10)))
    assert cycle.omega == pytest.approx(1.4090, abs=1e-4)
    z = np.exp(1j * cycle.omega * dt)
    assert abs(1 + describing_function(saturation(1), cycle.amplitude) * Hd(z)) < 1e-12


def test_nan_in_N_gives_no_crossings_and_is_counted():
    class Holey(DescribingFunctionNonlinearity):
        def __call__(self, u):
            return np.clip(u, -1, 1)

        def describing_function(self, A):
            return np.nan if A < 2 else describing_function(saturation(1), A)

    response = describing_function_response(H, Holey(), np.linspace(1, 5, 20))
    assert only(response).amplitude == pytest.approx(A_EXACT, rel=1e-9)
    assert "no periodic answer" in response.status
    empty = describing_function_response(H, Holey(), np.linspace(1, 1.9, 20))
    assert empty.limit_cycles == [] and len(empty) == 0 and "no solution" in empty.status


@pytest.mark.parametrize("slope", [0.0, 0.3, -2.0])
def test_zero_amplitude_gives_the_slope(slope):
    assert describing_function(lambda u: slope * np.sin(u), 0.0) == pytest.approx(slope, abs=1e-8)


@pytest.mark.parametrize("points", [2, 3, 10, 200])
def test_no_crossing_lost_or_doubled_on_coarse_or_fine_grids(points):
    A = np.linspace(1, 4, points)
    omega = np.logspace(-1, 2, points)
    assert only(describing_function_response(H, saturation(1), A, omega)).amplitude == pytest.approx(
        A_EXACT, rel=1e-9
    )


def test_measured_H_is_accepted_and_not_extrapolated():
    data = ct.frd(H, np.logspace(-1, 2, 60))
    cycle = only(describing_function_response(data, saturation(1), np.linspace(1, 4, 10)))
    assert cycle.amplitude == pytest.approx(A_EXACT, rel=2e-5)  # spline over 20 points a decade: 7e-6
    with pytest.raises(ValueError, match="known from 0.1 to 100"):
        describing_function_response(data, saturation(1), [1, 4], np.logspace(-2, 2, 20))


def test_asymmetric_saturation_is_right():
    A, lb, ub = 3.0, -1.0, 2.0
    theta = (np.arange(2_000_000) + 0.5) * 2 * np.pi / 2_000_000
    brute = 2 * np.mean(np.clip(A * np.cos(theta), lb, ub) * np.cos(theta)) / A
    with pytest.warns(UserWarning, match="asymmetric"):
        ours = saturation_nonlinearity(ub, lb)
    assert describing_function(ours, A) == pytest.approx(brute, rel=1e-11)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        theirs = ct.descfcn.saturation_nonlinearity(ub, lb)
    assert describing_function(theirs, A) == pytest.approx(brute, rel=1e-11)


def test_relays_are_not_sampled():
    assert describing_function(np.sign, 0.7) == pytest.approx(4 / (np.pi * 0.7), rel=1e-10)
    dead = describing_function(lambda u: 0.0 if abs(u) < 0.5 else np.sign(u), 0.7)
    assert dead == pytest.approx(4 / (np.pi * 0.7) * np.sqrt(1 - (0.5 / 0.7) ** 2), rel=1e-10)


def test_elements_keep_no_hidden_state():
    backlash = friction_backlash_nonlinearity(1.0)
    first = backlash(2.0)
    backlash(-5.0)
    assert backlash(2.0) == first


def test_calls_of_python_control_are_understood():
    assert describing_function(np.tanh, 1.0, 100, False, True) == describing_function(np.tanh, 1.0)
    assert describing_function(np.tanh, 1.0, num_points=50) == describing_function(np.tanh, 1.0)
    rough = describing_function_response(H, saturation(1), np.linspace(1, 4, 10), refine=False)
    assert rough.intersections[0] == pytest.approx((A_EXACT, W_EXACT), rel=0.05)
    a, w = next(iter(rough))
    assert (a, w) == rough[0]
    with pytest.raises(TypeError, match="unrecognized keyword"):
        describing_function(np.tanh, 1.0, unknown=1)


@pytest.mark.parametrize("names", [("a", "b"), (None, None)])
@pytest.mark.parametrize("make", [lambda name: Mass(3.0, name=name), lambda name: play(1.0, name=name)])
def test_equal_blocks_are_connected(make, names):
    # python-control keeps systems by equality
    one, other = (make(name) for name in names)
    assert (one == other) == (names == (None, None))
    inside, outside = one.input_labels[0], one.output_labels[0]
    both = ct.interconnect(
        [one, other], connections=[[f"{other.name}.{inside}", f"{one.name}.{outside}"]],
        inplist=[f"{one.name}.{inside}"], outlist=[f"{other.name}.{outside}"], inputs=["u"], outputs=["y"],
        warn_duplicate=False, check_unused=False,
    )  # fmt: skip
    assert both.nstates == len(set(both.state_labels)) == 2 * one.nstates
