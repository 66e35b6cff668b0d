"""Joints, contacts and presliding by laws of a user's own, against SciPy."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import ctrl_df as cdf

T = np.linspace(0, 4, 801)


def push(t):
    return 9.0 * np.sin(6.0 * t) + 4.0 * np.sin(2.3 * t)


@dataclass(frozen=True)
class Shaft(cdf.Effect):
    """A joint that hardens, with a lag of its own (a standard linear solid)."""

    stiffness: float = cdf.parameter("N/m")
    cubic: float = cdf.parameter("N/m^3")
    side: float = cdf.parameter("N/m")
    time: float = cdf.parameter("s")
    load_fraction: float = cdf.parameter("", default=0.4)

    role: ClassVar[str] = "coupling"
    states: ClassVar[int] = 1

    @staticmethod
    def law(t, x, v, z, p, dz):
        dz[0] = (x - z[0]) / p[3]
        return p[0] * x + p[1] * x * x * x + p[2] * (x - z[0])


@dataclass(frozen=True)
class Bumper(cdf.Effect):
    """Stops of rubber, Hunt and Crossley's law."""

    limit: float = cdf.parameter("m")
    stiffness: float = cdf.parameter("N/m^2")
    loss: float = cdf.parameter("s/m")

    role: ClassVar[str] = "contact"

    @property
    def span(self):
        return -self.limit, self.limit

    @staticmethod
    def law(t, depth, rate, z, p, dz):
        return p[1] * depth**1.5 * (1.0 + p[2] * rate)


@dataclass(frozen=True)
class Slip(cdf.Effect):
    """Two bristles side by side, each with half of the level."""

    soft: float = cdf.parameter("N/m")
    stiff: float = cdf.parameter("N/m")

    role: ClassVar[str] = "presliding"
    states: ClassVar[int] = 2

    @staticmethod
    def law(v, level, z, p, dz):
        for i in range(2):
            dz[i] = v - abs(v) * p[i] * z[i] / (0.5 * level)
        return -p[0] * z[0] - p[1] * z[1]


def joint(x, v, z):
    return 300.0 * x + 5e4 * x**3 + 150.0 * (x - z), (x - z) / 0.05


def solved(rates, n, **options):
    options = {"rtol": 1e-11, "atol": 1e-13, "max_step": 0.01, **options}
    return solve_ivp(rates, (0, T[-1]), np.zeros(n), "DOP853", T, **options).y


@pytest.mark.parametrize("block", ["one", "two"])
def test_a_joint(block):
    law = Shaft(300.0, 5e4, 150.0, 0.05)
    made = {
        "one": cdf.Mass(2.0, [law, cdf.Viscous(1.0)]),
        "two": cdf.TwoMass(1.2, 0.8, [law, cdf.Viscous(1.0)]),
    }

    def rates(t, s):
        pull, lag = joint(s[2] - s[0], s[3] - s[1], s[4])
        return [s[1], pull / 0.8, s[3], (push(t) - pull - s[3]) / 1.2, lag]

    run = cdf.event_response(made[block], T, lambda t: [push(t)])
    truth = solved(rates, 5)
    assert np.max(np.abs(run.outputs[0] - truth[0])) < 1e-8 * np.ptp(truth[0])
    # the compliant form of the same block knows the same joint
    plain = made[block].updfcn(0.3, np.array([0.1, 0.2, 0.15, -0.1, 0.02]), np.array([2.0]), {})
    pull, lag = joint(0.05, -0.3, 0.02)
    assert plain == pytest.approx([0.2, pull / 0.8, -0.1, (2.0 - pull + 0.1) / 1.2, lag], rel=1e-12)


