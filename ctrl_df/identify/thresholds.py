"""Every tuned number of identification, with what it follows from, or the benchmark that chose it.

``rigs``: `benchmarks/diagnosis.py`, single effects, ladders, rigs with nothing or something unknown hidden.
``records``: `benchmarks/studies.py`. ``tables``: `tests/test_frequency.py`. A number that names one of
these was chosen by hand on it; no scan of other values is on record, so that none is the best there is. The
ratio of two rms of n effective samples each has a logarithm of standard deviation 1/sqrt(n). Numbers of one
effect stand in its class, tolerances of one formula beside it.
"""

from __future__ import annotations

import math

import numpy as np

# --- evidence [nats] --------------------------------------------------------------------------------

SHAPES = 300
"""Shapes that a diagnosis of records tries: some 25 effects, about a dozen starts each."""

FALSE_ALARM = 1e-6
"""Chance at which one of them may look like an effect where nothing is missing."""

SIGNIFICANT = float(math.ceil(math.log(SHAPES / FALSE_ALARM)))
"""Evidence an effect needs on records: one of `SHAPES` exceeds it by chance once in `FALSE_ALARM`: 20."""

SIGNIFICANT_HELD = 5.0
"""Evidence it needs on held-out records alone: odds of 150 to 1, for data that choose nothing.

To these are fitted initial states, and what the others leave open: a threshold within a range, the phase of
a ripple.
"""

SIGNIFICANT_TABLE = 12.0
"""Evidence an effect needs on the points of a table: a hundred shapes, a false alarm of 6e-4."""

SIGNIFICANT_TABLE_HELD = 2.0
"""Evidence it needs on the points held out: odds of 7 to 1, as a third of the points can hardly give more
(tables)."""

REFUTED = SIGNIFICANT
"""Evidence of held-out data against a candidate that puts it last."""

RULED_OUT = 5.0
"""Evidence behind the first beyond which a candidate is no rival: odds of 150 to 1."""

TOLD_APART = 6.0
"""Log likelihood ratio that tells two candidates apart: odds of 400 to 1."""

STOPPED_EARLY = 3 * SIGNIFICANT
"""Evidence by which candidates may differ because their fits stopped early: thrice what makes an effect,
which fits gained on the rigs when brought to their end. More costs time, less the right one now and then."""

ANGLE_WORTH = 50.0
"""Log likelihood ratio, for white noise, that a record's own angle must bring: coloured residuals make tens
of it by chance (rigs with ripples)."""

PROMISING = 0.2
"""Share of the best one's evidence, at the first look, from which a candidate is confirmed: there records are
thinned fourfold and fits unfinished, so that the right one may show a fifth of its evidence (rigs)."""

HOPELESS_ON_TABLE = -SIGNIFICANT
"""Evidence on a few points of a table below which a candidate is not confirmed: as much as makes an effect,
but against it."""

BY_CHANCE = 3.0
"""Standard deviations up to which a difference may be chance: one in 370 is larger."""

# --- ratios of errors -------------------------------------------------------------------------------

PROCESS_NOISE = 50.0
"""Error over the sensor's noise, in the shortest segments, that disturbance forces alone make, and no effect
that is missing (between the rigs and the recorded machines)."""

HOPELESS = 3.0
"""Error over the best candidate's beyond which another try is not worth it: nine times its power, which no
last step of a fit removes (rigs). Only work depends on it."""

PROMISES = 0.25
"""Share of the squared error the best candidate explains that an effect has to explain for one that contains
it to be tried: the special case of a right law is right over a part of the motion."""

STILL_POSSIBLE = 1.5
"""Error over the best candidate's up to which another may yet turn out to be the right one: a bit more than
twice its power, left by a fit that ended beside its minimum (rigs)."""

BETTER = 0.99
"""Error over the one before that counts as a better minimum."""

SAME = 1.001
"""Error over the least that counts as the same: well below the spread of an rms, 1/sqrt(2 n), which is 0.007
for 10,000 samples."""

