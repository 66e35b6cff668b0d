"""Parameters of a system by name: those of a block, or of the blocks in an interconnection."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import control as ct
import numpy as np

from ...blocks.parameter import Parameter
from ...checks import above, known_name, mapping, number, real_array
from ...values.column import Column


def own_parameters(system) -> dict[str, Parameter | None]:
    """Return the parameters that a system and the blocks inside it have; None where no bounds are stated.

    A name that several blocks have in common is there once.
    """
    if isinstance(system, ct.InterconnectedSystem):
        found: dict[str, Parameter | None] = {}
        for part in system.syslist:
            found |= own_parameters(part)
        return found
    stated = getattr(system, "parameters", None)
    if isinstance(stated, Mapping):
        return dict(stated)
    return dict.fromkeys(system.params) if isinstance(system, ct.NonlinearIOSystem) else {}


def with_values(system, values: Mapping[str, Any]):
    """Return a block with some of its parameters changed (a user's own system: with these as well)."""
    if not values:
        return system
    if hasattr(system, "with_parameters"):
        return system.with_parameters(values)
    if any(isinstance(v, Column) for v in values.values()):
        raise TypeError("a system called back in Python takes one number a parameter.")
    return ct.NonlinearIOSystem(
        system.updfcn, system.outfcn, inputs=system.input_labels, outputs=system.output_labels,
        states=system.state_labels, params={**system.params, **values}, name=system.name,
    )  # fmt: skip


def checked_parameters(owner: str, system, params) -> dict[str, np.ndarray]:
    """Return the values asked for, by name, as arrays: of no dimension, or one number for each run.

    Raises
    ------
    TypeError
        No mapping, something else than real numbers.
    ValueError
        A name that no block has or that several have, NaN, a value out of its bounds, two dimensions or more.
    """
    values = {}
    known = own_parameters(system)
    open_ended = _takes_any(system)
    for name, given in ({} if params is None else mapping(owner, "params", params)).items():
        if not open_ended:
            known_name(owner, "names of params", name, known)
        several = _blocks_with(system, name)
        if len(several) > 1:
            raise ValueError(
                f"{owner} needs names of params that one block has; {name!r} is known to "
                f"{' and '.join(several)}. Change the blocks with with_parameters, then interconnect."
            )
        array = real_array(owner, f"params[{name!r}]", given)
        if array.ndim > 1:
            raise ValueError(
                f"{owner} needs params[{name!r}] as one number, or one for each run; got shape "
                f"{array.shape}. Give one dimension."
            )
        spec = known.get(name)
        if spec is not None:
            _require_bounds(owner, name, array, spec)
        values[name] = array
    return values


def _require_bounds(owner, name, array, spec):
    enough = above(array, spec.lower, spec.strict)
    wrong = np.flatnonzero(~(enough & (array <= spec.upper)))
    if wrong.size:
        where = f" of run {wrong[0]}" if array.ndim else ""
        number(
            f"{owner}, params{where},", name, float(array.flat[wrong[0]]), spec.unit, lower=spec.lower,
            upper=spec.upper, strict=spec.strict, meaning=spec.meaning,
        )  # fmt: skip


def _blocks_with(system, name) -> list[str]:
    """Return the names of the blocks that have a parameter of this name."""
    if isinstance(system, ct.InterconnectedSystem):
        return [found for part in system.syslist for found in _blocks_with(part, name)]
    return [str(system.name)] if name in own_parameters(system) else []


def _takes_any(system) -> bool:
    """Whether a system is a user's own function, which may read parameters that it does not declare."""
    plain = isinstance(system, ct.NonlinearIOSystem) and not isinstance(system, ct.InterconnectedSystem)
    return plain and not hasattr(system, "with_parameters") and not isinstance(system, ct.StateSpace)
