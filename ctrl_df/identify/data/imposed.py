"""Records of an imposed motion and the force that it took: the motion, as models are moved by it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from ...simulate.imposed import Path, path_of
from ...units import dimension
from . import derivatives
from .measurement import Measurement
from .thresholds import SLOW, STILL

_MOTIONS: WeakKeyDictionary[Measurement, ImposedMotion] = WeakKeyDictionary()


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
    """

    x: np.ndarray
    v: np.ndarray
    a: np.ndarray
    cutoff: float
    error: float
    measured: bool
    path: Path

    def __str__(self) -> str:
        """Return how it was read, as a clause."""
        speed = "the measured velocity" if self.measured else "a cubic spline"
        return f"the motion low-passed at {self.cutoff:.3g} Hz, {speed} between samples"


def imposed_motion(record: Measurement) -> ImposedMotion:
    """Return the motion of a record (kept for as long as the record lives).

    Speeds are derivatives, which make noise large: the position passes a low-pass at the frequency where its
    spectrum sinks into its noise floor.
    """
    known = _MOTIONS.get(record)
    if known is None:
        known = _MOTIONS[record] = _motion(record)
    return known


def _motion(record) -> ImposedMotion:
    t = record.t
    x, cutoff = _smoothed(t, record.u)
    v = None if record.velocity is None else _smoothed(t, record.velocity)[0]
    # white noise below the cutoff, and what differentiation makes of it
    noise, band = derivatives.noise_floor(t, record.u), 2 * cutoff * record.dt
    place = noise * math.sqrt(band)
    speed = 2 * math.pi * cutoff * place / math.sqrt(3)
    if record.velocity is not None:
        speed = derivatives.noise_floor(t, record.velocity) * math.sqrt(min(band, 1.0))
    path = path_of(t, x, v, still=STILL * place, slow=SLOW * speed)
    _, x, v, a, _ = path.nodes[path.samples >= 0].T
    return ImposedMotion(x, v, a, cutoff, place, record.velocity is not None, path)


def _smoothed(t, y) -> tuple[np.ndarray, float]:
    dt, _, values = derivatives.uniform(t, y)
    cutoff = derivatives.automatic_cutoff(values, dt)
    return derivatives.derivative(t, y, 0, cutoff), cutoff
