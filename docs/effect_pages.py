"""One page an effect, made by code: characteristic, law, print on N(a, omega), print on residuals, source.

All that a page says is what the class of the effect says; the pictures come from the effect added to one and
the same machine. An effect that joins the library gets its page with no change here.
"""

import dataclasses
import inspect
import math
import warnings
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import ctrl_df as cdf
from ctrl_df.units import size, turning

NOISE = 2e-5  # of a record [m, rad]
BLACK, ACCENT, GREY = "#1f2933", "#c8501e", "#8a94a0"
STYLE = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": GREY,
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "legend.frameon": False,
}
# What is typical of the machine below: an effect whose parameters have no default gets sizes by their units.
SIZES = {"N": 3.0, "m": 0.03, "s": 0.03, "rad": 0.5, "kg": 2.0, "V": 3.0, "A": 3.0}
SHOWN = {
    "drift": {"rate": 0.02},
    "input_gain": {"gain": 0.8},
    "load_dependent_friction": {"coefficient": 0.2},
    "position_ripple": {"amplitude": 2.0, "wavelength": 0.1},
    "stribeck": {"level": 3.0, "velocity": 0.1},
    "torque_constant": {"constant": 2.0, "resistance": 1.0},
}
ROLES = {
    "force": "a force that depends on position, speed or time",
    "friction": "a level of dry friction",
    "contact": "a contact that opens and closes",
    "coupling": "a joint between motor and load",
    "presliding": "bristles that carry the dry friction",
    "input": "something on the way of the force into the machine",
    "output": "something on the way of the position to the record",
}


def machine(turning=False):
    """Return the machine that every effect is added to: friction, and a spring that keeps it in place.

    About an axis the spring is soft: over small angles what goes with their sine is a spring as well.
    """
    body = cdf.Inertia(2.0) if turning else cdf.Mass(2.0)
    spring = cdf.LinearSpring(6.0 if turning else 60.0)
    return body.with_effect(cdf.Viscous(4.0)).with_effect(cdf.Coulomb(1.0)).with_effect(spring)


def typical(cls):
    """Return the effect with its default parameters, or typical ones where there are none."""
    values = dict(SHOWN.get(cls.id, {}))
    for field in dataclasses.fields(cls):
        spec = field.metadata.get("parameter")
        if spec and field.name not in values and field.default is dataclasses.MISSING:
            value = size(spec["unit"], SIZES)
            values[field.name] = float(np.clip(value, spec["lower"], spec["upper"]))
    return cls(**values)


def with_effect(effect):
    """Return a machine without and with the effect, on a line if it can be, else about an axis."""
    errors = []
    for about in (False, True):
        base = machine(about)
        own = [e for e in base.effects if e.id == effect.id]
        bare = base.without_effect(effect.id) if own else base
        try:
            return bare, bare.with_effect(own[0] if own else effect)
        except (TypeError, ValueError) as error:
            errors.append(str(error))
    raise ValueError(errors[0])


# --- pictures -----------------------------------------------------------------------------------------------


def law_curves(effect, words):
    """Return the curves of a plain law as (label, abscissa, force), over speed and place; or []."""
    law, p = effect.law, np.array(effect.values)
    reach = max(0.2, 0.5 * getattr(effect, "wavelength", 0.0))
    v, x = np.linspace(-1, 1, 801), np.linspace(-reach, reach, 801)
    over_speed, over_place = (
        f"{name} [{words.unit_of(unit)}]" for name, unit in ((words.velocity, "m/s"), (words.position, "m"))
    )
    if law is None or effect.states or effect.role not in ("force", "friction"):
        return []
    try:
        if effect.role == "friction":
            level = [math.copysign(law(1.0, math.copysign(1, s), abs(s), 1.0, p), s) for s in v]
            return [(over_speed, v, -np.array(level))]
        dz = np.zeros(1)
        over_v = np.array([law(0.0, 0.0, s, dz, p, dz) for s in v])
        over_x = np.array([law(0.0, s, 0.0, dz, p, dz) for s in x])
    except Exception:  # a law with other arguments is shown by what it does
        return []
    curves = [(over_speed, v, over_v), (over_place, x, over_x)]
    return [c for c in curves if np.ptp(c[2]) > 0] or curves[:1]


