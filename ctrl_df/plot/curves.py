"""What the pictures of -1/N share: views, curves and their labels, units, axes."""

from __future__ import annotations

import re

import matplotlib.pyplot as plt
import numpy as np
from matplotlib import ticker

from ..blocks.mechanism import Mechanism
from ..units import over

AMPLITUDE_COLOR, OMEGA_COLOR, NYQUIST_COLOR, CROSSING_COLOR = "#1f5a99", "#b3541e", "#222222", "#a3123a"


def memoryless(family) -> bool:
    """Whether N does not change with frequency in this family."""
    first, N = family.N[:, :1], family.N
    same = np.isclose(N, first, rtol=1e-12, atol=0, equal_nan=True)
    return bool(N.shape[1] == 1 or same.all())


def units(family) -> tuple[str, str, str]:
    """Units of A, of N and of -1/N, each with a space before it; empty where the block does not tell."""
    if not isinstance(family.block, Mechanism):
        return "", "", ""
    units = family.block.signals
    force, motion = units[family.block.input_labels[0]], units[family.output]
    return f" {force}", f" {over(motion, force)}", f" {over(force, motion)}"


def in_brackets(unit) -> str:
    """Return `` [unit]``, or nothing."""
    return f" [{unit.strip()}]" if unit else ""


def axes_for(ax):
    """Return (figure, axes): those given, an empty current figure's, or a new figure's."""
    if ax is not None:
        ax = np.asarray(ax, dtype=object).reshape(-1)[0]
        return ax.figure, ax
    fig = plt.gcf()
    if fig.axes:
        fig = plt.figure()
    return fig, fig.add_subplot()


def view_of(values, include=()) -> tuple[float, float, float, float]:
    """Limits (left, right, bottom, top) that show the bulk of complex values.

    With `include` they show its surroundings, as far as values lie there.
    """
    z = np.asarray(values).ravel()
    z = z[np.isfinite(z)]
    include = np.asarray(list(include), dtype=complex)
    if include.size:
        (left, right), (bottom, top) = (
            _around(part(z), part(include), include) for part in (np.real, np.imag)
        )
        low, high = complex(left, bottom), complex(right, top)
    elif z.size:
        reach = np.quantile(np.abs(z), 0.8)
        z = z[np.abs(z) <= reach * 1.001]
        low, high = complex(np.real(z).min(), np.imag(z).min()), complex(np.real(z).max(), np.imag(z).max())
    else:
        low, high = -1 - 1j, 1 + 1j
    left, right = min(low.real, 0.0), max(high.real, 0.0)
    bottom, top = min(low.imag, 0.0), max(high.imag, 0.0)
    width, height = max(right - left, 1e-12), max(top - bottom, 1e-12)
    height, width = max(height, 0.25 * width), max(width, 0.25 * height)
    mid_x, mid_y = 0.5 * (left + right), 0.5 * (bottom + top)
    return mid_x - 0.58 * width, mid_x + 0.58 * width, mid_y - 0.58 * height, mid_y + 0.58 * height


def _around(values, include, places):
    """Bounds about `include` that leave out what holds no values; the sizes of `places` set the margins."""
    size = 0.75 * np.abs(places).max()
    some = np.concatenate([values[np.abs(values - include[0]) <= 3 * size], include])
    spare = 0.25 * size
    low = max(include.min() - size, some.min() - spare)
    high = min(include.max() + size, some.max() + spare)
    return low, high


def set_view(ax, view):
    """Fix the limits of the picture."""
    ax.set_xlim(view[0], view[1])
    ax.set_ylim(view[2], view[3])


def draw_single(ax, amplitudes, curve, *, ticks=4, **kwargs):
    """Draw the one -1/N curve of a memoryless block, with a few amplitudes marked; return the line."""
    options = {"color": AMPLITUDE_COLOR, "lw": 1.8, **kwargs}
    finite = np.where(np.isfinite(curve), curve, np.nan)
    line = ax.plot(np.real(finite), np.imag(finite), **options)[0]
    inside = np.nonzero(_inside(ax, finite))[0]
    if inside.size:
        chosen = inside[np.unique(np.linspace(0, inside.size - 1, ticks).round().astype(int))]
        ax.plot(np.real(finite[chosen]), np.imag(finite[chosen]), ".", color=line.get_color(), ms=5)
        taken: list = []
        for i in chosen:
            text = f"{'A = ' if i == chosen[0] else ''}{amplitudes[i]:.3g}"
            _label(ax, finite[i], text, line.get_color(), taken, offset=(2, -12))
    return line


