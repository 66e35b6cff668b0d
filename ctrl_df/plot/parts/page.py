"""The page a picture is drawn on: style, width, what is handed back; the user's rcParams stay as they are.

A picture has two layouts: side by side at the width of a page, one below the other at that of a column of a
journal.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import control as ct
import matplotlib.pyplot as plt
import numpy as np

from ...checks import positive

WIDE = 7.0
"""Width of a figure unless told otherwise [in]."""
NARROW = 4.5
"""Width below which a figure is a column's [in]: panels stand one below the other, letters are smaller."""

AMPLITUDE_COLOR, OMEGA_COLOR, NYQUIST_COLOR, CROSSING_COLOR = "#1f5a99", "#b3541e", "#222222", "#a3123a"
EXACT_COLOR = "#1b7837"
MEASURED, MODEL, ERROR, OTHER, QUIET = "0.6", "#1f4e9c", "#b3402a", "#9db4d8", "0.75"
"""Colours that keep apart in grey (their lightness differs) and for the colour-blind (blue and orange)."""


def style(width: float) -> dict:
    """Return matplotlib's parameters for a figure of that width [in]."""
    letters = 7.0 if width < NARROW else 9.0
    return {
        "font.size": letters, "axes.titlesize": letters, "axes.labelsize": letters,
        "figure.titlesize": letters + 1, "xtick.labelsize": letters - 1, "ytick.labelsize": letters - 1,
        "legend.fontsize": letters - 1, "legend.frameon": False, "legend.handlelength": 1.8,
        "axes.spines.top": False, "axes.spines.right": False, "axes.linewidth": 0.7,
        "axes.grid": False, "grid.color": "0.92", "grid.linewidth": 0.6, "lines.linewidth": 1.4,
        "xtick.major.width": 0.7, "ytick.major.width": 0.7,
        "axes.formatter.use_mathtext": True, "axes.formatter.limits": (-4, 6),
    }  # fmt: skip


def in_lines(text: str, width: float, share: float = 1.0) -> str:
    """Break a title so that it fits a figure of that width [in]; `share`: of it that there is."""
    letters = style(width)["figure.titlesize"]
    return "\n".join(textwrap.wrap(text, max(int(share * width * 72 / (0.55 * letters)), 12)))


def legend_above(ax, title="", *, handles=None, columns=4):
    """Write what the lines are between title and picture, in as few columns as fit the axes."""
    handles = ax.get_legend_handles_labels()[0] if handles is None else handles
    size = ax.xaxis.label.get_size()
    room = ax.figure.get_figwidth() * 72 * ax.get_position().width
    ax.set_title(in_lines(title, ax.figure.get_figwidth(), max(ax.get_position().width + 0.04, 0.3)))
    if not handles:
        return
    longest = max(len(h.get_label()) for h in handles)
    columns = max(1, min(columns, len(handles), int(room / ((0.55 * longest + 4.5) * (size - 1)))))
    ax.legend(
        handles=handles, ncols=columns, loc="lower center", bbox_to_anchor=(0.5, 1.0), borderaxespad=0.15,
        borderpad=0.1, columnspacing=1.2, handletextpad=0.5, labelspacing=0.25, fontsize=size - 1,
    )  # fmt: skip
    # titles, ours or one set later, are kept above axes within axes: unseen ones lie where the legend is
    ax.inset_axes((0, 1, 1, 0)).set(visible=False, axes_locator=lambda _, renderer: _place(ax, renderer))


def _place(ax, renderer):
    """Return where the legend of some axes stands, in shares of the figure."""
    legend = ax.get_legend()
    box = ax.bbox if legend is None else legend.get_window_extent(renderer)
    return box.transformed(ax.figure.transSubfigure.inverted())


@dataclass
class Page:
    """A figure in the making.

    Attributes
    ----------
    figure : Figure
    given : list of Axes
        Those the caller wants to be drawn on; empty for a figure of our own.
    width : float
        Of what is drawn on [in].
    keep : list of Axes
        Axes drawn.
    """

    figure: plt.Figure  # pyright: ignore[reportPrivateImportUsage]
    given: list
    width: float
    keep: list = field(default_factory=list)

    @property
    def narrow(self) -> bool:
        """Whether it is a column's."""
        return self.width < NARROW

    @property
    def letters(self) -> float:
        """Size of the usual letters [pt]."""
        return plt.rcParams["font.size"]

    def panels(self, count: int, **layout) -> list:
        """Return axes: those given, or as many side by side (one below the other in a column).

        `layout`: of ``Figure.subplots``, the axis shared named by ``sharex`` or ``sharey``.
        """
        if self.given:
            self.keep = self.given[:count]
        elif self.narrow:
            self.keep = list(np.ravel(self.figure.subplots(count, 1, **layout)))
        else:
            self.keep = list(np.ravel(self.figure.subplots(1, count, **layout)))
        return self.keep

    def rows(self, *, wide: Sequence, narrow: Sequence, **layout) -> dict:
        """Return axes by name from a mosaic for each width; `layout`: of ``Figure.subplot_mosaic``."""
        names = list(dict.fromkeys(name for row in wide for name in row))
        if self.given:
            found = dict(zip(names, self.given, strict=False))
        else:
            mosaic = narrow if self.narrow else wide
            if self.narrow:
                layout.pop("width_ratios", None)
                layout["height_ratios"] = layout.pop("narrow_ratios", None)
            else:
                layout.pop("narrow_ratios", None)
            found = self.figure.subplot_mosaic([list(row) for row in mosaic], **layout)
        self.keep = list(found.values())
        return found

    def finished(self, lines, title=None) -> ct.ControlPlot:
        """Put a title over the figure, if it is ours, and return it with its axes and lines."""
        if title is not None and not self.given:
            title = in_lines(title, self.width)
            if len(self.keep) == 1:
                self.keep[0].set_title(title)
            else:
                self.figure.suptitle(title)
        drawn = np.empty(len(lines), dtype=object)
        drawn[:] = [list(artists) for artists in lines]
        return ct.ControlPlot(drawn, np.array(self.keep, dtype=object), self.figure)


@contextmanager
def page(height: float, *, narrow: float | None = None, width: float | None = None, ax=None):
    """Begin a picture: on the axes given, else on the current figure if it is empty, else on a new one.

    Parameters
    ----------
    height, narrow : float
        Of a new figure over its width, as a page's and as a column's (default the same).
    width : float or None
        Of a new figure [in]; None: `WIDE`.
    ax : Axes, array of them, or None
    """
    given = [] if ax is None else list(np.ravel(np.asarray(ax, dtype=object)))
    wide = WIDE if width is None else positive("a picture", "width", width, "in")
    if given:
        figure = given[0].figure
        wide = float(figure.get_figwidth() * given[0].get_position().width / 0.775)
    elif plt.get_fignums() and not plt.gcf().axes and width is None:
        figure = plt.gcf()
        wide = float(figure.get_figwidth())
    else:
        share = narrow if narrow is not None and wide < NARROW else height
        figure = plt.figure(figsize=(wide, wide * share))
    with plt.rc_context(style(wide)):
        if not given and figure.get_layout_engine() is None:
            figure.set_layout_engine("constrained")
        made = Page(figure, given, wide)
        yield made
        small = made.letters - 1
        for axes in [*made.keep, *(a for a in figure.axes if not given and a not in made.keep)]:
            axes.tick_params(which="both", labelsize=small)  # ticks are made when they are drawn
