"""Tests, regions, missing forces, horizons: tuned numbers, each with what it follows from."""

from __future__ import annotations

import math
from statistics import NormalDist

from ..thresholds import RTOL_COARSE

HORIZONS = 8
"""Lengths of free prediction at most, each half of the one above: of a record of 64 motions a half is the
shortest."""

SHORTEST_HORIZON = 0.25
"""The shortest, in to-and-fro motions: over less the fitted position and speed follow nearly anything."""

TEST_FORCE = round(math.sqrt(RTOL_COARSE), 3)
"""Amplitude of a test force over the rms of the force, 0.003: curvature, in proportion to it, and the error
of simulations over it, in inverse proportion, are then as large as each other."""

FORCES_TOGETHER = 16
"""Test forces simulated in one call: it bounds memory and changes no result."""

FORCES_FINER = 3
"""How many times finer the second grid of test forces is, half a decade: what is narrower than a bump of the
first by more than its root, 1.7, is nearer to one of the second."""

REVERSAL_REACHES = (0.03, 0.1, 0.3, 1.0)
"""Travel after a reversal [typical positions] over which a force may build up: exponentials half a decade
apart, of which one correlates by 0.96 or more with any between."""

RELAXATIONS = (0.02, 0.06, 0.2, 0.6, 2.0)
"""Time constants [to-and-fro motions] over which a force may relax, half a decade apart as above: a faster
one is viscous at the frequency of the motion within an eighth of its force, a slower one a spring within a
twelfth."""

INPUT_NOISE_MOST = 0.02
"""Noise of a recorded input over its spread at most: sensors of force, torque and current err by a hundredth
or two of their range. What is not foreseen beyond that is excitation."""

INPUT_ORDER = 8
"""Values of an input that foresee the next one: four sines at once."""

FEEDBACK_LAGS = 5
"""Values of each output that a controller makes its input of: bounds work."""

INPUT_SAMPLES = 20_000
"""Samples that are looked at: bounds work."""

TRIMMED = 4
"""Fits of these, each without what the one before misses by chance once in 370: jumps, limits of a drive."""

NOISES_TRIED = 4
"""Draws of noise that its effect is averaged over: the error of an rms is then a third or less."""

NO_POWER = 1e-30
"""Power, over all of it, that is none: the square of rounding, of some five eps."""

EDGE_ZERO = 1e-3
"""Edges of regions nearer to zero than this share of the largest are called zero: labels have three
digits."""

TWO_SIDED = round(NormalDist().inv_cdf(0.975), 2)
"""Standard deviations of a 95 % band."""

WHITENESS_LAGS = 25
"""Lags of a test of whiteness at most: as many as MATLAB's ``resid`` takes."""

INPUT_LAGS = 3000
"""Lags of a test for traces of the input at most: bounds work, for inputs that remember longer."""

DECORRELATED = round(math.exp(-1), 2)
"""Correlation at which a first-order signal has forgotten: 1/e."""

FASTEST = 0.95
"""Quantile of the speeds that is fast: one in twenty may be noise."""

LOW_SPEED, MEDIUM_SPEED = 0.1, 0.6
"""Shares of it below which a motion is slow, and of medium speed: a sine is slow for 6 % of the time, at
medium speed for 35 %, fast for 59 %."""

AFTER_REVERSAL = 0.15
"""Share of the time between two reversals that is just after one: a sine then has reached half its speed, and
travelled a twentieth of the way."""

REGION_SAMPLES = 60
"""Independent samples of a region from which its mean is tested with the spread that it leaves: Student's
quantile at 1 % is then 3 % beyond that of a known spread."""

REGION_ROWS = 12
"""Regions that a table shows by default, the worst: what is seen at a glance. No result depends on it."""

REGIONS = 8
"""Parts of a record in time and in position by default: of the shortest one each has six samples
(`RECORD_SAMPLES`)."""

FORCE_STEPS = {"time": (0.0, REGIONS), "position": (0.005, 12), "low_speed": (0.01, 12), "load": (0.01, 8)}
"""Range of a quantity left out at either end, as a quantile, and steps of a missing force over it; nothing of
the time, which has no stray values. Half and twice of those of the others name the same quantities on a rig
with friction that grows over a zone."""

HUM_FINER = 4
"""Parts of a line of a spectrum into which it is divided: halfway between two of them a hum loses 3 % of its
amplitude."""

HUM_LEAST = 3
"""Periods of a hum in a record at least: what whitening leaves of a trend has one or two."""

HUM_WINDOW = 10 * 4 * HUM_FINER + 1
"""Frequencies, 161, whose median is the power beside a hum: ten times those that the hum itself fills, which
are four lines with the lobes beside it."""

HORIZON_TOLERANCE = 1e-2
"""Relative gain of the cost at which initial states of a segment have converged: the error itself is then
known to half a per cent."""

HORIZON_FIRST, HORIZON_ON, HORIZON_LAST = 8, 3, 2
"""Steps of initial states for a horizon: of the first, of those where a shorter one is known, and at the full
rate. Half and twice of them move the error of the true structure by 6 % at most (a ripple, a joint, Stribeck
friction: `benchmarks/half_and_twice.py horizons`)."""

HORIZON_ONE = 12
"""Simulations of one segment, beside those for derivatives, by which it is moved to where it begins."""

REGION_LEAST = 8
"""Samples of a region at least: the eighth part of the shortest record taken (`RECORD_SAMPLES`) has six."""

BANDS_LEAST = 6
"""Bands of a spectrum at least: one, two neighbours to either side, and another one."""

BAND_LOWEST = 2.5
"""Its lowest frequency, in cycles of the record: beyond the two over which Hann's window spreads a mean."""

LAGS_TESTED = 20
"""Lags of a test for traces of the input, about as many as of one of whiteness."""

LAGS_SHARE = (5, 10, 4)
"""Parts of a record that lags are at most. In a test of whiteness a fifth (Hyndman & Athanasopoulos,
Forecasting, sec. 5.4); where the memory of the input is measured a tenth, so that nine tenths of the samples
have a partner; in the test of the input a quarter."""

LAGS_FORGOTTEN = 5
"""Correlation times over which these lags are spread: exp(-5), 0.7 %, is left of a first-order signal."""

LAGS_APART = 1e-5
"""Singular value, over the largest, below which lags of an input tell nothing of their own: inputs are known
to some five digits (of 16 bits, 1.5e-5)."""

ROUNDING_COARSE = 0.4
"""rms residual over the step up to which rounding can be what makes it: alone it makes 1/sqrt(12) = 0.29."""

LINE_SPREAD = 0.02
"""Spread about the lines of a grid, over its step, that still counts: finer is a grid of its own."""

STRAY = 1e-3
"""Share of rounded samples that may lie on any line: one that no model explains then costs log 1000 = 7 nats,
and does not refute the grid alone."""

ROUNDING_SPREAD = (-5.0, 0.0)
"""Logarithms between which the error of a model lies that rounding hides, over the step: below e^-5, 0.007
steps, no line is uncertain; beyond a whole step rounding hides nothing (`ROUNDING_COARSE`)."""
