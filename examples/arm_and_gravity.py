r"""
An arm that a motor lifts: a weight missing in the model
========================================================

**Problem.** A joint swings an arm of 0.08 kg m² in the vertical plane. Its model was made with the arm lying
in the horizontal plane: inertia and friction, no weight. Does a record of torque and angle show what is
missing, and how far does the arm sag under a PD controller?

.. code-block:: text

    r ---->( + )---[ PD ]---torque--->[ joint: inertia, friction, weight ]---+---> angle
            - ^                                                              |
              +--------------------------------------------------------------+

**Equations.** With the angle :math:`\varphi` from where the arm hangs,

.. math::

    J \ddot\varphi = \tau - d\, \dot\varphi - \tau_c \operatorname{sign} \dot\varphi
    - m g l \sin(\varphi - \varphi_0)

The zero of the encoder is not where the arm hangs, hence :math:`\varphi_0`.

**Method.** ``Inertia`` takes effects as ``Mass`` does, in N m and rad; ``Gravity`` is among them.
``diagnose`` finds whether the record calls for it.
"""

import matplotlib.pyplot as plt
import numpy as np

import ctrl_df as cdf

bare = cdf.Inertia(0.08).with_effect(cdf.Coulomb(0.3)).with_effect(cdf.Viscous(0.1))
joint = bare.with_effect(cdf.Gravity(2.5, angle0=0.2))  # 0.85 kg at 0.3 m

t = np.arange(0, 8, 0.02)
torque = 1.6 * np.sin(2 * np.pi * 0.35 * t) + 1.2 * np.sin(2 * np.pi * 0.9 * t + 1)
start = [0.2, 0.0]  # it hangs
angle = np.asarray(cdf.event_response(joint, t, torque, start, input_hold="zoh").outputs)[0]
angle += 2e-4 * np.random.default_rng(5).standard_normal(t.size)
record = cdf.Measurement(t, torque, angle, input_unit="N m", output_unit="rad", name="joint")

# %%
# **Result.** The torque that would have to be added for the model to follow the record, over the angle: it
# looks like a sine.

model = cdf.Inertia(0.09).with_effect(cdf.Coulomb(0.25)).with_effect(cdf.Viscous(0.12))
cdf.compare(model, record).missing_force.plot(against="position")

# %%
# The diagnosis compares it with other forces that a joint may have:

forces = ["gravity", "linear_spring", "constant_force", "stribeck"]
diagnosis = cdf.diagnose(model, record, candidates=forces)
print(diagnosis.explanation)
print(diagnosis.table(rows=4))
found = diagnosis.best.model
for name in ("inertia", "coulomb.level", "gravity.torque", "gravity.angle0"):
    print(f"{name}: {found.parameters[name].value:.4f} {found.parameters[name].unit}")

# %%
# With the weight known, the sag under a PD controller of 20 N m/rad can be predicted, and so can the torque
# that must be added to the command so that only the error held by friction remains:

loop = cdf.closed_loop(cdf.pid(20, 0, 1.5), found)
weight, hangs = found.parameters["gravity.torque"].value, found.parameters["gravity.angle0"].value
wanted = 1.2  # rad
lifted = wanted + weight * np.sin(wanted - hangs) / 20
for name, command in (("as it is", wanted), ("with the weight added", lifted)):
    run = cdf.event_response(loop, [0, 2.5, 5], command, [hangs, 0.0])
    rest = float(run.outputs[0, -1])
    print(f"command {name}: comes to rest at {rest:.3f} rad, {rest - wanted:+.3f} from {wanted}")
    if command == wanted:
        sagged = rest

# %%
# **Check.** The parameters against what the record was made with; the sag against statics (controller and
# weight are in balance, up to what friction holds); the arm's small swings, its linearization at rest without
# dry friction, against those of a pendulum:

assert diagnosis.verdict == "effect" and diagnosis.best.id == "gravity"
assert abs(weight / 2.5 - 1) < 0.01 and abs(hangs - 0.2) < 0.005
assert abs(20 * (wanted - sagged) - 2.5 * np.sin(sagged - 0.2)) <= 0.3
assert abs(rest - wanted) <= 0.3 / 20
swings = found.without_effect("coulomb").linearize([hangs, 0.0], 0.0).poles()
pendulum = np.roots([0.08, 0.1, 2.5])
print(f"swings at {abs(swings[0].imag):.3f} rad/s, a pendulum like it at {abs(pendulum[0].imag):.3f} rad/s")
assert abs(abs(swings[0].imag / pendulum[0].imag) - 1) < 0.01
plt.show()
