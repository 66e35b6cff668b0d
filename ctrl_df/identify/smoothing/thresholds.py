"""The missing force as a signal: tuned numbers, each with what it follows from."""

from __future__ import annotations

SMOOTHER_STEPS = 2500
"""Steps of a record: 4 ms of ten seconds, finer than noise of a position lets see of forces (rigs)."""

SMOOTHER_ROUNDS = 12
"""Linearizations at most; rigs take three to seven."""

SMOOTHER_ESTIMATED = 6
"""Of these, those in which size and time of the force and the sensor's noise are estimated anew."""

SMOOTHER_STILL = 0.05
"""Change of the force from round to round, in its standard deviations, that nobody would see."""

SMOOTHER_RTOL = 1e-6
"""Tolerance of its runs: the noise of a record is larger."""

SMOOTHER_NUDGE = 1e-3
"""Of parameters and forces, relative to their size, where runs are differenced: the square root of that."""

SMOOTHER_LEAK = 0.1
"""Of the sensor's noise: what continuity of the position may give way over a whole record."""

FORCE_KNOWN = 0.8
"""Of the force's size: with a standard deviation beyond it the record adds nothing to what was assumed."""

CURVE_BINS, CURVE_LEAST = 25, 4
"""Steps of a curve over a quantity, at most and at least."""

UNLIKE = 0.1
"""Autocorrelation of a force below which it is another one: what is left adds less than its own scatter."""

CURVE_ALONE = 4
"""Instants that know of different forces, for each step of a curve: its error is half their spread."""

SMOOTHER_BEGIN, SMOOTHER_USUAL = (0.3, 0.1), (0.1, 0.1)
"""Size of the missing force over the known one, its time over a to-and-fro motion: where their search begins,
and most probable before any data."""

SMOOTHER_DAMPED, SMOOTHER_SPREADS = (0.7, 0.2), (0.02, 0.05)
"""Size of the simplex, logarithmic, in the first two rounds and later; of it and of the likelihood at its
end."""

SMOOTHER_EVALUATIONS = 60
"""Of the likelihood, for each of its rounds."""

SMOOTHER_JITTER, SMOOTHER_DRIVEN = 1e-4, 1e-3
"""Process noise of every state, over its scale, and of speeds, over what the known force gives them in a
step: matrices stay regular."""

UNLIKELY = -1e300
"""Logarithm of a likelihood that is none."""

PARAMETER_NUDGE = 1e-4
"""Of parameters, relative, where runs of a whole record are differenced."""

HELD_BACK = 0.1
"""Share of the largest gain below which a state is moved by no force: it sticks."""

MADE_LEAST = 0.01
"""Share of a missing force's square that is worth a word: a tenth of its size."""

SMOOTHER_PRIOR, SMOOTHER_RANGE = (4.0, 1.5, 1.0), 40.0
"""Standard deviations of the logarithms of a missing force's size and time and of the noise, about the usual
ones: factors of 55, 4.5 and 2.7; logarithms beyond which they are not tried."""

SLOPE_LEAST = 1e-3
"""Of a step, over the time of a smooth force: what is new in it, its cube, is 1e-9 of the size, and rounding
1e-16."""
