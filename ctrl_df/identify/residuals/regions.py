"""Where the error is: its share by time, direction, speed, position, load, amplitude, frequency.

A region is a set of samples (or a band of frequencies). Under the null hypothesis the residual is stationary
noise of the spectrum it is seen to have, so that a region's share of the squared error is its share of the
samples. The p-values allow for that spectrum: neighbouring samples of a smooth residual say nearly the same
thing, and count as few. All are adjusted for the number of regions looked at.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ...blocks.coordinates import moving_in
from ...numerals import SMALLEST_P, digits
from ...thresholds import NOTHING
from ..data.quantities import word_of
from ..thresholds import BY_CHANCE, LEVEL, NEARLY_NOTHING, RECORD_SAMPLES
from .motion_phases import half_stroke, reversals, time_since
from .residual_tests import autocorrelation
from .thresholds import (
    AFTER_REVERSAL,
    BAND_LOWEST,
    BANDS_LEAST,
    EDGE_ZERO,
    FASTEST,
    LOW_SPEED,
    MEDIUM_SPEED,
    NO_POWER,
    REGION_LEAST,
    REGION_ROWS,
    REGION_SAMPLES,
    REGIONS,
)

SPEEDS = ("low_speed", "medium_speed", "high_speed")
KINDS = ("time", "direction", *SPEEDS, "after_reversal", "position", "load", "amplitude", "frequency")


@dataclass(frozen=True)
class Region:
    """One region and its part in the error.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    label : str
        Such as ``v > 0`` or ``0.2 to 0.4 s``.
    share, expected_share : float
        Of the squared error; of the samples (for a band of frequencies: what its neighbours suggest).
    p_value : float
        Probability of a share this large by chance, adjusted for the number of regions.
    bias, bias_p_value : float
        Mean residual in the region over the rms of the whole residual; probability of one that large by
        chance.
    span : (float, float)
        Its limits, in the unit of its kind (s, m/s, m, N, Hz).
    sentence : str
        The same in words.
    """

    kind: str
    label: str
    share: float
    expected_share: float
    p_value: float
    bias: float
    bias_p_value: float
    span: tuple[float, float]
    sentence: str = ""

    def __repr__(self) -> str:
        return (
            f"<Region {self.kind}, {self.label}: {self.share:.1%} of the squared error, expected "
            f"{self.expected_share:.1%}, p {chance(self.p_value)}>"
        )

    @property
    def excess(self) -> float:
        """Share of the error beyond the share expected."""
        return self.share - self.expected_share


class Regions(tuple[Region, ...]):
    """Regions, worst first."""

    heading: ClassVar[str] = "where the error is"
    measure: ClassVar[str] = "share of squared error [%]\n(black: of the samples)"
    apart: ClassVar[str] = ": "
    """What stands between kind and label in a picture."""
    columns: ClassVar[str] = f"{'kind':<15} {'region':<34} {'error':>7} {'samples':>8} {'p':>8} {'bias':>6}"

    @property
    def significant(self) -> Regions:
        """Those whose share of the error is beyond chance (p < 0.01)."""
        return type(self)(r for r in self if r.p_value < LEVEL)

    @property
    def sentences(self) -> tuple[str, ...]:
        """One sentence per significant region, or one that says there is none."""
        return tuple(r.sentence for r in self.significant) or (
            "No region holds more of the squared error than chance would leave there.",
        )

    def of(self, kind: str) -> Regions:
        """Return the regions of one kind, in their natural order."""
        if kind not in KINDS:
            raise ValueError(f"a kind of region must be one of {', '.join(KINDS)}; got {kind!r}.")
        return Regions(sorted((r for r in self if r.kind == kind), key=lambda r: r.span))

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds with a significant region, the worst first."""
        return tuple(dict.fromkeys(r.kind for r in self.significant))

    def table(self, rows: int = REGION_ROWS) -> str:
        """Return the worst `rows` regions as text."""
        return "\n".join([self.columns, *(self.line(r) for r in self[:rows])])

    @staticmethod
    def line(r: Region) -> str:
        """Return a region as a line of the table."""
        return (
            f"{r.kind:<15} {r.label:<34} {r.share:>7.1%} {r.expected_share:>8.1%} {chance(r.p_value):>8} "
            f"{r.bias:>+6.2f}"
        )


