"""What results say: tuned numbers, each with what it follows from."""

from __future__ import annotations

from ..thresholds import LEVEL

SPECTRUM_LEAST = 100
"""Samples of a record at least for a spectrum of its error: two decades of frequency."""

SMOOTHED_ENDS = 0.6
"""Periods of the cutoff at either end that a smoothed signal is not used of: the low-pass has forgotten a
quarter of what lies beyond (`LOW_PASS_MEMORY`)."""

CORRELATED = 0.95
"""Correlation of two parameters beyond which it is worth a word, by default: with the other one known, the
standard error of either would be less than a third, sqrt(1 - 0.95^2)."""

SHOWN_PROBABILITY = LEVEL
"""Probability of a candidate beyond which it is worth a word: that of a chance that tests take."""

LEAST_WIDTH = 30
"""Letters of the first column of a ladder: the longest name of an effect has 27."""
