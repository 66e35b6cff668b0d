"""Measured and simulated output, the residual, and where the error lies, in one picture."""

from __future__ import annotations

import control as ct
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import FuncFormatter

from ..checks import known_name

_MEASURED, _SIMULATED, _ERROR = "0.55", "#1f4e9c", "#b3402a"


def comparison_plot(
    comparison, record=None, *, output=None, title=None, rows=8, **keywords
) -> ct.ControlPlot:
    """Draw a `Comparison`; see `ctrl_df.identify.compare.Comparison.plot`.

    Parameters
    ----------
    comparison : Comparison
    record : int or None
        Which record; None: the one with the largest error.
    output : str or None
        Which of several outputs, by quantity; None: the one that leads.
    title : str or None
        Over the picture.
    rows : int
        Regions shown.
    """
    if keywords:
        raise TypeError(f"unrecognized keyword(s): {', '.join(keywords)}")
    chosen = comparison.worst if record is None else comparison.records[record]
    choices = chosen.by_output
    chosen = choices[known_name("plot", "output", output or next(iter(choices)), choices)]
    data, unit = chosen.record, chosen.record.output_unit
    fig = plt.gcf() if not plt.gcf().axes else plt.figure()
    fig.set_size_inches(9, 6.5)
    grid = fig.add_gridspec(2, 2, width_ratios=(2.1, 1), height_ratios=(1.5, 1))
    top = fig.add_subplot(grid[0, 0])
    below = fig.add_subplot(grid[1, 0], sharex=top)
    bars = fig.add_subplot(grid[:, 1])
    lines = np.empty(3, dtype=object)
    lines[0] = [top.plot(data.t, data.y, color=_MEASURED, lw=2.2, label="measured")[0]]
    lines[0].append(top.plot(data.t, chosen.simulated, color=_SIMULATED, lw=1.0, label="simulated")[0])
    top.set_ylabel(f"{_word(data)} [{unit}]")
    top.legend(frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1, 0.99), fontsize=9)
    top.set_title(f"nrmse {chosen.nrmse:.3g}, fit {chosen.fit_percent:.2f} %", loc="left", fontsize=10)
    factor, small = _readable(chosen.residual, unit)
    lines[1] = below.plot(data.t, chosen.residual, color=_ERROR, lw=0.7)
    below.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{factor * value:.4g}"))
    white = chosen.white
    below.set_title(
        f"rmse {factor * chosen.rmse:.3g} {small}; {'white' if white else 'not white'} "
        f"(p {'< 1e-6' if white.p_value < 1e-6 else f'= {white.p_value:.2g}'})",
        loc="left", fontsize=10,
    )  # fmt: skip
    below.set_ylabel(f"Measured - simulated [{small}]")
    below.set_xlabel("Time [s]")
    for edge in chosen.edges[1:-1]:
        for ax in (top, below):
            ax.axvline(data.t[edge], color="0.8", lw=0.6, zorder=0)
    lines[2] = _regions(bars, chosen.where, rows)
    for ax in (top, below, bars):
        ax.spines[["top", "right"]].set_visible(False)
    top.tick_params(labelbottom=False)
    fig.suptitle(data.name if title is None else title, fontsize=11)
    fig.tight_layout()
    return ct.ControlPlot(lines, np.array([top, below, bars], dtype=object), fig)


def _word(record) -> str:
    """Return what the output is called: a position or an angle, a velocity or a speed."""
    turns = "rad" in record.output_unit
    words = {"position": ("Position", "Angle"), "velocity": ("Velocity", "Speed")}
    return words.get(record.output, ("Output", "Output"))[turns]


def _readable(values, unit):
    """Return factor and unit that make numbers of order one to a thousand: micrometres rather than 1e-6 m."""
    largest = float(np.max(np.abs(values), initial=0.0))
    if unit not in ("m", "rad", "N", "m/s", "rad/s") or largest == 0 or largest >= 0.5:
        return 1.0, unit
    for factor, prefix in ((1e3, "m"), (1e6, "µ"), (1e9, "n")):
        if factor * largest >= 0.5:
            return factor, prefix + unit
    return 1.0, unit


def _regions(ax, regions, rows):
    """Bars: share of the error; ticks: share of the samples. Filled where beyond chance."""
    significant = regions.significant
    shown = (significant if len(significant) else regions)[:rows][::-1]
    ax.set_title(
        "Where the error is" if len(significant) else "No region stands out", loc="left", fontsize=10
    )
    if not shown:
        ax.set_axis_off()
        return []
    place = np.arange(len(shown))
    share = [100 * r.share for r in shown]
    colour = [_ERROR if r.p_value < 0.01 else "0.8" for r in shown]
    bars = list(ax.barh(place, share, 0.42, color=colour))
    for i, region in enumerate(shown):
        expected = 100 * region.expected_share
        ax.plot([expected, expected], [i - 0.21, i + 0.21], color="black", lw=1.5)
        ax.text(0, i + 0.27, f"{region.kind.replace('_', ' ')}: {region.label}", fontsize=8, va="bottom")
    ax.set_yticks([])
    ax.set_ylim(min(len(shown), 5) - 5.6, len(shown) - 0.1)  # few bars stay slim, at the top
    ax.set_xlabel("Share of squared error [%]\n(black: share of the samples)", fontsize=9)
    return bars
