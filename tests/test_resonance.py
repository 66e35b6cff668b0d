"""N at resonance and under slow transients, against formulas and arcs in closed form."""

import math

import control as ct
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import ctrl_df as cdf
from ctrl_df.df.forced_orbit.driven_block import DrivenBlock
from ctrl_df.df.forced_orbit.orbits import OrbitSolver


def block(inertia, *effects):
    for effect in effects:
        inertia = inertia.with_effect(effect)
    return inertia


def point(b, A, omega, **options):
    """N, regime and residual at one point."""
    family = cdf.describing_function_family(b, [A], [omega], **options)
    return family.N[0, 0], family.regime[0, 0], family.residual[0, 0]


# --- linear mechanisms --------------------------------------------------------------------------------------


@pytest.mark.parametrize("damping", [1e-2, 1e-3, 1e-6, 1e-9])
def test_resonance_of_a_linear_mass_is_its_formula(damping):
    b = block(cdf.Mass(1), cdf.LinearSpring(100.0), cdf.Viscous(damping))
    for omega in (10.0, 9.0, 10.001):
        N, regime, _ = point(b, 1.0, omega)
        exact = 1 / (100 - omega**2 + 1j * omega * damping)
        assert regime == "smooth" and abs(N / exact - 1) < 1e-9  # measured 4e-16 to 2e-11


def test_undamped_resonance_has_no_answer_and_says_why():
    b = block(cdf.Mass(1), cdf.LinearSpring(100.0))
    N, regime, residual = point(b, 1.0, 10.0)
    assert regime == "resonance" and np.isnan(N) and np.isnan(residual)
    assert abs(point(b, 1.0, 9.0)[0] * 19 - 1) < 1e-14
    N, regime, _ = point(ct.tf([1], [1, 0, 100]), 1.0, 10.0)
    assert regime == "resonance" and np.isnan(N)


def test_elastic_joint_at_its_resonance_is_its_formula():
    load, motor, k = 2.0, 1.0, 1000.0
    for damping in (1e-2, 1e-6):
        b = block(cdf.TwoMass(motor, load), cdf.Compliance(k, damping))
        omega = float(np.sqrt(k * (1 / load + 1 / motor)))
        for w in (omega, 0.9 * omega):
            s = 1j * w
            joint = k + damping * s
            exact = joint / ((motor * s**2 + joint) * (load * s**2 + joint) - joint**2)
            N, regime, _ = point(b, 1.0, w)
            assert regime == "smooth" and abs(N / exact - 1) < 1e-6  # the formula itself cancels


def test_constant_force_on_a_linear_mass_moves_the_mean_or_makes_it_travel():
    spring = block(cdf.Mass(2), cdf.Viscous(0.1), cdf.LinearSpring(50.0), cdf.ConstantForce(5.0))
    family = cdf.describing_function_family(spring, [2.0], [3.0])
    assert family.harmonics[0, 0, 0] == pytest.approx(5 / 50 / 2, rel=1e-12)
    free = block(cdf.Mass(2), cdf.Viscous(1e-3), cdf.ConstantForce(5.0))
    N, regime, _ = point(free, 2.0, 3.0)
    assert regime == "drifting" and abs(N * (-18 + 3e-3j) - 1) < 1e-12
    assert point(block(cdf.Mass(2), cdf.ConstantForce(5.0)), 2.0, 3.0)[1] == "diverged"


def test_linear_system_that_repels_says_so():
    N, regime, _ = point(ct.tf([1], [1, -1]), 1.0, 2.0)
    assert regime == "unstable" and abs(N * (2j - 1) - 1) < 1e-14


# --- dry friction and a spring: two arcs a period, in closed form ------------------------------------------


