"""Systems that differ in their parameters, grouped by the program that runs them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from ..values.column import Column, Differs
from .engine import Engine
from .thresholds import SPLITS


@dataclass(frozen=True)
class Group:
    """Runs whose systems are one program with different numbers.

    Attributes
    ----------
    engine : Engine
        Of one of them; the others share its nodes and integers.
    par : (k, npar) array
        Packed parameters.
    runs : (m,) int array
        Which runs these are.
    row : (m,) int array
        The row of `par` that each of them takes.
    """

    engine: Engine
    par: np.ndarray
    runs: np.ndarray
    row: np.ndarray


def grouped(parts: Iterable[tuple[Engine, np.ndarray]]) -> list[Group]:
    """Group engines by program.

    Parameters
    ----------
    parts : iterable of (Engine, (m,) int array)
        An engine, and the runs that it is for: all the same system (``engine.par`` has one row), or one
        system each (as many rows as runs).

    Returns
    -------
    list of Group
        In the order in which the programs are met. Engines that call Python back stay apart, each with the
        functions it calls.
    """
    found: dict[tuple[bytes, ...], list[tuple[Engine, np.ndarray]]] = {}
    for engine, runs in parts:
        found.setdefault(engine.kind, []).append((engine, runs))
    groups = []
    for members in found.values():
        tables, rows, at = [], [], 0
        for engine, runs in members:
            tables.append(engine.par)
            rows.append(at + (np.arange(len(runs)) if len(engine.par) > 1 else np.zeros(len(runs), int)))
            at += len(engine.par)
        runs = np.concatenate([r for _, r in members])
        groups.append(Group(members[0][0], np.concatenate(tables), runs, np.concatenate(rows)))
    return groups


def assigned(groups: Iterable[Group], system) -> list[Group]:
    """Let each run take one of the systems that are grouped: segments of a record, each with many parameters.

    Parameters
    ----------
    groups : iterable of Group
        Of k systems, in the place of runs.
    system : (runs,) int array
        The system of each run, 0 to k - 1.
    """
    system, found = np.asarray(system), []
    for group in groups:
        row = np.full(max(int(system.max(initial=-1)), int(group.runs.max(initial=-1))) + 1, -1)
        row[group.runs] = group.row
        runs = np.flatnonzero(row[system] >= 0)
        if runs.size:
            found.append(Group(group.engine, group.par, runs, row[system[runs]]))
    return found


def groups_of(owner: str, system, values: Mapping[str, np.ndarray], runs: int) -> list[Group]:
    """Pack a system for many runs whose parameters differ.

    All runs are packed at once, numbers as columns (`ctrl_df.values.column`); where a condition has two
    answers among them (a delay of zero or not), they are packed in two parts. The first and the last
    system of every part is packed by itself as well and has to agree to the last bit; where it does not, or
    where the code of a block takes no columns, every run is packed by itself.

    Parameters
    ----------
    owner : str
        Who asks, for errors.
    system : block, LTI system or interconnection
    values : mapping
        Parameters by name, from `checked_parameters`: one number, or (runs,).
    runs : int

    Raises
    ------
    ValueError, TypeError
        Parameters that contradict each other, with the number of the first such run.
    """
    return grouped(_parts(owner, system, values, runs))


def _parts(owner, system, values, runs):
    waiting, splits = [np.arange(runs)], 0
    while waiting:
        rows = waiting.pop()
        try:
            engine = Engine(system, {name: _column(v, rows) for name, v in values.items()})
            agreed = all(
                np.array_equal(engine.par[i], _alone(system, values, rows[i]).program.par, equal_nan=True)
                for i in (0, -1)
                if len(engine.par) > 1
            )
        except Differs as question:
            splits += 1
            if splits <= SPLITS:
                waiting += [rows[~question.mask], rows[question.mask]]
                continue
            agreed = False
        except Exception:  # no code for columns, or a contradiction: told run by run
            agreed = False
        if agreed:
            yield engine, rows  # pyright: ignore[reportPossiblyUnboundVariable]
            continue
        for row in rows:
            try:
                engine = _alone(system, values, row)
            except (TypeError, ValueError) as error:
                if not values:
                    raise
                raise type(error)(f"{owner}, run {row}: {error}") from error
            yield engine, np.array([row])


def _alone(system, values, row) -> Engine:
    return Engine(system, {name: float(v[row] if v.size > 1 else v.flat[0]) for name, v in values.items()})


def _column(values, rows):
    mine = values[rows] if values.size > 1 else values
    return float(mine.flat[0]) if np.all(mine == mine.flat[0]) else Column(mine)
