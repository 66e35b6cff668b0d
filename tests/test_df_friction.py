"""Closed form of the friction mass against DOP853 with events and against 60-digit arithmetic."""

import math
from decimal import Decimal, localcontext

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from ctrl_df.df.closed_form.friction import FRICTION_REGIMES, friction_family

SLIP, STICK_SLIP, STUCK = (FRICTION_REGIMES.index(name) for name in ("slip", "stick-slip", "stuck"))


def point(mass, coulomb, viscous, static, a, omega, orders=9):
    harmonics, regime, residual = friction_family(mass, coulomb, viscous, static, [a], [omega], orders)
    return harmonics[0, 0], int(regime[0, 0]), residual[0, 0]


# --- the whole motion, simulated --------------------------------------------------------------------------


def simulated(kappa, sigma, beta, velocity, periods, orders):
    """Harmonics of x M omega^2 / a over the last period, from an initial velocity, events located by DOP853.

    u' = cos - kappa sign(u) - beta u; states u, then int x-free harmonics of u by quadrature states.
    """
    ks = np.arange(1, orders + 1)
    theta, u = 0.3, velocity
    end = 0.3 + 2 * math.pi * periods
    last = end - 2 * math.pi
    total = np.zeros(orders, dtype=complex)
    stuck = False

    def stop(t, y):
        return y[0]

    stop.terminal = True
    while theta < end - 1e-13:
        if stuck:
            # rest until |cos| reaches sigma: the next phase -arccos(sigma) mod pi
            leave = -math.acos(sigma)
            theta += (leave - theta) % math.pi
            if theta >= end:
                break
            direction = 1.0 if math.cos(theta) > 0 else -1.0
        elif u != 0:
            direction = math.copysign(1.0, u)
        else:
            direction = math.copysign(1.0, math.cos(theta))

        def rates(t, y, direction=direction):
            v = y[0]
            turn = np.exp(-1j * ks * t) * v
            return np.concatenate([[math.cos(t) - kappa * direction - beta * v], turn.real, turn.imag])

        stop.direction = -direction
        while True:  # integrate up to the window, then inside it
            until = last if theta < last - 1e-13 else end
            start = np.concatenate([[u], np.zeros(2 * orders)])
            run = solve_ivp(
                rates,
                (theta, until),
                start,
                method="DOP853",
                rtol=1e-12,
                atol=1e-14,
                events=stop,
                max_step=0.3,
            )
            if until == end:
                total += run.y[1 : orders + 1, -1] + 1j * run.y[orders + 1 :, -1]
            theta, u = run.t[-1], run.y[0, -1]
            if run.status == 1 or theta >= end - 1e-13:
                break
        if run.status == 1:
            u = 0.0
            stuck = abs(math.cos(theta)) <= sigma
    return total / math.pi / (1j * ks)


@pytest.mark.parametrize("seed", range(10))
def test_family_agrees_with_simulated_motion(seed):
    rng = np.random.default_rng(seed)
    mass, a, omega = 10 ** rng.uniform(-1, 1), 10 ** rng.uniform(-1, 2), 10 ** rng.uniform(-1, 2)
    kappa = rng.uniform(0.02, 0.9)
    sigma = kappa if seed % 2 else rng.uniform(kappa, 1)
    beta = 10 ** rng.uniform(-1, 0.7)
    found, regime, residual = point(mass, kappa * a, beta * mass * omega, sigma * a, a, omega, orders=5)
    transient = 4 + int(25 / (2 * math.pi * beta)) if regime == SLIP else 4
    expected = simulated(kappa, sigma, beta, rng.uniform(-0.5, 0.5), transient, 5) / (mass * omega**2)
    # measured worst 1.3e-14 of |N|
    assert np.max(np.abs(found[1:] - expected)) < 1e-13 * abs(found[1])
    assert residual < 1e-12


# --- the formulas in 60 digits ----------------------------------------------------------------------------

PI = Decimal("3.14159265358979323846264338327950288419716939937510582097494459230781640628620899862803482534")


def _sincos(x):
    s, c, term, n = Decimal(0), Decimal(0), Decimal(1), 0
    while abs(term) > Decimal("1e-75"):
        if n % 2 == 0:
            c += term if n % 4 == 0 else -term
        else:
            s += term if n % 4 == 1 else -term
        n += 1
        term *= x / n
    return s, c


def _root(f, low, high):
    """Root of f, positive at low and not at high: bisection, then secant steps to 40 digits."""
    for _ in range(24):
        x = (low + high) / 2
        low, high = (x, high) if f(x) > 0 else (low, x)
    x, y, last, before = high, f(high), low, f(low)
    for _ in range(30):
        if y == before or abs(x - last) < Decimal("1e-40") * abs(high):
            return x
        x, y, last, before = x - y * (x - last) / (y - before), None, x, y
        y = f(x)
    raise AssertionError("no root")


def _arccos(c):
    """Arccos by Newton from the float value of 2 arcsin sqrt((1 - c)/2)."""
    x = Decimal(2 * math.asin(math.sqrt(float((1 - c) / 2))))
    if x == 0:
        return x
    for _ in range(4):
        s, cos = _sincos(x)
        x += (cos - c) / s
    return x


