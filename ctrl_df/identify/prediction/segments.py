"""A record seen by a model: its scales, and the segments in which a simulation is restarted."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np

from ...cached import cached_property
from ...thresholds import NOTHING
from ..data import signals
from ..data.imposed import imposed_motion, imposes_motion
from ..data.measurement import Measurement
from ..thresholds import NOISE_FREE, SEGMENT_SAMPLES, UNPLACED
from .sensed import POSITION, driving_force, force_scale, place_unit, sensed
from .thresholds import FREE_FORCE, HALF_LEAST, HALF_MOST, HALF_PERIOD, TURNS_SAMPLES, USUAL_SEGMENT_LEAST


@dataclass(frozen=True)
class Facts:
    """Scales of one record: spread of output, speed and force, noise, time between reversals, usable band.

    Also what it shows of position and force, whichever of them is the output.
    """

    dt: float
    spread: float
    speed: float
    force: float
    noise: float  # of the leading output, in its unit
    period: float  # of the to-and-fro motion [s]
    half: int  # samples either side of a local polynomial
    velocity: np.ndarray
    position: float  # typical, about its mean
    place: np.ndarray  # position, counted from the first sample where it was not measured
    load: np.ndarray  # force
    drive: float  # typical input, in its unit
    units: tuple[str, str]  # of both
    imposed: bool = False  # motion in, force out


_FACTS: WeakKeyDictionary[Measurement, Facts] = WeakKeyDictionary()


def facts(record: Measurement) -> Facts:
    """Return the scales of a record (kept for as long as the record lives)."""
    known = _FACTS.get(record)
    if known is None and imposes_motion(record):
        known = _FACTS[record] = _of_imposed(record)
    if known is None:
        _, grid, values = signals.uniform(record.t, record.y)
        dt = float(grid[1] - grid[0])
        cutoff = signals.automatic_cutoff(values, dt)
        measured = sensed(record)
        velocity = signals.derivative(record.t, record.y, 1 - measured.columns[0], cutoff)
        place = np.asarray(record.y) if measured.columns[0] == POSITION else _integral(record.t, record.y)
        speed = max(float(np.sqrt(np.mean(velocity**2))), NOTHING)
        period = min(2 * record.duration / max(_turns(values), 1), record.duration)
        half = _half(record, cutoff, dt)
        known = Facts(
            dt, max(float(np.std(record.y)), NOTHING), speed, max(float(np.std(record.u)), NOTHING),
            measured.noise, period, half, velocity, max(float(np.std(place)), NOTHING), place, record.u,
            max(float(np.std(record.u)), NOTHING), (place_unit(record), record.input_unit),
        )  # fmt: skip
        _FACTS[record] = known
    return known


def facts_of(block, record: Measurement) -> Facts:
    """Return the scales of a record as a model sees them: what drives it is a force, never a voltage."""
    known, scale = facts(record), abs(force_scale(block))
    free = free_force(block, record)
    if free > 0:
        return replace(known, force=free, drive=free / scale)
    return known if scale == 1.0 else replace(known, force=scale * known.force)


def free_force(block, record: Measurement) -> float:
    """Return the typical force of a motion that no input drives, by a model's inertia; 0 of any other."""
    known = facts(record)
    if known.imposed or np.ptp(record.u) > 0:
        return 0.0
    masses = getattr(getattr(block, "core", None), "masses", ())
    return FREE_FORCE * sum(masses) * known.speed * 2 * math.pi / known.period


def load_of(block, record: Measurement) -> np.ndarray:
    """Return the force recorded, (n,): of a motor what it makes of voltage or current."""
    known = facts(record)
    return known.load if force_scale(block) == 1.0 else driving_force(block, record, known.velocity)


def _integral(t, v) -> np.ndarray:
    return np.concatenate(([0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))))


def _of_imposed(record: Measurement) -> Facts:
    """Return the scales of a record of a motion that was imposed, and of the force that it took."""
    motion = imposed_motion(record)
    dt, _, values = signals.uniform(record.t, motion.x)
    force = max(float(np.std(record.y)), NOTHING)
    # dry friction makes steps of the force, whose spectrum has no floor
    noise = min(record.noise_floor(), max(signals.usual_noise(record.y), signals.resolution(record.y)))
    return Facts(
        dt, force, max(float(np.sqrt(np.mean(motion.v**2))), NOTHING), force,
        max(noise, NOISE_FREE * force),
        min(2 * record.duration / max(_turns(values), 1), record.duration),
        _half(record, motion.cutoff, dt), motion.v,
        max(float(np.std(motion.x)), NOTHING), motion.x, record.y, force,
        (record.input_unit, record.output_unit),
        imposed=True,
    )  # fmt: skip


