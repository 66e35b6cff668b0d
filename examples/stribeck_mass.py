# %% [markdown]
# # Friction that falls with speed: how does it bend the describing function?

# %%
import matplotlib.pyplot as plt
import numpy as np
from _shown import finish

import ctrl_df as cdf

# %% [markdown]
# The same mass with and without a Stribeck curve: static level 8 N falling to 5 N within about 2 cm/s. There
# is no closed form for this one; the forced periodic motion is found by shooting.

# %%
plain = cdf.Mass(9).with_effect(cdf.Coulomb(5)).with_effect(cdf.Viscous(0.5))
stribeck = plain.with_effect(cdf.Stribeck(8.0, velocity=0.02))
A, omega = np.array([9.0, 12.0, 20.0, 40.0]), np.array([4.0, 8.0, 14.0, 20.0])
N = cdf.describing_function_family(plain, A, omega).N
family = cdf.describing_function_family(stribeck, A, omega)
change = np.abs(family.N / N - 1)
print("change of N by the Stribeck curve, rows a = 9, 12, 20, 40 N, columns omega = 4, 8, 14, 20 rad/s:")
for a, row, regime in zip(A, change, family.regime, strict=True):
    print(f"{a:5.0f} N", *(f"{100 * c:6.2f} % {r:10s}" for c, r in zip(row, regime, strict=True)))

# %% [markdown]
# Where the force is large against friction, or the motion fast against the Stribeck velocity, nothing
# changes. The picture is about small, slow motion, and so is the trouble in practice.

# %%
figure, ax = plt.subplots(layout="constrained")
for a, row in zip(A, change, strict=True):
    ax.semilogy(omega, row, "k", lw=1)
    ax.annotate(f"{a:g} N", (omega[-1], row[-1]), xytext=(4, 0), textcoords="offset points", va="center")
ax.margins(x=0.1)
ax.set_xlabel("omega [rad/s]")
ax.set_ylabel("|N / N without Stribeck - 1|")
ax.set_title("Change of N by the Stribeck curve, by force amplitude", fontsize=10)
finish(figure)

# %%
ratio = change[0, 0] / change[-1, 0]
print(f"at 4 rad/s the change is {ratio:.0f} times as large at 9 N as at 40 N")
assert np.all(np.isfinite(family.N)) and ratio > 5
