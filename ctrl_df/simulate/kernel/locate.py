# pyright: reportCallIssue=false
# (numba's stubs know neither its private options nor the arguments of an intrinsic)
"""Where an event lies inside a step: margins, their tolerances, the first one to cross zero."""

from __future__ import annotations

import math

from ...thresholds import EPS, ROUNDED
from ..compiler.compiled import part
from ..dynamics.flow import input_rates, rates
from ..dynamics.mechanics import closed, dry_level_at
from ..program.layout import (
    A_BODIES,
    A_CONTACT,
    A_JOINT,
    A_STOP,
    AUX,
    G_BODY1,
    G_JOINT_HIGH,
    G_JOINT_LOW,
    G_WALL_HIGH,
    G_WALL_LOW,
    H_TRACK,
    J_IMPACT,
    JOINT,
    KIND,
    MECHANISM,
    MODE,
    NG,
    P_BUMP0,
    P_GAP,
    P_HIGH,
    P_LOW,
    PAR,
    PLAY,
    PWA,
    QUANTIZER,
    RATE,
    STUCK,
    TOUCH,
    G,
    X,
)
from ..thresholds import (
    BISECTED,
    BUMP_REACH,
    INPUT_REACH,
    LOOKS,
    LOOKS_POWER,
    ROOT_STEPS,
    ROUNDING,
    TOUCH_CLOSER,
    TOUCH_HALVINGS,
    TOUCH_STEPS,
)
from .stepper import inside

NOW, FIRST, SECOND, QUANTITY = range(4)  # rows of the scales of margins, see `renewed`


@part
def margins(prog, drive, segment, t, x, mode, work, dx, g, reach, watch, watch_level, watch_sign):
    """Rates and all margins at one point, those of input rates and of the section included."""
    rates(prog, drive, segment, t, x, mode, work, dx, g, True)
    complete(prog, drive, segment, t, x, mode, work, dx, g, reach, watch, watch_level, watch_sign)


@part
def complete(prog, drive, segment, t, x, mode, work, dx, g, reach, watch, watch_level, watch_sign):
    """Add to the margins that go with rates those of input rates and of the section."""
    last = g.shape[0] - 1
    # the signals stand in the work vector since the rates were taken
    g[last] = watch_sign * (work[0][watch] - watch_level) if watch >= 0 else math.inf
    if prog.ints[H_TRACK] == 1:
        input_rates(prog, drive, segment, t, x, mode, work, dx, reach, g)


@part(inline=True)
def worst(g, gtol, scale, blocked):
    """Smallest margin, relative to its scale, and its index."""
    value, index = 1.0, -1
    for i in range(g.shape[0]):
        if i != blocked:
            v = (g[i] + gtol[i]) / scale[i]
            if v < value:
                value, index = v, i
    return value, index


@part(inline=True)
def tolerances(prog, x, mode, scale, gtol):
    """Write how far below zero each margin may be before it counts as crossed.

    A margin compares numbers that are rounded: positions far from zero, a corner of a saturation. What their
    last digits make of it is no crossing. `scale` as in `renewed`.
    """
    for i in range(gtol.shape[0]):
        gtol[i] = ROUNDED * scale[NOW, i] + ROUNDING * scale[int(scale[QUANTITY, i]), i]
    for n in range(prog.nodes.shape[0]):
        kind, first, go, po = prog.nodes[n, KIND], prog.nodes[n, X], prog.nodes[n, G], prog.nodes[n, PAR]
        if kind == MECHANISM:
            if prog.ints[prog.nodes[n, AUX] + A_BODIES] == 2:
                rounding = ROUNDING * (abs(x[first]) + abs(x[first + 2]))
                gtol[go + G_JOINT_LOW] += rounding
                gtol[go + G_JOINT_HIGH] += rounding
            for b in range(prog.ints[prog.nodes[n, AUX] + A_BODIES]):
                if mode[prog.nodes[n, MODE] + b] == STUCK:
                    place = x[first + 2 * b]
                    for side in (1.0, -1.0):
                        gtol[go + b] += ROUNDING * dry_level_at(prog, n, b, 0.0, side, 0.0, place, 0.0, 0.0)
            gtol[go + G_WALL_LOW] += ROUNDING * abs(prog.par[po + P_LOW])
            gtol[go + G_WALL_HIGH] += ROUNDING * abs(prog.par[po + P_HIGH])
        elif kind == PWA:
            row = po + 4 * mode[prog.nodes[n, MODE]]
            for side in range(2):
                if abs(prog.par[row + side]) < math.inf:
                    gtol[go + side] += ROUNDING * abs(prog.par[row + side])
        elif kind == QUANTIZER:
            center = prog.par[po] * mode[prog.nodes[n, MODE]]
            for side in range(2):
                gtol[go + side] += ROUNDING * (abs(center) + prog.par[po])


