"""Simulated runs over time: as python-control draws them, with events; force and position as in the paper."""

from __future__ import annotations

import control as ct
import matplotlib.pyplot as plt
import numpy as np

from ..blocks.coordinates import AXIS, LINE
from ..calls import keywords_of
from .parts.events import MARKS, mark_events, shade_sticking
from .parts.keywords import check_keywords
from .parts.page import legend_above, page

_ROWS = 3
"""Signals over each other for which a figure of the usual height has room."""


def event_response_plot(run, *, fmt=(), events=True, **keywords) -> ct.ControlPlot:
    """Draw an `EventResponse` as ``ct.time_response_plot`` does, with units and events.

    Parameters
    ----------
    run : EventResponse
    fmt : tuple
        Format of the lines, as in matplotlib.
    events : bool
        Whether events are marked, and times of sticking shaded where a single body can stick.
    **keywords
        Of ``ct.time_response_plot``.

    Returns
    -------
    ControlPlot
        python-control's.
    """
    check_keywords("plot", keywords_of(event_response_plot)[1:], keywords, ct.time_response_plot)
    new = not plt.get_fignums()
    cplt = ct.time_response_plot(run, *fmt, **keywords)
    rows = np.shape(cplt.axes)[0]
    if new and rows > _ROWS:  # as high as labels need
        cplt.figure.set_figheight(cplt.figure.get_figheight() * rows / _ROWS)
    marked = False
    bodies = {e.subsystem for e in run.events if e.kind in ("stick", "breakaway")}
    for ax in np.ravel(cplt.axes):
        label = ax.get_ylabel().strip("$ ")
        if label in run.signal_units:
            ax.set_ylabel(f"{label} [{run.signal_units[label]}]")
        if not events or label not in (run.output_labels or ()):
            continue
        if len(bodies) == 1:
            shade_sticking(ax, run.events, run.time[0], run.time[-1])
        if not marked:
            y = np.reshape(run.outputs, (len(run.output_labels), -1, len(run.time)))
            mark_events(ax, run.events, run.time, y[list(run.output_labels).index(label), 0])
            marked = True
            known = dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))
            kinds = {k: h for k, h in known.items() if k == "stuck" or k in MARKS}
            if kinds:
                ax.legend(
                    kinds.values(), kinds.keys(), fontsize="x-small", ncols=len(kinds), frameon=False,
                    loc="lower right", bbox_to_anchor=(1, 0.97), handletextpad=0.3, columnspacing=1.0,
                )  # fmt: skip
    return cplt


def loop_response_plot(runs, *, labels=(), window=None, title=None, ax=None, width=None) -> ct.ControlPlot:
    """Draw the force above and the position [mm] below (torque and angle [mrad] of what turns), over time.

    Parameters
    ----------
    runs : EventResponse or sequence of them
        Of closed loops: first output the position, last the force.
    labels : sequence of str
        One a run, written at its end.
    window : (start, stop) [s], optional
        What is shown.
    title : str, optional
    ax : pair of Axes, optional
        Force, position.
    width : float, optional
        Of a new figure [in].

    Returns
    -------
    ControlPlot
    """
    runs = [runs] if hasattr(runs, "time") else list(runs)
    with page(0.6, narrow=1.0, width=width, ax=ax) as drawn:
        axes = list(drawn.rows(wide="Fx", narrow="Fx", sharex=True).values())
        lines = _drawn(axes, runs, labels, window)
        if title:
            drawn.finished([], title)
        return ct.ControlPlot(lines, np.array(axes, dtype=object).reshape(2, 1), drawn.figure)


def _drawn(axes, runs, labels, window):
    styles = (dict(color="k", lw=1.2), dict(color="0.5", lw=1.2, ls="--"))
    lines = np.empty((2, 1), dtype=object)
    lines[0, 0], lines[1, 0] = [], []
    for i, run in enumerate(runs):
        t, y = np.asarray(run.time), np.asarray(run.outputs)
        seen = np.ones(t.size, bool) if window is None else (t >= window[0]) & (t <= window[1])
        label = labels[i] if i < len(labels) else None
        style = styles[i % len(styles)]
        lines[0, 0] += axes[0].plot(t[seen], y[-1, seen], label=label, **style)
        lines[1, 0] += axes[1].plot(t[seen], 1e3 * y[0, seen], **style)
    moves = next((c for c in (LINE, AXIS) if c.name("F") in (runs[0].output_labels or ())), LINE)
    axes[0].set_ylabel(f"{moves.force} [{moves.force_unit}]")
    axes[1].set_ylabel(f"{moves.position} [m{moves.unit}]")
    axes[1].set_xlabel("time [s]")
    for axis in axes:
        axis.grid(True)
        axis.margins(x=0.01)
    if any(labels):
        legend_above(axes[0])
    return lines
