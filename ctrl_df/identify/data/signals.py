"""Noise floor, zero-phase derivatives and decimation of a sampled signal."""

from __future__ import annotations

import math

import numpy as np

from ...checks import number
from ...thresholds import NOTHING
from ..thresholds import ON_SAMPLE, QUARTILE
from .thresholds import (
    ABOVE_NOISE,
    BEYOND_EDGE,
    CUTOFF_HIGHEST,
    CUTOFF_LOWEST,
    CUTOFF_PERIODS,
    CUTOFF_SEGMENTS,
    DECIMATED_BAND,
    DECIMATED_MEMORY,
    DECIMATED_ORDER,
    DECIMATED_RIPPLE,
    FEW_VALUES,
    FLOOR_LEAST,
    LOW_PASS_MEMORY,
    LOW_PASS_ORDER,
    ON_STEP,
    ON_STEPS,
    ONE_STEP,
    PADDING,
    RARER_STEPS,
    REGULAR,
    ROUNDED_TIMES,
    SAME_VALUE,
    SPECTRUM_LENGTH,
    SPECTRUM_SEGMENTS,
    WHITE_BAND,
)


def uniform(t: np.ndarray, y: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Return (dt, times, values) on a regular grid; irregular samples are interpolated linearly."""
    steps = np.diff(t)
    middle = float(np.median(steps))
    if np.all(np.abs(steps - middle) <= REGULAR * middle):
        return float((t[-1] - t[0]) / (len(t) - 1)), t, y
    n = max(round(float((t[-1] - t[0]) / middle)) + 1, len(t))
    grid = np.linspace(t[0], t[-1], n)
    return float(grid[1] - grid[0]), grid, np.interp(grid, t, y)


def regular_clock(t: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the times of the regular clock that these are rounded from, and the unit of rounding [s].

    Rounded to q, a clock of any period makes steps of k q and (k + 1) q alone, in an order that keeps the
    times within q of a straight line. Other times are returned as they are, with a unit of 0.
    """
    steps, last = np.diff(t), len(t) - 1
    short, long = float(np.min(steps)), float(np.max(steps))
    unit = long - short
    if unit <= REGULAR * short:
        return t, 0.0
    lengthened = int(np.count_nonzero(steps - short > long - steps))
    off = ROUNDED_TIMES * float(np.spacing(np.max(np.abs(t))))
    between = float(np.max(np.minimum(steps - short, long - steps)))
    units = max(round(short / unit), 1)
    if (
        min(lengthened, last - lengthened) < RARER_STEPS
        or between > off
        or abs(short - units * unit) > (units + 1) * off
    ):
        return t, 0.0
    from scipy.optimize import minimize_scalar

    samples = np.arange(len(t))
    middle, slopes = float(np.mean(steps)), unit / last
    line = minimize_scalar(
        lambda slope: np.ptp(t - slope * samples), bounds=(middle - slopes, middle + slopes),
        method="bounded", options={"xatol": ON_STEP * slopes},
    )  # fmt: skip
    if line.fun > (1 + ON_STEP) * unit + off:
        return t, 0.0
    slope, first = np.polyfit(samples, t - t[0], 1)
    return t[0] + first + slope * samples, unit


def step_of(y: np.ndarray) -> float:
    """Return the quantum of a rounded signal, 0 if its values keep to no grid.

    The smallest distance of different values is a quantum if nearly all distances are multiples of it and
    values repeat.
    """
    values = np.unique(y)
    if len(values) < 3 or len(values) > FEW_VALUES * len(y):
        return 0.0
    gaps = _distances(values)
    if len(gaps) == 0:
        return 0.0
    quantum = float(np.median(gaps[gaps < ONE_STEP * np.min(gaps)]))
    return quantum if _multiples(gaps, quantum, len(y)) else 0.0


def rounded_to(y: np.ndarray, step: float) -> bool:
    """Whether the values of a signal are rounded to a step that is known: they need not repeat."""
    gaps = _distances(np.unique(y))
    return len(gaps) > 1 and float(np.min(gaps)) < ONE_STEP * step and _multiples(gaps, step, len(y))


def _distances(values: np.ndarray) -> np.ndarray:
    """Return the distances of values in order; those equal but for rounding are one value."""
    gaps = np.diff(values)
    return gaps[gaps > SAME_VALUE * max(float(np.max(np.abs(values))), NOTHING)]


def _multiples(gaps: np.ndarray, step: float, samples: int) -> bool:
    """Whether nearly all distances are multiples of a step, and no less than one."""
    off = np.abs(gaps / step - np.maximum(np.round(gaps / step), 1.0))
    return bool(np.mean(off < ON_STEP + ON_SAMPLE * samples) > ON_STEPS)


def spectrum(y: np.ndarray, dt: float, segments: int = SPECTRUM_SEGMENTS) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies [Hz] and one-sided spectral density of a signal (averaged, Hann window)."""
    from scipy.signal import welch

    length = min(
        len(y), max(2 ** int(math.log2(max(2 * len(y) // segments, SPECTRUM_LENGTH))), SPECTRUM_LENGTH)
    )
    return welch(y, 1 / dt, nperseg=length, detrend="linear")  # type: ignore[return-value]


def white_level(f: np.ndarray, p: np.ndarray) -> float:
    """Return the density of the floor between half and 95 % of the Nyquist frequency."""
    band = (f > WHITE_BAND[0] * f[-1]) & (f < WHITE_BAND[1] * f[-1])
    return float(np.median(p[band])) if np.any(band) else float(p[-1])


def noise_floor(t: np.ndarray, y: np.ndarray) -> float:
    """Return the rms of white noise that explains the top of the spectrum, at least the rounding's."""
    dt, _, values = uniform(t, y)
    f, p = spectrum(values, dt)
    return max(math.sqrt(white_level(f, p) * f[-1]), step_of(y) / math.sqrt(12))


def resolution(y: np.ndarray) -> float:
    """Return the rms of white noise that explains the usual fourth difference, jumps of motion left aside.

    For rounded signals: the rounding's.
    """
    if step_of(y) > 0:
        return step_of(y) / math.sqrt(12)
    return usual_noise(y)


def usual_noise(y: np.ndarray) -> float:
    """Return the rms of white noise that explains the usual fourth difference: steps are left aside."""
    return float(np.median(np.abs(np.diff(y, 4)))) / (QUARTILE * math.sqrt(70))


def automatic_cutoff(y: np.ndarray, dt: float) -> float:
    """Return the frequency [Hz] above which the signal is no more than ten times its noise floor in power."""
    f, p = spectrum(y, dt, CUTOFF_SEGMENTS)
    floor = max(white_level(f, p), FLOOR_LEAST * float(np.max(p)))
    above = np.flatnonzero(p > ABOVE_NOISE * floor)
    cutoff = BEYOND_EDGE * f[above[-1]] if len(above) else CUTOFF_LOWEST * f[-1]
    return float(min(max(cutoff, CUTOFF_PERIODS / (len(y) * dt), f[1]), CUTOFF_HIGHEST / dt))


def derivative(t: np.ndarray, y: np.ndarray, order: int, cutoff: float | None) -> np.ndarray:
    """Return the zero-phase low-passed derivative of `order` 1 or 2 (0: the signal) at the times given."""
    from scipy.signal import butter, sosfiltfilt

    dt, grid, values = uniform(t, y)
    if cutoff is None:
        cutoff = automatic_cutoff(values, dt)
    cutoff = number("a derivative", "cutoff", cutoff, "Hz")
    if not 0 < cutoff < 0.5 / dt:
        raise ValueError(
            f"a cutoff must lie between 0 and the Nyquist frequency {0.5 / dt:g} Hz; got cutoff={cutoff!r}."
        )
    # Removing the mean slope first keeps the ends quiet.
    slope = (values[-1] - values[0]) / (grid[-1] - grid[0])
    rest = values - values[0] - slope * (grid - grid[0])
    sos = butter(LOW_PASS_ORDER, cutoff * 2 * dt, output="sos")
    pad = int(min(len(rest) - 1, max(LOW_PASS_MEMORY / (cutoff * dt), PADDING)))
    d = sosfiltfilt(sos, rest, padtype="odd", padlen=pad)
    for _ in range(order):
        d = np.gradient(d, dt, edge_order=2)
    d = d + (values[0] + slope * (grid - grid[0]), slope, 0.0)[order]
    return d if grid is t else np.interp(t, grid, d)


def decimated(y: np.ndarray, factor: int) -> np.ndarray:
    """Return every `factor`-th sample after a zero-phase low-pass at 70 % of the new Nyquist frequency."""
    from scipy.signal import cheby1, sosfiltfilt

    # Flat within 1e-4 (odd order: exact at 0 Hz), 49 dB down at the new Nyquist frequency, both ways
    # together.
    sos = cheby1(DECIMATED_ORDER, DECIMATED_RIPPLE, DECIMATED_BAND / factor, output="sos")
    pad = min(len(y) - 1, DECIMATED_MEMORY * factor)
    return sosfiltfilt(sos, y, padtype="odd", padlen=pad)[::factor]


def block_means(u: np.ndarray, factor: int) -> np.ndarray:
    """Return the mean over each block of `factor` samples; the last block may be shorter."""
    edges = np.arange(0, len(u), factor)
    return np.add.reduceat(u, edges) / np.diff(np.append(edges, len(u)))
