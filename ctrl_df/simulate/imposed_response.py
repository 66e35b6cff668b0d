"""The public call: the force along a motion that is imposed on a block."""

from __future__ import annotations

from collections.abc import Mapping

import control as ct
import numpy as np

from ..blocks.massless import Massless, without_answer
from ..blocks.mechanism import Mechanism
from ..checks import shown
from .imposed import imposed_forces, path_of


def imposed_response(
    block: Mechanism,
    timepts,
    position,
    velocity=None,
    initial_state=0.0,
    params: Mapping[str, float] | None = None,
) -> ct.TimeResponseData:
    """Return the force that imposes a motion on a block: what a load cell on a test machine shows.

    ``F = inertia * acceleration - effects``, exact as far as the motion between the samples is known: a cubic
    spline through the positions, or Hermite's cubic through positions and velocities where these are given;
    reversals between samples are located, states that effects hide (bristles, hysteresis) integrated.
    Where the motion stands still (three equal positions or more) dry friction keeps the direction of the last
    motion.

    Parameters
    ----------
    block : Massless, Mass or Inertia
    timepts : (n,) array
        [s], rising, 4 at least.
    position : (n,) array
        [m] or [rad].
    velocity : (n,) array or None
        [m/s] or [rad/s].
    initial_state : float or array
        Of the hidden states at the first time.
    params : mapping or None
        Values of parameters other than the block's.

    Returns
    -------
    control.TimeResponseData
        Output ``F`` [N] (``torque``), inputs position and velocity, the hidden states.

    Raises
    ------
    TypeError, ValueError
        A block of two bodies, an effect that needs a free mass, times that do not rise.

    Examples
    --------
    >>> t = np.linspace(0, 1, 501)
    >>> damper = cdf.Massless().with_effect(cdf.Coulomb(5.0)).with_effect(cdf.LinearSpring(100.0))
    >>> F = np.asarray(cdf.imposed_response(damper, t, 0.1 * np.sin(2 * np.pi * t)).outputs)[0]
    >>> round(float(F[100]), 3), round(float(F[200]), 3)  # before and after the reversal
    (14.511, 0.878)
    """
    core = imposable(block)
    block = block.with_parameters(params) if params else block
    t, x = np.asarray(timepts, float), np.asarray(position, float)
    v = None if velocity is None else np.asarray(velocity, float)
    if t.ndim != 1 or len(t) < 4 or not np.all(np.diff(t) > 0):
        raise ValueError(f"imposed_response needs times that rise, shape (n,), n >= 4; got shape {t.shape}.")
    for name, values in (("position", x), ("velocity", v)):
        if values is not None and (values.shape != t.shape or not np.all(np.isfinite(values))):
            raise ValueError(
                f"imposed_response needs {name} as {len(t)} finite numbers, one a time; "
                f"got shape {values.shape}."
            )
    hidden = core.nstates - 2
    z0 = np.broadcast_to(np.asarray(initial_state, float), (hidden,))
    path = path_of(t, x, v)
    force, _, states = imposed_forces([block.core], path, z0[None], states=True)
    called = block.coordinates.name
    motion = path.nodes[path.samples >= 0, 1:3].T
    return ct.TimeResponseData(
        t, force[0], states[0].T if hidden else None, motion, issiso=False,
        output_labels=[called("F")], input_labels=[called("x"), called("v")],
        state_labels=list(core.state_names[2:]) if hidden else None,
        sysname=block.name, title=f"Force of {block.name} under an imposed motion",
    )  # fmt: skip


def imposable(block):
    """Return the core of a block that motion can be imposed on; TypeError or ValueError for others."""
    if not isinstance(block, Mechanism):
        raise TypeError(
            f"imposed motion needs a block of effects (Massless, Mass, Inertia); got {shown(block)}."
        )
    why = None if isinstance(block, Massless) else without_answer(block.effects)
    why = "one body alone is moved" if block.core.bodies == 2 else why
    if why is not None:
        raise ValueError(
            f"imposed motion needs a block that answers it with a force; got {type(block).__name__}, "
            f"of which {why}. Take a block without that, or record force as input and motion as output."
        )
    return block.core