def test_a_joint_with_a_gap():
    gap = 0.02
    block = cdf.TwoMass(1.2, 0.8, [Shaft(300.0, 5e4, 0.0, 0.05), cdf.Backlash(gap), cdf.Viscous(1.0)])

    def rates(t, s):
        delta = s[2] - s[0]
        bend = delta - np.clip(delta, 0.0, gap)
        pull = joint(bend, 0.0, bend)[0]
        return [s[1], pull / 0.8, s[3], (push(t) - pull - s[3]) / 1.2]

    truth = solved(rates, 4, max_step=1e-3)
    run = cdf.event_response(block, T, lambda t: [push(t)])
    assert np.max(np.abs(run.outputs[0] - truth[0])) < 1e-7 * np.ptp(truth[0])
    assert {e.kind for e in run.events} == {"contact", "release"}


def test_stops_that_yield():
    block = cdf.Mass(1.5, [Bumper(0.25, 4e4, 0.3), cdf.Viscous(0.5)])

    def rates(t, s):
        force = push(t) - 0.5 * s[1]
        side = np.sign(s[0])
        depth = side * s[0] - 0.25
        if depth > 0:
            force -= side * max(4e4 * depth**1.5 * (1.0 + 0.3 * side * s[1]), 0.0)
        return [s[1], force / 1.5]

    truth = solved(rates, 2, max_step=5e-4)
    run = cdf.event_response(block, T, lambda t: [push(t)])
    # the reference steps over the faces: it is no better
    assert np.max(np.abs(run.outputs[0] - truth[0])) < 1e-6 * np.ptp(truth[0])
    kinds = [e.kind for e in run.events]
    assert kinds.count("contact") >= 3 and abs(kinds.count("contact") - kinds.count("release")) <= 1
    assert np.max(np.abs(truth[0])) > 0.26
    many = cdf.batch_response(block, T, push(T), params={"bumper.limit": np.array([0.25, 0.3])})
    alone = cdf.event_response(block.with_parameters({"bumper.limit": 0.3}), T, push(T))
    assert np.max(np.abs(many.outputs[1, 0] - alone.outputs[0])) < 1e-9
    started = cdf.event_response(block, T[:2], 0.0, [0.3, 0.0])  # begins inside a stop
    assert started.outputs[1][-1] < 0
    N = cdf.describing_function(block.with_effect(cdf.LinearSpring(30.0)), 20.0, 3.0)
    assert np.isfinite(N)


def test_presliding_of_two_poles():
    block = cdf.Mass(1.5, [Slip(2000.0, 400.0), cdf.Coulomb(3.0), cdf.Stribeck(4.0, 0.1), cdf.Viscous(0.5)])

    def rates(t, s):
        level = 3.0 + np.exp(-((s[1] / 0.1) ** 2))
        slide = [
            s[1] - abs(s[1]) * k * z / (0.5 * level) for k, z in zip((2000.0, 400.0), s[2:], strict=True)
        ]
        return [s[1], (push(t) - 0.5 * s[1] - 2000.0 * s[2] - 400.0 * s[3]) / 1.5, *slide]

    truth = solved(rates, 4)
    run = cdf.event_response(block, T, lambda t: [push(t)])
    assert np.max(np.abs(run.outputs[0] - truth[0])) < 1e-7 * np.ptp(truth[0])
    assert block.state_labels[2:] == ["slip_0", "slip_1"]
    # held samples run by exponential steps
    t, held = np.linspace(0, 2, 2001), push(np.linspace(0, 2, 2001))
    fast = cdf.event_response(block, t, held, input_hold="zoh")
    slow = cdf.event_response(block, t, held, input_hold="zoh", max_step=4e-4)
    assert np.max(np.abs(fast.outputs[0] - slow.outputs[0])) < 1e-7 * np.ptp(slow.outputs[0])


def test_two_laws_for_one_place_are_refused():
    with pytest.raises(ValueError, match="one Shaft and Compliance"):
        cdf.Mass(1.0, [Shaft(1.0, 1.0, 1.0, 1.0), cdf.Compliance(3.0)])
    with pytest.raises(ValueError, match="one Bumper and HardStop"):
        cdf.Mass(1.0, [Bumper(1.0, 1.0, 1.0), cdf.HardStop(2.0)])
    with pytest.raises(ValueError, match="one Slip and Bristle"):
        cdf.Mass(1.0, [Slip(1.0, 1.0), cdf.Bristle(2.0)])
