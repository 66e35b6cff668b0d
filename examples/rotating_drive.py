r"""
A motor with cogging torque, recorded in degrees
================================================

**Problem.** A direct drive turns a disc of 0.01 kg m². Its model has dry and viscous friction; the
magnets pull the rotor into 24 notches a turn, which the model does not include. Does a record of torque and
angle show it?

.. code-block:: text

    torque ---->[ 0.01 kg m^2, friction, magnets ]----> angle, in degrees

**Equations.**

.. math::

    J \dot \Omega = \tau - d\, \Omega - \tau_c \operatorname{sign} \Omega
    + \hat\tau \sin\left(\frac{2 \pi \varphi}{\lambda}\right), \qquad \lambda = \frac{2 \pi}{24}

**Method.** ``Inertia`` takes the effects of ``Mass``; their parameters are then in N m and rad. A record in
degrees says so and is converted once.
"""

import matplotlib.pyplot as plt
import numpy as np

import ctrl_df as cdf

notch = 2 * np.pi / 24
motor = cdf.Inertia(0.01).with_effect(cdf.Coulomb(0.05)).with_effect(cdf.Viscous(0.02))
cogging = motor.with_effect(cdf.PositionRipple(0.04, wavelength=notch))
print({name: p.unit for name, p in cogging.parameters.items()})

t = np.arange(0, 6, 0.01)
torque = 0.16 * np.sin(2 * np.pi * 0.4 * t) + 0.1 * np.sin(2 * np.pi * 1.1 * t + 1)
angle = np.degrees(np.asarray(cdf.event_response(cogging, t, torque, input_hold="zoh").outputs)[0])
angle += 0.02 * np.random.default_rng(24).standard_normal(t.size)
record = cdf.Measurement(t, torque, angle, input_unit="N m", output_unit="deg", name="disc")
print(record)

# %%
# **Result.**

model = cdf.Inertia(0.012).with_effect(cdf.Coulomb(0.06)).with_effect(cdf.Viscous(0.015))
diagnosis = cdf.diagnose(model, record, candidates=["position_ripple", "stribeck", "drift"])
print(diagnosis.explanation)
found = diagnosis.best
print(f"{2 * np.pi / found.parameters['wavelength']:.2f} notches a turn")
diagnosis.plot()

# %%
# **Check.** Against what the record was made with; and at rest the better model stays in a notch, where the
# one without magnets would follow a small torque:

stays, follows = (
    np.degrees(np.asarray(cdf.event_response(block, [0, 5], 0.07, [0.5 * notch, 0.0]).outputs)[0, -1])
    for block in (found.model, motor)
)
print(f"under 0.07 N m: {stays - 7.5:.2f} degrees with magnets, {follows - 7.5:.0f} without")
assert diagnosis.verdict == "effect" and found.id == "position_ripple"
assert abs(found.parameters["wavelength"] / notch - 1) < 1e-3
assert abs(abs(found.parameters["amplitude"]) / 0.04 - 1) < 0.02
assert abs(stays - 7.5) < 7.5 < follows - 7.5
plt.show()
