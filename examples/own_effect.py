r"""
How do I add physics that the library does not have?
====================================================

**Problem.** A carriage of 2 kg on a spring is slowed by a magnetic brake. Its drag grows with speed, has
its greatest value at a critical speed and falls again. The screw that moves it is dry towards its ends:
friction in the nut is a share of the load, and the more so the farther out. The library has neither effect.

**Equations.** A force, and a level of dry friction, x being the place and L the load on the nut:

.. math::
    F_\text{brake} = -2 P \, \frac{v/v_c}{1 + (v/v_c)^2}, \qquad
    K = g \, |x| \, |L|

**Method.** One class states everything: parameters with units, the role, the law. From then on it is an
effect like any other: simulated, described, fitted, diagnosed.
"""

from dataclasses import dataclass
from typing import ClassVar

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import solve_ivp

import ctrl_df as cdf


@cdf.register_effect
@dataclass(frozen=True)
class EddyBrake(cdf.Effect):
    """Drag ``F = -2 peak (v/vc) / (1 + (v/vc)^2)``."""

    peak: float = cdf.parameter("N", meaning="greatest drag")
    velocity: float = cdf.parameter("m/s", strict=True, default=0.1, meaning="speed of the greatest drag")

    role: ClassVar[str] = "force"
    shows: ClassVar[str] = "drag that falls again at high speed"
    source: ClassVar[str] = "Smythe (1942)"

    @staticmethod
    def law(t, x, v, z, p, dz):
        ratio = v / p[1]
        return -2.0 * p[0] * ratio / (1.0 + ratio * ratio)


# %%
# The response to sines of three amplitudes, over frequency:

block = cdf.Mass(2.0).with_effect(EddyBrake(3.0, velocity=0.1)).with_effect(cdf.LinearSpring(200.0))
family = cdf.describing_function_family(block, np.array([2.0, 4.0, 8.0]), np.geomspace(4, 20, 9))
print(family)
N = cdf.describing_function(block, 4.0, 8.0)
print(f"N(4 N, 8 rad/s) = {N:.6e} m/N")
family.plot()

# %%
# **Check.** By code that shares nothing with the engine: let SciPy integrate 200 periods, so that the
# transient dies out, and take the fundamental.

omega, a = 8.0, 4.0
period = 2 * np.pi / omega


def rates(t, x):
    ratio = x[1] / 0.1
    return [x[1], (a * np.cos(omega * t) - 200 * x[0] - 6 * ratio / (1 + ratio**2)) / 2]


t = np.linspace(200 * period, 201 * period, 2049)
x = solve_ivp(rates, (0, t[-1]), [0, 0], "DOP853", t, rtol=1e-10, atol=1e-13).y[0]
brute = 2 / a * np.mean((x * np.exp(-1j * omega * t))[:-1])
print(f"difference from brute force: {abs(N / brute - 1):.1e}")
assert abs(N / brute - 1) < 1e-6

# %%
# **Friction of one's own.** Its law returns a level; `base` is that of the friction before it. A law with
# ``asks`` receives, after its parameters, the position, the driving force and the load carried: all that acts
# against the drive except inertia and dry friction, here the spring and the brake. ``proportional`` says that
# the effect vanishes with its first parameter, so that fits need few start values.


@cdf.register_effect
@dataclass(frozen=True)
class DryEnds(cdf.Effect):
    """Dry friction of level ``growth |x| |load|``."""

    growth: float = cdf.parameter("1/m", meaning="friction over load, per distance from the middle")

    role: ClassVar[str] = "friction"
    asks: ClassVar[tuple[str, ...]] = ("x", "load")
    proportional: ClassVar[bool] = True
    shows: ClassVar[str] = "friction that grows with the load towards the ends"
    source: ClassVar[str] = "Coulomb, the coefficient growing with the place"

    @staticmethod
    def law(moving, direction, speed, base, p, x, drive, load):
        return base + p[0] * abs(x) * abs(load)


# %%
# **Check**, by hand: 0.1 m out at 0.2 m/s the spring pulls with 20 N and the brake with 2.4 N. The screw adds
# 4/m x 0.1 m x 22.4 N = 8.96 N, so that of 40 N 8.64 N are left for 2 kg.

machine = block.with_effect(DryEnds(4.0))
acceleration = machine.dynamics(0, [0.1, 0.2], [40.0])[1]
print(f"acceleration: {acceleration:.4f} m/s^2")
assert abs(acceleration - 4.32) < 1e-9

# %%
# **A joint of one's own.** Three more roles have laws of their own: ``coupling``, the joint of two bodies;
# ``contact``, stops that yield; ``presliding``, friction that gives way before it slides. The law of a rubber
# coupling gets the deflection ``x`` and its rate ``v``. On a single mass a coupling divides it; the field for
# the share behind it may have any name, and is marked.


@cdf.register_effect
@dataclass(frozen=True)
class RubberCoupling(cdf.Effect):
    """Joint that hardens: ``F = k d (1 + (d/d0)^2) + c d'``."""

    stiffness: float = cdf.parameter("N/m", meaning="stiffness at small deflections")
    hardens: float = cdf.parameter(
        "m", strict=True, default=0.01, meaning="deflection at which it has doubled"
    )
    damping: float = cdf.parameter("N s/m", default=20.0, meaning="damping of the rubber")
    behind: float = cdf.parameter(
        "", default=0.5, known_as="load_fraction", meaning="share of the mass behind"
    )

    role: ClassVar[str] = "coupling"
    shows: ClassVar[str] = "ringing whose frequency rises with its size"
    source: ClassVar[str] = "Duffing (1918)"

    @staticmethod
    def law(t, x, v, z, p, dz):
        return p[0] * x * (1.0 + (x / p[1]) ** 2) + p[2] * v


# %%
# **Check**, by hand: deflected by 10 mm, at 0.1 m/s, it pulls the load of 1 kg with 16 N + 2 N.

drive = cdf.Mass(2.0).with_effect(RubberCoupling(800.0))
pulled = drive.dynamics(0, [0.0, 0.0, 0.01, 0.1], [0.0])[1]  # states: x, v, x_motor, v_motor
print(f"acceleration of the load: {pulled:.4f} m/s^2")
assert abs(pulled - 18) < 1e-9

# %%
# **Does a record show it?** Four seconds of the carriage, simulated so that the answer is known. The model
# has brake and spring, each a bit off, and no friction. Two effects of the library compete.

t = 0.01 * np.arange(400)
waves = [(12, 0.9), (9, 1.7), (5, 2.9)]  # N, Hz
force = sum(a * np.sin(2 * np.pi * f * t + k) for k, (a, f) in enumerate(waves))
x = np.asarray(cdf.event_response(machine, t, force, input_hold="zoh").outputs)[0]
x += 1e-4 * np.random.default_rng(1).standard_normal(t.size)
record = cdf.Measurement(t, force, x, name="carriage")

model = cdf.Mass(2.2, [EddyBrake(2.5, velocity=0.12), cdf.LinearSpring(190.0)])
candidates = ["dry_ends", "load_dependent_friction", "quadratic_drag"]
diagnosis = cdf.diagnose(model, record, candidates=candidates)
print(diagnosis.explanation)
print(diagnosis.table())

# %%
# **Result.** The model with it, refitted to the whole record, with standard errors:

fit = cdf.refit(diagnosis.best.model, record)
for parameter in fit.parameters.values():
    print(parameter)

growth = fit.parameters["dry_ends.growth"]
assert diagnosis.verdict == "effect" and diagnosis.best.id == "dry_ends"
assert abs(growth.value - 4) < 3 * growth.standard_error < 0.01
plt.show()
