"""Fits: tuned numbers, each with what it follows from or what chose it (`../thresholds.py`)."""

from __future__ import annotations

from ..thresholds import RTOL

# --- ratios of errors -------------------------------------------------------------------------------

BETTER = 0.99
"""Error over the one before that counts as a better minimum."""

SAME = 1.001
"""Error over the least that counts as the same: well below the spread of an rms, 1/sqrt(2 n), which is 0.007
for 10,000 samples."""

OUTLYING_SEGMENT, OUTLYING_NOISE = 1.5, 2.0
"""Error of a segment over the good quarter's, and over the noise, from which its start is sought anew."""

GOOD = 0.25
"""Share of the segments that are taken to be right when others are compared with them."""

# --- what a record shows ----------------------------------------------------------------------------

PARAMETER_RANGE = 12.0
"""Factor by which the model's own parameters may be off: beyond, a fit bends them to what they are not."""

SIZE_PRIOR = 3.0
"""Factor by which the model's own parameters may be off before any data, one standard deviation: beyond two
and a half lies `PARAMETER_RANGE`."""

# --- lengths of segments, samples -------------------------------------------------------------------

SEGMENT_LEAST = 50
"""Samples of the shortest segment of a diagnosis: states and derivatives of hidden bodies need more."""

SEGMENT_MOTIONS, SEGMENT_USUAL, SEGMENTS = 2.5, 60, (4, 40)
"""The longest segments of a diagnosis: to-and-fro motions in each, samples at least; how many of a record, at
least and at most."""

SHORTEST = 16
"""How many times as many the shortest segments of a diagnosis are as the longest: of two to-and-fro motions
and a half, a sixth of one remains, over which every effect is all but linear."""

LEVELS = (SHORTEST, 4, 1)
"""How many times as many as the longest segments are, of the three lengths that are looked at."""

BRIEF = 4 * SHORTEST
"""How many times as many they are for the parameters of a machine with disturbance forces."""

FILTERED = 40
"""Values of the force that the shortest segments show where disturbance forces outweigh the noise."""

HOLDOUT_PARTS = 9
"""Parts of a record of which every third is held out where no record is."""

SCREEN_SAMPLES = 2500
"""Steps of the input to which a record is thinned while candidates are screened: a quarter of those
of the rigs' records."""

RTOL_COARSE, RTOL_OVER_NOISE = 1e-5, 1e-3
"""Relative tolerance of simulations while candidates are screened: at most, and as a share of the sensors'
noise over the motion. Derivatives are differences over which the output moves by 0.3 times the noise: errors
of a thousandth of it change them by less than a hundredth."""

ANGLE_WORTH = 50.0
"""Log likelihood ratio, for white noise, that a record's own angle must bring: coloured residuals make tens
of it by chance (rigs with ripples)."""

ANGLES = 6
"""Angles of a full turn from which that of a record is sought: a sine's minimum reaches half a turn."""

# --- descents ---------------------------------------------------------------------------------------

DAMPING, DAMPING_LEAST, DAMPING_MOST = 1e-3, 1e-7, 1e4
"""Of Levenberg and Marquardt, over the curvature: at the begin; at least, where steps are those of Gauss and
Newton; at most, where a refused step is too short to gain."""

NUDGE_FIRST, NUDGE_LEAST, NUDGE_MOST, NUDGE_FALLS = 1e-3, 100 * RTOL, (0.05, 0.02), 0.05
"""Steps of scaled parameters that derivatives are differences over: the first; at least, a hundred times what
simulations err by; at most, on a linear and on a logarithmic scale; next one over the last, at least."""

OUTPUT_MOVES = 0.3
"""Of the noise: what the output is to move by over such a step, seen well and linear still."""

STATE_NUDGE, HIDDEN_NUDGE = 3e-3, 0.1
"""The same of initial states: of place and speed over the typical ones, of what is hidden over its reach."""

SLACK_TURNED = 0.8
"""Share of a gap from which its state is moved back."""

AT_BOUND, ON_BOUND = 1e-6, 1e-9
"""Distance of a scaled parameter from a bound that leaves no room; difference that rounding makes."""