def high_precision(mass, coulomb, viscous, static, a, omega, k):
    """X_k/a by the textbook formulas (they cancel badly in floats), 60 digits."""
    with localcontext() as context:
        context.prec = 75
        M, K, B, Ks, a, w = (Decimal(float(value)) for value in (mass, coulomb, viscous, static, a, omega))
        kappa, sigma, beta = K / a, Ks / a, B / (M * w)
        start = -_arccos(sigma)
        s0, c0 = _sincos(start)
        q = 1 + beta * beta

        def velocity(arc, s0=s0, c0=c0):
            s1, c1 = _sincos(arc)
            sin, cos = s0 * c1 + c0 * s1, c0 * c1 - s0 * s1
            decay = (-beta * arc).exp()
            lag = (1 - decay) / beta if beta else arc
            return (beta * cos + sin) / q - (beta * c0 + s0) / q * decay - kappa * lag

        if velocity(PI) > 0:
            # slide: u(psi0 + pi) = 0 from rest at psi0, which lies in (start, -start)
            def gap(psi):
                s, c = _sincos(psi)
                return velocity(PI, s, c)

            # stay on the branch of rising velocity at the start
            start = _root(gap, start, min(-start, _arccos(kappa)))
            arc = PI
        else:
            # the velocity peaks before F = K, falling
            low = _arccos(kappa) - start
            arc = _root(velocity, low, PI)

        def turn(m):  # integral of e^{-jm theta} over the arc, real and imaginary part
            if m == 0:
                return arc, Decimal(0)
            s1, c1 = _sincos(m * start)
            s2, c2 = _sincos(m * (start + arc))
            return (s2 - s1) / m, (c2 - c1) / m

        low, mid, high = turn(k - 1), turn(k), turn(k + 1)
        re, im = ((low[i] + high[i]) / 2 - kappa * mid[i] for i in (0, 1))
        # over -k^2 + jk beta
        size = k**4 + k * k * beta * beta
        x, y = -re * k * k + im * k * beta, -im * k * k - re * k * beta
        scale = 2 / PI / size / M / w / w
        return complex(float(x * scale), float(y * scale))


def compare(mass, coulomb, viscous, static, a, omega, rtol=2e-13):
    found, _, residual = point(mass, coulomb, viscous, static, a, omega)
    assert residual < 1e-11
    for k in (1, 3, 9):
        expected = high_precision(mass, coulomb, viscous, static, a, omega, k)
        scale = abs(expected) if k == 1 else abs(found[1])
        assert abs(found[k] - expected) < rtol * scale, (k, found[k], expected)


@pytest.mark.parametrize("viscous", [0.0, 1e-12, 1e-6, 0.03, 0.5, 20.0, 1e4, 1e9])
@pytest.mark.parametrize("excess", [1e-14, 1e-9, 1e-5, 1e-2, 0.3, 0.8, 3.0, 30.0])
@pytest.mark.parametrize("static", [5.0, 5.0000001, 6.5])
def test_n_to_machine_precision(viscous, excess, static):
    # measured worst 8e-14 of N over 3000 random points, all regimes (arcs just under 0.5 rad)
    compare(9.0, 5.0, viscous, static, static * (1 + excess), 15.0)


@pytest.mark.parametrize("omega", [1e-9, 1e-3, 1.0, 1e3, 1e9])
def test_n_at_extreme_frequencies(omega):
    for a in (5.1, 9.0, 20.0):
        compare(9.0, 5.0, 0.5, 5.0, a, omega)


@pytest.mark.parametrize("viscous", [0.0, 0.5, 30.0])
@pytest.mark.parametrize("static", [5.0, 6.0])
def test_both_sides_of_the_slip_boundary(viscous, static):
    low, high = static * 1.0001, static * 1000
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (
            (middle, high) if point(9, 5, viscous, static, middle, 15)[1] == STICK_SLIP else (low, middle)
        )
    for a in (low * (1 - 1e-6), low * (1 - 1e-12), low, high, high * (1 + 1e-12), high * (1 + 1e-6)):
        compare(9, 5, viscous, static, a, 15)
    jump = abs(point(9, 5, viscous, static, low, 15)[0][1] / point(9, 5, viscous, static, high, 15)[0][1] - 1)
    assert jump < 1e-13


@settings(max_examples=60, deadline=None)
@given(
    mass=st.floats(1e-2, 1e2),
    kappa=st.floats(1e-6, 0.999),
    rise=st.floats(0, 1),
    beta=st.floats(-8, 5),
    omega=st.floats(-3, 3),
)
def test_n_at_random_parameters(mass, kappa, rise, beta, omega):
    a, omega = 10.0, 10**omega
    static = a * (kappa + rise * (1 - kappa) * 0.999)
    compare(mass, kappa * a, 10**beta * mass * omega, max(static, kappa * a), a, omega, rtol=1e-12)


# --- known numbers and limits -----------------------------------------------------------------------------


