"""Fits: tuned numbers, each with what it follows from or what chose it (`../thresholds.py`)."""

from __future__ import annotations

# --- ratios of errors -------------------------------------------------------------------------------

SAME_ERROR = 1.001
"""Error over the least that counts as the same: well below the spread of an rms, 1/sqrt(2 n), which is 0.007
for 10,000 samples."""

# --- what a record shows ----------------------------------------------------------------------------

PARAMETER_RANGE = 12.0
"""Factor by which the model's own parameters may be off: 2.26 standard deviations of their prior
(`SIZE_PRIOR`, a factor of three), which hold 98 %; beyond, a fit bends them to what they are not."""

# --- lengths of segments, samples -------------------------------------------------------------------

SEGMENT_MOTIONS = 2.5
"""To-and-fro motions in each of the longest segments of a diagnosis. Half and twice name the same effects on
three rigs, half with 0.6 of the evidence of a joint."""

SEGMENT_USUAL = 60
"""Samples in each of them, at least."""

SEGMENTS = (4, 40)
"""How many of them a record has, at least and at most, as each has initial states of its own. Half and twice
of the latter change nothing on three rigs."""

SHORTEST = 16
"""How many times as many the shortest segments of a diagnosis are as the longest: of two to-and-fro motions
and a half, a sixth of one remains, over which every effect is all but linear."""

SEGMENT_SCALES = (SHORTEST, 4, 1)
"""How many times as many as the longest segments are, of the three lengths that are looked at."""

SHORT = 4 * SHORTEST
"""How many times as many they are for the parameters of a machine with disturbance forces."""

FILTERED = 40
"""Values of the force that the shortest segments show where disturbance forces outweigh the noise: 240 of a
to-and-fro motion, of which such a segment is a sixth. Half and twice leave the verdicts on three machines of
varying friction (15,000 samples) as they are; the effect hidden in one has 184 and 399 nats for 279."""

HOLDOUT_PARTS = 9
"""Parts of a record of which every third is held out where no record is: three, at the end of each third of
it."""

SCREEN_SAMPLES = 2500
"""Steps of the input to which a record is decimated while candidates are screened: a quarter of those
of the rigs' records."""

ANGLE_WORTH = 50.0
"""Log likelihood ratio, for white noise, that a record's own angle must bring: coloured residuals make tens
of it by chance (rigs with ripples)."""

ANGLES = 6
"""Angles of a full turn from which that of a record is sought: a sine's minimum reaches half a turn."""

EFFORT_OWN = 5
"""Steps of a fit of what a record has for itself, all else being known: one or two parameters near their
values."""

# --- descents ---------------------------------------------------------------------------------------

MOTOR_LEAST = 0.05
"""Share of its dry friction that the motor keeps where the load gains some: at none the level would lie on
its bound, and its scale would no longer be its own. Half or twice of it changes nothing (a rubbing load)."""

# --- how long fits go on: steps at most, relative gain of the cost that is none -----------------------

EFFORT_SHORT = (6, 2e-2)
"""Steps of a refit over short segments at most, and relative gain of the cost at which it ends: their minimum
is not the last one's."""

EFFORT_REFIT = (40, 1e-4)
"""The same at its end. A gain of 1e-4 is half a nat of 10,000 samples: a step of one standard error along one
direction gains as much."""

EFFORT_STATES = (4, 2e-2)
"""The same of initial states from which a fit goes on that moves them anyway."""

# --- where fits begin again -------------------------------------------------------------------------

RESTART_FACTORS = (0.6, 0.8, 1.25, 1.6)
"""Of a parameter over which the cost has many minima: neighbours, and the value itself between them, are a
fourth to a third apart."""

STATIC_FACTORS = (0.8, 0.95, 0.985, 0.995, 1.005, 1.015, 1.05, 1.25)
"""Of a static level: single samples pass it, so that minima are close; distances from one grow three- to
fivefold from half a per cent to a quarter."""

RESTARTED_AGAIN = 2
"""Times that a parameter that found a better minimum is moved once more."""

SEGMENTS_KEPT = 0.75
"""Share of the segments that lead on where others hold a fit in a wrong minimum: a quarter is usually left
out (Rousseeuw & Van Driessen 1999)."""

KEPT_IN_VAIN = 2
"""Steps in turn that come to no better minimum, after which that path ends. Twelve gaps of another generator
refitted from the stated values: with this path the error was 1.24 instead of 1.55 times that of a refit
from the truth on one, within 1 % of what it was on all others, in twice the time. Steps may go on
lowering the error by too little to be another minimum: a gap that lacked a drag took twice the time for
that."""

RESTARTS_KEPT = 3
"""Restarts that go on."""

BEGINNINGS_KEPT = 12
"""Tries of where a segment begins that go on where no parameter moves. Of 160 sets of segments of a gap with
elastic faces 13, 5 and 3 kept one in a wrong minimum with 3, 8 and 12, in the same time."""

OPEN_RANGE = (0.0025, 0.005, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32)
"""How far about a static level the segments are tried for the range that they leave open: from a quarter of a
per cent, doubled until a third (of a rig, 20 % were open)."""

