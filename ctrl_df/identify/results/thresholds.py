"""What results say: tuned numbers."""

from __future__ import annotations

SPECTRUM_LEAST = 100
"""Samples of a record at least for a spectrum of its error."""

SMOOTHED_ENDS = 0.6
"""Periods of the cutoff at either end that a smoothed signal is not used of."""

SHOWN_PROBABILITY = 0.01
"""Of a candidate that is worth a word."""

LEAST_WIDTH = 30
"""Letters of the first column of a ladder."""