def sliding_oscillator(m, k, b, level, A, omega):
    """N of a mass on a spring that slides without a stop: half a period is one arc, which mirrors itself.

    The arc starts at rest at x0 > 0 under the force Re(P exp(j omega t)), |P| = A: two linear conditions on
    x0 and P, and the modulus.
    """
    half, c = math.pi / omega, b / (2 * m)
    wd = np.sqrt(k / m - c * c)
    gain = 1 / (k - m * omega**2 + 1j * b * omega)

    def arc(t, x0, P):
        forced, speed = (gain * P * np.exp(1j * omega * t)).real, (1j * omega * gain * P).real
        a = x0 - (gain * P).real - level / k
        bend = np.exp(-c * t) * np.sin(wd * t) / wd
        even = np.exp(-c * t) * np.cos(wd * t) + c * bend
        v = (1j * omega * gain * P * np.exp(1j * omega * t)).real - speed * (even - 2 * c * bend)
        return forced + level / k + a * even - speed * bend, v - a * k / m * bend

    base = np.array(arc(half, 0.0, 0j))
    columns = [np.array(arc(half, *z)) - base for z in ((1.0, 0j), (0.0, 1 + 0j), (0.0, 1j))]
    matrix = np.array(columns).T + np.array([[1.0, 0, 0], [0, 0, 0]])
    part, null = np.linalg.lstsq(matrix, -base, rcond=None)[0], np.linalg.svd(matrix)[2][2]
    p, q = complex(*part[1:]), complex(*null[1:])
    answers = []
    for s in np.roots([abs(q) ** 2, 2 * (p * q.conjugate()).real, abs(p) ** 2 - A * A]).real:
        x0, P = part[0] + s * null[0], p + s * q
        if np.max(arc(np.linspace(0, half, 999)[1:-1], x0, P)[1]) < 0:  # it slides one way only
            node, weight = np.polynomial.legendre.leggauss(40)
            t = half * (node + 1) / 2
            answers.append(np.sum(arc(t, x0, P)[0] * np.exp(-1j * omega * t) * weight) / P)
    (N,) = answers
    return N


@pytest.mark.parametrize("damping", [1e-1, 1e-2, 1e-3, 1e-4, 1e-6])
def test_resonance_with_dry_friction_is_that_of_its_arcs(damping):
    for level in (0.3, 0.7):
        b = block(cdf.Mass(1), cdf.LinearSpring(100.0), cdf.Viscous(damping), cdf.Coulomb(level))
        for omega in (10.0, 10.003, 9.7):
            N, regime, residual = point(b, 1.0, omega)
            error = abs(N / sliding_oscillator(1, 100, damping, level, 1, omega) - 1)
            assert regime == "slip" and residual < 1e-8
            # at resonance a detuning of 1e-12 tells: measured 4e-12/damping, elsewhere 1e-9
            assert error < 5e-9 + (2e-11 / damping if omega == 10.0 else 0.0)


# --- smooth laws: own Newton's method on DOP853 -----------------------------------------------------------


def shooting(rates, n, A, omega, x):
    """Harmonic 1 over A of the first state on the periodic orbit nearest to x, and its largest multiplier."""
    period = 2 * math.pi / omega

    def flow(x):
        def f(t, z):
            turn = np.exp(-1j * omega * t) * z[0]
            return [*rates(z[:n], A * math.cos(omega * t)), turn.real, turn.imag]

        end = solve_ivp(f, (0, period), [*x, 0, 0], method="DOP853", rtol=1e-12, atol=1e-15).y[:, -1]
        return end[:n], complex(end[n], end[n + 1]) * 2 / period / A

    for _ in range(8):
        end, N = flow(x)
        h = 1e-5 * np.max(np.abs(x))
        J = np.array([(flow(x + h * e)[0] - flow(x - h * e)[0]) / (2 * h) for e in np.eye(n)]).T
        step = np.linalg.solve(np.eye(n) - J, end - x)
        x = x + step
        if np.max(np.abs(step)) < 1e-9 * np.max(np.abs(x)):
            break
    return flow(x)[1], np.max(np.abs(np.linalg.eigvals(J)))


