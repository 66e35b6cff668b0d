r"""
A fan identified from its tachometer
====================================

**Problem.** A motor drives a fan; only its speed is measured, by a tachometer, in rpm. The input is a
voltage. The model in use has the motor, dry and viscous friction, but the drag of the air follows another
law: does a record of voltage and speed show it, with no angle measured?

.. code-block:: text

    volts ---->[ motor: k, R ]---torque--->[ rotor and fan, friction, air ]----> speed, in rpm

**Equations.**

.. math::

    J \dot \Omega = \frac{k}{R} (u - k\, \Omega) - d\, \Omega - \tau_c \operatorname{sign} \Omega
    - c\, \Omega |\Omega|

**Method.** The unit says that the output is a speed; the model is then compared by its own speed. Constant
and resistance of the motor are on its plate: they are held, as the speed alone does not distinguish a torque
from an inertia.
"""

import matplotlib.pyplot as plt
import numpy as np

import ctrl_df as cdf

motor = cdf.TorqueConstant(0.05, resistance=1.2)
machine = cdf.Inertia(2e-4, [motor, cdf.Coulomb(4e-3), cdf.Viscous(2e-5), cdf.QuadraticDrag(2e-7)])
t = np.arange(0, 8, 8e-3)
volts = 12 * np.sin(2 * np.pi * 0.25 * t) + 6 * np.sin(2 * np.pi * 0.9 * t + 1)
speed = np.asarray(cdf.event_response(machine, t, volts, input_hold="zoh").outputs)[1] * 60 / (2 * np.pi)
speed += 2.0 * np.random.default_rng(7).standard_normal(t.size)
record = cdf.Measurement(t, volts, speed, input_unit="V", output_unit="rpm", name="fan")
print(record)

# %%
# **Result.** The model in use, a fifth off, and what it misses.

model = cdf.Inertia(2.4e-4, [motor, cdf.Coulomb(5e-3), cdf.Viscous(1.6e-5)])
names = ["quadratic_drag", "stribeck", "asymmetric_coulomb", "position_ripple"]
diagnosis = cdf.diagnose(model, record, candidates=names, free=["inertia", "coulomb", "viscous"])
print(diagnosis.explanation)
found = diagnosis.best
cdf.compare(found.model, record).plot()

# %%
# **Check.** Against what the record was made with; and by a free run of another input, new to both models:

pulses = np.where(np.sin(2 * np.pi * 0.2 * t) > 0, 15.0, -4.0)
true, better, used = (
    np.asarray(cdf.event_response(block, t, pulses, input_hold="zoh").outputs)[1]
    for block in (machine, found.model, cdf.refit(model, record, ["inertia", "coulomb", "viscous"]).model)
)
off = [float(np.sqrt(np.mean((y - true) ** 2)) * 30 / np.pi) for y in (better, used)]
print(f"under pulses: {off[0]:.2f} rpm off with drag, {off[1]:.1f} without, of {true.max() * 30 / np.pi:.0f}")
assert diagnosis.verdict == "effect" and found.id == "quadratic_drag"
assert abs(found.parameters["coefficient"] / 2e-7 - 1) < 0.1
assert off[0] < 0.1 * off[1]
plt.show()
