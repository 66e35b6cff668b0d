"""Elements with memory: play, relay with hysteresis, rate limiter.

Each keeps its memory in one state, so that the block is a pure function of ``(t, x, u, params)``. The exact
laws are set-valued; ``updfcn`` is a compliant form for ordinary ODE solvers, which follows the exact one with
the time constant ``control.config.defaults['ctrl_df.follow_time']`` (default 1 ms). `Element.step` and the
event engine are exact.
"""

from __future__ import annotations

import math

import control as ct
import numpy as np

from ..parameter import checked
from ..primitives import PiecewiseAffine, Play, RateLimiter
from ..thresholds import FOLLOW_TIME
from .element import Element, builder, finite

ct.config.defaults.setdefault("ctrl_df.follow_time", FOLLOW_TIME)


def _follow_time() -> float:
    return ct.config.defaults["ctrl_df.follow_time"]


@builder
def play(gap, *, name=None) -> Element:
    """Friction-driven backlash (kinematic): the output waits until the gap is taken up.

    ::

          y|   /--/
           |  /  /
        ---+-/--/--- u      (horizontal width = gap)
           |/--/

    The state is the output's position. In the compliant form it trails a moving input by ``follow_time``
    times the input's speed, while the output itself stays exactly within the gap: what remains is an error
    at each reversal of about ``follow_time**2`` times the input's acceleration.

    Parameters
    ----------
    gap : float
        Total clearance, unit of the input, > 0.
    name : str
        System name.

    Raises
    ------
    ValueError
        gap <= 0 or not finite.

    References
    ----------
    Gelb & Vander Velde (1968), appendix B, nonlinearity 48.

    Examples
    --------
    >>> N = cdf.describing_function(cdf.play(1.0), 1.0)  # half of the gap is lost on either side
    >>> print(f"{abs(N):.4f}, {np.degrees(np.angle(N)):.1f} deg")
    0.5927, -32.5 deg
    """
    spec = finite(lower=0.0, strict=True, meaning="total clearance")
    gap = checked("play", "gap", gap, spec, "For a tight joint leave the block out.")
    return _PlayElement("play", dict(gap=gap), Play(gap), specs=dict(gap=spec), name=name)


@builder
def relay_with_hysteresis(level, hysteresis, *, name=None) -> Element:
    """Relay that switches up at ``+hysteresis`` and down at ``-hysteresis``.

    ::

             y|  .----- level
           |  |  |
        ---+--+--+--- u      (switches at -hysteresis and +hysteresis)
        ---.  |

    The state is the branch, -1 to 1; a start at 0 or above is on the upper branch. In the compliant form the
    output crosses from level to level with the time constant ``follow_time``.

    Parameters
    ----------
    level : float
        Output level, > 0.
    hysteresis : float
        Half width of the loop, unit of the input, > 0.
    name : str
        System name.

    Raises
    ------
    ValueError
        level <= 0 or hysteresis <= 0. Without hysteresis use `relay`.

    References
    ----------
    Astrom & Murray, Feedback Systems, 2nd ed., example 10.12.

    Examples
    --------
    >>> N = cdf.describing_function(cdf.relay_with_hysteresis(1.0, 0.5), 1.0)
    >>> print(f"{abs(N):.4f}, {np.degrees(np.angle(N)):.1f} deg")  # arcsin(0.5) late
    1.2732, -30.0 deg
    """
    specs = dict(
        level=finite(lower=0.0, strict=True, meaning="output level"),
        hysteresis=finite(lower=0.0, strict=True, meaning="half width of the loop"),
    )
    level = checked("relay_with_hysteresis", "level", level, specs["level"])
    h = checked(
        "relay_with_hysteresis", "hysteresis", hysteresis, specs["hysteresis"], "Without it use relay(level)."
    )
    loop = PiecewiseAffine((-math.inf, -h), (h, math.inf), (0.0, 0.0), (-level, level))
    values = dict(level=level, hysteresis=h)
    return _RelayElement("relay_with_hysteresis", values, loop, specs=specs, name=name)


