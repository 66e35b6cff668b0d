"""The map of what a loop does over two gains: regions, borders, frequencies and amplitudes of its cycles."""

from __future__ import annotations

from typing import Any

import control as ct
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ..blocks.mechanism import Mechanism
from ..gains.map import Fine, LimitCycleMap
from ..numerals import digits
from .parts.curves import in_brackets, plain_spines
from .parts.page import AMPLITUDE_COLOR, CROSSING_COLOR, NARROW, OMEGA_COLOR

_REST, _CYCLE, _BOTH, _HATCH = "#ffffff", "#d9d9d9", "#efefef", "////"


def plot_limit_cycle_map(
    gains_map: LimitCycleMap, *, ax=None, title=None, contours=True, checks=True
) -> ct.ControlPlot:
    """Draw a map over gains.

    Shaded where the loop cycles, hatched where large motions grow without bound, white where it comes to
    rest. Solid contours are frequencies, dashed ones amplitudes of the cycle: exact ones where enough points
    were simulated, else those of the smallest predicted stable cycle.

    Parameters
    ----------
    gains_map : LimitCycleMap
    ax : matplotlib Axes, optional
        Where to draw; default a new figure.
    title : str, optional
    contours : bool
        Whether to draw frequency and amplitude.
    checks : bool
        Whether to mark the points simulated.

    Returns
    -------
    ControlPlot
        ``lines[0]`` the linear border, ``lines[1]`` folds, ``lines[2]`` points simulated, ``lines[3]`` marks.

    Examples
    --------
    >>> import ctrl_df as cdf
    >>> axis = cdf.friction_mass(mass=9, coulomb=5, viscous=0.5)
    >>> gains = cdf.limit_cycle_map(axis, kp=(500, 4000), ki=(0, 80000), kd=130, exact_check=0)
    >>> cplt = gains.plot()
    >>> cplt.axes[0, 0].get_xlabel()
    'kp [N/m]'
    """
    if ax is None:
        figure = plt.figure(figsize=(6.4, 4.8), layout="constrained")
        ax = figure.add_subplot()
    else:
        ax = np.ravel(ax)[0]
        figure = ax.figure
    ax.set_xlim(gains_map.x[0], gains_map.x[-1])
    ax.set_ylim(gains_map.y[0], gains_map.y[-1])
    narrow = figure.get_figwidth() * ax.get_position().width < NARROW
    fine = gains_map.fine()
    names = _regions(ax, fine)
    drawn = np.empty(4, dtype=object)
    drawn[0] = [ax.plot(*c.T, color="k", lw=1.8, zorder=4)[0] for c in gains_map.linear_border]
    drawn[1] = [
        ax.plot(c[:, 0], c[:, 1], color="k", lw=1.2, ls=(0, (5, 2)), zorder=4)[0] for c in gains_map.folds
    ]
    handles: list[Any] = [Patch(fc=color, ec="0.4", hatch=hatch, label=name) for name, color, hatch in names]
    if drawn[0]:
        handles.append(Line2D([], [], color="k", lw=1.8, label="linear stability border"))
    if drawn[1]:
        handles.append(Line2D([], [], color="k", lw=1.2, ls=(0, (5, 2)), label="fold (predicted)"))
    labels = []
    if contours:
        labels, more = _contours(ax, gains_map, fine, 3 if narrow else 5)
        handles += more
    drawn[2] = _checks(ax, gains_map, handles) if checks else []
    drawn[3] = _marks(ax, gains_map)
    units = gains_map.units
    ax.set_xlabel(gains_map.free[0] + in_brackets(units[gains_map.free[0]]))
    ax.set_ylabel(gains_map.free[1] + in_brackets(units[gains_map.free[1]]))
    third = ", ".join(
        f"{name} = {value:.4g} {units[name]}".rstrip() for name, value in gains_map.fixed.items()
    )
    ax.set_title(third if title is None else title, fontsize=9 if narrow else 10)
    plain_spines(ax)
    figure.legend(
        handles=handles, loc="outside lower center" if figure.get_layout_engine() else "lower center",
        ncols=2 if narrow else 3, fontsize=6.5 if narrow else 8, frameon=False, handlelength=2.2,
        columnspacing=1.2,
    )  # fmt: skip
    figure.draw_without_rendering()
    _clear(figure, labels, drawn[3])
    return ct.ControlPlot(drawn, np.array([[ax]]), figure)


def _regions(ax, fine: Fine):
    """Shade and hatch; return (name, color, hatch) of what there is."""
    has = {name: (np.char.find(fine.verdict, name) >= 0).T.astype(float) for name in ("cycles", "diverges")}
    if has["cycles"].any():
        ax.contourf(fine.x, fine.y, has["cycles"], levels=[0.5, 2], colors=[_CYCLE], zorder=0)
    if has["diverges"].any():
        filled = ax.contourf(
            fine.x, fine.y, has["diverges"], levels=[0.5, 2], colors="none", hatches=[_HATCH], zorder=1
        )
        filled.set_edgecolor("0.55")
        filled.set_linewidth(0)
    alike: dict = {}  # what looks the same stands in the legend once
    for name, color, hatch in (
        ("rests", _REST, ""), ("rests or cycles", _CYCLE, ""), ("cycles", _CYCLE, ""),
        ("rests or cycles or diverges", _CYCLE, _HATCH), ("cycles or diverges", _CYCLE, _HATCH),
        ("rests or diverges", _REST, _HATCH), ("diverges", _REST, _HATCH),
    ):  # fmt: skip
        if (fine.verdict == name).any():
            alike.setdefault((color, hatch), []).append(name)
    return [(_joined(words), color, hatch) for (color, hatch), words in alike.items()]


