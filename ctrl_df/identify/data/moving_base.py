"""Records of a base that moves and of the mass on it: the same, as it is seen from the base.

There the mass is at rest but for the force of inertia: ``m z'' + f(z, z') = -m a``, z its motion relative to
the base and a the acceleration of the base. All else is as for a force that is applied.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.linalg import solve_banded

from ...blocks.mechanism import Mechanism
from ...blocks.primitives import Ramp
from ...checks import shown
from ...units import dimension
from . import signals
from .measurement import Measurement
from .quantities import quantity_of
from .thresholds import LOW_PASS_ENDS

_DERIVATIVES = ("position", "velocity", "acceleration")  # each of the one before


def moves_base(model, record) -> bool:
    """Return whether a record holds the motion of a base as input and that of the mass on it as output."""
    outputs = getattr(record, "units", None)
    if not isinstance(model, Mechanism) or not outputs:
        return False
    return quantity_of(record.input_unit) in _DERIVATIVES and all(q in _DERIVATIVES for q in outputs)


def measured_in_space(record: Measurement) -> bool:
    """Return whether a record of a base that moves has its outputs in space, not relative to the base."""
    return quantity_of(record.input_unit) != "acceleration"


def seen_from_base(model, record: Measurement) -> Measurement:
    """Return a record with the force of inertia as input, and outputs relative to the base.

    The force is that on the mass of the model as it is: a record of motion tells forces per mass only.

    Raises
    ------
    ValueError
        A model of two bodies or without a mass, or with effects on the way of a force (of a sensor in space
        but for its offset), units of another kind of motion than the model's, an output
        that the motion of the base does not tell.
    """
    mass, moves = _inertia(model), model.coordinates
    _check_channels(model, measured_in_space(record))
    given = _DERIVATIVES.index(quantity_of(record.input_unit))
    turns = dimension(record.input_unit).get("rad", 0) == 1
    if turns != (moves.unit == "rad"):
        raise ValueError(
            f"this model moves in {moves.unit}; the base of {record.name!r} moves in {record.input_unit}. "
            "Take Inertia for a base that turns, Mass for one that does not, or state input_unit=."
        )
    cutoff = signals.automatic_cutoff(*_regular(record.t, record.u)) if given < 2 else 0.0
    path = None
    if cutoff:
        # of the fifth degree: central differences would err by (w dt)^2 / 6
        path = make_interp_spline(record.t, signals.derivative(record.t, record.u, 0, cutoff), k=5)

    def base(order) -> np.ndarray:
        """Return the motion of the base: its position (0), velocity (1) or acceleration (2)."""
        return record.u if path is None or order == given else path.derivative(order - given)(record.t)

    pushed = _nearest_line(record.t, base(2))
    outputs = {q: _relative(record, q, given, y, base) for q, y in record.outputs.items()}  # type: ignore[union-attr]
    velocity = record.velocity
    if velocity is not None and given < 2:
        velocity = velocity - base(1)
    how = f", its motion low-passed at {cutoff:.3g} Hz" if given < 2 else ""
    seen = record.noted(
        f"seen from its base{how}", u=-mass * pushed, input="force", input_unit=moves.force_unit,
        input_hold="linear", outputs=outputs, velocity=velocity,
    )  # fmt: skip
    # low-passed, the motion is not known at the very ends
    ends = LOW_PASS_ENDS / cutoff if cutoff else 0.0
    return seen.slice(record.t[0] + ends, record.t[-1] - ends)


def _inertia(model) -> float:
    if len(model.core.masses) != 1 or not model.core.masses[0] > 0:
        raise ValueError(
            f"on a base that moves a model needs one body with a mass; got {shown(model)}. Give a Mass or an "
            "Inertia without backlash and compliance, or record the force."
        )
    return model.core.masses[0]


def _check_channels(model, in_space: bool) -> None:
    for effect in model.effects:
        moved = effect.role == "output" and not all(isinstance(p, Ramp) for p in effect.channel())
        if effect.role == "input" or (moved and in_space):
            what = "a force, and here none is applied" if effect.role == "input" else (
                "the place in space, and the record is taken as seen from the base"
            )  # fmt: skip
            raise ValueError(
                f"on a base that moves a model needs effects between base and mass; got {effect.id}, which "
                f"acts on {what}. Leave it out."
            )


def _relative(record, quantity, given, y, base) -> np.ndarray:
    order = _DERIVATIVES.index(quantity)
    if given == 2:
        return y  # an accelerometer knows no place: the other sensor sits on the base
    if order < given:
        raise ValueError(
            f"the {_DERIVATIVES[given]} of a base does not tell its {quantity}, nor the {quantity} of "
            f"{record.name!r} relative to it. Record the {quantity} of the base, or its acceleration and the "
            f"{quantity} relative to it."
        )
    return y - base(order)


def _nearest_line(t, a) -> np.ndarray:
    """Return the knots of the broken line through times t (n,) that is nearest to a smooth signal a (n,).

    What lies straight between the samples themselves falls short of a sine by (w dt)^2/12 of it. The line
    that is nearest to the cubic spline, by least squares, moves a mass through the same places as the spline
    does: both have the same integral over every hat of two neighbouring intervals.
    """
    place = CubicSpline(t, a).antiderivative(2)
    h, x = np.diff(t), place(t)
    ends = place(t[[0, -1]], 1)
    hats = np.diff(np.concatenate((ends[:1], np.diff(x) / h, ends[1:])))
    bands = np.zeros((3, len(t)))
    bands[0, 1:] = bands[2, :-1] = h * (1 / 6)
    bands[1, :-1] += h * (1 / 3)
    bands[1, 1:] += h * (1 / 3)
    return solve_banded((1, 1), bands, hats)


def _regular(t, u):
    dt, _, values = signals.uniform(t, u)
    return values, dt
