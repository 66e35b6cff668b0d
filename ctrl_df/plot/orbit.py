"""One period of an exact limit cycle: output and block input over time, and the phase portrait."""

from __future__ import annotations

import control as ct
import matplotlib.pyplot as plt
import numpy as np

from ..blocks.mechanism import Mechanism

_MARKS = {"impact": "x", "stick": "s", "breakaway": "o", "reversal": "|", "contact": "v", "release": "^"}
_SMALL = 0.1  # [m, rad]: below it motions are drawn in thousandths


def orbit_plot(orbit, *, ax=None, title=None, **line) -> ct.ControlPlot:
    """Draw an `Orbit`: output and block input over one period, events marked, and the phase portrait.

    The portrait shows a mechanism's output against its rate; of an element, whose output may jump, the input
    and its rate.

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
    scale, length, force = _units(orbit, names)
    output, drive = scale * orbit.outputs[0], orbit.outputs[-1]
    drawn = []
    for axis, y, name, unit in ((axes[0], output, names[0], length), (axes[1], drive, names[-1], force)):
        drawn.append(axis.plot(orbit.time, y, **style))
        axis.set_ylabel(name + (f" [{unit}]" if unit else ""))
        axis.axhline(0, color="0.8", lw=0.8, zorder=0)
        axis.grid(False)
    _mark(axes[0], orbit, output, _MARKS)
    _mark(axes[1], orbit, drive, {kind: mark for kind, mark in _MARKS.items() if kind != "impact"})
    axes[0].tick_params(labelbottom=False)
    axes[1].set_xlabel("time [s]")
    if axes[0].get_legend_handles_labels()[1]:
        axes[0].legend(
            frameon=False,
            fontsize="small",
            ncols=4,
            loc="lower left",
            bbox_to_anchor=(0, 0.98),
            borderpad=0.1,
        )
    mechanical = bool(force)
    x, name, unit = (output, names[0], length) if mechanical else (drive, names[-1], "")
    drawn.append(axes[2].plot(x, np.gradient(x, orbit.time), **style))
    axes[2].set_xlabel(name + (f" [{unit}]" if unit else ""))
    rate = f"d{name}/dt" if len(name) == 1 else f"rate of {name}"
    axes[2].set_ylabel(rate + (f" [{unit}/s]" if unit else " [1/s]"))
    axes[2].locator_params(nbins=5)
    if title is None:
        kind = {True: "stable", False: "unstable", None: "irregular"}[orbit.stable]
        size = f"{scale * orbit.output_amplitude:.4g} {length}".strip()
        title = f"{kind} limit cycle, {orbit.omega:.5g} rad/s, fundamental of {names[0]} {size}"
    figure.suptitle(title, fontsize="medium")
    return ct.ControlPlot(np.array(drawn, dtype=object), np.array(axes), figure)


def _units(orbit, names) -> tuple[float, str, str]:
    """Scale and unit of the output, unit of the input; none where the block is no mechanism."""
    parts = getattr(orbit.loop, "parts", None)
    if parts is None or not isinstance(parts.block, Mechanism):
        return 1.0, "", ""
    units = parts.block.signals
    small = np.max(np.abs(orbit.outputs[0])) < _SMALL
    scale, prefix = (1e3, "m") if small else (1.0, "")
    return scale, prefix + units[names[0]], units[names[-1]]


def _mark(axis, orbit, y, marks):
    """Mark the events on a curve, each kind named once."""
    seen = set()
    for event in orbit.events:
        if event.kind in marks:
            label = event.kind if event.kind not in seen else None
            seen.add(event.kind)
            place = np.interp(event.time, orbit.time, y)
            axis.plot(event.time, place, marks[event.kind], color="0.35", ms=5, label=label)
