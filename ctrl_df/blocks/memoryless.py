"""Memoryless elements: saturation, dead zone, relays, quantizer, preload, broken lines, cubic.

Each is an immutable ``ct.NonlinearIOSystem`` (one input ``u``, one output ``y``, any unit) that also serves
wherever python-control takes a ``DescribingFunctionNonlinearity``: it is callable, ``y = f(u)``, and has
``describing_function(A)``. Its `primitive` is the plain data the event engine runs. Elements with memory
(`ctrl_df.blocks.hysteresis`) share the class.
"""

from __future__ import annotations

import importlib
import math
import warnings
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import control as ct
import numpy as np
from control.descfcn import DescribingFunctionNonlinearity as _PythonControlNonlinearity

from .parameter import Parameter, checked
from .primitives import PiecewiseAffine, Quantizer, Smooth


class DescribingFunctionNonlinearity(_PythonControlNonlinearity):
    """Base class for a user's own nonlinearity with an analytic describing function.

    Subclass it, define ``__call__(u)`` and ``describing_function(A)``, as with python-control's class of the
    same name, which it extends. Without ``describing_function`` the numerical computation is used.
    """


def _finite(unit="", **bounds) -> dict:
    return dict(
        unit=unit, **{"lower": -math.inf, "upper": math.inf, "strict": False, "meaning": "", **bounds}
    )


