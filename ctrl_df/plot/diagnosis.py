"""The ranking of candidates, and the residual before and after the best."""

from __future__ import annotations

import control as ct
import matplotlib.pyplot as plt
import numpy as np


def plot_diagnosis(diagnosis, *, rows=8, title=None, **keywords) -> ct.ControlPlot:
    """Draw a `Diagnosis`: held-out error of every candidate beside that of the refitted model and the noise.

    Parameters
    ----------
    diagnosis : Diagnosis
    rows : int
        Candidates shown.
    title : str or None
        Over the picture.
    """
    if keywords:
        raise TypeError(f"unrecognized keyword(s): {', '.join(keywords)}")
    shown = diagnosis.ranking[:rows]
    fig = plt.gcf() if not plt.gcf().axes else plt.figure()
    fig.set_size_inches(8, 0.9 + 0.42 * (len(shown) + 1))
    ax = fig.add_subplot()
    values = [diagnosis.nrmse_holdout, *(c.nrmse_holdout for c in shown)]
    labels = ["nothing added", *(c.id.replace("_", " ") for c in shown)]
    shades = ["0.75"] + ["#1f4e9c" if c is diagnosis.best else "#9db4d8" for c in shown]
    at = np.arange(len(values))[::-1]
    bars = ax.barh(at, 100 * np.array(values), color=shades, height=0.62)
    for y, value, c in zip(at, values, [None, *shown], strict=True):
        text = f" {value:.2%}" + ("" if c is None or c.probability < 0.005 else f"   p = {c.probability:.0%}")
        if c is not None and c.equivalents:
            text += "   same as " + ", ".join(e.replace("_", " ") for e in c.equivalents)
        ax.text(100 * value, y, text, va="center", fontsize=8)
    ax.set_yticks(at, labels)
    ax.set_xlabel("Held-out error, rms over rms of the output [%]")
    ax.set_xlim(0, 100 * max(values) * 1.45)
    ax.spines[["top", "right"]].set_visible(False)
    fig.suptitle(f"Verdict: {diagnosis.verdict}" if title is None else title, fontsize=11)
    fig.tight_layout()
    lines = np.empty(1, dtype=object)
    lines[0] = list(bars)
    return ct.ControlPlot(lines, np.array([ax], dtype=object), fig)
