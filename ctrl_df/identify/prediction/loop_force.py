"""Records of a loop's reference: the force that its controller makes of it and of the measured output."""

from __future__ import annotations

import warnings

import numpy as np

from ...blocks.mechanism import Mechanism
from ...simulate.response import event_response
from ..data.measurement import Measurement
from ..data.quantities import quantity_of
from .prepared import REFERENCE, recorded_reference
from .segments import facts
from .thresholds import FOLLOWED_AS_REFERENCE, HARDLY_FOLLOWED, POINTS_OF_A_SAMPLE


def driven_by_force(model, record: Measurement) -> Measurement:
    """Return a record with the force on the block as its input, and the reference of a loop as a channel.

    The controller of a loop is known: its force follows from the reference and the measured output, from rest
    at the first sample on. Of each sample the mean is taken; a sampled controller in step with the record is
    met exactly, another one to second order in the interval. The record's `note` says so. A record that has
    the force already is returned as it is, and so is any for a block.

    Raises
    ------
    ValueError
        An input that is said to be a force, and whose values the output follows as it would a reference; a
        reference of what was not measured.
    """
    parts = getattr(model, "parts", None)
    if parts is None or recorded_reference(record) is not None:
        return record
    if quantity_of(record.input_unit) not in ("position", "velocity"):
        _check_force(record)
        return record
    moves = parts.block.coordinates
    note = moves.text("the force worked out from reference and output, by the loop's controller")
    return record.noted(
        note, u=controller_force(model, record), input_unit=moves.force_unit,
        input_hold="zoh", channels={**(record.channels or {}), REFERENCE[0]: record.u},
    )  # fmt: skip


def controller_force(loop, record: Measurement) -> np.ndarray:
    """Return the mean force of a loop's controller over each sample of a record of its reference, (n,)."""
    controller, fed_back = loop.syslist[0], quantity_of(record.input_unit)
    measured = (record.outputs or {}).get(fed_back)
    if measured is None:
        moves = loop.parts.block.coordinates
        raise ValueError(
            f"the reference of {record.name!r} "
            + moves.text(
                f"is a {fed_back}, which was not measured: the force of the controller does not follow from "
                "it. Record that force as the input, the reference as the channel 'reference'."
            )
        )
    known, dt = facts(record), record.dt
    some = np.arange(POINTS_OF_A_SAMPLE * len(record)) / POINTS_OF_A_SAMPLE
    t = dt * some
    held = record.u[some.astype(int)]
    reference = held if record.input_hold == "zoh" else np.interp(some, np.arange(len(record)), record.u)
    place, speed = (np.interp(some, np.arange(len(record)), x) for x in (measured, known.velocity))
    asked = np.zeros((controller.ninputs, len(t)))
    answered = asked.copy()
    asked[0], answered[0], answered[1:] = reference, -place, speed
    runs = [
        np.ravel(event_response(controller, t, u, input_hold=hold, keep_events=False).outputs)
        for u, hold in ((asked, record.input_hold), (answered, "linear"))
    ]
    force = np.sum(runs, axis=0)
    return force.reshape(len(record), -1)[:, 1::2].mean(axis=1)


def warn_of_references(model, records) -> None:
    """Warn where a loop hardly follows what is taken for its reference, and that is not said to be one."""
    block = getattr(getattr(model, "parts", None), "block", None)
    if not isinstance(block, Mechanism):
        return
    for record in records:
        said = quantity_of(record.input_unit) in ("position", "velocity")
        if said or recorded_reference(record) is not None or quantity_of(record.output_unit) != "position":
            continue
        if np.std(record.u - record.y) > HARDLY_FOLLOWED * np.std(record.y):
            place = block.coordinates.unit
            warnings.warn(
                f"the input of {record.name!r} is taken for the reference of the loop, in {place}, and the "
                f"output hardly follows it (rms {np.std(record.y):.3g} of {np.std(record.u):.3g}). If it is "
                f"a {block.coordinates.force} [{record.input_unit}], compare or refit the block alone, "
                f"loop.parts.block; if it is the reference, state input_unit={place!r}.",
                stacklevel=5,
            )


def _check_force(record: Measurement) -> None:
    y = record.y
    if np.std(record.u - y) < FOLLOWED_AS_REFERENCE * np.std(y):
        raise ValueError(
            f"the input of {record.name!r} is in {record.input_unit}, but the output follows its values as a "
            f"loop follows its reference. State input_unit={record.output_unit!r} for a reference; for a "
            "force also give the reference, as the channel 'reference'."
        )
