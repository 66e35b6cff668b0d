"""Parameters as a solver sees them: scaled, logarithmic where they keep their sign, kept in their bounds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...blocks.mechanism import Mechanism
from ...blocks.primitives import Ramp
from ...units import dimension, size
from ..prediction.segments import Facts, facts
from ..prediction.sensed import POSITION, sensed
from ..prediction.values import in_record
from .thresholds import LOG_MOST, NATURAL, NO_SIZE, OPEN_BOUND, PLACE_NOISE, SIZE_PRIOR, TIME_SAMPLES


@dataclass(frozen=True)
class RecordScales:
    """What records can show of an effect.

    Attributes
    ----------
    force, position, speed, mass : float
        Typical sizes [N], [m], [m/s], [kg].
    dt, duration : float
        Shortest sample time and longest record [s].
    lowest, highest : float
        Places between which the body has been, beyond noise [m]; inf and -inf where the sensor tells others.
    """

    force: float
    position: float
    speed: float
    mass: float
    dt: float
    duration: float
    lowest: float = math.inf
    highest: float = -math.inf

    @property
    def reach(self) -> float:
        """Farthest place where the body has been [m]; -inf where the sensor tells other places."""
        return max(self.highest, -self.lowest)

    @property
    def stroke(self) -> float:
        """How far apart the places are where the body has been [m]; nothing is known below zero."""
        return self.highest - self.lowest


def seen_by(block, records, sizes) -> RecordScales:
    """Return what the records show of the effects of a block.

    `sizes`: typical force, position and speed, of one record (`Facts`) or of all (`scales.Scales`).
    """
    force, position, speed = sizes.force, sizes.position, sizes.speed
    return RecordScales(
        force, position, speed, typical_mass(block, force, position, speed), min(r.dt for r in records),
        max(r.duration for r in records), *_places_seen(block, records),
    )  # fmt: skip


def _places_seen(block, records) -> tuple[float, float]:
    """Return the places between which a body has been, beyond noise [m]; (inf, -inf): they are not told."""
    known = [facts(r) for r in records]
    placed = known[0].imposed or all(POSITION in sensed(r).columns for r in records)
    shifted = any(isinstance(p, Ramp) for e in block.effects if e.role == "output" for p in e.channel())
    if shifted or not placed:
        return math.inf, -math.inf
    off = 0.0 if known[0].imposed else PLACE_NOISE * known[0].noise
    places = [k.place for k in known]
    return min(float(np.min(x)) for x in places) + off, max(float(np.max(x)) for x in places) - off


def total_inertia(block) -> float:
    """Return the mass of all bodies of a block; 0 of one without."""
    return sum(p.value for k, p in block.parameters.items() if "." not in k)


def typical_mass(block, force: float, position: float, speed: float) -> float:
    """Return the mass of a block; of one without, that whose inertia the force is [kg]."""
    return total_inertia(block) or force * position / speed**2


def default_free(block) -> tuple[str, ...]:
    """Return the parameters that a refit moves by default."""
    return tuple(k for k, p in block.parameters.items() if p.free and not p.stepped)


def step_of_sensor(block) -> str | None:
    """Return the name of the step of a block's sensor that rounds; None where it has none."""
    return next((k for k, p in getattr(block, "parameters", {}).items() if p.stepped), None)


