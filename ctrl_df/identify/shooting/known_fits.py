"""Fits made before: what is asked again is not fitted again.

A search that is repeated without a candidate that long horizons refute asks for most of its fits once more,
and a ladder for those of its last step. A fit follows from what it is asked alone.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from .thresholds import KNOWN_BYTES


class KnownFits:
    """The fits made for one question, those asked for last; empty again in another process.

    A fit tells its size (`bytes`), and whether the limit of its error has ended it (`given_up`).
    """

    def __init__(self):
        # those asked for last at the end; an OrderedDict would hash every key anew to sum its values
        self._found: dict[Hashable, tuple[Any, float, int]] = {}
        self._lock = threading.Lock()

    def __reduce__(self):
        return KnownFits, ()

    def of(self, asked: Hashable, give_up: float, fit: Callable[[], Any]) -> Any:
        """Return the fit that answers what is asked, made now unless it is known.

        `give_up`: error above which it is of no use. A fit that this has not ended is the same for any larger
        limit.
        """
        with self._lock:
            known = self._found.pop(asked, None)
            if known is not None:
                self._found[asked] = known
                found, limit, _ = known
                if give_up == limit or (give_up > limit and not found.given_up):
                    return found
        found = fit()
        with self._lock:
            self._keep(asked, found, give_up)
        return found

    def _keep(self, asked: Hashable, found: Any, give_up: float) -> None:
        before, *_ = self._found.get(asked, (None,))
        if found.bytes > KNOWN_BYTES or (found.given_up and before and not before.given_up):
            return  # one that went on to its end answers more
        self._found.pop(asked, None)
        self._found[asked] = found, give_up, found.bytes
        while sum(size for *_, size in self._found.values()) > KNOWN_BYTES:
            del self._found[next(iter(self._found))]


def by_value(thing: Any) -> Hashable:
    """Return what is equal for two things of equal values: arrays, mappings, and whatever holds them."""
    if isinstance(thing, np.ndarray):
        return thing.shape, thing.dtype.str, thing.tobytes()
    if is_dataclass(thing) and type(thing).__eq__ is not object.__eq__:
        return type(thing), tuple(by_value(getattr(thing, f.name)) for f in fields(thing))
    if isinstance(thing, Mapping):
        return tuple(sorted((k, by_value(v)) for k, v in thing.items()))
    if isinstance(thing, (tuple, list)):
        return tuple(by_value(v) for v in thing)
    return thing
