"""The ranking of candidates: what each leaves on held-out data."""

from __future__ import annotations

import control as ct
import matplotlib.pyplot as plt
import numpy as np

from ...identify.monitor import COMPLETE
from ...identify.results.diagnosis import rivals
from ...numerals import certainty, digits
from ..parts.labels import settle
from ..parts.page import MODEL, OTHER, QUIET, page


def plot_diagnosis(diagnosis, *, rows=8, title=None, width=None) -> ct.ControlPlot:
    """Draw a `Diagnosis`: held-out error of every candidate beside that of the refitted model.

    Parameters
    ----------
    diagnosis : Diagnosis
    rows : int
        Candidates shown.
    title : str or None
        Over the picture.
    width : float or None
        Of a new figure [in].
    """
    inches = 1.0 + 0.3 * (min(rows, len(diagnosis.ranking)) + 1)
    with page(inches / 7.0, narrow=inches / 3.3, width=width) as drawn:
        ax = drawn.panels(1)[0]
        bars = draw_ranking(ax, diagnosis, rows)
        of = "acceleration" if diagnosis.measure == "acceleration" else "output"
        what = "held-out error" if errors_shown(diagnosis) == "nrmse_holdout" else "error"
        ax.set_xlabel(f"{what}, rms over rms of the {of} [%]")
        return drawn.finished([bars], verdict_title(diagnosis, title))


def errors_shown(diagnosis) -> str:
    """Return which errors are drawn: the held-out ones, unless the diagnosis ended before it knew them."""
    return "nrmse_holdout" if np.isfinite(diagnosis.nrmse_holdout) else "nrmse"


def verdict_title(diagnosis, title) -> str:
    """Return the title given, or the verdict in words."""
    if title is not None:
        return title
    if diagnosis.status != COMPLETE:
        first = "nothing" if diagnosis.best is None else diagnosis.best.id.replace("_", " ")
        return f"Not complete ({diagnosis.status}); first so far: {first}"
    if diagnosis.verdict not in ("effect", "ambiguous") or not diagnosis.ranking:
        several = "Missing: several effects, or one outside the library"
        return {"none": "Nothing missing"}.get(diagnosis.verdict, several)
    open_ones = rivals(diagnosis.ranking) if diagnosis.verdict == "ambiguous" else []
    names = [c.id.replace("_", " ") for c in (diagnosis.ranking[0], *open_ones)]
    known = "Missing" if open_ones or diagnosis.verdict == "effect" else "Missing, not confirmed"
    return f"{known}: {' or '.join(dict.fromkeys(names))}"


def draw_ranking(ax, diagnosis, rows):
    """Draw one bar a candidate, best on top; bars that leave the picture are cut and say their value."""
    shown = diagnosis.ranking[:rows]
    entries = [None, *shown]
    of = errors_shown(diagnosis)
    values = 100 * np.array([getattr(d, of) for d in (diagnosis, *shown)])
    labels = ["nothing added", *(c.id.replace("_", " ") for c in shown)]
    shades = [QUIET] + [MODEL if c is diagnosis.best else OTHER for c in shown]
    # A candidate far worse than the model without it must not squeeze the others.
    end = 1.15 * max(values[np.isfinite(values) & (values <= 2 * values[0])], default=1.0)
    at = np.arange(len(values))[::-1]
    known = np.isfinite(values)
    # An error of next to nothing is still a line: a bar's edge has a width.
    bars = ax.barh(
        at, np.where(known, np.minimum(values, end), 0.0), color=shades, height=0.62, edgecolor=shades,
        linewidth=np.where(known, 2.0, 0.0),
    )  # fmt: skip
    ax.set_yticks(at, labels)
    ax.set_ylim(-0.6, len(values) - 0.4)
    small = plt.rcParams["legend.fontsize"]
    notes = []
    for y, value, c in zip(at, values, entries, strict=True):
        if not np.isfinite(value):
            notes.append(ax.text(0, y, " not confirmed", va="center", fontsize=small, color="0.45"))
            continue
        text = f"  {digits(value)} %" + (" >>" if value > end else "")
        if c is not None and diagnosis.names_effects and c.probability >= 0.005:
            sure = certainty(c.probability)
            text += f"  p {sure}" if sure.startswith(">") else f"  p = {sure}"
        if c is not None and c.equivalents:
            same = [e.replace("_", " ") for e in c.equivalents]
            text += ", not told from " + ", ".join(same[:2]) + (" …" if len(same) > 2 else "")
        notes.append(ax.text(min(value, end), y, text, va="center", fontsize=small))
    _make_room(ax, end, notes)
    return bars


def _make_room(ax, end, notes):
    """Widen the axis until what is written behind the bars fits."""
    ax.set_xlim(0, end)
    settle(ax.figure)
    renderer = ax.figure.canvas.get_renderer()
    whole = ax.get_window_extent(renderer).width
    share = 1.0
    for note in notes:
        wide = note.get_window_extent(renderer).width
        share = min(share, max(0.15, (1 - wide / whole) * end / max(note.get_position()[0], 1e-12 * end)))
    ax.set_xlim(0, end / share)
