"""Picture of a family's harmonic content."""

from __future__ import annotations

import control as ct
import matplotlib.pyplot as plt
import numpy as np

from .curves import in_brackets, log_ticks, memoryless, plain_spines, short, units

_HARMONIC_STYLES = (("-", "o"), ("--", "s"), ("-", "^"), ("--", "v"), ("-.", "D"), (":", "x"))


def plot_harmonics(
    family, *, ax=None, title=None, orders=None, amplitude=None, omega=None, **kwargs
) -> ct.ControlPlot:
    """Draw |Y_k| / A over frequency (left) and over amplitude (right), both axes logarithmic.

    Parameters
    ----------
    family : Family
    ax : matplotlib Axes or pair of Axes, optional
        One axes draws over frequency if the family has several, else over amplitude.
    title : str, optional
    orders : sequence of int, optional
        Harmonics drawn; default 1 to 5.
    amplitude, omega : float, optional
        Where the cuts are made, nearest grid value; default the middle of the grid.
    **kwargs
        Line properties.

    Returns
    -------
    ControlPlot
    """
    orders = [k for k in (orders or range(1, 6)) if k <= family.orders]
    force, gain, _ = units(family)
    i = _nearest(family.amplitudes, amplitude)
    k = _nearest(family.omega, omega)
    over_w, over_a = family.omega.size > 1 and not memoryless(family), family.amplitudes.size > 1
    panels = [name for name, wanted in (("omega", over_w), ("amplitude", over_a)) if wanted] or ["amplitude"]
    if ax is None:
        fig = plt.figure(figsize=(1.8 + 4 * len(panels), 3.9), layout="constrained")
        axes = np.atleast_1d(fig.subplots(1, len(panels), sharey=True))
    else:
        axes = np.atleast_1d(ax)
        panels, fig = panels[: axes.size], axes[0].figure
    lines = np.empty((1, axes.size), dtype=object)
    for j, panel in enumerate(panels):
        if panel == "omega":
            x, y = family.omega, np.abs(family.harmonics[i])
            where = f"A = {family.amplitudes[i]:.3g}{force}"
            axes[j].set_xlabel(r"$\omega$ [rad/s]")
        else:
            at = "" if memoryless(family) else rf"$\omega$ = {family.omega[k]:.3g} rad/s"
            x, y, where = family.amplitudes, np.abs(family.harmonics[:, k]), at
            axes[j].set_xlabel(f"input amplitude A{in_brackets(force)}")
        lines[0, j] = _draw_harmonics(axes[j], x, y, orders, where, kwargs)
    axes[0].set_ylabel(r"$|Y_k|\,/\,A$" + in_brackets(gain))
    fig.suptitle(title or f"Harmonic content of {short(family.description)}", fontsize=10)
    return ct.ControlPlot(lines, axes.reshape(1, -1), fig)


def _draw_harmonics(ax, x, y, orders, where, kwargs):
    top = np.nanmax(y[:, orders[0]]) if np.isfinite(y[:, orders[0]]).any() else 1.0
    drawn, silent, places = [], [], []
    for k in orders:
        live = np.isfinite(y[:, k]) & (y[:, k] > 1e-9 * top)
        if not live.any():
            silent.append(k)
            continue
        style, marker = _HARMONIC_STYLES[(k - 1) % len(_HARMONIC_STYLES)]
        shade = plt.get_cmap("viridis")(min(0.85, 0.17 * (k - 1)))
        values = np.where(live, y[:, k], np.nan)
        options = {"color": shade, "ls": style, "marker": marker, "ms": 3.2, "lw": 1.5, **kwargs}
        options.setdefault("markevery", max(1, x.size // 8))
        drawn += ax.loglog(x, values, **options)
        last = np.nonzero(live)[0][-1]
        places.append((k, x[last], values[last], shade))
    none = f"harmonics {', '.join(map(str, silent))}: none" if silent else ""
    note = ", ".join(text for text in (where, none) if text)
    ax.set_title(note, loc="left", fontsize=8.5, color="0.3")
    ax.grid(True, which="major", color="0.9", lw=0.7)
    ax.margins(x=0.08)
    log_ticks(ax.xaxis, x.min(), x.max())
    plain_spines(ax)
    _end_names(ax, places)
    return drawn


def _end_names(ax, places, apart=8.0):
    """Write each curve's order at its end, names at one place moved apart (in points)."""
    ax.figure.draw_without_rendering()  # a constrained layout moves the axes
    points = 72.0 / ax.figure.dpi
    written: list[tuple[float, float]] = []
    for k, x, y, shade in sorted(places, key=lambda place: place[2]):
        across, up = points * ax.transData.transform((x, y))
        near = [at for over, at in written if abs(over - across) < apart]
        lifted = max([up, *(at + apart for at in near)])
        written.append((across, lifted))
        ax.annotate(
            f"{k}",
            (x, y),
            xytext=(5, lifted - up),
            textcoords="offset points",
            color=shade,
            va="center",
            fontsize=9,
        )


def _nearest(grid, value):
    if value is None:
        return grid.size // 2
    return int(np.abs(np.log(grid) - np.log(value)).argmin())