def characteristic(effect, bare, full, path):
    """Draw the law; where the engine itself knows it, what the machine does under a slowly swelling force."""
    words = full.coordinates
    curves = law_curves(effect, words)
    figure, axes = plt.subplots(
        1, max(len(curves), 1), figsize=(6.6, 2.6), layout="constrained", squeeze=False
    )
    for ax, (label, at, force) in zip(axes[0], curves, strict=False):
        ax.axhline(0, color=GREY, lw=0.5)
        ax.plot(at, force, color=ACCENT, lw=1.6)
        ax.set_xlabel(label)
        ax.set_ylabel(f"{words.force} on the body [{words.force_unit}]")
    if not curves:
        t = np.linspace(0, 10, 4001)
        force = 6 * np.sin(2 * np.pi * 0.2 * t) * np.minimum(t / 5, 1)
        for block, color, label in ((bare, GREY, "without"), (full, ACCENT, "with the effect")):
            x = np.asarray(cdf.event_response(block, t, force).outputs)[0]
            axes[0, 0].plot(force, 1e3 * x, color=color, lw=1.1, label=label)
        units = dict.fromkeys(b.signals[b.input_labels[0]] for b in (bare, full))
        axes[0, 0].set_xlabel(f"{words.force}, slow [{' or '.join(units)}]")
        axes[0, 0].set_ylabel(f"{words.position} shown [m{words.unit}]")
        figure.legend(loc="outside upper left", ncols=2)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def on_plane(bare, full, path):
    """Draw N with the effect over N without, at three amplitudes, over frequency."""
    A, omega = np.array([3.0, 6.0, 18.0]), np.geomspace(1.5, 30, 40)
    with warnings.catch_warnings():  # an average, where a motion has no period, is what is drawn
        warnings.filterwarnings("ignore", ".*aperiodic")
        N0, N1 = (cdf.describing_function_family(b, A, omega).N for b in (bare, full))
    ratio = np.where(np.abs(N1) > 1e-3 * np.abs(N0), N1 / N0, np.nan)  # at less the body does not move
    words = full.coordinates
    figure, axes = plt.subplots(1, 2, figsize=(6.6, 2.6), layout="constrained")
    for k, (a, style) in enumerate(zip(A, (":", "--", "-"), strict=True)):
        axes[0].semilogx(
            omega, 20 * np.log10(np.abs(ratio[k])), color=ACCENT, ls=style, lw=1.3,
            label=f"{words.force} {a:g} {words.force_unit}",
        )  # fmt: skip
        axes[1].semilogx(omega, np.degrees(np.angle(ratio[k])), color=ACCENT, ls=style, lw=1.3)
    for ax, title, unit in zip(
        axes, ("gain, with over without", "phase, with less without"), ("dB", "deg"), strict=True
    ):
        ax.axhline(0, color=GREY, lw=0.5)
        ax.set_title(title)
        ax.set_xlabel("frequency [rad/s]")
        ax.set_xticks([2, 5, 10, 20], ["2", "5", "10", "20"])
        ax.minorticks_off()
        ax.set_ylabel(unit)
        low, high = ax.get_ylim()
        ax.set_ylim(min(low, -0.1), max(high, 0.1))
    figure.legend(loc="outside lower center", ncols=3)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def on_residual(bare, full, path):
    """Draw what a record of the machine leaves when the model without the effect is fitted to it."""
    t = np.arange(0, 6, 0.01)
    force = (
        8 * np.sin(2 * np.pi * 0.35 * t)
        + 6 * np.sin(2 * np.pi * 0.9 * t + 1)
        + 4 * np.sin(2 * np.pi * 2.3 * t)
    )
    x = np.asarray(cdf.event_response(full, t, force, input_hold="zoh").outputs)[0]
    noisy = x + NOISE * np.random.default_rng(1).standard_normal(t.size)
    words = full.coordinates
    record = cdf.Measurement(t, force, noisy, input_unit=words.force_unit, output_unit=words.unit)
    fit = cdf.refit(bare, record)
    row = fit.comparison.records[0] if hasattr(fit.comparison, "records") else fit.comparison[0]
    residual, v = 1e3 * row.residual, np.gradient(x, t)
    figure, axes = plt.subplots(
        1, 3, figsize=(6.6, 2.3), layout="constrained", width_ratios=(1.6, 1, 1), sharey=True
    )
    axes[0].plot(t, residual, color=ACCENT, lw=0.9)
    axes[0].set_xlabel("time [s]")
    axes[0].set_ylabel(f"residual [m{words.unit}]")
    for ax, at, name, unit in (
        (axes[1], 1e3 * x, words.position, f"m{words.unit}"),
        (axes[2], v, words.velocity, words.unit_of("m/s")),
    ):
        ax.plot(at, residual, ".", color=ACCENT, ms=1.5)
        ax.set_xlabel(f"{name} [{unit}]")
    figure.savefig(path, dpi=110)
    plt.close(figure)
    left = f" Here {100 * row.nrmse:.2g} % of the motion (rms)"
    if row.rmse < 1.5 * NOISE:
        left += ", which is the noise: the model's other parameters take the place of the effect"
    return left + "."


# --- the page -----------------------------------------------------------------------------------------------

PICTURES = (
    ("characteristic", "Characteristic", characteristic),
    ("plane", "Effect on N(a, ω)", on_plane),
    ("residual", "What it leaves in the residual", on_residual),
)
SAYS = {
    "characteristic": "The force of the law itself; or, where it is no function of speed or place, what the "
    "machine does under a slowly swelling force. Levels of friction add to 1 N.",
    "plane": "How the answer to a sine changes: the describing function with the effect over that without. "
    "Lines break where no periodic answer exists.",
    "residual": "What is left of a record when all but this effect is in the model, and its parameters are "
    "fitted.",
}


