"""Records of an imposed motion and the force that it took: the motion, as models are moved by it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np

from ...simulate.imposed import Path, path_of
from ...units import dimension
from . import signals
from .measurement import Measurement
from .thresholds import DIRECTION_SEEN, LOW_PASS_ENDS, MINIMUM, TURN_SEEN

_MOTIONS: WeakKeyDictionary[Measurement, ImposedMotion] = WeakKeyDictionary()
_WITHOUT_ENDS: WeakKeyDictionary[Measurement, Measurement] = WeakKeyDictionary()


def imposes_motion(record: Measurement) -> bool:
    """Return whether the input of a record is a position (an angle) and its output a force (a torque)."""
    into, out = dimension(record.input_unit), dimension(record.output_unit)
    return into in (dimension("m"), dimension("rad")) and out in (dimension("N"), dimension("N m"))


@dataclass(frozen=True, eq=False)
class ImposedMotion:
    """A motion as it is imposed on models.

    Attributes
    ----------
    x, v, a : (n,) arrays
        Position, speed and acceleration at the samples, of the signal below `cutoff`.
    cutoff : float
        [Hz] of the zero-phase low-pass that the position has passed.
    error : float
        [m] rms that noise leaves in the position below `cutoff`.
    measured : bool
        Whether the speed is a measured one (low-passed at its own cutoff).
    path : Path
        The same between samples.
    lowest : float
        [Hz] of the low-passes of position and speed: what they know least of the ends by.
    ends : float
        [s] that were left out at either end (see `without_ends`).
    """

    x: np.ndarray
    v: np.ndarray
    a: np.ndarray
    cutoff: float
    error: float
    measured: bool
    path: Path
    lowest: float
    ends: float = 0.0

    def __str__(self) -> str:
        """Return how it was read, as a clause."""
        speed = "the measured velocity" if self.measured else "a cubic spline"
        ends = f", less {self.ends:.3g} s at either end" if self.ends else ""
        return f"the motion low-passed at {self.cutoff:.3g} Hz, {speed} between samples{ends}"

    def between(self, first: int, last: int, ends: float) -> ImposedMotion:
        """Return the motion from sample `first` to before `last`, with `ends` left out, as it was found."""
        part = slice(first, last)
        path = self.path.between(first, last)
        return replace(self, x=self.x[part], v=self.v[part], a=self.a[part], path=path, ends=ends)


def imposed_motion(record: Measurement) -> ImposedMotion:
    """Return the motion of a record (kept for as long as the record lives).

    Speeds are derivatives, which make noise large: the position passes a low-pass at the frequency where its
    spectrum sinks into its noise floor.
    """
    known = _MOTIONS.get(record)
    if known is None:
        known = _MOTIONS[record] = _motion(record)
    return known


def without_ends(record: Measurement) -> Measurement:
    """Return a record without its ends, where the low-pass of its motion has none of what lies beyond.

    There speeds and accelerations are those of a continuation that nobody recorded, and near a reversal the
    direction may be. The motion stays the one found from the whole record. Records that have lost their ends
    already, and such of which too little would be left, are returned as they are.
    """
    motion = imposed_motion(record)
    if motion.ends:
        return record
    known = _WITHOUT_ENDS.get(record)
    if known is None:
        known = _inner(record, motion)
        if known is not record:  # which would keep itself alive
            _WITHOUT_ENDS[record] = known
    return known


def _inner(record, motion) -> Measurement:
    ends = LOW_PASS_ENDS / motion.lowest
    first, last = np.searchsorted(record.t, (record.t[0] + ends, record.t[-1] - ends)).tolist()
    if last - first < MINIMUM:
        return record
    inner = record.slice(record.t[first], record.t[last - 1])
    _MOTIONS[inner] = motion.between(first, last, ends)
    return inner


def _motion(record) -> ImposedMotion:
    t = record.t
    x, cutoff = _smoothed(t, record.u)
    v, lowest = None, cutoff
    if record.velocity is not None:
        v, own = _smoothed(t, record.velocity)
        lowest = min(cutoff, own)
    # white noise below the cutoff, and what differentiation makes of it
    noise, band = signals.noise_floor(t, record.u), 2 * cutoff * record.dt
    place = noise * math.sqrt(band)
    speed = 2 * math.pi * cutoff * place / math.sqrt(3)
    if record.velocity is not None:
        speed = signals.noise_floor(t, record.velocity) * math.sqrt(min(band, 1.0))
    path = path_of(t, x, v, still=TURN_SEEN * place, slow=DIRECTION_SEEN * speed)
    _, x, v, a, _ = path.nodes[path.samples >= 0].T
    return ImposedMotion(x, v, a, cutoff, place, record.velocity is not None, path, lowest)


def _smoothed(t, y) -> tuple[np.ndarray, float]:
    dt, _, values = signals.uniform(t, y)
    cutoff = signals.automatic_cutoff(values, dt)
    return signals.derivative(t, y, 0, cutoff), cutoff
