"""Systems of python-control whose numbers stay as they were made."""

from __future__ import annotations

from typing import Any, NoReturn

import control as ct

from ..checks import shown


class FixedParameters(dict):
    """The ``params`` of a block, read like any dictionary; `copy` returns one that can be changed."""

    def _refuse(self, *args, **_) -> NoReturn:
        got = f"params[{shown(args[0])}] = {shown(args[1])}" if len(args) == 2 else "a change of its params"
        raise TypeError(
            f"a block is a value, whose parameters stay; got {got}. Make another, "
            "block.with_parameters({name: value}), or give params={name: value} to the call that simulates."
        )

    __setitem__ = __delitem__ = __ior__ = update = setdefault = pop = popitem = clear = _refuse  # pyright: ignore

    def copy(self) -> dict[str, Any]:
        """Return a dictionary of one's own."""
        return dict(self)

    def __reduce__(self):
        return type(self), (dict(self),)


class Immutable(ct.NonlinearIOSystem):
    """A system whose laws and parameters are given once; names, its own and of signals, may be changed."""

    _GIVEN_ONCE = ("params", "updfcn", "outfcn")

    def __setattr__(self, name: str, value: Any) -> None:
        if name in self._GIVEN_ONCE:
            if vars(self).get(name) is not None:
                raise AttributeError(
                    f"a block is a value, whose {name} stays; got {name}={shown(value)}. Make another: "
                    "with_parameters, with_effect, or ct.nlsys for laws of your own."
                )
            value = FixedParameters(value) if name == "params" else value
        super().__setattr__(name, value)
