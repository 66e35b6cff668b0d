"""What the calls for describing functions may be asked, checked before any work begins."""

from __future__ import annotations

import control as ct
import numpy as np

from ..calls import keywords_of, unknown_keywords
from ..checks import count, real_array


def check_block(F, num_points) -> int:
    """Check what is described beyond what `method_for` asks: linear systems have one input, one output."""
    if isinstance(F, ct.FrequencyResponseData):
        raise TypeError(
            "a describing function needs a block or a law; got measured points (FrequencyResponseData). "
            "They are linear: their N is the response itself."
        )
    if isinstance(F, ct.StateSpace | ct.TransferFunction) and not F.issiso():
        raise ValueError(
            f"a describing function needs one input and one output; got {F.ninputs} inputs and {F.noutputs} "
            "outputs. Select one channel, F[i, j]."
        )
    return count("a describing function", "num_points", num_points, meaning="calls a period")


def amplitudes_of(A) -> np.ndarray:
    """Return amplitudes as an array, >= 0."""
    A = real_array("a describing function", "A", A, remedy="An amplitude is a peak value.")
    if (A < 0).any():
        bad = A[A < 0].flat[0]
        raise ValueError(
            f"cannot evaluate describing function for A < 0; got A={bad:g}. An amplitude is a peak value."
        )
    return A


def frequencies_of(omega) -> np.ndarray:
    """Return frequencies as an array, > 0."""
    omega = real_array("a describing function", "omega", omega, "rad/s")
    if (omega <= 0).any():
        bad = omega[omega <= 0].flat[0]
        raise ValueError(
            f"a describing function needs omega > 0 and finite [rad/s]; got omega={bad}. Remove it."
        )
    return omega


def common_shape(A, omega):
    """Return the shape of amplitudes and frequencies broadcast."""
    if omega is None:
        return A.shape
    try:
        return np.broadcast_shapes(A.shape, omega.shape)
    except ValueError:
        raise ValueError(
            f"A and omega must broadcast; got shapes {A.shape} and {omega.shape}. "
            "For every pair of both use describing_function_family."
        ) from None


def axis_of(name, values, unit) -> np.ndarray:
    """Return the values along one axis of a grid, one at least."""
    values = np.array(np.atleast_1d(values))
    if values.ndim != 1 or values.size == 0:
        raise ValueError(
            f"a family needs {name} as a 1-D array with at least one value [{unit}]; got shape "
            f"{values.shape}. Give the values along one axis of the grid, np.ravel({name})."
        )
    return values


def check_omega(method, omega):
    """Check that frequencies are given where N depends on them."""
    if method.needs_omega and omega is None:
        raise ValueError(
            "a block with dynamics has N(A, omega): give omega [rad/s]. Only memoryless blocks do without it."
        )


def check_options(method, options, function):
    """Check that further keywords of a function are options that the method takes."""
    wrong = {k: v for k, v in options.items() if k not in method.takes_options}
    if wrong:
        unknown_keywords(function.__name__, wrong, (*keywords_of(function), *method.takes_options))
