"""Numbers and lists as people write them, in sentences, tables and labels."""

from __future__ import annotations

import math

_LARGEST = 1e6
_SMALLEST = 1e-3
SMALLEST_P = 1e-6
"""Probabilities below are said to be smaller than this."""


def digits(value: float, count: int = 3) -> str:
    """Return a number to so many significant digits, without an exponent below a million.

    Examples
    --------
    >>> from ctrl_df.numerals import digits
    >>> digits(2000.0), digits(484.6, 2), digits(0.01234), digits(3.2e7)
    ('2000', '480', '0.0123', '3.2e+07')
    """
    text = f"{value + 0.0:.{count}g}"
    return f"{float(text):.0f}" if "e+" in text and abs(value) < _LARGEST else text


def percent(share: float) -> str:
    """Return a share in percent, to two decimals, or to two digits where these say too little.

    Examples
    --------
    >>> from ctrl_df.numerals import percent
    >>> percent(0.1234), percent(0.00017), percent(0.0)
    ('12.34%', '0.017%', '0.00%')
    """
    if not math.isfinite(share):
        return "–"
    return f"{share:.2%}" if share == 0 or abs(share) >= _SMALLEST else f"{digits(100 * share, 2)}%"


def probability(p: float) -> str:
    """Return a probability as `` = 0.02`` or `` < 1e-6``, to stand behind its letter."""
    return f" < {SMALLEST_P:g}" if p < SMALLEST_P else f" = {p:.2g}"


def certainty(p: float) -> str:
    """Return how sure something is, in percent; nothing is said to be quite so.

    Examples
    --------
    >>> from ctrl_df.numerals import certainty
    >>> certainty(0.974), certainty(0.99999)
    ('97.4%', '> 99.9%')
    """
    text = f"{p:.1%}"
    return "> 99.9%" if text == "100.0%" else text


def listed(names) -> str:
    """Return names in a row, the last behind an "and".

    Examples
    --------
    >>> from ctrl_df.numerals import listed
    >>> listed(["mass", "gain", "level"])
    'mass, gain and level'
    """
    *some, last = names
    return f"{', '.join(some)} and {last}" if some else last
