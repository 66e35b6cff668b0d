"""The Nyquist picture of a describing-function analysis, with the answer written at each crossing."""

from __future__ import annotations

import warnings

import control as ct
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.lines import Line2D

from ..calls import keywords_of
from ..checks import kind_of, shown
from ..limit_cycles.predicted.grade import UNRELIABLE
from ..limit_cycles.predicted.linear import LinearPart
from ..limit_cycles.predicted.predict import DescribingFunctionResponse, describing_function_response
from .family import keys
from .parts.curves import (
    draw_curves,
    draw_single,
    finish,
    labels_of,
    memoryless,
    name_amplitudes,
    name_curves,
    set_view,
    short,
    units,
    view_of,
)
from .parts.keywords import LEGEND, check_keywords
from .parts.page import (
    CROSSING_COLOR,
    EXACT_COLOR,
    NYQUIST_COLOR,
    OMEGA_COLOR,
    in_lines,
    legend_above,
    page,
    style,
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


def describing_function_plot(
    *sysdata, point_label=_POINT_LABEL, label=None, exact=None, **kwargs
) -> ct.ControlPlot:
    """Nyquist plot of H with the -1/N curves of the block; crossings carry amplitude and frequency.

    Called as ``describing_function_plot(response)`` or ``describing_function_plot(H, F, A[, omega])``; the
    second form runs `describing_function_response`. A memoryless block has one -1/N curve, drawn over
    python-control's Nyquist plot. A block with dynamics has a family: solid at constant amplitude, dashed at
    constant frequency; H is then drawn over the frequencies scanned (continuous Nyquist contours clip and
    shift what an improper H has to show). Crossings are dots, filled where the cycle is predicted stable,
    pale where the prediction calls itself unreliable; an open diamond is a solution on a motion of the block
    that N does not name, see `LimitCycle.branch`. Exact orbits are stars, filled where they are stable.

    Parameters
    ----------
    *sysdata
        A response, or H, F, A and optionally omega.
    point_label : str or None
        Format of the crossings' labels, two numbers: amplitude and frequency. None: no labels. The default is
        python-control's, for a mechanism or a family with units and more digits.
    label : str, False or None
        Name of the Nyquist curve.
    exact : Check or sequence of Orbit, optional
        What `verify` or `find_limit_cycle` found, to be marked at H(j omega) of each orbit.
    ax, title
        As in ``ct.nyquist_plot``.
    width
        Of a new figure [in], where a family is drawn.
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
        raise ValueError(
            f"label must be formatting string, False, or None; got {shown(label)}. Leave it out for none."
        )
    if "warn" in kwargs:
        warnings.warn("'warn' is replaced by 'warn_nyquist'", FutureWarning, stacklevel=2)
        kwargs["warn_nyquist"] = kwargs.pop("warn")
    for keyword in LEGEND:
        if keyword in kwargs:
            raise TypeError(
                f"describing_function_plot draws its own legend; got {keyword}={shown(kwargs[keyword])} "
                f"(unexpected keyword argument '{keyword}'). Leave it out, and change the picture's axes."
            )
    analysis = {key: kwargs.pop(key) for key in _ANALYSIS if key in kwargs}
    own = (*keywords_of(describing_function_plot), "ax", "title", "width", *_ANALYSIS)
    check_keywords("describing_function_plot", own, kwargs, ct.nyquist_plot)
    if len(sysdata) in (3, 4):
        response = describing_function_response(*sysdata, **analysis)
    elif len(sysdata) == 1:
        response = sysdata[0]
        if not isinstance(response, DescribingFunctionResponse):
            raise TypeError(
                "data must be DescribingFunctionResponse of ctrl_df, or else H, F, A (and omega); got "
                f"{kind_of(response)}. Call ctrl_df.describing_function_response."
            )
    else:
        raise TypeError(
            "describing_function_plot needs 1, 3, or 4 positional arguments: a response, or H, F, A (and "
            f"omega); got {len(sysdata)}. Name the others."
        )
    if memoryless(response.family):
        return _over_nyquist(response, point_label, label, _placed(response, exact), kwargs)
    return _family_picture(response, point_label, label, _placed(response, exact), kwargs)


def _placed(response, exact) -> list:
    """Return where each orbit stands on the curve of H, of those within the frequencies scanned."""
    orbits = getattr(exact, "orbits", exact) or ()
    low, high = response.family.omega.min(), response.family.omega.max()
    H = LinearPart(response.H)
    seen = [orbit for orbit in orbits if low <= orbit.omega <= high]
    return [(complex(H.clamped(np.array([orbit.omega]))[0][0]), orbit) for orbit in seen]


def _over_nyquist(response, point_label, label, exact, kwargs):
    """python-control's Nyquist plot with the single -1/N curve of a memoryless block."""
    kwargs.setdefault("max_curve_magnitude", _reach(response))
    if isinstance(label, str):
        kwargs["label"] = label
    width = _width_of(kwargs.get("ax"))
    kwargs.setdefault("title", in_lines(_title(response), width, 0.65))
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*tight_layout.*|.*constrained_layout.*")
        cplt = response.response.plot(**kwargs)
    ax = cplt.axes[0, 0]
    lines = np.empty(2, dtype=object)
    lines[0] = np.concatenate(cplt.lines.flatten()).tolist()
    curve = np.asarray(response.N_vals)
    places = [*response.positions, *(place for place, _ in exact)]
    if places:
        _keep_in_view(ax, places)
    amplitudes = response.family.amplitudes
    curve = curve[-amplitudes.size :]
    with plt.rc_context(style(width)):
        lines[1] = [draw_single(ax, amplitudes, curve, color=OMEGA_COLOR)]
        labels = labels_of(ax, [*lines[0], *lines[1]])
        _mark(labels, response, point_label, exact)
        name_amplitudes(labels, amplitudes, curve, OMEGA_COLOR)
    return ct.ControlPlot(lines, cplt.axes, cplt.figure)


def _reach(response) -> float:
    """Return where a Nyquist curve is cut: five times as far as -1 and the crossings lie.

    A curve that python-control draws whole, within 15, stays whole.
    """
    seen = max(_NEAR * abs(p) for p in (-1.0, *response.positions))
    farthest = np.abs(np.asarray(response.response.response))
    whole = farthest[np.isfinite(farthest)].max(initial=0.0) <= _CUT
    return max(seen, _CUT) if whole else seen


_NEAR, _CUT = 5.0, 15.0  # python-control's ``nyquist.max_curve_magnitude``


def _family_picture(response, point_label, label, exact, kwargs):
    title = kwargs.pop("title", None)
    family, H = response.family, response.response
    with page(0.72, narrow=0.95, width=kwargs.pop("width", None), ax=kwargs.pop("ax", None)) as drawn:
        ax = drawn.panels(1)[0]
        w = np.abs(np.imag(H.contour)) if not H.dt else np.angle(H.contour) / H.dt
        seen = (w >= family.omega.min() * (1 - 1e-9)) & (w <= family.omega.max() * (1 + 1e-9))
        curve = np.asarray(H.response)[seen]
        include = [*response.positions, *(place for place, _ in exact)]
        z = family.minus_inverse.ravel()
        set_view(ax, view_of(z if include else np.concatenate([z, curve]), include))
        solid, dashed, names = draw_curves(ax, family)
        options = {"color": NYQUIST_COLOR, "lw": 2.0, "label": label or None, **kwargs}
        nyquist = ax.plot(np.real(curve), np.imag(curve), **options)
        finish(ax, units(family)[2])
        named = label if isinstance(label, str) else "H(jω)"
        handles = [Line2D([], [], color=nyquist[0].get_color(), lw=2.0, label=named), *keys()]
        handles += _kinds(response, exact)
        title = _title(response) if title is None else title
        legend_above(ax, title, handles=handles, columns=3)
        labels = labels_of(ax, [*nyquist, *solid, *dashed])
        _mark(labels, response, point_label, exact)
        name_curves(labels, names)
        return ct.ControlPlot(_two(nyquist, solid + dashed), np.array([[ax]]), drawn.figure)


def _width_of(ax) -> float:
    """Return the width of the figure that will be drawn on [in]."""
    if ax is not None:
        return float(np.ravel(np.asarray(ax, dtype=object))[0].figure.get_figwidth())
    return float(plt.gcf().get_figwidth() if plt.get_fignums() else plt.rcParams["figure.figsize"][0])


def _two(first, second):
    lines = np.empty(2, dtype=object)
    lines[0], lines[1] = list(first), list(second)
    return lines


def _look(cycle) -> dict:
    """Return how a crossing is drawn: filled where Loeb calls the cycle stable, open otherwise.

    Pale where the prediction is unreliable: there may be no orbit, or one of other stability. Open diamonds
    stand on a motion that N does not name; the curves drawn do not pass through them.
    """
    fill = CROSSING_COLOR if cycle.stable and not cycle.branch else "white"
    fill = _PALE if cycle.grade == UNRELIABLE and not cycle.branch else fill
    return dict(
        marker="D" if cycle.branch else "o", ms=6, mfc=fill, mec=CROSSING_COLOR, mew=1.4, ls="none", zorder=6
    )


def _look_exact(orbit) -> dict:
    """Return how an exact orbit is drawn: a star, filled where it is stable."""
    fill = EXACT_COLOR if orbit.stable else "white"
    return dict(marker="*", ms=11, mfc=fill, mec=EXACT_COLOR, mew=1.0, ls="none", zorder=8)


def _kinds(response, exact) -> list[Line2D]:
    """Return what the legend says of the crossings there are."""
    handles = {}
    for cycle in response.limit_cycles:
        kind = (
            "cycle on another motion of the block" if cycle.branch
            else "prediction, unreliable" if cycle.grade == UNRELIABLE
            else "predicted cycle, stable" if cycle.stable
            else "predicted cycle, unstable" if cycle.stable is not None
            else "predicted cycle, stability open"
        )  # fmt: skip
        handles[kind] = Line2D([], [], label=kind, **{**_look(cycle), "ms": 5})
    for _, orbit in exact:
        words = {True: "exact orbit, stable", False: "exact orbit, unstable", None: "exact motion, irregular"}
        kind = words[orbit.stable]
        handles[kind] = Line2D([], [], label=kind, **{**_look_exact(orbit), "ms": 7})
    return list(handles.values())


def _mark(labels, response, point_label, exact):
    """Mark the crossings and the exact orbits, and write amplitude and frequency beside each."""
    ax, force = labels.ax, units(response.family)[0]
    if point_label == _POINT_LABEL and (force or not memoryless(response.family)):
        point_label = f"%.4g{force} @ %.4g rad/s"
    for position, cycle in zip(response.positions, response.limit_cycles, strict=True):
        ax.plot(position.real, position.imag, **{**_look(cycle), "ms": 7})
    for place, orbit in exact:
        ax.plot(place.real, place.imag, **_look_exact(orbit))
    places = [*response.positions, *(place for place, _ in exact)]
    labels.block_points([(p.real, p.imag) for p in places], 7)
    if not point_label:
        return
    for position, cycle in zip(response.positions, response.limit_cycles, strict=True):
        labels.write(
            (point_label % (cycle.amplitude, cycle.omega)).strip() + _standing(cycle),
            [(position.real, position.imag)],
            offsets=_away(ax, position, places),
            must=True, avoid=False, color=CROSSING_COLOR, fontweight="normal" if cycle.branch else "bold",
            bbox=dict(boxstyle="round,pad=0.1", fc="white", ec="none", alpha=0.85), zorder=7,
        )  # fmt: skip

    for place, orbit in exact:
        labels.write(
            (point_label % (orbit.amplitude, orbit.omega)).strip(), [(place.real, place.imag)],
            offsets=_away(ax, place, places), must=True, avoid=False, color=EXACT_COLOR,
            bbox=dict(boxstyle="round,pad=0.1", fc="white", ec="none", alpha=0.85), zorder=7,
        )  # fmt: skip


_PALE = "#ecc9d1"  # of the crossings' colour
_ASIDE = np.array(
    [
        *[(7, 5), (7, -5), (-7, 5), (-7, -5), (0, 9), (0, -9)],
        *[(10, 13), (10, -13), (-10, 13), (-10, -13), (10, 0), (-10, 0)],
    ]
)
"""Where a label may stand beside its crossing [pt], the best first."""


def _away(ax, position, positions):
    """Return the places beside a crossing, those away from a near one first."""
    at = ax.transData.transform([(p.real, p.imag) for p in positions])
    own = ax.transData.transform((position.real, position.imag))
    apart = at - own
    far = np.hypot(*apart.T)
    near = apart[(far > 0) & (far < 40)]
    if not len(near):
        return _ASIDE.tolist()
    toward = _ASIDE @ (near[0] / np.hypot(*near[0]))
    return _ASIDE[np.argsort(toward > 0, kind="stable")].tolist()


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
