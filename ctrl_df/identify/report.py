"""One self-contained HTML file that tells the story of a ladder: text, tables, pictures inside."""

from __future__ import annotations

import base64
import html
import io
import math
from string import Template

from ..checks import place_to_write

_PAGE = Template("""<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>$title</title>
<style>
:root { --ink: #1b2430; --soft: #5b6675; --line: #dfe4ea; --blue: #1f4e9c; --paper: #fff; }
* { box-sizing: border-box; }
body { font: 16px/1.55 system-ui, "Segoe UI", Arial, sans-serif; color: var(--ink); background: #f4f6f8;
  margin: 0; overflow-wrap: break-word; }
main { max-width: 60rem; margin: 0 auto; padding: 2.5rem 1.5rem 4rem; background: var(--paper); }
h1 { font-size: 1.75rem; line-height: 1.2; margin: 0 0 .3rem; }
h2 { font-size: 1.2rem; margin: 2.4rem 0 .6rem; padding-top: .8rem; border-top: 1px solid var(--line); }
p.lead { font-size: 1.08rem; border-left: 4px solid var(--blue); padding: .2rem 0 .2rem 1rem;
  margin: 1.2rem 0; }
.verdict { display: inline-block; background: var(--blue); color: #fff; border-radius: 3px;
  padding: .1rem .6rem; }
.soft { color: var(--soft); font-size: .92rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: .93rem; font-variant-numeric: tabular-nums; }
th { text-align: left; color: var(--soft); font-weight: 600; border-bottom: 2px solid var(--line);
  padding: .35rem .6rem; white-space: nowrap; }
td { border-bottom: 1px solid var(--line); padding: .35rem .6rem; vertical-align: top; }
td:first-child { min-width: 8.5rem; }
td.n, th.n { text-align: right; white-space: nowrap; }
figure { margin: 1rem 0; }
img { max-width: 100%; height: auto; display: block; margin: 0 auto; }
figcaption { color: var(--soft); font-size: .92rem; text-align: center; }
details { margin: .6rem 0; border: 1px solid var(--line); border-radius: 4px; padding: .3rem .9rem; }
summary { cursor: pointer; font-weight: 600; padding: .3rem 0; }
@media (max-width: 40rem) {
  main { padding: 1.2rem .9rem 2.5rem; } h1 { font-size: 1.35rem; }
  figure { overflow-x: auto; } img { min-width: 34rem; }
  td, th { padding: .3rem .4rem; }
}
@media print { body { background: #fff; } main { padding: 0; } }
</style></head><body><main>
<h1>$title</h1>
<p class="soft">$records</p>
<p><span class="verdict">$verdict</span></p>
<p class="lead">$lead</p>
<h2>The ladder</h2>
<p>$how</p>
$ladder
<div class="scroll">$steps</div>
<h2>Model and measurement</h2>
$pictures
<h2>The model</h2>
<p>$model</p>
<div class="scroll">$parameters</div>
$doubts
$neighbours
<h2>Step by step</h2>
$sections
<p class="soft">$closing</p>
</main></body></html>
""")

_ERRORS = {
    "output": "over the rms of the centred output, over windows each of which starts from a fitted state",
    "acceleration": "of the acceleration, averaged over some samples, over that measured: forces that no "
    "model has, such as friction that varies, are larger here than the noise of the sensor",
    "N": "of |N|",
}

_VERDICTS = {"none": "nothing missing", "effect": "found", "unknown": "something remains"}


def write_report(study, path) -> str:
    """Write the report of a `Study` and return the path as a string.

    Parameters
    ----------
    study : Study
    path : path-like
        File to write; its folder must exist.

    Raises
    ------
    OSError
        The folder does not exist, or the file cannot be written; said before any picture is drawn.
    """
    target = place_to_write("report", "path", path)
    target.write_text(render(study), encoding="utf-8")
    return str(target)


