"""Draw the two pictures of the README, with its own code: `python docs/readme_pictures.py`.

Takes a quarter of a minute; needs only the package. The PNGs are kept in docs/images.
"""

import re
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import ctrl_df as cdf

HERE = Path(__file__).parent
BLACK, ACCENT, GREY = "#1f2933", "#c8501e", "#8a94a0"
STYLE = {
    "font.size": 8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": GREY,
    "axes.titlesize": 8.5,
    "axes.titlelocation": "left",
    "legend.frameon": False,
}


def readme():
    """Run the README's own snippets; return their names."""
    names = {}
    for code in re.findall(r"```python\n(.*?)```", (HERE.parent / "README.md").read_text(), re.S):
        exec(code, names)
    plt.close("all")
    return names


def swings(loop, start, seconds):
    """Return times and the greatest excursion [mm] about each, the mass being let go at rest at `start` [mm].

    The first point is the start itself.
    """
    t = np.arange(0, seconds, 2e-3)
    x = 1e3 * np.abs(np.asarray(cdf.event_response(loop, t, 0, {"x": 1e-3 * start}).outputs)[0])
    parts = x[: x.size // 300 * 300].reshape(-1, 300).max(axis=1)
    return np.r_[0.0, 0.6 * np.arange(len(parts)) + 0.3], np.r_[start, parts]


def hunting(said):
    """Draw one and a half periods of the motion, and what becomes of starts of three sizes."""
    cycle, exact = said["check"].rows[0].predicted, said["check"].rows[0].exact
    border = said["check"].rows[1].exact
    figure, (motion, course) = plt.subplots(1, 2, figsize=(7.4, 2.8), layout="constrained")
    loop = cdf.closed_loop(said["controller"], said["axis"])
    t = np.linspace(0, 1.5 * exact.period, 800)
    x = 1e3 * np.asarray(cdf.event_response(loop, t, 0, exact.states[:, 0]).outputs)[0]
    motion.plot(t, x, color=ACCENT, lw=1.8, label="exact")
    begin = t[np.argmax(x)]
    sine = 1e3 * cycle.output_amplitude * np.cos(cycle.omega * (t - begin))
    motion.plot(t, sine, color=GREY, lw=1, ls="--", label="predicted sine")
    motion.set_xlabel("time [s]")
    motion.set_ylabel("position [mm]")
    motion.set_title(f"it hunts: {exact.omega:.2f} rad/s, {1e3 * exact.peak:.1f} mm, stopping at each end")
    motion.set_ylim(-4.6, 6)
    motion.legend(loc="upper left", ncols=2)

    low, high = said["check"].fate.borders[0].below, said["check"].fate.borders[0].above
    for start, seconds, color in ((0.5, 60, BLACK), (3.9, 60, BLACK), (4.6, 24, GREY)):
        course.plot(*swings(loop, start, seconds), color=color, lw=1.2)
        course.plot(0, start, "o", color=color, ms=3.5, clip_on=False, zorder=3)
    for peak, line, name, end in ((exact.peak, "-", "stable", 46), (border.peak, "--", "unstable", 60)):
        course.axhline(1e3 * peak, color=ACCENT, lw=1.2, ls=line)
        said_of = f"{name} orbit, peak {1e3 * peak:.1f} mm"
        course.text(end, 1e3 * peak + 0.08, said_of, color=ACCENT, ha="right", va="bottom")
    course.text(2.5, 0.15, "start 0.5 mm", color=BLACK)
    course.text(2, 2.95, "start 3.9 mm", color=BLACK)
    course.text(6.5, 6.6, "start 4.6 mm", color=GREY)
    course.set_ylim(0, 8)
    course.set_xlim(-1, 60)
    course.set_xlabel("time [s]")
    course.set_ylabel("greatest excursion [mm]")
    course.set_title(f"let go at rest; starts beyond {500 * (low + high):.1f} mm diverge")
    figure.savefig(HERE / "images" / "hunting.png", dpi=160)


def missing(said):
    """Draw the error of the model before and after, and the candidates in order."""
    diagnosis, record = said["diagnosis"], said["record"]
    before = cdf.compare(diagnosis.baseline.model, record, mode="free")
    after = cdf.compare(diagnosis.best.model, record, mode="free")
    figure, (error, bars) = plt.subplots(
        1, 2, figsize=(7.4, 2.8), layout="constrained", width_ratios=(1.5, 1)
    )
    for comparison, color, label in (
        (before, GREY, "fitted model"),
        (after, ACCENT, "with Stribeck friction"),
    ):
        residual = (
            comparison.residual if isinstance(comparison.residual, np.ndarray) else comparison.residual[0]
        )
        error.plot(record.t, 1e3 * residual, color=color, lw=0.8, label=label)
    error.set_xlabel("time [s]")
    error.set_ylabel("measured − simulated [mm]")
    error.set_title("what the model gets wrong")
    error.legend(loc="upper left", ncols=2)
    error.margins(y=0.15)
    tried = sorted((c for c in diagnosis.ranking if np.isfinite(c.nrmse)), key=lambda c: -c.evidence)[:6][
        ::-1
    ]
    gains = [max(c.evidence, 0.0) for c in tried]
    best = diagnosis.best.id
    colors = [ACCENT if c.id == best else GREY for c in tried]
    bars.barh([c.id.replace("_", " ") for c in tried], gains, color=colors, height=0.6)
    bars.set_xlabel("evidence for the effect [nats]")
    bars.set_title("candidates, best first")
    bars.tick_params(axis="y", length=0)
    figure.savefig(HERE / "images" / "missing.png", dpi=160)


if __name__ == "__main__":
    with plt.rc_context(STYLE):
        found = readme()
        hunting(found)
        missing(found)
