"""Tuned numbers that several subpackages share, each with what it follows from or what chose it.

Those of one subpackage stand in its own ``thresholds.py``.

``rigs``: `benchmarks/diagnosis.py`, single effects, ladders, rigs with nothing or something unknown hidden.
``records``: `benchmarks/studies.py`. ``tables``: `tests/test_frequency.py`. A number that names one of
these was chosen by hand on it; no scan of other values is on record, so that none is the best there is. The
ratio of two rms of n effective samples each has a logarithm of standard deviation 1/sqrt(n). Numbers of one
effect stand in its class, tolerances of one formula beside it.
"""

from __future__ import annotations

import math
from statistics import NormalDist

from ..thresholds import ROUNDED

# --- evidence [nats] --------------------------------------------------------------------------------

SHAPES = 300
"""Shapes that a diagnosis of records tries: some 25 effects, about a dozen starts each."""

FALSE_ALARM = 1e-6
"""Chance at which one of them may look like an effect where nothing is missing."""

SIGNIFICANT = float(math.ceil(math.log(SHAPES / FALSE_ALARM)))
"""Evidence an effect needs on records: one of `SHAPES` exceeds it by chance once in `FALSE_ALARM`: 20."""

RULED_OUT = float(round(math.log(150)))
"""Evidence behind the first beyond which a candidate is no rival: odds of 150 to 1."""

DISTINGUISHED = float(round(math.log(400)))
"""Log likelihood ratio that distinguishes two candidates: odds of 400 to 1."""

QUARTILE = round(NormalDist().inv_cdf(0.75), 4)
"""Of a normal distribution: half the values lie within so many standard deviations, 0.6745."""

BY_CHANCE = 3.0
"""Standard deviations up to which a difference may be chance: one in 370 is larger."""

# --- ratios of errors -------------------------------------------------------------------------------

PROCESS_NOISE = 50.0
"""Error over the sensor's noise, in the shortest segments, that disturbance forces alone make, and no effect
that is missing (between the rigs and the recorded machines)."""

LACKS_MORE = 10.0
"""Error over the noise beyond which a model lacks something, which moves its events as well: no other minimum
of its cost is sought. Six steps past events lowered an error by a third (rigs)."""

GIVE_UP = 3.0
"""Error over the best candidate's beyond which another try is not worth it: nine times its power, which no
last step of a fit removes (rigs). Only work depends on it."""

STILL_POSSIBLE = 1.5
"""Error over the best candidate's up to which another may yet turn out to be the right one: a bit more than
twice its power, left by a fit that ended beside its minimum (rigs)."""

GROWTH = round(math.exp(BY_CHANCE / math.sqrt(100)), 2)
"""Best error over segments four times as long that still counts as the same: chance for 100 effective
samples, 1.35."""

ONLY_NOISE = round(1 + 1 / math.sqrt(2 * 500), 2)
"""Error over the noise, or over the least that the shortest segments leave, up to which a fit has nothing to
gain: the spread of an rms over 500 effective samples, 1.03."""

UNMOVED = 0.5
"""Error over the shortest segments, of the output's rms, beyond which a model explains no motion: one that
stands still at a fitted place and speed errs by as much over half a turn of a sine."""

# --- what a record shows ----------------------------------------------------------------------------

NOISE_FREE = 1e-7
"""Noise over the spread of the output that no sensor is below: such a record was simulated."""

UNPLACED = 0.2
"""Error of a place that is an integral of the velocity, over the spread of places: where a record began is
determined by laws that depend on the place alone, and fits let a place be five of its errors off."""

SLOWLY = 0.05
"""Speed, over its rms, below which a record hardly moves."""

ON_SAMPLE = 1e-9
"""Of a step: difference of instants that rounding makes."""

SEGMENT_SAMPLES = 20
"""Samples of the shortest segment that a comparison takes: fewer are used up by its initial states."""

RTOL_FINEST = 1e-8
"""Relative tolerance of the finest simulations: a tenth of the least noise (`NOISE_FREE`)."""

RTOL_COARSE = 1e-5
"""Relative tolerance of simulations that are fitted to a record, at most."""

FULL_SAMPLES = 12_000
"""Steps of the input at the full rate: a longer record is decimated to about so many."""

# --- tests and regions ------------------------------------------------------------------------------

LEVEL = 0.01
"""Level of tests: one in a hundred by chance."""

RECORD_SAMPLES = 50
"""Samples of a record at least for regions of its error."""

TAKES_PART = 0.01
"""Effect on the output, over the largest in a direction that data do not determine, from which a parameter
takes part in it: friction of a few per cent of a drive's torque does, errors of derivatives (1e-3) do not."""

# --- rounding ---------------------------------------------------------------------------------------

NEARLY_NOTHING = ROUNDED
"""What quotients of the size of one are divided by where their divisor may be zero."""

DEPENDENT = 1e-9
"""Singular value, over the largest, of columns that depend on each other: noise of a millionth shows more."""

EXPONENT = 700.0
"""Largest exponent whose exponential is a number: the logarithm of the largest float is 709."""

# --- fits -------------------------------------------------------------------------------------------

REFIT_BUDGET = 600
"""Simulations at most of a refit by default, and of one of a model that may be named: forty steps of fifteen,
of differences by a dozen parameters and by initial states, and a try. Half and twice were not tried."""

# --- reports ----------------------------------------------------------------------------------------

REPORT_BUDGET = 200
"""Simulations of the refit that tells the standard errors of a report: it begins at the values that the model
has."""

REPORT_DPI = 130
"""Dots per inch of its pictures."""

PROGRESS_EVERY = 10.0
"""Seconds for which a stage goes on without a line of progress: attention is kept no longer (Nielsen
1993)."""

PROGRESS_POLL = 2.0
"""Seconds between two looks whether it is time for one while jobs run: five times in them."""
