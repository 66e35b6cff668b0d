"""Channels that a periodic motion passes unchanged but for a shift: pure delays, offsets, drift."""

from __future__ import annotations

from typing import NamedTuple

from ..blocks.mechanism import Mechanism
from ..blocks.primitives import Delay, Quantizer, Ramp


class Opened(NamedTuple):
    """A mechanism without its transparent channels, and what they do to a periodic answer.

    Attributes
    ----------
    block : Mechanism
    delay : float
        By how much every output is late [s].
    sensor_delay, sensor_offset : float
        By how much the position is late besides [s], and what is added to it.
    """

    block: Mechanism
    delay: float = 0.0
    sensor_delay: float = 0.0
    sensor_offset: float = 0.0


def without_delays(block: Mechanism) -> Opened:
    """Take out effects that are pure delays."""
    return _without(block, lambda primitive: isinstance(primitive, Delay))


def without_shifts(block: Mechanism) -> Opened:
    """Take out effects that are pure delays, drifts, or offsets; the last not where the sensor rounds.

    A drift has no share in a periodic answer; an offset moves where a sensor rounds.
    """
    rounded = any(isinstance(p, Quantizer) for e in block.effects if e.role == "output" for p in e.channel())

    def shifts(primitive):
        if isinstance(primitive, Ramp):
            return primitive.rate != 0 or not rounded
        return isinstance(primitive, Delay)

    return _without(block, shifts)


def _without(block, taken) -> Opened:
    kept, delays, offset = [], {"input": 0.0, "output": 0.0}, 0.0
    for effect in block.effects:
        channel = effect.channel() if effect.role in delays else ()
        if not channel or not all(map(taken, channel)):
            kept.append(effect)
            continue
        for primitive in channel:
            if isinstance(primitive, Delay):
                delays[effect.role] += primitive.delay
            else:
                offset += primitive.offset
    if len(kept) == len(block.effects):
        return Opened(block)
    return Opened(block.with_effects(kept), delays["input"], delays["output"], offset)
