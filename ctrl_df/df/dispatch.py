"""Which method describes which block: closed form, quadrature, or the forced periodic orbit."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field, replace
from typing import Any

import control as ct
import numpy as np
from control import descfcn

from ..blocks.element import Element
from ..blocks.hysteresis import play, relay_with_hysteresis
from ..blocks.mechanism import Mechanism
from ..blocks.memoryless import saturation
from ..checks import shown
from ..status import Status
from .branch import Branch
from .memoryless import callable_harmonics, element_harmonics, static_regimes, swept_harmonics

# python-control's own classes, held at import: someone may put ours in their place.
_SATURATION = descfcn.saturation_nonlinearity
_BACKLASH = descfcn.friction_backlash_nonlinearity
_RELAY = descfcn.relay_hysteresis_nonlinearity

FRICTION_IDS = (
    {"coulomb", "viscous"},
    {"coulomb", "viscous", "stiction"},
    {"coulomb"},
    {"coulomb", "stiction"},
)


@dataclass(frozen=True)
class Method:
    """How one block is described.

    Attributes
    ----------
    name : str
        ``element``, ``rate``, ``law``, ``memory``, ``linear``, ``friction``, ``backlash`` or ``orbit``.
    subject : object
        The block, or what stands for it.
    output : str
        Name of the output described.
    order : int
        Times the harmonics of the position are to be differentiated (1 for a velocity).
    """

    name: str
    subject: Any
    output: str = "y"
    order: int = 0
    own_method: Any = None
    samples: int = 4096
    options: dict = field(default_factory=dict)

    @property
    def needs_omega(self) -> bool:
        """Whether N depends on frequency."""
        return self.name not in ("element", "law", "memory")

    def harmonics(self, A, omega, orders):
        """Return harmonics (na, nw, orders + 1), regime and residual (na, nw) at positive A and omega."""
        if not self.needs_omega:
            y, regime, residual = self._static(A, orders)
            shape = (A.size, 1 if omega is None else omega.size)
            return (
                np.broadcast_to(y[:, None, :], (*shape, orders + 1)),
                np.broadcast_to(np.array(regime, dtype=str).reshape(-1, 1), shape),
                np.broadcast_to(residual[:, None], shape),
            )
        if self.name == "rate":
            columns = [element_harmonics(self.subject, A, w, orders) for w in omega]
            regime = np.array([c[1] for c in columns], dtype=str).T
            return (
                np.stack([c[0] for c in columns], axis=1),
                regime,
                np.stack([c[2] for c in columns], axis=1),
            )
        if self.name == "linear":
            return _linear(self.subject, A, omega, orders)
        y, regime, residual = self._dynamic(A, omega, orders)
        if self.order:
            y = y * (1j * np.arange(orders + 1) * omega[:, None]) ** self.order
        return y, regime, residual

    def compiled(self) -> bool:
        """Whether all the work is compiled code, fit for threads; what it needs is compiled thereafter."""
        if self.name != "orbit":
            return self.name in ("friction", "backlash")
        from . import orbits

        engine = orbits.solver_for(self.subject, self.output, **self.options).engine
        return not engine.calls_python

    def brief(self) -> Method:
        """Return the method with short averages over irregular motion, for who has no use for them."""
        return replace(self, options={"periods": 8}) if self.name == "backlash" else self

    def branches(self, A, omega, near_A, near_omega) -> list[Branch]:
        """Return known motions besides those that `harmonics` names, each a branch of N of its own.

        A method without such knowledge has none; one that knows more adds its branches here.

        Parameters
        ----------
        A, omega : ndarray
            The box of interest: from the least to the greatest of each.
        near_A, near_omega : ndarray, equally long
            Points at which motions that attract beside each other matter.
        """
        if self.name != "backlash":
            return []
        from .backlash_branches import backlash_branches

        found = backlash_branches(self.subject, A, omega, near_A, near_omega)
        return [b.differentiated(self.order) for b in found] if self.order else found

    def _static(self, A, orders):
        if self.name == "element":
            return element_harmonics(self.subject, A, None, orders)
        if self.own_method is not None:
            return self._by_own_method(A, orders)
        if self.name == "law":
            return callable_harmonics(self.subject, A, orders)
        return swept_harmonics(self.subject, A, orders, self.samples)

    def _by_own_method(self, A, orders):
        """N from the user's ``describing_function``; the other harmonics, if asked, from the law itself."""
        N = np.array([complex(self.own_method(float(a))) for a in A])
        y = np.full((A.size, orders + 1), np.nan + 0j)
        residual = np.zeros(A.size)
        if orders > 1:
            try:
                run = callable_harmonics if self.name == "law" else swept_harmonics
                y, _, residual = run(self.subject, A, orders)
            except NotImplementedError:  # a class with N but no law: its other harmonics stay unknown
                pass
        y[:, 1] = N
        known = static_regimes(y) if not np.isnan(y).any() else ["memoryless"] * A.size
        return y, known, residual

    def _dynamic(self, A, omega, orders):
        block = self.subject
        if self.name == "friction":
            from .friction import FRICTION_REGIMES, friction_family

            levels = {e.id: e.values[0] for e in block.effects}
            y, code, residual = friction_family(
                block.core.masses[0],
                levels.get("coulomb", 0.0),
                levels.get("viscous", 0.0),
                levels.get("stiction"),
                A,
                omega,
                orders,
            )
            return y, named(code, FRICTION_REGIMES), residual
        if self.name == "backlash":
            from . import backlash

            joint = block.effects[0]
            y, code, residual = backlash.backlash_family(
                block.core.masses[1],
                block.core.masses[0],
                joint.gap,
                joint.restitution,
                A,
                omega,
                orders,
                **self.options,
            )
            return y, named(code, backlash.BACKLASH_REGIMES), residual
        from . import orbits

        y, code, residual = orbits.orbit_family(
            block, A, omega, orders=orders, output=self.output, **self.options
        )
        return y, named(code, getattr(orbits, "ORBIT_REGIMES", ())), residual