def error_regions(
    t, residual, *, position=None, velocity=None, force=None, bins=REGIONS, units=("m", "N")
) -> Regions:
    """Return every region's share of the squared error, worst first.

    Parameters
    ----------
    t : array_like, shape (n,)
        Times [s], evenly spaced.
    residual : array_like, shape (n,)
        Measured minus simulated. A position error remembers: what went wrong at one place stays visible until
        corrected. The error of force or acceleration shows the place itself.
    position, velocity, force : array_like or None, shape (n,)
        Signals that divide the record; those missing leave their regions out.
    bins : int
        Parts of the record in time and in position.
    units : (str, str)
        Of position and of force; the words follow from them.

    Returns
    -------
    Regions
        Significant ones first, by excess of error.

    Raises
    ------
    ValueError
        Unequal lengths, NaN, fewer than 50 samples.
    """
    t, r = _checked(t, residual)
    signals = {}
    for name, values in dict(position=position, velocity=velocity, force=force).items():
        if values is not None:
            signals[name] = _checked(t, values, name)[1]
    total = float(np.sum(r * r))
    if total == 0:
        return Regions()
    null = _Null(r)
    found = [null.region(*part) for part in _parts(t, bins, units, **signals)]
    found += _bands(t, r, signals.values())
    found.sort(key=lambda region: region.p_value)
    adjusted = [
        replace(region, p_value=float(p), bias_p_value=min(region.bias_p_value * len(found), 1.0))
        for region, p in zip(found, holm([region.p_value for region in found]), strict=True)
    ]
    adjusted.sort(key=lambda region: (region.p_value >= LEVEL, -region.excess))
    words = {"position": moving_in(units[0]).position, "load": word_of(units[1], "force")}
    return Regions(replace(region, sentence=_sentence(region, words)) for region in adjusted)


# --- dividing the record --------------------------------------------------------------------------


def _parts(t, bins, units, position=None, velocity=None, force=None) -> Iterator[tuple]:
    """Yield (kind, label, mask, span) of every region of samples."""
    edges = np.linspace(t[0], t[-1], bins + 1)
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        yield "time", f"{digits(a)} to {digits(b)} s", (t >= a) & ((t < b) | (b == edges[-1])), (a, b)
    if velocity is not None:
        yield from _by_velocity(t, velocity, position, units[0])
    if position is not None:
        yield from _quantiles("position", units[0], position, bins)
    if force is not None:
        word = word_of(units[1], "force")
        yield from _quantiles("load", units[1], np.abs(force), 4, "|F| " if word == "force" else f"|{word}| ")


def _by_velocity(t, velocity, position, unit):
    fast = float(np.quantile(np.abs(velocity), FASTEST))
    low, v = LOW_SPEED * fast, moving_in(unit).name("v")
    yield "direction", f"{v} > 0", velocity > low, (low, math.inf)
    yield "direction", f"{v} < 0", velocity < -low, (-math.inf, -low)
    speed = np.abs(velocity)
    yield "low_speed", f"|{v}| < {digits(low, 2)} {unit}/s", speed < low, (0.0, low)
    yield (
        "medium_speed",
        f"{digits(low, 2)} < |{v}| < {digits(MEDIUM_SPEED * fast, 2)} {unit}/s",
        (speed >= low) & (speed < MEDIUM_SPEED * fast),
        (low, MEDIUM_SPEED * fast),
    )
    yield (
        "high_speed",
        f"|{v}| > {digits(MEDIUM_SPEED * fast, 2)} {unit}/s",
        speed >= MEDIUM_SPEED * fast,
        (MEDIUM_SPEED * fast, math.inf),
    )
    turns = reversals(velocity, low)
    if len(turns) < 3:
        return
    since = time_since(t, turns)
    usual = float(np.median(np.diff(t[turns])))
    first = AFTER_REVERSAL * usual
    yield "after_reversal", f"within {digits(first, 2)} s", since < first, (0.0, first)
    middle = 0.5 * usual
    yield (
        "after_reversal",
        f"{digits(first, 2)} to {digits(middle, 2)} s after",
        (since >= first) & (since < middle),
        (first, middle),
    )
    yield "after_reversal", f"later than {digits(middle, 2)} s", since >= middle, (middle, math.inf)
    if position is not None:
        yield from _quantiles("amplitude", unit, half_stroke(position, turns), 3)


