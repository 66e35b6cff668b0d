"""Odd but legal input, and what earlier versions got wrong with it; bad input gets one clear error."""

import warnings

import control as ct
import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.limit_cycles.finder import OrbitFinder

H = ct.tf([8], [1, 2, 2, 1])
SATURATED = cdf.saturation(1)
FREQUENCIES = np.geomspace(0.05, 50, 400)


def test_frd_at_an_amplitude_that_is_no_integer():
    block = cdf.friction_mass(2.7, 6.2, 1.8)
    family = cdf.describing_function_family(block, [9.47, 18.94, 56.8], [3, 9.5])
    assert np.allclose(np.asarray(family.frd(18.94).frdata).ravel(), family.N[1])
    between = np.asarray(family.frd(12.6266).frdata).ravel()
    assert np.allclose(between, cdf.describing_function(block, 12.6266, [3, 9.5]))


def test_measured_points_of_a_sampled_system():
    sampled = ct.sample_system(H, 0.01, "tustin")
    points = ct.frd(sampled(np.exp(1j * FREQUENCIES * 0.01)), FREQUENCIES, dt=0.01)
    response = cdf.describing_function_response(points, SATURATED, np.linspace(1, 4, 10))
    cycle = response.limit_cycles[0]
    # tustin at 10 ms warps the frequency by (omega dt)^2/12, the spline adds 1e-4
    assert cycle.amplitude == pytest.approx(3.343999, rel=2e-3)
    assert cycle.omega == pytest.approx(np.sqrt(2), rel=2e-3)