def test_self_check_values():
    stick, regime, _ = point(9, 5, 0.5, 5, 9, 15)
    assert regime == STICK_SLIP
    assert abs(stick[1] / (-1.88628562837e-4 - 1.71710313129e-4j) - 1) < 1e-11  # the figures have 12 digits
    slide, regime, _ = point(9, 5, 0.5, None, 14, 15)
    assert regime == SLIP
    assert abs(slide[1] / (-3.66471993467e-4 - 1.86782062855e-4j) - 1) < 1e-11


def test_pure_mass_and_viscous_mass():
    for B in (0.0, 1e-12, 0.7, 1e12):
        for w in (1e-6, 2.0, 1e6):
            found, regime, residual = point(3.0, 0.0, B, None, 2.0, w)
            assert regime == SLIP and residual < 1e-12
            assert abs(found[1] * ((B + 3j * w) * 1j * w) - 1) < 1e-15
            assert np.all(found[2:] == 0)


def test_sliding_without_viscous_friction():
    # sin(psi0) = -pi K/(2a); N = [1 + j(4K/pi a) e^{-j psi0}] / (-M w^2)
    psi = -math.asin(math.pi / 2 * 0.3)
    expected = (1 + 1j * (4 * 0.3 / math.pi) * np.exp(-1j * psi)) / (-2.0 * 9)
    assert abs(point(2.0, 3.0, 0.0, None, 10.0, 3.0)[0][1] / expected - 1) < 1e-15


def test_stuck_is_nan_and_named():
    harmonics, regime, residual = friction_family(9, 5, 0.5, 7, [5.0, 7.0, 7.0001], [1.0, 2.0])
    assert np.all(regime[:2] == STUCK) and np.all(regime[2] == STICK_SLIP)
    assert np.all(np.isnan(harmonics[:2, :, 1])) and np.all(np.isnan(residual[:2]))
    assert np.all(np.isfinite(harmonics[2]))


def test_shapes_orders_and_symmetry():
    harmonics, regime, residual = friction_family(
        9, 5, 0.5, 5, np.linspace(6, 30, 4), [1.0, 5.0, 20.0], orders=6
    )
    assert harmonics.shape == (4, 3, 7) and regime.shape == residual.shape == (4, 3)
    assert np.all(harmonics[..., ::2] == 0)
    one = friction_family(9, 5, 0.5, 5, [6.0], [1.0], orders=1)[0]
    assert one[0, 0, 1] == harmonics[0, 0, 1]


@settings(max_examples=100, deadline=None)
@given(
    kappa=st.floats(0, 0.95),
    rise=st.floats(0, 0.95),
    beta=st.floats(-6, 3),
    unit=st.floats(-3, 3),
)
def test_friction_dissipates_and_units_cancel(kappa, rise, beta, unit):
    sigma, beta, unit = kappa + rise * (1 - kappa), 10**beta, 10**unit
    found = point(1, kappa, beta, sigma, 1.0, 1.0)[0]
    assert found[1].imag <= 0  # loop area -pi a^2 Im N: work into friction
    forces = point(1, kappa * unit, beta * unit, sigma * unit, unit, 1.0)[0]
    # mass in units of force: x in units of force too; measured 4e-13 where the arc is short
    heavy = point(unit, kappa, beta * unit, sigma, 1.0, 1.0)[0]
    assert abs(heavy[1] * unit / found[1] - 1) < 1e-11
    assert (
        abs(point(unit, kappa * unit, beta * unit, sigma * unit, unit, 1.0)[0][1] * unit / found[1] - 1)
        < 1e-9
    )
    assert np.isfinite(forces[1])


def test_loop_area_is_the_friction_work():
    # one period of sliding: K per metre both ways plus viscous losses = -pi a^2 Im N
    M, K, B, a, w = 2.0, 1.0, 0.4, 5.0, 3.0
    X, regime, _ = point(M, K, B, None, a, w, orders=3001)
    assert regime == SLIP
    t = (np.arange(60000) + 0.5) * 2 * np.pi / 60000
    k = np.arange(1, 3002, 2)
    velocity = np.zeros_like(t)
    for order in k[:200]:
        velocity += (1j * order * w * a * X[order] * np.exp(1j * order * t)).real
    lost = np.mean(K * np.abs(velocity) + B * velocity**2) * 2 * np.pi / w
    assert abs(lost / (-math.pi * a * a * X[1].imag) - 1) < 1e-6


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (dict(mass=0.0), "mass > 0"),
        (dict(mass=math.nan), "mass"),
        (dict(coulomb=-1.0), "coulomb >= 0"),
        (dict(viscous=-1.0), "viscous >= 0"),
        (dict(static=4.0), "static >= 5"),
        (dict(A=[1.0, -2.0]), "A > 0"),
        (dict(A=[]), "non-empty"),
        (dict(omega=[0.0]), "omega > 0"),
        (dict(omega=[[1.0]]), "1-D"),
        (dict(orders=0), "orders"),
        (dict(orders=2.5), "orders"),
    ],
)
def test_bad_input_is_one_clear_error(change, word):
    good = dict(mass=9, coulomb=5, viscous=0.5, static=5, A=[6.0], omega=[1.0])
    with pytest.raises(ValueError, match=word):
        friction_family(**{**good, **change})