class Variable:
    """One parameter: physical value p, scaled value q; those of one sign on a logarithmic scale.

    `begin`: where it begins; of a parameter that every record has for itself, in one of them.
    """

    def __init__(self, name, parameter, natural, limits=None, begin=None):
        self.name, self.begin = name, parameter.value if begin is None else begin
        self.lower, self.upper = parameter.lower, parameter.upper
        # Bounded on both sides (a share, a restitution): linear. Of one sign: logarithmic.
        self.log = parameter.one_sign
        self.natural = natural
        if parameter.strict and not self.log:
            self.lower = parameter.lower + OPEN_BOUND
        if limits is not None:
            self.lower, self.upper = max(self.lower, limits[0]), min(self.upper, limits[1])
        # of the value that it can have, where it begins; one that is next to nothing says nothing of a size
        size = abs(min(max(self.begin, self.lower), self.upper))
        if self.log:
            size = math.copysign(size, self.begin)
        self.scale = size if self.log or size > NO_SIZE * natural else natural
        # a share is bounded on both sides: its natural size is all of its range, and far steps miss minima
        self.reach = 0.0 if math.isfinite(parameter.lower) and math.isfinite(parameter.upper) else natural

    def q(self, p: float) -> float:
        """Return the scaled value of a physical one."""
        return math.log(p / self.scale) if self.log else p / self.scale

    def p(self, q: float) -> float:
        """Return the physical value of a scaled one."""
        if self.log:
            return self.scale * math.exp(min(max(q, -LOG_MOST), LOG_MOST))
        return min(max(q * self.scale, self.lower), self.upper)

    def clip(self, q: float) -> float:
        """Return the scaled value within the bounds nearest to `q`."""
        if self.log:
            near, far = (self.lower, self.upper) if self.scale > 0 else (self.upper, self.lower)
            low = self.q(near) if near / self.scale > 0 else -math.inf
            return min(max(q, low), self.q(far) if math.isfinite(far) else math.inf)
        return min(max(q, self.lower / self.scale), self.upper / self.scale)

    def has_room(self, q: float, move: float) -> bool:
        """Whether a bound leaves room for a move; what stands on one is off it by rounding."""
        return abs(self.clip(q + move) - q) > 0.5 * abs(move)

    def slope(self, q: float) -> float:
        """Return dp/dq."""
        return self.p(q) if self.log else self.scale

    def step(self, q: float) -> float:
        """Return the largest move of one iteration: a factor of e, or a size, its own or the natural one."""
        return 1.0 if self.log else max(abs(q), 1.0, self.reach / abs(self.scale))


def variables_of(block, names, records, known: Facts, limits=None, own=frozenset()) -> list[Variable]:
    """Return the named parameters of a block as variables, with scales natural on these records.

    `limits`, a mapping of names to (least, largest), narrows their ranges. Those of `own` are as many
    variables as there are records, one after the other.
    """
    if not names:
        return []
    table = block.parameters
    spans = dict(limits or {})
    if isinstance(block, Mechanism):
        seen = seen_by(block, records, known)
        for key, effect in block.named_effects.items():
            for name, (low, high) in effect.bounds(seen).items():
                least, most = spans.get(f"{key}.{name}", (-math.inf, math.inf))
                spans[f"{key}.{name}"] = max(least, low), min(most, high)
    return [
        Variable(k, table[k], natural_scale(table[k].line_unit, known), spans.get(k), begin)
        for k in names
        for begin in ([in_record(table[k].value, r.name) for r in records] if k in own else [table[k].value])
    ]


class Prior(NamedTuple):
    """What is known of a parameter before any data: about where it lies, and its standard deviation.

    Both in its unit; None for one that nobody has stated: the value may be off by a factor, `SIZE_PRIOR`.
    """

    value: float
    std: float | None = None


def priors(block, stated: Mapping[str, tuple[float, float | None]] | None = None) -> dict[str, Prior]:
    """Return what is known of the parameters of a block, and what is stated of some, by name."""
    of_block = {k: Prior(p.value) for k, p in block.parameters.items()}
    return of_block | {k: Prior(*known) for k, known in (stated or {}).items()}


def beforehand(variables, about: Mapping[str, Prior]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what is known of scaled parameters before any data: about where they lie, one over variance.

    The third array has the latter of those whose standard deviation is stated, else 0. Of parameters that
    `about` does not have nothing is known, and their variance is infinite.
    """
    means, precisions, stated = np.zeros((3, len(variables)))
    for i, v in enumerate(variables):
        value, std = about.get(v.name, Prior(math.nan))
        if math.isnan(value) or (v.log and value / v.scale <= 0):
            continue
        means[i] = v.q(value)
        if std is not None:
            stated[i] = precisions[i] = (v.slope(means[i]) / std) ** 2
        else:
            spread = math.log(SIZE_PRIOR) if v.log else SIZE_PRIOR * max(abs(value), v.natural) / v.scale
            precisions[i] = 1 / spread**2
    return means, precisions, stated


def typical(unit: str, force: float, position: float, time: float, mass: float, drive: float) -> float:
    """Return the typical size of what has this unit; `drive`: of an input in volts or amperes."""
    return size(unit, {"N": force, "m": position, "s": time, "kg": mass, "V": drive, "A": drive})


def natural_scale(unit: str, known: Facts) -> float:
    """Return the size a parameter of this unit has when it matters on a record with these facts."""
    powers = dimension(unit)
    if powers == {"s": 1}:
        return TIME_SAMPLES * known.dt  # times are seen from a few samples on
    if powers.keys() <= {"rad"}:
        return 1.0
    time = known.position / known.speed
    mass = known.force * time**2 / known.position
    whole = typical(unit, known.force, known.position, time, mass, known.drive)
    return whole if powers == {"kg": 1} else NATURAL * whole
