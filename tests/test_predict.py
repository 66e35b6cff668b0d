"""Predicted limit cycles: converged to the equation's solutions, honest, graded with a reason."""

import math
from dataclasses import replace

import control as ct
import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from problems import PROBLEMS, tsypkin_relay

from ctrl_df.blocks.effects import InputSaturation
from ctrl_df.blocks.elements.hysteresis import play, rate_limiter, relay_with_hysteresis
from ctrl_df.blocks.elements.memoryless import quantizer, relay, saturation
from ctrl_df.blocks.mechanism import backlash_masses, friction_mass
from ctrl_df.blocks.pid import pid
from ctrl_df.df.describing import describing_function, describing_function_family
from ctrl_df.limit_cycles.predicted.grade import Sensitivity, graded
from ctrl_df.limit_cycles.predicted.predict import describing_function_response
from ctrl_df.plot.describing import describing_function_plot

H3 = ct.tf([8], [1, 2, 2, 1])


@pytest.fixture(scope="module")
def responses():
    return {p.name: describing_function_response(p.H, p.block, p.A, p.omega) for p in PROBLEMS}


@pytest.fixture(autouse=True)
def no_open_figures():
    yield
    plt.close("all")


def nearest(response, predicted):
    return min(response.limit_cycles, key=lambda c: abs(math.log(c.omega / predicted[1])))


@pytest.mark.parametrize("problem", PROBLEMS, ids=lambda p: p.name)
def test_converged(problem, responses):
    response = responses[problem.name]
    for cycle in response.limit_cycles:
        s = 1j * cycle.omega
        N = describing_function(problem.block, cycle.amplitude, cycle.omega)
        assert abs(1 + N * problem.H(s)) < 1e-9
        assert cycle.output_amplitude == pytest.approx(abs(N) * cycle.amplitude, rel=1e-9)
    if problem.predicted is not None:
        cycle = nearest(response, problem.predicted)
        assert (cycle.amplitude, cycle.omega) == pytest.approx(problem.predicted, rel=5e-5)
    if problem.cycle is None:
        assert response.limit_cycles == [] and "no solution" in response.status


@pytest.mark.parametrize("problem", [p for p in PROBLEMS if p.cycle], ids=lambda p: p.name)
def test_honest(problem, responses):
    """The bands hold the exact cycle, and are no wider than six times the error they admit (trusted ones)."""
    cycle = nearest(responses[problem.name], problem.predicted or problem.cycle)
    a, w = problem.cycle
    assert math.isnan(a) or cycle.amplitude_band[0] <= a <= cycle.amplitude_band[1]
    assert cycle.omega_band[0] <= w <= cycle.omega_band[1]
    if cycle.grade == "trusted":
        assert math.log(cycle.amplitude_band[1] / cycle.amplitude) < 6 * abs(math.log(a / cycle.amplitude))
    if cycle.grade != "unreliable":
        assert cycle.stable == problem.stable


def test_honest_on_random_relay_loops():
    """Exact by Tsypkin; measured 139 of 139 loops inside, the error taking up to 0.67 of the band."""
    rng = np.random.default_rng(11)
    tried = 0
    while tried < 12:
        den = np.array([1.0])
        for lag in np.exp(rng.uniform(np.log(0.1), np.log(3), rng.integers(2, 4))):
            den = np.convolve(den, [lag, 1])
        if rng.random() < 0.6:
            den = np.convolve(den, [1, 0])
        h = 0.0 if rng.random() < 0.5 and den.size > 3 else rng.uniform(0.02, 0.3)
        H, level = ct.tf([rng.uniform(0.5, 5)], den), rng.uniform(0.5, 2)
        exact = tsypkin_relay(H, level, h, harmonics=4001)
        if exact is None:
            continue
        block = relay_with_hysteresis(level, h) if h else relay(level)
        A, omega = np.geomspace(1e-3, 30, 30), np.geomspace(0.02, 100, 60)
        (cycle,) = describing_function_response(H, block, A, omega).limit_cycles
        assert cycle.amplitude_band[0] < exact[0] < cycle.amplitude_band[1]
        assert cycle.omega_band[0] < exact[1] < cycle.omega_band[1]
        assert cycle.corrected == pytest.approx(exact, rel=1e-3)  # measured 2e-4
        assert cycle.stable
        tried += 1