FLOOR = round(1 + 1 / math.sqrt(2 * 500), 2)
"""Error over the least that the shortest segments leave up to which a fit has nothing to gain: the spread of
an rms over 500 effective samples, 1.03."""

GROWTH = round(math.exp(BY_CHANCE / math.sqrt(100)), 2)
"""Best error over segments four times as long that still counts as the same: chance for 100 effective
samples, 1.35."""

EXPLAINS_LITTLE, SHOWS_HARDLY = 0.8, 0.97
"""Error of the best candidate over the baseline's from which it explains little, and next to nothing."""

STRUCTURE_LEAST = 0.1
"""Power of the baseline's error beyond noise, over that of the noise, below which there is hardly any: of 200
effective samples noise has that spread."""

LEFT = 0.2
"""Share of the structure (rms) that the best candidate may leave: 4 % of its power. Rigs with something
unknown hidden leave more to whatever stands in for it, those of the library less."""

SIZE_KNOWN = 0.5
"""Standard error over the size of an effect, beyond which it may be none: two of them reach zero."""

UNMOVED = 0.5
"""Error over the shortest segments, of the output's rms, beyond which a model explains no motion: one that
stands still at a fitted place and speed errs by as much over half a turn of a sine."""

NOISIER = round(math.exp(BY_CHANCE / math.sqrt(80)), 1)
"""Error on held-out segments over that on fitted ones that may be chance for 80 effective samples, 1.4."""

GROWN = 2.0
"""Error over the least that the shortest segments leave, up to which it may be noise: slow noise of thrice
the power of the fast one, the only one that short segments do not absorb (rigs with coloured noise)."""

OUTLYING_SEGMENT, OUTLYING_NOISE = 1.5, 2.0
"""Error of a segment over the good quarter's, and over the noise, from which its start is sought anew."""

GOOD = 0.25
"""Share of the segments that are taken to be right when others are compared with them."""

ANOTHER_START = (1.5, 0.02)
"""Share of the residual that a start leaves from which none is begun: over that of the best, and beyond it
(rigs). Only work depends on it."""

HOPELESS_START = HOPELESS
"""Error of a start on a table over that of the model itself from which it is none."""

GROSS = 0.02
"""Share of the points of a table expected to err by as much as N itself, as motions coexist: one in 50, fewer
than one of the tables of `tests/test_frequency.py`, so that a second such point has to show itself."""

COARSE = 0.4
"""rms residual over the step up to which rounding can be what makes it: alone it makes 1/sqrt(12) = 0.29."""

FINEST = 0.02
"""Spread about the lines of a grid, over its step, that still counts: finer is a grid of its own."""

STRAY = 1e-3
"""Share of rounded samples that may lie on any line."""

# --- what a record shows ----------------------------------------------------------------------------

NOISE_FREE = 1e-7
"""Noise over the spread of the output that no sensor is below: such a record was simulated."""

UNPLACED = 0.2
"""Error of a place that is an integral of the velocity, over the spread of places: where a record began is
told by laws that know the place alone, and fits let a place be five of its errors off."""

EXACT = 10 * NOISE_FREE
"""Error over the spread of the output that is no error."""

PARAMETER_RANGE = 12.0
"""Factor by which the model's own parameters may be off: beyond, a fit bends them to what they are not."""

SIZE_PRIOR = 3.0
"""Factor by which the model's own parameters may be off before any data, one standard deviation: beyond two
and a half lies `PARAMETER_RANGE`."""

PASSED, BUMP_LEFT = 2.15e-3, 0.01
"""Speed, over the typical one, at which a bump of friction is gone that only breaking away shows, and the
share of it that is left then: a Gaussian one of a thousandth of the typical speed, sqrt(log 100) of its width
away."""

RIGID = (2e-3, 3e-4)
"""Deflection of bristles, as a share of the swing, below which they are rigid: when quick, when careful."""

# --- lengths of segments, samples -------------------------------------------------------------------

