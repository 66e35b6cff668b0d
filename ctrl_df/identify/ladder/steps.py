"""The steps of a ladder as they are reported, and the words where one is not taken."""

from __future__ import annotations

from dataclasses import replace

from ...numerals import percent
from ..results.diagnosis import CandidateEffect, Diagnosis
from ..results.explain import named
from ..results.ladder import Step
from ..results.neighbours import ADD, Neighbour
from ..selection.search import Search


def step_of(found: Diagnosis, model, errors, how: dict) -> Step:
    """Return a step; `how`: what it has done, as `addition` and `exchange` tell it."""
    return Step(
        model=model,
        nrmse=errors[0],
        nrmse_holdout=errors[1],
        parameters=_values(model),
        diagnosis=found,
        **how,
    )


def step_to(found: Diagnosis, tried, search: Search) -> Step:
    """Return the step to a model fitted in a search; `found`: the diagnosis that led to it."""
    how = {"effect": tried.block.effects[-1].id, "evidence": tried.evidence}
    return step_of(found, tried.block, search.errors(tried), how)


def with_model(step: Step, model, error: float, held_out: float) -> Step:
    """Return a step with its model as fitted to other data, and the errors there."""
    return replace(step, model=model, nrmse=error, nrmse_holdout=held_out, parameters=_values(model))


def refusal(effect: CandidateEffect, held_out: tuple[float, float]) -> str:
    """Return why an effect was not added; `held_out`: errors on held-out data, with it and without."""
    return (
        f"{named(effect.effect).capitalize()} was not added: it improves the model on the segments on which "
        f"the previous model was validated, but not on those chosen for the model with it (held-out error "
        f"{percent(held_out[0])} with it, {percent(held_out[1])} without)."
    )


def addition(effect: CandidateEffect) -> dict:
    """Return what a step that adds an effect has done."""
    return {"effect": effect.id, "evidence": effect.evidence, "equivalents": effect.equivalents}


def exchange(n: Neighbour) -> dict:
    """Return what a step to a neighbour has done."""
    if n.dropped == (n.added,):  # the same in a better minimum
        return {"evidence": n.evidence}
    if n.change == ADD:
        return {"effect": n.added, "evidence": n.evidence}
    return {"dropped": n.dropped, "instead": (n.added,) if n.added else (), "evidence": n.evidence}


def _values(model) -> dict[str, float]:
    return {k: p.value for k, p in model.parameters.items()}
