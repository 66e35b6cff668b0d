"""Diagnosis and ladder: tuned numbers, each with what it follows from or chose it (`../thresholds.py`)."""

from __future__ import annotations

import math

from ..thresholds import BY_CHANCE, NOISE_FREE, RULED_OUT, SIGNIFICANT

# --- evidence [nats] --------------------------------------------------------------------------------

SIGNIFICANT_HELD = RULED_OUT
"""Evidence an effect needs on held-out records alone: odds of 150 to 1, for data that choose nothing.

To these are fitted initial states, and what the others leave open: a threshold within a range, the phase of
a ripple.
"""

REFUTED = SIGNIFICANT
"""Evidence of held-out data against a candidate that puts it last."""

STOPPED_EARLY = 3 * SIGNIFICANT
"""Evidence by which candidates may differ because their fits stopped early: thrice what makes an effect,
which fits gained on the rigs when brought to their end. More costs time, less the right one now and then."""

PROMISING = 0.2
"""Share of the best one's evidence, and of what makes an effect, from which a candidate is confirmed after
screening: there records are decimated fourfold and fits unfinished, so that the right one may show a fifth of
its evidence (rigs)."""

TO_ITS_END = 0.5
"""Share of the best one's evidence from which a candidate is fitted to its end: unfinished fits lose less
(`STOPPED_EARLY`). Only work depends on it while no fit loses half; half and twice change nothing on two
rigs."""

FORCE_ALIKE = 0.98
"""Share of the best one's evidence that another kind of force must bring to be named beside it, but for what
makes an effect: of large evidence two hundredths are a matter of the noise model."""

# --- ratios of errors -------------------------------------------------------------------------------

EXPLAINS_LITTLE = 0.8
"""Error of the best candidate over the baseline's from which it explains little: a third of the power (1 -
0.8^2)."""

SHOWS_HARDLY = 0.97
"""The same from which it explains next to nothing: 3 % are one standard deviation of that ratio for 1,000
effective samples."""

EXPLAINS_LONG = 0.5
"""Error of the best candidate over the baseline's, over the longest segments, up to which it explains enough
of what long ones show: three quarters of the power."""

LITTLE_CHANCE = 0.1
"""Error held out, of the baseline's, below which it does not matter whether a part of it is chance: 99 %
of the power are explained in any case (rig "stop, open" of `benchmarks/verdicts.py`: 3 %)."""

LEFT = 0.2
"""Share of the structure (rms) that the best candidate may leave: 4 % of its power. Rigs with something
unknown hidden leave more to whatever stands in for it, those of the library less."""

LEFT_BY_ANSWER = 0.05
"""The same share up to which the best candidate is the answer whatever remains, over segments of any length:
0.25 % of the power. A right law leaves that where the input is not known exactly (a moving base read by an
accelerometer: 0.015), one that stands in for another law more (rigs with something unknown hidden: 0.07 and
more)."""

CURVE_SHARE = 0.15
"""Share of a missing force that is a curve over one quantity from which on that quantity is reported. On 40
rigs with something unknown hidden 19 came to it, and for 16 of them the quantity was the right one; under
steps of force three had a curve after reversals in the place of one over time or position, of 0.37 to
0.54."""

CURVE_MOST = 0.5
"""Share from which on the explanation tells it, where the kind of force fitted to the residual is another: it
is then most of the missing force."""

SIZE_KNOWN = 0.5
"""Standard error over the size of an effect, beyond which it may be none: two of them reach zero."""

HEAVY_TAILS = 1.32
"""Rms of noise over that of normal noise with the same median size, at most: that of Laplace's distribution,
whose values beyond four of these sizes are cut. Of 90 true models it was 0.78 to 1.09, of three 1.25,
1.26 and 1.33 (an encoder that rounds); of valves whose slips came at other times 1.34 to 1.58."""

INDEPENDENT_MOST = 80
"""Independent samples that noise is taken to have at most where records are compared: two of them of 80 each
differ by a factor of 1.4 by chance, and levels of noise differ from record to record anyway."""

GROWN = 2.0
"""Error over the least that the shortest segments leave, up to which it may be noise in any case: slow noise
of thrice the power of the fast one, the only one that short segments do not absorb (rigs with coloured
noise). Noise that is known to be slower may grow by more."""


def by_chance(independent: float) -> float:
    """Return how many times larger one rms of noise may be than another, of so many independent samples."""
    return math.exp(BY_CHANCE / math.sqrt(independent))


REFIT_PROMISES = 2.0
"""Error over that of the best candidate from which a model without an effect is not refitted to see whether
it explains as much: a refit goes on from a fit over the same records, and hardly halves its error."""

ON_LIMIT = 1.001
"""Factor to the end of its range within which a parameter has come there: fits go on to a thousandth."""

FINE_STEP = 0.1
"""Step of a grid over the spread of the values up to which it is fine: a loop sees in it a gain of one within
1 % (describing function of a quantizer, over amplitudes about the square root of two of the spread)."""

NO_ERROR = 10 * NOISE_FREE
"""Error over the spread of the output that is no error."""

PASSED, BUMP_LEFT = 2.15e-3, 0.01
"""Speed, over the typical one, at which a bump of friction is gone that only breaking away shows, and the
share of it that is left then: a Gaussian one of a thousandth of the typical speed, sqrt(log 100) of its width
away."""

# --- work -------------------------------------------------------------------------------------------

CONFIRMED = 6
"""Most candidates that are refitted at the full rate: two, and all that screening left near the best. Each
costs as much as the whole screening of several effects; half and twice change nothing on three rigs."""

CONFIRMED_FORCED = 10
"""The same where disturbance forces let screening distinguish little. Half and twice change nothing on three
rigs."""

REFUTED_MOST = 2
"""Candidates that long horizons refute, after each of which the search is repeated without it: a
joint and a gap, which have the hidden states that follow short segments. Each repetition is a whole
search."""

LONG_RIVALS = 2
"""Rivals that the best one is compared with over long horizons, beside the baseline: each costs as much as a
comparison at eight lengths."""

EFFORT_CONFIRMED = (3, 1e-3)
"""The same at the full rate: 1e-3 is 5 nats of 10,000 samples, which rules out a rival (`RULED_OUT`)."""

EFFORT_ENDED = (8, 1e-6)
"""The same of near equals at the full rate: 1e-6 is 0.005 nats."""

BASE_STEPS = 8
"""Steps of the refitted model over short segments: every candidate is compared with it."""

BASE_LONGER_STEPS = 12
"""Steps of the refitted model that is moved to longer segments: it goes on for twice as long as a candidate
does at first (`../fits/thresholds.py`: `EFFORT_TRIED`)."""

RIVAL_STEPS = 4
"""Steps of the models among which rivals of one more effect are sought: their errors are compared only."""

RIVAL_BASE_STEPS = 3
"""Steps of the baseline that is moved to the segments of that search."""

STEPS_LONGER = 6
"""Iterations over longer segments of fits that were started there: as many as an effect is tried with
(`../fits/thresholds.py`: `EFFORT_TRIED`)."""