SEGMENT_SAMPLES = 20
"""Samples of the shortest segment that a comparison takes: fewer are used up by its initial states."""

SEGMENT_LEAST = 50
"""Samples of the shortest segment of a diagnosis: states and derivatives of hidden bodies need more."""

SHORTEST = 16
"""How many times as many the shortest segments of a diagnosis are as the longest: of two to-and-fro motions
and a half, a sixth of one remains, over which every effect is all but linear."""

LEVELS = (SHORTEST, 4, 1)
"""How many times as many they are, of the three lengths that are looked at."""

BRIEF = 4 * SHORTEST
"""The same of segments for the parameters of a machine with disturbance forces."""

FILTERED = 40
"""Values of the force that the shortest segments show where disturbance forces outweigh the noise."""

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

HORIZONS = 8
"""Lengths of free prediction at most, each half of the one above: of a record of 64 motions a half is the
shortest."""

SHORTEST_HORIZON = 0.25
"""The shortest, in to-and-fro motions: over less the fitted position and speed follow nearly anything."""

HOLDOUT_PARTS = 9
"""Parts of a record of which every third is held out where no record is."""

SCREEN_SAMPLES = 2500
"""Steps of the input to which a record is thinned while candidates are screened: a quarter of those
of the rigs' records."""

RTOL, RTOL_COARSE, RTOL_OVER_NOISE = 1e-8, 1e-5, 1e-3
"""Relative tolerance of simulations: at the full rate; at most, while candidates are screened, where it is
that share of the sensors' noise over the motion. Derivatives are differences over which the output moves by
0.3 times the noise: errors of a thousandth of it change them by less than a hundredth."""

FULL_SAMPLES = 12_000
"""Steps of the input of a longer record at the full rate."""

SPECTRUM_SAMPLES = 25_000
"""Samples of a record beyond which ripples are sought in means over several."""

# --- work -------------------------------------------------------------------------------------------

CONFIRMED = 6
"""Most candidates that are refitted at the full rate: two, and all that the first look left near the best."""

OUTLASTING = 2
"""Rivals that the best one is compared with over long stretches, beside the baseline: each costs as much as a
comparison at eight lengths."""

CONFIRMED_FORCED = 10
"""The same where disturbance forces let the first look tell little."""

CONFIRMED_ON_TABLE = 5
"""Candidates that are fitted to all points of a table."""

POINTS, POINTS_COSTLY = 20, 10
"""Points of a table for the first look, and for effects whose orbits take many times as long."""

RIVALS = 2
"""Candidates that are fitted in the place of an effect of a ladder: beside a later one, and at its end."""

BRANCHES = 3
"""Rivals of steps from which a ladder begins again where it ended with something unexplained: of two effects
hidden one that stands in for both ranks first, and the right ones follow (rigs)."""

EFFORT_TRIED, EFFORT_BENT, EFFORT_MOVED = (6, 1e-2), (14, 3e-3), (4, 1e-2)
"""Steps of the fit of an effect at most, and the relative gain of its cost that is none: one whose minimum
may be long and bent takes more; from segments to others less (rigs)."""

EFFORT_CONFIRMED, EFFORT_ENDED = (3, 1e-3), (8, 1e-6)
"""The same at the full rate, and of near equals: a gain of a millionth is 0.005 nats of 10,000 samples."""

BEGUN, KEPT, JOINTS, JOINTS_TRIED = 2, 2, 3, 4
"""Steps of every fit before the first look, fits of an effect that go on after it; joints of a share of load
that begin, and from how many these are chosen."""

ANGLES = 6
"""Angles of a full turn from which that of a record is sought: a sine's minimum reaches half a turn."""

STRONG = 0.5
"""Share of the mean squared force that is missing up to which a single law leaves: it takes more of it than
all that is left, and the model's own parameters are bent by it."""

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

LOAD_SHARES = (0.15, 0.35, 0.6, 0.85)
RESONANCES = np.geomspace(1.5, 40.0, 12)
JOINT_DAMPING = 0.1
"""Joints tried: share of the mass behind them, resonance over the rate of the motion (its speed over its
stroke), damping ratio. Resonances that are neighbours lie a third apart."""