OPEN_BOUND = 1e-3
"""Distance from a bound that a share must not reach."""

LOG_MOST = 40.0
"""Logarithm of a factor by which a parameter may be off its scale: 17 decades are any number."""

NATURAL = 0.1
"""Size of a parameter that matters, over what the scales of a record make of its unit; but of a mass."""

MOTOR_LEAST = 0.05
"""Share of its dry friction that the motor keeps where the load gains some."""

GAP_PLACES, GAP_RATES = (0.02, 0.25, 0.5, 0.75, 0.98), (0.0, -0.2, 0.2, -0.7, 0.7)
"""Where in a gap segments may begin, and how fast they cross it, over the typical speed."""

# --- how long fits go on: steps at most, relative gain of the cost that is none -----------------------

EFFORT_SHORT, EFFORT_REFIT = (6, 2e-2), (40, 1e-4)
"""Of a refit: over short segments, whose minimum is not the last one's; at its end."""

EFFORT_STATES = (4, 2e-2)
"""Of initial states from which a fit goes on that moves them anyway."""

EFFORT_ALONE, EFFORT_BEGUN, EFFORT_FOLLOWED = (8, 1e-4), (5, 1e-2), (2, 1e-2)
"""Of initial states alone: to their end; over beginnings of segments, and where tries of them lead; behind
one step of the parameters."""

# --- where fits begin again -------------------------------------------------------------------------

RESTART_FACTORS = (0.6, 0.8, 1.25, 1.6)
"""Of a parameter over which the cost has many minima."""

STATIC_FACTORS = (0.8, 0.95, 0.985, 0.995, 1.005, 1.015, 1.05, 1.25)
"""Of a static level: single samples pass it."""

RESTARTED_AGAIN, RESTARTS_KEPT = 2, 3
"""Times that a parameter that found a better minimum is moved once more; restarts that go on."""

DAMPED = 4
"""Times that a refused step of an initial state is damped tenfold: from 1e-3 to a step a tenth as long."""

OPEN_RANGE = (0.0025, 0.005, 0.01, 0.02, 0.04, 0.08, 0.16)
"""How far about a static level the segments are tried for the range that they leave open."""

UNFOLLOWED = 0.7
"""Mean squared error over the one before below which another start of a segment is taken as it is (rigs)."""

RESTART_SPEEDS = (-1, -0.6, -0.3, -0.15, 0, 0.15, 0.3, 0.6, 1)
"""Speeds to begin a segment with, over how far the estimate may be off."""

BEGINNINGS = (16, 8, 4, 2)
"""Shares of a segment over which the state that it begins in is found first, each twice the last."""

# --- noise ------------------------------------------------------------------------------------------

MANY_SEGMENTS = 50
"""Segments of a record from which on they tell how their errors go on from one to the next."""

NOISE_PASSES = 300
"""Multiplicative steps to the likeliest spectrum of the noise: ten times as many move most of it by a
hundredth, none by more than a fifth (measured on white, first-order and pink noise), a tenth of an error."""

NOISE_SHARE = 0.1
"""Share of a frequency's power from which on what a fit takes away there is worked out exactly: below it the
rest is off by the square of it, a hundredth."""

NOISE_KNOWN = 2.0
"""Natural logarithm of the factor, 7, within which the size of each part of the noise is known: a random
walk, the steepest noise of a sensor, falls by 4 from one octave, and so from one part, to the next."""

NOISE_ORDER = 12
"""Largest order of the noise model of a residual that others are judged by."""

NOISE_LEFT, NOISE_LEAST = 1e-3, 1e-6
"""Share of its density that a fit leaves of a noise at least; power of a noise, over that of the sensors',
that is rounding."""

IMPULSE_GONE = 1e-6
"""Over its peak, an impulse response that has died out."""

UNDETERMINED = 1e-7
"""Curvature of the cost, over the largest, along a direction that data do not determine: to change the output
as much a step there has to be 3000 times as long."""

FREEDOM_MOST = 1e6
"""Degrees of freedom of a normal distribution."""
