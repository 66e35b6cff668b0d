"""What the pictures of -1/N share: views, curves as smooth as they are, their labels, units."""

from __future__ import annotations

import re

import numpy as np
from matplotlib import ticker

from ...blocks.mechanism import Mechanism
from ...numerals import digits
from ...units import over
from .labels import Labels, settle
from .page import AMPLITUDE_COLOR, OMEGA_COLOR

_TURN = np.radians(4.0)  # between two pieces of a polyline, seen as a curve up to it
_ROUNDS, _POINTS = 6, 1500  # of refinement, and of points of a curve
_IRREGULAR = "aperiodic"  # a mean over a motion without a period: no curve


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


def draw_single(ax, amplitudes, curve, **kwargs):
    """Draw the one -1/N curve of a memoryless block; return the line."""
    options = {"color": AMPLITUDE_COLOR, "lw": 1.8, **kwargs}
    finite = np.where(np.isfinite(curve), curve, np.nan)
    return ax.plot(np.real(finite), np.imag(finite), **options)[0]


def name_amplitudes(labels: Labels, amplitudes, curve, color, *, ticks=4):
    """Mark a few amplitudes along the -1/N curve of a memoryless block, fewer where it is short.

    A mark on a crossing, or without room for its number, is left out.
    """
    ax = labels.ax
    inside = np.nonzero(_inside(ax, curve))[0]
    if not inside.size:
        return
    at = ax.transData.transform(np.column_stack([curve.real, curve.imag])[inside])
    letter = ax.xaxis.label.get_size() * ax.figure.dpi / 72
    length = float(np.linalg.norm(np.diff(at, axis=0), axis=1).sum())
    count = int(np.clip(length / (_APART * letter) + 1, 2, ticks))
    wanted = np.linspace(0, length, count)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(at, axis=0), axis=1))])
    chosen = inside[np.unique([int(np.argmin(np.abs(along - w))) for w in wanted])]
    named = False
    for i in chosen:
        place = (curve[i].real, curve[i].imag)
        if labels.covers(place):
            continue
        text = f"{'' if named else 'A = '}{digits(amplitudes[i])}"
        if labels.write(text, [place], offsets=_BESIDE, color=color) is not None:
            named = True
            ax.plot(*place, ".", color=color, ms=5)


_APART = 4.0  # between two amplitudes named along a curve, in heights of a letter
_BESIDE = ((0, 5), (0, -5), (3, -4), (3, 4), (-3, 4), (-3, -4), (0, 14), (0, -14), (8, 14), (-8, -14))
"""Where the number of an amplitude may stand [pt], the best first."""


def draw_curves(ax, family, amplitudes=5, frequencies=5, **kwargs):
    """Draw -1/N at a few constant amplitudes (solid) and frequencies (dashed).

    Returns
    -------
    solid, dashed : lists of lines
    names : list of (symbol, value, unit, curve, color)
        For `name_curves`.
    """
    z = family.minus_inverse
    shown = _inside(ax, z)
    rows, columns = _chosen(shown.any(axis=1), amplitudes), _chosen(shown.any(axis=0), frequencies)
    solid, dashed, names = [], [], []
    for i in rows:
        options = {"color": AMPLITUDE_COLOR, "lw": 1.1, "alpha": 0.9, "label": "_", **kwargs}
        A = family.amplitudes[i]
        curve = _curve(ax, family, A, family.omega, z[i], family.motion[i])
        solid += ax.plot(np.real(curve), np.imag(curve), **options)
        names.append(("A", A, units(family)[0], curve[::-1], AMPLITUDE_COLOR))
    for k in columns:
        options = {"color": OMEGA_COLOR, "lw": 1.1, "ls": (0, (4, 2)), "alpha": 0.9, "label": "_", **kwargs}
        w = family.omega[k]
        curve = _curve(ax, family, family.amplitudes, w, z[:, k], family.motion[:, k])
        dashed += ax.plot(np.real(curve), np.imag(curve), **options)
        names.append(("ω", w, " rad/s", curve, OMEGA_COLOR))
    return solid, dashed, names


def name_curves(labels: Labels, names):
    """Write the value at which each curve was drawn at its end, or as near to it as there is room.

    The first of each kind says of what it is the value.
    """
    said = set()
    for symbol, value, unit, curve, color in names:
        inside = curve[_inside(labels.ax, curve)]
        if not inside.size:
            continue
        some = inside[np.unique(np.linspace(0, inside.size - 1, 16).round().astype(int))]
        written = labels.write(
            f"{digits(value)}" if symbol in said else f"{symbol} = {digits(value)}{unit}",
            [(z.real, z.imag) for z in some], offsets=((3, 3), (3, -3), (-3, 3), (-3, -3)), color=color,
            bbox=dict(boxstyle="round,pad=0.05", fc="white", ec="none", alpha=0.8),
        )  # fmt: skip
        if written is not None:
            said.add(symbol)


def labels_of(ax, lines) -> Labels:
    """Return the labels of axes on which lines were drawn, all else being set."""
    settle(ax.figure)
    return Labels(ax, [np.column_stack(line.get_data()) for line in lines if line is not None])


def _curve(ax, family, A, omega, z, regime):
    """Return -1/N along a line of the grid, cut at jumps; computed between its nodes where that is quick."""
    at = getattr(family, "at", None)
    if at is None or not at.light:
        return unbroken(z, regime)
    A, omega = np.broadcast_arrays(A, omega)
    over_omega = A[0] == A[-1]
    p = np.array(np.log(omega if over_omega else A))
    z, regime = np.array(z), np.array(regime)
    for _ in range(_ROUNDS):
        wanted = _coarse(ax, z)
        wanted = wanted[~((regime[wanted] == _IRREGULAR) & (regime[wanted + 1] == _IRREGULAR))]
        if not wanted.size or p.size + wanted.size > _POINTS:
            break
        new = 0.5 * (p[wanted] + p[wanted + 1])
        N, names = at(A[0], np.exp(new)) if over_omega else at(np.exp(new), omega[0])
        with np.errstate(all="ignore"):
            value = -1 / N
        p, z = np.insert(p, wanted + 1, new), np.insert(z, wanted + 1, value)
        regime = np.insert(regime, wanted + 1, names)
    return unbroken(z, regime)


def _coarse(ax, z):
    """Return the pieces of a polyline, within the picture, at whose ends it turns visibly."""
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    at = z.real / (right - left) + 1j * z.imag / (top - bottom)
    seen = _inside(ax, z)
    step = np.diff(at)
    with np.errstate(all="ignore"):
        turn = np.abs(np.angle(step[1:] / step[:-1])) * (np.minimum(abs(step[1:]), abs(step[:-1])) > 2e-3)
    bent = np.zeros(step.size, bool)
    sharp = np.nan_to_num(turn) > _TURN
    bent[:-1] |= sharp
    bent[1:] |= sharp
    bent |= np.nan_to_num(np.abs(step)) > 0.1
    return np.nonzero(bent & (seen[:-1] | seen[1:]) & np.isfinite(step))[0]


def finish(ax, unit=""):
    """Axes through the origin and their labels; `unit` that of -1/N."""
    ax.axhline(0, color="0.75", lw=0.8, zorder=0)
    ax.axvline(0, color="0.75", lw=0.8, zorder=0)
    ax.set_xlabel(f"Real part{in_brackets(unit)}")
    ax.set_ylabel(f"Imaginary part{in_brackets(unit)}")
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
