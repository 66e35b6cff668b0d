r"""
A family that takes long: how do I stop it and go on tomorrow?
==============================================================

**Problem.** A carriage with dry friction on a hardening spring, at 24 amplitudes and 24 frequencies:
motions jump and double their period, and a point costs milliseconds. On finer grids that is hours, and
hours get interrupted.

.. math:: M \ddot x = a \cos \omega t - B \dot x - K \operatorname{sign} \dot x - k_3 x^3

**Method.** ``save=`` keeps every finished line of the grid in a file at once, whatever ends the process;
the same call computes the others. The file carries a fingerprint of all that determines the numbers, and is
not used by any other computation.
"""

import tempfile
import warnings
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import ctrl_df as cdf

block = (
    cdf.Mass(2.0)
    .with_effect(cdf.CubicSpring(2e4))
    .with_effect(cdf.Coulomb(1.0))
    .with_effect(cdf.Viscous(2.0))
)
A, omega = np.geomspace(1.5, 40, 24), np.geomspace(4, 40, 24)
# At some points this block never repeats itself; each family would warn that N is an average there.
warnings.simplefilter("ignore", cdf.DescribingFunctionWarning)
folder = tempfile.TemporaryDirectory()
path = Path(folder.name) / "family.npz"

# %%
# Start it, and press Ctrl-C. Here a pool of workers does that in your place: it stops after nine pieces of
# work.


class Impatient(ThreadPoolExecutor):
    left = 9

    def submit(self, *work):
        self.left -= 1
        if self.left < 0:
            raise KeyboardInterrupt
        piece = super().submit(*work)
        wait([piece])
        return piece


try:
    with Impatient(2) as pool:
        cdf.describing_function_family(block, A, omega, executor=pool, save=path)
except KeyboardInterrupt as stopped:
    print(stopped)

# %%
# **Result.** The same call continues where the first one stopped, and a finished file is read at once:

family = cdf.describing_function_family(block, A, omega, save=path)
print(family)
again = cdf.load_family(path)

figure, ax = plt.subplots(layout="constrained")
for k in range(0, 24, 4):
    ax.loglog(omega, np.abs(family.N[k]), color=plt.cm.copper(k / 24), label=f"{A[k]:.3g} N")
ax.set_xlabel("frequency [rad/s]")
ax.set_ylabel("|N| [m/N]")
ax.set_xticks([4, 6, 10, 20, 40], ["4", "6", "10", "20", "40"])
ax.set_xticks([], minor=True)
figure.legend(title="amplitude", loc="outside right center", frameon=False)

# %%
# **Check.** The values kept and those computed afterwards are bitwise the same as in one uninterrupted call;
# another computation is refused.

whole = cdf.describing_function_family(block, A, omega)
assert np.array_equal(again.N, family.N, equal_nan=True)
assert np.array_equal(whole.harmonics, family.harmonics, equal_nan=True)
print("interrupted and resumed against computed at a stroke: 0 differences")
try:
    cdf.describing_function_family(block.with_effect(cdf.ConstantForce(1.0)), A, omega, save=path)
    raise AssertionError("another computation must be refused")
except ValueError as refused:
    print(str(refused)[:120], "...")
folder.cleanup()
plt.show()
