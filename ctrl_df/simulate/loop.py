"""Closed loops: a controller around one block, the ideal PID included."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import control as ct
import numpy as np

from ..blocks.elements.element import Element
from ..blocks.immutable import FixedParameters
from ..blocks.mechanism import Mechanism
from ..blocks.ordinary.linearization import warn_of_mechanism
from ..blocks.primitives import RateLimiter
from ..checks import is_number, number, returned, shown, system_name
from ..nearest import did_you_mean
from .sampled import Sampled


@dataclass(frozen=True)
class LoopParts:
    """What a loop of `closed_loop` was made of; kept on the loop as ``loop.parts``."""

    controller: Any
    block: ct.NonlinearIOSystem
    dt: float


class ClosedLoop(ct.InterconnectedSystem):
    """A loop of `closed_loop`; its linearization warns where its mechanism has none."""

    parts: LoopParts

    def linearize(self, x0, u0=None, t=0, params=None, eps=1e-6, copy_names=False, **kwargs):
        """Linearize the compliant form; see `ct.linearize`."""
        block, before = self.syslist[1], self.syslist[0].nstates or 0
        if isinstance(block, Mechanism):
            x = np.atleast_1d(np.asarray(getattr(x0, "states", x0), dtype=float)).ravel()
            x = x[before:] if x.size > 1 else x
            warn_of_mechanism(block.core, block.effects, x, self.parts.block.name)
        return super().linearize(x0, u0, t, params, eps, copy_names, **kwargs)


def closed_loop(pid, block, dt: float | None = 0, *, output=None, name=None) -> ct.InterconnectedSystem:
    """Close a loop: ``F = pid (r - x)`` drives the block, x is its first output.

    Parameters
    ----------
    pid : ct.TransferFunction or ct.StateSpace
        The controller. One degree of the numerator above the denominator (the ideal PID) is allowed where the
        block has a velocity output ``v``: the derivative then acts on ``-v``, not on the reference.
    block : ct.NonlinearIOSystem
        The plant: one input; a mechanism, a memoryless element, or a block of the user's own.
    dt : float
        Sample time of a digital controller with zero-order hold [s]; 0: continuous. The continuous `pid` is
        then run as ``kp e + I - kd v`` with I summed by the backward rule (any other proper controller:
        Tustin's rule). A discrete `pid` brings its own dt. One with a direct path (D != 0) reads the plant
        just before its tick and the reference as it is from then on; one without puts out ``u[k] = C x[k]``
        first and reads what a plant without time answers to it, so that the loop is the recursion u = H e,
        y = f(u).
    output : str or int
        The output that is fed back, the first by default.
    name : str
        Name of the loop.

    Returns
    -------
    ct.InterconnectedSystem
        Input ``r``; outputs the block's output (``x``) and the block's input (``F``).

    Raises
    ------
    ValueError
        MIMO controller, improper controller without a velocity to act on, sample times that differ, algebraic
        loop.

    Examples
    --------
    >>> loop = cdf.closed_loop(cdf.pid(2000, 0, 130), cdf.friction_mass(mass=9, coulomb=5))
    >>> loop.input_labels, loop.output_labels
    (['r'], ['x', 'F'])
    """
    system_name("closed_loop", name)
    block = _as_block(block)
    controller = _as_lti(pid)
    dt = 0.0 if dt is None else number(
        "closed_loop", "dt", dt, "s", lower=0.0, meaning="sample time of the controller",
        remedy="Use dt=0 for a continuous controller.",
    )  # fmt: skip
    if controller.isdtime(strict=True):
        own = float(controller.dt)
        if dt != 0 and not np.isclose(own, dt):
            raise ValueError(
                f"closed_loop got dt={dt} for a controller with dt={own}; leave dt out, or make them equal."
            )
        dt = own
    fed_back = block.output_labels[0] if output is None else _label(block, output)
    force = block.input_labels[0]
    kd, proper = split_improper(controller)
    rate = block.output_labels[1] if isinstance(block, Mechanism) else "v"
    if kd != 0 and rate not in block.output_labels:
        raise ValueError(
            "an improper controller needs a block with a velocity output v for its derivative; "
            f"{block.name} has {', '.join(block.output_labels)}. Filter the derivative: pid(..., tf=...)."
        )
    if controller.isdtime(strict=True) and has_direct_feedthrough(block) and np.any(np.asarray(proper.D)):
        raise ValueError(
            f"{block.name} and the discrete controller answer each other within one sample (an algebraic "
            "loop, D != 0), so the loop has no order of steps; give the controller one sample of delay."
        )
    control = _controller(proper, kd, dt, force, name="controller")
    plant = block.with_name("plant") if isinstance(block, Mechanism) else block.copy(name="plant")
    connections = [["controller.e", f"-plant.{fed_back}"], [f"plant.{force}", f"controller.{force}"]]
    if kd != 0:
        connections.append(["controller.v", f"plant.{rate}"])
    loop = ct.interconnect(
        [control, plant],
        connections=connections,
        inplist=["controller.e"],
        inputs=["r"],
        outlist=[f"plant.{fed_back}", f"controller.{force}"],
        outputs=[fed_back, force],
        name=name,
        warn_duplicate=False,
        check_unused=False,
    )
    loop.__class__ = ClosedLoop  # python-control's interconnect makes no other
    loop.parts = LoopParts(pid, block, float(dt or 0))
    loop.params = FixedParameters(loop.params)  # the exact simulation has the block's own
    return loop


def has_direct_feedthrough(block) -> bool:
    """Whether a block is a law without time: its output follows a jump of its input."""
    if isinstance(block, Element):
        return not isinstance(block.primitive, RateLimiter)
    return not block.nstates


def split_improper(controller) -> tuple[float, ct.StateSpace]:
    """Split ``H = kd s + proper``; returns (kd, proper as state space). ValueError beyond one derivative."""
    if isinstance(controller, ct.StateSpace):
        return 0.0, controller
    num, den = (np.trim_zeros(np.asarray(p[0][0], float), "f") for p in (controller.num, controller.den))
    if len(num) <= len(den):
        return 0.0, _realized(num, den, controller.dt)
    if len(num) > len(den) + 1 or controller.isdtime(strict=True):
        raise ValueError(
            "a controller may exceed its denominator by one degree (an ideal derivative) in continuous time; "
            f"got numerator degree {len(num) - 1} over {len(den) - 1}. Filter it: pid(..., tf=...)."
        )
    quotient, rest = np.polydiv(num, den)
    kd, kp = quotient[0], quotient[1] if len(quotient) > 1 else 0.0
    rest = np.atleast_1d(rest)
    return float(kd), _realized(np.polyadd(kp * den, rest), den, 0)


def _realized(num, den, dt) -> ct.StateSpace:
    """Return a proper transfer function in controllable canonical form.

    That of SciPy takes small coefficients for zero, which in other units are none.
    """
    order = len(den) - 1
    a = den / den[0]
    b = np.concatenate([np.zeros(order + 1 - len(num)), num]) / den[0]
    A = np.vstack([-a[1:], np.eye(order)[:-1]]) if order else np.zeros((0, 0))
    B = np.eye(order)[:, :1] if order else np.zeros((0, 1))
    C = (b[1:] - a[1:] * b[0])[None, :]
    return ct.ss(A, B, C, [[b[0]]], dt)  # pyright: ignore[reportReturnType]


def _controller(proper: ct.StateSpace, kd: float, dt, force: str, name: str):
    a, b, c, d = (np.asarray(m, float) for m in (proper.A, proper.B, proper.C, proper.D))
    inputs = ["e", "v"] if kd != 0 else ["e"]
    if dt in (0, None):
        if kd != 0:
            b, d = np.hstack([b, 0 * b]), np.hstack([d, [[-kd]]])
        return ct.ss(a, b, c, d, inputs=inputs, outputs=[force], name=name)
    if not proper.isdtime(strict=True):
        a, b, c, d = _discretized(a, b, c, d, float(dt))
    if kd != 0:
        b, d = np.hstack([b, 0 * b]), np.hstack([d, [[-kd]]])
    return Sampled(a, b, c, d, dt, inputs=inputs, outputs=[force], name=name)


def _discretized(a, b, c, d, dt):
    if a.shape == (1, 1) and a[0, 0] == 0:
        # the integral of a PID, summed by the backward rule: I[k] = I[k-1] + dt e[k]
        return np.eye(1), b * dt, c, d + c @ b * dt
    ss = ct.c2d(ct.ss(a, b, c, d), dt, method="bilinear")
    return tuple(np.asarray(m, float) for m in (ss.A, ss.B, ss.C, ss.D))


def _as_block(block: Any) -> ct.NonlinearIOSystem:
    if not isinstance(block, ct.NonlinearIOSystem):
        if callable(block):
            static: Any = block
            return ct.NonlinearIOSystem(
                None, lambda t, x, u, params: np.array([_one_number(static(u[0]), u[0])]),
                inputs=["u"], outputs=["y"], name="nonlinearity",
            )  # fmt: skip
        raise TypeError(
            f"closed_loop needs a block (ct.NonlinearIOSystem) or a static function; got {block!r}."
        )
    if block.ninputs != 1:
        raise ValueError(f"closed_loop needs a block with one input; {block.name} has {block.ninputs}.")
    return block


def _one_number(y, u) -> float:
    value = np.squeeze(y) if isinstance(y, np.ndarray) else y
    if not returned(value):
        raise TypeError(f"a static law must return one real number; got {shown(y)} at u = {u:g}.")
    return float(value)


def _as_lti(pid) -> Any:
    if isinstance(pid, ct.FrequencyResponseData):
        raise ValueError(
            "closed_loop cannot run measured frequency points (FRD) in time; fit a transfer function first."
        )
    if is_number(pid):
        pid = ct.tf([number("closed_loop", "pid", pid)], [1.0])
    if not isinstance(pid, ct.TransferFunction | ct.StateSpace):
        raise TypeError(
            f"closed_loop needs a TransferFunction or StateSpace controller; got {type(pid).__name__}. The "
            "nonlinear block comes second."
        )
    if not pid.issiso():
        raise ValueError(
            f"closed_loop needs a SISO controller; got {pid.ninputs} inputs and {pid.noutputs} outputs. "
            "Select one channel, pid[i, j]."
        )
    parts = (pid.num[0][0], pid.den[0][0]) if isinstance(pid, ct.TransferFunction) else _matrices(pid)
    for part in parts:
        if not np.isfinite(part).all() or np.iscomplexobj(part):
            raise ValueError(
                f"closed_loop needs a controller with real, finite coefficients; got {shown(part)}. "
                "Correct the model."
            )
    return pid


def _matrices(system):
    return system.A, system.B, system.C, system.D


def _label(block, output) -> str:
    labels = list(block.output_labels)
    if isinstance(output, str) and output in labels:
        return output
    if isinstance(output, int | np.integer) and not isinstance(output, bool) and 0 <= output < len(labels):
        return labels[int(output)]
    named = isinstance(output, str) or (is_number(output) and not isinstance(output, float))
    raise (ValueError if named else TypeError)(
        f"closed_loop needs output out of {', '.join(labels)}, or a number from 0 to {len(labels) - 1}; got "
        f"{shown(output)}.{did_you_mean(output, labels, 'Give one of these.')}"
    )
