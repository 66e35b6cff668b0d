"""The wavelength of a ripple of force or friction, sought in the motion as it was measured.

A simulation that does not know the ripple yet is soon a wavelength away from the place where the mass
really is: short ripples are lost in it. Here the measured place stands in the ripple's argument, and the
equation of motion is integrated twice,

    y = x0 + v0 t + 1/m (u - friction + a sin kx + b cos kx), integrated twice,

which is linear in all but k; friction that differs from place to place is a wave that reverses with the
motion. Of several records each has a and b of its own. Second differences take x0 and v0 out. What is left
over has noise of two kinds, of the sensor and of forces; each frequency weighs by what is left at and around
it (Whittle's likelihood), so that either may prevail. Pauses do not count: friction is whatever the drive is
there, and would pass for noise of forces. Then k is scanned, from the stroke down to what the smoothed
position resolves.

Where the motion was imposed the force is what was measured: nothing is integrated, and the equation is one of
the force itself (`ImposedSpectrum`).
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...thresholds import NOTHING
from ...values.per_record import PerRecord
from ..data.imposed import imposed_motion
from ..prediction.segments import facts
from ..thresholds import DEPENDENT, NEARLY_NOTHING, NOISE_FREE, SLOWLY
from .thresholds import (
    FADES,
    RIPPLE_BAND,
    RIPPLE_COARSEST,
    RIPPLE_LONGEST,
    RIPPLE_NEAR,
    RIPPLE_ROUNDS,
    RIPPLE_RUN,
    RIPPLE_SAMPLES,
    RIPPLE_STEP,
    RIPPLE_TURNS,
    RUN_LEAST,
    SPECTRUM_AROUND,
    SPECTRUM_SAMPLES,
    SPECTRUM_WIDTH,
)

_FORCES = {"dry": True, "linear": True, "constant": True, "unequal": False, "elastic": False, "drag": False}
"""Forces that a drive may have, and whether every drive has them."""


@dataclass(frozen=True)
class Wave:
    """A ripple that explains the motion, and the parameters of the mass that go with it.

    `gain`: log likelihood ratio [nats] over the motion without it.
    """

    gain: float
    amplitude: float
    wavelength: float
    phase: float
    mass: float
    coulomb: float
    viscous: float


class RippleSpectrum:
    """Records as one linear regression.

    Parameters
    ----------
    records, segments : sequences
        Records, evenly sampled, and the parts of each that count (one of 20 samples at least).
    known : sequence of (float, bool)
        Wave numbers [rad/m] of ripples that the model has already, and whether each is one of friction.
    elastic : bool
        Whether the model has a force that depends on the place.
    reversing : bool
        Whether the wave sought is of friction, which acts against the motion.
    """

    _differences = 2

    def __init__(
        self,
        records: Sequence,
        segments: Sequence,
        known: Sequence[tuple[float, bool]] = (),
        elastic: bool = False,
        reversing: bool = False,
    ):
        self.records, self.elastic = records, elastic
        self.places = [self._place(r) for r in records]
        self._reversing = reversing
        self.span = max(float(np.ptp(x)) for x in self.places)
        moving = [_moving(r) for r in records]
        if not any(_runs(w, 1, m) for w, m in zip(segments, moving, strict=True)):
            moving = [np.ones(len(r), bool) for r in records]
        longest = max(j - i for w, m in zip(segments, moving, strict=True) for i, j in _runs(w, 1, m))
        self._size = max(self._band(), math.ceil(max(map(len, records)) / SPECTRUM_SAMPLES), 1)
        self._size = max(min(self._size, longest // RIPPLE_RUN), 1)
        self._runs = [_runs(w, self._size, m) for w, m in zip(segments, moving, strict=True)]
        self._of = [k for k, runs in enumerate(self._runs) for _ in runs]  # the record of each
        forces = [_forces(r, x) for r, x in zip(records, self.places, strict=True)]
        base = [self._response(column) for column in zip(*forces, strict=True)]
        for k, reverses in known:
            pairs = self._apart(self._response(self._waves(k, reverses)))
            base += [[part(p) for p in pair] for pair in pairs for part in (np.real, np.imag)]
        given, measured = self._signals()
        self._base = [self._parts(given), *base]
        self._y = self._parts(measured)
        self._weights = [np.ones(_length(y) // 2 + 1) for y in self._y]
        for _ in range(RIPPLE_ROUNDS):
            w = self._regressed(self._base)
            left = [
                y - sum(c * b[i] for c, b in zip(w, self._base, strict=True)) for i, y in enumerate(self._y)
            ]
            self._weights = [_weights(e) for e in left]
        self._basis, _ = np.linalg.qr(np.array([self._white(b) for b in self._base]).T)
        self._left = self._without(self._white(self._y))
        self._power = float(self._left @ self._left)

    def best(self, count: int) -> list[Wave]:
        """Return the ripples that explain most, the best first."""
        if not self.span > 0 or not self._power > 0:
            return []
        finest = self.span / (RIPPLE_COARSEST * max(self._blur(r) for r in self.records))
        turns = np.arange(RIPPLE_LONGEST, max(min(finest, RIPPLE_TURNS), 2.0), RIPPLE_STEP)
        gains = self._scan(turns)
        found: list[Wave] = []
        while len(found) < count and np.max(gains) > 0:
            i = int(np.argmax(gains))
            near = turns[i] + np.linspace(-RIPPLE_STEP, RIPPLE_STEP, RIPPLE_NEAR)
            wave = self.wave(2 * math.pi * near[int(np.argmax(self._scan(near)))] / self.span)
            if wave is not None:
                found.append(wave)
            gains[np.abs(turns - turns[i]) < 1.0] = 0.0
        return found

    def wave(self, k: float) -> Wave | None:
        """Return the ripple of wave number `k` [rad/m], fitted; None where that makes no sense."""
        waves = self._waves(k, self._reversing)
        pairs = self._apart(self._response(waves))
        # what a drive may have besides blurs the parameters of what it does have
        has = [True, *(_FORCES | {"elastic": self.elastic}).values()]
        plain = [*itertools.compress(self._base, has), *self._base[len(has) :]]
        columns = [[part(p) for p in pair] for pair in pairs for part in (np.imag, np.real)]
        w = self._regressed([*plain, *columns])
        if (units := self._units(float(w[0]))) is None:
            return None
        (mass, force), each = units, w[len(plain) :].reshape(-1, 2)
        size = float(np.mean([math.hypot(*ab) for ab in each]))
        phase = PerRecord.angles([r.name for r in self.records], [math.atan2(b, a) for a, b in each])
        return Wave(
            float(self._gain(waves)),
            force * size,
            2 * math.pi / k,
            phase,
            mass,
            float(force * w[1]),
            float(force * w[2]),
        )

    def _waves(self, k: float, reversing: bool) -> list[np.ndarray]:
        """Return the forces of a ripple of wave number `k`, sine and cosine in one, of each record."""
        senses = [-np.sign(facts(r).velocity) if reversing else 1.0 for r in self.records]
        return [sense * np.exp(1j * k * x) for sense, x in zip(senses, self.places, strict=True)]

    def _scan(self, turns) -> np.ndarray:
        """Return the gains at evenly spaced numbers of wavelengths to the stroke."""
        k, step = 2 * math.pi * turns / self.span, 2 * math.pi * (turns[1] - turns[0]) / self.span
        many = int(np.clip(RIPPLE_SAMPLES // sum(map(len, self.records)), 1, len(k)))
        beyond = [np.exp(1j * step * np.arange(many)[:, None] * x) for x in self.places]
        # from wave number to wave number they are turned on: exponentials took a quarter of the time
        turned = [np.exp(1j * step * many * x) for x in self.places]
        waves, gains = self._waves(k[0], self._reversing), []
        for left in range(len(k), 0, -many):
            gains.append(self._gain([w * b[:left] for w, b in zip(waves, beyond, strict=True)]))
            waves = [w * t for w, t in zip(waves, turned, strict=True)]
        return np.concatenate(gains)

    def _gain(self, waves) -> np.ndarray:
        """Return what forces in phase and in quadrature with waves (..., n) explain together [nats]."""
        a = self._without(self._white_apart(self._response(waves)))
        g, h = a @ self._left, a @ a.swapaxes(-1, -2)
        i = np.arange(h.shape[-1])
        h[..., i, i] += DEPENDENT * np.trace(h, axis1=-2, axis2=-1)[..., None] + NOTHING
        share = np.sum(g * np.linalg.solve(h, g[..., None])[..., 0], axis=-1) / self._power
        return -0.5 * len(self._left) * np.log(np.maximum(1 - share, NEARLY_NOTHING))

    def _regressed(self, columns) -> np.ndarray:
        """Return the weights of columns; 0 of one that those before it make up.

        Of a drive that moves one way dry friction is a constant force: shared out between the two, either
        may come to anything.
        """
        matrix = np.array([self._white(c) for c in columns]).T
        matrix = matrix / (size := np.linalg.norm(matrix, axis=0) + NOTHING)
        tells = np.abs(np.diag(np.linalg.qr(matrix, "r"))) > DEPENDENT
        weights = np.zeros(len(columns))
        weights[tells] = np.linalg.lstsq(matrix[:, tells], self._white(self._y), rcond=NEARLY_NOTHING)[0]
        return weights / size

    def _without(self, x) -> np.ndarray:
        """Return spectra (..., m) without what the columns of the model explain of them."""
        return x - (x @ self._basis) @ self._basis.T

    def _band(self) -> int:
        """Return samples over which means keep the band of the motion and some of the noise above it."""
        return min(facts(r).half for r in self.records) // RIPPLE_BAND

    def _signals(self) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Return what the mass goes with, here what the force given does to 1 kg; and what was measured."""
        given = [_integral(_held(r), r.t) for r in self.records]
        return given, [facts(r).place for r in self.records]

    def _units(self, weight: float) -> tuple[float, float] | None:
        """Return the mass, and the force of a weight of one; `weight`: of what the mass goes with.

        None where the mass would be negative.
        """
        return (1 / weight, 1 / weight) if weight > 0 else None

    def _place(self, record) -> np.ndarray:
        """Return the position without the noise above the band of the motion."""
        x = _integral(facts(record).velocity, record.t)
        return x - np.mean(x) + np.mean(facts(record).place)

    def _blur(self, record) -> float:
        """Return the error of the smoothed position [m]."""
        known = facts(record)
        return max(known.noise / math.sqrt(2 * known.half), NOISE_FREE * known.position)

    def _response(self, forces) -> list[np.ndarray]:
        """Return what forces, (..., n) a record, do to a free mass of 1 kg, as `_parts` does."""
        return self._parts(
            [_integral(_integral(f, r.t), r.t) for f, r in zip(forces, self.records, strict=True)]
        )

    def _apart(self, parts) -> list[list[np.ndarray]]:
        """Return parts of all records as those of each, and nothing in the others."""
        return apart(parts, self._of, len(self.records))

    def _parts(self, signals) -> list[np.ndarray]:
        """Return second differences of means over samples, one array for each part without holes."""
        parts, mean = [], np.full(self._size, 1 / self._size)
        for s, runs in zip(signals, self._runs, strict=True):
            for i, j in runs:
                means = s[..., i:j].reshape(*s.shape[:-1], -1, self._size) @ mean
                d = np.diff(means, self._differences)
                # faded at the ends: sensor noise is a million times stronger at high than at low frequencies
                parts.append(d * _fade(d.shape[-1]))
        return parts

    def _white(self, parts) -> np.ndarray:
        """Return the weighted spectra of parts, real and imaginary."""
        return np.concatenate(self._spectra(parts))

    def _white_apart(self, parts) -> np.ndarray:
        """Return `_white` of the real and of the imaginary part of `_apart`, (..., two rows a record, m).

        What is nothing has no spectrum: each part is transformed once, however many records there are.
        """
        both = [self._spectra([part(p) for p in parts]) for part in (np.real, np.imag)]
        pairs = zip(*(apart(spectra, self._of, len(self.records)) for spectra in both), strict=True)
        rows = [np.concatenate(spectra, axis=-1) for pair in pairs for spectra in pair]
        return np.stack(rows, axis=-2)

    def _spectra(self, parts) -> list[np.ndarray]:
        spectra = [np.fft.rfft(s, _length(s)) * w for s, w in zip(parts, self._weights, strict=True)]
        return [np.concatenate((s.real, s.imag), axis=-1) for s in spectra]


