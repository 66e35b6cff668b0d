"""Picture of a family's harmonic content."""

from __future__ import annotations

import control as ct
import matplotlib.pyplot as plt
import numpy as np

from ..calls import keywords_of
from ..df.family import within
from ..numerals import digits
from .parts.curves import in_brackets, labels_of, log_ticks, memoryless, short, units
from .parts.keywords import check_keywords
from .parts.page import page

_HARMONIC_STYLES = (("-", "o"), ("--", "s"), ("-", "^"), ("--", "v"), ("-.", "D"), (":", "x"))


def plot_harmonics(
    family, *, ax=None, title=None, orders=None, amplitude=None, omega=None, width=None, **kwargs
) -> ct.ControlPlot:
    """Draw |Y_k| / A over frequency and over amplitude, both axes logarithmic.

    Parameters
    ----------
    family : Family
    ax : matplotlib Axes or pair of Axes, optional
        One axes draws over frequency if the family has several, else over amplitude.
    title : str, optional
    orders : sequence of int, optional
        Harmonics drawn; default 1 to 5.
    amplitude, omega : float, optional
        Where the cuts are made, nearest grid value; default the middle of the grid. ValueError outside it.
    width : float, optional
        Of a new figure [in].
    **kwargs
        Line properties.

    Returns
    -------
    ControlPlot
    """
    check_keywords("plot_harmonics", keywords_of(plot_harmonics)[1:], kwargs)
    orders = [k for k in (orders or range(1, 6)) if k <= family.orders]
    force, gain, _ = units(family)
    i = _nearest("amplitude", amplitude, family.amplitudes)
    k = _nearest("omega", omega, family.omega)
    over_w, over_a = family.omega.size > 1 and not memoryless(family), family.amplitudes.size > 1
    panels = [name for name, wanted in (("omega", over_w), ("amplitude", over_a)) if wanted] or ["amplitude"]
    shape = (0.52, 1.5) if len(panels) > 1 else (0.65, 0.85)
    with page(shape[0], narrow=shape[1], width=width, ax=ax) as drawn:
        axes = drawn.panels(len(panels), sharey=True)
        lines = np.empty((1, len(axes)), dtype=object)
        ends = []
        for j, (panel, axis) in enumerate(zip(panels, axes, strict=False)):
            if panel == "omega":
                x, y = family.omega, np.abs(family.harmonics[i])
                where = f"A = {digits(family.amplitudes[i])}{force}"
                axis.set_xlabel("frequency ω [rad/s]")
            else:
                at = "" if memoryless(family) else f"ω = {digits(family.omega[k])} rad/s"
                x, y, where = family.amplitudes, np.abs(family.harmonics[:, k]), at
                axis.set_xlabel(f"amplitude A{in_brackets(force)}")
            lines[0, j], places = _draw_harmonics(axis, x, y, orders, where, kwargs)
            ends.append((axis, lines[0, j], places))
        for axis in axes[:: 1 if drawn.narrow else len(axes)]:
            axis.set_ylabel("|Yₖ| / A" + in_brackets(gain))
        drawn.finished([], title or f"Harmonic content of {short(family.description)}")
        for axis, curves, places in ends:
            _end_names(axis, curves, places)
        return ct.ControlPlot(lines, np.array(axes, dtype=object).reshape(1, -1), drawn.figure)


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
        options = {"color": shade, "ls": style, "marker": marker, "ms": 3.2, "lw": 1.3, **kwargs}
        options.setdefault("markevery", max(1, x.size // 8))
        drawn += ax.loglog(x, values, **options)
        places.append((k, x[live], values[live], shade))
    none = f"harmonics {', '.join(map(str, silent))}: none" if silent else ""
    note = ", ".join(text for text in (where, none) if text)
    ax.set_title(note)
    ax.grid(True, which="major")
    ax.margins(x=0.08)
    log_ticks(ax.xaxis, x.min(), x.max())
    return drawn, places


def _end_names(ax, lines, places):
    """Write each curve's order at its end; where the ends lie together, all orders in a legend."""
    labels = labels_of(ax, lines)
    ends = ((5, 0), (5, 6), (5, -6), (5, 12), (5, -12))
    names = [
        labels.write(f"{k}", [(x[-1], y[-1])], offsets=ends, color=shade)
        for k, x, y, shade in sorted(places, key=lambda place: place[2][-1])
    ]
    right = max((x[-1] for _, x, _, _ in places), default=0.0)
    if all(names) and all(x[-1] == right for _, x, _, _ in places):
        return
    for name in filter(None, names):
        name.remove()
    orders = [f"{k}" for k, *_ in places]
    ax.legend(
        lines, orders, title="harmonic", ncols=len(orders), columnspacing=1.0, handletextpad=0.4,
        frameon=True, framealpha=0.85, edgecolor="none",
    )  # fmt: skip


def _nearest(name, value, grid):
    if value is None:
        return grid.size // 2
    return int(np.abs(np.log(grid) - np.log(within("plot_harmonics", name, value, grid))).argmin())
