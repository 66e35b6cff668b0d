"""N at resonance and under slow transients, against formulas and arcs in closed form."""

import control as ct
import numpy as np
import pytest

import ctrl_df as cdf


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