OPEN_HALVED = 3
"""How often the interval in which this range ends is halved: the true level may lie next to the end."""

# --- noise ------------------------------------------------------------------------------------------

MANY_SEGMENTS = 50
"""Segments of a record from which on they show how their errors are correlated from one to the next: a
correlation of 50 pairs has a standard deviation of 0.14."""

NOISE_PASSES = 300
"""Multiplicative steps to the likeliest spectrum of the noise: ten times as many move most of it by a
hundredth, none by more than a fifth (measured on white, first-order and pink noise), a tenth of an error."""

NOISE_SHARE = 0.1
"""Share of a frequency's power from which on what a fit takes away there is worked out exactly: below it the
rest is off by the square of it, a hundredth."""

NOISE_KNOWN = 2.0
"""Natural logarithm of the factor, 7, within which the size of each part of the noise is known: a random
walk, the steepest noise of a sensor, falls by 4 from one octave, and so from one part, to the next."""

NOISE_LEFT, NOISE_LEAST = 1e-3, 1e-6
"""Share of its density that a fit leaves of a noise at least; power of a noise, over that of the sensors',
that is rounding."""

OUTPUT_APART = 1e-6
"""Singular value, over the largest, below which parameters move the output in no direction of its own: the
finest simulations err by 1e-8 (`RTOL_FINEST`), a hundred times that over a step of a hundredth, and coarser
ones alike on either side of such a step (a drive gain beside curved friction is told at 30 and 60 dB)."""

NOISE_BAND = 2**0.125
"""Width of a band of frequencies whose noise counts as one density, an eighth of an octave: the steepest
noise of a sensor falls by 4 in an octave (`NOISE_KNOWN`), by a sixth in it."""

UNDETERMINED = 1e-7
"""Curvature of the cost, over the largest, along a direction that data do not determine: to change the output
as much a step there has to be 3000 times as long."""

FREEDOM_MOST = 1e6
"""Degrees of freedom of a normal distribution: Student's quantiles are the same to 1e-5 from there on."""

# --- steps of fits that begin beside another ----------------------------------------------------------

GLANCE = 2
"""Steps of initial states alone, after which starts are compared."""

GLANCED_ON = 4
"""Steps by which the best of these starts go on: those that lead nowhere show it by then."""

STEPS_NEAR_STATES = 4
"""Steps of initial states alone, of a fit with values of another one: they settle what these values moved."""

STEPS_NEAR = 6
"""Steps of all that is fitted which follow: it is near its minimum by then, or it is dropped."""

NEXT_TO_NOTHING = 1e-3
"""Share of its size with which an effect is next to nothing: what it changes, a few hundred times the noise
at most, is then below it."""

ITERATIONS, COST_GAIN = 12, 1e-3
"""Steps of a fit and relative gain of the cost at which it ends, by default: a gain of 1e-3 is 5 nats of
10,000 samples, which rules out a rival."""

RECORDS_BUDGET = 10 * ITERATIONS
"""Simulations of all records at most, by default: ten a step, for some eight parameters that are differenced
one by one, and a try."""

DECIMATION = 4
"""Samples to a step of the input before the full rate, by default."""

EFFORT_MOVED_ON = (6, 5e-3)
"""Of a fit that is continued over other segments: a gain of 5e-3 is 6 nats of 2,500 samples, about what rules
out a rival."""

UNCOUNTED = 100000
"""Simulations allowed to fits that their steps bound."""

SEVERAL = 1.5
"""Length of a record, or of the segments of the last stage of a fit, over that of segments, from which it is
divided by them: less is rounded to one."""


FIRST_STROKES = 0.5
"""Length of the segments of the first stage of a fit, in to-and-fro motions: one is a stroke. Half and twice
change nothing for a joint."""

FIRST_PERIODS = 4
"""The same in periods of an elastic joint. Half changes nothing for a joint, twice makes 0.8 % more error."""

STAGES = 4
"""Stages before the last at most. Half and twice change nothing for a joint."""

STAGE_FACTOR = 4
"""How much longer each stage's segments are. Half and twice change nothing for a joint."""


BREAKAWAYS_BETWEEN, BREAKAWAY_ROUNDS = 7, 3
"""Breakaway forces (static levels) tried over an open range, and how often: twice again between the best
one's neighbours, which are then a fifty-fourth of the range apart. That is less than one sample lets see."""

BREAKAWAYS_OVER_ALL, BREAKAWAYS_AROUND = 25, 7
"""Breakaway forces tried over all that a record can show, and between the neighbours of the best of them. The
latter is repeated until they are as close as what is tried first for an open range (`OPEN_RANGE`). Over two
decades, the most that there are, 25 are a fifth apart."""

BREAKAWAY_LEAST = 0.01
"""The least breakaway force tried, over the largest force: two decades."""

STROKE_SAMPLES = 60
"""Samples of a to-and-fro motion that decimation leaves at least: a sine is then interpolated linearly to (2
pi / 60)^2 / 8, 0.14 %."""

POLISH = 12
"""Steps at the full rate of a fit over whole records, at most. They begin at the minimum over every fourth
sample; of a gap it took seven. Half and twice of six changed nothing but that."""
