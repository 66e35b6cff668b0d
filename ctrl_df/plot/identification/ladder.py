"""The error of every step of a ladder, beside the noise."""

from __future__ import annotations

import textwrap

import control as ct
import matplotlib.pyplot as plt
import numpy as np

from ...numerals import digits
from ..parts.curves import log_ticks
from ..parts.page import MODEL, OTHER, legend_above, page

OF = {
    "output": "error [% of the output's rms]",
    "acceleration": "error of the acceleration [% of its rms]",
    "force": "error [% of the force's rms]",
    "N": "error [% of |N|]",
}
"""What errors are drawn as shares of."""


def plot_ladder(study, *, title=None, width=None) -> ct.ControlPlot:
    """Draw the error of each step on training and held-out data; the grey band is the noise floor.

    Parameters
    ----------
    study : Study
    title : str or None
        Over the picture.
    width : float or None
        Of a new figure [in].
    """
    steps = study.steps
    with page(0.52, narrow=0.95, width=width) as drawn:
        ax = drawn.panels(1)[0]
        small = plt.rcParams["legend.fontsize"]
        at = np.arange(len(steps))
        train = 100 * np.array([s.nrmse for s in steps])
        held_out = 100 * np.array([s.nrmse_holdout for s in steps])
        # on a logarithmic axis the length of a bar would say nothing
        lines = [
            ax.plot(at - 0.06, train, "o", color=OTHER, label="fitted data"),
            ax.plot(at + 0.06, held_out, "s", color=MODEL, label="held-out data"),
        ]
        levels = np.array([100 * study.noise, *train, *held_out])
        bottom = 0.5 * levels[levels > 0].min()
        bands = []
        if study.noise > 0:  # it is 0 where disturbance forces outweigh it
            bands.append(ax.axhspan(bottom, 100 * study.noise, color="0.88", zorder=0, label="noise"))
        ax.set_yscale("log")
        ax.set_ylim(bottom, 2.2 * np.nanmax([*train, *held_out]))
        log_ticks(ax.yaxis, *ax.get_ylim())
        for x, a, b in zip(at, train, held_out, strict=True):
            ax.text(x - 0.12, a, digits(a, 2), ha="right", va="center", fontsize=small)
            if np.isfinite(b):  # a ladder that ended early may not have been tried on what is held out
                ax.text(x + 0.12, b, digits(b, 2), ha="left", va="center", fontsize=small)
        beside = max(0.1, 1.0 - 0.5 * len(steps))  # one step stands in the middle
        ax.set_xlim(-0.5 - beside, len(steps) - 0.5 + beside)
        room = max(int(drawn.width * 0.8 * 72 / (max(len(steps), 2) * 0.58 * small)), 6)
        ax.set_xticks(at, [_in_lines(s.signs or ("refitted",), room) for s in steps])
        ax.set_ylabel(study.model.coordinates.text(OF[study.measure]))
        legend_above(ax, "Error of every step" if title is None else title)
        return drawn.finished([*lines, bands])


def _in_lines(parts, room) -> str:
    """Return what a step did, broken into lines of so many letters."""
    return "\n".join("\n".join(textwrap.wrap(part.replace("_", " "), room)) for part in parts)
