"""Measured tables N(A, omega) beside a model, and the print a missing effect leaves on the plane."""

from __future__ import annotations

import control as ct
import matplotlib.pyplot as plt
import numpy as np

from .diagnosis import draw_ranking, verdict_title
from .sheet import finished, sheet


def table_comparison_plot(comparison, record=None, *, title=None, curves=6, **keywords) -> ct.ControlPlot:
    """Draw a `FrequencyComparison`: magnitude and phase over frequency, dots measured, lines model; error.

    Parameters
    ----------
    comparison : FrequencyComparison
    record : int or None
        Which table; None: the one with the largest error.
    title : str or None
        Over the picture.
    curves : int
        Amplitudes drawn at most.
    """
    fig = sheet(9.5, 5.2, keywords)
    chosen = comparison.worst if record is None else comparison.records[record]
    data = chosen.record
    grid = fig.add_gridspec(2, 2, width_ratios=(1.25, 1), height_ratios=(1.3, 1))
    top = fig.add_subplot(grid[0, 0])
    below = fig.add_subplot(grid[1, 0], sharex=top)
    plane = fig.add_subplot(grid[:, 1])
    dots, curves_drawn = [], []
    rows = np.unique(np.linspace(0, len(data.A) - 1, min(curves, len(data.A))).astype(int))
    for i in rows:
        shade = plt.get_cmap("viridis")(0.85 * i / max(len(data.A) - 1, 1))
        good = np.isfinite(data.N[i]) & (data.N[i] != 0)  # what stood still has no place on these axes
        if not np.any(good):
            continue
        w, measured, model = data.omega[good], data.N[i, good], chosen.simulated[i, good]
        turn = 360 * np.round((np.degrees(np.angle(model / measured))) / 360)
        phase = np.degrees(np.unwrap(np.angle(measured)))
        phase -= 360 * np.ceil(np.max(phase) / 360 - 0.5)
        step = np.degrees(np.angle(model / measured)) - turn
        dots += top.loglog(w, np.abs(measured), "o", color=shade, ms=4)
        curves_drawn += top.loglog(w, np.abs(model), "-", color=shade, lw=1.2)
        below.semilogx(w, phase, "o", color=shade, ms=4)
        below.semilogx(w, phase + step, "-", color=shade, lw=1.2)
        curves_drawn[-1].set_label(f"{data.A[i]:.3g} {data.input_unit}")
    top.legend(frameon=False, fontsize=8, loc="lower left", handlelength=1.2, labelspacing=0.25)
    top.set_ylabel(f"|N| [{data.output_unit}/{data.input_unit}]")
    below.set_ylabel("Phase [deg]")
    below.set_xlabel("Frequency [rad/s]")
    top.set_title(f"error {chosen.nrmse:.2%} of |N| (dots measured, lines model)", loc="left", fontsize=10)
    cells = error_plane(fig, plane, data, np.abs(chosen.relative))
    for ax in (top, below):
        ax.spines[["top", "right"]].set_visible(False)
        ax.grid(True, which="major", color="0.92", lw=0.7)
    _plain_ticks(below.xaxis)
    top.tick_params(which="both", labelbottom=False)
    plane.set_title("Error over the plane", loc="left", fontsize=10)
    lines = [dots, curves_drawn, [cells]]
    return finished(fig, [top, below, plane], lines, data.name if title is None else title)


def error_plane(fig, ax, data, error, limits=None, bar=True):
    """Draw relative errors as cells over frequency and amplitude; grey where nothing was measured."""
    from matplotlib.colors import LogNorm

    good = error[np.isfinite(error) & (error > 0)]
    low, high = limits or (max(float(good.min()), 1e-6), float(good.max())) if len(good) else (1e-3, 1.0)
    colours = plt.get_cmap("magma_r").with_extremes(bad="0.92")
    picture = ax.pcolormesh(
        _edges(data.omega), _edges(data.A), np.ma.masked_invalid(100 * error), cmap=colours,
        norm=LogNorm(100 * low, max(100 * high, 101 * low)), edgecolors="w", linewidth=0.4,
    )  # fmt: skip
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xlabel("Frequency [rad/s]")
    ax.set_ylabel(f"Amplitude [{data.input_unit}]")
    _plain_ticks(ax.xaxis)
    _plain_ticks(ax.yaxis)
    if bar:
        fig.colorbar(picture, ax=ax, label="Error [% of |N|]", shrink=0.85)
    return picture


def _plain_ticks(axis):
    """Label a logarithmic axis at 1, 2, 5, 10, ... in plain numbers: it spans a decade or two."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(10, subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def _edges(values):
    """Return cell limits half way, on a logarithmic axis, between the values."""
    place = np.log(values)
    if len(place) == 1:
        return np.exp([place[0] - 0.1, place[0] + 0.1])
    middle = 0.5 * (place[1:] + place[:-1])
    return np.exp(np.concatenate([[2 * place[0] - middle[0]], middle, [2 * place[-1] - middle[-1]]]))


def plot_frequency_diagnosis(diagnosis, *, rows=6, title=None, **keywords) -> ct.ControlPlot:
    """Draw a `FrequencyDiagnosis`: the ranking, and the error on the plane before and after the first of it.

    Parameters
    ----------
    diagnosis : FrequencyDiagnosis
    rows : int
        Candidates shown.
    title : str or None
        Over the picture.
    """
    fig = sheet(9.5, 6.0, keywords)
    top, bottom = fig.add_gridspec(2, 1, height_ratios=(1, 1.15))
    ax = fig.add_subplot(top)
    bars = draw_ranking(ax, diagnosis, rows)
    ax.set_xlabel("Held-out error, rms over |N| [%]")
    grid = bottom.subgridspec(1, 2)
    left, right = fig.add_subplot(grid[0]), fig.add_subplot(grid[1])
    i = diagnosis.before.records.index(diagnosis.before.worst)
    before, after = (np.abs(c.records[i].relative) for c in (diagnosis.before, diagnosis.after))
    both = np.concatenate([before[before > 0], after[after > 0]])
    limits = (float(np.nanquantile(both, 0.05)), float(np.nanmax(both))) if len(both) else None
    data = diagnosis.before.records[i].record
    error_plane(fig, left, data, before, limits, bar=False)
    error_plane(fig, right, data, after, limits)
    left.set_title(f"model refitted, {diagnosis.nrmse:.2%}", loc="left", fontsize=10)
    name = diagnosis.ranking[0].id.replace("_", " ") if diagnosis.ranking else "nothing"
    error = diagnosis.ranking[0].nrmse if diagnosis.ranking else diagnosis.nrmse
    right.set_title(f"with {name}, {error:.2%}", loc="left", fontsize=10)
    right.set_ylabel("")
    return finished(fig, [ax, left, right], [bars], verdict_title(diagnosis, title))