class ImposedSpectrum(RippleSpectrum):
    """Records of an imposed motion and the force that it took, as one linear regression of that force.

    It is mass times acceleration, less friction and the wave, as these act on the mass. The motion knows
    nothing of the wave, and its band nothing of that of the force.
    """

    _differences = 0

    def _band(self) -> int:
        return 1

    def _signals(self) -> tuple[list[np.ndarray], list[np.ndarray]]:
        return [imposed_motion(r).a for r in self.records], [facts(r).load for r in self.records]

    def _units(self, weight: float) -> tuple[float, float]:
        return weight, 1.0

    def _place(self, record) -> np.ndarray:
        return imposed_motion(record).x

    def _blur(self, record) -> float:
        return max(imposed_motion(record).error, NOISE_FREE * facts(record).position)

    def _response(self, forces) -> list[np.ndarray]:
        """Return what it takes to move against forces."""
        return self._parts([-f for f in forces])


@functools.lru_cache(maxsize=64)
def _fade(length: int) -> np.ndarray:
    return np.hanning(length) ** FADES


def _forces(record, place) -> list[np.ndarray]:
    """Return forces that a drive may have, those of `_FORCES`."""
    v = facts(record).velocity
    return [-np.sign(v), -v, np.ones(len(v)), -np.abs(v), place, v * np.abs(v)]


