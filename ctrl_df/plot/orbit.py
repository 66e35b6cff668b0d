"""One period of an exact limit cycle: output and force over time, and the phase portrait."""

from __future__ import annotations

import control as ct
import matplotlib.pyplot as plt
import numpy as np

_MARKS = {"impact": "x", "stick": "s", "breakaway": "o", "reversal": "|", "contact": "v", "release": "^"}


def orbit_plot(orbit, *, ax=None, title=None, **line) -> ct.ControlPlot:
    """Draw an `Orbit`: output and block input over one period with the events marked, and output against its rate.

    Parameters
    ----------
    orbit : Orbit
        From `find_limit_cycle`.
    ax : array of three Axes, optional
        Output, input, phase portrait.
    title : str, optional
        Default: frequency, amplitude, stability.
    **line
        Line properties.
    """
    if ax is None:
        figure = plt.figure(figsize=(9, 4.5), layout="constrained")
        grid = figure.add_gridspec(2, 2, width_ratios=(1.6, 1))
        top = figure.add_subplot(grid[0, 0])
        axes = [top, figure.add_subplot(grid[1, 0], sharex=top), figure.add_subplot(grid[:, 1])]
    else:
        axes = list(np.ravel(ax))
        figure = axes[0].figure
    style = {"color": "k", "lw": 1.5, **line}
    names = list(getattr(orbit.loop, "output_labels", ["x", "F"]))
    drawn = []
    for axis, row, unit in ((axes[0], 0, "m"), (axes[1], -1, "N")):
        y = orbit.outputs[row]
        drawn.append(axis.plot(orbit.time, y, **style))
        axis.set_ylabel(f"{names[row]} [{unit}]" if hasattr(orbit.loop, "parts") else names[row])
        axis.axhline(0, color="0.8", lw=0.8, zorder=0)
        axis.grid(False)
        seen = set()
        for event in orbit.events:
            mark = _MARKS.get(event.kind)
            if mark is None:
                continue
            label = event.kind if event.kind not in seen else None
            seen.add(event.kind)
            axis.plot(event.time, np.interp(event.time, orbit.time, y), mark, color="0.35", ms=5, label=label)
    axes[0].tick_params(labelbottom=False)
    axes[1].set_xlabel("time [s]")
    if orbit.events and axes[0].get_legend_handles_labels()[1]:
        axes[0].legend(frameon=False, fontsize="small", ncols=3, loc="upper right")
    x = orbit.outputs[0]
    drawn.append(axes[2].plot(x, np.gradient(x, orbit.time), **style))
    axes[2].set_xlabel(f"{names[0]} [m]")
    axes[2].set_ylabel(f"d{names[0]}/dt [m/s]")
    axes[2].locator_params(nbins=5)
    if title is None:
        kind = {True: "stable", False: "unstable", None: "irregular"}[orbit.stable]
        title = f"{kind} limit cycle, {orbit.omega:.5g} rad/s, fundamental {orbit.output_amplitude:.4g} m"
    figure.suptitle(title, fontsize="medium")
    return ct.ControlPlot(np.array(drawn, dtype=object), np.array(axes), figure)