def draw_curves(ax, family, amplitudes=5, frequencies=5, **kwargs):
    """Draw -1/N at a few constant amplitudes (solid) and frequencies (dashed), labelled at their ends."""
    z = family.minus_inverse
    shown = _inside(ax, z)
    rows, columns = _chosen(shown.any(axis=1), amplitudes), _chosen(shown.any(axis=0), frequencies)
    solid, dashed, taken = [], [], []
    for n, i in enumerate(rows):
        options = {"color": AMPLITUDE_COLOR, "lw": 1.1, "alpha": 0.9, **kwargs}
        curve = unbroken(z[i], family.regime[i])
        solid += ax.plot(np.real(curve), np.imag(curve), **options)
        text = (
            f"A = {family.amplitudes[i]:.3g}{units(family)[0]}" if n == 0 else f"{family.amplitudes[i]:.3g}"
        )
        _end_label(ax, z[i], text, AMPLITUDE_COLOR, taken)
    for n, k in enumerate(columns):
        options = {"color": OMEGA_COLOR, "lw": 1.1, "ls": (0, (4, 2)), "alpha": 0.9, **kwargs}
        curve = unbroken(z[:, k], family.regime[:, k])
        dashed += ax.plot(np.real(curve), np.imag(curve), **options)
        text = f"ω = {family.omega[k]:.3g} rad/s" if n == 0 else f"{family.omega[k]:.3g}"
        _end_label(ax, z[:, k], text, OMEGA_COLOR, taken, from_start=True)
    return solid, dashed


def finish(ax, title, unit=""):
    """Axes through the origin, labels and title; `unit` that of -1/N."""
    ax.axhline(0, color="0.75", lw=0.8, zorder=0)
    ax.axvline(0, color="0.75", lw=0.8, zorder=0)
    ax.set_xlabel(f"Real part{in_brackets(unit)}")
    ax.set_ylabel(f"Imaginary part{in_brackets(unit)}")
    ax.set_title(title, fontsize=10)
    plain_spines(ax)


def short(text: str, most=46) -> str:
    """Shorten a description so that it fits a title: numbers go first, then the tail."""
    text = re.sub(r"\.with_effect\((\w+\([^()]*\))\)", r" + \1", text)
    if len(text) > most:
        text = re.sub(r"\([^()]*\)", "", text)
    return text if len(text) <= most else text[: most - 1] + "…"


def unbroken(curve, regime):
    """Cut a curve (by NaN) where it jumps between different motions: no motion lies on the line between."""
    if curve.size < 2:
        return curve.astype(complex)
    step = np.abs(np.diff(curve))
    size = np.maximum(np.abs(curve[1:]), np.abs(curve[:-1]))
    usual = np.median(step[np.isfinite(step)]) if np.isfinite(step).any() else np.inf
    with np.errstate(invalid="ignore"):
        jump = (step > 4 * usual) & (step > 0.25 * size) & (regime[1:] != regime[:-1])
    return np.insert(curve.astype(complex), np.nonzero(jump)[0] + 1, np.nan)


def log_ticks(axis, low, high):
    """Ticks at 1, 2, 5 with plain numbers over a short span, powers of ten over a long one."""
    if high / low < 150:
        axis.set_major_locator(ticker.LogLocator(subs=(1.0, 2.0, 5.0), numticks=20))
        axis.set_major_formatter(ticker.FuncFormatter(lambda v, _: f"{v:g}"))
    axis.set_minor_formatter(ticker.NullFormatter())


def plain_spines(ax):
    """Leave the frame's left and lower side."""
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)


def _chosen(has, count):
    """Evenly spread indices among those that have something in view."""
    index = np.nonzero(has)[0]
    if index.size <= count:
        return index
    return index[np.unique(np.linspace(0, index.size - 1, count).round().astype(int))]


def _inside(ax, z):
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    with np.errstate(invalid="ignore"):
        return np.isfinite(z) & (z.real >= left) & (z.real <= right) & (z.imag >= bottom) & (z.imag <= top)


def _end_label(ax, curve, text, color, taken, from_start=False):
    inside = np.nonzero(_inside(ax, curve))[0]
    order = inside if from_start else inside[::-1]
    for index in order:
        if _label(ax, curve[index], text, color, taken):
            return


def _label(ax, place, text, color, taken, offset=(3, 3)) -> bool:
    """Write a label unless another one is near; return whether it was written."""
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    x, y = (place.real - left) / (right - left), (place.imag - bottom) / (top - bottom)
    if not (0.01 < x < 0.93 and 0.01 < y < 0.96):
        return False
    box = ax.get_position()
    wide = 5.5 * len(text) / (72 * ax.figure.get_figwidth() * box.width)  # of the axes; 5.5 points a letter
    if any(x < end and start < x + wide and abs(y - v) < 0.05 for start, end, v in taken):
        return False
    taken.append((x, x + wide, y))
    ax.annotate(
        text,
        (place.real, place.imag),
        xytext=offset,
        textcoords="offset points",
        color=color,
        fontsize=8.5,
        bbox=dict(boxstyle="round,pad=0.1", fc="white", ec="none", alpha=0.75),
        zorder=4,
        annotation_clip=True,
    )
    return True
