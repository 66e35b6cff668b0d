"""The known name that a misspelt one stands for."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

_ALIKE = 0.7  # share of letters in common: lvl is level, foh is not zoh


def nearest(name: str, known: Iterable[str]) -> list[str]:
    """Return the known names that a wrong one may stand for, if any; capital letters do not count.

    With the name of an owner before it (``plant.mass``), or without that of a part (``coulomb``), it stands
    for what it has in common with a known one; else for the one that is spelt most like it.
    """
    lower = {str(k).lower(): k for k in known}
    given = name.lower()
    alike = [k for k in lower if given.endswith(f".{k}") or k.startswith(f"{given}.")]
    return [lower[k] for k in alike or difflib.get_close_matches(given, lower, 1, _ALIKE)]


def did_you_mean(name, known: Iterable[str], otherwise: str = "") -> str:
    """Return the question which known name was meant, after a space; where none is near, what else to do."""
    near = nearest(name, known) if isinstance(name, str) else []
    text = f"Did you mean {' or '.join(near)}?" if near else otherwise
    return f" {text}" if text else ""
