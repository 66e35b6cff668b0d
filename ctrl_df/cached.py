"""Properties that are worked out once, by any number of threads at a time."""

from __future__ import annotations

import functools
from typing import Any, TypeVar

T = TypeVar("T")


class cached_property(functools.cached_property[T]):  # noqa: N801 - in place of functools' own
    """As `functools.cached_property` from Python 3.12 on.

    That of Python 3.11 holds one lock for all instances of a class while it works a value out, so that
    threads wait for each other over different instances. Two that ask one instance at a time may both work
    its value out here.
    """

    def __get__(self, instance: Any, owner: type | None = None) -> Any:
        """Return the value of an instance, kept under the name of the property."""
        if instance is None:
            return self
        known = vars(instance)
        if self.attrname not in known:
            known[self.attrname] = self.func(instance)
        return known[self.attrname]