def _quantiles(kind, unit, values, count, prefix=""):
    edges = np.unique(np.quantile(values, np.linspace(0, 1, count + 1)))
    reach = float(np.max(np.abs(edges)))
    for i, (a, b) in enumerate(zip(edges[:-1], edges[1:], strict=True)):
        inside = (values >= a) & ((values < b) | (i == len(edges) - 2))
        ends = " to ".join(digits(end if abs(end) > EDGE_ZERO * reach else 0.0) for end in (a, b))
        yield kind, f"{prefix}{ends} {unit}", inside, (float(a), float(b))


# --- what chance alone would do -------------------------------------------------------------------


class _Null:
    """Shares and means of a stationary Gaussian residual of the spectrum seen."""

    def __init__(self, r):
        n = len(r)
        self.r, self.n, self.power = r, n, float(np.mean(r * r))
        self.lags = n // 2
        self.size = 1 << (2 * n - 1).bit_length()
        self.rho = self._correlation(r)

    def _correlation(self, r):
        rho = autocorrelation(r, self.lags)
        # Lags whose correlation is within three standard errors of none add noise only.
        rho = np.where(rho**2 > BY_CHANCE**2 / self.n, rho, 0.0)
        rho[0] = 1.0
        return rho

    def _pairs(self, mask):
        """Count the pairs of samples of the region at each distance in time."""
        spectrum = np.fft.rfft(mask.astype(float), self.size)
        pairs = np.fft.irfft(np.abs(spectrum) ** 2, self.size)[: self.lags + 1]
        pairs[1:] *= 2
        return pairs

    def region(self, kind, label, mask, span) -> Region:
        from scipy.stats import t as t_distribution

        count = int(mask.sum())
        share, expected = float(np.sum(self.r[mask] ** 2)) / (self.n * self.power), count / self.n
        if count < REGION_LEAST or self.n - count < REGION_LEAST:
            return Region(kind, label, share, expected, 1.0, 0.0, 1.0, span)
        inside, outside = self._pairs(mask), self._pairs(~mask)
        squares = [_independent(pairs, self.rho**2) for pairs in (inside, outside)]
        p = chance_of(share, expected, *squares)
        # A step between the region and the rest correlates the residual by itself: without it the test is
        # sharper, where enough independent samples remain to know the two means.
        mean_in, mean_out = float(np.mean(self.r[mask])), float(np.mean(self.r[~mask]))
        rest = self.r - np.where(mask, mean_in, mean_out)
        error_filter, power = self._correlation(rest), float(np.mean(rest * rest))
        means = [_independent(pairs, np.maximum(error_filter, 0)) for pairs in (inside, outside)]
        if min(means) < REGION_SAMPLES:
            error_filter, power = self.rho, self.power
            means = [_independent(pairs, np.maximum(error_filter, 0)) for pairs in (inside, outside)]
        z = mean_in / math.sqrt(max(power, NO_POWER * self.power) / means[0])
        bias_p = float(2 * t_distribution.sf(abs(z), max(means[0] - 1, 1)))
        if share > expected:  # more error than its part: by its spread, or by its mean
            p = min(1.0, 2 * min(p, bias_p))
        return Region(kind, label, share, expected, p, mean_in / math.sqrt(self.power), bias_p, span)


def chance_of(share: float, expected: float, inside: float, outside: float) -> float:
    """Return the probability of a share of the squared error as large as this by chance: an F test.

    `inside`, `outside`: independent squares in the region and in the rest.
    """
    from scipy.stats import f as f_distribution

    ratio = share / max(1 - share, NOTHING) * (1 - expected) / expected
    return float(f_distribution.sf(ratio, inside, outside))


def holm(p_values: Sequence[float]) -> np.ndarray:
    """Return probabilities, in ascending order, adjusted for how many there are: Holm's step-down method."""
    count = len(p_values)
    return np.maximum.accumulate([min(p * (count - i), 1.0) for i, p in enumerate(p_values)])


def _independent(pairs, correlation) -> float:
    """Effective number of samples of a region: its size over the correlated samples that come with each."""
    count = float(pairs[0])
    return count**2 / max(float(pairs @ correlation), count)


