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

OUTLYING_POINT, OUTLYING_LEAST, OUTLYING_SHARE = 10, 1e-3, 16
"""Error over the median from which a point is of another motion: by complex normal scatter one in 2^100 is;
and at least, a third of the scatter of a good table, for tables without any; one in so many points may be, or
two: three times as many as are expected (`GROSS`)."""

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
"""Deflection of bristles, as a share of the amplitude, below which they are rigid: when quick, two thirds of
the scatter of a good table, 0.3 %; when careful, a tenth of it."""

AS_DRY = 1e-6
"""Relative difference up to which presliding that slips has the dry friction of its block: rounding."""

# --- work -------------------------------------------------------------------------------------------

CONFIRMED_ON_TABLE = 5
"""Candidates that are fitted to all points of a table: as the likeliest of screening may be a few nats
behind. Half and twice were tried with three candidates alone, and change nothing."""

POINTS, POINTS_COSTLY = 20, 10
"""Points of a table for screening, and for effects whose orbits take many times as long: of 20 some eight
parameters of a candidate leave twelve, 24 real errors. Half and twice name the same effects. Of a gap half
brings 199 nats in place of 126 in half the time: the fit ends in another of its minima."""

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

STEPS_BEGUN, STEPS_ENDED, STEPS_CONFIRMED, STEPS_COSTLY = 2, 8, 12, 3
"""Steps of a fit to points: of every start, of the best of them; to all points, and of an effect that takes
many times as long. Half and twice of the first two bring 132 and 133 nats of a gap in place of 126, the
latter in 1.5 times the time; all else is the same."""

TABLE_STEPS = {"try": 1e-2, "refit": 1e-4, "last": 1e-6}
"""Relative gain at which a fit to a table stops: of n points it is n times as much evidence. While effects
are tried 0.3 nats of 30 points, less than any decision; a hundredth of that of the model itself, and of that
at the end. Half and twice change nothing."""

FIT_TOLERANCE = 1e-3
"""Relative gain at which a fit to a table stops otherwise: 0.03 nats of 30 points."""

TABLE_ITERATIONS = {"rebase": 10, "refit": 25, "last": 40}
"""Steps of such fits at most: the model from values of another, from its own, at the end. Half and twice
change nothing."""

TABLE_BUDGET, FIT_BUDGET = 10 * STEPS_CONFIRMED, 10 * TABLE_ITERATIONS["last"]
"""Tables computed for one of the best candidates, and for any fit, at most: of a step of some eight
parameters, each differenced, and a try."""

TOP_FREQUENCIES = 0.8
"""Quantile of the frequencies from which the mass shows alone. Half of it changes nothing."""

# --- starts -----------------------------------------------------------------------------------------

TABLE_SIZES = (0.01, 0.05, 0.2, 0.7)
"""Sizes of an effect of which nothing is known, over those of the table, fourfold or fivefold apart: one is
within 2.2 of any between 0.005 and 1.5. """

DRY_SHARES, DELAYS, UNKNOWN_SIZES = (0.1, 0.3, 0.6), (0.02, 0.1, 0.4, 1.2), (0.1, 1.0)
"""Levels of friction, over the friction there is or the least force applied, up to twice apart; times over
the shortest period's radian, three- to fivefold apart, up to a phase at which tables repeat; multiples of the
usual size of a parameter that has no default. Half and twice of all these change nothing."""

START_COMMON, START_SAME = 0.1, 1e-5
"""Share of the mean error added to every point's, so that one of another motion hides no good start , whose
half and twice change nothing; relative difference of tables that an effect does not change: above what orbits
err by, below any scatter."""

# --- starts by the balance of forces ----------------------------------------------------------------

BALANCED_STARTS = 2
"""Starts of an effect on a table from which its forces are balanced: sizes apart may balance alike.
Half and twice change nothing."""

BALANCE_SAMPLES, BALANCE_PERIODS, BALANCE_ROUNDS = 48, 3, 4
"""Of the sines along which forces are balanced: samples a period, of which the ninth harmonic has five;
periods, hidden states settling over the first ones; rounds of Gauss and Newton for parameters that are not
linear. Half and twice of the latter two change nothing."""

BALANCE_RANK = 1e-6
"""Singular value, over the largest, that a balance leaves out: below it columns differ by less than what
differences leave of them (`HIDDEN_RTOL`, `TABLE_NUDGE`). Half and twice change nothing."""

BALANCE_GAIN, BALANCE_LOWEST = 1e-3, 1e-2
"""Relative gain of a round that is none: a fit follows; share of a positive parameter that a round leaves of
it at least, so that its logarithm exists. Half and twice change nothing."""

GROSS_BALANCE = 3.0
"""Usual errors, medians, beyond which a point counts less in a balance of forces, by Cauchy's weight: of
complex normal errors the median is 0.83 standard deviations, and at 2.4 of them the estimate keeps 95 % of
its efficiency (Holland & Welsch, Comm. Statist. A6 (1977) 813)."""

# --- what a table determines ------------------------------------------------------------------------

FLAT_COLUMN, FLAT_SINGULAR, FLAT_INVERSE = 1e-6, 1e-5, 1e-8
"""Slope, over the largest, of a parameter that a table does not determine: what N errs by over a difference
(`TABLE_NUDGE`); singular value, over the largest, of such a direction: ten times that, as it is a sum of
several; singular value that an inverse takes at least, so that it is finite."""

REGION_BANDS = 4
"""Bands of amplitude and of frequency: tables have some five to ten of either."""
