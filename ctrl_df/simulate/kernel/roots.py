# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""First root of a power series on an interval: the passage of a margin below zero within a step."""

from __future__ import annotations

import math

from ..compiler.compiled import part
from ..thresholds import BOTTOM_HALVINGS, ROOT_STEPS, ROUNDING, SERIES_LOOKS, TOUCH_HALVINGS


@part(inline=True)
def value_slope(curve, terms, theta):
    """Value and slope of a power series."""
    value, slope = curve[terms], 0.0
    for k in range(terms - 1, -1, -1):
        slope = slope * theta + value
        value = value * theta + curve[k]
    return value, slope


@part(inline=True)
def first_root(curve, terms, upto, scale):
    """First passage of a power series below zero within [0, upto]; 2.0 where there is none."""
    pieces = SERIES_LOOKS
    left, value, slope = 0.0, curve[0], curve[1]
    if value < 0.0:
        return 0.0
    for p in range(1, pieces + 1):
        right = upto * p / pieces
        value_right, slope_right = value_slope(curve, terms, right)
        if value_right >= 0.0 and slope < 0.0 < slope_right:
            # a dip inside the piece
            lowest, value_lowest = _bottom(curve, terms, left, right)
            if value_lowest < 0.0:
                right, value_right = lowest, value_lowest
        if value_right < 0.0:
            if p == 1:
                # a flight or slip that begins here: the margin rises from zero, or from its last digits,
                # before it falls
                for _halving in range(TOUCH_HALVINGS):
                    middle = 0.5 * right
                    value_middle, _slope = value_slope(curve, terms, middle)
                    if value_middle >= 0.0:
                        left, value = middle, value_middle
                        break
                    right, value_right = middle, value_middle
                if left == 0.0 and slope <= 0.0 and value <= ROUNDING * scale:
                    return 0.0
            return _refine(curve, terms, left, value, right, value_right, scale)
        left, value, slope = right, value_right, slope_right
    return 2.0


@part(inline=True)
def _bottom(curve, terms, left, right):
    """Lowest point of a series between a falling and a rising end, by bisection of its slope."""
    best, lowest = left, math.inf
    for _i in range(BOTTOM_HALVINGS):
        middle = 0.5 * (left + right)
        value, slope = value_slope(curve, terms, middle)
        if value < lowest:
            best, lowest = middle, value
        if value < 0.0:
            break
        if slope < 0.0:
            left = middle
        else:
            right = middle
    return best, lowest


@part(inline=True)
def _refine(curve, terms, left, value, right, value_right, scale):
    """Right end of the root between a value >= 0 on the left and one < 0 on the right: Newton kept inside."""
    theta = left + (right - left) * value / (value - value_right)
    for iteration in range(ROOT_STEPS):
        now, slope = value_slope(curve, terms, theta)
        if now < 0.0:
            right, value_right = theta, now
        else:
            left = theta
        if right - left < ROUNDING or value_right > -ROUNDING * scale:
            break
        # a little to the right of the root, so that it is met from beyond
        step = theta - (now + 0.5 * ROUNDING * scale) / slope if slope < 0.0 else left
        if not left < step < right or iteration % 8 == 7:
            step = 0.5 * (left + right)
        theta = step
    return right
