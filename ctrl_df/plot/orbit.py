"""One period of an exact limit cycle: output and block input over time, and the phase portrait."""

from __future__ import annotations

import control as ct
import numpy as np

from ..blocks.mechanism import Mechanism
from ..calls import keywords_of
from .parts.events import mark_events, shade_sticking
from .parts.keywords import check_keywords
from .parts.page import legend_above, page

_SMALL = 0.1  # [m, rad]: below it motions are drawn in thousandths
_CLOSED = 1e-3  # gap between the ends of an orbit, over its extent, that nobody sees


def orbit_plot(orbit, *, ax=None, title=None, width=None, **line) -> ct.ControlPlot:
    """Draw an `Orbit`: output and block input over one period, events marked, and the phase portrait.

    The portrait shows a mechanism's output against its rate; of an element, whose output may jump, the input
    and its rate. Times at which a mass sticks are shaded.

    Parameters
    ----------
    orbit : Orbit
        From `find_limit_cycle`.
    ax : array of three Axes, optional
        Output, input, phase portrait.
    title : str, optional
        Default: frequency, amplitude, stability.
    width : float, optional
        Of a new figure [in].
    **line
        Line properties.
    """
    check_keywords("plot", keywords_of(orbit_plot)[1:], line)
    style = {"color": "k", "lw": 1.3, **line}
    names = list(getattr(orbit.loop, "output_labels", ["x", "F"]))
    scale, length, force = _units(orbit, names)
    output, drive = scale * orbit.outputs[0], orbit.outputs[-1]
    with page(0.52, narrow=1.45, width=width, ax=ax) as drawn:
        found = drawn.rows(
            wide=["xp", "up"], narrow=["x", "u", "p"], width_ratios=(1.5, 1), narrow_ratios=(1, 1, 1.6)
        )
        axes = [found[name] for name in "xup"]
        drawn.keep = axes
        if not drawn.given:
            axes[1].sharex(axes[0])
        lines = []
        for axis, y, name, unit in ((axes[0], output, names[0], length), (axes[1], drive, names[-1], force)):
            lines.append(axis.plot(orbit.time, y, **style))
            axis.set_ylabel(name + (f" [{unit}]" if unit else ""))
            axis.axhline(0, color="0.8", lw=0.8, zorder=0)
            shade_sticking(axis, orbit.events, orbit.time[0], orbit.time[-1], around=True)
        mark_events(axes[0], orbit.events, orbit.time, output)
        mark_events(axes[1], orbit.events, orbit.time, drive, without=("impact",))
        axes[0].tick_params(labelbottom=False)
        axes[1].set_xlabel("time [s]")
        legend_above(axes[0], columns=5)
        mechanical = bool(force)
        x, name, unit = (output, names[0], length) if mechanical else (drive, names[-1], "")
        lines.append(axes[2].plot(x, _rate(x, orbit.time), **style))
        axes[2].set_xlabel(name + (f" [{unit}]" if unit else ""))
        rate = f"d{name}/dt" if len(name) == 1 else f"rate of {name}"
        axes[2].set_ylabel(rate + (f" [{unit}/s]" if unit else " [1/s]"))
        axes[2].locator_params(nbins=5)
        if title is None:
            kind = {True: "stable", False: "unstable", None: "irregular"}[orbit.stable]
            size = f"{scale * orbit.output_amplitude:.4g} {length}".strip()
            title = f"{kind} limit cycle, {orbit.omega:.5g} rad/s, fundamental of {names[0]} {size}"
        return drawn.finished(lines, title)


def _rate(x, time) -> np.ndarray:
    """Return the rate of a signal over one period, whose last sample is the first of the next.

    Where the orbit is none that closes its ends stay one-sided.
    """
    if abs(x[-1] - x[0]) > _CLOSED * np.ptp(x):
        return np.gradient(x, time)
    period = time[-1] - time[0]
    around = np.concatenate((x[-2:-1], x, x[1:2]))
    return np.gradient(around, np.concatenate((time[-2:-1] - period, time, time[1:2] + period)))[1:-1]


def _units(orbit, names) -> tuple[float, str, str]:
    """Scale and unit of the output, unit of the input; none where the block is no mechanism."""
    parts = getattr(orbit.loop, "parts", None)
    if parts is None or not isinstance(parts.block, Mechanism):
        return 1.0, "", ""
    units = parts.block.signals
    small = np.max(np.abs(orbit.outputs[0])) < _SMALL
    scale, prefix = (1e3, "m") if small else (1.0, "")
    return scale, prefix + units[names[0]], units[names[-1]]
