"""One self-contained HTML file that tells the story of a ladder: text, tables, pictures inside."""

from __future__ import annotations

import base64
import html
import io
from pathlib import Path
from string import Template

_PAGE = Template("""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>$title</title>
<style>
:root { --ink: #1b2430; --soft: #5b6675; --line: #dfe4ea; --blue: #1f4e9c; --paper: #fff; }
body { font: 16px/1.55 system-ui, "Segoe UI", Arial, sans-serif; color: var(--ink); background: #f4f6f8;
  margin: 0; }
main { max-width: 960px; margin: 0 auto; padding: 2.5rem 1.5rem 4rem; background: var(--paper); }
h1 { font-size: 1.75rem; line-height: 1.2; margin: 0 0 .3rem; }
h2 { font-size: 1.15rem; margin: 2.4rem 0 .6rem; padding-top: .8rem; border-top: 1px solid var(--line); }
p.lead { font-size: 1.08rem; border-left: 4px solid var(--blue); padding: .2rem 0 .2rem 1rem; margin: 1.2rem 0; }
.verdict { display: inline-block; background: var(--blue); color: #fff; border-radius: 3px; padding: .1rem .6rem; }
.soft { color: var(--soft); font-size: .92rem; }
table { border-collapse: collapse; width: 100%; font-size: .93rem; font-variant-numeric: tabular-nums; }
th { text-align: left; color: var(--soft); font-weight: 600; border-bottom: 2px solid var(--line); padding: .35rem .6rem; }
td { border-bottom: 1px solid var(--line); padding: .35rem .6rem; vertical-align: top; }
td.n, th.n { text-align: right; }
.scroll { overflow-x: auto; }
img { max-width: 100%; height: auto; display: block; margin: .8rem auto; }
@media print { body { background: #fff; } main { padding: 0; } }
</style></head><body><main>
<h1>$title</h1>
<p class="soft">$records</p>
<p><span class="verdict">$verdict</span></p>
<p class="lead">$lead</p>
<h2>The ladder</h2>
$ladder
<div class="scroll">$steps</div>
$sections
<h2>The model</h2>
<div class="scroll">$parameters</div>
<p class="soft">$closing</p>
</main></body></html>
""")


def write_report(study, path) -> str:
    """Write the report of a `Study` and return the path as a string.

    Parameters
    ----------
    study : Study
    path : path-like
        File to write; its folder must exist.
    """
    target = Path(path)
    if not target.parent.exists():
        raise ValueError(f"report needs a folder that exists; got {str(target.parent)!r}. Create it first.")
    target.write_text(render(study), encoding="utf-8")
    return str(target)


def render(study) -> str:
    """Return the report as HTML text."""
    names = ", ".join(f"{r.name} ({len(r):,} samples, {r.duration:.3g} s)" for r in study.train)
    held = ", ".join(r.name for r in study.holdout) or "every third part of the record"
    return _PAGE.substitute(
        title=html.escape(f"What the model of {study.train[0].name} was missing"),
        records=html.escape(f"Fitted to {names}; held out: {held}."),
        verdict={"none": "nothing missing", "effect": "found", "unknown": "something remains"}[study.verdict],
        lead=html.escape(study.summary().split("\n")[0]),
        ladder=_picture(study.plot, "Error of every step beside the noise"),
        steps=_steps(study),
        sections="\n".join(_section(i, s) for i, s in enumerate(study.steps)),
        parameters=_parameters(study),
        closing=html.escape(
            "Errors are rms over the rms of the centred output, over windows each of which starts from a fitted "
            f"state. Evidence is in nats, less Schwarz's price of the parameters. Computed in {study.seconds:.0f} s."
        ),
    )


def _steps(study):
    rows = []
    for s in study.steps:
        name = "+ " + s.effect.replace("_", " ") if s.effect else "start, refitted"
        name += "".join(f"; {d.replace('_', ' ')} became idle and was dropped" for d in s.dropped)
        same = ", ".join(e.replace("_", " ") for e in s.equivalents) or "–"
        rows.append(
            [
                name,
                f"{s.nrmse:.3%}",
                f"{s.nrmse_holdout:.3%}",
                f"{s.evidence:,.0f}" if s.effect else "–",
                same,
            ]
        )
    rows.append(["noise floor", f"{study.noise:.3%}", "", "", ""])
    return _table(["Step", "Error", "Held out", "Evidence", "Same on these data"], rows, numeric=(1, 2, 3))


def _section(number, step):
    d = step.diagnosis
    if d is None or not d.ranking:
        return ""
    title = "Diagnosis of the start" if number == 0 else f"After adding {step.effect.replace('_', ' ')}"
    body = [f"<h2>{html.escape(title)}</h2>", f"<p>{html.escape(d.explanation)}</p>"]
    body.append(_picture(d.plot, "Held-out error of every candidate"))
    if d.where is not None and d.where.significant:
        body.append(
            "<ul>" + "".join(f"<li>{html.escape(r.sentence)}</li>" for r in d.where.significant[:4]) + "</ul>"
        )
    return "\n".join(body)


def _parameters(study):
    before = study.start.parameters
    rows = []
    for name, p in study.model.parameters.items():
        old = f"{before[name].value:.6g}" if name in before else "–"
        rows.append([name, old, f"{p.value:.6g}", p.unit, p.meaning])
    return _table(["Parameter", "Start", "Fitted", "Unit", "Meaning"], rows, numeric=(1, 2))


def _table(head, rows, numeric=()):
    def cell(tag, i, text):
        kind = ' class="n"' if i in numeric else ""
        return f"<{tag}{kind}>{html.escape(str(text))}</{tag}>"

    top = "".join(cell("th", i, h) for i, h in enumerate(head))
    body = "".join("<tr>" + "".join(cell("td", i, c) for i, c in enumerate(row)) + "</tr>" for row in rows)
    return f"<table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"


def _picture(draw, text):
    """Draw into a figure of its own and return it as an inline PNG."""
    import matplotlib.pyplot as plt

    open_before = plt.get_fignums()
    fig = plt.figure()
    try:
        drawn = draw().figure
        buffer = io.BytesIO()
        drawn.savefig(buffer, format="png", dpi=140)
    finally:
        for number in set(plt.get_fignums()) - set(open_before):
            plt.close(number)
        plt.close(fig)
    data = base64.b64encode(buffer.getvalue()).decode("ascii")
    return f'<img alt="{html.escape(text)}" src="data:image/png;base64,{data}">'
