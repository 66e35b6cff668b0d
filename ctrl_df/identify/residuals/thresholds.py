"""Tests, regions, missing forces, horizons: tuned numbers, each with what it follows from."""

from __future__ import annotations

import math
from statistics import NormalDist

HORIZONS = 8
"""Lengths of free prediction at most, each half of the one above: of a record of 64 motions a half is the
shortest."""

SHORTEST_HORIZON = 0.25
"""The shortest, in to-and-fro motions: over less the fitted position and speed follow nearly anything."""

TEST_FORCE = 3e-3
"""Amplitude of a test force over the rms of the force: linear still, and far above rounding."""

FORCES_TOGETHER = 16
"""Test forces simulated in one call: it bounds memory and changes no result."""

FINER = 3
"""How many times finer the second grid of test forces is."""

REVERSAL_REACHES = (0.03, 0.1, 0.3, 1.0)
"""Travel after a reversal [typical positions] over which a force may build up."""

FAINT = 1e-30
"""Power, over all of it, that is none."""

EDGE_ZERO = 1e-3
"""Edges of regions nearer to zero than this share of the largest are called zero."""

TWO_SIDED = round(NormalDist().inv_cdf(0.975), 2)
"""Standard deviations of a 95 % band."""

WHITENESS_LAGS = 25
"""Lags of a test of whiteness at most."""

INPUT_LAGS = 3000
"""Lags of a test for traces of the input at most; a tenth of the samples."""

DECORRELATED = round(math.exp(-1), 2)
"""Correlation at which a first-order signal has forgotten: 1/e."""

FASTEST, LOW_SPEED, MEDIUM_SPEED = 0.95, 0.1, 0.6
"""Quantile of the speeds that is fast, and shares of it below which a motion is slow, and of medium speed."""

AFTER_REVERSAL = 0.15
"""Share of the time between two reversals that is just after one."""

REGION_SAMPLES = 60
"""Independent samples of a region at least."""

FREE_STEPS = {"position": (0.005, 12), "low_speed": (0.01, 12), "load": (0.01, 8)}
"""Range of a quantity left out at either end, as a quantile, and steps of a free force over it."""

HUM_WINDOW = 161
"""Frequencies whose median is the power beside a hum."""

HORIZON_TOLERANCE = 1e-2
"""Relative gain at which initial states of a segment have converged."""

HORIZON_LEAST = 50
"""Samples of the shortest horizon at least."""

HORIZON_DECIMATION, HORIZON_FIRST, HORIZON_ON, HORIZON_LAST = 4, 8, 3, 2
"""Initial states for a horizon: decimation of the first fit, its steps, those where a shorter one is known,
and those at the full rate."""

CORRELATED = 3.0
"""Standard errors of a correlation beyond which it is one."""

REGION_LEAST, BANDS_LEAST, BAND_LOWEST = 8, 6, 2.5
"""Samples of a region, and bands of a spectrum, at least; its lowest frequency, in cycles of the record."""

LAGS_TESTED, LAGS_SHARE, LAGS_FORGOTTEN = 20, (5, 10, 4), 5
"""Lags of a test for traces of the input; parts of a record that its lags are at most (whiteness, input,
spread); times after which the input has forgotten, in those of a first-order signal."""

HUM_FINER, HUM_LEAST = 4, 3
"""Parts of a line of a spectrum into which it is divided; periods of a hum in a record at least."""

COARSE = 0.4
"""rms residual over the step up to which rounding can be what makes it: alone it makes 1/sqrt(12) = 0.29."""

FINEST = 0.02
"""Spread about the lines of a grid, over its step, that still counts: finer is a grid of its own."""

STRAY = 1e-3
"""Share of rounded samples that may lie on any line: one that no model explains then costs log 1000 = 7 nats,
and does not refute the grid alone."""

ROUNDING_SPREAD = (-5.0, 0.0)
"""Logarithms between which the error of a model lies that rounding hides, over the step: below e^-5, 0.007
steps, no line is uncertain; beyond a whole step rounding hides nothing (`COARSE`)."""
