"""The same machine and the same record in other units."""

from __future__ import annotations

import ctrl_df as cdf
from ctrl_df.units import size


def sizes(force, length):
    """Return the factors of dimensions where forces and lengths have so many times the number.

    Times and currents stay as they are: what a voltage does in a second is as much work.
    """
    return {"N": force, "m": length, "kg": force / length, "s": 1.0, "V": force * length, "A": 1.0}


def block(model, force, length):
    """Return a mechanism in units in which forces and lengths have other numbers."""
    values = {k: p.value * size(p.unit, sizes(force, length)) for k, p in model.parameters.items()}
    inertias = {k: v for k, v in values.items() if "." not in k}
    effects = []
    for key, effect in model.named_effects.items():
        own = {n: p.value * size(p.unit, sizes(force, length)) for n, p in effect.parameters.items()}
        effects.append(effect.replace(**own))
        assert key
    return type(model)(**inertias, effects=effects)


def record(data, force, length):
    """Return a record likewise."""
    given, seen = (size(unit, sizes(force, length)) for unit in (data.input_unit, data.output_unit))
    velocity = None if data.velocity is None else data.velocity * length
    return cdf.Measurement(
        data.t, data.u * given, data.y * seen, name=data.name, velocity=velocity,
        input_unit=data.input_unit, output_unit=data.output_unit, input_hold=data.input_hold,
    )  # fmt: skip


def back(candidate, force, length):
    """Return the parameters of a candidate's effect in the units it was scaled from."""
    table = candidate.effect.parameters
    return {k: v / size(table[k].unit, sizes(force, length)) for k, v in candidate.parameters.items()}
