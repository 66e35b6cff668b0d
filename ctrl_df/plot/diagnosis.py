"""The ranking of candidates: what each leaves on held-out data."""

from __future__ import annotations

import control as ct
import numpy as np

from .sheet import finished, sheet

_BEST, _OTHER, _NOTHING = "#1f4e9c", "#9db4d8", "0.75"


def plot_diagnosis(diagnosis, *, rows=8, title=None, **keywords) -> ct.ControlPlot:
    """Draw a `Diagnosis`: held-out error of every candidate beside that of the refitted model.

    Parameters
    ----------
    diagnosis : Diagnosis
    rows : int
        Candidates shown.
    title : str or None
        Over the picture.
    """
    fig = sheet(8, 1.15 + 0.36 * (min(rows, len(diagnosis.ranking)) + 1), keywords)
    ax = fig.add_subplot()
    bars = draw_ranking(ax, diagnosis, rows)
    of = "acceleration" if diagnosis.measure == "acceleration" else "output"
    ax.set_xlabel(f"Held-out error, rms over rms of the {of} [%]")
    return finished(fig, [ax], [bars], verdict_title(diagnosis, title))


def verdict_title(diagnosis, title) -> str:
    """Return the title given, or the verdict."""
    return f"Verdict: {diagnosis.verdict}" if title is None else title


def draw_ranking(ax, diagnosis, rows):
    """Draw one bar a candidate, best on top; bars that leave the picture are cut and say their value."""
    shown = diagnosis.ranking[:rows]
    entries = [None, *shown]
    values = 100 * np.array([diagnosis.nrmse_holdout, *(c.nrmse_holdout for c in shown)])
    labels = ["nothing added", *(c.id.replace("_", " ") for c in shown)]
    shades = [_NOTHING] + [_BEST if c is diagnosis.best else _OTHER for c in shown]
    # A candidate far worse than the model without it must not squeeze the others.
    end = 1.15 * max(values[np.isfinite(values) & (values <= 2 * values[0])], default=1.0)
    at = np.arange(len(values))[::-1]
    known = np.isfinite(values)
    bars = ax.barh(at, np.where(known, np.minimum(values, end), 0.0), color=shades, height=0.62)
    for y, value, c in zip(at, values, entries, strict=True):
        if not np.isfinite(value):
            ax.text(0, y, " passed over at the first look", va="center", fontsize=8, color="0.45")
            continue
        text = f" {value:.3g} %" + (" >>" if value > end else "")
        if c is not None and c.probability >= 0.005:
            text += f"   p = {c.probability:.0%}"
        if c is not None and c.equivalents:
            text += "   same as " + ", ".join(e.replace("_", " ") for e in c.equivalents)
        ax.text(min(value, end), y, text, va="center", fontsize=8)
    ax.set_yticks(at, labels)
    ax.set_xlim(0, 1.9 * end)
    ax.set_ylim(-0.6, len(values) - 0.4)
    ax.spines[["top", "right"]].set_visible(False)
    return bars
