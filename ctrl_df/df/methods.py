"""How a block is described, a class for each way: closed forms, quadrature, maps, forced periodic orbits."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from ..blocks.recognized import is_dry, is_static, is_viscous
from ..checks import shown
from ..status import Status
from .branch import Branch
from .closed_form.memoryless import callable_harmonics, element_harmonics, static_regimes, swept_harmonics
from .thresholds import HERE, MOTIONS_AT_ONCE, SAMPLES, SCANNED, SCANNED_ELEMENT, SCANNED_LAW, SHORT_AVERAGE


@dataclass(frozen=True)
class Method:
    """How one block is described.

    Attributes
    ----------
    block : object
        The block, or what stands for it.
    output : str
        Name of the output described.
    needs_omega : bool
        Whether N depends on frequency.
    dynamic : bool
        Whether the block is a nonlinear one with dynamics: it responds to harmonics less the higher they are.
    static : bool
        Whether the block is a law over the amplitude alone, whose corners are looked for.
    quick : bool
        Whether a point costs so little that a scan may take a finer grid than the family's.
    between : bool
        Whether pictures may ask for points between those of a family, where its motions have a period.
    light : bool
        Whether a family is computed sooner than sent to another process.
    takes_options : tuple of str
        Options of its solver that the user may set.
    along_amplitudes : bool
        Whether one point starts the next along amplitudes: lines of a family are then columns.
    amplitudes : int
        Least number of amplitudes in a scan.
    at_once : int or None
        Points computed between two chances to interrupt; None: it reacts to Ctrl-C by itself.
    caveat : str
        What all its values have to be read with.
    """

    block: Any
    output: str = "y"

    needs_omega: ClassVar[bool] = True
    dynamic: ClassVar[bool] = False
    static: ClassVar[bool] = False
    quick: ClassVar[bool] = False
    between: ClassVar[bool] = False
    light: ClassVar[bool] = False
    takes_options: ClassVar[tuple[str, ...]] = ()
    along_amplitudes: ClassVar[bool] = False
    amplitudes: ClassVar[int] = SCANNED
    at_once: ClassVar[int | None] = None
    caveat: ClassVar[str] = ""

    def harmonics(self, A, omega, orders):
        """Return harmonics (na, nw, orders + 1), regime and residual (na, nw) at positive A and omega."""
        raise NotImplementedError

    def compiled(self) -> bool:
        """Whether all the work is compiled code, fit for threads; what it needs is compiled thereafter."""
        return False

    def with_short_averages(self) -> Method:
        """Return the method with short averages over irregular motion, for who has no use for them."""
        return self

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
        return []

    def copied(self) -> Method | None:
        """Return a method that another part can use at the same time; None if there can be none."""
        return self

    def law(self):
        """Return the law without time that it describes, number to number; None if it is none."""
        return None

    def identity(self) -> tuple:
        """Return what a saved family depends on besides the block: numbers, names and code."""
        return (type(self).__name__,)


# --- blocks without dynamics --------------------------------------------------------------------------------


@dataclass(frozen=True)
class ElementIntegrals(Method):
    """Elements of this package by their exact Fourier integrals."""

    needs_omega = False
    static = True
    quick = True
    amplitudes = SCANNED_ELEMENT

    def harmonics(self, A, omega, orders):
        """See `Method.harmonics`."""
        return _spread(element_harmonics(self.block, A, None, orders), A, omega, orders)


@dataclass(frozen=True)
class RateLimiterForm(Method):
    """The rate limiter, whose N depends on A omega."""

    quick = True

    def harmonics(self, A, omega, orders):
        """See `Method.harmonics`."""
        columns = [element_harmonics(self.block, A, w, orders) for w in omega]
        regime = np.array([c[1] for c in columns], dtype=str).T
        return np.stack([c[0] for c in columns], axis=1), regime, np.stack([c[2] for c in columns], axis=1)


@dataclass(frozen=True)
class Quadrature(Method):
    """A law without memory, integrated between its corners.

    Attributes
    ----------
    own_method : callable or None
        The user's ``describing_function``, which is believed.
    """

    own_method: Any = None

    needs_omega = False
    static = True
    quick = True
    amplitudes = SCANNED_LAW

    def harmonics(self, A, omega, orders):
        """See `Method.harmonics`."""
        return _spread(self._at(A, orders), A, omega, orders)

    def law(self):
        """See `Method.law`."""
        return self.block if callable(self.block) else None

    def identity(self) -> tuple:
        """See `Method.identity`."""
        return (*super().identity(), self.own_method)

    def _at(self, A, orders):
        if self.own_method is not None:
            return self._by_own_method(A, orders)
        return self._integrals(A, orders)

    def _integrals(self, A, orders):
        return callable_harmonics(self.block, A, orders)

    def _by_own_method(self, A, orders):
        """N from the user's ``describing_function``; the other harmonics, if asked, from the law itself."""
        assert self.own_method is not None
        N = np.array([complex(self.own_method(float(a))) for a in A])
        y = np.full((A.size, orders + 1), np.nan + 0j)
        residual = np.zeros(A.size)
        if orders > 1:
            try:
                y, _, residual = self._integrals(A, orders)
            except NotImplementedError:  # a class with N but no law: its other harmonics stay unknown
                pass
        y[:, 1] = N
        known = static_regimes(y) if not np.isnan(y).any() else ["memoryless"] * A.size
        return y, known, residual


