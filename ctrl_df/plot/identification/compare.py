"""Measured and simulated output, the residual, and where the error lies, in one picture."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping

import control as ct
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import FuncFormatter

from ...blocks.coordinates import moving_in
from ...checks import known_name, shown
from ...identify.data.quantities import word_of
from ...identify.prediction.segments import facts
from ...numerals import digits, probability
from ..parts.page import ERROR, MEASURED, MODEL, legend_above, page

_LOOKS = ((MODEL, "-"), ("#b3541e", "--"), ("#1b7837", "-."), ("k", ":"))


def comparison_plot(
    comparison, record=None, *, output=None, beside=(), labels=(), title=None, rows=8, width=None
) -> ct.ControlPlot:
    """Draw a `Comparison`; see `ctrl_df.identify.compare.Comparison.plot`.

    Parameters
    ----------
    comparison : Comparison
    record : int or None
        Which record; None: the one with the largest error.
    output : str or None
        Which of several outputs, by quantity; None: the one that leads.
    beside : Comparison, sequence or mapping of them
        Of other models with the same records, drawn in the same picture; a mapping gives their names.
    labels : sequence of str
        Names of the models: that of `comparison` first.
    title : str or None
        Over the picture.
    rows : int
        Regions shown.
    width : float or None
        Of a new figure [in].
    """
    others, named = compared("plot", "beside", beside)
    labels = labels or (["model 1", *named] if named else ())
    index = comparison.records.index(comparison.worst) if record is None else record
    choices = comparison.records[index].by_output
    quantity = known_name("plot", "output", output or next(iter(choices)), choices)
    models = [c.records[index].by_output[quantity] for c in (comparison, *others)]
    chosen, data = models[0], models[0].record
    if any(len(m.residual) != len(chosen.residual) for m in models):
        raise ValueError("comparisons in one picture need the same records; these differ in length.")
    names = [*labels, *(f"model {i + 1}" for i in range(len(labels), len(models)))]
    if len(models) == 1 and not labels:
        names = ["simulated"]
    with page(0.72, narrow=1.9, width=width) as drawn:
        found = drawn.rows(
            wide=["yw", "ew"], narrow=["y", "e", "w"], width_ratios=(2.0, 1), narrow_ratios=(1.2, 1, 1.3)
        )
        top, below, bars = found["y"], found["e"], found["w"]
        below.sharex(top)
        drawn.keep = [top, below, bars]
        lines = np.empty(3, dtype=object)
        lines[0] = top.plot(data.t, data.y, color=MEASURED, lw=2.6, label="measured")
        lines[1] = []
        factor, small = _readable(np.concatenate([m.residual for m in models]), data.output_unit)
        size, unit = _readable(data.y, data.output_unit)
        for m, name, (color, style) in zip(models, names, _LOOKS, strict=False):
            lines[0] += top.plot(data.t, m.simulated, color=color, ls=style, lw=1.0, label=name)
            color = ERROR if len(models) == 1 else color
            lines[1] += below.plot(data.t, m.residual, color=color, ls=style, lw=0.7)
        top.set_ylabel(f"{word_of(chosen.record.output_unit)} [{unit}]")
        top.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{size * value:.4g}"))
        below.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{factor * value:.4g}"))
        over = "free run" if chosen.windows == 1 else f"{chosen.windows} segments"
        heading = f"{over}: nrmse {chosen.nrmse:.3g}, fit {chosen.fit_percent:.2f} %"
        if len(models) > 1:
            heading = f"{over}: nrmse " + ", ".join(f"{m.nrmse:.3g}" for m in models)
        legend_above(top, heading)
        white = chosen.white
        below.set_title(
            f"rmse {digits(factor * chosen.rmse)} {small}; {'white' if white else 'not white'} "
            f"(p{probability(white.p_value)})"
        )
        below.set_ylabel(f"measured - simulated [{small}]")
        below.set_xlabel("time [s]")
        for edge in chosen.edges[1:-1]:
            for ax in (top, below):
                ax.axvline(data.t[edge], color="0.85", lw=0.6, zorder=0)
        said = moving_in(facts(data).units[0]).text
        lines[2] = _regions(bars, chosen.stands_out, rows, said)
        top.tick_params(labelbottom=False)
        return drawn.finished(lines, data.name if title is None else title)


def compared(owner: str, name: str, beside) -> tuple[list, list[str]]:
    """Return comparisons given alone, in a row or by name, and these names."""
    named = list(beside) if isinstance(beside, Mapping) else []
    rows = list(beside.values()) if named else [beside]
    if isinstance(beside, Iterable) and not named:
        rows = list(beside)
    for row in rows:
        if not hasattr(row, "records"):
            raise TypeError(
                f"{owner} needs {name} as what compare() returns, several of them, or a mapping of names to "
                f"them; got {shown(row)}."
            )
    return rows, [str(key) for key in named]


def _readable(values, unit):
    """Return factor and unit that make numbers of order one to a thousand: micrometres rather than 1e-6 m."""
    largest = float(np.max(np.abs(values), initial=0.0))
    if unit not in ("m", "rad", "N", "m/s", "rad/s") or largest == 0 or largest >= 0.5:
        return 1.0, unit
    for factor, prefix in ((1e3, "m"), (1e6, "µ"), (1e9, "n")):
        if factor * largest >= 0.5:
            return factor, prefix + unit
    return 1.0, unit


def _regions(ax, regions, rows, said):
    """Bars: share of the error, filled where beyond chance; ticks: of the samples; `said`: in whose words."""
    significant = regions.significant
    shown = (significant if len(significant) else regions)[:rows][::-1]
    ax.set_title(said(regions.heading) if len(significant) else "no region stands out")
    if not shown:
        ax.set_axis_off()
        return []
    place = np.arange(len(shown))
    share = [100 * r.share for r in shown]
    colour = [ERROR if r.p_value < 0.01 else "0.8" for r in shown]
    bars = list(ax.barh(place, share, 0.36, color=colour))
    for i, region in enumerate(shown):
        ax.vlines(
            [100 * share for share in [region.expected_share] if share > 0],
            i - 0.18,
            i + 0.18,
            color="black",
            lw=1.5,
        )
        words = f"{said(region.kind.replace('_', ' '))}{regions.apart}{region.label}"
        words = "\n".join(textwrap.wrap(words, 36))
        ax.annotate(
            words, (0, i + 0.22), xytext=(2, 0), textcoords="offset points", va="bottom", linespacing=0.95,
            fontsize=plt.rcParams["legend.fontsize"],
        )  # fmt: skip
    ax.set_yticks([])
    ax.set_ylim(min(len(shown), 5) - 5.6, len(shown) - 0.1)  # few bars stay slim, at the top
    ax.set_xlim(0, max(1.25 * max(share), 1.05 * max(100 * r.expected_share for r in shown)))
    ax.set_xlabel(regions.measure)
    return bars