@pytest.mark.parametrize("dt", [0.02, 0.1])
def test_sampled_linear_part_around_a_law(dt):
    """The loop of a discrete H is the recursion u = H y, y = f(u): here run step by step."""
    sampled = ct.sample_system(H, dt, "zoh")
    check = cdf.verify(cdf.describing_function_response(sampled, SATURATED, np.linspace(1, 9, 10)))
    assert [row.verdict for row in check] == ["confirmed"]
    ss, x, u = ct.ss(sampled), np.ones(3), []
    for _ in range(int(300 / dt)):
        u.append((ss.C @ x).item())
        x = ss.A @ x - ss.B[:, 0] * np.clip(u[-1], -1, 1)
    u = np.array(u[len(u) // 2 :])
    ups = np.flatnonzero((u[:-1] < 0) & (u[1:] >= 0))
    passing = ups - u[ups] / (u[ups + 1] - u[ups])
    omega = 2 * np.pi * (len(ups) - 1) / (passing[-1] - passing[0]) / dt
    assert check.orbits[0].omega == pytest.approx(
        omega, rel=2e-4
    )  # measured 4e-6 at 0.1, averages over 40 swings


def test_an_equilibrium_is_no_orbit():
    loop = cdf.closed_loop(cdf.pid(1800, 19500, 100), cdf.backlash_masses(1, 8, 0.018, 0.8))
    for guess in ((10.28, 125.8), (12.7, 156.0)):  # both ended at rest within the gap once
        orbit = cdf.find_limit_cycle(loop, guess=guess)
        assert orbit.omega == pytest.approx(156.045031, abs=1e-5)
        assert orbit.output_amplitude == pytest.approx(8.1608e-4, rel=1e-4)


def test_a_relay_is_watched_by_its_input():
    plant = ct.tf([1], [1, 1, 0])
    response = cdf.describing_function_response(
        plant, ct.relay_hysteresis_nonlinearity(1, 0.1), np.geomspace(0.11, 5, 20), np.geomspace(0.3, 10, 60)
    )
    row = cdf.verify(response).rows[0]
    assert row.verdict == "confirmed"
    assert row.simulated[0] == pytest.approx(row.exact.omega, rel=1e-6)


def test_starts_reach_the_corners_whatever_the_scale():
    for scale in (1e-4, 1e4):
        x = np.array([-2, -1, 1, 2]) * scale
        law = cdf.piecewise_linear(x, np.clip(x, -scale, scale))
        loop = cdf.closed_loop(ct.tf([20], [1, 3, 2, 0]), law)
        orbit = cdf.find_limit_cycle(loop)
        assert orbit.amplitude == pytest.approx(4.37665557 * scale, rel=1e-6)  # tests/problems.py


def test_a_loop_closed_on_the_velocity_is_verified_there():
    controller = ct.tf([60, 3000], [1, 0]) * ct.tf([1], [0.05, 1])
    response = cdf.describing_function_response(
        controller,
        cdf.friction_mass(2, 3, 0.1),
        np.geomspace(3.1, 60, 20),
        np.geomspace(3, 100, 40),
        output="v",
    )
    check = cdf.verify(response)
    assert check.loop.output_labels[0] == "v"
    assert [row.verdict for row in check] == ["confirmed"]


def test_starts_of_six_sizes():
    finder = OrbitFinder(cdf.closed_loop(cdf.pid(2000, 44250, 130), cdf.friction_mass(9, 5, 0.5, 5.5)))
    starts = finder.poincare.starts.all()
    assert len(starts) == 6
    assert len(finder.poincare.iterate(starts[0][1], 5).crossings) == 5


BLOCK = cdf.friction_mass(9, 5, 0.5)
LOOP = cdf.closed_loop(cdf.pid(2000, 44250, 130), BLOCK)
ANALYSE = cdf.describing_function_response


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda: cdf.describing_function(BLOCK, [9, 10, 11], [1, 2]), ValueError, "broadcast"),
        (lambda: cdf.describing_function(BLOCK, 9 + 1j, 2.0), TypeError, "real numbers"),
        (lambda: cdf.describing_function(SATURATED, 1.0, output="z"), ValueError, "output out of y"),
        (lambda: cdf.describing_function(lambda u: 1 / 0, 1.0), RuntimeError, "ZeroDivisionError"),
        (lambda: cdf.describing_function_family(BLOCK, [9.0], [1.0], orders="a"), TypeError, "orders"),
        (lambda: cdf.describing_function_family(BLOCK, [9.0], [1.0], save="/none/x.npz"), OSError, "folder"),
        (lambda: ANALYSE(ct.tf([np.nan], [1, 1]), SATURATED, [1, 4]), ValueError, "finite coefficients"),
        (lambda: ANALYSE(H, SATURATED, [1, 4], orders=0), ValueError, "orders"),
        (
            lambda: ANALYSE(ct.sample_system(H, 0.01), SATURATED, [1, 4], [1, 500]),
            ValueError,
            "Nyquist frequency",
        ),
        (lambda: cdf.verify(3), TypeError, "describing_function_response"),
        (lambda: cdf.find_limit_cycle(LOOP, guess=(-1, 3)), ValueError, "amplitude > 0"),
        (lambda: cdf.find_limit_cycle(LOOP, guess=np.zeros(17)), TypeError, r"shape \(3,\)"),
    ],
)
def test_bad_input(call, error, words):
    with warnings.catch_warnings(), pytest.raises(error, match=words):
        warnings.simplefilter("ignore", UserWarning)  # python-control's, about its Nyquist contour
        call()


def test_broken_family_file(tmp_path):
    path = cdf.describing_function_family(BLOCK, [9.0], [1.0]).save(tmp_path / "family.npz")
    (tmp_path / "cut.npz").write_bytes(path.read_bytes()[:300])
    np.save(tmp_path / "bare.npy", np.ones(3))
    for name in ("cut.npz", "bare.npy"):
        with pytest.raises(ValueError, match="npz"):
            cdf.load_family(tmp_path / name)


def test_zeros_left_out_are_told():
    response = ANALYSE(H, SATURATED, np.linspace(0, 4, 10), np.array([0, 0.5, 1, 2, 4.0]))
    assert len(response.limit_cycles) == 1 and "zero" in response.status


def test_one_amplitude_is_drawn():
    import matplotlib.pyplot as plt

    controller = cdf.pid(2000, 44250, 130)
    cplt = cdf.describing_function_plot(controller, BLOCK, [10.0], np.geomspace(5, 40, 20))
    assert isinstance(cplt, ct.ControlPlot)
    plt.close(cplt.figure)
