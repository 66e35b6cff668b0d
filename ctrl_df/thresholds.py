"""Numbers that several packages share: what floats, and the memory of a machine, leave no choice about."""

from __future__ import annotations

import math
import sys

EPS = sys.float_info.epsilon
"""Spacing of floats at one, 2.2e-16."""

SQRT_EPS = math.sqrt(EPS)
"""What rounding leaves of a double root, over its size, and of a difference quotient to one side: 1.5e-8."""

FEW_ROUNDED = 64 * EPS
"""Relative error of a sum of a few dozen rounded terms, 1.4e-14."""

ROUNDED = 1e-12
"""Relative error of a sum of many rounded terms: n of them err by n eps at most, this is 4,500."""

HALVINGS = round(-math.log2(EPS)) + 8
"""Halvings of an interval, 60: to the last digit of a place in it that is 1/256 of its length."""

NEWTON_NEAR, NEWTON_FAR = 12, 40
"""Newton's steps at most: from near a solution, where each doubles the digits, so that four lead from one
digit to all sixteen (from a cell of a map of gains four or five were taken, from a neighbour on a fold two in
1,265 of 1,270 cases); and from far off, where steps are cut short (``max_iterations`` by default)."""

NOTHING = 1e-300
"""What quotients are divided by where their divisor may be zero: a normal float (from 2.2e-308 on), and
numbers up to 1e8 over it still are numbers."""

UNIT = 2.0**200
"""Size of the inputs and states that linear maps are asked with: a power of two, so that nothing is rounded,
and so large, 1.6e60, that no constant beside it is seen."""

LARGEST = 2 << 30
"""Memory [bytes] of results that are computed in one go. Beyond it the user is told how to divide the call: a
copy of them, as writing them to a file makes, is to find room in 8 GiB beside all else."""
