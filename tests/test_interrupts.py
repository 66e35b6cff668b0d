"""Ctrl-C ends compiled work within a second, and what a user's function raises is told, not swallowed.

Signals are sent from outside to a process of its own, as a terminal would: compiled code holds the
interpreter, so no thread of the same process could send one.
"""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import control as ct
import numpy as np
import pytest

import ctrl_df as cdf

pytestmark = pytest.mark.skipif(os.name == "nt", reason="no POSIX signals")

ROOT = Path(cdf.__file__).parents[1]

WORK = """
import json, os, subprocess, sys, time, warnings
import control as ct, numpy as np, ctrl_df as cdf
warnings.simplefilter("ignore")

L = cdf.closed_loop(cdf.pid(2000, 44250, 130), cdf.friction_mass(9, 5, 0.5, 5.5))
def law(t, x, u, p):
    return [x[1], u[0] - x[0] - (x[0] ** 2 - 1) * x[1]]
def slow(t, x, u, p):
    time.sleep(1e-3)
    return law(t, x, u, p)
def read(t, x, u, p):
    return x[:1]
user, sleepy = (ct.nlsys(f, read, states=2, inputs=1, outputs=1) for f in (law, slow))
wide = ct.ss(-np.eye(300) + np.diag(np.ones(299), 1), np.ones((300, 1)), np.ones((1, 300)), 0)
A, W = np.geomspace(5.2, 60, 9), np.geomspace(4, 40, 9)
def search():
    response = cdf.describing_function_response(
        cdf.pid(2000, 44250, 130), cdf.friction_mass(9, 5, 0.5), A, W)
    while True:
        cdf.verify(response)
def find():
    while True:
        cdf.find_limit_cycle(L)
def find_in_a_law_of_the_users():
    loop = cdf.closed_loop(ct.tf([5.0], [1, 1]), sleepy)
    while True:
        cdf.find_limit_cycle(loop)
long = np.linspace(0, 1e7, 11)
CASES = {
    "friction loop": lambda: cdf.event_response(L, long, 0, [0, 1e-3, 0]),
    "many states": lambda: cdf.event_response(wide, long, lambda t: np.sin(50 * t), 0, max_step=1e-3),
    "law of the user's": lambda: cdf.event_response(user, long, 1, [1, 0]),
    "slow law of the user's": lambda: cdf.event_response(sleepy, long, 1, [1, 0]),
    "input of the user's": lambda: cdf.event_response(L, long, lambda t: 1e-3 * np.sin(t)),
    "find_limit_cycle": find,
    "find_limit_cycle, law of the user's": find_in_a_law_of_the_users,
    "verify": search,
    "many runs": lambda: cdf.batch_response(L, [0, 10], 0, np.full((10**6, 3), 1e-3)),
    "one long run of many": lambda: cdf.batch_response(L, [0, 1e7], 0, [0, 1e-3, 0]),
    "many runs of a law of the user's": lambda: cdf.batch_response(user, [0, 1e3], 1, np.ones((10**4, 2))),
}
LATER = {"many runs": 0.6, "one long run of many": 0.6, "many runs of a law of the user's": 0.6}  # [s]
cdf.batch_response(L, [0, 1])
cdf.batch_response(user, [0, 1])
cdf.event_response(L, [0, 1], 0, [0, 1e-3, 0])
cdf.event_response(user, [0, 1], 0, [1, 0])
cdf.find_limit_cycle(L)
SEND = (  # when is told by the sender, which may start late
    "import os, signal, sys, time; time.sleep(float(sys.argv[1]));"
    "print(time.time(), flush=True); os.kill(int(sys.argv[2]), signal.SIGINT)"
)
answers = {}
for name in CASES:
    send = [sys.executable, "-c", SEND, str(LATER.get(name, 0.2)), str(os.getpid())]
    child = subprocess.Popen(send, stdout=subprocess.PIPE)
    outcome = "returned"
    try:
        try:
            CASES[name]()
        finally:
            sent = float(child.communicate()[0])
    except KeyboardInterrupt:
        outcome = "interrupted"
    except BaseException as error:
        outcome = repr(error)
    answers[name] = (outcome, time.time() - sent)
print(json.dumps(answers))
"""