@dataclass(frozen=True)
class Sampled(Quadrature):
    """A callable that keeps a memory of its own: swept over periods, sample by sample.

    Attributes
    ----------
    samples : int
        Calls a period.
    """

    samples: int = SAMPLES

    static = False
    quick = False
    amplitudes = SCANNED
    caveat = "the block keeps its own memory and could only be sampled"

    def law(self):
        """See `Method.law`."""
        return None

    def copied(self) -> Method | None:
        """See `Method.copied`: parts must not disturb each other's memory."""
        try:
            return replace(self, block=copy.deepcopy(self.block))
        except Exception:  # whatever cannot be copied: one part after the other, then
            return None

    def identity(self) -> tuple:
        """See `Method.identity`."""
        return (*super().identity(), self.samples)

    def _integrals(self, A, orders):
        return swept_harmonics(self.block, A, orders, self.samples)


# --- blocks with dynamics -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class FrequencyResponse(Method):
    """A linear system."""

    quick = True
    light = True

    def harmonics(self, A, omega, orders):
        """See `Method.harmonics`."""
        return _linear(self.block, A, omega, orders)


@dataclass(frozen=True)
class _OfPosition(Method):
    """A mechanism of which the harmonics of the position are known.

    Attributes
    ----------
    order : int
        Times they are to be differentiated: 1 for a velocity.
    """

    order: int = 0

    dynamic = True

    def harmonics(self, A, omega, orders):
        """See `Method.harmonics`."""
        y, regime, residual = self._of_position(A, omega, orders)
        if self.order:
            y = y * (1j * np.arange(orders + 1) * omega[:, None]) ** self.order
        return y, regime, residual

    def compiled(self) -> bool:
        """See `Method.compiled`."""
        return True

    def identity(self) -> tuple:
        """See `Method.identity`."""
        return (*super().identity(), self.order)

    def _of_position(self, A, omega, orders):
        raise NotImplementedError


@dataclass(frozen=True)
class FrictionClosedForm(_OfPosition):
    """A mass with dry and viscous friction: Azenha & Machado (1997), eq. (6), exact with stiction as well."""

    quick = True
    at_once = HERE

    @classmethod
    def fits(cls, block) -> bool:
        """Whether a mechanism has no other effects."""
        if block.core.bodies > 1:
            return False
        dry, viscous, static = cls._sorted(block)
        one = len(dry) == 1 and len(viscous) <= 1 and len(static) <= 1
        return one and len(dry) + len(viscous) + len(static) == len(block.effects)

    @staticmethod
    def _sorted(block) -> list[list[float]]:
        """Return the dry, viscous and static coefficients among the effects."""
        return [[e.values[0] for e in block.effects if kind(e)] for kind in (is_dry, is_viscous, is_static)]

    def _of_position(self, A, omega, orders):
        from .closed_form.friction import FRICTION_REGIMES, friction_family

        (dry,), viscous, static = self._sorted(self.block)
        y, code, residual = friction_family(
            self.block.core.masses[0],
            dry,
            viscous[0] if viscous else 0.0,
            static[0] if static else None,
            A,
            omega,
            orders,
        )
        return y, named(code, FRICTION_REGIMES), residual


