"""Force, length and time in other units alter no dimensionless describing function."""

import control as ct
import numpy as np
import pytest

import ctrl_df as cdf

POWERS = (-9, -6, -3, 3, 6, 9)
_rng = np.random.default_rng(9)
SCALES = [
    *((10.0**p, 1.0, 1.0) for p in POWERS),
    *((1.0, 10.0**p, 1.0) for p in POWERS),
    *((1.0, 1.0, 10.0**p) for p in POWERS),
    *(tuple(10.0 ** _rng.uniform(-9, 9, 3)) for _ in range(6)),
]


class Units:
    """One newton, metre and second in the units of a scale."""

    def __init__(self, force, length, time):
        self.force, self.length, self.time = force, length, time
        self.mass = force * time**2 / length
        self.damping, self.stiffness = force * time / length, force / length
        self.speed = length / time


def block(inertia, *effects):
    for effect in effects:
        inertia = inertia.with_effect(effect)
    return inertia


def slider(u, static=None):
    return cdf.friction_mass(
        9 * u.mass, 5 * u.force, 0.5 * u.damping, None if static is None else static * u.force
    )


def two(u):
    return cdf.TwoMass(u.mass, 8 * u.mass)


# name: (block in some units, amplitude [N], frequency [rad/s])
MECHANISMS = {
    "friction": (slider, 20, 5),
    "friction with static level": (lambda u: slider(u, 5.5), 9, 5),
    "backlash": (lambda u: cdf.backlash_masses(u.mass, 8 * u.mass, 0.018 * u.length, 0.2), 10, 10),
    "subharmonic backlash": (
        lambda u: cdf.backlash_masses(u.mass, 8 * u.mass, 0.018 * u.length, 0.818), 5.663 * 1.8, 10),
    "spring and drag": (
        lambda u: block(slider(u), cdf.LinearSpring(50 * u.stiffness),
                        cdf.QuadraticDrag(0.8 * u.force / u.speed**2)), 20, 5),
    "cubic spring": (
        lambda u: block(cdf.Mass(u.mass), cdf.Viscous(0.1 * u.damping), cdf.LinearSpring(u.stiffness),
                        cdf.CubicSpring(0.3 * u.force / u.length**3)), 2, 1.5),
    "stops, asymmetric": (
        lambda u: block(slider(u), cdf.HardStop(0.03 * u.length, 0.4, lower=-0.05 * u.length)), 20, 5),
    "Stribeck": (lambda u: block(slider(u), cdf.Stribeck(6 * u.force, 0.05 * u.speed)), 9, 5),
    "bristle": (
        lambda u: block(slider(u), cdf.Bristle(3000 * u.stiffness, 30 * u.damping)), 12, 5),
    "gap with friction": (
        lambda u: block(two(u), cdf.Backlash(0.018 * u.length, 0.2), cdf.Coulomb(u.force),
                        cdf.Viscous(0.5 * u.damping)), 20, 10),
    "elastic gap with friction": (
        lambda u: block(two(u), cdf.Compliance(500 * u.stiffness, 3 * u.damping),
                        cdf.Backlash(0.01 * u.length), cdf.Coulomb(u.force)), 20, 10),
    "ripple": (lambda u: block(slider(u), cdf.PositionRipple(u.force, 0.05 * u.length)), 20, 5),
    "asymmetric friction": (
        lambda u: block(slider(u), cdf.AsymmetricCoulomb(0.5 * u.force),
                        cdf.LinearSpring(50 * u.stiffness)), 20, 5),
    "channels": (
        lambda u: block(slider(u), cdf.InputSaturation(15 * u.force), cdf.InputLag(0.05 * u.time),
                        cdf.InputDeadZone(0.5 * u.force)), 20, 5),
    "quantized and late": (
        lambda u: block(slider(u), cdf.SensorQuantization(0.002 * u.length),
                        cdf.InputDelay(0.03 * u.time)), 20, 5),
    "travelling": (lambda u: block(slider(u), cdf.ConstantForce(u.force)), 20, 5),
    "resonance": (
        lambda u: block(cdf.Mass(u.mass), cdf.LinearSpring(100 * u.stiffness),
                        cdf.Viscous(1e-2 * u.damping), cdf.Coulomb(0.3 * u.force)), 1, 10),
    "linear": (
        lambda u: block(two(u), cdf.LinearSpring(100 * u.stiffness), cdf.Viscous(1e-4 * u.damping),
                        cdf.Compliance(1000 * u.stiffness, 0.1 * u.damping)), 1, 10),
    "stuck": (lambda u: slider(u, 5.5), 5.4, 5),
    "pushed away": (lambda u: block(cdf.Mass(u.mass), cdf.ConstantForce(u.force)), 1, 5),
}  # fmt: skip