LONG_WAVES, LONG_WAVE_TURNS = 5, (6.0, 30.0)
"""Ripples that fits begin with by what they change in the output; wavelengths to the stroke up to which they
are sought there, of one body and of two (200 runs of the segments then, a second at most)."""

RIPPLE_TURNS, RIPPLE_STEP, RIPPLE_COARSEST = 400.0, 0.3, 6.0
"""Ripples tried: wavelengths to the stroke at most; between two of them (one turn apart they are orthogonal);
shortest wavelength over the error of the smoothed position."""

TEST_FORCE = 3e-3
"""Amplitude of a test force over the rms of the force: linear still, and far above rounding."""

FINER = 3
"""How many times finer the second grid of test forces is."""

REVERSAL_REACHES = (0.03, 0.1, 0.3, 1.0)
"""Travel after a reversal [typical positions] over which a force may build up."""

HIDDEN_RTOL = 1e-4
"""Tolerance of hidden states under an imposed motion: of steps no longer than a sample it leaves errors of
some 1e-6 of the force, and is twice as fast as 1e-6 (records)."""

TABLE_SIZES = (0.01, 0.05, 0.2, 0.7)
"""Sizes of an effect of which nothing is known, over those of the table."""

BEGINNINGS = (16, 8, 4, 2)
"""Shares of a segment over which the state that it begins in is found first, each twice the last."""

BALANCE_SAMPLES, BALANCE_PERIODS, BALANCE_ROUNDS = 48, 3, 4
"""Of the sines along which forces are balanced: samples a period, of which the ninth harmonic has five;
periods, hidden states settling over the first ones; rounds of Gauss and Newton for parameters that are not
linear."""

BALANCED_STARTS = 2
"""Starts of an effect on a table from which its forces are balanced: sizes apart may balance alike."""

WORK_LOW = {"max_steps": 4_000, "averages": 8}
WORK_MEDIUM = {"max_steps": 25_000, "averages": 8}
WORK_HIGH = {"max_steps": 60_000, "averages": 16}
"""Bounds on the work of one point of a forced orbit: a candidate far from the truth may rattle or creep for
ever."""

# --- plans ------------------------------------------------------------------------------------------

PLAN_SIZES = (1.0, 0.8, 0.6, 0.45, 0.35, 0.25, 0.15, 0.08, 0.04)
"""Of inputs, over the largest that the limits allow."""

PLAN_MARGIN = 0.9
"""Share of the stroke that candidates may use: the drive itself is like them, not one of them."""

SETTLE, COUNTED, SINES = 12, 8, 6
"""Periods before and while a point is measured, and points of a plan."""

# --- the missing force as a signal ------------------------------------------------------------------

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
"""Of the force's size: a standard deviation beyond it tells of no more than what was assumed."""

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

SLOWLY = 0.05
"""Speed, over its rms, below which a record hardly moves."""

# --- rounding ---------------------------------------------------------------------------------------

NOTHING, NEARLY_NOTHING = 1e-300, 1e-12
"""What quotients are divided by where their divisor may be zero: of any size, of the size of one."""

FAINT = 1e-30
"""Power, over all of it, that is none."""

DEPENDENT = 1e-9
"""Singular value, over the largest, of columns that depend on each other: noise of a millionth shows more."""

# --- describing functions ---------------------------------------------------------------------------

RESONANT = 30.0
"""Relative error of a point that counts as no larger: a resonance on the grid must not outweigh all others
while a fit is on its way."""

SCALE_LEAST = 0.1
"""Share of the median ``|N|`` at a frequency that errors are relative to at least."""

OUTLYING_POINT, OUTLYING_LEAST, OUTLYING_SHARE = 10, 1e-3, 16
"""Error over the median, and at least, from which a point is of another motion; one in so many may be, or
two."""