@dataclass(frozen=True)
class ImpactMap(_OfPosition):
    """Two masses with a gap, by the map from impact to impact.

    Attributes
    ----------
    options : dict
        Of `ctrl_df.df.closed_form.backlash.backlash_family`.
    """

    options: dict = field(default_factory=dict)

    between = True
    at_once = MOTIONS_AT_ONCE

    @staticmethod
    def fits(block) -> bool:
        """Whether a mechanism is two masses with a gap and nothing else, measured on the load."""
        return [e.divides for e in block.effects] == [True] and block.core.measured == 0

    def with_short_averages(self) -> Method:
        """See `Method.with_short_averages`."""
        return replace(self, options={"periods": SHORT_AVERAGE})

    def branches(self, A, omega, near_A, near_omega) -> list[Branch]:
        """See `Method.branches`."""
        from .closed_form.backlash_branches import backlash_branches

        found = backlash_branches(self.block, A, omega, near_A, near_omega)
        return [b.differentiated(self.order) for b in found] if self.order else found

    def identity(self) -> tuple:
        """See `Method.identity`."""
        return (*super().identity(), self.options)

    def _of_position(self, A, omega, orders):
        from .closed_form import backlash

        core = self.block.core
        load, motor = core.masses
        y, code, residual = backlash.backlash_family(
            motor, load, core.gap, core.restitution, A, omega, orders, **self.options
        )
        return y, named(code, backlash.BACKLASH_REGIMES), residual


@dataclass(frozen=True)
class ForcedOrbit(Method):
    """Anything else: its forced periodic orbit on the engine.

    Attributes
    ----------
    options : dict
        Of `ctrl_df.df.forced_orbit.orbits.orbit_family`.
    """

    options: dict = field(default_factory=dict)

    dynamic = True
    takes_options = ("transient", "averages", "max_steps")
    along_amplitudes = True

    def harmonics(self, A, omega, orders):
        """See `Method.harmonics`."""
        from .forced_orbit import orbits, regimes

        y, code, residual = orbits.orbit_family(
            self.block, A, omega, orders=orders, output=self.output, **self.options
        )
        return y, named(code, regimes.ORBIT_REGIMES), residual

    def compiled(self) -> bool:
        """See `Method.compiled`."""
        from .forced_orbit import orbits

        return not orbits.solver_for(self.block, self.output, **self.options).block.engine.calls_python

    def identity(self) -> tuple:
        """See `Method.identity`."""
        return (*super().identity(), self.options)


@dataclass(frozen=True)
class ImposedForce(Method):
    """A block without mass: the force along an imposed ``A cos(omega t)``, once what it hides has settled."""

    dynamic = True

    def harmonics(self, A, omega, orders):
        """See `Method.harmonics`."""
        from .forced_orbit.imposed import force_harmonics

        y = np.empty((A.size, omega.size, orders + 1), complex)
        residual = np.empty((A.size, omega.size))
        for i, k in np.ndindex(residual.shape):
            y[i, k], residual[i, k] = force_harmonics(self.block.core, A[i], omega[k], orders)
        return y, np.where(np.isfinite(residual), "slip", "aperiodic"), residual


# --- what they share ----------------------------------------------------------------------------------------


class Guarded:
    """A user's law whose errors say that they are the law's, and where it was."""

    def __init__(self, law, name):
        self.law, self.name = law, name

    def __call__(self, u):
        """Evaluate the law; RuntimeError with its exception as the cause."""
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


def _spread(columns, A, omega, orders):
    """Harmonics, regimes and residuals over amplitude, alike at every frequency."""
    y, regime, residual = columns
    shape = (A.size, 1 if omega is None else omega.size)
    return (
        np.broadcast_to(y[:, None, :], (*shape, orders + 1)),
        np.broadcast_to(np.array(regime, dtype=str).reshape(-1, 1), shape),
        np.broadcast_to(residual[:, None], shape),
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
