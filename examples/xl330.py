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

**Equations.** A level :math:`\tau_c`, and more the more is carried:

.. math::

    J \ddot\varphi = \frac{k}{R} (u - k\, \dot\varphi) - m g l \sin\varphi - d\, \dot\varphi
    - (\tau_c + \mu\, |\tau|) \operatorname{sign} \dot\varphi

**Method.** Weight and arm are known, and so is the torque of gravity: it is the scale by which volts become
torques. The rest is refitted on the records of the lower gain, over windows of half a second, with and
without the friction that carries load, and judged on those of the higher gain.
"""

import sys
from pathlib import Path

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

gravity = 0.49 * 9.81 * 0.1
motor = cdf.TorqueConstant(0.323, resistance=4.76)
plain = cdf.Inertia(
    0.00164 + 0.49 * 0.1**2, [motor, cdf.Gravity(gravity), cdf.Coulomb(0.05), cdf.Viscous(0.005)]
)
models = {
    "Coulomb and viscous": (plain, ()),
    "and with the load": (
        plain.with_effect(cdf.LoadDependentFriction(0.1)),
        ("load_dependent_friction",),
    ),
}

# %%
# **Result.**

free = ("inertia", "torque_constant.constant", "coulomb", "viscous")
errors, compared = {}, {}
for name, (model, more) in models.items():
    fit = cdf.refit(model, train, [*free, *more], window=WINDOW, budget=250)
    compared[name] = cdf.compare(fit.model, held_out, window=WINDOW)
    errors[name] = fit.comparison.rmse, compared[name].rmse
    print(f"{name}: {1e3 * errors[name][0]:.0f} mrad fitted, {1e3 * errors[name][1]:.0f} mrad held out")
    for key, p in fit.parameters.items():
        print(f"  {key:<38} {p.value:8.4f} +- {p.standard_error:.4f} {p.unit}")
first, second = compared.values()
first.plot(beside=second, labels=list(compared))

# %%
# **Check.** By other means, without a simulation: torque of the motor less gravity and inertia is friction.
# Regressed on its direction, with and without the torque carried, over the records held out.

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
assert errors["and with the load"][1] < 0.5 * errors["Coulomb and viscous"][1]
plt.show()
