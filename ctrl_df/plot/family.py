"""Picture of a describing-function family: its -1/N curves."""

from __future__ import annotations

import control as ct
import numpy as np

from .curves import axes_for, draw_curves, draw_single, finish, memoryless, set_view, short, units, view_of


def plot_family(family, *, ax=None, title=None, amplitudes=5, frequencies=5, **kwargs) -> ct.ControlPlot:
    """Draw -1/N in the complex plane, at constant amplitude (solid) and at constant frequency (dashed).

    Parameters
    ----------
    family : Family
    ax : matplotlib Axes, optional
        Where to draw; default a new figure, or the current one if it is empty.
    title : str, optional
    amplitudes, frequencies : int
        Number of curves of each kind.
    **kwargs
        Line properties.

    Returns
    -------
    ControlPlot
        ``lines[0]`` curves at constant amplitude (or the one curve of a memoryless block), ``lines[1]`` at
        constant frequency.
    """
    fig, ax = axes_for(ax)
    lines = np.empty(2, dtype=object)
    if memoryless(family):
        curve = family.minus_inverse[:, 0]
        set_view(ax, view_of(curve))
        lines[0] = [draw_single(ax, family.amplitudes, curve, **kwargs)]
        lines[1] = []
    else:
        set_view(ax, view_of(family.minus_inverse))
        lines[0], lines[1] = draw_curves(ax, family, amplitudes, frequencies, **kwargs)
    finish(ax, title or f"-1/N of {short(family.description)}", units(family)[2])
    return ct.ControlPlot(lines, np.array([[ax]]), fig)
