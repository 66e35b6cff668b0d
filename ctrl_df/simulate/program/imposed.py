"""The laws of a block under an imposed motion as arrays, for many sets of parameters at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...blocks.core import Core
from .nodes import signature_of
from .pointers import address, calls_python

FORCE, FRICTION, ASKING, PRESLIDING, CONTACT = range(5)


@dataclass(frozen=True, eq=False)
class ImposedLaws:
    """One row for every core.

    Attributes
    ----------
    table : (nl, 5) int array
        Kind, address, place of its parameters, place of its states, number of these, of each law.
    par, mass, span : (rows, np), (rows,), (rows, 2) arrays
    asked, presliding : int
    states : int
        Hidden ones.
    calls_python : bool
        Whether a law could not be compiled.
    """

    table: np.ndarray
    par: np.ndarray
    mass: np.ndarray
    span: np.ndarray
    asked: int
    presliding: int
    states: int
    calls_python: bool


def laws_of(cores: Sequence[Core]) -> ImposedLaws:
    """Return the laws of cores that differ in their values alone; each of one body."""
    first, table, at, presliding = cores[0], [], 0, -1
    for kind, effect, state in _laws(first):
        if kind == PRESLIDING:
            presliding = len(table)
        law = address(type(effect).law, signature_of(effect))  # type: ignore[arg-type]
        table.append((kind, law, at, state, effect.states if state >= 0 else 0))
        at += len(effect.values)
    rows = [[v for _, effect, _ in _laws(core) for v in effect.values] for core in cores]
    return ImposedLaws(
        np.array(table, np.int64).reshape(len(table), 5),
        np.array(rows, float).reshape(len(cores), at),
        np.array([core.masses[0] for core in cores], float),
        np.array([core.wall for core in cores], float),
        int(any(effect.asks for effect in first.friction[0])),
        presliding,
        first.nstates - 2,
        any(calls_python(row[1]) for row in table),
    )


def _laws(core: Core):
    """Yield kind, effect and place of its hidden states, of every law; friction in the order of its chain."""
    for term in core.forces:
        yield FORCE, term.effect, term.state - 2
    for effect in core.friction[0]:
        yield (ASKING if effect.asks else FRICTION), effect, 0
    for kind, term in ((PRESLIDING, core.presliding), (CONTACT, core.contact)):
        if term is not None:
            yield kind, term.effect, term.state - 2
