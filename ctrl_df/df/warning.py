"""What `describing_function` says where a number alone would mislead."""

from __future__ import annotations

import warnings

import numpy as np


class DescribingFunctionWarning(RuntimeWarning):
    """N is NaN, or that of a motion that repels, travels or has no period.

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


def warn_of(N, regime, A, omega, stacklevel: int = 3) -> None:
    """Warn once for every regime that N does not describe, or does so only with a reservation.

    Parameters
    ----------
    N : ndarray of complex
    regime : ndarray of str, the shape of N
    A, omega : ndarray broadcast to that shape; omega may be None
    """
    N, regime = np.asarray(N), np.asarray(regime)
    missing = np.isnan(N)
    doubtful = missing | np.isin(regime, ["aperiodic", "drifting", "unstable"])
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
        said.append(f"{name or 'unknown'} at {points}, first {at} ({outcome}{_nan(missing[mine])})")
    warnings.warn(
        f"the describing function is not that of a settled periodic motion everywhere: {'; '.join(said)}. "
        "Look at describing_function_family(...).regime and .residual before using N there.",
        DescribingFunctionWarning,
        stacklevel=stacklevel,
    )


def _nan(missing) -> str:
    return "; N is NaN" if missing.all() else ""
