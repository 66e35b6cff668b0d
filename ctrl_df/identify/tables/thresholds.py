"""Describing functions as data: tuned numbers, each with what it follows from or chose it.

See `../thresholds.py`. What half and twice of a number change is measured by `benchmarks/half_and_twice.py
tables`: drag, a delay, breakaway and a gap hidden in tables of 20 to 36 points; the gap, which takes most of
the time, with the sizes of screening and the steps alone. Where nothing changes, verdict, ranking and
evidence are the same.
"""

from __future__ import annotations

from ..thresholds import GIVE_UP, SIGNIFICANT

# --- evidence [nats] --------------------------------------------------------------------------------

SIGNIFICANT_TABLE = 12.0
"""Evidence an effect needs on the points of a table: a hundred shapes, a false alarm of 6e-4."""

SIGNIFICANT_TABLE_VALIDATION = 2.0
"""Evidence an effect needs on the points held out: odds of 7 to 1, as a third of the points can hardly give
more (tables)."""

GIVE_UP_ON_TABLE = -SIGNIFICANT
"""Evidence on a few points of a table below which a candidate is not confirmed: as much as makes an effect,
but against it."""

GIVE_UP_START = GIVE_UP
"""Error of a start on a table over that of the model itself from which it is none."""

# --- errors of points -------------------------------------------------------------------------------

PAIRS_LEAST = 3
"""Pairs of neighbours at least that tell whether errors of points are independent: of two, nothing is beyond
chance at one in a hundred."""

GROSS = 0.02
"""Share of the points of a table expected to err by as much as N itself, as motions coexist: one in 50, fewer
than one of the tables of `tests/test_frequency.py`, so that a second such point has to show itself."""

RESONANT = 30.0
"""Relative error of a point that counts as no larger: a resonance on the grid must not outweigh all others
while a fit is on its way. Half and twice change nothing."""

SCALE_LEAST = 0.1
"""Share of the median ``|N|`` at a frequency that errors are relative to at least: scatter of 0.3 % of the
median is then at most 3 % of a point. Half and twice move 287 nats by 6 and 10 (breakaway)."""

OUTLYING_POINT = 10
"""Error over the median from which a point is of another motion: of complex normal scatter one in 2^100 errs
so much."""

OUTLYING_LEAST = 1e-3
"""Error from which a point is of another motion, at least: a third of the scatter of a good table, for tables
without any."""

OUTLYING_SHARE = 16
"""One point in so many may be of another motion, or two: three times as many as are expected (`GROSS`)."""

MIXTURE_ROUNDS = 30
"""Rounds of a mixture's variance. Half and twice change nothing."""

SCATTER_LEAST = 1e-6
"""Relative scatter of a table at least: numbers are written with six digits."""

VARIANCE_LEAST = SCATTER_LEAST**2
"""Its square."""

STRUCTURE_SHOWS = 2.0
"""Structure of the errors over their scatter (rms) from which something is unexplained: four fifths of their
power, which neighbours have in common. Half and twice change nothing on four tables with an effect."""

RIGID = (2e-3, 3e-4)
"""Deflection of bristles, over the amplitude, below which they count as rigid, which spares thousands of
steps a period. When quick it is two thirds of the scatter of a good table, 0.3 %; when careful a tenth of
it."""

AS_DRY = 1e-6
"""Relative difference up to which presliding that slips has the dry friction of its block: rounding."""

# --- work -------------------------------------------------------------------------------------------

CONFIRMED_ON_TABLE = 5
"""Candidates that are fitted to all points of a table: as the likeliest of screening may be a few nats
behind. Half and twice were tried with three candidates alone, and change nothing."""

POINTS = 20
"""Points of a table for screening: some eight parameters of a candidate leave twelve, 24 real errors. Half
and twice name the same effects."""

POINTS_COSTLY = 10
"""Points for effects whose orbits take many times as long. Of a gap half brings 199 nats in place of 126 in
half the time, as the fit ends in another of its minima; half and twice name the same effects."""

WORK_LOW = {"max_steps": 4_000, "averages": 8}
"""Bounds on the work of one point of a forced orbit at screening: a candidate far from the truth may
rattle or creep for ever."""

WORK_MEDIUM = {"max_steps": 25_000, "averages": 8}
"""Bounds on it in the fits of the best, and of what a table is compared with."""

WORK_HIGH = {"max_steps": 60_000, "averages": 16}
"""Bounds on it at the end."""

# --- fits -------------------------------------------------------------------------------------------

TABLE_NUDGE = 1e-3
"""Relative step of a parameter over which differences are taken: N, right to some 1e-9, leaves them six
digits, curvature three."""

TABLE_JUMP = 0.3 / TABLE_NUDGE
"""Slope that is a jump, 300: by a thousandth of a parameter N changes by 30 % only where an orbit changes its
kind."""

