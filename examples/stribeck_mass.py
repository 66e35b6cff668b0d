r"""
Friction that falls with speed: what does it change?
====================================================

**Problem.** The friction of a mass of 9 kg is 8 N at rest and falls to 5 N within about 2 cm/s. At which
amplitudes and frequencies does that matter?

**Equations.** With the Coulomb level K, the static level :math:`K_s` and the Stribeck velocity :math:`v_s`,

.. math:: \text{friction}(v) = K + (K_s - K)\, e^{-(v / v_s)^2} .

**Method.** The describing function with the fall over the one without. There is no closed form for this
friction; the forced periodic motion is found by Newton's method.
"""

import matplotlib.pyplot as plt
import numpy as np

import ctrl_df as cdf

plain = cdf.Mass(9).with_effect(cdf.Coulomb(5)).with_effect(cdf.Viscous(0.5))
stribeck = plain.with_effect(cdf.Stribeck(8.0, velocity=0.02))
A, omega = np.array([9.0, 12.0, 20.0, 40.0]), np.array([4.0, 8.0, 14.0, 20.0])
N = cdf.describing_function_family(plain, A, omega).N
family = cdf.describing_function_family(stribeck, A, omega)
change = np.abs(family.N / N - 1)
print("change of N, rows a = 9, 12, 20, 40 N, columns omega = 4, 8, 14, 20 rad/s:")
for a, row, regime in zip(A, change, family.regime, strict=True):
    print(f"{a:5.0f} N", *(f"{100 * c:6.2f} % {r:10s}" for c, r in zip(row, regime, strict=True)))

# %%
figure, ax = plt.subplots(layout="constrained")
for a, row in zip(A, change, strict=True):
    ax.semilogy(omega, row, "k", lw=1)
    ax.annotate(f"{a:g} N", (omega[-1], row[-1]), xytext=(4, 0), textcoords="offset points", va="center")
ax.margins(x=0.1)
ax.set_xlabel("frequency [rad/s]")
ax.set_ylabel("change of N, relative")
ax.set_title("What the Stribeck curve changes, by amplitude of the force", fontsize=10)

# %%
# **Result.** Where the force is large against friction, or the motion fast against the Stribeck velocity,
# nothing changes. The Stribeck curve matters for small, slow motion, where problems occur in practice.
#
# **Check.** One point by SciPy, with the friction smoothed over 1 mm/s:

from scipy.integrate import solve_ivp  # noqa: E402

a, w = A[-1], omega[0]


def rates(t, s):
    friction = (5 + 3 * np.exp(-((s[1] / 0.02) ** 2))) * np.tanh(s[1] / 1e-3)
    return [s[1], (a * np.cos(w * t) - 0.5 * s[1] - friction) / 9]


period = 2 * np.pi / w
t = np.linspace(20 * period, 21 * period, 1025)
x = solve_ivp(rates, (0, t[-1]), [0, 0], "LSODA", t, rtol=1e-8, atol=1e-10).y[0]
brute = 2 / a * np.mean((x * np.exp(-1j * w * t))[:-1])
print(f"N {family.N[-1, 0]:.5e}, by SciPy {brute:.5e}")

ratio = change[0, 0] / change[-1, 0]
print(f"at 4 rad/s the change is {ratio:.0f} times as large at 9 N as at 40 N")
assert abs(brute / family.N[-1, 0] - 1) < 0.01
assert np.all(np.isfinite(family.N)) and ratio > 5
plt.show()