MIXTURE_ROUNDS, EXPONENT = 30, 700.0
"""Rounds of a mixture's variance; largest exponent whose exponential is a number."""

VARIANCE_LEAST, SCATTER_LEAST = 1e-12, 1e-6
"""Variance and size of relative errors at least: exact orbits are no better."""

TABLE_NUDGE, TABLE_JUMP = 1e-3, 300.0
"""Step of a scaled parameter; slope that is a jump: where an orbit changes its kind."""

TABLE_UNIT = 0.1
"""Of the scales of a table, the unit in which its parameters are moved."""

TABLE_STEPS = {"try": 1e-2, "refit": 1e-4, "last": 1e-6}
"""Relative gain at which a fit to a table stops: while effects are tried, of the model itself, at the end."""

TABLE_ITERATIONS = {"rebase": 10, "refit": 25, "last": 40}
"""Steps of such fits at most."""

TABLE_BUDGET = 120
"""Tables computed for one of the best candidates."""

TOP_FREQUENCIES = 0.8
"""Quantile of the frequencies from which the mass shows alone."""

UNEXPLAINED = 0.2
"""Share of the structure that was there, from which what the best candidate leaves is unexplained."""

BALANCE_RTOL, BALANCE_NUDGE, BALANCE_RANK = 1e-4, 1e-3, 1e-6
"""Of forces that are balanced: tolerance of hidden states, step of a parameter, singular value left out."""

BALANCE_GAIN, BALANCE_LOWEST = 1e-3, 1e-2
"""Relative gain of a round that is none; share of a positive parameter that a round leaves of it at least."""

START_COMMON, START_SAME = 0.1, 1e-5
"""Share of the mean error added to every point's, so that one of another motion hides no good start; relative
difference of tables that an effect does not change."""

DRY_SHARES, DELAYS, UNKNOWN_SIZES = (0.1, 0.3, 0.6), (0.02, 0.1, 0.4, 1.2), (0.1, 1.0)
"""Levels of friction, over the friction there is or the least force applied; times over the shortest period;
multiples of the usual size of a parameter that has no default."""

FLAT_SINGULAR, FLAT_COLUMN, FLAT_INVERSE = 1e-5, 1e-6, 1e-8
"""Singular value, over the largest, of a direction that a table does not determine; slope, over the largest,
of a parameter that it does not; singular value that an inverse takes at least."""

TAKES_PART = 0.1
"""Component of such a direction from which a parameter takes part in it."""

# --- tests and regions ------------------------------------------------------------------------------

LEVEL = 0.01
"""Level of tests: one in a hundred by chance."""

SMALLEST_SAID = 1e-6
"""Probability below which that is all that is said."""

TWO_SIDED = 1.96
"""Standard deviations of a 95 % band."""

WHITENESS_LAGS = 25
"""Lags of a test of whiteness at most."""

INPUT_LAGS = 3000
"""Lags of a test for traces of the input at most; a tenth of the samples."""

DECORRELATED = 0.37
"""Correlation at which a first-order signal has forgotten: 1/e."""

BANDWIDTH, AT_ROOT = 1.1447, 1e-6
"""Andrews' (1991) factor of the bandwidth of Bartlett's kernel; distance of a correlation from one, at
least."""

FASTEST, LOW_SPEED, MEDIUM_SPEED = 0.95, 0.1, 0.6
"""Quantile of the speeds that is fast, and shares of it below which a motion is slow, and of medium speed."""

AFTER_REVERSAL = 0.15
"""Share of the time between two reversals that is just after one."""

REGION_SAMPLES, RECORD_SAMPLES, SPECTRUM_LEAST = 60, 50, 100
"""Independent samples of a region at least; samples of a record for regions, and for a spectrum."""

FREE_ORDER = 12
"""Order of the noise model of a residual, while free forces are fitted to it."""

FREE_STEPS = {"position": (0.005, 12), "low_speed": (0.01, 12), "load": (0.01, 8)}
"""Range of a quantity left out at either end, as a quantile, and steps of a free force over it."""

