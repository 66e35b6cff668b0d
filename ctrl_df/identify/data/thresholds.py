"""Reading, checking and differentiating records: tuned numbers, each with what it follows from."""

from __future__ import annotations

# --- reading and checking ---------------------------------------------------------------------------

MINIMUM = 10
"""Samples of a record at least: fewer have no derivatives."""

JUMP_BESIDE = 5
"""Samples to either side whose accelerations a jump stands out from: ten in all."""

JUMP_STANDS_OUT, JUMP_FAST = 10.0, 5.0
"""How far it stands out from these accelerations, and from all others of the record: the largest of ten
second differences of white noise is four to six of its deviations, so that a jump of a hundred of them is
seen wherever it is, and noise never makes one."""

SINGLE = 2
"""Jumps up to which none is a step of a coarse sensor: there and back again is no motion."""

BETWEEN_STEPS = 0.5
"""Motion between jumps, over the least of them, below which they are steps of a sensor: half a step is what
rounding hides."""

ABOVE_REST = 2.0
"""Standard deviation of an output, over its noise, above which it moves of itself: of a hundred samples of
noise it is 1.5 at most in all but one of a thousand, of thirty 2.3 in all but one of a hundred."""

USUAL_STEPS = (0.05, 0.95)
"""Quantiles between which steps of time lie that are usual: one in ten may be a hole, or written twice, and
the clock still counts as regular."""

REGULAR = 0.01
"""Difference of steps of time, over their median, that is jitter: a motion of some ten samples a period or
more moves by 0.6 % of its amplitude in it at most."""

RARER_STEPS = 3
"""Steps of the rarer of two lengths of steps from which they may tell a rounded clock: three at random places
keep to a line within their difference once in 770."""

ROUNDED_TIMES = 4.0
"""Distance of two steps of time, over the rounding of the largest time, up to which they are one: each is the
difference of two times, each of them rounded when it was read and again when it was converted to seconds."""

MOST_COLUMNS = 99
"""Columns of a matrix that are read: instruments have tens of channels."""

BLOCK = 100_000
"""Rows converted at once: some ten megabytes of texts, so that memory stays near the size of the file."""

SAMPLE_ROWS = 2000
"""Rows that the decimal mark is read off: a column may begin with whole numbers."""

ENCODING_LOOK, ENCODING_ZEROS = 4000, 4
"""Bytes of a file without a mark of its encoding that are looked at for zeros: bounds work. How many times as
many of one place of a pair as of the other tell UTF-16 from a binary file: digits and Latin letters have a
zero in every pair at the one place, and none at the other."""

BINARY = 0.002
"""Share of control characters from which a file is no text: of random bytes a tenth are (26 of 256), of text
none but stray ones."""

BINARY_LOOK = 100_000
"""Characters that are looked at for them: bounds work."""

NANOSECONDS = 1e9
"""In a second: times of day are kept as whole ones."""

# --- signals ----------------------------------------------------------------------------------------

FEW_VALUES = 0.9
"""Share of different values, over the samples, up to which a signal may be rounded: a tenth of them
repeat."""

ON_STEP, ON_STEPS = 0.05, 0.9
"""Distance from a multiple of the step, over it, and share of the distances that lie within it, from which
values keep to a grid: of values that keep to none a tenth do."""

SAME_VALUE = 1e-9
"""Distance of two values, over the largest, up to which they are one: rounding of sums and units makes some
hundred eps, a sensor of 24 bits steps of 6e-8."""

ONE_STEP = 1.5
"""Distance over the least one that is one step: half way to two."""

SPECTRUM_LENGTH = 16
"""Samples of a segment of a spectrum at least: four of its nine frequencies are then in the upper half, which
tells the noise (`white_level`)."""

WHITE_BAND = (0.5, 0.95)
"""Shares of the Nyquist frequency between which noise is white: below, machines move; beyond, filters of
instruments act."""

FLOOR_LEAST = 1e-14
"""Noise floor, over the largest power, that rounding makes: of Hann's window and a sum of some samples, fifty
eps."""

CUTOFF_LOWEST = 0.1
"""Cutoff of a signal that is all noise, over the Nyquist frequency: a tenth of the noise stays."""

CUTOFF_HIGHEST = 0.4
"""Highest cutoff, over the sampling rate: the bilinear transform has no room above, and differences of
samples, whose gain at it is 23 % of a derivative's, say nothing there."""

PADDING = 30
"""Samples by which a signal is continued at its ends, at least, before it is filtered: twice what SciPy's
``sosfiltfilt`` takes for two sections."""

DECIMATED_BAND = 0.7
"""Band that decimation keeps, over the new Nyquist frequency."""

DECIMATED_RIPPLE = 5e-4
"""Ripple in that band [dB]: flat within 1e-4, 49 dB down at the new Nyquist frequency."""

LONG = 100_000
"""Samples beyond which a record is decimated if it loses nothing: a diagnosis of so many takes minutes."""

CUTOFFS_KEPT = 3.0
"""Band that is kept, over the frequency at which the outputs have sunk into their noise: forces that change
at once reach beyond it, two octaves lower in a position for every one above."""

# --- a motion that is imposed -----------------------------------------------------------------------

TURN_SEEN = 6.0
"""Standard deviations of the smoothed position's noise up to which a way back is none: three to either
side."""

DIRECTION_SEEN = 3.0
"""Standard deviations of the speed's noise up to which its direction is not known."""

MISSING = 1.5
"""Over the usual interval: a longer one lacks a sample, half way to two intervals."""

SPECTRUM_SEGMENTS = 12
"""Segments of a spectrum, which is then known to 0.3 of its level, one over the root of them."""

CUTOFF_SEGMENTS = 24
"""Segments of a spectrum whose edge is sought: known to 0.2."""

ABOVE_NOISE = 10.0
"""Power over the noise floor that is signal: of a spectrum of 24 segments, some 23 averages, noise exceeds it
at no frequency by chance (exp(-160))."""

BEYOND_EDGE = 1.5
"""Cutoff over the highest such frequency, where Butterworth's low-pass, both ways, keeps 1 - 1.5^-8, 96 %."""

CUTOFF_PERIODS = 4
"""Periods of a cutoff in a record, at least."""

LOW_PASS_ORDER = 4
"""Order of the low-pass before derivatives, twice for both ways: its fall of 48 dB an octave is far more than
the 12 dB by which a second derivative rises."""

LOW_PASS_MEMORY = 3
"""Periods of its cutoff after which it has forgotten: its slowest poles, at 67.5 degrees, have then decayed
by exp(-7)."""

LOW_PASS_ENDS = 1.0
"""Periods of its cutoff at either end that a low-passed motion is not used of. It is continued there by its
point reflection, which turns the acceleration around: 83 % of that is lost at the end itself, within 3.7 % it
is right after one period. The cutoff has four periods in a record at least (`CUTOFF_PERIODS`): half of it
stays."""

DECIMATED_ORDER = 9
"""Order of the low-pass before decimation, odd: exact at 0 Hz."""

DECIMATED_MEMORY = 40
"""New samples after which it has forgotten: its slowest poles have decayed by exp(-9)."""

WINDOW_LEAST = MINIMUM - 1
"""Steps that a window of a record has to be longer than, to hold a record."""
