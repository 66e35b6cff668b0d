"""Calls that do not fit a signature: what is wrong with them, what the function takes, what was meant."""

from __future__ import annotations

import difflib
import functools
import inspect
import sys
from collections.abc import Iterable, Mapping
from types import FunctionType
from typing import Any, NoReturn, TypeVar

from .checks import shown

_Public = TypeVar("_Public")


def unknown_keywords(owner: str, keywords: Mapping[str, Any], known: Iterable[str]) -> None:
    """Refuse keywords, if there are any, with the names that the owner knows and the nearest of them."""
    if not keywords:
        return
    known = tuple(known)
    given = ", ".join(f"{name}={shown(value)}" for name, value in keywords.items())
    near = dict.fromkeys(near for name in keywords for near in nearest(name, known))
    takes = f"it takes {', '.join(known)}" if known else "it takes no keywords"
    meant = f"Did you mean {' or '.join(near)}?" if near else "Leave it out."
    raise TypeError(f"{owner} has an unrecognized keyword: {given}; {takes}. {meant}")


def nearest(name: str, known: Iterable[str]) -> list[str]:
    """Return the known name that a misspelt one stands for, if any; capital letters do not count."""
    lower = {k.lower(): k for k in known}
    return [lower[k] for k in difflib.get_close_matches(name.lower(), lower, 1)]


def explained(public: _Public, owner: str = "", given: int = 0) -> _Public:
    """Return a function, or a class with its constructors, whose calls say what is wrong with them.

    Signatures and docstrings stay as they are, and a call that fits costs nothing but itself. Of other things
    (enumerations, numbers) nothing is changed.

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
        for name, made in list(vars(public).items()):
            if name == "__init__" and isinstance(made, FunctionType):
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
            return function(*args, **keywords)
        except TypeError as error:
            if error.__traceback__ is None or error.__traceback__.tb_next is not None:
                raise  # from within: the call itself was right
        _refuse(function, owner, given, args[given:], keywords)

    call.calls_are_explained = True  # type: ignore[attr-defined]
    return call


def keywords_of(function: Any) -> list[str]:
    """Return the arguments of a function that may be given by name."""
    stated = inspect.signature(function).parameters.values()
    return [p.name for p in stated if p.kind in (p.KEYWORD_ONLY, p.POSITIONAL_OR_KEYWORD)]


def _refuse(function, owner, given, args, keywords) -> NoReturn:
    """Raise what is wrong with a call that Python refused; the first `given` are not the caller's."""
    stated = list(inspect.signature(function).parameters.values())[given:]
    placed = [p.name for p in stated if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)]
    named = keywords_of(function)[given:]
    unknown_keywords(owner, {k: v for k, v in keywords.items() if k not in named}, named)
    if len(args) > len(placed):
        rest = [name for name in named if name not in placed]
        remedy = f"Name the others: {', '.join(rest)}." if rest else "Leave the others out."
        places = f"{len(placed)} without a name ({', '.join(placed)})" if placed else "none without a name"
        raise TypeError(f"of its arguments {owner} takes {places}; got {len(args)}. {remedy}")
    for name in placed[: len(args)]:
        if name in keywords:
            raise TypeError(f"{owner} needs {name} once; got it by place and by name. Leave one out.")
    free = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    needed = [p.name for p in stated if p.default is p.empty and p.kind not in free]
    missing = [name for name in needed if name not in keywords and name not in placed[: len(args)]]
    lacks = " and no ".join(missing)
    raise TypeError(f"{owner} needs {', '.join(needed)}; got no {lacks}. Add what is missing.")
