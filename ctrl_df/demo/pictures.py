"""The paper's figures 3, 4, 5, 7, 8, 9, 10, drawn again."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from ..df.describing import quiet_family
from ..plot.describing import describing_function_plot
from ..plot.family import plot_family
from ..plot.harmonics import plot_harmonics
from ..plot.parts.page import WIDE, style
from ..plot.response import loop_response_plot
from .findings import Finding, Settled, settled, simulate
from .systems import backlash_plant, friction_plant

DPI = 130
Findings = dict[str, Finding]


def draw_all(findings: Findings, folder: Path) -> list[Path]:
    """Draw every figure into `folder`; return their paths."""
    figures: dict[str, Callable[[Findings], object]] = {
        "fig3-friction-family": _figure_3,
        "fig3-friction-crossings": _crossings("friction"),
        "fig4-friction-harmonics": _figure_4,
        "fig5-friction-loop": _figure_5,
        "fig7-backlash-families": _figure_7,
        "fig7-backlash-crossings": _crossings("backlash 0.2"),
        "fig8-backlash-harmonics": _figure_8,
        "fig9-backlash-loop-0.2": _figure_9,
        "fig10-backlash-loop-0.8": _figure_10,
        "hunting-with-stiction": _hunting,
    }
    paths = []
    for name, draw in figures.items():
        plt.close("all")
        path = folder / f"{name}.png"
        with plt.rc_context(style(WIDE)):
            draw(findings).savefig(path, dpi=DPI)  # type: ignore[attr-defined]
        plt.close("all")
        paths.append(path)
    return paths


def _figure_3(_):
    family = quiet_family(friction_plant(), np.geomspace(6, 60, 60), np.geomspace(2, 30, 90))
    figure, ax = plt.subplots(figsize=(6.8, 5), layout="constrained")
    plot_family(family, ax=ax, title="Fig. 3: -1/N(A, ω) of the mass with friction")
    return figure


def _figure_4(_):
    family = quiet_family(friction_plant(), np.geomspace(5.2, 60, 60), np.geomspace(2, 40, 60))
    return plot_harmonics(
        family, title="Fig. 4: harmonic content of x, mass with friction", amplitude=15, omega=14
    ).figure


def _figure_5(findings):
    finding = findings["friction"]
    labels = [f"rest start {1e3 * start:g} mm" for start, _ in finding.runs]
    cplt = loop_response_plot(
        [run for _, run in finding.runs],
        labels=labels,
        window=(0, 6),
        title="Fig. 5: the friction loop has a boundary, not an attractor",
    )
    reach = 1.6 * np.abs(np.asarray(finding.runs[0][1].outputs)).max(axis=1)
    for axis, limit in zip(np.ravel(cplt.axes), (reach[-1], 1e3 * reach[0]), strict=True):
        axis.set_ylim(-limit, limit)
    return cplt.figure


def _figure_7(_):
    figure, axes = plt.subplots(1, 2, figsize=(10.5, 4.8), layout="constrained")
    figure.suptitle("Fig. 7: -1/N(A, ω) of two masses with backlash (zigzag: averages over irregular motion)")
    figure.draw_without_rendering()  # both panels have their width before either is drawn on
    for ax, restitution in zip(axes, (0.2, 0.8), strict=True):
        plant = backlash_plant(restitution)
        family = quiet_family(plant, np.geomspace(10, 100, 40), np.geomspace(5, 60, 40))
        plot_family(family, ax=ax, title=f"restitution {restitution}")
    return figure


def _figure_8(_):
    figure, axes = plt.subplots(1, 2, figsize=(10.5, 4.5), layout="constrained", sharey=True)
    figure.suptitle(
        "Fig. 8: harmonic content of x, two masses with backlash (jagged: averages over irregular motion)"
    )
    axes[0].set_ylim(1e-8, 1e-2)
    figure.draw_without_rendering()  # both panels have their width before either is drawn on
    for ax, restitution in zip(axes, (0.2, 0.8), strict=True):
        plant = backlash_plant(restitution)
        family = quiet_family(plant, np.array([20.0]), np.geomspace(5, 60, 80))
        plot_harmonics(family, ax=ax)
        ax.set_title(f"restitution {restitution}, {ax.get_title()}")
    axes[1].set_ylabel("")
    return figure


def _figure_9(findings):
    start, run = findings["backlash 0.2"].runs[0]
    end = _end(run)
    return loop_response_plot(
        run,
        window=(0, 6),
        title="Fig. 9: backlash, restitution 0.2, the first seconds of the way to "
        f"{end.omega:.3f} rad/s, {1e3 * end.position:.2f} mm",
    ).figure


def _figure_10(findings):
    loop = findings["backlash 0.8"].loop
    figure = plt.figure(figsize=(10, 4.8), layout="constrained")
    axes = figure.subplots(2, 2, sharex="col", width_ratios=(2, 1))
    early = simulate(loop, loop.starts[0], time=8.0, step=1e-3)
    loop_response_plot(early, window=(0, 8), ax=axes[:, 0])
    # far beyond the irregular motion: 200 s, sampled finely at the end
    late = simulate(loop, loop.starts[0], time=200.3, step=5e-4)
    loop_response_plot(late, window=(200.0, 200.3), ax=axes[:, 1])
    axes[0, 0].set_title("the first seconds, as in the paper")
    axes[0, 1].set_title(f"after 200 s: {_end(late).omega:.2f} rad/s")
    for axis in axes[:, 1]:
        axis.set_ylabel("")
    figure.suptitle("Fig. 10: backlash, restitution 0.8: irregular for minutes, then a rattle")
    return figure


def _hunting(findings):
    start, run = findings["static 5.5"].runs[0]
    end = _end(run)
    t_end = float(np.asarray(run.time)[-1])
    return loop_response_plot(
        run,
        window=(t_end - 3, t_end),
        title=f"static level 5.5 N: hunting at {end.omega:.3f} rad/s, stuck between the jumps",
    ).figure


def _crossings(key):
    def draw(findings):
        figure, ax = plt.subplots(figsize=(7.4, 5), layout="constrained")
        describing_function_plot(
            findings[key].response, ax=ax, label="PID", point_label="%.4g N @ %.4g rad/s",
            exact=findings[key].check,
            title=f"PID and -1/N(A, ω): {findings[key].loop.title}",
        )  # fmt: skip
        return figure

    return draw


def _end(run) -> Settled:
    end = settled(run)
    if end is None:
        raise RuntimeError("a run of the demo came to rest that should oscillate; the engine has changed")
    return end