def law_text(cls) -> tuple[str, str]:
    """Return the first line of the docstring and what follows before its sections."""
    doc = inspect.getdoc(cls) or cls.__name__
    body = doc.split("\nParameters\n")[0].split("\nExamples\n")[0].split("\nReferences\n")[0].strip()
    first, _, rest = body.partition("\n\n")
    return " ".join(first.split()), rest


def rst_to_md(text) -> str:
    """Return reStructuredText of a docstring as Markdown: literals alone differ."""
    return text.replace("``", "`")


def cell(text) -> str:
    """Return a text as a cell of a Markdown table: a bare ``|`` would end the cell."""
    return text.replace("|", r"\|")


def bounds(spec) -> str:
    """Return the range of a parameter in words."""
    low, high = spec["lower"], spec["upper"]
    above = "" if low == -math.inf else f"{'>' if spec['strict'] else '≥'} {low:g}"
    below = "" if high == math.inf else f"≤ {high:g}"
    return ", ".join(filter(None, (above, below))) or "any"


def parameters(cls) -> str:
    """Return the table of parameters."""
    rows = []
    for field in dataclasses.fields(cls):
        spec = field.metadata.get("parameter")
        if spec:
            default = "" if field.default is dataclasses.MISSING else f"{field.default:g}"
            unit = turning(spec["unit"]) if cls.turns else spec["unit"]
            rows.append(
                f"| `{field.name}` | {unit or '–'} | {bounds(spec)} | {default} | {cell(spec['meaning'])} |"
            )
    return "| parameter | unit | range | default | meaning |\n|---|---|---|---|---|\n" + "\n".join(rows)


def page(job) -> tuple[str, str]:
    """Write the page of one effect with its pictures; return its id and what failed."""
    key, folder = job
    cls = cdf.effect_class(key)
    first, rest = law_text(cls)
    text = f"# {cls.__name__}\n\n{rst_to_md(first)}\n\n"
    text += f"id `{key}`, {ROLES[cls.role]}. Source: {cls.source or 'elementary'}.\n\n"
    text += f"{parameters(cls)}\n\n## Law\n\n{rst_to_md(rest) or 'As said above.'}\n\n"
    if cls.shows:
        text += f"In the residual of a model without it: {cls.shows}.\n\n"
    failed = ""
    try:
        effect = typical(cls)
        bare, full = with_effect(effect)
        body = f"a body of 2 {full.coordinates.unit_of('kg')}".replace("^2", "²")
        text += f"The pictures show `{effect!r}` on {body} with a spring and a little friction.\n"
    except Exception as error:
        return key, _finish(folder, key, text, f"{type(error).__name__}: {error}")
    for name, title, draw in PICTURES:
        path = folder / f"{key}-{name}.png"
        says = SAYS[name]
        try:
            with plt.rc_context(STYLE), np.errstate(all="ignore"):
                args = (effect, bare, full, path) if name == "characteristic" else (bare, full, path)
                left = draw(*args)
            says += left or ""
            text += f"\n## {title}\n\n{says}\n\n![{title} of {cls.__name__}]({path.name})\n"
        except Exception as error:
            plt.close("all")
            failed = f"{name}: {type(error).__name__}: {error}"
            text += f"\n## {title}\n\nNot drawn: this machine shows nothing of it.\n"
    return key, _finish(folder, key, text, failed)


def _finish(folder, key, text, failed) -> str:
    (folder / f"{key}.md").write_text(text)
    return failed


def built_in() -> dict:
    """Return the effects that the package itself brings."""
    return {k: c for k, c in cdf.effect_library().items() if c.__module__.startswith("ctrl_df.")}


def write(folder, workers=2):
    """Write all pages and their index; those newer than the package stay as they are."""
    folder = Path(folder)
    folder.mkdir(exist_ok=True)
    classes = built_in()
    newest = max(p.stat().st_mtime for p in (*Path(cdf.__file__).parent.rglob("*.py"), Path(__file__)))
    old = [k for k in classes if not _fresh(folder / f"{k}.md", newest)]
    if old:
        with ProcessPoolExecutor(min(workers, len(old)), get_context("spawn")) as pool:
            for key, failed in pool.map(page, [(k, folder) for k in old]):
                if failed:
                    print(f"effects/{key}: {failed}")
    rows = "\n".join(
        f"| [{c.__name__}]({k}.md) | {c.role} | {cell(rst_to_md(law_text(c)[0]))} |"
        for k, c in sorted(classes.items())
    )
    toctree = "\n".join(sorted(classes))
    text = f"""# Effects

A machine is an inertia plus effects: `cdf.Mass(9).with_effect(cdf.Coulomb(5))`. These are all there are; one
of your own is [one class](../gallery/own_effect.rst). Each page shows the law, how the effect changes the
answer to a sine, and what it leaves in the residual of a model that lacks it.
[Which friction law when](../friction_laws.md) compares those of friction.

| effect | role | in a sentence |
|---|---|---|
{rows}

```{{toctree}}
:hidden:

{toctree}
```
"""
    target = folder / "index.md"
    if not target.exists() or target.read_text() != text:
        target.write_text(text)


def _fresh(path, newest) -> bool:
    return path.exists() and path.stat().st_mtime > newest


if __name__ == "__main__":
    write(Path(__file__).parent / "effects")
