"""The error of free prediction against its length."""

from __future__ import annotations

import control as ct

from ..parts.curves import log_ticks
from ..parts.page import ERROR, MEASURED, MODEL, legend_above, page

_LEAST_SPAN = 4.0
"""Upper over lower end of the errors shown, at least."""
_COLOURS = (MODEL, ERROR, MEASURED, "#3f8f5f", "#8a5fa8")


def horizons_plot(curves, *, labels=(), title=None, width=None) -> ct.ControlPlot:
    """Draw one or more `ErrorByHorizon`.

    Parameters
    ----------
    curves : sequence of ErrorByHorizon
    labels : sequence of str
        One a curve; none: no legend.
    title : str or None
        Over the picture.
    width : float or None
        Of a new figure [in].
    """
    with page(0.55, narrow=0.8, width=width) as drawn:
        ax, lines = drawn.panels(1)[0], []
        for i, curve in enumerate(curves):
            label = labels[i] if i < len(labels) else None
            colour = _COLOURS[i % len(_COLOURS)]
            lines.append(ax.plot(curve.horizon, 100 * curve.nrmse, "o-", ms=4, color=colour, label=label))
        ax.set_xscale("log")
        ax.set_yscale("log")
        low, high = ax.get_ylim()
        spread = max(1.0, (_LEAST_SPAN * low / high) ** 0.5)  # a change of a percent is none to the eye
        ax.set_ylim(low / spread, high * spread)
        log_ticks(ax.xaxis, *ax.get_xlim())
        log_ticks(ax.yaxis, *ax.get_ylim())
        ax.set_xlabel("time predicted freely [s]")
        ax.set_ylabel("error [% of the output's rms]")
        named = curves[0].name or "records"
        legend_above(ax, f"Error against the horizon, {named}" if title is None else title)
        return drawn.finished(lines)
