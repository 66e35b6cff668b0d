"""An orbit found by continuation: the mismatch after a period is scaled down to zero.

``R(z) = share R(z0)``, with R the mismatch of state z after a period, is followed by arclength from share 1.
At share 0 lies the orbit, also where Newton's own steps do not lead to it. If the share turns back to 1
before, the orbit and its neighbour have merged (a fold); if the period grows out of all bounds on the way,
the curve ends at rest. Either way there is no orbit near.

References
----------
Keller (1978), Global homotopies and Newton methods.
"""

from __future__ import annotations

import numpy as np

from ...thresholds import NEWTON_NEAR, NOTHING
from ..arclength import correction, tangent
from ..thresholds import CURVE_BEND, CURVE_FIRST, CURVE_LONGER
from .closing import Closing, NoClosure
from .orbit import Orbit
from .shift_invariance import shift_directions
from .thresholds import (
    ACROSS,
    CLOSED,
    CORNER_BEYOND,
    SHRINK_CLOSED,
    SHRINK_FAR,
    SHRINK_LONGEST,
    SHRINK_SHORTEST,
    SHRINK_STEPS,
)


class Merged(NoClosure):
    """The mismatch cannot be brought to zero: the orbit has merged with a neighbour, or with rest."""


def trace(closing: Closing, x0, period: float) -> Orbit:
    """Follow the curve from a state near an orbit to the orbit.

    Raises
    ------
    Merged
        The curve turns back, or leads to rest.
    NoClosure
        It could not be followed.
    """
    curve = _Curve(closing, np.array(x0, float), period)
    n, scale = curve.n, curve.scale
    if scale < CLOSED:
        return closing.close(x0, period)
    y = np.zeros(n + 2)
    y[-1] = 1.0
    _, J = curve.equations(y)
    border = tangent(J, -np.eye(n + 2)[-1])
    step, least = CURVE_FIRST * min(1.0, scale), 1.0
    for _ in range(SHRINK_STEPS):
        ahead = y + step * border
        met = curve.onto(ahead, border)
        if met is not None and np.linalg.norm(met[0] - ahead) > step:
            met = None  # farther across the curve than along it: another curve, such as that of period zero
        turned = None if met is None else tangent(met[1], border)
        if met is not None and turned is not None and turned @ border >= CURVE_BEND:
            y, border = met[0], turned
        else:
            step *= 0.5
            if step > SHRINK_SHORTEST * scale:
                continue
            beyond = curve.round_corner(y, border, ACROSS * scale)
            if beyond is None:
                break
            (y, border), step = beyond, ACROSS * scale
        least = min(least, float(y[-1]))
        if y[-1] <= 0.0:
            return closing.close(curve.state(y), period * float(np.exp(y[n])))
        if y[-1] >= 1.0:
            raise Merged(
                f"the mismatch after a period falls to {least:.0%} of {scale:.1g} and grows again: "
                "the orbit and its neighbour have merged",
                least * scale,
            )
        if y[n] > SHRINK_FAR:
            raise Merged(
                f"the mismatch after a period falls to {least:.1%} of {scale:.1g} only as the period grows "
                f"to {np.exp(y[n]):.0f} times the estimate: the orbit has merged with rest",
                least * scale,
            )
        if np.max(np.abs(y[: n + 1])) > SHRINK_FAR:
            break
        step = min(CURVE_LONGER * step, SHRINK_LONGEST)
    raise NoClosure("the mismatch after a period could not be followed to zero", least * scale)


class _Curve:
    """Unknowns y = (state moved, in sizes; logarithm of the period's change; share) and their equations."""

    def __init__(self, closing, x0, period):
        self.closing, self.tracer, self.period = closing, closing.tracer, period
        start, self.size = closing.free_state(x0, period)
        self.n, self.origin = self.tracer.n, start.x.copy()
        phase = self.tracer.rate(start.time, start.x, start.mode) * period / self.size
        self.phase = phase / max(np.linalg.norm(phase), NOTHING)
        self.beside = np.eye(self.n)
        traced = self.tracer.trace(start, period, size=self.size)
        free = shift_directions(self.tracer, traced, self.size)
        self.beside = np.eye(self.n) - free @ free.T
        self.first, _ = self._mismatch(np.zeros(self.n + 1))
        self.scale = float(np.max(np.abs(self.first)))

    def state(self, y):
        """Return the state that the unknowns stand for."""
        return self.origin + y[: self.n] * self.size

    def _mismatch(self, y):
        n, span = self.n, self.period * np.exp(y[self.n])
        here = self.closing.rebuilt(self.state(y))
        traced = self.tracer.trace(here, span, size=self.size)
        if not traced.status.ok or not np.all(np.isfinite(traced.monodromy)):
            raise NoClosure("no period could be followed")
        gap = self.beside @ ((traced.end.x - here.x) / self.size)
        slope = np.zeros((n, n + 1))
        slope[:, :n] = self.beside @ (traced.monodromy * self.size / self.size[:, None] - np.eye(n))
        end = self.tracer.rate(traced.end.time, traced.end.x, traced.end.mode)
        slope[:, n] = self.beside @ (end * span / self.size)
        return gap, slope

    def equations(self, y):
        """Return their defect and its derivatives by all unknowns."""
        gap, slope = self._mismatch(y[:-1])
        phase_row = np.append(self.phase, [0.0, 0.0])
        J = np.vstack([np.column_stack([slope, -self.first]), phase_row])
        return np.append(gap - y[-1] * self.first, self.phase @ y[: self.n]), J

    def onto(self, y, border):
        """Newton onto the curve within the plane through y across `border`; (y, J), or None."""
        begin, offset = y, border @ y
        try:
            for _ in range(NEWTON_NEAR):
                r, J = self.equations(y)
                if np.max(np.abs(r)) < SHRINK_CLOSED * self.scale:
                    return y, J
                y = y + correction(J, border, r, border @ y - offset)
                if not np.linalg.norm(y - begin) < SHRINK_FAR:
                    break  # it diverges
        except NoClosure:
            pass
        return None

    def round_corner(self, y, border, step):
        """Go on beyond a corner of the curve, where an event begins or ends to take part: the Jacobian jumps.

        The curve beyond is a tangent of the Jacobian there; of its two directions the right one stays there.
        """
        try:
            _, before = self.equations(y - step * border)
            _, beyond = self.equations(y + step * border)
        except NoClosure:
            return None
        along = tangent(beyond, border)
        for direction in (along, -along):
            met = self.onto(y + step * direction, direction)
            if met is None:
                continue
            if np.abs(met[1] - beyond).max() < CORNER_BEYOND * np.abs(met[1] - before).max():
                return met[0], direction
        return None
