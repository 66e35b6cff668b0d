"""The force that is missing, over time or over another quantity."""

from __future__ import annotations

import control as ct
import numpy as np

from ..parts.page import legend_above, page

_POINTS, _CURVE = "#7f9cc6", "#b3402a"


def missing_force_plot(missing, *, against="time", title=None, width=None) -> ct.ControlPlot:
    """Draw a `MissingForce`; see `ctrl_df.identify.smoothing.missing_force.MissingForce.plot`.

    Parameters
    ----------
    missing : MissingForce
    against : str
        Over time: the force with two standard deviations. Over another quantity: a point for every instant
        at which the force is known, and their mean as a curve.
    title : str or None
        Over the picture.
    width : float or None
        Of a new figure [in].
    """
    with page(0.55, narrow=0.8, width=width) as drawn:
        ax = drawn.panels(1)[0]
        what = missing.words["force"]
        if against == "time":
            band = ax.fill_between(
                missing.time, missing.force - 2 * missing.std, missing.force + 2 * missing.std,
                color=_POINTS, alpha=0.45, lw=0, label="two standard deviations",
            )  # fmt: skip
            line = ax.plot(missing.time, missing.force, color=_CURVE, lw=0.9, label=f"missing {what}")[0]
            lines = [[band, line]]
        else:
            curve = missing.curve(against)
            points = ax.plot(
                *curve.points, ".", ms=2.5, color=_POINTS, rasterized=True, label="each instant"
            )[0]
            means = ax.errorbar(
                curve.at, curve.force, 2 * curve.std, color=_CURVE, lw=1.2, capsize=2,
                label="mean, two standard errors",
            )  # fmt: skip
            lines = [[points, means]]
            if not len(curve.points[0]):
                ax.text(
                    0.5, 0.6, f"no missing {what} is significant:\nnowhere larger than its uncertainty",
                    transform=ax.transAxes, ha="center", va="bottom",
                )  # fmt: skip
        ax.axhline(0.0, color="0.6", lw=0.7, zorder=0)
        ax.set_xlabel(f"{missing.words[against]} [{missing.units[against]}]")
        along = " along the motion" if against == "reversal" else ""
        ax.set_ylabel(f"missing {what}{along} [{missing.unit}]")
        if against == "time":
            ax.set_xlim(missing.time[0], missing.time[-1])
            ax.set_ylim(*_limits(missing))
        legend_above(ax, missing.name if title is None else title)
        return drawn.finished(lines)


def _limits(missing):
    """Return limits that show the force where it is known; bands that are wide open are cut."""
    reach = np.max(np.abs(missing.force) + 2 * np.minimum(missing.std, np.median(missing.std)))
    return -1.05 * reach, 1.05 * reach
