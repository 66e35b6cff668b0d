"""`explore`: the -1/N curves of a block, with the gains of its controller on sliders."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.widgets import Slider

from ..checks import flag, number, real_array, shown
from ..df.family import Family
from ..gains.arguments import gain_units
from ..gains.controller import GAINS, Structure
from ..gains.plane import Plane, plane_of, require_linear
from ..gains.predicted import PredictedCycle, at_one
from ..gains.simulated import Simulated, simulated
from ..gains.stability import unstable_poles
from .parts.curves import (
    draw_curves,
    draw_single,
    finish,
    in_brackets,
    labels_of,
    memoryless,
    name_amplitudes,
    name_curves,
    set_view,
    units,
    view_of,
)
from .parts.page import AMPLITUDE_COLOR, CROSSING_COLOR, EXACT_COLOR, NYQUIST_COLOR, style

_OWNER = "explore"
_SHOWN = (48, 64)  # amplitudes and frequencies of the curves drawn
_AROUND = (4.0, 2.5)  # factors of amplitude and frequency about the cycles, within which curves are drawn
_NARROW = 5.0  # [in] below which fewer curves are drawn, in smaller letters
_ROW = 0.26  # [in] of a slider
_MARK, _RIM = 8.0, 4.0  # [points] about a mark, beyond the right rim, that labels may not, may reach


def explore(
    block,
    *,
    kp: Any,
    ki: Any = 0.0,
    kd: Any = 0.0,
    tf: float = 0.0,
    plant: Any = None,
    output: str | None = None,
    exact: bool = True,
    width: float = 7.0,
) -> Explorer:
    """Open a picture of -1/N(a, omega) and of the controller, with its gains on sliders.

    The describing functions are computed once: they do not depend on the gains. At every move of a slider the
    controller's curve is drawn again, its crossings with the curves of the block are marked (filled where the
    cycle is predicted stable) and, with ``exact=True``, the loop is simulated from twelve starts: a star
    marks the exact cycle that it ends on, and the line above the picture says what the loop does.

    Parameters
    ----------
    block : block
        As in `limit_cycle_map`.
    kp, ki, kd : float, (low, high) or (low, start, high)
        Gains of `pid`: a number, or the ends of a slider and where it stands at first (default: in the
        middle).
    tf, plant, output
        As in `limit_cycle_map`.
    exact : bool
        Whether to simulate.
    width : float
        Of the figure [inches].

    Returns
    -------
    Explorer
        Keep a reference to it, or the sliders stop working. ``.set(kp=...)`` moves them from code.

    Raises
    ------
    TypeError, ValueError
        No gain with a range; what `limit_cycle_map` refuses.

    Examples
    --------
    >>> import ctrl_df as cdf
    >>> axis = cdf.friction_mass(mass=9, coulomb=5, viscous=0.5, static=5.5)
    >>> view = cdf.explore(axis, kp=(500, 2000, 4000), ki=(0, 44250, 80000), kd=130)
    >>> view.simulated.orbit
    <Orbit: 7.945402 @ 11.62868 rad/s, stable>
    >>> view.set(ki=10000)
    >>> view.gains["ki"]
    10000.0
    """
    flag(_OWNER, "exact", exact)
    tf = number(_OWNER, "tf", tf, "s", lower=0.0, meaning="filter time constant")
    width = number(_OWNER, "width", width, "in", lower=2.0)
    if plant is not None:
        require_linear(plant)
    ranges = {name: _range(name, value) for name, value in (("kp", kp), ("ki", ki), ("kd", kd))}
    if all(low == high for low, _, high in ranges.values()):
        raise ValueError(f"{_OWNER} needs at least one gain as (low, high) for a slider; got three numbers.")
    structure = Structure(block, tf, plant, output)
    ends = [{name: r[k] for name, r in ranges.items()} for k in range(3)]
    ends += [{name: r[k if name == "kp" else 2 - k] for name, r in ranges.items()} for k in (0, 2)]
    return Explorer(plane_of(structure, ends), ranges, exact, width)


class Explorer:
    """The picture that `explore` opens.

    Attributes
    ----------
    figure : matplotlib Figure
    ax : matplotlib Axes
        The complex plane.
    sliders : dict
        Name of a gain to its `matplotlib.widgets.Slider`.
    gains : dict
        All three gains as they stand.
    cycles : tuple of PredictedCycle
        By rising amplitude.
    simulated : Simulated or None
        What the loop does; None with ``exact=False``.
    """

    def __init__(
        self, plane: Plane, ranges: Mapping[str, tuple[float, float, float]], exact: bool, width: float
    ):
        self.plane, self.exact = plane, exact
        self.cycles: tuple[PredictedCycle, ...] = ()
        self.simulated: Simulated | None = None
        self.gains = {name: start for name, (_, start, _) in ranges.items()}
        self._narrow = width < _NARROW
        self._family: Any = None
        free = [name for name in GAINS if ranges[name][0] < ranges[name][2]]
        self.figure, self.ax, rows = _layout(width, len(free), self._narrow)
        gain_unit = gain_units(plane.structure.block, plane.structure.output)
        self.sliders = {}
        for name, row in zip(free, rows, strict=True):
            low, start, high = ranges[name]
            slider = Slider(
                row,
                name + in_brackets(gain_unit[name]),
                low,
                high,
                valinit=start,
                valfmt="%.5g",
                color="0.45",
            )
            slider.vline.set_visible(False)
            for text in (slider.label, slider.valtext):
                text.set_fontsize(7 if self._narrow else 9)
            slider.on_changed(lambda value, name=name: self._moved(name, value))
            self.sliders[name] = slider
        self._draw()

    def set(self, **gains: float) -> None:
        """Move sliders; TypeError for a gain without one."""
        for name, value in gains.items():
            if name not in self.sliders:
                raise TypeError(
                    f"explore has sliders for {', '.join(self.sliders)}; got {name}={shown(value)}."
                )
            self.sliders[name].set_val(number("set", name, value))

    def __repr__(self) -> str:
        """Return gains and what the loop does."""
        at = ", ".join(f"{name}={value:.6g}" for name, value in self.gains.items())
        verdict = "" if self.simulated is None else f": {self.simulated.verdict}"
        return f"<Explorer {at}{verdict}; {len(self.cycles)} cycles predicted>"

    def _moved(self, name, value):
        self.gains[name] = float(value)
        self._draw()
        self.figure.canvas.draw_idle()

    def _draw(self):
        with plt.rc_context(style(self.figure.get_figwidth())):
            self._draw_plane()

    def _draw_plane(self):
        plane, ax = self.plane, self.ax
        self.cycles = at_one(plane, self.gains, next(iter(self.sliders)))
        self.simulated = simulated(plane.structure, self.gains) if self.exact else None
        ax.clear()
        orbit = None if self.simulated is None else self.simulated.orbit
        centres = [(c.amplitude, c.omega) for c in self.cycles] + (
            [(orbit.amplitude, orbit.omega)] if orbit else []
        )
        self._family = _family_around(plane, centres)
        w = np.exp(plane.log_w)
        curve: Any = plane.structure.loop_gain(self.gains, w)
        places = [complex(plane.structure.loop_gain(self.gains, np.array([c.omega]))[0]) for c in self.cycles]
        marked = list(places)
        if orbit is not None:
            marked.append(complex(plane.structure.loop_gain(self.gains, np.array([orbit.omega]))[0]))
        z = self._family.minus_inverse.ravel()
        set_view(ax, view_of(z if marked else np.concatenate([z, curve]), marked))
        names: list = []
        lines = ax.plot(curve.real, curve.imag, color=NYQUIST_COLOR, lw=2.0, zorder=3)
        amplitudes, single = self._family.amplitudes, self._family.minus_inverse[:, 0]
        if memoryless(self._family):
            lines.append(draw_single(ax, amplitudes, single))
        else:
            solid, dashed, names = draw_curves(ax, self._family, *((3, 3) if self._narrow else (5, 5)))
            lines += solid + dashed
        for place, cycle in zip(places, self.cycles, strict=True):
            fill = CROSSING_COLOR if cycle.stable else "white"
            ax.plot(place.real, place.imag, "o", ms=7, mfc=fill, mec=CROSSING_COLOR, mew=1.6, zorder=6)
        if orbit is not None:
            ax.plot(marked[-1].real, marked[-1].imag, "*", ms=13, mfc=EXACT_COLOR, mec="white", zorder=7)
        finish(ax, units(self._family)[2])
        ax.set_title(self._title(orbit))
        ax.tick_params(labelsize=plt.rcParams["xtick.labelsize"])
        labels = labels_of(ax, lines)
        labels.block_points([(z.real, z.imag) for z in marked], 10)
        name_curves(labels, names)
        if not names:
            name_amplitudes(labels, amplitudes, single, AMPLITUDE_COLOR)

    def _title(self, orbit) -> str:
        """Lines above the picture: predicted, and what the loop does."""
        force = units(self._family)[0]
        words = {True: "stable", False: "unstable", None: "?"}
        found = [f"{c.amplitude:.4g}{force} @ {c.omega:.4g} rad/s {words[c.stable]}" for c in self.cycles]
        if len(found) > 2:
            found = [*found[:2], f"and {len(found) - 2} more"]
        apart = "\n    " if self._narrow else ", "
        lines = ["predicted (dots): " + (apart.join(found) or "no cycle")]
        if self.simulated is not None:
            lines.append(f"simulated: {self.simulated.verdict}")
            if orbit is not None:
                lines[-1] += f"{apart}exact (star): {orbit.amplitude:.4g}{force} @ {orbit.omega:.4g} rad/s"
        else:
            poles = int(unstable_poles(self.plane, *(self.gains[name] for name in GAINS)))
            lines.append(f"in the large the loop is {'unstable' if poles else 'stable'}")
        return "\n".join(lines)


def _range(name, value) -> tuple[float, float, float]:
    """(low, start, high) of a slider; three times the same for a fixed gain."""
    given = real_array(_OWNER, name, value).ravel()
    if given.size == 1:
        return float(given[0]), float(given[0]), float(given[0])
    if given.size == 2:
        given = np.array([given[0], given.mean(), given[1]])
    low, start, high = given if given.size == 3 else (1.0, 0.0, 0.0)
    if not low <= start <= high or low == high:
        raise ValueError(
            f"{_OWNER} needs {name} as a number, (low, high) or (low, start, high), low <= start <= high; "
            f"got {shown(value)}."
        )
    return float(low), float(start), float(high)


def _family_around(plane: Plane, centres) -> Family:
    """Return describing functions about some cycles, or about the middle of the plane, for drawing."""
    middle = [(plane.scale, np.exp(0.5 * (plane.log_w[0] + plane.log_w[-1])))]
    logs = np.log(centres or middle)
    p, q = (
        np.linspace(max(at.min() - np.log(factor), axis[0]), min(at.max() + np.log(factor), axis[-1]), count)
        for at, factor, axis, count in zip(logs.T, _AROUND, (plane.log_a, plane.log_w), _SHOWN, strict=True)
    )
    P, Q = (grid.ravel() for grid in np.meshgrid(p, q, indexing="ij"))
    beside = plane.structure.beside(np.exp(q))
    with np.errstate(all="ignore"):
        N = -1 / (plane.need(P, Q).reshape(p.size, q.size) * beside)
    block = plane.structure.block
    output = plane.structure.output or getattr(block, "output_labels", ["y"])[0]
    return Family(
        np.exp(p), np.exp(q), np.stack([np.zeros_like(N), N], axis=-1), np.full(N.shape, ""),
        np.zeros(N.shape), block, "", output,
    )  # fmt: skip


def _layout(width, sliders, narrow):
    """Figure, axes of the plane and of the sliders, placed in inches."""
    height = 0.75 * width + (0.9 if narrow else 0.5) + _ROW * sliders
    figure = plt.figure(figsize=(width, height))
    left, right, head = (0.8, 0.15, 0.85) if narrow else (1.0, 0.3, 0.6)
    foot = 0.65 + _ROW * sliders
    ax = figure.add_axes(
        (left / width, foot / height, 1 - (left + right) / width, 1 - (foot + head) / height)
    )
    begin, end = (1.05, 0.6) if narrow else (1.3, 0.8)
    rows = [
        figure.add_axes(
            (
                begin / width,
                (0.08 + _ROW * (sliders - 1 - k)) / height,
                1 - (begin + end) / width,
                0.7 * _ROW / height,
            )
        )
        for k in range(sliders)
    ]
    return figure, ax, rows