STEPS_BEGUN = 2
"""Steps of a fit to points from every start. Half and twice of this and of `STEPS_ENDED` bring 132 and 133
nats of a gap in place of 126, the latter in 1.5 times the time; all else is the same."""

STEPS_ENDED = 8
"""Steps of a fit to points from the best of these starts (measured with `STEPS_BEGUN`)."""

STEPS_CONFIRMED = 12
"""Steps of a fit to all points. Half and twice change nothing."""

STEPS_COSTLY = 3
"""Steps of a fit of an effect whose orbits take many times as long. Half and twice change nothing."""

TABLE_STEPS = {"try": 1e-2, "refit": 1e-4, "last": 1e-6}
"""Relative gain of the cost at which a fit to a table stops; of n points it is n times as much evidence.
While effects are tried it is 0.3 nats of 30 points, less than any decision turns on; for the model itself a
hundredth of that, and at the end a hundredth of that. Half and twice change nothing."""

FIT_TOLERANCE = 1e-3
"""Relative gain at which a fit to a table stops otherwise: 0.03 nats of 30 points."""

TABLE_ITERATIONS = {"rebase": 10, "refit": 25, "last": 40}
"""Steps of such fits at most: of the model from values of another one, from its own values, and at the end.
Half and twice change nothing."""

TABLE_BUDGET = 10 * STEPS_CONFIRMED
"""Tables computed for one of the best candidates at most: ten a step, for some eight parameters that are
differenced one by one, and a try."""

FIT_BUDGET = 10 * TABLE_ITERATIONS["last"]
"""The same for any other fit."""

TOP_FREQUENCIES = 0.8
"""Quantile of the frequencies from which the mass shows alone. Half of it changes nothing."""

# --- starts -----------------------------------------------------------------------------------------

TABLE_SIZES = (0.01, 0.05, 0.2, 0.7)
"""Sizes of an effect of which nothing is known, over those of the table, fourfold or fivefold apart: one is
within a factor of 2.2 of any between 0.005 and 1.5."""

DRY_SHARES = (0.1, 0.3, 0.6)
"""Levels of friction that fits begin with, over the friction there is or the least force applied: up to
threefold apart. Half and twice change nothing."""

DELAYS = (0.02, 0.1, 0.4, 1.2)
"""Times that fits begin with, over the radian of the shortest period, three- to fivefold apart, up to a phase
at which tables repeat. Half and twice change nothing."""

UNKNOWN_SIZES = (0.1, 1.0)
"""Multiples of the usual size of a parameter that has no default. Half and twice change nothing."""

START_COMMON = 0.1
"""Share of the mean error that is added to that of every point where starts are compared, so that one point
of another motion hides no good start. Half and twice change nothing."""

START_SAME = 1e-5
"""Relative difference of tables that an effect does not change: above what orbits err by, below any
scatter."""

# --- starts by the balance of forces ----------------------------------------------------------------

BALANCED_STARTS = 2
"""Starts of an effect on a table from which its forces are balanced: sizes apart may balance alike.
Half and twice change nothing."""

BALANCE_SAMPLES = 48
"""Samples a period of the sines along which forces are balanced, so that the ninth harmonic has five."""

BALANCE_PERIODS = 3
"""Periods of these sines: hidden states settle over the first ones. Half and twice change nothing."""

BALANCE_ROUNDS = 4
"""Rounds of Gauss and Newton for parameters that are not linear. Half and twice change nothing."""

BALANCE_RANK = 1e-6
"""Singular value, over the largest, that a balance leaves out: below it columns differ by less than what
differences leave of them (`HIDDEN_RTOL`, `TABLE_NUDGE`). Half and twice change nothing."""

BALANCE_GAIN = 1e-3
"""Relative gain of a round that is none: a fit follows anyway. Half and twice change nothing."""

BALANCE_LOWEST = 1e-2
"""Share of a positive parameter that a round leaves of it at least, so that its logarithm exists. Half and
twice change nothing."""

GROSS_BALANCE = 3.0
"""Usual errors, medians, beyond which a point counts less in a balance of forces, by Cauchy's weight: of
complex normal errors the median is 0.83 standard deviations, and at 2.4 of them the estimate keeps 95 % of
its efficiency (Holland & Welsch, Comm. Statist. A6 (1977) 813)."""

# --- what a table determines ------------------------------------------------------------------------

FLAT_COLUMN = 1e-6
"""Slope, over the largest, of a parameter that a table does not determine: what N errs by over a difference
(`TABLE_NUDGE`)."""

FLAT_SINGULAR = 1e-5
"""Singular value, over the largest, of a direction that a table does not determine: ten times that of one
parameter, as it is a sum of several."""

FLAT_INVERSE = 1e-8
"""Singular value, over the largest, that an inverse takes at least, so that it is finite."""

REGION_BANDS = 4
"""Bands of amplitude and of frequency: tables have some five to ten of either."""