def render(study) -> str:
    """Return the report as HTML text."""
    names = ", ".join(_record(r) for r in study.train)
    held = ", ".join(_record(r) for r in study.holdout) or "a third of the same data"
    fit = _known(study)
    return _PAGE.substitute(
        title=html.escape(f"What the model of {study.train[0].name} was missing"),
        records=html.escape(f"Fitted to {names}. Held out: {held}."),
        verdict=_VERDICTS[study.verdict],
        lead=html.escape(study.summary().split("\n")[0]),
        how=html.escape(
            "Each step adds the effect that explains most of what is left, and refits everything. It stays "
            "only if the error on data it was not fitted to falls too. Effects added before are looked at "
            "again beside it: those no longer needed go, those that stood in for another give way to it. "
            f"Errors are rms {_ERRORS[study.measure]}."
        ),
        ladder=_picture(study.plot, "Error of every step, beside the noise"),
        steps=_steps(study),
        pictures=_pictures(study),
        model=html.escape(
            "A standard error is how far the value may be off by chance alone; two of them hold 95 % of the "
            "time if the structure is right."
        ),
        parameters=_parameters(study, fit),
        doubts="".join(f"<p>{html.escape(s)}</p>" for s in fit.unidentifiable) if fit else "",
        neighbours=_neighbours(study.neighbours),
        sections="\n".join(_section(i, s) for i, s in enumerate(study.steps)),
        closing=html.escape(
            "Evidence is the logarithm of the likelihood ratio over the step before, in nats, less Schwarz's "
            "price of the parameters; twenty nats are half a billion to one. "
            f"Computed in {study.seconds:.0f} s."
        ),
    )


def _record(record) -> str:
    if hasattr(record, "omega"):
        return f"{record.name} ({len(record.A)} amplitudes, {len(record.omega)} frequencies)"
    return f"{record.name} ({len(record):,} samples, {record.duration:.3g} s)"


def _known(study):
    """Refit the final model once more for its standard errors; None where that fails."""
    from .estimation.variables import default_free
    from .refit import refit

    names = default_free(study.model)
    try:
        return refit(study.model, list(study.train), names, budget=200)
    except (ValueError, ArithmeticError):
        return None


def _steps(study):
    rows = []
    for s in study.steps:
        name = _did(s)
        same = ", ".join(e.replace("_", " ") for e in s.equivalents) or "–"
        evidence = f"{s.evidence:,.0f}" if s.effect or s.changes else "–"
        rows.append([name, _percent(s.nrmse), _percent(s.nrmse_holdout), evidence, same])
    rows.append(["noise floor", _percent(study.noise), "", "", ""])
    return _table(["Step", "Error", "Held out", "Evidence", "Same on these data"], rows, numeric=(1, 2, 3))


def _did(step) -> str:
    """Return what a step did, in words."""
    added = [f"+ {_words(step.effect)}"] if step.effect else []
    gone, new = " and ".join(map(_words, step.dropped)), " and ".join(map(_words, step.instead))
    if new:
        added.append(f"{new} in place of {gone}" if gone else f"with {new}")
    elif gone:
        added.append(f"without {gone}")
    return "; ".join(added) or "start, refitted"


def _neighbours(neighbours) -> str:
    """Return the final model beside all that are one exchange away: a sentence, the nearest, and the rest."""
    if not neighbours:
        return ""
    table = neighbours.table(len(neighbours))
    rows = [list(row) for row in table.rows]
    head = ["Neighbour", "Evidence", "Error", "Held out", "Verdict"]
    near, far = rows[:10], rows[10:]
    told = (
        "Evidence is over the final model: negative where the data speak against the neighbour. Those "
        "without a held-out error came nowhere near at a first look over short segments, of which their "
        "evidence is."
    )
    parts = [
        "<h2>One exchange away</h2>",
        f'<p>{html.escape(neighbours.sentence)}</p><p class="soft">{html.escape(told)}</p>',
        f'<div class="scroll">{_table(head, near, numeric=(1, 2, 3))}</div>',
    ]
    if far:
        rest = f'<div class="scroll">{_table(head, far, numeric=(1, 2, 3))}</div>'
        parts.append(f"<details><summary>{len(far)} more</summary>{rest}</details>")
    return "\n".join(parts)