@builder
def rate_limiter(rate, *, name=None) -> Element:
    """Rate limiter: the output follows the input, but never faster than `rate`.

    The state is the output; in the compliant form it trails an input slower than `rate` by ``follow_time``.

    Parameters
    ----------
    rate : float
        Largest speed of the output, unit of the input per second, > 0.
    name : str
        System name.

    Raises
    ------
    ValueError
        rate <= 0 or not finite.

    References
    ----------
    Klyde, McRuer & Myers (1997), J. Guidance, Control, and Dynamics 20(1), 81-89; Duda (1997), ibid. 20(3).

    Examples
    --------
    >>> N = cdf.describing_function(cdf.rate_limiter(1.0), 1.0, 4.0)  # a triangle wave
    >>> print(f"{abs(N):.4f}")
    0.3183
    """
    spec = finite(lower=0.0, strict=True, meaning="largest speed of the output")
    rate = checked("rate_limiter", "rate", rate, spec)
    return _RateElement("rate_limiter", dict(rate=rate), RateLimiter(rate), specs=dict(rate=spec), name=name)


class _PlayElement(Element):
    _static = False

    def step(self, u: float, center: float = 0.0) -> tuple[float, float]:
        """Return output and new state for input `u` from state `center`, exactly."""
        half = self.primitive.gap / 2
        center = min(max(center, u - half), u + half)
        return center, center

    def _from_rest(self, primitive, u):
        return u - np.clip(u, -primitive.gap / 2, primitive.gap / 2)

    def _outfcn(self, t, x, u, params):
        half = self._primitive_for(params).gap / 2
        return np.array([min(max(float(x[0]), float(u[0]) - half), float(u[0]) + half)])

    def _updfcn(self, t, x, u, params):
        return (self._outfcn(t, x, u, params) - x[0]) / _follow_time()


class _RelayElement(Element):
    _static = False
    _state_name = "branch"

    def step(self, u: float, branch: int = 1) -> tuple[float, int]:
        """Return output and new branch (0 lower, 1 upper) for input `u` from `branch`, exactly."""
        branch = self.primitive.region(u, branch)
        return self.primitive.intercept[branch], branch

    def _from_rest(self, primitive, u):
        regions = [primitive.region(float(v)) for v in u.ravel()]
        return np.array([primitive.intercept[i] for i in regions]).reshape(u.shape)

    def _outfcn(self, t, x, u, params):
        level = self._primitive_for(params).intercept[1]
        return np.array([level * min(max(float(x[0]), -1.0), 1.0)])

    def _updfcn(self, t, x, u, params):
        h = self._primitive_for(params).high[0]
        upper = u[0] > h or (u[0] >= -h and x[0] >= 0)
        return np.array([((1.0 if upper else -1.0) - x[0]) / _follow_time()])


class _RateElement(Element):
    _static = False

    def _from_rest(self, primitive, u):
        raise TypeError(
            "rate_limiter has no y = f(u): its output depends on time. Simulate it, or ask for N(A, omega)."
        )

    def _outfcn(self, t, x, u, params):
        return np.array([float(x[0])])

    def _updfcn(self, t, x, u, params):
        rate = self._primitive_for(params).rate
        return np.clip((np.array([float(u[0])]) - x[0]) / _follow_time(), -rate, rate)


class friction_backlash_nonlinearity(_PlayElement):
    """python-control's kinematic backlash by its own name, without its hidden state: `play` of gap `b`.

    Parameters
    ----------
    b : float
        Total clearance, unit of the input, > 0.

    Raises
    ------
    TypeError, ValueError
        `b` not a positive number.

    Examples
    --------
    >>> play = cdf.friction_backlash_nonlinearity(1.0)
    >>> print(f"{np.degrees(np.angle(cdf.describing_function(play, 1.0))):.1f} deg")
    -32.5 deg
    """

    def __init__(self, b):
        element = play(b)
        super().__init__("play", element.values, element.primitive, specs=element._specs)

    @property
    def b(self) -> float:
        """Total clearance."""
        return self.values["gap"]


class relay_hysteresis_nonlinearity(_RelayElement):
    """python-control's relay with hysteresis by its own name, without its hidden state.

    Parameters
    ----------
    b : float
        Output level, > 0.
    c : float
        Half width of the hysteresis, unit of the input, > 0.

    Raises
    ------
    TypeError, ValueError
        `b` or `c` not a positive number.

    Examples
    --------
    >>> relay = cdf.relay_hysteresis_nonlinearity(1.0, 0.5)
    >>> print(f"{np.degrees(np.angle(cdf.describing_function(relay, 1.0))):.1f} deg")
    -30.0 deg
    """

    def __init__(self, b, c):
        element = relay_with_hysteresis(b, c)
        super().__init__("relay_with_hysteresis", element.values, element.primitive, specs=element._specs)

    @property
    def b(self) -> float:
        """Output level."""
        return self.values["level"]

    @property
    def c(self) -> float:
        """Half width of the hysteresis."""
        return self.values["hysteresis"]
