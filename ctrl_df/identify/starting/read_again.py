"""The model's own laws read off the motion once more: a refit without what is missing bends them away.

A ripple of the model may slip by a period while something else is missing, and no fit of that comes back over
the periods between. The motion as it was measured tells the ripple whatever else acts (`ripple_spectrum`).
"""

from __future__ import annotations

from ...blocks.effect import Effect
from ..estimation.segmented import SegmentedData
from .screen import Screen


def read_again(block, data: SegmentedData) -> dict[str, float]:
    """Return values of a model's parameters as its classes regress them, each in the model without its law.

    Of laws whose fits have many minima alone: all others a fit finds from anywhere. Only a single body makes
    it possible.
    """
    values: dict[str, float] = {}
    if block.core.bodies != 1:
        return values
    for key, effect in block.named_effects.items():
        if effect.multimodal and regresses(type(effect)):
            values |= _read(block.without_effect(key), effect, key, data)
    return values


def regresses(cls) -> bool:
    """Whether a class has a regression of its own."""
    return cls.regress.__func__ is not Effect.regress.__func__


def _read(without, effect, key: str, data: SegmentedData) -> dict[str, float]:
    """Return the parameters of an effect, and of the model without it, that explain most of the motion."""
    screen = Screen(data.fit(without, (), iterations=0), data)
    found = next(iter(type(effect).regress(screen)), None)
    if found is None:
        return {}
    read, beside = found
    return {**beside, **{f"{key}.{k}": p.value for k, p in read.parameters.items() if p.estimated}}
