"""The same machine and the same record in other units."""

from __future__ import annotations

import ctrl_df as cdf
from ctrl_df.units import size


def sizes(force, length, time=1.0):
    """Return the factors of dimensions where forces, lengths and times have so many times the number.

    Currents stay as they are: what a voltage does in a second is as much work.
    """
    mass, voltage = force * time**2 / length, force * length / time
    return {"N": force, "m": length, "kg": mass, "s": time, "V": voltage, "A": 1.0}


def block(model, *scale):
    """Return a mechanism in units in which forces, lengths and times have other numbers."""
    values = {k: p.value * size(p.unit, sizes(*scale)) for k, p in model.parameters.items()}
    inertias = {k: v for k, v in values.items() if "." not in k}
    effects = []
    for key, effect in model.named_effects.items():
        own = {n: p.value * size(p.unit, sizes(*scale)) for n, p in effect.parameters.items()}
        effects.append(effect.replace(**own))
        assert key
    return type(model)(**inertias, effects=effects)


def record(data, force, length, time=1.0):
    """Return a record likewise."""
    own = sizes(force, length, time)
    given, seen = (size(unit, own) for unit in (data.input_unit, data.output_unit))
    velocity = None if data.velocity is None else data.velocity * length / time
    return cdf.Measurement(
        data.t * time, data.u * given, data.y * seen, name=data.name, velocity=velocity,
        input_unit=data.input_unit, output_unit=data.output_unit, input_hold=data.input_hold,
    )  # fmt: skip


def frequency(data, force, length, time=1.0):
    """Return a table of describing functions likewise."""
    return cdf.FrequencyMeasurement(data.A * force, data.omega / time, data.N * length / force)


def back(candidate, *scale):
    """Return the parameters of a candidate's effect in the units it was scaled from."""
    table = candidate.effect.parameters
    return {k: v / size(table[k].unit, sizes(*scale)) for k, v in candidate.parameters.items()}