@pytest.mark.parametrize("name", MECHANISMS)
def test_a_mechanism_is_described_the_same_in_every_unit(name):
    make, A, omega = MECHANISMS[name]

    def described(*scale):
        u = Units(*scale)
        family = cdf.describing_function_family(make(u), [A * u.force], [omega / u.time])
        return family.harmonics[0, 0] * u.stiffness, family.regime[0, 0], family.residual[0, 0]

    y, regime, residual = described(1.0, 1.0, 1.0)
    for scale in SCALES:
        other, its, closing = described(*scale)
        assert its == regime, scale
        if np.isnan(y[1]):
            assert np.isnan(other).all() and np.isnan(closing)
            continue
        twins = (y, y * (-1.0) ** (np.arange(len(y)) + 1))  # rounding chooses between mirror images
        apart = min(np.max(np.abs(other - twin)) for twin in twins)
        assert apart < 1e-6 * abs(y[1]), scale  # measured 2e-10
        assert abs(closing - residual) < 1e-6


def test_a_system_of_equations_is_described_the_same_in_every_unit():
    def oscillator(u):
        def update(t, x, force, params):
            pull = 40 * x[0] * u.stiffness + 300 * u.force * (x[0] / u.length) ** 3 + 2 * u.damping * x[1]
            return [x[1], (force[0] - pull) / u.mass]

        return ct.nlsys(update, lambda t, x, force, params: x[:1], inputs=1, outputs=1, states=2)

    values = []
    for scale in [(1.0, 1.0, 1.0), (1e-9, 1e6, 1e-3), (1e9, 1e-9, 1e3), (1.0, 1e9, 1e-9), (1e3, 1.0, 1e6)]:
        u = Units(*scale)
        family = cdf.describing_function_family(oscillator(u), [5 * u.force], [6 / u.time])
        values.append((family.harmonics[0, 0] * u.stiffness, family.regime[0, 0]))
    y, regime = values[0]
    for other, its in values[1:]:
        assert its == regime and np.max(np.abs(other - y)) < 1e-6 * abs(y[1])


# name: element whose input is measured in `x`, its output in `y`, its time in `t`
ELEMENTS = {
    "saturation": lambda x, y, t: cdf.saturation(y, slope=y / x),
    "dead zone": lambda x, y, t: cdf.dead_zone(x, slope=y / x),
    "relay": lambda x, y, t: cdf.relay(y),
    "relay with dead zone": lambda x, y, t: cdf.relay_with_dead_zone(y, x),
    "relay with hysteresis": lambda x, y, t: cdf.relay_with_hysteresis(y, x),
    "quantizer": lambda x, y, t: cdf.quantizer(x),
    "cubic": lambda x, y, t: cdf.cubic(y / x**3),
    "play": lambda x, y, t: cdf.play(x),
    "rate limiter": lambda x, y, t: cdf.rate_limiter(3 * x / t),
    "user law": lambda x, y, t: lambda u: y * np.tanh(u / x) + (y if u > 0.4 * x else 0.0),
    "user law with memory of corners": lambda x, y, t: lambda u: y * (abs(u / x + 0.3) - 0.3) ** 1.5 if (
        abs(u / x + 0.3) > 0.3) else 0.0,
}  # fmt: skip


@pytest.mark.parametrize("name", ELEMENTS)
def test_an_element_is_described_the_same_in_every_unit(name):
    own_output = name not in ("quantizer", "play", "rate limiter")

    def described(x, y, t):
        y = y if own_output else x
        try:
            element = ELEMENTS[name](x, y, t)
        except TypeError:  # no slope to choose
            element, y = getattr(cdf, name.replace(" ", "_"))(x), x
        A = x * np.array([0.3, 1.2, 2.7, 40.0])
        family = cdf.describing_function_family(element, A, [2.0 / t])
        return family.harmonics * x / y, family.regime

    known, regime = described(1.0, 1.0, 1.0)
    for x, y, t in SCALES:
        other, its = described(x, y, t)
        assert np.array_equal(its, regime), (x, y, t)
        np.testing.assert_allclose(other, known, rtol=0, atol=1e-9 * np.nanmax(np.abs(known)), equal_nan=True)


@pytest.mark.parametrize("unit", [1e-18, 1e-9, 1.0, 1e9])
def test_slope_at_the_origin_of_a_law_in_small_units_is_no_zero(unit):
    assert cdf.describing_function(lambda u: unit * np.sin(u), [0.0, 1.0])[0] == pytest.approx(unit, rel=1e-7)
    assert cdf.describing_function(lambda u: unit * u**3, [0.0, 1.0])[0] == 0
