"""What memoryless and hysteretic elements share: a value, python-control's dialect, a builder's name."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from control.descfcn import DescribingFunctionNonlinearity as _PythonControlNonlinearity

from ...checks import known_name, mapping, shown, system_name
from ...drawing import go_on
from ..immutable import Immutable
from ..ordinary.linearization import warn_of_element
from ..parameter import Parameter


class DescribingFunctionNonlinearity(_PythonControlNonlinearity):
    """Base class for a user's own nonlinearity with an analytic describing function.

    Subclass it, define ``__call__(u)`` and ``describing_function(A)``, as with python-control's class of the
    same name, which it extends. Without ``describing_function`` the numerical computation is used.

    Examples
    --------
    >>> class Square(cdf.DescribingFunctionNonlinearity):
    ...     def __call__(self, A):
    ...         return A * abs(A)
    ...     def describing_function(self, A):
    ...         return 8 * A / (3 * np.pi)
    >>> print(f"{cdf.describing_function(Square(), 3.0).real:.4f}")
    2.5465
    """


def finite(unit="", **bounds) -> dict:
    """Bounds and meaning of a number that must be finite, as `Parameter` takes them."""
    return dict(
        unit=unit, **{"lower": -math.inf, "upper": math.inf, "strict": False, "meaning": "", **bounds}
    )


class Element(Immutable, DescribingFunctionNonlinearity):
    """One-input, one-output nonlinear element; built by `saturation`, `relay`, `play` ..., not directly.

    Attributes
    ----------
    kind : str
        Name of the function that built it.
    primitive : PiecewiseAffine, Quantizer, Smooth, Play or RateLimiter
        The element as plain data.
    values : mapping
        Its arguments by name.
    """

    _static = True

    def __init__(self, kind, values, primitive, *, specs=None, name=None):
        system_name(kind, name)
        self._kind: str = kind
        self._values = MappingProxyType(dict(values))
        self._specs: dict = specs or {}
        self._primitive: Any = primitive
        super().__init__(
            None if self._static else self._updfcn,
            self._outfcn,
            params={k: self._values[k] for k in self._specs},
            inputs=["u"],
            outputs=["y"],
            states=None if self._static else [self._state_name],
            dt=None if self._static else 0,
            name=name,
        )

    _state_name = "y"

    # --- a value --------------------------------------------------------------------------------------

    @property
    def kind(self) -> str:
        """Name of the function that built it."""
        return self._kind

    @property
    def values(self) -> Mapping[str, Any]:
        """Its arguments by name."""
        return self._values

    @property
    def primitive(self) -> Any:
        """The element as plain data, for the event engine."""
        return self._primitive

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """Its numbers as `Parameter` (value, unit, bounds); empty for a broken line given by points."""
        return MappingProxyType({k: Parameter(self._values[k], **spec) for k, spec in self._specs.items()})

    def with_parameters(self, values: Mapping[str, float]) -> Element:
        """Return the element with some of its numbers changed; an unknown name raises ValueError."""
        for key in mapping("with_parameters", "values", values):
            known_name("with_parameters", "names", key, self._specs)
        return build(self._kind, {**self._values, **values})

    def __reduce__(self):
        """Pickle as kind and arguments."""
        return build, (self._kind, dict(self._values), self.given_name), self._called

    def __eq__(self, other: Any) -> bool:
        """Compare by kind, arguments and given name."""
        if not isinstance(other, Element):
            return NotImplemented
        return (self._kind, self._values, self.given_name) == (other._kind, other._values, other.given_name)

    def __hash__(self) -> int:
        """Hash of kind, arguments and given name."""
        return hash((self._kind, tuple(self._values.items()), self.given_name))

    def __repr__(self) -> str:
        """Return the call that builds it."""
        return f"{self._kind}({', '.join(f'{k}={v!r}' for k, v in self._values.items())})"

    # --- the dialect of python-control -----------------------------------------------------------------

    def __call__(self, u, params=None, squeeze=None):
        """Return ``y = f(u)``, elementwise; an element with memory answers as from rest at u = 0."""
        values = np.asarray(u)
        if values.dtype.kind not in "iuf":
            raise TypeError(f"{self._kind} needs its input u as real numbers; got {shown(u)}.")
        y = self._from_rest(self._primitive_for(params), values.astype(float))
        if squeeze:
            y = np.squeeze(y)
        return float(y) if np.ndim(y) == 0 else y

    def linearize(self, x0, u0=None, t=0, params=None, eps=1e-6, copy_names=False, **kwargs):
        """Linearize; see `ct.linearize`. Warns where there is no slope."""
        at = getattr(x0, "inputs", 0.0) if u0 is None else u0
        warn_of_element(self._kind, self._primitive_for(params), at, eps)
        return super().linearize(x0, u0, t, params, eps, copy_names, **kwargs)

    def _isstatic(self) -> bool:
        return self._static

    def describing_function(self, A, omega=None):
        """Return N at amplitude `A` >= 0; `omega` [rad/s] matters to a rate limiter only."""
        # the drop-in contract wants the method here; the mathematics lives above
        return go_on("describing function", self, A, omega)

    def _primitive_for(self, params) -> Any:
        changed = (
            {k: params[k] for k in self._specs if k in params and params[k] != self._values[k]}
            if params
            else {}
        )
        return (
            build(self._kind, {**self._values, **changed}, "params").primitive if changed else self._primitive
        )

    def _from_rest(self, primitive, u):
        return primitive.value(u)

    def _outfcn(self, t, x, u, params):
        return np.atleast_1d(self._primitive_for(params).value(np.asarray(u, dtype=float).reshape(-1)))

    def _updfcn(self, t, x, u, params):
        return np.zeros(0)


_BUILDERS: dict[str, Callable[..., Element]] = {}


def builder(function):
    """Make `build` know a factory by its name (a decorator)."""
    _BUILDERS[function.__name__] = function
    return function


def build(kind: str, values: Mapping[str, Any], name: str | None = None) -> Element:
    """Build an element again from its kind and arguments (what unpickling and parameter changes use)."""
    return _BUILDERS[kind](**values, name=name)
