"""Describing functions as data: tuned numbers, each with what it follows from (see `../thresholds.py`)."""

from __future__ import annotations

from ..thresholds import GIVE_UP, SIGNIFICANT

SIGNIFICANT_TABLE = 12.0
"""Evidence an effect needs on the points of a table: a hundred shapes, a false alarm of 6e-4."""

SIGNIFICANT_TABLE_HELD = 2.0
"""Evidence an effect needs on the points held out: odds of 7 to 1, as a third of the points can hardly give
more (tables)."""

GIVE_UP_ON_TABLE = -SIGNIFICANT
"""Evidence on a few points of a table below which a candidate is not confirmed: as much as makes an effect,
but against it."""

GIVE_UP_START = GIVE_UP
"""Error of a start on a table over that of the model itself from which it is none."""

GROSS = 0.02
"""Share of the points of a table expected to err by as much as N itself, as motions coexist: one in 50, fewer
than one of the tables of `tests/test_frequency.py`, so that a second such point has to show itself."""

RIGID = (2e-3, 3e-4)
"""Deflection of bristles, as a share of the swing, below which they are rigid: when quick, when careful."""

AS_DRY = 1e-6
"""Relative difference up to which presliding that slips has the dry friction of its block: rounding."""

CONFIRMED_ON_TABLE = 5
"""Candidates that are fitted to all points of a table."""

POINTS, POINTS_COSTLY = 20, 10
"""Points of a table for screening, and for effects whose orbits take many times as long."""

TABLE_SIZES = (0.01, 0.05, 0.2, 0.7)
"""Sizes of an effect of which nothing is known, over those of the table."""

BALANCE_SAMPLES, BALANCE_PERIODS, BALANCE_ROUNDS = 48, 3, 4
"""Of the sines along which forces are balanced: samples a period, of which the ninth harmonic has five;
periods, hidden states settling over the first ones; rounds of Gauss and Newton for parameters that are not
linear."""

BALANCED_STARTS = 2
"""Starts of an effect on a table from which its forces are balanced: sizes apart may balance alike."""

WORK_LOW = {"max_steps": 4_000, "averages": 8}
"""Bounds on the work of one point of a forced orbit at screening: a candidate far from the truth may
rattle or creep for ever."""

WORK_MEDIUM = {"max_steps": 25_000, "averages": 8}
"""Bounds on it in the fits of the best, and of what a table is compared with."""

WORK_HIGH = {"max_steps": 60_000, "averages": 16}
"""Bounds on it at the end."""

RESONANT = 30.0
"""Relative error of a point that counts as no larger: a resonance on the grid must not outweigh all others
while a fit is on its way."""

SCALE_LEAST = 0.1
"""Share of the median ``|N|`` at a frequency that errors are relative to at least."""

OUTLYING_POINT, OUTLYING_LEAST, OUTLYING_SHARE = 10, 1e-3, 16
"""Error over the median, and at least, from which a point is of another motion; one in so many may be, or
two."""

MIXTURE_ROUNDS = 30
"""Rounds of a mixture's variance."""

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

STEPS_BEGUN, STEPS_ENDED, STEPS_CONFIRMED, STEPS_COSTLY = 2, 8, 12, 3
"""Steps of a fit to points: of every start, of the best of them; to all points, and of an effect that takes
many times as long."""

FIT_STEPS, FIT_TOLERANCE, FIT_BUDGET = 10, 1e-3, 400
"""Steps of a fit to points, relative gain at which it ends, tables computed at most, if nothing is said."""

GROSS_BALANCE = 3.0
"""Usual errors beyond which a point counts less in a balance of forces."""

STARTS_KEPT, REGION_BANDS = 3, 4
"""Starts of an effect that are fitted; bands of amplitude and of frequency."""