def _bands(t, r, signals) -> list[Region]:
    """Third-octave bands that stand out from their neighbours, and not because the signals do so there."""
    from scipy.stats import f as f_distribution

    n, dt = len(r), (t[-1] - t[0]) / (len(r) - 1)
    f = np.fft.rfftfreq(n, dt)
    edges = [BAND_LOWEST / (n * dt)]
    while edges[-1] < f[-1]:
        edges.append(edges[-1] * 2 ** (1 / 3))
    where = np.searchsorted(f, edges)
    bands = [(a, b) for a, b in zip(where[:-1], where[1:], strict=True) if b - a >= 2]
    power = _periodogram(r)
    total = float(power[1:].sum())
    if total == 0 or len(bands) < BANDS_LEAST:
        return []
    density = np.array([power[a:b].mean() for a, b in bands]) + NO_POWER * total
    references = [np.array([_periodogram(x)[a:b].mean() for a, b in bands]) for x in signals]
    relative = [density / (x + NEARLY_NOTHING * x.max()) for x in references if x.max() > 0]
    found = []
    for i, (a, b) in enumerate(bands):
        near = [j for j in (i - 2, i - 1, i + 1, i + 2) if 0 <= j < len(bands)]
        widths = sum(bands[j][1] - bands[j][0] for j in near)
        # An excited line of the input shows in every residual: it must also stand out beside the signals.
        ratio = min(values[i] / _background(values, near) for values in (density, *relative))
        p = float(f_distribution.sf(ratio, b - a, widths))  # the Hann segment halves the independent lines
        share = float(power[a:b].sum()) / total
        span = (float(f[a]), float(f[b - 1]))
        expected = min(share, _background(density, near) * (b - a) / total)
        label = f"{digits(span[0])} to {digits(span[1])} Hz"
        found.append(Region("frequency", label, share, expected, p, 0.0, 1.0, span))
    return found


def _background(values, near) -> float:
    """Level that the neighbours suggest: the second highest, as a line near an edge leaks into one of them.

    On a slope, and at the corner of a filter, this is above the band itself: only peaks stand out.
    """
    return float(np.sort(values[near])[-2])


def _periodogram(x):
    return np.abs(np.fft.rfft((x - x.mean()) * np.hanning(len(x)))) ** 2


# --- words ----------------------------------------------------------------------------------------

_PLACE = {
    "time": "the time from {label}",
    "direction": "motion with {label}",
    **dict.fromkeys(SPEEDS, "motion with {label}"),
    "after_reversal": "the time after reversals, {label}",
    "position": "{word}s from {label}",
    "load": "samples with {label}",
    "amplitude": "swings of amplitude {label}",
    "frequency": "the band {label}",
}


def _sentence(region: Region, words: dict[str, str]) -> str:
    place = _PLACE[region.kind].format(label=region.label, word=words.get(region.kind))
    of = "expected from its neighbours" if region.kind == "frequency" else "of the samples"
    text = (
        f"{region.share:.0%} of the squared error lies in {place}, against {region.expected_share:.0%} {of}"
    )
    if region.p_value >= LEVEL:
        return f"{text}: no more than chance (p = {chance(region.p_value)})."
    text += f" (p {chance(region.p_value)})"
    if region.bias_p_value < LEVEL:
        side = "above" if region.bias > 0 else "below"
        text += (
            f"; the measured output lies {side} the model there, by {abs(region.bias):.2g} of the rms error"
        )
    return text + "."


def chance(p: float) -> str:
    """Return a probability for a table."""
    return "< 1e-6" if p < SMALLEST_P else f"{p:.2g}"


def _checked(t, values, name="residual"):
    t, x = np.asarray(t, dtype=float), np.asarray(values, dtype=float)
    if t.shape != x.shape or t.ndim != 1 or len(t) < RECORD_SAMPLES:
        raise ValueError(
            f"error_regions needs 1-D arrays of equal length, 50 samples or more; t has shape {t.shape} and "
            f"{name} {x.shape}."
        )
    if not np.all(np.isfinite(x)):
        raise ValueError(
            f"error_regions needs finite numbers; {name} has NaN or infinity. Has the simulation diverged?"
        )
    return t, x
