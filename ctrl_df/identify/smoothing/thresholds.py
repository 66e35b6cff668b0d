"""The missing force as a signal: tuned numbers, each with what it follows from or what half and twice change.

Measured by `benchmarks/half_and_twice.py smoothing` on four rigs of `tests/rigs.py` (a ripple, Stribeck
friction, a spring, a delay under a PID). Where nothing else is said half and twice of a number change the
force by 5 % of its rms at most, its standard deviation by 5 % (under the PID by a third), the share of a
curve by 0.05, and the time by a third.
"""

from __future__ import annotations

import math

# --- steps ------------------------------------------------------------------------------------------

SMOOTHER_STEPS = 2500
"""Steps that a record is divided into: of ten seconds 4 ms, finer than noise of a position lets forces be
seen. Half of it takes 0.6 of the time. A force that acts for shorter than a step grows with their number: of
Stribeck friction the size is 3.9, 6.5 and 11 N with half, as many and twice as many, and with twice no curve
over the position explains it."""

SMOOTHER_SAMPLES = 16
"""Samples of a step that are compared, at most: with slow noise the work grows with their cube. Of
records over 40,000 samples the others are simulated, too, and not compared: 100,000 take 5 s (all: 174 s)."""

SMOOTHER_RTOL = 1e-6
"""Tolerance of its runs: the noise of a record is larger. Half and twice change nothing."""

SMOOTHER_NUDGE = math.sqrt(SMOOTHER_RTOL)
"""Of parameters and forces, relative to their size, where runs are differenced: curvature and tolerance are
then as large as each other."""

HELD_BACK = 0.1
"""Share of the largest gain below which a state is moved by no force: it sticks. Half and twice change
nothing."""

PARAMETER_NUDGE = 1e-4
"""Of parameters, relative, where forces under an imposed motion are differenced: what hidden states leave of
them (`HIDDEN_RTOL`) is a hundredth of what it changes."""

# --- the process ------------------------------------------------------------------------------------

SMOOTHER_ROUNDS = 12
"""Linearizations at most; rigs take three to seven, under the PID more. Half of it takes 0.75 of the time
there, twice 1.6."""

SMOOTHER_ESTIMATED = SMOOTHER_ROUNDS // 2
"""Of these, those in which size and time of the force and the sensor's noise are re-estimated: the others
let states settle with them."""

SMOOTHER_TRIED = 2
"""Of these, those over which slow noise has to be the more probable to be taken for it. On twenty records of
the tests one choice was wrong after one round, none after two."""

SMOOTHER_STILL = 0.05
"""Change of the force from round to round, in its standard deviations, that nobody would see."""

SMOOTHER_LEAK = 0.1
"""Of the sensor's noise: what continuity of the position may give way over a whole record."""

SMOOTHER_JITTER = 1e-4
"""Process noise of every state, over its scale: matrices stay regular."""

SMOOTHER_DRIVEN = 1e-3
"""Process noise of speeds, over what the known force gives them in a step, for the same reason. Twice of it
raises the standard deviation of the force by 10 % (a spring)."""

SMOOTHER_BEGIN = (0.3, 0.1)
"""Size of the missing force over the known one, and its time over a to-and-fro motion, where their search
begins: a force that would not be overlooked."""

SMOOTHER_USUAL = (0.1, 0.1)
"""The same two that are most probable before any data."""

SMOOTHER_PRIOR = (4.0, 1.5, 1.0)
"""Standard deviations of the logarithms of a missing force's size, of its time and of the noise about the
usual ones: factors of 55, 4.5 and 2.7. A size is known least, a noise best. With twice as wide ones the
standard deviation of the force beside a spring is twice as large."""

SMOOTHER_RANGE = 40.0
"""Logarithm beyond which none of them is tried: 17 decades are any number."""

SLOW_PRIOR = (1.5, 1.5)
"""The standard deviations for slow noise: of its size about the noise floor, which sees the fast part alone,
and of its time about the geometric mean of a sample and a motion. Both are factors of 4.5, as little as of a
force's time is known."""

SMOOTHER_DAMPED = (0.7, 0.2)
"""Size of the simplex, logarithmic, at the start of a search: in the first two rounds a factor of two, later
a fifth, as it begins near its end."""

SMOOTHER_SPREADS = (0.02, 0.05)
"""Size of the simplex and spread of the likelihood over it [nats] at which a search ends: 2 % and 0.05 nats
are far less than the sizes are known to."""

SMOOTHER_EVALUATIONS = 60
"""Of the likelihood, for each of its rounds: half of it leaves them up to 4 % off."""

SLOPE_LEAST = 1e-3
"""Of a step, over the time of a smooth force: what is new in it, its cube, is 1e-9 of the size, and rounding
1e-16."""

UNLIKELY = -1e300
"""Logarithm of a likelihood that is none: below any other, and a number still."""

# --- curves -----------------------------------------------------------------------------------------

FORCE_KNOWN = 0.8
"""Standard deviation of the force, over its size, beyond which an instant says nothing of it: there the
record adds next to nothing, as it leaves 0.8 of what was assumed. With half of it a ripple's share of the
curve over the position is 0.81, and that over the time 0.88, in place of 0.52 and none; of Stribeck friction
half leaves no curve."""

CURVE_BINS = 25
"""Steps of a curve over a quantity, at most. A ripple of eleven waves to the stroke has two for each, and its
share is 0.29, 0.52 and 0.74 with half, as many and twice as many."""

STEPS_A_MOVE = 2 * CURVE_BINS
"""Steps to a to-and-fro motion, at least: one to each step of a curve over the position, both ways."""

CURVE_LEAST = 4
"""Steps of a curve at least: a fall and a rise. Half and twice change nothing."""

UNLIKE = 0.1
"""Autocorrelation of a force below which two instants know of different forces: what is left of it adds less
than its own scatter. Twice of it makes a share of 0.17 of one of 0.05 (the delay)."""

CURVE_ALONE = 4
"""Instants that know of different forces, for each step of a curve: the error of their mean is half their
spread. With half of it a share of 0.75 over the load appears for a spring, which is none; twice takes up to
0.1 away or adds it."""

MADE_LEAST = 0.01
"""Share of a missing force's square that is worth a word: a tenth of its size."""
