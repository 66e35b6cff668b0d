"""Memoryless elements: saturation, dead zone, relays, quantizer, preload, broken lines, cubic.

Each is an immutable ``ct.NonlinearIOSystem`` (one input ``u``, one output ``y``, any unit) that also serves
wherever python-control takes a ``DescribingFunctionNonlinearity``: it is callable, ``y = f(u)``, and has
``describing_function(A)``. Its `primitive` is the plain data the event engine runs. Elements with memory
(`ctrl_df.blocks.elements.hysteresis`) share the class.
"""

from __future__ import annotations

import warnings

import numpy as np

from ...checks import real_array, shown
from ..parameter import checked
from ..primitives import PiecewiseAffine, Quantizer, Smooth
from .element import DescribingFunctionNonlinearity, Element, builder, finite

__all__ = ["DescribingFunctionNonlinearity", "Element"]


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
        Upper level, unit of the input; > 0 where `lb` is left out.
    lb : float or None
        Lower level, < `ub`; None: ``-ub``.
    name : str
        System name.

    Raises
    ------
    ValueError
        lb >= ub, one level alone that is not positive, or a level that is not finite.
    TypeError
        A level that is no real number.

    References
    ----------
    Gelb & Vander Velde (1968), appendix B, nonlinearity 9; unequal levels by direct integration.

    Examples
    --------
    >>> print(f"{cdf.describing_function(cdf.saturation(1.0), 2.0):.6f}")
    0.608998+0.000000j
    """
    ub = checked("saturation", "ub", ub, finite(meaning="upper level"))
    if lb is None and ub <= 0:
        raise ValueError(
            f"saturation needs ub > 0 (upper level; the lower one is -ub); got ub={ub:g}. "
            "Give the size of the level, or both levels in order: saturation(ub, lb)."
        )
    lb = -ub if lb is None else lb
    lb = checked("saturation", "lb", lb, finite(meaning="lower level"))
    if lb >= ub:
        raise ValueError(
            f"saturation needs lb < ub; got lb={lb!r}, ub={ub!r}. Give ub > 0, or both levels in order."
        )
    line = PiecewiseAffine.from_corners((lb, ub), (0, 1, 0), (lb, 0, ub))
    specs = dict(ub=finite(meaning="upper level"), lb=finite(meaning="lower level"))
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

    Examples
    --------
    >>> print(f"{cdf.describing_function(cdf.dead_zone(1.0), [0.4, 5.0])[1].real:.4f}")
    0.8729
    """
    spec = finite(lower=0.0, meaning="total width of the dead band")
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

    Examples
    --------
    >>> print(f"{cdf.describing_function(cdf.relay(1.0), 2.0).real:.6f}")  # 4 / (pi 2)
    0.636620
    """
    spec = finite(lower=0.0, strict=True, meaning="output level")
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

    Examples
    --------
    >>> relay = cdf.relay_with_dead_zone(1.0, dead_zone=0.5)
    >>> [float(relay.output(0, [], [u])[0]) for u in (0.2, 0.3, -0.3)]
    [0.0, 1.0, -1.0]
    """
    specs = dict(
        level=finite(lower=0.0, strict=True, meaning="output level"),
        dead_zone=finite(lower=0.0, meaning="total width of the silent part"),
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

    Examples
    --------
    >>> [float(cdf.quantizer(0.1).output(0, [], [u])[0]) for u in (0.04, 0.06)]
    [0.0, 0.1]
    """
    spec = finite(lower=0.0, strict=True, meaning="width and height of a stair")
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

    Examples
    --------
    >>> float(cdf.preload(0.5, slope=2.0).output(0, [], [1.0])[0])
    2.5
    """
    specs = dict(level=finite(lower=0.0, meaning="half the jump at zero"), slope=finite(meaning="gain"))
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

    Examples
    --------
    >>> curve = cdf.piecewise_linear([-1, 0, 1], [-2, 0, 1])
    >>> [float(curve.output(0, [], [u])[0]) for u in (-0.5, 0.5, 2.0)]
    [-1.0, 0.5, 2.0]
    """
    xs, ys = (real_array("piecewise_linear", k, v) for k, v in (("x", x), ("y", y)))
    if xs.ndim != 1 or xs.shape != ys.shape or xs.size < 2:
        raise ValueError(
            f"piecewise_linear needs x and y of one equal length >= 2; got shapes {xs.shape} and {ys.shape}. "
            "Give one output for every input."
        )
    if np.any(np.diff(xs) <= 0):
        raise ValueError(
            f"piecewise_linear needs x strictly ascending; got x={shown(x)}. Sort it; for a jump use a relay."
        )
    slopes = np.diff(ys) / np.diff(xs)
    intercepts = ys[:-1] - slopes * xs[:-1]
    line = PiecewiseAffine.from_corners(xs[1:-1].tolist(), slopes.tolist(), intercepts.tolist())
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

    Examples
    --------
    >>> print(f"{cdf.describing_function(cdf.cubic(1.0), 2.0).real:.4f}")  # 3/4 a^2
    3.0000
    """
    spec = finite(meaning="coefficient of the cube")
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
        Lower level; None: ``-abs(ub)`` to ``abs(ub)``, as there. Unequal levels warn, as python-control's
        class does: the output then has a mean, which a loop analysis by the first harmonic leaves out.

    Raises
    ------
    TypeError, ValueError
        A level that is not a finite number, ``lb >= ub``.

    Examples
    --------
    >>> F = cdf.saturation_nonlinearity(1)
    >>> float(F(3.0))
    1.0
    """

    def __init__(self, ub=1, lb=None):
        if lb is None:
            ub = abs(checked("saturation_nonlinearity", "ub", ub, finite(meaning="upper level")))
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
