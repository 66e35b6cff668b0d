r"""
What does my model miss? A test where the answer is known
=========================================================

**Problem.** A drive's model has Coulomb and viscous friction. Its record shows that something else is
missing. Does the record determine what it is, and how large? Here the record is made by simulation, so that
the answer is known: a drive with a stop of rubber, a spring that hardens with the cube of the stroke.

.. code-block:: text

    F, recorded ---+--->[ machine: 2.2 kg, friction, + something ]---> x, recorded
                   |                                                     | -
                   +--->[ model: 2 kg, friction ]---> x simulated ---->( + )---> residual

**Equations.**

.. math:: M \ddot x = F - B \dot x - K \operatorname{sign} \dot x - k_3 x^3 ,

the last term unknown to the model.

**Method.** ``diagnose``: the model is refitted, possible effects are added to it in turn, and validated on
held-out data. Without ``candidates=`` the whole library is tried.
"""

import matplotlib.pyplot as plt
import numpy as np

import ctrl_df as cdf

t = np.arange(0, 8, 0.02)
waves = [(9, 0.31), (8, 0.73), (6, 1.27), (5, 2.11)]  # N, Hz
force = sum(a * np.sin(2 * np.pi * f * t + k) for k, (a, f) in enumerate(waves))
machine = cdf.friction_mass(2.2, 3.0, 6.0).with_effect(cdf.CubicSpring(60.0))
x = np.asarray(cdf.event_response(machine, t, force, input_hold="zoh").outputs)[0]
x += 2e-4 * np.random.default_rng(11).standard_normal(t.size)
record = cdf.Measurement(t, force, x, name="drive")

model = cdf.friction_mass(2.0, 2.5, 5.0)
fit = cdf.refit(model, record)
print(f"the model with its best parameters errs by {100 * fit.comparison.nrmse:.1f} % of the motion")

# %%
# **Result.**

laws = ["cubic_spring", "linear_spring", "stribeck", "quadratic_drag"]
diagnosis = cdf.diagnose(model, record, candidates=laws)
print(diagnosis.explanation)
print(diagnosis.table(rows=4))
diagnosis.plot()

# %%
# The parameters with their errors, against the truth:

best = diagnosis.best
for name, true in (
    ("mass", 2.2),
    ("coulomb.level", 3.0),
    ("viscous.coefficient", 6.0),
    ("cubic_spring.stiffness", 60.0),
):
    parameter = best.model.parameters[name]
    print(f"{name:24s} {parameter.value:8.4f} {parameter.unit:8s} true {true:g}")

# %%
# **Check.** The verdict and the numbers; and the reverse: with the effect in the model nothing is missing
# any more.

again = cdf.diagnose(best.model, record, candidates=["linear_spring", "quadratic_drag"])
print("with it in the model:", again.verdict)
assert diagnosis.verdict == "effect" and best.id == "cubic_spring"
assert abs(best.parameters["stiffness"] / 60 - 1) < 0.02
assert again.verdict == "none"
plt.show()
