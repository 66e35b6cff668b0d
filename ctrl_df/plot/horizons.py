"""The error of free prediction against its length."""

from __future__ import annotations

import control as ct

from .sheet import finished, sheet

_COLOURS = ("#1f4e9c", "#b3402a", "0.45", "#3f8f5f", "#8a5fa8")


def horizons_plot(curves, *, labels=(), title=None, **keywords) -> ct.ControlPlot:
    """Draw one or more `ErrorByHorizon`.

    Parameters
    ----------
    curves : sequence of ErrorByHorizon
    labels : sequence of str
        One a curve; none: no legend.
    title : str or None
        Over the picture.
    """
    fig = sheet(6.4, 3.8, keywords)
    ax = fig.add_subplot()
    lines = []
    for i, curve in enumerate(curves):
        label = labels[i] if i < len(labels) else None
        colour = _COLOURS[i % len(_COLOURS)]
        lines.append(ax.plot(curve.horizon, 100 * curve.nrmse, "o-", ms=4, lw=1.4, color=colour, label=label))
    ax.set_xscale("log")
    ax.set_yscale("log")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(lambda x, _: f"{x:g}" if f"{x:.0e}"[0] in "25" else "")
    ax.set_xlabel("Time predicted freely [s]")
    ax.set_ylabel("Error, rms over rms of the output [%]")
    ax.spines[["top", "right"]].set_visible(False)
    if labels:
        ax.legend(frameon=False, fontsize=9)
    named = curves[0].name or "records"
    return finished(fig, [ax], lines, f"Error against the horizon, {named}" if title is None else title)