def method_for(F, output=None, try_method=True, num_points=100, largest=1.0, options=None) -> Method:
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
        return Method("rate" if F.kind == "rate_limiter" else "element", F)
    if isinstance(F, Mechanism):
        return _for_mechanism(F, _output_name(F, output), options)
    if isinstance(F, ct.StateSpace | ct.TransferFunction):
        return Method("linear", F)
    if isinstance(F, ct.NonlinearIOSystem):
        name = _output_name(F, output)
        if F._isstatic():
            own = getattr(F, "describing_function", None) if try_method else None
            law = _Guarded(_static_law(F, F.output_labels.index(name)), F.name)
            return Method("law", law, name, own_method=own)
        return Method("orbit", F, name, options=options)
    own = getattr(F, "describing_function", None) if try_method else None
    if own is not None and not _implemented(own, largest):
        own = None
    if not callable(F):
        if own is None:
            raise TypeError(
                f"a describing function needs a block or a callable y = f(u); got {type(F).__name__}. "
                "Wrap a table with ctrl_df.piecewise_linear."
            )
        return Method("law", F, own_method=own)
    law = _Guarded(F, getattr(F, "__name__", type(F).__name__))
    static = own is not None or _is_static(law, largest)
    return Method("law" if static else "memory", law, own_method=own, samples=max(4096, int(num_points)))


class _Guarded:
    """A user's law whose errors say that they are the law's, and where it was."""

    def __init__(self, law, name):
        self.law, self.name = law, name

    def __call__(self, u):
        try:
            y = self.law(u)
            if np.asarray(y).dtype.kind not in "fiub":
                raise TypeError(f"it must return real numbers; got {shown(y)}")
            return y
        except NotImplementedError:  # a class with N but no law
            raise
        except Exception as error:
            raise RuntimeError(f"{Status.USER_ERROR} (law {self.name} at u = {u!r}: {error!r})") from error


def named(code, names) -> np.ndarray:
    """Regime codes as strings."""
    code = np.asarray(code)
    return code.astype(str) if code.dtype.kind in "US" else np.array(names, dtype=str)[code]


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
    ids = [e.id for e in block.effects]
    order = {label: i for i, label in enumerate(block.output_labels[:2])}.get(output)
    unique = len(ids) == len(set(ids))
    if order is not None and unique:
        if block.core.bodies == 1 and set(ids) in FRICTION_IDS:
            return Method("friction", block, output, order)
        if ids == ["backlash"] and block.core.measured == 0:
            return Method("backlash", block, output, order)
    return Method("orbit", block, output, options=options)


def _output_name(system, output) -> str:
    if system.ninputs != 1:
        raise ValueError(
            f"a describing function needs one input; {system.name} has {system.ninputs}. Fix the others "
            f"inside the block."
        )
    labels = list(system.output_labels)
    if output is None:
        return labels[0]
    if isinstance(output, int | np.integer) and 0 <= output < len(labels):
        return labels[int(output)]
    if output in labels:
        return str(output)
    raise ValueError(f"output must be one of {', '.join(labels)}; got {output!r}.")


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
    told = getattr(F.law, "_isstatic", None)
    if told is not None and told():
        return True
    try:
        F = copy.deepcopy(F)  # do not disturb a memory that is the user's
    except Exception:  # whatever cannot be copied is tried as it is
        pass
    up = largest * np.linspace(-1, 1, 33)
    for u in up[16:]:
        F(float(u))
    down = [np.squeeze(F(float(u))) for u in up[::-1]]
    again = [np.squeeze(F(float(u))) for u in up]
    return bool(
        np.array_equal(np.array(down[::-1], dtype=float), np.array(again, dtype=float), equal_nan=True)
    )


def _linear(system, A, omega, orders):
    """Frequency response; NaN at an undamped pole, named where the forced motion repels."""
    continuous = system.isctime()
    s = 1j * omega if continuous else np.exp(1j * omega * float(system.dt))
    y = np.zeros((A.size, omega.size, orders + 1), dtype=complex)
    response = np.asarray(system(s, warn_infinite=False)).reshape(-1)
    at_pole = ~np.isfinite(response)
    poles = system.poles()
    repels = np.any(poles.real > 0) if continuous else np.any(np.abs(poles) > 1)
    regime = np.full(y.shape[:2], "unstable" if repels else "linear", dtype="U9")
    y[..., 1], regime[:, at_pole] = response, "resonance"
    y[:, at_pole] = np.nan
    return y, regime, np.where(np.isnan(y[..., 1]), np.nan, 0.0)
