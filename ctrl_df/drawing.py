"""The one way up: what a result is asked for that only packages above it can do, such as its picture.

Every import of the package runs downwards, so that no computation depends on matplotlib. A result knows the
name of what it is asked for and nothing else; `ctrl_df/__init__.py` hands down how the function that does it
is found (`handlers.py`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .calls import explained

_find: Callable[[str], Callable[..., Any]]


def install(find: Callable[[str], Callable[..., Any]]) -> None:
    """State how the function is found that does what a name stands for."""
    global _find
    _find = find


def draw(picture: str, result, **keywords) -> Any:
    """Draw a result.

    Parameters
    ----------
    picture : str
        A name that `ctrl_df.handlers.handler` knows.
    result : object
        What the function of `ctrl_df.plot` takes first.
    **keywords
        Its other arguments.

    Returns
    -------
    ct.ControlPlot
    """
    return explained(_find(picture), "plot", given=1)(result, **keywords)


def go_on(step: str, result, *arguments) -> Any:
    """Ask a result or an element for more: `step`, a name; `arguments`: further ones of its function."""
    return _find(step)(result, *arguments)
