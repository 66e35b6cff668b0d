"""What `describing_function` says where a number alone would mislead."""

from __future__ import annotations

import numpy as np

from ..checks import warn


class DescribingFunctionWarning(RuntimeWarning):
    """N is NaN, interpolated, or that of a motion that repels, travels or has no period.

    Examples
    --------
    >>> import warnings
    >>> with warnings.catch_warnings(record=True) as said:
    ...     warnings.simplefilter("always")
    ...     N = cdf.describing_function(cdf.friction_mass(mass=9, coulomb=5), 4.0, 10.0)  # too weak
    >>> said[0].category.__name__
    'DescribingFunctionWarning'
    """


_MEANING = {
    "stuck": "nothing moves",
    "resonance": "undamped and driven at its natural frequency, its oscillation grows without bound",
    "diverged": "the state runs away",
    "work limit": "the motion had not settled when the bound on work was reached",
    "aperiodic": "the motion has no period: N is an average",
    "drifting": "the motion travels steadily besides oscillating: N leaves the travel out",
    "unstable": "the forced motion repels: N belongs to a motion that no run shows",
}


IRREGULAR = ("aperiodic",)
"""Regimes without a period, where N is an average all the same."""

RESERVED = (*IRREGULAR, "drifting", "unstable")
"""Regimes whose N has to be read with a reservation."""


def warn_of(
    N, regime, A, omega, *, regimes=RESERVED, missing=True, look_at="describing_function_family(...)"
) -> None:
    """Warn, once for all, of the regimes that N does not describe, or does so only with a reservation.

    Parameters
    ----------
    N : ndarray of complex
    regime : ndarray of str, the shape of N
    A, omega : ndarray broadcast to that shape; omega may be None
    regimes : sequence of str
        Those that are told of.
    missing : bool
        Whether points without N are told of, too.
    look_at : str
        What has more to say.
    """
    N, regime = np.asarray(N), np.asarray(regime)
    lost = np.isnan(N)
    doubtful = np.isin(regime, regimes) & ~lost | (lost & missing)
    if not doubtful.any():
        return
    said = []
    for name in np.unique(regime[doubtful]):
        mine = doubtful & (regime == name)
        first = tuple(np.argwhere(mine)[0])
        at = f"A={float(np.broadcast_to(A, N.shape)[first]):g}"
        if omega is not None:
            at += f", omega={float(np.broadcast_to(omega, N.shape)[first]):g}"
        outcome = _MEANING.get(str(name), "there is no periodic answer")
        points = f"{int(mine.sum())} of {N.size} points"
        said.append(f"{name or 'unknown'} at {points}, first {at} ({outcome}{_nan(lost[mine])})")
    warn(
        f"the describing function is not that of a settled periodic motion everywhere: {'; '.join(said)}. "
        f"Look at {look_at}.regime and .residual before using N there.",
        DescribingFunctionWarning,
    )


def _nan(missing) -> str:
    return "; N is NaN" if missing.all() else ""
