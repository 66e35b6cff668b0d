"""The Nyquist picture of a describing-function analysis, with the answer written at each crossing."""

from __future__ import annotations

import warnings

import control as ct
import numpy as np

from ..limit_cycles.predicted.predict import DescribingFunctionResponse, describing_function_response
from .curves import (
    CROSSING_COLOR,
    NYQUIST_COLOR,
    axes_for,
    draw_curves,
    draw_single,
    finish,
    memoryless,
    set_view,
    short,
    units,
    view_of,
)

_ANALYSIS = (
    "refine",
    "warn_nyquist",
    "output",
    "orders",
    "num_points",
    "try_method",
    "executor",
    "save",
    "progress",
    "options",
)


_POINT_LABEL = "%5.2g @ %-5.2g"  # python-control's


def describing_function_plot(*sysdata, point_label=_POINT_LABEL, label=None, **kwargs) -> ct.ControlPlot:
    """Nyquist plot of H with the -1/N curves of the block; crossings carry amplitude and frequency.

    Called as ``describing_function_plot(response)`` or ``describing_function_plot(H, F, A[, omega])``; the
    second form runs `describing_function_response`. A memoryless block has one -1/N curve, drawn over
    python-control's Nyquist plot. A block with dynamics has a family: solid at constant amplitude, dashed at
    constant frequency; H is then drawn over the frequencies scanned (continuous Nyquist contours clip and
    shift what an improper H has to show). Crossings are dots, filled where the cycle is predicted stable; an
    open diamond is a solution on a motion of the block that N does not name, see `LimitCycle.branch`.

    Parameters
    ----------
    *sysdata
        A response, or H, F, A and optionally omega.
    point_label : str or None
        Format of the crossings' labels, two numbers: amplitude and frequency. None: no labels. The default is
        python-control's, for a mechanism with units and more digits.
    label : str, False or None
        Name of the Nyquist curve.
    ax, title
        As in ``ct.nyquist_plot``.
    refine, warn_nyquist, output, orders, num_points, try_method, executor, save, progress, options
        Passed to `describing_function_response`.
    **kwargs
        Line properties of the Nyquist curve; for a memoryless block every keyword of ``ct.nyquist_plot``.

    Returns
    -------
    ControlPlot
        ``lines[0]`` Nyquist curve, ``lines[1]`` describing function, for a family first the curves at
        constant amplitude.

    Raises
    ------
    TypeError
        Wrong positional arguments, legend keywords.
    ValueError
        `label` neither string, False nor None.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> H = ct.tf([8], [1, 2, 2, 1])
    >>> picture = cdf.describing_function_plot(H, cdf.saturation(1), np.linspace(1, 5, 20))
    >>> picture.axes.size
    1
    >>> plt.close(picture.figure)
    """
    if label not in (False, None) and not isinstance(label, str):
        raise ValueError("label must be formatting string, False, or None")
    if "warn" in kwargs:
        warnings.warn("'warn' is replaced by 'warn_nyquist'", FutureWarning, stacklevel=2)
        kwargs["warn_nyquist"] = kwargs.pop("warn")
    analysis = {key: kwargs.pop(key) for key in _ANALYSIS if key in kwargs}
    if len(sysdata) in (3, 4):
        response = describing_function_response(*sysdata, **analysis)
    elif len(sysdata) == 1:
        response = sysdata[0]
        if not isinstance(response, DescribingFunctionResponse):
            raise TypeError("data must be DescribingFunctionResponse")
    else:
        raise TypeError("1, 3, or 4 position arguments required")
    for keyword in ("legend_loc", "legend_map", "show_legend"):
        if keyword in kwargs:
            raise TypeError(f"unexpected keyword argument '{keyword}'")
    if memoryless(response.family):
        return _over_nyquist(response, point_label, label, kwargs)
    return _family_picture(response, point_label, label, kwargs)


def _over_nyquist(response, point_label, label, kwargs):
    """python-control's Nyquist plot with the single -1/N curve of a memoryless block."""
    reach = max([15.0, *(3 * abs(p) for p in response.positions)])
    kwargs.setdefault("max_curve_magnitude", reach)  # its default would bend the curve where the crossing is
    if isinstance(label, str):
        kwargs["label"] = label
    kwargs.setdefault("title", _title(response))
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*tight_layout.*|.*constrained_layout.*")
        cplt = response.response.plot(**kwargs)
    ax = cplt.axes[0, 0]
    lines = np.empty(2, dtype=object)
    lines[0] = np.concatenate(cplt.lines.flatten()).tolist()
    curve = np.asarray(response.N_vals)
    if response.positions:
        _keep_in_view(ax, response.positions)
    amplitudes = response.family.amplitudes
    lines[1] = [draw_single(ax, amplitudes, curve[-amplitudes.size :], color="#b3541e")]
    _mark(ax, response, point_label)
    return ct.ControlPlot(lines, cplt.axes, cplt.figure)


