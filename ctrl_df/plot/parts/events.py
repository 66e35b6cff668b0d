"""Events over time: marks on a curve, and the times at which something sticks."""

from __future__ import annotations

import numpy as np

MARKS = {"impact": "x", "stick": "s", "breakaway": "o", "reversal": "|", "contact": "v", "release": "^"}
_STUCK = "0.9"
_MOST = 60
"""Events of a kind beyond which marks would cover the curve."""


def mark_events(axis, events, time, y, *, without=(), window=None):
    """Mark events on a curve, each kind named once in the legend; kinds with very many are left out."""
    low, high = window or (time[0], time[-1])
    for kind, mark in MARKS.items():
        at = [e.time for e in events if e.kind == kind and low <= e.time <= high]
        if at and kind not in without and len(at) <= _MOST:
            axis.plot(at, np.interp(at, time, y), mark, color="0.35", ms=4, label=kind, ls="none")


def shade_sticking(axis, events, start, end, *, around=False):
    """Shade the times from a stick to the next breakaway; `around`: what is shown is one period."""
    marks = sorted((e.time, e.kind) for e in events if e.kind in ("stick", "breakaway"))
    since = start if marks and marks[0][1] == "breakaway" and (around or marks) else None
    spans = []
    for time, kind in marks:
        if kind == "stick" and since is None:
            since = time
        elif kind == "breakaway" and since is not None:
            spans.append((since, time))
            since = None
    if since is not None:
        spans.append((since, end))
    for i, (a, b) in enumerate((max(a, start), min(b, end)) for a, b in spans if b > start and a < end):
        axis.axvspan(a, b, color=_STUCK, lw=0, zorder=-1, label="_" if i else "stuck")
