"""Force and position of a simulated loop over time, as the paper draws them."""

from __future__ import annotations

import control as ct
import matplotlib.pyplot as plt
import numpy as np

from ..blocks.coordinates import AXIS, LINE


def loop_response_plot(runs, *, labels=(), window=None, title=None, ax=None) -> ct.ControlPlot:
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

    Returns
    -------
    ControlPlot
    """
    runs = [runs] if hasattr(runs, "time") else list(runs)
    if ax is None:
        figure = plt.figure(figsize=(7.6, 4.6), layout="constrained")
        axes = figure.subplots(2, 1, sharex=True)
    else:
        axes = np.ravel(ax)
        figure = axes[0].figure
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
        axis.grid(True, color="0.92", lw=0.7)
        axis.margins(x=0.01)
        axis.spines[["top", "right"]].set_visible(False)
    if any(labels):
        axes[0].legend(
            frameon=False, fontsize="small", ncols=len(runs), loc="lower left", bbox_to_anchor=(0, 1.0)
        )
    if title:
        figure.suptitle(title, fontsize="medium")
    return ct.ControlPlot(lines, axes.reshape(2, 1), figure)
