"""Values of a model's parameters: kept feasible, and those that every record has for itself.

A parameter whose value is a `PerRecord`, or that says so itself (`Parameter.per_record`), is one of the
records' own. The model carries these values wherever it goes; a simulator takes those of its record.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from typing import Any

import control as ct

from ...blocks.core import is_kinetic, kinetic_level
from ...blocks.mechanism import Mechanism
from ...blocks.parameter import Parameter
from ...simulate.loop import closed_loop
from ...values.per_record import PerRecord


def block_of(model) -> Any:
    """Return the block itself, or that of a loop; TypeError for what is neither."""
    parts = getattr(model, "parts", None)
    block = model if parts is None else parts.block
    if not isinstance(block, ct.NonlinearIOSystem):
        raise TypeError(
            f"compare and refit need a block or a loop of closed_loop; got {type(model).__name__}. "
            "Wrap a linear system with ct.nlsys, or build the block from ctrl_df.Mass or Inertia and effects."
        )
    return block


def has_many_minima(model) -> bool:
    """Whether the error over a model's parameters has many minima (`Mechanism.many_minima`)."""
    return getattr(block_of(model), "many_minima", False)


def with_block(model, block):
    """Return a block as the model was given: within a loop of the same controller, or itself."""
    parts = getattr(model, "parts", None)
    return block if parts is None else closed_loop(parts.controller, block, parts.dt)


def with_values(model, values: Mapping[str, float] | None):
    """Return a model with these values; a static level below the kinetic one is raised to it."""
    if not values:
        return model
    block = block_of(model)
    return with_block(model, block.with_parameters(feasible(block, values)))


def is_own(parameter: Parameter) -> bool:
    """Whether every record has a parameter for itself."""
    return parameter.per_record or isinstance(parameter.value, PerRecord)


def in_record(value: float, record: str) -> float:
    """Return what a value is in the record of that name."""
    return value.of(record) if isinstance(value, PerRecord) else float(value)


def knows(value: float, record: str) -> bool:
    """Whether a value tells what it is in the record of that name alone."""
    return isinstance(value, PerRecord) and value.knows(record)


def warn_of_means(model, records, moved: Iterable[str] = ()):
    """Warn where a model has values by record and a record is none of these; `moved`: names fitted to it."""
    table, moved = getattr(block_of(model), "parameters", {}), set(moved)
    own = {k: p.value for k, p in table.items() if isinstance(p.value, PerRecord) and k not in moved}
    lacking = [(k, r.name) for k, v in own.items() if v.values for r in records if not v.knows(r.name)]
    if lacking:
        taken, without = (" and ".join(dict.fromkeys(words)) for words in zip(*lacking, strict=True))
        warnings.warn(
            f"the model has a value for each record of {taken}, and none for {without}: "
            "the mean over the records fitted is used. Give every record a name of its own (name=), the "
            "same in the fit and here, or take fit.model_of(record).",
            stacklevel=4,
        )


def with_own(model, names: Iterable[str]):
    """Return a model of which every record has these parameters for itself."""
    block = block_of(model)
    given = {k: block.parameters[k].value for k in names}
    own = {k: v if isinstance(v, PerRecord) else PerRecord(v) for k, v in given.items()}
    return with_block(model, block.with_parameters(own)) if own else model


def knowing(model, other, records: Iterable[str], others: Iterable[str]):
    """Return a model fitted to `records` that knows what `others` have for themselves, as `other` has it.

    As a number each value stays what it was, and so does one that all of them have.
    """
    block, found = block_of(model), {}
    table, shared = getattr(block, "parameters", {}), getattr(block_of(other), "parameters", {})
    for k, p in table.items():
        if is_own(p):
            each = {r: in_record(p.value, r) for r in records}
            each |= {r: in_record(shared[k].value, r) for r in others}
            if any(v != float(p.value) for v in each.values()):
                found[k] = PerRecord(p.value, each)
    return with_block(model, block.with_parameters(found)) if found else model


def for_record(model, record: str) -> Any:
    """Return a model with the values that it has in the record of that name."""
    block = block_of(model)
    table = getattr(block, "parameters", {})
    own = {k: p.value.of(record) for k, p in table.items() if isinstance(p.value, PerRecord)}
    return with_block(model, block.with_parameters(_raised(block, own))) if own else model


def feasible(block: Mechanism, values: Mapping[str, float]) -> dict[str, float]:
    """Return the values with static levels raised to the kinetic one where they fell below it.

    What the records have for themselves stays theirs: one number is for all of them.
    """
    table = block.parameters
    kept = {
        k: PerRecord(v) if isinstance(table[k].value, PerRecord) and not isinstance(v, PerRecord) else v
        for k, v in values.items()
    }
    return _raised(block, kept)


def _raised(block: Mechanism, values: dict[str, float]) -> dict[str, float]:
    current = block.parameters
    statics = [name for name, p in current.items() if p.threshold]
    if statics:
        kinetic = kinetic_level(
            [
                e.replace(**{n: values[f"{k}.{n}"] for n in e.parameters if f"{k}.{n}" in values})
                for k, e in block.named_effects.items()
                if is_kinetic(e)
            ]
        )
        for name in statics:
            value = values.get(name, current[name].value)
            if value < kinetic:
                values[name] = PerRecord(kinetic, value.values) if isinstance(value, PerRecord) else kinetic
    return values
