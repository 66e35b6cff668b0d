"""Inputs and sines that are planned: tuned numbers, each with what it follows from or what chose it.

Every input that is tried is simulated with all candidates, and the best is named: more shapes and sizes cost
time, fewer miss some of the separation. Measured by `benchmarks/half_and_twice.py planning` on four rigs (a
ripple, Stribeck friction, a spring, drag beside a gap), with and without the hidden effect.
"""

from __future__ import annotations

PLAN_SIZES = (1.0, 0.8, 0.6, 0.45, 0.35, 0.25, 0.15, 0.08, 0.04)
"""Sizes of inputs, over the largest that the limits allow, down to where friction holds most machines.
All of them half as large, or twice, the separation is up to two fifths less (0.57 to 1.05 of it)."""

PLAN_MARGIN = 0.9
"""Share of the stroke that candidates may use: the drive itself is like them, not one of them."""

SETTLE = 12
"""Periods before a point of a sine plan is measured: a transient that falls by a factor of e in two periods
is then down to a quarter of a per cent."""

COUNTED = 8
"""Periods over which it is measured: they divide noise by their root, 2.8."""

SINES = 6
"""Points of a plan, as many as two candidates of three parameters have: with all of it a plan takes 120
periods."""

PLAN_SLACK = 1.0001
"""Over a limit, that is rounding."""

PLAN_MOVES = 0.2
"""Least stroke of the candidates' outputs, over the largest: below, one of them does not move. Half and twice
change nothing."""

PLAN_BAND = (0.3, 8.0, 10.0)
"""Frequencies over that of the motion: the lowest, the highest of a multisine, and that of a chirp. Above
them an inertia moves by a hundredth. Half and twice leave 0.93 to 1.05 of the separation."""

PLAN_SINES = 20
"""Sines of a multisine, a sixth apart in frequency. Half and twice leave 0.93 or all of the separation."""

PLAN_STEPS = 400
"""Random steps of an input, after which they are repeated: 800 motions."""

PLAN_STEP_RATE = 0.5
"""Steps over motions, so that the machine settles between them. Half and twice leave 1 to 1.05 of the
separation."""

PLAN_STEP_SIZES = (0.4, 0.6)
"""Size of the steps at least, and how much more at most. Half and twice leave 1 to 1.05 of the separation."""

PLAN_TRIANGLE = 0.4
"""Rate of a triangle, over that of the motion: slow, for what shows at the turns. Half leaves 0.83 to 1.34 of
the separation, twice 0.90 to 1."""

PLAN_PERIOD = (40, 10)
"""Samples of a period at least: of a reference, which the sampled controller of a drive has to follow (an
angle of 9 degrees a sample); of an input, whose ninth part is still a smooth curve."""

PLAN_LEAST = 2 * PLAN_PERIOD[1]
"""Samples of an input at least: two periods."""

PLAN_PEAK = 4
"""Standard deviations of noise that its peaks reach: one of 16,000 samples is larger."""

PLAN_SMOOTH = 0.25
"""Of a to-and-fro motion, over which a reference is smoothed to either side: Hann's window of half a motion
passes nothing at four times its frequency."""

PLANE = (9, 11)
"""Amplitudes and frequencies among which sines are chosen: bounds work, as each is a forced orbit for every
candidate."""

PLANE_BEYOND = (0.5, 2.0)
"""Lowest and highest frequency of sines, over those of the tables: an octave beyond either."""

SINE_SAMPLES = 100
"""Samples of the fastest period of a sine, of which a hold loses 0.02 % of the amplitude."""
