r"""
A geared servo carries a pendulum
=================================

**Problem.** A hobby servo (Dynamixel XL330) swings 0.49 kg at 0.1 m. Recorded are the volts on its motor and
the angle, at 200 Hz, under two gains of its position controller. Does the friction of its gears grow with the
torque they carry, as Rhoban's BAM project found? Run with ``python examples/xl330.py FOLDER``: FOLDER holds
their records as CSV. The data are no part of this repository, and this page is not run when the site is
built.

.. code-block:: text

    volts ---->[ motor: k, R ]---torque--->[ gears: friction ]---->[ pendulum ]----> angle

**Equations.** A friction level :math:`\tau_c` that grows with the torque carried:

.. math::

    J \ddot\varphi = \frac{k}{R} (u - k\, \dot\varphi) - m g l \sin\varphi - d\, \dot\varphi
    - (\tau_c + \mu\, |\tau|) \operatorname{sign} \dot\varphi

The torque carried is the one that passes through the gears: the drive's torque where all inertia lies behind
them, the load's where none does, a share of each in between.

**Method.** Weight and arm are known, and so is the torque of gravity: it is the scale by which volts become
torques. The rest is refitted on the records of the lower gain, over segments of half a second, with and
without the friction that carries load, and validated on those of the higher gain; beside it, refitted in the
same way, the law that BAM prefers, whose bump at low speed grows with the load as well. Then the same as if
nobody had weighed the pendulum: the published constant of the motor is the scale, and inertia and torque of
gravity are fitted as well.
"""

import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import matplotlib.pyplot as plt
import numpy as np

import ctrl_df as cdf

WINDOW = 0.5  # s: long enough to swing, short enough that nothing drifts far
MOVES = ("sin_sin", "sin_time_square")

if len(sys.argv) < 2 or not Path(sys.argv[1]).is_dir():
    sys.exit("The records are not here: python examples/xl330.py FOLDER, which holds sin_sin_kp400.csv ...")


def record(name):
    columns = dict(time="t_s", input="volts", output="angle_rad", input_unit="V", output_unit="rad")
    return cdf.Measurement.from_csv(Path(sys.argv[1]) / f"{name}.csv", name=name, **columns)


train = [record(f"{move}_kp400") for move in MOVES]
held_out = [record(f"{move}_kp800") for move in MOVES]


@cdf.register_effect
@dataclass(frozen=True)
class LoadDependentStribeck(cdf.Effect):
    """BAM's friction of gears: a level and a bump at low speed, both growing with the torque of the drive."""

    slope: float = cdf.parameter("", default=0.1, meaning="level over torque")
    bump: float = cdf.parameter("N", default=0.02, meaning="bump at low speed")
    bump_slope: float = cdf.parameter("", default=0.1, meaning="bump over torque")
    speed: float = cdf.parameter("m/s", strict=True, default=0.3, meaning="Stribeck velocity")

    role: ClassVar[str] = "friction"
    asks: ClassVar[tuple[str, ...]] = ("drive",)
    shows: ClassVar[str] = "friction that is larger where the drive works harder, most at low speed"
    source: ClassVar[str] = "Duclusaud et al. (2025), Better Actuator Models"

    @staticmethod
    def law(moving, direction, speed, base, p, x, drive, load):
        """Return the level [N]."""
        near = math.exp(-((speed / p[3]) ** 2))
        return base + p[0] * abs(drive) + (p[1] + p[2] * abs(drive)) * near


def torque_error(model, records):
    """Return the rms torque that a model lacks while the servo moves, over that of its motor."""
    lacking, given = [], []
    motor = model.named_effects["torque_constant"]
    for r in records:
        v, a = r.velocity_estimate(12.0), r.acceleration_estimate(12.0)
        moving = np.abs(v) > 0.05
        states = np.column_stack([r.y, v])[moving]
        does = [model.dynamics(0.0, x, [u])[1] for x, u in zip(states, r.u[moving], strict=True)]
        lacking.append(model.parameters["inertia"].value * (a[moving] - np.array(does)))
        given.append(motor.constant * (r.u - motor.constant * v)[moving] / motor.resistance)
    return float(np.linalg.norm(np.concatenate(lacking)) / np.linalg.norm(np.concatenate(given)))


gravity = 0.49 * 9.81 * 0.1
motor = cdf.TorqueConstant(0.323, resistance=4.76)
plain = cdf.Inertia(
    0.00164 + 0.49 * 0.1**2, [motor, cdf.Gravity(gravity), cdf.Coulomb(0.05), cdf.Viscous(0.005)]
)
unweighed = plain.with_parameters({"inertia": 0.004, "gravity.torque": 0.25})
added = {
    "Coulomb and viscous": ((), ()),
    "and with the load": (
        (cdf.LoadDependentFriction(0.1, share=0.5),),
        ("load_dependent_friction", "load_dependent_friction.share"),
    ),
    "BAM's law": ((LoadDependentStribeck(),), ("load_dependent_stribeck",)),
}


def validate(baseline, free):
    """Refit a model with each law of friction in turn, print and return what it does on records held out."""
    errors, compared, torque = {}, {}, {}
    for name, (effects, more) in added.items():
        model = baseline.with_effect(*effects) if effects else baseline
        fit = cdf.refit(model, train, [*free, *more], window=WINDOW, budget=250)
        compared[name] = cdf.compare(fit.model, held_out, window=WINDOW)
        errors[name] = fit.comparison.rmse, compared[name].rmse
        torque[name] = torque_error(fit.model, held_out)
        print(
            f"{name}: {1e3 * errors[name][0]:.0f} mrad fitted, {1e3 * errors[name][1]:.0f} mrad held out; "
            f"{100 * torque[name]:.1f} % of the torque held out"
        )
        for key, p in fit.parameters.items():
            print(f"  {key:<38} {p.value:8.4f} +- {p.standard_error:.4f} {p.unit}")
    assert errors["and with the load"][1] < 0.5 * errors["Coulomb and viscous"][1]
    assert errors["and with the load"][1] < errors["BAM's law"][1]
    assert torque["and with the load"] < torque["BAM's law"]
    return compared


# %%
# **Result.**

print("Weight and arm known:")
first, second, _ = validate(plain, ("inertia", "torque_constant.constant", "coulomb", "viscous")).values()
print("\nWeight and arm unknown:")
validate(unweighed, ("inertia", "gravity.torque", "coulomb", "viscous"))
first.plot(beside=second, labels=list(added)[:2])

# %%
# **Check.** By other means, without a simulation: the torque of the motor less gravity and inertia is
# friction. It is regressed on the direction of motion, with and without the torque carried, over the held-out
# records.

constant, resistance = 0.5, 4.76
direction, carried, friction = [], [], []
for r in held_out:
    v, a = r.velocity_estimate(8.0), r.acceleration_estimate(8.0)
    drive = constant * (r.u - constant * v) / resistance
    moving = np.abs(v) > 0.3
    direction.append(np.sign(v[moving]))
    carried.append(np.abs(gravity * np.sin(r.y[moving])))
    friction.append((drive - gravity * np.sin(r.y) - 0.0066 * a)[moving])
d, load, f = map(np.concatenate, (direction, carried, friction))
(level, slope), *_ = np.linalg.lstsq(np.column_stack([d, d * load]), f, rcond=None)
print(f"friction by regression: {level:.3f} N m and {slope:.2f} of the torque of gravity")
print(f"the load takes {100 * (1 - second.rmse / first.rmse):.0f} % off the held-out error")
assert slope > 0
plt.show()