@part
def renewed(prog, mode, scale, node):
    """Reset the scales of margins after an event of `node` (-1: of those alone whose quantity changed).

    One margin is a speed while its body slides and a force while it sticks, a distance over a gap and a force
    in contact. Rows of `scale` (4, ng): size of each margin in its present mode, the largest ever of either
    of its two quantities, and which of the two rows is the present one.
    """
    for n in range(prog.nodes.shape[0]):
        kind, go, mo = prog.nodes[n, KIND], prog.nodes[n, G], prog.nodes[n, MODE]
        joined = kind == MECHANISM and prog.ints[prog.nodes[n, AUX] + A_BODIES] == 2 and closed(prog, n, mode)
        for slot in range(prog.nodes[n, NG]):
            i = go + slot
            other = False
            if kind == MECHANISM:
                if slot <= G_BODY1:
                    other = mode[mo + slot] == STUCK
                elif slot == G_JOINT_LOW or slot == G_JOINT_HIGH:
                    other = joined
            elif kind == PLAY:
                other = mode[mo] != 0
            elif kind == RATE:
                other = mode[mo] == 0
            row = SECOND if other else FIRST
            if n == node or row != int(scale[QUANTITY, i]):
                past = int(scale[QUANTITY, i])
                if past != 0:
                    scale[past, i] = max(scale[past, i], scale[NOW, i])
                scale[NOW, i] = 0.0
                scale[QUANTITY, i] = row
    if scale[QUANTITY, scale.shape[1] - 1] == 0.0:
        scale[QUANTITY, scale.shape[1] - 1] = FIRST


@part
def bump_share(prog, x, x1):
    """Share of the way from x to x1 that a step may take near a narrow feature of friction over speed.

    A Stribeck bump lies within `BUMP_REACH` of its speeds vs. There a step may
    change the speed by vs, or by half: no stage of it can then miss the bump, and the error estimate sees it.
    """
    share = 1.0
    for n in range(prog.nodes.shape[0]):
        if prog.nodes[n, KIND] != MECHANISM:
            continue
        for b in range(prog.ints[prog.nodes[n, AUX] + A_BODIES]):
            narrow = prog.par[prog.nodes[n, PAR] + P_BUMP0 + b]
            at = prog.nodes[n, X] + 2 * b + 1
            v0, v1 = x[at], x1[at]
            passes = v0 * v1 < 0.0 or min(abs(v0), abs(v1)) < BUMP_REACH * narrow
            if narrow < math.inf and passes and v1 != v0:
                share = min(share, max(0.5 * abs(v0), narrow) / abs(v1 - v0))
    return share


@part
def may_touch(prog, x, x1, mode, length):
    """Whether a gap or a stop may be touched inside a step at whose ends it is open.

    Where a distance falls at the start and rises at the end it lies above both its tangents, if it bends one
    way only.
    """
    for n in range(prog.nodes.shape[0]):
        if prog.nodes[n, KIND] != MECHANISM:
            continue
        first, po, ao = prog.nodes[n, X], prog.nodes[n, PAR], prog.nodes[n, AUX]
        bodies = prog.ints[ao + A_BODIES]
        if bodies == 2 and prog.ints[ao + A_JOINT] == J_IMPACT and mode[prog.nodes[n, MODE] + JOINT] == 0:
            d0, d1 = x[first + 2] - x[first], x1[first + 2] - x1[first]
            v0, v1 = length * (x[first + 3] - x[first + 1]), length * (x1[first + 3] - x1[first + 1])
            gap = prog.par[po + P_GAP]
            if _tangents_meet_below(d0, v0, d1, v1) or _tangents_meet_below(gap - d0, -v0, gap - d1, -v1):
                return True
        yielding = prog.ints[ao + A_CONTACT] >= 0 and mode[prog.nodes[n, MODE] + TOUCH] == 0
        if prog.ints[ao + A_STOP] == 1 or yielding:
            at = first + 2 * (bodies - 1)
            low, high = prog.par[po + P_LOW], prog.par[po + P_HIGH]
            v0, v1 = length * x[at + 1], length * x1[at + 1]
            if _tangents_meet_below(x[at] - low, v0, x1[at] - low, v1):
                return True
            if _tangents_meet_below(high - x[at], -v0, high - x1[at], -v1):
                return True
    return False


@part
def _tangents_meet_below(g0, s0, g1, s1):
    return s0 < 0.0 < s1 and g0 + s0 * (g1 - s1 - g0) / (s0 - s1) < 0.0