def _held(record) -> np.ndarray:
    """Return the impulse of the force given, up to each sample."""
    u = np.asarray(record.u)
    if record.input_hold == "zoh":
        return np.concatenate(([0.0], np.cumsum(u[:-1] * np.diff(record.t))))
    return _integral(u, record.t)


def _integral(f, t) -> np.ndarray:
    """Return the integral of signals (..., n) up to each sample."""
    sums = np.zeros_like(f)
    np.cumsum((0.5 * np.diff(t)) * (f[..., 1:] + f[..., :-1]), axis=-1, out=sums[..., 1:])
    return sums


def _moving(record) -> np.ndarray:
    """Return which samples are of no pause: there dry friction is whatever the drive is, and no regressor.

    A passage through zero speed lasts no longer than the speed is smoothed over.
    """
    known = facts(record)
    slow = np.abs(known.velocity) < SLOWLY * known.speed
    moving = np.ones(len(slow), bool)
    for i, j in _intervals(slow):
        if j - i > 2 * known.half:
            moving[max(i - known.half, 0) : j + known.half] = False
    return moving


def _runs(segments, size, moving) -> list[tuple[int, int]]:
    """Return first and last sample of parts without holes or pauses, of whole numbers of `size` samples."""
    runs = _intervals(_covered(segments, len(moving)) & moving)
    return [(int(i), int(i + (j - i) // size * size)) for i, j in runs if (j - i) // size > RUN_LEAST]


def _covered(segments, samples: int) -> np.ndarray:
    there = np.zeros(samples, bool)
    for i, j in zip(segments.first, segments.stop, strict=True):
        there[i:j] = True
    return there


def intervals_of(segments, samples: int) -> np.ndarray:
    """Return begin and end (n, 2) of the intervals of samples that lie in segments."""
    return _intervals(_covered(segments, samples))


def _intervals(there) -> np.ndarray:
    """Return begin and end (n, 2) of the intervals of samples that are there."""
    return np.flatnonzero(np.diff(np.concatenate(([False], there, [False])).astype(int))).reshape(-1, 2)


def _length(signal) -> int:
    """Return a length for the Fourier transform that is quick."""
    from scipy.fft import next_fast_len

    return next_fast_len(signal.shape[-1], real=True) or signal.shape[-1]


def _weights(left) -> np.ndarray:
    """Return one over the rms that is left around each frequency: medians, which single lines leave alone."""
    power = np.abs(np.fft.rfft(left, _length(left))) ** 2
    n = len(power)
    middles = np.unique(np.geomspace(2, n - 1, SPECTRUM_AROUND).astype(int))
    level = [
        np.median(power[max(int(m / SPECTRUM_WIDTH) - 2, 1) : int(m * SPECTRUM_WIDTH) + 3]) / math.log(2)
        for m in middles
    ]
    logs = np.interp(np.log(np.arange(1, n)), np.log(middles), np.log(np.array(level) + NOTHING))
    return np.append(0.0, np.exp(-0.5 * logs))


def apart(parts, of, records: int) -> list[list[np.ndarray]]:
    """Return parts as those of each record, and nothing in the others; `of`: the number of each one's."""
    return [
        [p if k == i else np.zeros_like(p) for i, p in zip(of, parts, strict=True)] for k in range(records)
    ]