def _half(record, cutoff, dt) -> int:
    """Return half of the samples over which a state is read off."""
    return int(np.clip(HALF_PERIOD / (cutoff * dt), HALF_LEAST, max(len(record) // HALF_MOST, HALF_LEAST)))


def _turns(y) -> int:
    """Count the turning points between strokes longer than half the rms, so that noise adds none."""
    y = y[:: max(len(y) // TURNS_SAMPLES, 1)]
    least, top, low, up, count = 0.5 * float(np.std(y)), y[0], y[0], 0, 0
    for value in y.tolist():
        top, low = max(top, value), min(low, value)
        if up >= 0 and value < top - least:
            up, low, count = -1, value, count + 1
        elif up <= 0 and value > low + least:
            up, top, count = 1, value, count + 1
    return count


@dataclass(frozen=True)
class Segments:
    """Parts of a record, and the state in which the data say each begins.

    Attributes
    ----------
    first, stop : (nw,) integer arrays
        First sample of each segment and the one after its last; in order, without overlap unless
        `repeated`. What lies between segments is not simulated and does not count.
    x, v, a : (nw,) arrays
        Reported position [m], velocity [m/s], acceleration [m/s^2] at the first sample of each.
    x_error, v_error : (nw,) arrays
        How far they may be off.
    outputs : int
        How many outputs the record holds: signals have them one after the other.
    step : int
        Every how many samples of a segment count, from its first on.
    """

    first: np.ndarray
    stop: np.ndarray
    x: np.ndarray
    v: np.ndarray
    a: np.ndarray
    x_error: np.ndarray
    v_error: np.ndarray
    outputs: int = 1
    step: int = 1

    def __len__(self) -> int:
        """Return the number of segments."""
        return len(self.x)

    @property
    def edges(self) -> np.ndarray:
        """Sample numbers where segments begin, and the end of the last, (nw + 1,)."""
        return np.append(self.first, self.stop[-1])

    @cached_property
    def samples(self) -> np.ndarray:
        """Numbers of the record's samples that count, (n,)."""
        counts = self.counts
        offset = self.first - self.step * (np.cumsum(counts) - counts)
        return np.repeat(offset, counts) + self.step * np.arange(int(counts.sum()))

    @cached_property
    def counts(self) -> np.ndarray:
        """How many samples of each segment count, (nw,)."""
        return -(-(self.stop - self.first) // self.step)

    @cached_property
    def follow(self) -> np.ndarray:
        """Whether each goes on from the one before it: after a pause of at most twice its length, (nw,)."""
        pause = self.first[1:] - self.stop[:-1]
        on = (pause >= 0) & (pause <= 2 * (self.stop - self.first)[:-1])
        return np.concatenate(([False], on))

    @cached_property
    def slices(self) -> list[slice]:
        """Each segment as a slice of a signal: those of the first output, then those of the next."""
        at = np.concatenate(([0], np.cumsum(np.tile(self.counts, self.outputs))))
        return [slice(int(i), int(j)) for i, j in zip(at[:-1], at[1:], strict=True)]

    @cached_property
    def places(self) -> list:
        """Where in a signal each segment is, all outputs together: slices, or numbers of samples."""
        if self.outputs == 1:
            return self.slices
        parts = [np.arange(w.start, w.stop) for w in self.slices]
        return [np.concatenate(parts[i :: len(self)]) for i in range(len(self))]

    @cached_property
    def blocks(self) -> list[slice]:
        """Each output as a slice of a signal."""
        n = int(np.sum(self.counts))
        return [slice(i * n, (i + 1) * n) for i in range(self.outputs)]

    @cached_property
    def begins(self) -> np.ndarray:
        """Where each segment of each output begins in a signal, (outputs * nw,)."""
        lengths = np.tile(self.counts, self.outputs)
        return np.concatenate(([0], np.cumsum(lengths)[:-1]))

    def sums(self, x) -> np.ndarray:
        """Return the sum over each segment, all outputs together, of a signal (n,) or of several (n, m)."""
        sums = np.add.reduceat(x, self.begins, axis=0)
        return sums if self.outputs == 1 else sums.reshape(self.outputs, len(self), *x.shape[1:]).sum(axis=0)

    def means(self, x) -> np.ndarray:
        """Return the mean over each segment, all outputs together, of a signal (n,)."""
        return self.sums(x) / (self.outputs * self.counts)

    def centred(self, x) -> np.ndarray:
        """Return a signal (n,) less the mean of each output."""
        return np.concatenate([x[b] - x[b].mean() for b in self.blocks])

    def spread(self, values) -> np.ndarray:
        """Return the signal (n,) that has one of the values (nw,) throughout each segment."""
        once = np.repeat(values, self.counts)
        return once if self.outputs == 1 else np.tile(once, self.outputs)

    def only(self, which) -> Segments:
        """Return some of the segments; `which`: booleans (nw,), or their numbers, each as often as wanted."""
        if which.dtype == bool and which.all():
            return self  # with what is known of their samples
        arrays = (self.first, self.stop, self.x, self.v, self.a, self.x_error, self.v_error)
        return Segments(*(array[which] for array in arrays), outputs=self.outputs, step=self.step)

    def repeated(self, times: int) -> Segments:
        """Return all of them that many times, one time after the other."""
        return self.only(np.tile(np.arange(len(self)), times))

    def every(self, step: int) -> Segments:
        """Return the same segments, of which every `step`-th sample counts."""
        return self if step == self.step else replace(self, step=step)


def usual_segment(record: Measurement) -> float:
    """Return a length of segment [s] that shows two to-and-fro motions, 40 samples at least."""
    known = facts(record)
    return max(2 * known.period, USUAL_SEGMENT_LEAST * known.dt)


def make_segments(record: Measurement, length: float | None = None) -> Segments:
    """Divide a record into segments of about `length` [s] (None: one), and estimate where each begins."""
    return equal_segments(record, 1 if length is None else max(round(record.duration / length), 1))


def equal_segments(record: Measurement, count: int) -> Segments:
    """Divide a record into `count` segments of equal time, of 20 samples at least."""
    n = len(record)
    count = max(min(count, n // SEGMENT_SAMPLES), 1)
    edges = np.searchsorted(record.t, np.linspace(record.t[0], record.t[-1], count + 1))
    edges[0], edges[-1] = 0, n
    edges = np.unique(edges)
    return _between(record, edges[:-1], edges[1:])


def subdivided(record: Measurement, segments: Segments, factor: int, least: int) -> Segments:
    """Divide each segment into up to `factor` equal parts, none shorter than `least` samples."""
    first, stop = [], []
    for i, j in zip(segments.first, segments.stop, strict=True):
        edges = np.linspace(i, j, max(min(factor, (j - i) // least), 1) + 1).astype(int)
        first.append(edges[:-1])
        stop.append(edges[1:])
    return _between(record, np.concatenate(first), np.concatenate(stop)).every(segments.step)


_ESTIMATES: WeakKeyDictionary[Measurement, dict[int, tuple[float, ...]]] = WeakKeyDictionary()


def _between(record, first, stop) -> Segments:
    known, estimates = facts(record), _ESTIMATES.setdefault(record, {})
    for i in first.tolist():
        if i not in estimates:
            estimates[i] = _local(record, i, known)
    rows = np.array([estimates[i] for i in first.tolist()])
    return Segments(first, stop, *rows.T, outputs=len(sensed(record).columns))


def _local(record, i, known) -> tuple[float, float, float, float, float]:
    """Return (x, v, a, error of x, error of v) at sample i, by parabolas through its neighbours."""
    low, high = max(i - known.half, 0), min(i + known.half + 1, len(record))
    if high - low < 2 * known.half:  # at an end: as many samples, to one side
        low, high = (
            (0, min(2 * known.half, len(record)))
            if i < known.half
            else (max(len(record) - 2 * known.half, 0), high)
        )
    measured, s = sensed(record), record.t[low:high] - record.t[i]
    # a place that was not measured is counted from the first sample, which may lie anywhere
    x, x_error = float(known.place[i]), UNPLACED * known.position
    v, v_error, a = 0.0, math.inf, 0.0
    for column, y, weight in zip(measured.columns, measured.values, measured.weights, strict=True):
        found, errors = _parabola(s, y[low:high], measured.noise / weight)
        if column == POSITION:
            x, x_error = found[0], errors[0]
        if errors[1 - column] < v_error:
            v, v_error, a = found[1 - column], errors[1 - column], found[2 - column]
    return x, v, a, x_error, v_error


def _parabola(s, y, noise) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return value, slope and curvature of y at s = 0, and how far each may be off."""
    reach = max(float(np.max(np.abs(s))), NOTHING)
    basis = np.vander(s / reach, 3, increasing=True)
    solution, *_ = np.linalg.lstsq(basis, y, rcond=None)
    rest = y - basis @ solution
    sigma = max(float(np.sqrt(np.sum(rest**2) / max(len(y) - 3, 1))), noise)
    errors = sigma * np.sqrt(np.diag(np.linalg.pinv(basis.T @ basis)))
    return tuple((float(c[0]), float(c[1] / reach), float(2 * c[2] / reach**2)) for c in (solution, errors))  # type: ignore[return-value]
