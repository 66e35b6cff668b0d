"""What a record holds of a model's outputs, as one vector of values, each output over its own noise.

Outputs lie one after the other, the leading one first and as it is; the others are scaled so that their noise
is as large as its. A fit then minimizes one sum of squares, with one noise, whatever was measured.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from ...cached import cached_property
from ...thresholds import NOTHING
from ...units import dimension, written
from ..data import signals
from ..data.measurement import Measurement
from ..data.quantities import leading
from ..thresholds import NOISE_FREE
from .thresholds import FAR_OUT

OUTPUT_COLUMNS: Mapping[str, int] = {"position": 0, "velocity": 1}
"""Where an engine puts out the quantities that records may hold, of the body that is measured; and how often
the position is differentiated to be one."""

POSITION = OUTPUT_COLUMNS["position"]


@dataclass(frozen=True, eq=False)
class Sensed:
    """Outputs of one record.

    Attributes
    ----------
    quantities : tuple of str
    columns : tuple of int
        `OUTPUT_COLUMNS` of each.
    values : tuple of (n,) arrays
        In their units.
    weights : tuple of float
        What each is multiplied by: the noise of the leading one over its own.
    noise : float
        Of the leading one, in its unit.
    """

    quantities: tuple[str, ...]
    columns: tuple[int, ...]
    values: tuple[np.ndarray, ...]
    weights: tuple[float, ...]
    noise: float

    @cached_property
    def spans(self) -> list[tuple[float, float]]:
        """Mean of each output, and ten times its spread: what stands for a model that ran away."""
        return [(float(np.mean(y)), FAR_OUT * max(float(np.std(y)), NOTHING)) for y in self.values]

    def within(self, samples) -> np.ndarray:
        """Return the weighted values at some samples, (outputs times samples,)."""
        if len(self.columns) == 1:
            return self.values[0][samples]
        return np.concatenate([w * y[samples] for w, y in zip(self.weights, self.values, strict=True)])

    def apart(self, values) -> dict[str, np.ndarray]:
        """Return weighted values, such as a simulator's, output by output in their own units."""
        parts = np.split(values, len(self.columns)) if len(self.columns) > 1 else [values]
        return {
            q: x if w == 1.0 else x / w for q, x, w in zip(self.quantities, parts, self.weights, strict=True)
        }

    def of_place(self, count: int) -> np.ndarray:
        """Return what `count` values of each change by with the place alone, where no law knows it."""
        return np.repeat([float(column == POSITION) for column in self.columns], count)


_SENSED: WeakKeyDictionary[Measurement, Sensed] = WeakKeyDictionary()


def sensed(record: Measurement) -> Sensed:
    """Return the outputs of a record (kept for as long as the record lives)."""
    known = _SENSED.get(record)
    if known is None:
        outputs = record.outputs or {}
        first = leading(outputs)
        order = [first, *(q for q in outputs if q != first)]
        noise = [noise_of(record.t, outputs[q]) for q in order]
        known = _SENSED[record] = Sensed(
            tuple(order),
            tuple(OUTPUT_COLUMNS.get(q, POSITION) for q in order),
            tuple(outputs[q] for q in order),
            tuple(noise[0] / n for n in noise),
            noise[0],
        )
    return known


def noise_of(t, y) -> float:
    """Return the noise floor of an output, that of computed numbers at least; above 0 even of one at rest."""
    return max(signals.noise_floor(t, y), NOISE_FREE * float(np.std(y)), NOTHING)


def place_unit(record: Measurement) -> str:
    """Return the unit of the place that goes with the outputs of a record."""
    column = sensed(record).columns[0]
    powers = dimension(record.output_unit)
    return written(powers | {"s": powers.get("s", 0) + column}) if column else record.output_unit


def force_scale(block) -> float:
    """Return the force that a unit of the input makes at standstill: 1 unless it is voltage or current."""
    scale = 1.0
    for effect in getattr(block, "effects", ()):
        for primitive in effect.channel() if effect.input_unit else ():
            scale *= float(primitive.value(1.0) - primitive.value(0.0))
    return scale


def driving_force(block, record: Measurement, velocity) -> np.ndarray:
    """Return the force of the drive, (n,): the input, or what a motor makes of voltage or current."""
    force = np.asarray(record.u)
    for effect in getattr(block, "effects", ()):
        if effect.input_unit:
            for primitive in effect.channel():
                force = primitive.value(force)
            if effect.law is not None:
                p, z = effect.values, np.zeros(1)
                force = force + np.array([type(effect).law(0.0, 0.0, v, z, p, z) for v in velocity.tolist()])
    return force