def _joined(words):
    """Name regions that look the same: what all of them do, in brackets what only some do."""
    sets = [word.split(" or ") for word in words]
    every = [w for w in sets[-1] if all(w in s for s in sets)]
    some = sorted({w for s in sets for w in s} - set(every))
    return " or ".join(every) + (f" (or {' or '.join(some)})" if some else "")


def _contours(ax, gains_map, fine, count):
    """Draw frequency and output amplitude of the cycle; return their labels and what the legend needs."""
    scale, unit = _output_scale(gains_map)
    labels, handles = [], []
    kind = "exact" if fine.exact else "predicted"
    for values, color, style, name in (
        (fine.omega, OMEGA_COLOR, "-", "frequency [rad/s]"),
        (scale * fine.output_amplitude, AMPLITUDE_COLOR, "--", f"amplitude{in_brackets(unit)}"),
    ):
        levels = _levels(values[np.isfinite(values)], count)
        if not levels.size:
            continue
        where = fine.x, fine.y, np.ma.masked_invalid(values.T)
        lines = ax.contour(*where, levels=levels, colors=color, linestyles=style, linewidths=1.1, zorder=3)
        labels += list(ax.clabel(lines, fontsize=7.5, fmt=digits, inline=True, inline_spacing=2))
        handles.append(Line2D([], [], color=color, ls=style, lw=1.1, label=f"{name}, {kind}"))
    return labels, handles


def _levels(values, count):
    """Round numbers, evenly in logarithm, within the bulk of some values."""
    values = values[values > 0]
    if values.size < 2:
        return np.zeros(0)
    low, high = np.quantile(values, [0.05, 0.95])
    if high < 1.02 * low:
        return np.zeros(0)
    even = np.geomspace(low, high, count + 2)[1:-1]
    digits = 1 - np.floor(np.log10(even)).astype(int)
    return np.unique([round(v, d) for v, d in zip(even, digits, strict=True)])


def _output_scale(gains_map):
    block = gains_map.structure.block
    if not isinstance(block, Mechanism):
        return 1.0, ""
    unit = block.signals[gains_map.structure.output or block.output_labels[0]]
    values = gains_map.output_amplitude[np.isfinite(gains_map.output_amplitude)]
    values = [c.orbit.output_amplitude for c in gains_map.checks if c.orbit] or values
    small = len(values) > 0 and np.median(values) < 0.1
    return (1e3, f"m{unit}") if small and unit in ("m", "rad") else (1.0, unit)


def _checks(ax, gains_map, handles):
    """Mark what was simulated: filled where it cycles."""
    drawn = []
    for cycles, fill, name in ((True, "0.25", "simulated: cycles"), (False, "white", "simulated: no cycle")):
        at = [c.gains for c in gains_map.checks if c.cycles == cycles]
        if at:
            x, y = ([g[name_] for g in at] for name_ in gains_map.free)
            style: Any = dict(ls="none", marker="o", ms=2.8, mfc=fill, mec="0.25", mew=0.6)
            drawn += ax.plot(x, y, zorder=5, clip_on=False, **style)
            handles.append(Line2D([], [], label=name, **style))
    return drawn


def _marks(ax, gains_map):
    """Mark the gains that were named."""
    drawn = []
    for name, at in gains_map.marks.items():
        x, y = (at[gain] for gain in gains_map.free)
        ax.plot(x, y, "*", ms=11, mfc=CROSSING_COLOR, mec="white", mew=0.8, zorder=7)
        right = x > 0.6 * gains_map.x[-1] + 0.4 * gains_map.x[0]
        drawn.append(
            ax.annotate(
                name, (x, y), xytext=(-7 if right else 7, 5), textcoords="offset points",
                ha="right" if right else "left", color=CROSSING_COLOR, fontsize=9, fontweight="bold",
                zorder=7,
                bbox=dict(boxstyle="round,pad=0.15", fc="white", ec="none", alpha=0.9),
            )
        )  # fmt: skip
    return drawn


def _clear(figure, labels, marks):
    """Leave out labels of contours that lie on a mark's name, on one another or over the rim."""
    renderer = figure.canvas.get_renderer()
    taken = [m.get_window_extent(renderer) for m in marks]
    for text in labels:
        box = text.get_window_extent(renderer)
        frame = text.axes.get_window_extent(renderer)
        inside = frame.x0 <= box.x0 and box.x1 <= frame.x1 and frame.y0 <= box.y0 and box.y1 <= frame.y1
        if not inside or any(box.overlaps(other) for other in taken):
            text.set_visible(False)
        else:
            taken.append(box)