@part
def locate_event(
    prog, drive, segment, t, length, x, mode, work, terms, poly, xi, dx, g, gtol, scale, blocked, watch,
    watch_level, watch_sign,
):  # fmt: skip
    """Fraction of the step at which the first margin crosses zero, and its index (1.0, -1: none).

    The inner stages of a step are crude; what they suspect is confirmed on the interpolant. `g` holds the
    margins at the end of the step, before and after.
    """
    reach = INPUT_REACH * length
    left, right = 0.0, -1.0
    value_right, at = worst(g, gtol, scale, blocked)
    value_left = 1.0
    end_value, end_at = value_right, at
    # a margin may go below zero and come back before it goes again: look from the left
    pieces = LOOKS_POWER if 0 < terms <= 4 else LOOKS
    before = math.inf  # value one piece before the left end
    for p in range(1, pieces + 1):
        theta = p / pieces
        if p == pieces:
            value, at = end_value, end_at
        else:
            inside(terms, theta, x, poly, xi)
            margins(
                prog, drive, segment, t + theta * length, xi, mode, work, dx, g, reach, watch, watch_level,
                watch_sign
            )  # fmt: skip
            value, at = worst(g, gtol, scale, blocked)
        if 0.0 <= value and 0.0 <= value_left < before and value_left < value and p > 1:
            # lowest at the left end: a touch may hide on either side of it
            step, middle, low = 1.0 / pieces, left, value_left
            one, three = before, value
            for _narrowing in range(TOUCH_STEPS):
                bend = one - 2.0 * low + three
                if not 0.0 < bend < math.inf:
                    break
                vertex = middle + 0.5 * step * (one - three) / bend
                inside(terms, vertex, x, poly, xi)
                margins(
                    prog, drive, segment, t + vertex * length, xi, mode, work, dx, g, reach, watch,
                    watch_level, watch_sign
                )  # fmt: skip
                touch, index = worst(g, gtol, scale, blocked)
                if touch < 0.0:
                    right, value_right, at = vertex, touch, index
                    left, value_left = (left, value_left) if vertex > left else (left - 1.0 / pieces, before)
                    break
                if touch >= low:
                    break
                # closer, by the parabola itself
                step *= TOUCH_CLOSER
                one = three = touch + 0.5 * TOUCH_CLOSER * TOUCH_CLOSER * bend
                middle, low = vertex, touch
            if right > 0.0:
                break
        if value < 0.0:
            right, value_right = theta, value
            break
        before = value_left if p > 1 else math.inf
        left, value_left = theta, value
    if right < 0.0:
        # g must again be the margins at the end of the step
        inside(terms, 1.0, x, poly, xi)
        margins(
            prog, drive, segment, t + length, xi, mode, work, dx, g, reach, watch, watch_level, watch_sign
        )
        return 1.0, -1
    if left == 0.0:
        inside(terms, 0.0, x, poly, xi)
        margins(prog, drive, segment, t, xi, mode, work, dx, g, reach, watch, watch_level, watch_sign)
        value_left, _ = worst(g, gtol, scale, blocked)
    if value_left < 0.0:
        return 0.0, at
    if left == 0.0:
        # a flight or slip that began at this very point: its margin rises from zero before it falls
        for _halving in range(TOUCH_HALVINGS):
            theta = 0.5 * right
            inside(terms, theta, x, poly, xi)
            margins(
                prog,
                drive,
                segment,
                t + theta * length,
                xi,
                mode,
                work,
                dx,
                g,
                reach,
                watch,
                watch_level,
                watch_sign,
            )
            value, index = worst(g, gtol, scale, blocked)
            if value >= 0.0:
                left, value_left = theta, value
                break
            right, value_right, at = theta, value, index
    weight_left, weight_right, side = value_left, value_right, 0
    least = 0.5 * max(ROUNDING, EPS * max(abs(t), length) / length)
    for iteration in range(ROOT_STEPS):
        width = right - left
        if width * length <= EPS * max(abs(t), length) or width < ROUNDING or value_right > -ROUNDING:
            break
        # Anderson and Bjorck: a secant that cannot hang on one side, with a bisection now and then
        theta = left + width * weight_left / (weight_left - weight_right)
        if iteration % BISECTED == BISECTED - 1 or not left <= theta <= right:
            theta = 0.5 * (left + right)
        theta = min(max(theta, left + least), right - least)
        inside(terms, theta, x, poly, xi)
        margins(
            prog,
            drive,
            segment,
            t + theta * length,
            xi,
            mode,
            work,
            dx,
            g,
            reach,
            watch,
            watch_level,
            watch_sign,
        )
        value, index = worst(g, gtol, scale, blocked)
        if value < 0.0:
            if side < 0:
                weight_left *= _share(value, weight_right)
            right, value_right, weight_right, at = theta, value, value, index
            side = -1
        else:
            if side > 0:
                weight_right *= _share(value, weight_left)
            left, weight_left = theta, value
            side = 1
    return right, at


@part(inline=True)
def _share(value, before):
    """Share that the weight of one side keeps where the other side's value has changed once more."""
    share = 1.0 - value / before
    return share if share > 0.0 else 0.5