def test_rigorous_bound_holds_the_exact_cycle(responses):
    problem = PROBLEMS[0]
    (cycle,) = responses[problem.name].limit_cycles
    (a_low, a_high), (w_low, w_high) = cycle.bound
    assert a_low < problem.cycle[0] < a_high and w_low < problem.cycle[1] < w_high
    assert "proven" in cycle.why
    (other,) = responses["relay, integrator and double lag"].limit_cycles
    assert other.bound is None and "bound" not in other.why  # a relay: the theorem is not about such loops


def test_second_friction_prediction_is_called_spurious(responses):
    """The stable cycle predicted at 13.05 rad/s does not exist; with its harmonics it is far away."""
    low, high = responses["friction mass under PID"].limit_cycles
    assert low.amplitude == pytest.approx(9.535886, rel=1e-6) and low.grade == "unreliable"
    assert "passes a fold" in low.why
    assert high.corrected == pytest.approx((10.850004, 13.792124), rel=2e-5)
    assert high.grade == "doubtful" and "tangentially" in high.why and high.sensitivity.amplitude > 6


def test_a_frequency_known_roughly_is_doubted_as_an_amplitude_is():
    # an amplitude that hardly exceeds the first step of a quantizer: N is steep there, and the phase is open
    H = ct.tf([30], [1, 2, 2, 1])
    found = describing_function_response(
        H, quantizer(1.0), np.linspace(0.4, 1.0, 40), np.geomspace(0.3, 5, 40)
    )
    (cycle,) = found.limit_cycles
    low, high = cycle.amplitude_band
    assert high / low < 1.1 and cycle.omega_band[1] / cycle.omega_band[0] > 1.35
    assert cycle.grade == "doubtful" and "The frequency is known to a factor of 1.2 only" in cycle.why


@pytest.mark.parametrize(
    ("spread", "grade"),
    [
        ((0.1, 0.1), "trusted"),
        ((0.1, 0.2), "doubtful"),
        ((0.1, 0.8), "unreliable"),
        ((0.1, math.nan), "unreliable"),
    ],
)
def test_the_wider_band_grades(spread, grade):
    crossing = Sensitivity(1.0, 1.0)
    found, _ = graded(distortion=0.0, sensitivity=crossing, spread=spread, stable=True, regime="slip")
    assert (
        found
        == grade
        == graded(distortion=0.0, sensitivity=crossing, spread=spread[::-1], stable=True, regime="slip")[0]
    )


def test_backlash_prediction_is_doubted_and_corrected(responses):
    (cycle,) = responses["backlash, restitution 0.2, under PID"].limit_cycles
    assert cycle.grade == "doubtful" and cycle.sensitivity.amplitude > 15
    assert cycle.corrected == pytest.approx((20.459998, 14.733968), rel=0.01)
    (rattle,) = responses["backlash, restitution 0.8, under PID"].limit_cycles
    assert rattle.grade == "unreliable" and rattle.distortion > 0.6


@pytest.mark.parametrize("scale", [1e-6, 1e5])
def test_units_change_nothing(scale):
    """Force in other units: N scales, H scales back, the cycle scales."""
    base = describing_function_response(
        pid(2000, 44250, 130), friction_mass(9, 5, 0.5), [6, 8, 12, 20, 40], [5, 40]
    )
    block = friction_mass(9 * scale, 5 * scale, 0.5 * scale)
    other = describing_function_response(
        pid(2000 * scale, 44250 * scale, 130 * scale), block, scale * np.array([6, 8, 12, 20, 40]), [5, 40]
    )
    assert len(base) == len(other) == 2
    for one, two in zip(base.limit_cycles, other.limit_cycles, strict=True):
        assert two.amplitude == pytest.approx(scale * one.amplitude, rel=1e-8)
        assert two.omega == pytest.approx(one.omega, rel=1e-8)
        assert (one.grade, one.stable) == (two.grade, two.stable)


