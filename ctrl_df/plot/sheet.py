"""A figure to draw a result on, and what is handed back: the same for every picture of a study."""

from __future__ import annotations

import control as ct
import matplotlib.pyplot as plt
import numpy as np


def sheet(width: float, height: float, keywords=None):
    """Return the current figure if it is empty, else a new one, of that size [inches].

    Raises
    ------
    TypeError
        `keywords` that no picture knows.
    """
    if keywords:
        raise TypeError(f"unrecognized keyword(s): {', '.join(keywords)}")
    fig = plt.gcf() if not plt.gcf().axes else plt.figure()
    fig.set_size_inches(width, height)
    return fig


def finished(fig, axes, lines, title) -> ct.ControlPlot:
    """Put the title over a figure and return it with its axes and lines, a list of artists for each entry."""
    fig.suptitle(title, fontsize=11)
    fig.tight_layout()
    drawn = np.empty(len(lines), dtype=object)
    drawn[:] = [list(artists) for artists in lines]
    return ct.ControlPlot(drawn, np.array(axes, dtype=object), fig)
