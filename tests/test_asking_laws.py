"""Friction laws that ask for place, drive and load, against an integrator that knows nothing of them."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from brute_force import Dry

import ctrl_df as cdf
from ctrl_df.blocks.effect import Effect, register_effect


@dataclass(frozen=True)
class Rough(Effect):
    """A level of a user's own: more to the right, more under load; half of the inertia behind the gears."""

    level: float = cdf.parameter("N")
    slope: float = cdf.parameter("N/m")
    share: float = cdf.parameter("")

    role: ClassVar[str] = "friction"
    asks: ClassVar[tuple[str, ...]] = ("x", "drive", "load")

    @staticmethod
    def law(moving, direction, speed, base, p, x, drive, load):
        held = 0.25 if moving < 0.5 else 0.0
        return base + p[0] + held + p[1] * x * x + p[2] * abs(0.5 * drive + 0.5 * load)


T = np.linspace(0, 6, 1201)


def push(t):
    return 9.0 * np.sin(4.0 * t) + 2.0 * np.sin(1.3 * t)


def shapes(p):
    """The law again: kinetic and static levels of (x, drive, load)."""

    def level(x, drive, load):
        return p[0] + p[1] * x * x + p[2] * abs(0.5 * drive + 0.5 * load)

    return level, lambda *told: level(*told) + 0.25


@pytest.mark.parametrize("stiffness", [0.0, 30.0])
def test_a_users_law_may_ask_for_place_and_load(stiffness):
    block = cdf.Mass(1.5, [Rough(1.5, 4.0, 0.2), cdf.Viscous(0.8), cdf.LinearSpring(stiffness)])
    level, static = shapes((1.5, 4.0, 0.2))
    truth = Dry(level, static, lambda x, v: -0.8 * v - stiffness * x, 1.5, push).run(T)
    run = cdf.event_response(block, T, lambda t: [push(t)])
    assert np.max(np.abs(run.outputs[0] - truth)) < 1e-8 * np.ptp(truth)  # seen: 2.9e-9
    assert any(e.kind == ("reversal" if stiffness else "stick") for e in run.events)


def test_a_law_that_does_not_ask_is_called_as_ever_and_so_beside_one_that_does():
    plain = cdf.Mass(1.5, [cdf.Coulomb(2.0), cdf.Viscous(0.8)])
    beside = plain.with_effect(Rough(0.0, 4.0, 0.0))
    level = lambda x, drive, load: 2.0 + 4.0 * x * x  # noqa: E731
    truth = Dry(level, lambda *a: level(*a) + 0.25, lambda x, v: -0.8 * v, 1.5, push).run(T)
    run = cdf.event_response(beside, T, lambda t: [push(t)])
    assert np.max(np.abs(run.outputs[0] - truth)) < 1e-8 * np.ptp(truth)


def test_bodies_that_move_as_one_have_drive_and_load_in_common():
    law = Rough(1.5, 0.0, 0.3)
    one = cdf.event_response(cdf.Mass(3.0, [law, cdf.LinearSpring(10.0)]), T, push(T))
    two = cdf.event_response(cdf.TwoMass(1.0, 2.0, [law, cdf.LinearSpring(10.0)]), T, push(T))
    assert np.max(np.abs(one.outputs[0] - two.outputs[0])) < 1e-9


def test_many_runs_and_orbits_of_such_laws():
    block = cdf.Mass(1.5, [Rough(1.5, 4.0, 0.2), cdf.Viscous(0.8), cdf.LinearSpring(30.0)])
    batch = cdf.batch_response(block, T, push(T), params={"rough.slope": np.array([0.0, 4.0])})
    for slope, y in zip((0.0, 4.0), batch.outputs[:, 0], strict=True):
        alone = cdf.event_response(block.with_parameters({"rough.slope": slope}), T, push(T))
        assert np.max(np.abs(y - alone.outputs[0])) < 1e-9
    # the fundamental of a brute-force run that has forgotten its start
    w, a, laps = 5.0, 12.0, 24
    t = np.linspace(0, laps * 2 * np.pi / w, laps * 400 + 1)
    level, static = shapes((1.5, 4.0, 0.2))
    x = Dry(level, static, lambda x, v: -0.8 * v - 30.0 * x, 1.5, lambda t: a * np.cos(w * t)).run(t)
    brute = 2 / a * np.mean((x * np.exp(-1j * w * t))[-400:])
    assert abs(cdf.describing_function(block, a, w) / brute - 1) < 1e-6


def test_what_cannot_be_asked_is_refused():
    with pytest.raises(ValueError, match="may ask for x, drive, load"):

        @register_effect
        @dataclass(frozen=True)
        class Curious(Effect):
            role: ClassVar[str] = "friction"
            asks: ClassVar[tuple[str, ...]] = ("weather",)
