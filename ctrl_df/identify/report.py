"""One self-contained HTML file that reports a ladder: text, tables and pictures."""

from __future__ import annotations

import base64
import io
import math
from pathlib import Path

from ..checks import place_to_write
from ..numerals import percent
from .thresholds import REPORT_BUDGET, REPORT_DPI

_ERRORS = {
    "output": "over the rms of the centred output, over segments each from a fitted initial state",
    "acceleration": "of the acceleration, averaged over some samples, over that measured: forces that no "
    "model has, such as friction that varies, are larger here than the noise of the sensor",
    "force": "over the rms of the centred force, along the whole motion",
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
        The folder does not exist, or the file cannot be written; raised before any picture is drawn.
    """
    target = place_to_write("report", "path", path)
    target.write_text(render(study), encoding="utf-8")
    return str(target)


def render(study) -> str:
    """Return the report as HTML text."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    folder = FileSystemLoader(Path(__file__).parent, encoding="utf-8")
    page = Environment(loader=folder, autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    names = ", ".join(_record(r) for r in study.train)
    held_out = ", ".join(_record(r) for r in study.holdout) or "a third of the same data"
    fit, drawn = _known(study), _drawn(study)
    return page.get_template("report.html").render(
        title=f"What the model of {study.train[0].name} was missing",
        records=f"Fitted to {names}. Held out: {held_out}.",
        verdict=_VERDICTS[study.verdict],
        lead=study.summary().split("\n")[0],
        errors=study.model.coordinates.text(_ERRORS[study.measure]),
        as_drawn=f"over {drawn[0].over}, of {_shown(study).name} alone",
        ladder=_picture(study.plot, "Error of every step, beside the noise"),
        steps=_steps(study, drawn),
        pictures=_pictures(study, drawn),
        parameters=_parameters(study, fit),
        doubts=fit.unidentifiable if fit else (),
        neighbours=_neighbours(study.neighbours),
        sections=[_section(i, s) for i, s in enumerate(study.steps) if s.diagnosis and s.diagnosis.ranking],
        seconds=f"{study.seconds:.0f}",
    )


def _record(record) -> str:
    if hasattr(record, "omega"):
        return f"{record.name} ({len(record.A)} amplitudes, {len(record.omega)} frequencies)"
    return f"{record.name} ({len(record):,} samples, {record.duration:.3g} s)"


def _known(study):
    """Refit the final model once more for its standard errors; None where that fails."""
    from .refit import refit
    from .shooting.variables import default_free

    names = default_free(study.model)
    try:
        return refit(study.model, list(study.train), names, budget=REPORT_BUDGET)
    except (ValueError, ArithmeticError):
        return None


def _shown(study):
    """Return the record of the pictures: one held out, or fitted."""
    return (study.holdout or study.train)[0]


def _drawn(study) -> list:
    """Return the first and the last model beside the record of the pictures."""
    from .compare import compare

    models = [study.steps[0].model, study.model][: len(study.steps)]
    return [compare(model, _shown(study)) for model in models]


def _steps(study, drawn):
    """Return the table of the steps; `drawn`: the comparisons of the pictures, whose numbers it repeats."""
    rows, last = [], len(study.steps) - 1
    for i, s in enumerate(study.steps):
        same = ", ".join(e.replace("_", " ") for e in s.equivalents) or "–"
        evidence = f"{s.evidence:,.0f}" if s.effect or s.changes else "–"
        seen = percent(drawn[0 if i == 0 else -1].nrmse) if i in (0, last) else "–"
        rows.append([_did(s), percent(s.nrmse), percent(s.nrmse_holdout), seen, evidence, same])
    rows.append(["noise floor", percent(study.noise), "", "", "", ""])
    head = ["Step", "Error", "Held out", "As drawn", "Evidence", "Indistinguishable from"]
    return _table(head, rows, numeric=(1, 2, 3, 4))


def _did(step) -> str:
    """Return what a step did, in words."""
    added = [f"+ {_words(step.effect)}"] if step.effect else []
    gone, new = " and ".join(map(_words, step.dropped)), " and ".join(map(_words, step.instead))
    if new:
        added.append(f"{new} in place of {gone}" if gone else f"with {new}")
    elif gone:
        added.append(f"without {gone}")
    return "; ".join(added) or "start, refitted"


def _neighbours(neighbours) -> dict | None:
    """Return the final model beside all that differ by one effect: a sentence, the nearest, and the rest."""
    if not neighbours:
        return None
    rows = [list(row) for row in neighbours.table(len(neighbours)).rows]
    head = ["Neighbour", "Evidence", "Error", "Held out", "Verdict"]
    near, far = (_table(head, some, numeric=(1, 2, 3)) for some in (rows[:10], rows[10:]))
    return {"sentence": neighbours.sentence, "near": near, "far": far}


def _pictures(study, drawn):
    """Draw the first and the last model beside the record held out, or the training record."""
    parts = []
    for comparison, name in zip(drawn, ("The start, refitted", "The improved model"), strict=False):
        caption = (
            f"{name}, on {_shown(study).name}: it errs by {percent(comparison.nrmse)} over "
            f"{comparison.over}. {comparison.places[0]}"
        )
        parts.append(_picture(lambda c=comparison, n=name, **size: c.plot(title=n, **size), caption))
    return parts


def _section(number, step) -> dict:
    """Return what a step's diagnosis said."""
    d = step.diagnosis
    return {
        "title": "What the start is missing" if number == 0 else f"What is missing after: {_did(step)}",
        "explanation": d.explanation,
        "picture": _picture(d.plot, "Held-out error of every candidate"),
        "where": [r.sentence for r in d.where.significant[:4]] if d.where is not None else [],
    }


def _parameters(study, fit):
    before = study.start.parameters
    rows = []
    for name, p in study.model.parameters.items():
        old = f"{before[name].value:.5g}" if name in before else "–"
        unit = p.unit.replace(" ", "\u00a0")
        error, note = _sureness(fit.parameters.get(name) if fit else None)
        rows.append([_words(name), old, f"{p.value:.5g}", error, unit, p.meaning + note])
        for record, own in (fit.own.get(name, {}) if fit else {}).items():
            error, note = _sureness(own)
            rows.append([f"\u2003in {record}", "", f"{own.value:.5g}", error, unit, note.strip()])
    head = ["Parameter", "Start", "Fitted", "Standard error", "Unit", "Meaning"]
    return _table(head, rows, numeric=(1, 2, 3))


def _sureness(known) -> tuple[str, str]:
    """Return the standard error of a fitted parameter, and what else is to be said of it."""
    if known is None:
        return "–", ""
    error = f"± {known.standard_error:.2g}" if math.isfinite(known.standard_error) else "–"
    return error, " (at its bound)" if known.at_bound else "" if known.identifiable else " (not determined)"


def _words(name) -> str:
    effect, _, parameter = name.rpartition(".")
    return f"{effect}: {parameter}".replace("_", " ") if effect else parameter.replace("_", " ")


def _table(head, rows, numeric=()) -> dict:
    """Return a table as the template takes it; `numeric`: columns of numbers."""
    return {"head": head, "rows": rows, "numeric": numeric}


def _picture(draw, text) -> dict:
    """Draw into a figure of its own and return it as an inline PNG, with what it shows."""
    import matplotlib.pyplot as plt

    open_before = plt.get_fignums()
    buffer = io.BytesIO()
    try:
        draw(width=8.0).figure.savefig(buffer, format="png", dpi=REPORT_DPI)
    finally:
        for number in set(plt.get_fignums()) - set(open_before):
            plt.close(number)
    return {"png": base64.b64encode(buffer.getvalue()).decode("ascii"), "text": text}
