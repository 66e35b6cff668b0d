"""Joints, contacts and presliding by laws of a user's own, against SciPy."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
import scaled
from scipy.integrate import solve_ivp

import ctrl_df as cdf
from ctrl_df.blocks import probing

T = np.linspace(0, 4, 801)


def push(t):
    return 9.0 * np.sin(6.0 * t) + 4.0 * np.sin(2.3 * t)


@dataclass(frozen=True)
class Shaft(cdf.Effect):
    """A joint that hardens, with a lag of its own (a standard linear solid)."""

    stiffness: float = cdf.parameter("N/m")
    cubic: float = cdf.parameter("N/m^3")
    slow: float = cdf.parameter("N/m")
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


@dataclass(frozen=True)
class Link(cdf.Effect):
    """A joint that hardens; no parameter is called as one of the library is."""

    firm: float = cdf.parameter("N/m")
    more: float = cdf.parameter("N/m^3")
    loss: float = cdf.parameter("N s/m", default=0.0)
    beyond: float = cdf.parameter("", default=0.4, known_as="load_fraction")

    role: ClassVar[str] = "coupling"

    @staticmethod
    def law(t, x, v, z, p, dz):
        return p[0] * x + p[1] * x * x * x + p[2] * v


@dataclass(frozen=True)
class Clutch(Link):
    """A joint that slips at 10 N."""

    @staticmethod
    def law(t, x, v, z, p, dz):
        return 10.0 * np.tanh(0.1 * p[0] * x)


@dataclass(frozen=True)
class Teeth(cdf.Effect):
    """A force from tooth to tooth."""

    size: float = cdf.parameter("N")
    pitch: float = cdf.parameter("m", strict=True)
    width: float = cdf.parameter("m", strict=True)

    role: ClassVar[str] = "force"

    @staticmethod
    def law(t, x, v, z, p, dz):
        return p[0] * np.sin(2 * np.pi * x / p[1]) ** 3


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


def test_what_laws_tell_of_themselves():
    spring, link, pulls = cdf.Compliance(300.0, 2.0), Link(300.0, 5e4, 2.0), np.array([7.0, -0.1, 0.0])
    assert probing.deflection(spring, pulls) == pytest.approx(pulls / 300.0, rel=1e-15)
    bent = probing.deflection(link, pulls)
    assert 300.0 * bent + 5e4 * bent**3 == pytest.approx(pulls, rel=1e-12)
    assert probing.stiffness(link, 7.0) == pytest.approx(7.0 / bent[0], rel=1e-12)
    pure = float(probing.deflection(Link(0.0, 5e4), 7.0))
    assert 5e4 * pure**3 == pytest.approx(7.0, rel=1e-12)  # without a slope at rest
    assert probing.deflection(Clutch(300.0, 0.0), 50.0) == pytest.approx(np.arctanh(0.9) / 30.0, rel=1e-9)
    assert probing.deflection(Link(0.0, 0.0, 3.0), 7.0) == 0.0  # a damper alone
    assert probing.states_at(Shaft(300.0, 5e4, 150.0, 0.05), 0.02) == pytest.approx((0.02,), rel=1e-12)
    stated = (cdf.Bristle(5e4, 300.0, 1.0), cdf.MaxwellSlip(5e4, 30.0), cdf.LooseLinkage(5e4, 0.01))
    for effect in (*stated, cdf.Hysteresis(3.0, 0.1)):
        assert probing.sliding(effect, 3.0) == pytest.approx(effect.steady(3.0), rel=1e-9)
    assert Slip(2000.0, 400.0).steady(3.0) == pytest.approx((1.5 / 2000.0, 1.5 / 400.0), rel=1e-9)
    assert Teeth(2.0, 0.3, 0.2).periods() == (0.3,)
    assert cdf.LinearSpring(3.0, center=0.1).periods() == cdf.LinearSpring(3.0, center=1e-12).periods() == ()
    assert cdf.PositionDependentFriction(1e-6, wavelength=4e3).periods() == (4e3,)


def record_of(block):
    drive = 3.0 * push(T)
    x, *_ = np.asarray(cdf.event_response(block, T, drive, input_hold="zoh").outputs)
    return cdf.Measurement(T, drive, x, input_unit="N", output_unit="m")


@pytest.mark.parametrize("law", [Link(600.0, 2e5, 1.0), Shaft(300.0, 5e4, 150.0, 0.05)])
def test_a_joint_of_any_names_is_compared_and_refitted(law):
    block = cdf.Mass(2.0, [law, cdf.Viscous(1.0)])
    record, stiff = record_of(block), f"{law.id}.{next(iter(law.parameters))}"
    assert cdf.compare(block, record).nrmse < 1e-4  # 5e-6: samples begin a little off
    off = block.with_parameters({stiff: 0.9 * block.parameters[stiff].value})
    fit = cdf.refit(off, record, free=[stiff])
    assert fit.parameters[stiff].value == pytest.approx(block.parameters[stiff].value, rel=1e-3)
    assert "link.beyond" not in cdf.TwoMass(1.0, 2.0, [Link(600.0, 2e5)]).parameters


def test_presliding_of_any_names_on_a_table():
    rest = [cdf.Coulomb(3.0), cdf.Viscous(0.5), cdf.LinearSpring(50.0)]
    soft, none = cdf.Mass(1.5, [Slip(4000.0, 2000.0), *rest]), cdf.Mass(1.5, rest)
    A, omega = np.array([6.0, 12.0]), np.array([3.0, 8.0])
    table, rigid = (
        cdf.FrequencyMeasurement(A, omega, cdf.describing_function_family(b, A, omega).N)
        for b in (soft, none)
    )
    assert cdf.compare(soft, table).nrmse < 1e-6
    assert cdf.compare(none, table).nrmse > 0.01
    # what yields over next to nothing is as good as rigid, and costs no more
    assert cdf.compare(cdf.Mass(1.5, [Slip(4e7, 2e7), *rest]), rigid).nrmse < 1e-6
    assert np.isfinite(cdf.compare(cdf.Mass(1.5, [cdf.MaxwellSlip(6000.0), *rest]), table).nrmse)


def stated(name, **body):
    """Make a contact of an effect class."""
    made = {"role": "contact", "__annotations__": {"size": float}, "size": cdf.parameter("m"), **body}
    return dataclass(frozen=True)(type(name, (cdf.Effect,), made))


def test_what_a_contact_leaves_open_is_asked_for():
    with pytest.raises(ValueError, match="needs span"):
        cdf.register_effect(stated("Wall"))
    with pytest.raises(ValueError, match="needs restitution; got none. Declare"):
        cdf.register_effect(stated("Wall", span=(-1.0, 1.0)))
    with pytest.raises(ValueError, match="needs gap; got none. Declare"):
        stated("Slack", divides=True)(0.1)
    with pytest.raises(ValueError, match="cannot have a law"):
        stated("Slack", divides=True, law=staticmethod(lambda t, x, v, z, p, dz: 0.0))(0.1)
    loose = stated("Slack", divides=True, restitution=0.3, gap=property(lambda self: 2.0 * self.size))(0.1)
    assert cdf.TwoMass(1.0, 2.0, [loose]).core.gap == 0.2
    with pytest.raises(ValueError, match="which share of it lies behind Slack"):
        cdf.Mass(1.0, [loose])
    with pytest.raises(ValueError, match="known_as gap, restitution, load_fraction"):
        cdf.parameter("m", known_as="play")
    with pytest.raises(ValueError, match="0 < beyond <= 0.999"):
        Link(1.0, 1.0, beyond=2.0)


@dataclass(frozen=True)
class Wash(cdf.Effect):
    """Drag between that of a slow flow and that of a fast one."""

    resistance: float = cdf.parameter("N s^1.5/m^1.5", meaning="drag over speed to the power 1.5")

    role: ClassVar[str] = "force"
    shows: ClassVar[str] = "drag that grows a little faster than speed"
    source: ClassVar[str] = "of the test"

    @staticmethod
    def law(t, x, v, z, p, dz):
        return -p[0] * v * math.sqrt(abs(v))


def test_a_parameter_may_have_a_fractional_power_of_a_unit():
    true, guess = (cdf.Mass(2.0, [Wash(c)]) for c in (6.0, 3.0))
    x = np.asarray(cdf.event_response(true, T, push(T)).outputs)[0]
    assert guess.parameters["wash.resistance"].unit == "N s^1.5/m^1.5"
    noise = 1e-4 * np.random.default_rng(3).standard_normal(len(T))
    record = cdf.Measurement(T, push(T), x + noise, input_hold="linear")
    found = cdf.refit(guess, record)
    resistance = found.model.parameters["wash.resistance"].value
    assert abs(resistance - 6.0) < 3 * found.parameters["wash.resistance"].standard_error
    # in millimetres it has another number, and is the same
    other = cdf.refit(scaled.block(guess, 1.0, 1e3), scaled.record(record, 1.0, 1e3)).model
    assert other.parameters["wash.resistance"].value == pytest.approx(resistance / 1e3**1.5, rel=1e-6)
