"""The error of every step of a ladder, beside the noise."""

from __future__ import annotations

import control as ct
import matplotlib.pyplot as plt
import numpy as np

OF = {
    "output": "Error [% of the output's rms]",
    "acceleration": "Error of the acceleration [% of its rms]",
    "N": "Error [% of |N|]",
}
"""What errors are drawn as shares of."""


def plot_ladder(study, *, title=None, **keywords) -> ct.ControlPlot:
    """Draw the error of each step on training and held-out data; the grey band is the noise floor.

    Parameters
    ----------
    study : Study
    title : str or None
        Over the picture.
    """
    if keywords:
        raise TypeError(f"unrecognized keyword(s): {', '.join(keywords)}")
    steps = study.steps
    fig = plt.gcf() if not plt.gcf().axes else plt.figure()
    fig.set_size_inches(max(5.5, 1.6 * len(steps) + 1.5), 3.6)
    ax = fig.add_subplot()
    at = np.arange(len(steps))
    train = 100 * np.array([s.nrmse for s in steps])
    held = 100 * np.array([s.nrmse_holdout for s in steps])
    lines = np.empty(3, dtype=object)
    lines[0] = list(ax.bar(at - 0.19, train, 0.36, color="#9db4d8"))
    lines[1] = list(ax.bar(at + 0.19, held, 0.36, color="#1f4e9c"))
    bottom = 0.5 * min(100 * study.noise, train.min(), held.min())
    lines[2] = [ax.axhspan(bottom, max(100 * study.noise, bottom * 1.001), color="0.85", zorder=0)]
    ax.set_yscale("log")
    ax.yaxis.set_major_formatter("{x:g}")
    ax.yaxis.set_minor_formatter(lambda x, _: f"{x:g}" if f"{x:.0e}"[0] in "25" else "")
    ax.set_ylim(bottom, 2.2 * max(train.max(), held.max()))
    for x, a, b in zip(at, train, held, strict=True):
        ax.text(x - 0.19, a * 1.05, f"{a:.3g}", ha="center", fontsize=8)
        ax.text(x + 0.19, b * 1.05, f"{b:.3g}", ha="center", fontsize=8)
    ax.text(at[0] - 0.19, train[0] * 0.8, "train", ha="center", va="top", fontsize=8, rotation=90)
    ax.text(
        at[0] + 0.19, held[0] * 0.8, "held out", ha="center", va="top", fontsize=8, rotation=90, color="w"
    )
    ax.set_xlim(-0.6, len(steps) - 0.4)
    ax.text(len(steps) - 0.38, 100 * study.noise, "noise", va="center", ha="left", fontsize=8)
    names = ["refitted", *("+ " + s.effect.replace("_", " ") for s in steps[1:])]
    ax.set_xticks(
        at,
        [
            n + "".join(f"\n{sign} {d.replace('_', ' ')}" for sign, d in s.changes)
            for n, s in zip(names, steps, strict=True)
        ],
    )
    ax.set_ylabel(OF[study.measure])
    ax.spines[["top", "right"]].set_visible(False)
    fig.suptitle("Error of every step" if title is None else title, fontsize=11)
    fig.tight_layout()
    return ct.ControlPlot(lines, np.array([ax], dtype=object), fig)
