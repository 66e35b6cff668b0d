"""Start values for every effect: its class's own, read off the data, or sizes from small to large."""

from __future__ import annotations

import dataclasses
import itertools

from .thresholds import PROPORTIONAL_SIZES, SIZES


def proposals(cls, screen) -> list:
    """Return effects of one class to begin with: those it suggests to a `Screen`, or sizes of all kinds.

    Of a class that usually acts on the load they are proposed on both sides of a joint.
    """
    own = cls.suggest(screen)
    found = list(_generic(cls, screen) if own is None else own)
    if screen.block.core.loose and cls.usual_side == "load" != cls.side:
        found += [effect.replace(side="load") for effect in found]
    return found


def _generic(cls, screen):
    """Yield the effect with its main parameter from small to large, others at default or typical size."""
    values, main = {}, None
    for f in dataclasses.fields(cls):
        spec = f.metadata.get("parameter")
        if spec is None:
            continue
        if main is None:
            main = (f.name, spec)
        elif f.default is dataclasses.MISSING:
            values[f.name] = screen.scales.of(spec["unit"])
    if main is None:
        yield cls()
        return
    name, spec = main
    usual = screen.scales.of(spec["unit"])
    sizes = PROPORTIONAL_SIZES if cls.proportional else SIZES
    signs = (1.0, -1.0) if spec["lower"] < 0 and not cls.proportional else (1.0,)
    for size, sign in itertools.product(sizes, signs):
        try:
            yield cls(**{name: sign * size * usual, **values})
        except ValueError:
            continue