def _percent(value) -> str:
    return f"{100 * value:.3g} %" if math.isfinite(value) else "–"


def _pictures(study):
    """Compare the first and the last model with the record held out, or the training record."""
    from .compare import compare

    record = (study.holdout or study.train)[0]
    parts = []
    for model, name in ((study.steps[0].model, "The start, refitted"), (study.model, "The improved model")):
        if parts and len(study.steps) == 1:
            break
        comparison = compare(model, record)
        caption = f"{name}, on {record.name}. {comparison.where.sentences[0]}"
        parts.append(_picture(lambda c=comparison, n=name: c.plot(title=n), caption, caption=True))
    return "\n".join(parts)


def _section(number, step):
    d = step.diagnosis
    if d is None or not d.ranking:
        return ""
    title = "What the start is missing" if number == 0 else f"What is missing after: {_did(step)}"
    body = [
        f"<details{' open' if number == 0 else ''}><summary>{html.escape(title)}</summary>",
        f"<p>{html.escape(d.explanation)}</p>",
        _picture(d.plot, "Held-out error of every candidate"),
    ]
    if d.where is not None and d.where.significant:
        lines = "".join(f"<li>{html.escape(r.sentence)}</li>" for r in d.where.significant[:4])
        body.append(f"<p>Where the error is:</p><ul>{lines}</ul>")
    return "\n".join([*body, "</details>"])


def _parameters(study, fit):
    before = study.start.parameters
    rows = []
    for name, p in study.model.parameters.items():
        old = f"{before[name].value:.5g}" if name in before else "–"
        known = fit.parameters.get(name) if fit else None
        error, note = "–", ""
        if known is not None:
            error = f"± {known.standard_error:.2g}" if math.isfinite(known.standard_error) else "–"
            note = " (at its bound)" if known.at_bound else "" if known.identifiable else " (not determined)"
        rows.append(
            [_words(name), old, f"{p.value:.5g}", error, p.unit.replace(" ", "\u00a0"), p.meaning + note]
        )
    head = ["Parameter", "Start", "Fitted", "Standard error", "Unit", "Meaning"]
    return _table(head, rows, numeric=(1, 2, 3))


def _words(name) -> str:
    effect, _, parameter = name.rpartition(".")
    return f"{effect}: {parameter}".replace("_", " ") if effect else parameter.replace("_", " ")


def _table(head, rows, numeric=()):
    def cell(tag, i, text):
        kind = ' class="n"' if i in numeric else ""
        return f"<{tag}{kind}>{html.escape(str(text))}</{tag}>"

    top = "".join(cell("th", i, h) for i, h in enumerate(head))
    body = "".join("<tr>" + "".join(cell("td", i, c) for i, c in enumerate(row)) + "</tr>" for row in rows)
    return f"<table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"


def _picture(draw, text, caption=False):
    """Draw into a figure of its own and return it as an inline PNG."""
    import matplotlib.pyplot as plt

    open_before = plt.get_fignums()
    fig = plt.figure()
    try:
        drawn = draw().figure
        buffer = io.BytesIO()
        drawn.savefig(buffer, format="png", dpi=130)
    finally:
        for number in set(plt.get_fignums()) - set(open_before):
            plt.close(number)
        plt.close(fig)
    data = base64.b64encode(buffer.getvalue()).decode("ascii")
    below = f"<figcaption>{html.escape(text)}</figcaption>" if caption else ""
    return f'<figure><img alt="{html.escape(text)}" src="data:image/png;base64,{data}">{below}</figure>'
