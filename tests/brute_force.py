"""Dry friction by SciPy alone: each slide and each hold a run of its own."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq


class Dry:
    """A mass under dry friction that may depend on place, drive and load.

    Parameters
    ----------
    kinetic, static : callables
        Levels over (x, drive, load).
    others : callable
        Force besides drive and dry friction, over (x, v).
    mass : float
    drive : callable
        Over time.
    """

    def __init__(self, kinetic, static, others, mass, drive):
        self.kinetic, self.static, self.others = kinetic, static, others
        self.mass, self.drive = mass, drive

    def push(self, t, x):
        """Force on the body at rest."""
        return self.drive(t) + self.others(x, 0.0)

    def room(self, t, x):
        """What is left of the hold."""
        return self.static(x, self.drive(t), -self.others(x, 0.0)) - abs(self.push(t, x))

    def breaks(self, t, x, end, grid=20_000):
        """When a body at rest at `x` breaks away; `end` if it does not."""
        times = np.linspace(t, end, grid)
        broken = np.flatnonzero(np.array([self.room(s, x) for s in times]) < 0)
        if not len(broken):
            return end
        return t if broken[0] == 0 else brentq(self.room, times[broken[0] - 1], times[broken[0]], (x,), 1e-15)

    def run(self, times, x=0.0):
        """Positions from rest at `x`."""
        t, out = times[0], np.full(len(times), x)
        while t < times[-1]:
            until = self.breaks(t, x, times[-1])
            out[(times >= t) & (times <= until)] = x
            if until == times[-1]:
                break
            t, x = self._slide(until, x, times, out)
        return out

    def _slide(self, t, x, times, out):
        """Slide until standstill; returns when and where it stands."""
        way = np.sign(self.push(t, x))

        def rates(t, s):
            others = self.others(*s)
            drive = self.drive(t)
            return [s[1], (drive + others - way * self.kinetic(s[0], drive, -others)) / self.mass]

        def standstill(t, s):
            return s[1]

        standstill.terminal, standstill.direction = True, -way
        some = times[times > t]
        run = solve_ivp(
            rates, (t, times[-1]), [x, 0.0], "DOP853", some, events=standstill, rtol=1e-11, atol=1e-14
        )
        out[np.searchsorted(times, run.t)] = run.y[0]
        if not run.t_events[0].size:
            return times[-1], x
        return run.t_events[0][0], run.y_events[0][0][0]
