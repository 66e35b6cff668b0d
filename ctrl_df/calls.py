"""Calls that do not fit a signature: what is wrong with them, what the function takes, what was meant."""

from __future__ import annotations

import functools
import inspect
import sys
from collections.abc import Iterable, Mapping
from types import FunctionType
from typing import Any, NoReturn, TypeVar

from .checks import shown
from .nearest import nearest

_Public = TypeVar("_Public")


def unknown_keywords(
    owner: str,
    keywords: Mapping[str, Any],
    known: Iterable[str],
    besides: tuple[str, Iterable[str]] = ("", ()),
    remedy: str = "Leave it out.",
) -> None:
    """Refuse keywords, if there are any, with the names that the owner knows and the nearest of them.

    `besides`: what the owner takes besides, in words, and the names of all that. `remedy`: what to do where
    no name is near.
    """
    if not keywords:
        return
    known = tuple(known)
    given = ", ".join(f"{name}={shown(value)}" for name, value in keywords.items())
    more, names = besides
    near = dict.fromkeys(near for name in keywords for near in nearest(name, (*names, *known)))
    takes = f"it takes {', '.join(known)}{more}" if known else "it takes no keywords"
    meant = f"Did you mean {' or '.join(near)}?" if near else remedy
    raise TypeError(f"{owner} has an unrecognized keyword: {given}; {takes}. {meant}")


def explained(public: _Public, owner: str = "", given: int = 0) -> _Public:
    """Return a function, or a class with its constructors, whose calls say what is wrong with them.

    So do the methods of a class of this package, and those of what such a function returns. Signatures and
    docstrings stay as they are, and a call that fits costs nothing but itself. Of other things (enumerations,
    numbers) nothing is changed.

    Parameters
    ----------
    public : function or class
        A class keeps its identity.
    owner : str
        What a function is called in the message, its name by default.
    given : int
        How many of its first arguments are not the caller's.
    """
    if isinstance(public, FunctionType):
        made = _explained(public, owner or public.__name__, given)
        home = sys.modules.get(public.__module__)
        if getattr(home, public.__name__, None) is public:  # pickle looks it up there
            setattr(home, public.__name__, made)
        return made
    if isinstance(public, type):
        own = _of_this_package(public)
        for name, made in list(vars(public).items()):
            if own and isinstance(made, FunctionType) and not name.startswith("_"):
                setattr(public, name, _explained(made, name, 1))
            elif name == "__init__" and isinstance(made, FunctionType):
                setattr(public, name, _explained(made, public.__name__, 1))
            elif name == "__new__" and isinstance(made, staticmethod):
                setattr(public, name, staticmethod(_explained(made.__func__, public.__name__, 1)))
            elif isinstance(made, classmethod) and not name.startswith("_"):
                setattr(public, name, classmethod(_explained(made.__func__, f"{public.__name__}.{name}", 1)))
    return public


def _explained(function: Any, owner: str, given: int) -> Any:
    if getattr(function, "calls_are_explained", False):
        return function

    @functools.wraps(function)
    def call(*args, **keywords):
        try:
            result = function(*args, **keywords)
        except TypeError as error:
            if error.__traceback__ is None or error.__traceback__.tb_next is not None:
                raise  # from within: the call itself was right
        else:
            _explain_methods(type(result))
            return result
        _refuse(function, owner, given, args[given:], keywords)

    call.calls_are_explained = True  # type: ignore[attr-defined]
    return call


_seen: set[type] = set()  # whose methods are explained


def _explain_methods(cls: type) -> None:
    if cls not in _seen:
        _seen.add(cls)
        for base in cls.__mro__:
            if _of_this_package(base):
                explained(base)


def _of_this_package(cls: type) -> bool:
    return cls.__module__.partition(".")[0] == __name__.partition(".")[0]


def keywords_of(function: Any) -> list[str]:
    """Return the arguments of a function that may be given by name."""
    stated = inspect.signature(function).parameters.values()
    return [p.name for p in stated if p.kind in (p.KEYWORD_ONLY, p.POSITIONAL_OR_KEYWORD)]


def _refuse(function, owner, given, args, keywords) -> NoReturn:
    """Raise what is wrong with a call that Python refused; the first `given` are not the caller's."""
    stated = list(inspect.signature(function).parameters.values())[given:]
    placed = [p.name for p in stated if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)]
    named = keywords_of(function)[given:]
    free = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    needed = [p.name for p in stated if p.default is p.empty and p.kind not in free]
    missing = [name for name in needed if name not in keywords and name not in placed[: len(args)]]
    instead = f"Give {' and '.join(missing)}, which it needs." if missing else "Leave it out."
    unknown_keywords(owner, {k: v for k, v in keywords.items() if k not in named}, named, remedy=instead)
    if len(args) > len(placed):
        rest = [name for name in named if name not in placed]
        remedy = f"Name the others: {', '.join(rest)}." if rest else "Leave the others out."
        places = f"{len(placed)} without a name ({', '.join(placed)})" if placed else "none without a name"
        raise TypeError(f"of its arguments {owner} takes {places}; got {len(args)}. {remedy}")
    for name in placed[: len(args)]:
        if name in keywords:
            raise TypeError(f"{owner} needs {name} once; got it by place and by name. Leave one out.")
    lacks = " and no ".join(missing)
    raise TypeError(f"{owner} needs {', '.join(needed)}; got no {lacks}. Add what is missing.")