def test_ctrl_c_ends_compiled_work_within_a_second():
    done = subprocess.run([sys.executable, "-c", WORK], capture_output=True, text=True, timeout=300, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    assert "Exception ignored" not in done.stderr, done.stderr
    answers = json.loads(done.stdout)
    assert len(answers) == 11
    for name, (outcome, late) in answers.items():
        assert outcome == "interrupted", f"{name}: {outcome}"
        assert late < 1.0, f"{name}: {late:.2f} s"  # measured 0.03 at worst


def test_ctrl_c_leaves_the_handler_as_it_was():
    before = signal.getsignal(signal.SIGINT)
    cdf.event_response(ct.tf([1], [1, 1]), [0, 1], lambda t: t)
    assert signal.getsignal(signal.SIGINT) is before


# --- what a user's function raises -------------------------------------------------------------------------


def _broken(t, x, u, params):
    if abs(x[0]) > 0.5:
        raise KeyError("no such row in the friction map")
    return [x[1], u[0] - x[1] + 4 * x[0]]


BROKEN = ct.nlsys(_broken, lambda t, x, u, params: [x[0]], states=2, inputs=1, outputs=["x"], name="rig")


def test_a_law_that_raises_inside_find_limit_cycle_is_told():
    loop = cdf.closed_loop(cdf.pid(2), BROKEN)
    with pytest.raises(RuntimeError, match="user-written law.*friction map") as caught:
        cdf.find_limit_cycle(loop)
    assert isinstance(caught.value.__cause__, KeyError)


def test_a_law_that_raises_inside_verify_is_told():
    def law(u):
        if abs(u) > 6:
            raise ZeroDivisionError("beyond the table")
        return min(max(u, -1.0), 1.0)

    H = ct.tf([12], [1, 2, 2, 1])
    response = cdf.describing_function_response(H, cdf.saturation(1.0), np.linspace(1.5, 5.5, 5))
    assert response.limit_cycles
    with pytest.raises(RuntimeError, match="user-written law.*beyond the table"):
        cdf.verify(response, loop=cdf.closed_loop(H, law))


def test_a_law_that_raises_is_told_by_event_response():
    with pytest.raises(RuntimeError, match="user-written law.*friction map"):
        cdf.event_response(BROKEN, [0, 10], 1.0)


def test_a_law_that_returns_nan_text_or_complex_is_told():
    for value, words in ((float("nan"), "returned NaN at t"), ("a", "real numbers"), (1j, "real numbers")):
        block = ct.nlsys(
            lambda t, x, u, p, v=value: [v if t > 0.1 else 0.0],
            lambda t, x, u, p: x,
            states=1,
            inputs=1,
            outputs=1,
        )
        with pytest.raises(RuntimeError, match=words):
            cdf.event_response(block, [0, 1], 1.0)


def test_a_trial_step_into_nan_is_retried_not_told():
    """A tank runs empty: trial steps look below zero, where the root of the level is NaN."""
    met = []

    def flow(t, x, u, params):
        with np.errstate(invalid="ignore"):
            rate = u[0] - np.sqrt(x[0])
        met.append(np.isnan(rate))
        return [rate]

    tank = ct.nlsys(flow, lambda t, x, u, p: x, states=1, inputs=1, outputs=1)
    times = np.linspace(0, 60, 61)
    inflow = np.where((times > 5) & (times < 20), 2.0, 1e-3)
    response = cdf.event_response(tank, times, inflow, [1e-6], input_hold="zoh", rtol=1e-4)
    assert any(met) and response.status.ok
    assert response.outputs[-1] == pytest.approx(1e-6, rel=0.1)


def test_a_state_beyond_the_range_of_floats_is_divergence_not_an_error_of_the_law():
    block = ct.nlsys(
        lambda t, x, u, p: [float(x[0]) ** 3 + 1.0], lambda t, x, u, p: x, states=1, inputs=1, outputs=1
    )
    with pytest.warns(RuntimeWarning, match="ended at t"):
        response = cdf.event_response(block, [0, 1, 5], 0.0, [1e100])
    assert not response.status.ok
