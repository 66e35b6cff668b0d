"""The rate limiter in time: it catches up with its input, follows it, falls behind, at jumps as well."""

from typing import Any

import control as ct
import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.status import Status

T = np.linspace(0, 5, 201)


def limited(u, rate, hold="linear", steps=400):
    """The output at the samples, by short steps none of which is longer than the rate allows."""
    y, out, h = 0.0, np.empty(len(T)), (T[1] - T[0]) / steps
    for k in range(len(T)):
        out[k] = y
        if k + 1 < len(T):
            end = u[k + 1] if hold == "linear" else u[k]
            for value in np.linspace(u[k], end, steps + 1)[1:]:
                y += min(max(value - y, -rate * h), rate * h)
    return out


def signal(seed):
    """A step, sines of any speed, steps of several heights; they begin at zero."""
    rng = np.random.default_rng([44, seed])
    a, omega = rng.uniform(0.3, 3), rng.uniform(0.5, 8)
    if seed % 3 == 0:
        return a * np.sign(np.sin(omega * T))
    return a * np.sin(omega * T) + (0.3 * np.sin(5 * omega * T) if seed % 3 == 1 else 0)


@pytest.mark.parametrize("seed", range(9))
@pytest.mark.parametrize("hold", ["linear", "zoh"])
def test_rate_limiter_against_stepping_in_time(hold, seed):
    u, rate = signal(seed), np.random.default_rng([45, seed]).uniform(0.5, 4)
    run = cdf.event_response(cdf.rate_limiter(rate), T, u, input_hold=hold)
    assert run.status is Status.CONVERGED and run.event_count < 2 * len(T)
    # the reference catches up a step of 62 us late; worst of 18: 1.9e-4
    assert np.abs(np.asarray(run.outputs) - limited(u, rate, hold)).max() < 1e-3


def test_rate_limiter_follows_once_it_has_caught_up():
    run = cdf.event_response(cdf.rate_limiter(2.5), T, np.ones_like(T))
    assert [e.kind for e in run.events] == ["disengage"]  # 2002 of them and an early end before
    assert np.asarray(run.outputs) == pytest.approx(np.minimum(2.5 * T, 1.0), abs=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_rate_limiter_in_a_loop_against_python_control(seed):
    rng = np.random.default_rng([46, seed])
    rate, kp, ki, lag = rng.uniform(0.3, 3), rng.uniform(0.5, 4), rng.uniform(0, 3), rng.uniform(0.1, 1)
    limiter = cdf.rate_limiter(rate).copy(name="L")
    (enters,), (leaves,) = limiter.input_labels, limiter.output_labels
    loop = ct.interconnect(
        [
            ct.ss(ct.tf([kp, ki], [1, 0]), name="C", inputs="e", outputs="u"),
            ct.ss(ct.tf([1], [lag, 1]), name="P", inputs="v", outputs="y"),
            limiter,
        ],
        connections=[["C.e", "-P.y"], [f"L.{enters}", "C.u"], ["P.v", f"L.{leaves}"]],
        inplist=["C.e"], inputs=["r"], outlist=["P.y"], outputs=["y"],
    )  # fmt: skip
    r: Any = np.ones_like(T) if seed % 2 else np.sin(rng.uniform(0.5, 4) * T)
    run = cdf.event_response(loop, T, r)
    assert run.status is Status.CONVERGED and run.event_count < 50
    options = dict(rtol=1e-6, max_step=0.05)
    reference = ct.input_output_response(loop, T, r, 0, solve_ivp_kwargs=options).outputs
    # python-control rounds the corner at which the limiter catches up; worst of 4: 1.0e-3
    assert np.abs(np.asarray(run.outputs) - reference).max() < 5e-3
