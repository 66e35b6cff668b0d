"""Measured tables N(A, omega) beside a model, and the print a missing effect leaves on the plane."""

from __future__ import annotations

import control as ct
import matplotlib.pyplot as plt
import numpy as np

from ...numerals import digits
from ..parts.curves import log_ticks
from ..parts.page import legend_above, page
from .diagnosis import draw_ranking, verdict_title


def table_comparison_plot(comparison, record=None, *, title=None, curves=6, width=None) -> ct.ControlPlot:
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
    width : float or None
        Of a new figure [in].
    """
    chosen = comparison.worst if record is None else comparison.records[record]
    data = chosen.record
    with page(0.62, narrow=2.1, width=width) as drawn:
        found = drawn.rows(
            wide=["ne", "pe"], narrow=["n", "p", "e"], width_ratios=(1.25, 1), narrow_ratios=(1.2, 1, 1.2)
        )
        top, below, plane = found["n"], found["p"], found["e"]
        below.sharex(top)
        dots, lines = _over_frequency(top, below, data, chosen, curves)
        legend_above(top, f"error {digits(100 * chosen.nrmse)} % of |N| (dots measured, lines model)")
        cells = error_plane(drawn.figure, plane, data, np.abs(chosen.relative))
        plane.set_title("error over the plane")
        drawn.keep = [top, below, plane]
        return drawn.finished([dots, lines, [cells]], data.name if title is None else title)


def _over_frequency(top, below, data, chosen, curves):
    """Draw magnitude and phase at a few amplitudes; return measured dots and the model's lines."""
    dots, lines = [], []
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
        dots += top.loglog(w, np.abs(measured), "o", color=shade, ms=3)
        lines += top.loglog(w, np.abs(model), "-", color=shade, lw=1.1)
        below.semilogx(w, phase, "o", color=shade, ms=3)
        below.semilogx(w, phase + step, "-", color=shade, lw=1.1)
        lines[-1].set_label(f"{digits(data.A[i])} {data.input_unit}")
    top.set_ylabel(f"|N| [{data.output_unit}/{data.input_unit}]")
    below.set_ylabel("phase [deg]")
    below.set_xlabel("frequency ω [rad/s]")
    for ax in (top, below):
        ax.grid(True, which="major")
    log_ticks(below.xaxis, data.omega.min(), data.omega.max())
    top.tick_params(which="both", labelbottom=False)
    return dots, lines


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
    ax.set_xlabel("frequency ω [rad/s]")
    ax.set_ylabel(f"amplitude A [{data.input_unit}]")
    log_ticks(ax.xaxis, data.omega.min(), data.omega.max())
    log_ticks(ax.yaxis, data.A.min(), data.A.max())
    if bar:
        fig.colorbar(picture, ax=ax, label="error [% of |N|]", shrink=0.85)
    return picture


def _edges(values):
    """Return cell limits half way, on a logarithmic axis, between the values."""
    place = np.log(values)
    if len(place) == 1:
        return np.exp([place[0] - 0.1, place[0] + 0.1])
    middle = 0.5 * (place[1:] + place[:-1])
    return np.exp(np.concatenate([[2 * place[0] - middle[0]], middle, [2 * place[-1] - middle[-1]]]))


def plot_frequency_diagnosis(diagnosis, *, rows=6, title=None, width=None) -> ct.ControlPlot:
    """Draw a `FrequencyDiagnosis`: the ranking, and the error on the plane before and after the first of it.

    Parameters
    ----------
    diagnosis : FrequencyDiagnosis
    rows : int
        Candidates shown.
    title : str or None
        Over the picture.
    width : float or None
        Of a new figure [in].
    """
    inches = 0.9 + 0.3 * (min(rows, len(diagnosis.ranking)) + 1)
    with page((inches + 2.9) / 7, narrow=(inches + 4.4) / 3.3, width=width) as drawn:
        found = drawn.rows(
            wide=["rr", "ba"], narrow=["r", "b", "a"], height_ratios=(inches, 2.9),
            narrow_ratios=(inches, 2.2, 2.2),
        )  # fmt: skip
        ax, left, right = found["r"], found["b"], found["a"]
        i = diagnosis.before.records.index(diagnosis.before.worst)
        before, after = (np.abs(c.records[i].relative) for c in (diagnosis.before, diagnosis.after))
        both = np.concatenate([before[before > 0], after[after > 0]])
        limits = (float(np.nanquantile(both, 0.05)), float(np.nanmax(both))) if len(both) else None
        data = diagnosis.before.records[i].record
        error_plane(drawn.figure, left, data, before, limits, bar=drawn.narrow)
        error_plane(drawn.figure, right, data, after, limits)
        left.set_title(f"model refitted, {digits(100 * diagnosis.nrmse)} %")
        name = diagnosis.ranking[0].id.replace("_", " ") if diagnosis.ranking else "nothing"
        error = diagnosis.ranking[0].nrmse if diagnosis.ranking else diagnosis.nrmse
        right.set_title(f"with {name}, {digits(100 * error)} %")
        if not drawn.narrow:
            right.set_ylabel("")
        ax.set_xlabel("held-out error, rms over |N| [%]")
        drawn.keep = [ax, left, right]
        done = drawn.finished([], verdict_title(diagnosis, title))
        lines = np.empty(1, dtype=object)
        lines[0] = list(draw_ranking(ax, diagnosis, rows))
        return ct.ControlPlot(lines, done.axes, done.figure)