def _family_picture(response, point_label, label, kwargs):
    fig, ax = axes_for(kwargs.pop("ax", None))
    title = kwargs.pop("title", None)
    family, H = response.family, response.response
    w = np.abs(np.imag(H.contour)) if not H.dt else np.angle(H.contour) / H.dt
    seen = (w >= family.omega.min() * (1 - 1e-9)) & (w <= family.omega.max() * (1 + 1e-9))
    curve = np.asarray(H.response)[seen]
    include = response.positions or ()
    z = family.minus_inverse.ravel()
    set_view(ax, view_of(z if include else np.concatenate([z, curve]), include))
    solid, dashed = draw_curves(ax, family)
    lines = np.empty(2, dtype=object)
    options = {"color": NYQUIST_COLOR, "lw": 2.2, "label": label or None, **kwargs}
    lines[0] = ax.plot(np.real(curve), np.imag(curve), **options)
    lines[1] = solid + dashed
    _name_curve(ax, curve, label if isinstance(label, str) else "H(jω)")
    _mark(ax, response, point_label)
    finish(ax, _title(response) if title is None else title, units(family)[2])
    return ct.ControlPlot(lines, np.array([[ax]]), fig)


def _name_curve(ax, curve, name):
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    inside = (curve.real > left) & (curve.real < right) & (curve.imag > bottom) & (curve.imag < top)
    index = np.nonzero(inside)[0]
    if index.size:
        place = curve[index[int(0.93 * (index.size - 1))]]
        ax.annotate(
            name,
            (place.real, place.imag),
            xytext=(6, 0),
            textcoords="offset points",
            color=NYQUIST_COLOR,
            fontsize=10,
        )


def _mark(ax, response, point_label):
    """Mark the crossings: filled where Loeb calls the cycle stable, open otherwise.

    Open diamonds stand on a motion that N does not name; the curves drawn do not pass through them.
    """
    force = units(response.family)[0]
    if force and point_label == _POINT_LABEL:
        point_label = f"%.4g{force} @ %.4g rad/s"
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    places = [
        ((p.real - left) / (right - left), (p.imag - bottom) / (top - bottom)) for p in response.positions
    ]
    for (x, y), position, cycle in zip(places, response.positions, response.limit_cycles, strict=True):
        fill = CROSSING_COLOR if cycle.stable and not cycle.branch else "white"
        shape = "D" if cycle.branch else "o"
        ax.plot(position.real, position.imag, shape, ms=7, mfc=fill, mec=CROSSING_COLOR, mew=1.6, zorder=6)
        if not point_label:
            continue
        # of two that lie together the lower one's label goes below
        shift = -16 if any(abs(x - u) < 0.25 and 0 < v - y < 0.1 for u, v in places) else 6
        below = cycle.branch != "" and shift < 0  # two lines hang from the crossing
        aside = (-8, "right") if x > 0.72 else (8, "left")
        ax.annotate(
            (point_label % (cycle.amplitude, cycle.omega)).strip() + _standing(cycle),
            (position.real, position.imag),
            xytext=(aside[0], 2 if below else shift),
            textcoords="offset points",
            ha=aside[1],
            va="top" if below else "baseline",
            color=CROSSING_COLOR,
            fontsize=10,
            fontweight="normal" if cycle.branch else "bold",
            bbox=dict(boxstyle="round,pad=0.15", fc="white", ec="none", alpha=0.85),
            zorder=7,
        )


def _standing(cycle) -> str:
    """Say beside a crossing that it stands on a motion which N does not name."""
    if not cycle.branch:
        return ""
    return "\n(unstable motion)" if cycle.forced_multiplier >= 1 else "\n(coexisting motion)"


def _keep_in_view(ax, positions):
    """Widen the limits of a Nyquist plot so that every crossing lies well inside."""
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    x = [p.real for p in positions if np.isfinite(p)]
    y = [p.imag for p in positions if np.isfinite(p)]
    pad_x, pad_y = 0.1 * (right - left), 0.1 * (top - bottom)
    ax.set_xlim(min([left, *(v - pad_x for v in x)]), max([right, *(v + pad_x for v in x)]))
    ax.set_ylim(min([bottom, *(v - pad_y for v in y)]), max([top, *(v + pad_y for v in y)]))


def _title(response):
    count = len(response.limit_cycles)
    found = {0: "no limit cycle predicted", 1: "one limit cycle predicted"}.get(
        count, f"{count} limit cycles predicted"
    )
    return f"{short(response.family.description)}: {found}"
