"""Systems of python-control whose numbers stay as they were made."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NoReturn

import control as ct

from ..checks import shown


class FixedParameters(dict):
    """The ``params`` of a block, read like any dictionary; `copy` returns one that can be changed."""

    def _refuse(self, *args, **_) -> NoReturn:
        got = f"params[{shown(args[0])}] = {shown(args[1])}" if len(args) == 2 else "a change of its params"
        raise TypeError(
            f"the parameters of a block cannot be changed; got {got}. Make another block, "
            "block.with_parameters({name: value}), or give params={name: value} to the call that simulates."
        )

    __setitem__ = __delitem__ = __ior__ = update = setdefault = pop = popitem = clear = _refuse  # pyright: ignore

    def copy(self) -> dict[str, Any]:
        """Return a dictionary of one's own."""
        return dict(self)

    def __reduce__(self):
        return type(self), (dict(self),)


class _GivenOnce:
    """An attribute that is set once; reading it takes no longer than reading any other."""

    def __init__(self, kept: Callable[[Any], Any] = lambda value: value):
        self.kept = kept

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __set__(self, block: Any, value: Any) -> None:
        given = vars(block).get(self.name)
        # python-control writes sizes again with the names of signals
        if given is not None and not (isinstance(given, int) and value == given):
            raise AttributeError(
                f"{self.name} of a block cannot be changed; got {self.name}={shown(value)}. Make another "
                "block: with_parameters, with_effect, or ct.nlsys for laws of your own."
            )
        vars(block)[self.name] = self.kept(value)


class Immutable(ct.NonlinearIOSystem):
    """A system whose laws and parameters are given once; names, its own and of signals, may be changed."""

    def __init__(self, *args, name=None, **keywords):
        super().__init__(*args, name=name, **keywords)
        self._numbered = self.name if name is None else None

    @property
    def given_name(self) -> str | None:
        """Its name, if it was given one; None: python-control numbered it.

        Equal blocks have equal ones: python-control tells the systems that it connects apart by that.
        """
        return None if self.name == self._numbered else self.name

    @property
    def _called(self) -> dict[str, str | None]:
        """What it is called, and whether python-control numbered it, as pickles keep it."""
        return {"name": self.name, "_numbered": self._numbered}

    def __setattr__(self, name: str, value: Any) -> None:
        made = "_numbered" in vars(self)
        if made and not name.startswith("_") and name not in vars(self) and not hasattr(type(self), name):
            raise AttributeError(
                f"a block takes no further attributes; got {name}={shown(value)}. Keep it outside "
                "the block, or make another with with_parameters or with_effect."
            )
        super().__setattr__(name, value)

    nstates: Any = _GivenOnce()
    ninputs: Any = _GivenOnce()
    noutputs: Any = _GivenOnce()
    params: Any = _GivenOnce(FixedParameters)
    updfcn: Any = _GivenOnce()
    outfcn: Any = _GivenOnce()
