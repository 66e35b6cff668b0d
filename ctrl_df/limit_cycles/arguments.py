"""What the searches for exact orbits may be asked: numbers of the right kind, a guess that can be one."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

from ..checks import count, flag, positive, real_array, shown


def checked_guess(loop, guess: Any) -> Any:
    """Return a guess as it is meant: a cycle, a pair (amplitude, omega), or the state as an array."""
    if guess is None or not isinstance(loop, ct.NonlinearIOSystem):
        return guess
    n = loop.nstates or 0
    if hasattr(guess, "amplitude"):
        known = len(getattr(guess, "states", ()))
        if known and known != n:
            raise TypeError(
                f"an orbit given as a guess must have the {n} states of the loop; got one with {known}, of "
                "another loop. Give its (amplitude, omega) instead."
            )
        return guess
    wrong = (
        "a guess must be a predicted limit cycle, an orbit, a pair (amplitude, omega), or a state as an "
        f"array of shape ({n},); got {shown(guess)}."
    )
    try:
        values = real_array("find_limit_cycle", "guess", guess)
    except TypeError:
        raise TypeError(wrong) from None
    if isinstance(guess, np.ndarray) and values.shape == (n,):
        return values
    if values.shape not in ((2,), (n,)):
        raise TypeError(wrong)
    if values.shape != (2,):
        return values
    amplitude, omega = values.tolist()
    if not (0 < amplitude < np.inf and 0 < omega < np.inf):
        raise ValueError(
            "a guess needs amplitude > 0 and omega > 0 [rad/s], both finite; got "
            f"({amplitude:g}, {omega:g}). Leave the guess out to search."
        )
    return amplitude, omega


def check_search(owner: str, *, max_iterations: Any = 1, search_time: Any = None, **flags: Any) -> None:
    """Check the bounds of a search, and that its flags are True or False."""
    count(owner, "max_iterations", max_iterations, meaning="bound on Newton steps")
    if search_time is not None:
        positive(
            owner, "search_time", search_time, "s", infinite=True, meaning="longest simulation of the search",
            remedy="Leave it out for some hundred periods.",
        )  # fmt: skip
    for name, value in flags.items():
        flag(owner, name, value)
