"""Picture of a describing-function family: -1/N in the plane, or N over the amplitude where that is all."""

from __future__ import annotations

import control as ct
import numpy as np
from matplotlib.lines import Line2D

from ..calls import keywords_of
from .parts.curves import (
    draw_curves,
    finish,
    in_brackets,
    labels_of,
    log_ticks,
    memoryless,
    name_curves,
    set_view,
    short,
    units,
    view_of,
)
from .parts.keywords import check_keywords
from .parts.page import AMPLITUDE_COLOR, OMEGA_COLOR, legend_above, page

_LONG = 20.0  # a span of amplitudes beyond which their axis is logarithmic


def plot_family(
    family, *, ax=None, title=None, amplitudes=5, frequencies=5, width=None, **kwargs
) -> ct.ControlPlot:
    """Draw -1/N in the complex plane, at constant amplitude (solid) and at constant frequency (dashed).

    Of a memoryless block N over the amplitude is drawn: its magnitude, and the phase where it has one.

    Parameters
    ----------
    family : Family
    ax : matplotlib Axes (of a memoryless block with a phase: two), optional
        Where to draw; default a new figure, or the current one if it is empty.
    title : str, optional
    amplitudes, frequencies : int
        Number of curves of each kind.
    width : float, optional
        Of a new figure [in].
    **kwargs
        Line properties.

    Returns
    -------
    ControlPlot
        ``lines[0]`` curves at constant amplitude, ``lines[1]`` at constant frequency; of a memoryless block
        magnitude and phase.
    """
    check_keywords("plot", keywords_of(plot_family)[1:], kwargs)
    name = short(family.description)
    if memoryless(family):
        return _over_amplitude(family, ax, width, title or f"N of {name}", kwargs)
    with page(0.72, narrow=0.95, width=width, ax=ax) as drawn:
        ax = drawn.panels(1)[0]
        set_view(ax, view_of(family.minus_inverse))
        solid, dashed, names = draw_curves(ax, family, amplitudes, frequencies, **kwargs)
        finish(ax, units(family)[2])
        legend_above(ax, title or f"-1/N of {name}", handles=keys())
        name_curves(labels_of(ax, solid + dashed), names)
        return _on_grid(drawn.finished([solid, dashed]))


def _on_grid(drawn) -> ct.ControlPlot:
    """Return the axes as rows, as python-control does."""
    return ct.ControlPlot(drawn.lines, np.reshape(drawn.axes, (1, -1)), drawn.figure)


def keys() -> list[Line2D]:
    """Return what the legend of the plane says of the curves."""
    return [
        Line2D([], [], color=AMPLITUDE_COLOR, lw=1.1, label="-1/N at constant amplitude A"),
        Line2D([], [], color=OMEGA_COLOR, lw=1.1, ls=(0, (4, 2)), label="-1/N at constant frequency ω"),
    ]


def _over_amplitude(family, ax, width, title, kwargs):
    A, N = family.amplitudes, family.N[:, 0]
    force, gain, _ = units(family)
    with np.errstate(invalid="ignore"):
        turned = bool(np.nanmax(np.abs(N.imag), initial=0) > 1e-9 * np.nanmax(np.abs(N), initial=0))
    parts = [(np.abs(N) if turned else N.real, ("|N|" if turned else "N(A)") + in_brackets(gain))]
    if turned:
        parts.append((np.degrees(np.unwrap(np.angle(N))), "phase of N [deg]"))
    with page(0.55, narrow=0.75 if len(parts) == 1 else 1.2, width=width, ax=ax) as drawn:
        lines = []
        for axes, (values, label) in zip(drawn.panels(len(parts)), parts, strict=False):
            options = {"color": AMPLITUDE_COLOR, "lw": 1.6, **kwargs}
            lines.append(axes.plot(A, np.where(np.isfinite(values), values, np.nan), **options))
            if A.max() > _LONG * A.min():
                axes.set_xscale("log")
                log_ticks(axes.xaxis, A.min(), A.max())
            axes.set_xlabel(f"amplitude A{in_brackets(force)}")
            axes.set_ylabel(label)
            axes.grid(True)
            axes.margins(x=0)
        if drawn.given:
            drawn.keep[0].set_title(title)
        return _on_grid(drawn.finished(lines if turned else [*lines, []], title))