def test_general_engine_agrees_with_the_closed_form():
    """A saturation out of reach sends the same mass through the engine."""
    A, omega = np.geomspace(8, 16, 8), np.geomspace(12, 16, 8)
    H, block = pid(2000, 44250, 130), friction_mass(9, 5, 0.5)
    fast = describing_function_response(H, block, A, omega).limit_cycles
    slow = describing_function_response(H, block.with_effect(InputSaturation(1e4)), A, omega).limit_cycles
    for one, two in zip(fast, slow, strict=True):
        assert (two.amplitude, two.omega) == pytest.approx((one.amplitude, one.omega), rel=1e-6)


def test_every_crossing_of_a_delayed_loop():
    """Play with a dead time: crossings found by brute force over the relation phase(N) + phase(H) = -pi."""
    H = H3 * ct.tf(*ct.pade(5, 4)) / 2
    A, omega = np.linspace(0.6, 5, 50), np.logspace(-1, 3, 50)
    found = describing_function_response(H, play(1), A, omega).limit_cycles
    a = np.geomspace(0.6, 5, 4000)
    w = np.geomspace(0.1, 1000, 20000)
    L = np.log(H(1j * w))
    minus = np.log(-1 / describing_function(play(1), a))
    count = 0
    phase_H, phase_N = np.unwrap(L.imag), minus.imag
    for turn in range(-12, 13):  # |H| at the frequency where its phase meets that of -1/N(a)
        meet = np.interp(
            -(phase_N + 2 * np.pi * turn), -phase_H, np.arange(w.size), left=np.nan, right=np.nan
        )
        gap = np.interp(meet, np.arange(w.size), L.real) - minus.real
        count += int(np.nansum(np.sign(gap[1:]) * np.sign(gap[:-1]) < 0))
    assert len(found) == count == 2


def test_rate_limiter_loop():
    """Stable for small signals (gain margin 4/3), lost beyond an amplitude: the unstable cycle between."""
    H = ct.tf([1.5], [1, 2, 1, 0])
    A, omega = np.geomspace(0.2, 200, 40), np.geomspace(0.05, 20, 40)
    (cycle,) = describing_function_response(H, rate_limiter(1.0), A, omega).limit_cycles
    excess = cycle.amplitude * cycle.omega
    assert 1 < excess < 1.8621 and cycle.residual < 1e-12 and cycle.stable is False
    assert describing_function_response(4 * H, rate_limiter(1.0), A, omega).limit_cycles == []


def test_state_space_discrete_and_static_H():
    by_tf = describing_function_response(H3, saturation(1), np.linspace(1, 4, 10)).limit_cycles[0]
    by_ss = describing_function_response(ct.ss(H3), saturation(1), np.linspace(1, 4, 10)).limit_cycles[0]
    assert by_ss.omega == pytest.approx(by_tf.omega, rel=1e-10)
    assert describing_function_response(0.5, saturation(1), [1, 4]).limit_cycles == []


@pytest.mark.parametrize(
    "call, error, words",
    [
        (
            lambda: describing_function_response(ct.ss([[-1]], [[1, 1]], [[1]], 0), saturation(1), [1, 2]),
            ValueError,
            "one input",
        ),
        (
            lambda: describing_function_response(saturation(1), saturation(1), [1, 2]),
            TypeError,
            "linear system",
        ),
        (lambda: describing_function_response(H3, saturation(1), [0.0]), ValueError, "amplitude > 0"),
        (lambda: describing_function_response(H3, saturation(1), [1, -2]), ValueError, "cannot evaluate"),
        (lambda: describing_function_response(H3, saturation(1), [1, 2], [np.nan, 1]), ValueError, "finite"),
        (
            lambda: describing_function_response(H3, saturation(1), [1, 2], np.array([])),
            ValueError,
            "at least one",
        ),
        (
            lambda: describing_function_response(H3, saturation(1), [1, 2], unknown=1),
            TypeError,
            "unrecognized keyword",
        ),
        (
            lambda: describing_function_response(ct.tf([1], [1, -0.5], 0.1), saturation(1), [1, 2], [40, 50]),
            ValueError,
            "Nyquist frequency",
        ),
        (
            lambda: describing_function_response(
                ct.tf([1], [1, -0.5], 0.1), friction_mass(9, 5), [6, 9], [1, 9]
            ),
            ValueError,
            "one timebase",
        ),
    ],
)
def test_bad_calls(call, error, words):
    with pytest.raises(error, match=words):
        call()


