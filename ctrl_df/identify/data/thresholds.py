"""Reading, checking and differentiating records: tuned numbers, each with what it follows from."""

from __future__ import annotations

# --- reading and checking ---------------------------------------------------------------------------

MINIMUM = 10
"""Samples of a record at least: fewer have no derivatives."""

BESIDE, JUMP, FAST = 5, 10.0, 5.0
"""Samples to either side whose accelerations a jump stands out from, how far, and how far from all others of
the record: the largest of ten second differences of white noise is four to six of its deviations, so that a
jump of a hundred of them is seen wherever it is, and noise never makes one."""

SINGLE = 2
"""Jumps up to which none is a step of a coarse sensor: there and back again is no motion."""

USUAL_STEPS = (0.05, 0.95)
"""Quantiles between which steps of time lie that are usual."""

REGULAR = 0.01
"""Difference of steps of time, over their median, that is jitter."""

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

FLOOR_LEAST = 1e-14
"""Noise floor, over the largest power, that rounding makes."""

CUTOFF_LOWEST, CUTOFF_HIGHEST = 0.1, 0.4
"""Cutoff of a signal that is all noise, over the Nyquist frequency; the highest, over the sampling rate."""

PADDING = 30
"""Samples by which a signal is continued at its ends, at least, before it is filtered."""

DECIMATED_BAND, DECIMATED_RIPPLE = 0.7, 5e-4
"""Band that decimation keeps, over the new Nyquist frequency; its ripple [dB]: flat within 1e-4, 49 dB down
at that frequency."""

LONG, CUTOFFS_KEPT = 100_000, 3.0
"""Samples beyond which a record is decimated if it loses nothing: a diagnosis of so many takes minutes. Band
that is kept over the frequency at which the outputs have sunk into their noise: forces that change at once
reach beyond it, two octaves lower in a position for every one above."""

# --- a motion that is imposed -----------------------------------------------------------------------

STILL, SLOW = 6.0, 3.0
"""Standard deviations of the smoothed position's noise, three to either side, up to which a way back is none;
of the speed's, up to which its direction is not known."""

MISSING = 1.5
"""Over the usual interval: a longer one lacks a sample, half way to two intervals."""

SEGMENTS, SEGMENTS_CUTOFF = 12, 24
"""Segments of a spectrum, known to 0.3 of its level then, one over the root of them; of one whose edge is
sought."""

ABOVE_NOISE, BEYOND_EDGE, CUTOFF_PERIODS = 10.0, 1.5, 4
"""Power over the noise floor that is signal; cutoff over its highest frequency; periods of a cutoff in a
record, at least."""

LOW_PASS_ORDER, LOW_PASS_MEMORY = 4, 3
"""Order of the low-pass before derivatives, twice for both ways; periods of its cutoff after which it has
forgotten."""

DECIMATED_ORDER, DECIMATED_MEMORY = 9, 40
"""Order of the low-pass before decimation, odd: exact at 0 Hz; new samples after which it has forgotten."""

WINDOW_LEAST = 9
"""Samples that a window of a record has to be longer than: a record has ten (`MINIMUM`)."""