HUM_WINDOW = 161
"""Frequencies whose median is the power beside a hum."""

HORIZON_TOLERANCE = 1e-2
"""Relative gain at which initial states of a stretch are found."""

SMOOTHED_ENDS = 0.6
"""Periods of the cutoff at either end that a smoothed signal is not used of."""

FORCE_ALIKE = 0.98
"""Share of the best one's evidence that another kind of force must bring to be named beside it, but for what
makes an effect: of large evidence two hundredths are a matter of the noise model."""

SHOWN_PROBABILITY = 0.01
"""Of a candidate that is worth a word."""

LEAST_WIDTH = 30
"""Letters of the first column of a ladder."""

# --- shapes of plans --------------------------------------------------------------------------------

PLAN_SLACK = 1.0001
"""Over a limit, that is rounding."""

PLAN_MOVES = 0.2
"""Least swing of the candidates' outputs, over the largest: below, one of them does not move."""

PLAN_BAND, PLAN_SINES = (0.3, 8.0, 10.0), 20
"""Frequencies over that of the motion: lowest, highest of a multisine, of a chirp; sines of the former."""

PLAN_STEPS, PLAN_STEP_RATE, PLAN_STEP_SIZES = 400, 0.5, (0.4, 0.6)
"""Random steps, their rate over that of the motion, and their sizes: at least, and how much more at most."""

PLAN_TRIANGLE = 0.4
"""Rate of a triangle, over that of the motion."""

SIGMA_LEAST = 1e-6
"""Relative noise of a table that plans count with at least."""

# --- reading and checking ---------------------------------------------------------------------------

MINIMUM = 10
"""Samples of a record at least: fewer have no derivatives."""

BESIDE, LEAP, FAST = 5, 20.0, 5.0
"""Steps to either side that a leap stands out from, how far, and how far from all others of the record."""

USUAL_STEPS = (0.05, 0.95)
"""Quantiles between which steps of time lie that are usual."""

REGULAR = 0.01
"""Difference of steps of time, over their median, that is jitter."""

ON_SAMPLE = 1e-9
"""Of a step: difference of instants that rounding makes."""

MOST_COLUMNS = 99
"""Of a matrix: more is a row of samples."""

BLOCK, SAMPLE_ROWS = 100_000, 2000
"""Rows converted at once, so that memory stays near the size of the file; rows that the decimal mark is read
off."""

BINARY, BINARY_LOOK = 0.002, 100_000
"""Share of control characters from which a file is no text; characters that are looked at."""

NANOSECONDS = 1e9
"""In a second: times of day are kept as whole ones."""

# --- signals ----------------------------------------------------------------------------------------

FEW_VALUES, ON_STEP, ON_STEPS = 0.9, 0.05, 0.9
"""Share of different values, over the samples, up to which a signal may be rounded; distance from a multiple
of the step, over it, and share of the samples within it."""

SPECTRUM_LENGTH = 16
"""Samples of a segment of a spectrum at least."""

WHITE_BAND = 0.95
"""Share of the Nyquist frequency up to which noise is white: beyond, filters of instruments act."""

QUARTILE = 0.6745
"""Of a normal distribution: half the values lie within so many standard deviations."""

FLOOR_LEAST = 1e-14
"""Noise floor, over the largest power, that rounding makes."""

CUTOFF_LOWEST, CUTOFF_HIGHEST = 0.1, 0.4
"""Cutoff of a signal that is all noise, over the Nyquist frequency; the highest, over the sampling rate."""

PADDING = 30
"""Samples by which a signal is continued at its ends, at least, before it is filtered."""

THINNED_BAND, THINNED_RIPPLE = 0.7, 5e-4
"""Band that thinning keeps, over the new Nyquist frequency, and its ripple [dB]: flat within 1e-4, 49 dB down
at that frequency."""

# --- reports ----------------------------------------------------------------------------------------

REPORT_BUDGET, REPORT_DPI = 200, 130
"""Simulations of the refit that tells standard errors; dots per inch of its pictures."""
