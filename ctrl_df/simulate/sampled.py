"""Digital controllers: difference equations between a sampler and a zero-order hold."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

from ..checks import positive, shown


class Sampled(ct.NonlinearIOSystem):
    """A discrete-time system run at its sample times inside a continuous loop, its output held in between.

    The state is that of the difference equation followed by the held outputs. The event engine runs it
    exactly, every multiple of dt. The plain ``updfcn`` for ordinary ODE solvers replaces sampling and hold by
    their mean delay: the difference equation becomes ``dx/dt = ((A - I) x + B u)/dt`` and the hold a lag of
    dt/2, right well below the Nyquist frequency.

    Parameters
    ----------
    A, B, C, D : array_like
        ``x[k+1] = A x[k] + B u[k]``, ``y[k] = C x[k] + D u[k]``.
    dt : float
        Sample time [s], > 0.
    """

    def __init__(self, A, B, C, D, dt, **keywords):  # noqa: N803 - the field's names
        b, d = np.atleast_2d(np.asarray(B, float)), np.atleast_2d(np.asarray(D, float))
        a = np.asarray(A, float).reshape(b.shape[0], b.shape[0])
        c = np.asarray(C, float).reshape(d.shape[0], a.shape[0])
        dt = positive("a sampled system", "dt", dt, "s", meaning="sample time")
        self.sampled = (a, b, c, d, float(dt))
        n, ny = a.shape[0], d.shape[0]

        def update(t, x, u, params):
            held = x[n:]
            return np.concatenate(
                [((a - np.eye(n)) @ x[:n] + b @ u) / dt, (c @ x[:n] + d @ u - held) * 2 / dt]
            )

        def output(t, x, u, params):
            return x[n:]

        states = [f"d[{i}]" for i in range(n)] + [f"held[{i}]" for i in range(ny)]
        keywords = {"inputs": d.shape[1], "outputs": ny, **keywords}
        super().__init__(update, output, states=states, dt=0, **keywords)


def sampled(system, **keywords) -> Sampled:
    """Return a discrete-time LTI system as a block that runs at its sample times inside a continuous loop.

    Parameters
    ----------
    system : ct.TransferFunction or ct.StateSpace
        Discrete, with a sample time ``dt`` > 0 [s].

    Returns
    -------
    ct.NonlinearIOSystem
        Its output is held between the sample times.

    Raises
    ------
    TypeError
        `system` not a transfer function or state space.
    ValueError
        A continuous system, or one without a sample time (``dt=True``).

    Examples
    --------
    >>> controller = cdf.sampled(ct.tf([1.0, -0.5], [1, 0], 0.01))
    >>> controller.dt == 0 or controller.dt is None  # a block for continuous loops
    True
    """
    if not isinstance(system, ct.TransferFunction | ct.StateSpace) or not system.isdtime(strict=True):
        raise (ValueError if isinstance(system, ct.TransferFunction | ct.StateSpace) else TypeError)(
            f"sampled needs a discrete-time TransferFunction or StateSpace; got {shown(system)}. "
            "Make it discrete with ct.c2d(system, dt)."
        )
    if system.dt is True:
        raise ValueError("sampled needs a sample time in seconds; got dt=True. Give the system its dt.")
    ss: Any = ct.ss(system)
    keywords.setdefault("inputs", system.input_labels)
    keywords.setdefault("outputs", system.output_labels)
    return Sampled(ss.A, ss.B, ss.C, ss.D, float(system.dt), **keywords)  # pyright: ignore[reportArgumentType]