@pytest.mark.parametrize("omega", [9.9, 10.0, 10.05])
def test_lightly_damped_cubic_spring_is_its_own_periodic_orbit(omega):
    b, k3 = 2e-3, 0.02
    plant = block(cdf.Mass(1), cdf.LinearSpring(100.0), cdf.Viscous(b), cdf.CubicSpring(k3))
    point = OrbitSolver(DrivenBlock(plant)).solve(1.0, omega, 3)
    N, multiplier = shooting(
        lambda x, F: (x[1], F - b * x[1] - 100 * x[0] - k3 * x[0] ** 3), 2, 1.0, omega, point.after.state.x
    )
    assert point.regime == "smooth" and multiplier < 1 and abs(point.harmonics[1] / N - 1) < 1e-7


def test_lightly_damped_elastic_joint_is_its_own_periodic_orbit():
    k, c, drag = 1000.0, 1e-3, 0.01
    plant = block(
        cdf.TwoMass(1.0, 2.0), cdf.Compliance(k, c), cdf.LinearSpring(10.0), cdf.QuadraticDrag(drag)
    )
    omega = math.sqrt(k * 1.5)
    point = OrbitSolver(DrivenBlock(plant)).solve(3.0, omega, 3)

    def rates(x, F):
        pull = k * (x[2] - x[0]) + c * (x[3] - x[1])
        return x[1], pull / 2, x[3], F - pull - 10 * x[2] - drag * abs(x[3]) * x[3]

    N, multiplier = shooting(rates, 4, 3.0, omega, point.after.state.x)
    assert point.regime == "smooth" and multiplier < 1 and abs(point.harmonics[1] / N - 1) < 1e-6


def test_friction_that_cannot_hold_an_undamped_resonance_is_said_to_diverge():
    b = block(cdf.Mass(1), cdf.LinearSpring(100.0), cdf.Coulomb(0.3))
    N, regime, _ = point(b, 1.0, 10.0)
    assert regime == "diverged" and np.isnan(N)
    assert np.isfinite(point(b, 1.0, 9.7)[0])


# --- what describing_function says -------------------------------------------------------------------------


def test_describing_function_warns_where_n_is_not_that_of_a_settled_motion():
    undamped = block(cdf.Mass(1), cdf.LinearSpring(100.0))
    with pytest.warns(
        cdf.DescribingFunctionWarning, match=r"resonance at 1 of 2 points, first A=1, omega=10 "
    ):
        N = cdf.describing_function(undamped, 1.0, [9.0, 10.0])
    assert np.isfinite(N[0]) and np.isnan(N[1])
    with pytest.warns(cdf.DescribingFunctionWarning, match="stuck at 2 of 3 points, first A=1, omega=5"):
        cdf.describing_function(cdf.friction_mass(9, 5), [1.0, 2.0, 9.0], 5.0)
    travels = block(cdf.friction_mass(9, 5, 0.5), cdf.ConstantForce(1.0))
    with pytest.warns(cdf.DescribingFunctionWarning, match=r"drifting.*family.*regime"):
        cdf.describing_function(travels, 20.0, 5.0)
    with pytest.warns(cdf.DescribingFunctionWarning, match="unstable"):
        cdf.describing_function(ct.tf([1], [1, -1]), 1.0, 2.0)
    with pytest.warns(cdf.DescribingFunctionWarning, match="aperiodic"):
        cdf.describing_function(cdf.backlash_masses(1, 1, 1.0, 0.8), 1.0, 1.0)
    with pytest.warns(cdf.DescribingFunctionWarning, match="aperiodic at 1 of 1 points.*average") as said:
        cdf.describing_function_family(cdf.backlash_masses(1, 1, 1.0, 0.8), [1.0], [1.0])
    assert len(said) == 1 and said[0].filename == __file__
    assert issubclass(cdf.DescribingFunctionWarning, RuntimeWarning)


def test_a_settled_motion_is_described_without_a_warning():  # warnings are errors here
    cdf.describing_function(cdf.friction_mass(9, 5, 0.5), [6.0, 30.0], 5.0)
    cdf.describing_function(cdf.saturation(1), [0.0, 2.0])
    cdf.describing_function_family(block(cdf.Mass(1), cdf.LinearSpring(100.0)), [1.0], [10.0])
