r"""
A friction damper on a test machine
===================================

**Problem.** A test machine moves the rod of a friction damper and measures the force that it takes: the
motion goes in, the force comes out. The model in use is dry and viscous friction. At every reversal the
measured force drops to zero for a while, and only then builds up in the other direction. What is missing?

.. code-block:: text

    motion x(t) ---->[ rod | pin with play | dry friction | oil ]----> force F(t) of the machine

**Equations.** No mass moves freely, so nothing is integrated except the hidden deflection z of the damper's
linkage, from which the gap g is subtracted on either side:

.. math::

    F = k\, b + d\, \dot b + c\, \dot x, \qquad b = z \mp g/2, \qquad
    \dot z = \dot x - |\dot x|\, |q|\, q, \qquad q = k\, b / F_c

**Method.** A block without mass (`Massless`) is given the motion and compared by its force. The comparison
says how the motion is low-passed and interpolated.
"""

import matplotlib.pyplot as plt
import numpy as np

import ctrl_df as cdf

model = cdf.Massless([cdf.Coulomb(50.0), cdf.Viscous(100.0)])
machine = model.with_effect(cdf.LooseLinkage(5e4, gap=0.004))


def tested(amplitude, omega, seed, name):
    """Return a record of the damper under a sine with a second one on it."""
    noise, t = np.random.default_rng(seed), np.arange(0, 8, 0.004)
    x = amplitude * (np.sin(omega * t) + 0.4 * np.sin(2.7 * omega * t))
    force = np.asarray(cdf.imposed_response(machine, t, x).outputs)[0]
    x, force = x + 1e-6 * noise.standard_normal(t.size), force + 0.5 * noise.standard_normal(t.size)
    return cdf.Measurement(t, x, force, input_unit="m", output_unit="N", name=name)


record, other = tested(0.02, 2.6, 0, "20 mm"), tested(0.03, 1.7, 1, "30 mm, slower")
print(cdf.compare(model, record))

# %%
# **Result.** Three laws that build up after a reversal are tried; a record of another amplitude decides.

laws = ["bristle", "hysteresis", "loose_linkage"]
diagnosis = cdf.diagnose(model, record, holdout=other, candidates=laws)
print(diagnosis.explanation)
found = diagnosis.best

# %%
# The force against the motion shows the play as a step of no force after each reversal.

fig, ax = plt.subplots(figsize=(5.5, 3.6), layout="constrained")
seen = slice(500, 1500)
ax.plot(1e3 * record.u[seen], record.y[seen], color="0.6", lw=3, label="measured")
for block, style, label in ((model, "--", "friction alone"), (found.model, "-", "with a loose linkage")):
    force = np.asarray(cdf.imposed_response(block, record.t, record.u).outputs)[0]
    ax.plot(1e3 * record.u[seen], force[seen], style, lw=1, label=label)
ax.set(xlabel="displacement [mm]", ylabel="force [N]")
ax.legend(frameon=False, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))

# %%
# **Check.** Against what the records were made with, and by the force at the other amplitude:

gap, error = found.parameters["gap"], cdf.compare(found.model, other).nrmse
print(f"gap {1e3 * gap:.3f} mm of 4, error at 30 mm {100 * error:.2f} %")
assert diagnosis.verdict == "effect" and found.id == "loose_linkage"
assert abs(gap / 0.004 - 1) < 0.01
assert error < 0.02 < cdf.compare(model, other).nrmse
plt.show()
