"""Which method describes which block: closed form, quadrature, or the forced periodic orbit."""

from __future__ import annotations

import copy

import control as ct
import numpy as np
from control import descfcn

from ..blocks.elements.element import Element
from ..blocks.elements.hysteresis import play, relay_with_hysteresis
from ..blocks.elements.memoryless import saturation
from ..blocks.massless import Massless
from ..blocks.mechanism import Mechanism
from ..checks import shown
from ..nearest import did_you_mean
from .methods import (
    ElementIntegrals,
    ForcedOrbit,
    FrequencyResponse,
    FrictionClosedForm,
    Guarded,
    ImpactMap,
    ImposedForce,
    Method,
    Quadrature,
    RateLimiterForm,
    Sampled,
)
from .thresholds import NUM_POINTS, SAMPLES, STATIC_PROBES

# python-control's own classes, held at import: someone may put ours in their place.
_SATURATION = descfcn.saturation_nonlinearity
_BACKLASH = descfcn.friction_backlash_nonlinearity
_RELAY = descfcn.relay_hysteresis_nonlinearity


def method_for(F, output=None, try_method=True, num_points=NUM_POINTS, largest=1.0, options=None) -> Method:
    """Choose the method for a block.

    Parameters
    ----------
    F : block, callable, or python-control nonlinearity
    output : str or int, optional
        Output of a block with several; default the first.
    try_method : bool
        Whether a user's own ``describing_function`` method is believed.
    num_points : int
        Least number of calls a period for a callable that keeps its own memory.
    largest : float
        Largest amplitude: the range over which a callable is tried for memory.
    options : dict, optional
        Passed to the general solver of forced periodic orbits.

    Raises
    ------
    TypeError
        F is neither callable nor a block.
    ValueError
        Several inputs, an unknown output.
    """
    F = translated(F)
    options = options or {}
    if isinstance(F, Element):
        _output_name(F, output)
        return RateLimiterForm(F) if F.kind == "rate_limiter" else ElementIntegrals(F)
    if isinstance(F, Massless):
        return ImposedForce(F, _named_output(F, output))
    if isinstance(F, Mechanism):
        return _for_mechanism(F, _output_name(F, output), options)
    if isinstance(F, ct.StateSpace | ct.TransferFunction):
        return FrequencyResponse(F)
    if isinstance(F, ct.NonlinearIOSystem):
        name = _output_name(F, output)
        if F._isstatic():
            own = getattr(F, "describing_function", None) if try_method else None
            law = Guarded(_static_law(F, F.output_labels.index(name)), F.name)
            return Quadrature(law, name, own_method=own)
        return ForcedOrbit(F, name, options=options)
    own = getattr(F, "describing_function", None) if try_method else None
    if own is not None and not _implemented(own, largest):
        own = None
    if not callable(F):
        if own is None:
            raise TypeError(
                f"a describing function needs a block or a callable y = f(u); got {type(F).__name__}. "
                "Wrap a table with ctrl_df.piecewise_linear."
            )
        return Quadrature(F, own_method=own)
    law = Guarded(F, getattr(F, "__name__", type(F).__name__))
    static = own is not None or _is_static(law, largest)
    if static:
        return Quadrature(law, own_method=own)
    return Sampled(law, own_method=own, samples=max(SAMPLES, int(num_points)))


def translated(F):
    """Put the exact element in the place of python-control's own nonlinearities."""
    own = getattr(type(F), "describing_function", None)
    if isinstance(F, _SATURATION) and own is _SATURATION.describing_function:
        return saturation(F.ub, F.lb)
    if isinstance(F, _BACKLASH) and own is _BACKLASH.describing_function:
        return play(F.b)
    if isinstance(F, _RELAY) and own is _RELAY.describing_function and F.c > 0:
        return relay_with_hysteresis(F.b, F.c)
    return F


def _for_mechanism(block, output, options) -> Method:
    order = {label: i for i, label in enumerate(block.output_labels[:2])}.get(output)
    if order is not None:
        for closed in (FrictionClosedForm, ImpactMap):
            if closed.fits(block):
                return closed(block, output, order)
    return ForcedOrbit(block, output, options=options)


def _output_name(system, output) -> str:
    if system.ninputs != 1:
        raise ValueError(
            f"a describing function needs one input; {system.name} has {system.ninputs}. Fix the others "
            f"inside the block."
        )
    return _named_output(system, output)


def _named_output(system, output) -> str:
    labels = list(system.output_labels)
    if output is None:
        return labels[0]
    if isinstance(output, int | np.integer) and 0 <= output < len(labels):
        return labels[int(output)]
    if output in labels:
        return str(output)
    raise ValueError(
        f"a describing function needs output out of {', '.join(labels)}, or a number from 0 to "
        f"{len(labels) - 1}; got {shown(output)}.{did_you_mean(output, labels, 'Give one of these.')}"
    )


def _static_law(system, index):
    """Return the law of a static ``ct.NonlinearIOSystem``, for one number or many."""
    if isinstance(system, ct.InterconnectedSystem) or system.outfcn is None:
        return lambda u: np.asarray(system(u)).reshape(-1)[index]

    def law(u):
        inputs = np.atleast_1d(u) if np.ndim(u) == 0 else np.asarray(u)[None, :]
        y = np.asarray(system.outfcn(0.0, np.zeros(0), inputs, system.params), dtype=float)
        return y.reshape(system.noutputs, *np.shape(u))[index]

    return law


def _implemented(own, largest) -> bool:
    try:
        own(largest)
    except NotImplementedError:
        return False
    return True


def _is_static(F, largest) -> bool:
    """Whether a callable gives the same values on the way up and on the way down."""
    isstatic = getattr(F.law, "_isstatic", None)
    if isstatic is not None and isstatic():
        return True
    try:
        F = copy.deepcopy(F)  # do not disturb a memory that is the user's
    except Exception:  # whatever cannot be copied is tried as it is
        pass
    up = largest * np.linspace(-1, 1, STATIC_PROBES)
    for u in up[STATIC_PROBES // 2 :]:
        F(float(u))
    down = [np.squeeze(F(float(u))) for u in up[::-1]]
    again = [np.squeeze(F(float(u))) for u in up]
    return bool(
        np.array_equal(np.array(down[::-1], dtype=float), np.array(again, dtype=float), equal_nan=True)
    )
