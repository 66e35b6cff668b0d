r"""
Which gains keep a drive from hunting?
======================================

**Problem.** An axis of 9 kg with 5 N of Coulomb friction, 5.5 N at standstill, under PID. The gains of
Azenha & Machado (1997), 2000 N/m, 44250 N/(m s), 130 N s/m, hunt. Which gains do not, and what do they
cost?

.. code-block:: text

    r ---->( + )---[ PID ]---F--->[ 9 kg, friction ]---+---> x
            - ^                                        |
              +----------------------------------------+

**Equations.** A cycle of amplitude a and frequency :math:`\omega` needs

.. math:: k_p + \frac{k_i}{j \omega} + k_d\, j \omega = -\frac{1}{N(a, \omega)} .

The right-hand side does not depend on the gains: it is computed once for all of them, and for two free gains
these are two linear equations.

**Method.** The map over kp and ki. Predictions cover the plane; 40 pairs of gains are simulated from twelve
starts each, more of them where the behaviour of the loop changes, and correct the predictions.
"""

import matplotlib.pyplot as plt

import ctrl_df as cdf

axis = cdf.friction_mass(mass=9, coulomb=5, viscous=0.5, static=5.5)
paper = {"kp": 2000, "ki": 44250}

box = {"kp": (500, 4000), "ki": (0, 80000), "kd": 130}
gains = cdf.limit_cycle_map(axis, **box, exact_check=40, marks={"paper": paper})
print(gains.summary())
print(gains.at(**paper, exact=True))

figure = plt.figure(figsize=(6.4, 4.8), layout="constrained")
gains.plot(ax=figure.add_subplot())

# %%
# **Result.** Everything with integral action hunts or diverges: static friction above the kinetic one makes
# the loop stick, wind up and jump. The describing function, which hardly depends on the instant of breakaway,
# predicts no cycles at the lower edge of the map. Less integral action only makes the hunting slower. What
# helps is to leave it out:

tuned = cdf.tune_pid(axis, bandwidth=12, ki=0)
print(tuned.summary())

# %%
# The price is an offset: the axis may rest wherever the force of the controller stays below 5.5 N.

offset = 5.5 / tuned.gains["kp"]
print(f"rests up to {1e3 * offset:.1f} mm from where it should")

# %%
# **Check.** The hunting at the paper's gains against the exact orbit, found by a search of its own; the
# tuned loop against a simulation from 50 mm.

orbit = cdf.find_limit_cycle(cdf.closed_loop(cdf.pid(2000, 44250, 130), axis))
hunting = gains.at(**paper, exact=True).simulated.orbit
print(f"exact: {orbit.omega:.5f} rad/s, in the map {hunting.omega:.5f} rad/s")
assert abs(orbit.omega - 11.628680) < 1e-5 and abs(hunting.omega / orbit.omega - 1) < 1e-6

rest = cdf.event_response(tuned.loop, [0.0, 30.0, 60.0], 0.0, [0.05, 0.0])
assert tuned.verdict == "rests" and tuned.feasible
assert abs(rest.outputs[0, -1]) <= offset and abs(rest.outputs[0, -1] - rest.outputs[0, 1]) < 1e-6
plt.show()