def test_measured_controller_and_extrapolated_harmonics():
    omega = np.geomspace(5, 40, 200)
    data = ct.frd(pid(2000, 44250, 130), omega)
    block = friction_mass(9, 5, 0.5)
    response = describing_function_response(data, block, np.geomspace(5.5, 40, 30), omega[::8])
    _, high = response.limit_cycles
    assert (high.amplitude, high.omega) == pytest.approx((11.082170, 13.898109), rel=1e-4)
    assert "not measured" in high.why and high.grade != "trusted"


def test_results_carry_what_made_them_and_do_not_change():
    response = describing_function_response(H3, saturation(1), np.linspace(1, 4, 10), np.logspace(-1, 2, 50))
    assert (
        response.H is H3
        and response.block == saturation(1)
        and isinstance(response, ct.DescribingFunctionResponse)
    )
    assert response.family.N.shape == (10, 50) and response.N_vals.shape == (10,)
    (cycle,) = response.limit_cycles
    with pytest.raises(AttributeError):
        cycle.amplitude = 1.0
    assert replace(cycle, grade="doubtful").grade == "doubtful"
    assert cycle.period == pytest.approx(2 * np.pi / cycle.omega)


# --- pictures: what was drawn -------------------------------------------------------------------------------


def texts(ax):
    return [t.get_text() for t in ax.texts]


def test_picture_of_a_memoryless_loop():
    cplt = describing_function_plot(H3, saturation(1), np.linspace(1, 4, 10), label="plant")
    ax = cplt.axes[0, 0]
    assert isinstance(cplt, ct.ControlPlot) and len(cplt.lines[0]) == 5 and len(cplt.lines[1]) == 1
    assert "3.3 @ 1.4" in texts(ax)
    marks = [
        line
        for line in ax.lines
        if line.get_marker() == "o" and len(line.get_xdata()) == 1 and line.get_ms() == 7
    ]
    assert complex(marks[0].get_xdata()[0], marks[0].get_ydata()[0]) == pytest.approx(-8 / 3, abs=1e-6)
    assert "one limit cycle" in ax.get_title() + cplt.figure.get_suptitle()


def test_picture_of_a_mechanism():
    response = describing_function_response(
        pid(1800, 19500, 100),
        backlash_masses(1, 8, 0.018, 0.2),
        np.geomspace(5, 60, 15),
        np.geomspace(8, 40, 15),
    )
    cplt = response.plot(point_label="%.4g @ %.4g")
    ax = cplt.axes[0, 0]
    assert (
        "17.75 @ 14.84" in texts(ax)
        and any("A = " in t for t in texts(ax))
        and any("ω = " in t for t in texts(ax))
    )
    assert np.allclose(cplt.lines[0][0].get_xdata(), 1800)  # the ideal PID's real part, unclipped
    assert 4 <= len(cplt.lines[1]) <= 10
    assert len(describing_function_plot(response, point_label=None).axes[0, 0].texts) < len(ax.texts)


def test_pictures_of_families():
    family = describing_function_family(
        friction_mass(9, 5, 0.5), np.geomspace(6, 50, 12), np.geomspace(2, 50, 12)
    )
    cplt = family.plot()
    assert len(cplt.lines[0]) == 5 and len(cplt.lines[1]) == 5
    cplt = family.plot_harmonics(amplitude=10)
    assert cplt.lines.shape == (1, 2) and len(cplt.lines[0, 0]) == 3  # 1, 3, 5: even ones are absent
    assert "harmonics 2, 4: none" in cplt.axes[0, 0].get_title()
    single = describing_function_family(relay(1), np.geomspace(0.1, 10, 30)).plot()
    assert len(single.lines[0]) == 1
    with pytest.raises(AttributeError):
        family.plot(unknown=1)