class Element(ct.NonlinearIOSystem, DescribingFunctionNonlinearity):
    """One-input, one-output nonlinear element; built by the functions of this module, not directly.

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
        for key in values:
            if key not in self._specs:
                raise ValueError(
                    f"a parameter name must be one of {', '.join(self._specs) or 'none'}; got {key!r}."
                )
        return build(self._kind, {**self._values, **values})

    def __reduce__(self):
        """Pickle as kind and arguments."""
        return build, (self._kind, dict(self._values), self.name)

    def __eq__(self, other: Any) -> bool:
        """Compare by kind and arguments."""
        if not isinstance(other, Element):
            return NotImplemented
        return (self._kind, self._values) == (other._kind, other._values)

    def __hash__(self) -> int:
        """Hash of kind and arguments."""
        return hash((self._kind, tuple(self._values.items())))

    def __repr__(self) -> str:
        """Return the call that builds it."""
        return f"{self._kind}({', '.join(f'{k}={v!r}' for k, v in self._values.items())})"

    # --- the dialect of python-control -----------------------------------------------------------------

    def __call__(self, u, params=None, squeeze=None):
        """Return ``y = f(u)``, elementwise; an element with memory answers as from rest at u = 0."""
        y = self._from_rest(self._primitive_for(params), np.asarray(u, dtype=float))
        if squeeze:
            y = np.squeeze(y)
        return float(y) if np.ndim(y) == 0 else y

    def _isstatic(self) -> bool:
        return self._static

    def describing_function(self, A, omega=None):
        """Return N at amplitude `A` >= 0; `omega` [rad/s] matters to a rate limiter only."""
        # The drop-in contract wants the method here; the mathematics lives one layer up, in ctrl_df.df.
        return importlib.import_module("ctrl_df.df.describing").describing_function(self, A, omega)

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


@builder
def saturation(ub=1.0, lb=None, *, name=None) -> Element:
    """Saturation: the identity, clipped.

    ::

             y|    ____ ub
              |   /
        ______|__/______ u
             /|
        ____/ |  lb

    Parameters
    ----------
    ub : float
        Upper level, unit of the input.
    lb : float or None
        Lower level, < `ub`; None: ``-abs(ub)`` to ``abs(ub)``.
    name : str
        System name.

    Raises
    ------
    ValueError
        lb >= ub, or a level that is not finite.

    References
    ----------
    Gelb & Vander Velde (1968), appendix B, nonlinearity 9; unequal levels by direct integration.
    """
    ub = checked("saturation", "ub", ub, _finite(meaning="upper level"))
    if lb is None:
        lb, ub = -abs(ub), abs(ub)
    lb = checked("saturation", "lb", lb, _finite(meaning="lower level"))
    if lb >= ub:
        raise ValueError(
            f"saturation needs lb < ub; got lb={lb!r}, ub={ub!r}. Give ub > 0, or both levels in order."
        )
    line = PiecewiseAffine.from_corners((lb, ub), (0, 1, 0), (lb, 0, ub))
    specs = dict(ub=_finite(meaning="upper level"), lb=_finite(meaning="lower level"))
    return Element("saturation", dict(ub=ub, lb=lb), line, specs=specs, name=name)


@builder
def dead_zone(width, *, name=None) -> Element:
    """Dead zone: nothing until the input exceeds half the width, slope 1 beyond.

    ::

             y|     /
              |    /
        ___.__|__./____ u      (horizontal part = width)
          /   |
         /    |

    Parameters
    ----------
    width : float
        Total width of the dead band, unit of the input, >= 0: from -width/2 to +width/2.
    name : str
        System name.

    Raises
    ------
    ValueError
        width < 0 or not finite.

    References
    ----------
    Gelb & Vander Velde (1968), appendix B, nonlinearity 10.
    """
    spec = _finite(lower=0.0, meaning="total width of the dead band")
    width = checked("dead_zone", "width", width, spec)
    d = width / 2
    line = PiecewiseAffine.from_corners((-d, d), (1, 0, 1), (d, 0, -d))
    return Element("dead_zone", dict(width=width), line, specs=dict(width=spec), name=name)


@builder
def relay(level=1.0, *, name=None) -> Element:
    """Ideal relay: ``y = level sign(u)``.

    ::

             y|_____ level
        ______|______ u
        ______|

    Parameters
    ----------
    level : float
        Output level, > 0.
    name : str
        System name.

    Raises
    ------
    ValueError
        level <= 0 or not finite.

    References
    ----------
    Tsypkin (1984), Relay Control Systems; Gelb & Vander Velde (1968), appendix B: N = 4 level / (pi A).
    """
    spec = _finite(lower=0.0, strict=True, meaning="output level")
    level = checked("relay", "level", level, spec)
    line = PiecewiseAffine.from_corners((0.0,), (0, 0), (-level, level))
    return Element("relay", dict(level=level), line, specs=dict(level=spec), name=name)


@builder
def relay_with_dead_zone(level, dead_zone, *, name=None) -> Element:
    """Three-position relay: silent until the input exceeds half the dead zone.

    ::

             y|   ____ level
        ______|__|____ u      (silent part = dead_zone, total width)
        __|   |

    Parameters
    ----------
    level : float
        Output level, > 0.
    dead_zone : float
        Total width of the silent part, unit of the input, >= 0.
    name : str
        System name.

    Raises
    ------
    ValueError
        level <= 0, dead_zone < 0.

    References
    ----------
    Gelb & Vander Velde (1968), appendix B: N = (4 level / (pi A)) sqrt(1 - (dead_zone / 2A)^2).
    """
    specs = dict(
        level=_finite(lower=0.0, strict=True, meaning="output level"),
        dead_zone=_finite(lower=0.0, meaning="total width of the silent part"),
    )
    level = checked("relay_with_dead_zone", "level", level, specs["level"])
    width = checked("relay_with_dead_zone", "dead_zone", dead_zone, specs["dead_zone"])
    line = PiecewiseAffine.from_corners((-width / 2, width / 2), (0, 0, 0), (-level, 0, level))
    values = dict(level=level, dead_zone=width)
    return Element("relay_with_dead_zone", values, line, specs=specs, name=name)


@builder
def quantizer(step, *, name=None) -> Element:
    """Mid-tread quantizer: rounds to the nearest multiple of `step`.

    ::

             y|      __
              |   __|
        ______|__|____ u      (stairs of width and height = step)
           |__|

    Parameters
    ----------
    step : float
        Unit of the input, > 0.
    name : str
        System name.

    Raises
    ------
    ValueError
        step <= 0 or not finite.

    References
    ----------
    Gelb & Vander Velde (1968), appendix B, uniform quantizer.
    """
    spec = _finite(lower=0.0, strict=True, meaning="width and height of a stair")
    step = checked("quantizer", "step", step, spec)
    return Element("quantizer", dict(step=step), Quantizer(step), specs=dict(step=spec), name=name)


@builder
def preload(level, slope=1.0, *, name=None) -> Element:
    """Preload: a relay beside a gain, ``y = slope u + level sign(u)``.

    ::

             y|  /
         level| /
        ______|/_____ u
             /|
            / |

    Parameters
    ----------
    level : float
        Jump at zero is twice this; >= 0.
    slope : float
        Gain beside the relay.
    name : str
        System name.

    Raises
    ------
    ValueError
        level < 0, or a number that is not finite.

    References
    ----------
    Gelb & Vander Velde (1968), appendix B: N = slope + 4 level / (pi A).
    """
    specs = dict(level=_finite(lower=0.0, meaning="half the jump at zero"), slope=_finite(meaning="gain"))
    level = checked("preload", "level", level, specs["level"])
    slope = checked("preload", "slope", slope, specs["slope"])
    line = PiecewiseAffine.from_corners((0.0,), (slope, slope), (-level, level))
    return Element("preload", dict(level=level, slope=slope), line, specs=specs, name=name)


@builder
def piecewise_linear(x, y, *, name=None) -> Element:
    """Broken line through points; the end slopes continue beyond them.

    Parameters
    ----------
    x : sequence of float, shape (n,), n >= 2
        Inputs, strictly ascending.
    y : sequence of float, shape (n,)
        Outputs.
    name : str
        System name.

    Raises
    ------
    ValueError
        Fewer than two points, unequal lengths, x not ascending, a number that is not finite.
    """
    xs, ys = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    if xs.ndim != 1 or xs.shape != ys.shape or xs.size < 2:
        raise ValueError(
            f"piecewise_linear needs x and y of one equal length >= 2; got shapes {xs.shape} and {ys.shape}. "
            "Give one output for every input."
        )
    if not (np.isfinite(xs).all() and np.isfinite(ys).all()):
        raise ValueError("piecewise_linear needs finite x and y; got NaN or infinity. Remove those points.")
    if np.any(np.diff(xs) <= 0):
        raise ValueError(
            f"piecewise_linear needs x strictly ascending; got x={x!r}. Sort it; for a jump use a relay."
        )
    slopes = np.diff(ys) / np.diff(xs)
    intercepts = ys[:-1] - slopes * xs[:-1]
    line = PiecewiseAffine.from_corners(xs[1:-1], slopes, intercepts)
    values = dict(x=tuple(xs.tolist()), y=tuple(ys.tolist()))
    return Element("piecewise_linear", values, line, name=name)


@builder
def cubic(coefficient=1.0, *, name=None) -> Element:
    """Cubic: ``y = coefficient u**3``.

    Parameters
    ----------
    coefficient : float
        Unit of y over unit of u cubed.
    name : str
        System name.

    Raises
    ------
    ValueError
        coefficient not finite.

    References
    ----------
    N = (3/4) coefficient A^2, third harmonic (1/4) coefficient A^3: the identity for cos^3.
    """
    spec = _finite(meaning="coefficient of the cube")
    coefficient = checked("cubic", "coefficient", coefficient, spec)
    law = Smooth(_cube, (coefficient,))
    return Element("cubic", dict(coefficient=coefficient), law, specs=dict(coefficient=spec), name=name)


def _cube(u, p):
    return p[0] * u * u * u


class saturation_nonlinearity(Element):
    """python-control's saturation by its own name; the describing function holds for unequal levels too.

    Parameters
    ----------
    ub : float
        Upper level.
    lb : float or None
        Lower level; None: ``-abs(ub)`` to ``abs(ub)``. Unequal levels warn, as python-control's class does:
        the output then has a mean, which a loop analysis by the first harmonic leaves out.
    """

    def __init__(self, ub=1, lb=None):
        element = saturation(ub, lb)
        if element.values["lb"] + element.values["ub"] != 0:
            warnings.warn(
                "asymmetric saturation; the output has a mean, see .harmonics of its family", stacklevel=2
            )
        super().__init__("saturation", element.values, element.primitive, specs=element._specs)

    @property
    def lb(self) -> float:
        """Lower level."""
        return self.values["lb"]

    @property
    def ub(self) -> float:
        """Upper level."""
        return self.values["ub"]
