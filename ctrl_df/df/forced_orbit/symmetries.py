"""What a system's laws leave unchanged, found by asking them: oddness, free positions, free speeds.

A shooting method needs to know which states must repeat (a free mass may be anywhere), whether half a
period tells the whole one (odd laws), and whether the laws depend on time at all. Lists of known effects
would not hold for effects that users write; the compiled rates are evaluated at random states instead.
"""

from __future__ import annotations

import copy
import functools
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ...blocks.mechanism import Mechanism
from ...cached import cached_property
from ...simulate.engine import Engine, constant_drive
from ...simulate.kernel.evaluation import evaluate_each
from ...simulate.program import layout as L
from ...thresholds import FEW_ROUNDED
from ..thresholds import ALIKE, AT_REST, INPUT_DECADES, PROBES, RIPPLED, SHIFTS, STATE_DECADES


@dataclass
class Symmetries:
    """Coordinates y = T x of a system, and what is known of each.

    Attributes
    ----------
    transform, inverse : (n, n) arrays
        Two bodies are described by load position, speed of their centre of mass, relative position and
        relative speed.
    odd : bool
        Whether the laws are odd about the mirror ``x -> offset - x``.
    offset : (n,) array
        Not zero across a gap: motor and load change faces.
    free : (m,) int array
        Coordinates that must repeat after a period.
    wrap : (n,) array
        Length over which a coordinate repeats (a ripple over position); 0: none.
    positions : (n,) bool array
        States that are positions of a free body, whose mean has no meaning.
    inertial : (n,) bool array
        Coordinates whose speed is free as well: nothing ties the mechanism to the ground.
    lower, upper : (n,) arrays
        Bounds of the coordinates (the gap).
    low, high : (n,) arrays
        Bounds of the states (end stops).
    power : (n,) int array
        1 for speeds, 2 for positions of a mechanism, 0 for other states.
    autonomous : bool
        False where the rates depend on time itself.
    shifts : list of (n,) bool arrays
        The directions of free position, one a mechanism.
    """

    transform: np.ndarray
    inverse: np.ndarray
    odd: bool
    offset: np.ndarray
    free: np.ndarray
    wrap: np.ndarray
    positions: np.ndarray
    inertial: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    low: np.ndarray
    high: np.ndarray
    power: np.ndarray
    autonomous: bool
    shifts: list


@dataclass(frozen=True)
class Sizes:
    """What motion the laws are asked about: laws that matter there must show.

    Attributes
    ----------
    states : (n,) array
        Size of each state.
    force : float
        Size of the input.
    rate : float
        Typical frequency [rad/s].
    """

    states: np.ndarray
    force: float = 1.0
    rate: float = 1.0

    @classmethod
    def ones(cls, n: int) -> Sizes:
        """Return sizes of one in every unit."""
        return cls(np.ones(n))

    def near(self, other: Sizes, factor: float) -> bool:
        """Whether all sizes agree within a factor."""
        ratios = (self.states / other.states).tolist()
        ratios += [self.force / other.force, self.rate / other.rate]
        return max(ratios) <= factor and min(ratios) >= 1 / factor


class Samples(NamedTuple):
    """Values of the laws at random states `x` (m, n) and inputs `u` (m,): rates, margins, outputs."""

    x: np.ndarray
    u: np.ndarray
    dx: np.ndarray
    g: np.ndarray
    y: np.ndarray


class Probe:
    """Rates and margins of an engine at given states and input."""

    def __init__(self, engine: Engine, sizes: Sizes | None = None):
        self.engine, self.prog = engine, engine.program
        self.sizes = Sizes.ones(engine.nstates) if sizes is None else sizes
        self.ng = int(self.prog.ints[L.H_NG])

    @cached_property
    def rng(self) -> np.random.Generator:
        """Random numbers beside those of the states, the same for every probe of such a system."""
        return copy.deepcopy(self._drawn.after)

    @cached_property
    def _gaps(self) -> list[tuple[Any, tuple[float, float]]]:
        """Mechanisms with a gap, and where in it, or beyond, their other body may be."""
        found = [(node, _reach(self.prog, node)) for node in _mechanisms(self.prog)]
        return [(node, reach) for node, reach in found if reach is not None]

    @cached_property
    def _drawn(self) -> _Drawn:
        return _drawn(self.engine.nstates, tuple(reach for _, reach in self._gaps))

    def at(self, x, u):
        """Return rates, margins and outputs at one state."""
        dx, g, y = self.at_all(x[None], np.array([u]))
        return dx[0], g[0], y[0]

    def at_all(self, x, u, t=0.0):
        """Return rates (m, n), margins (sorted within each node), outputs at states x (m, n), inputs u (m,).

        Modes are settled first.
        """
        engine, prog = self.engine, self.prog
        m, x = len(x), np.array(x, order="C")
        dx, g, y = np.zeros(x.shape), np.full((m, self.ng + 1), np.inf), np.zeros((m, engine.noutputs))
        drive, times = constant_drive(np.zeros(engine.ninputs)), np.broadcast_to(t, m).astype(float)
        inputs = np.asarray(u, float)
        evaluate_each(prog, drive, times, x, inputs, engine.modes, engine.space.work, dx, g, y)
        for node in prog.nodes:
            mine = slice(node[L.G], node[L.G] + node[L.NG])
            # what a quantizer does with its steps shows in the rates, or it does nothing
            g[:, mine] = np.inf if node[L.KIND] == L.QUANTIZER else np.sort(g[:, mine], axis=1)
        return dx, g, y

    def states(self) -> tuple[np.ndarray, np.ndarray]:
        """Random states (m, n) over several decades, bodies within their gaps, some at rest; inputs (m,)."""
        prog, drawn = self.prog, self._drawn
        x, u = drawn.x * self.sizes.states, drawn.u * self.sizes.force
        for node in _mechanisms(prog):
            at, bodies = node[L.X], prog.ints[node[L.AUX] + L.A_BODIES]
            x[::AT_REST, at + 1 : at + 2 * bodies : 2] = 0.0
            if bodies == 2 and prog.ints[node[L.AUX] + L.A_JOINT] == L.J_RIGID:
                x[:, at + 2 : at + 4] = x[:, at : at + 2]
        for (node, _), share in zip(self._gaps, drawn.shares, strict=True):
            at = node[L.X]
            x[:, at + 2] = x[:, at] + prog.par[node[L.PAR] + L.P_GAP] * share
        return x, u

    def samples(self) -> Samples:
        """Return what the laws are at random states."""
        x, u = self.states()
        return Samples(x, u, *self.at_all(x, u))


class _Drawn(NamedTuple):
    """Random states and inputs in units of one, places in gaps, and the generator after them."""

    x: np.ndarray
    u: np.ndarray
    shares: np.ndarray  # (gaps, m)
    after: np.random.Generator


@functools.cache
def _drawn(n: int, reaches: tuple[tuple[float, float], ...]) -> _Drawn:
    rng = np.random.default_rng(20)
    x, u, shares = np.zeros((PROBES, n)), np.zeros(PROBES), np.zeros((len(reaches), PROBES))
    for i in range(PROBES):
        x[i] = rng.normal(size=n) * 10.0 ** rng.uniform(*STATE_DECADES, size=n)
        u[i] = rng.normal() * 10.0 ** rng.uniform(*INPUT_DECADES)
        shares[:, i] = [rng.uniform(*reach) for reach in reaches]
    return _Drawn(x, u, shares, rng)


def _reach(prog, node) -> tuple[float, float] | None:
    """Return where in its gap the other body of a mechanism may be, or beyond; None without a gap."""
    joint = prog.ints[node[L.AUX] + L.A_JOINT]
    two = prog.ints[node[L.AUX] + L.A_BODIES] == 2
    if not two or joint == L.J_RIGID or not prog.par[node[L.PAR] + L.P_GAP] > 0:
        return None
    return (0.0, 1.0) if joint == L.J_IMPACT else (-1.0, 2.0)


def _mechanisms(prog):
    return [node for node in prog.nodes if node[L.KIND] == L.MECHANISM]


def powers(engine: Engine) -> np.ndarray:
    """Return `Symmetries.power` of a compiled system."""
    power = np.zeros(engine.nstates, int)
    for node in _mechanisms(engine.program):
        bodies = int(engine.program.ints[node[L.AUX] + L.A_BODIES])
        places = node[L.X] + 2 * np.arange(bodies)
        power[places], power[places + 1] = 2, 1
    return power


def autonomous(engine: Engine) -> bool:
    """Whether the rates of a compiled system do not depend on time itself."""
    probe = Probe(engine)
    return _autonomous(probe, probe.samples())


def find_symmetries(engine: Engine, block=None, sizes: Sizes | None = None) -> Symmetries:
    """Ask the laws of a compiled system for its symmetries; `block` tells over which lengths they repeat."""
    n, prog, probe = engine.nstates, engine.program, Probe(engine, sizes)
    transform = np.eye(n)
    lower, upper = np.full(n, -np.inf), np.full(n, np.inf)
    low, high, gaps = lower.copy(), upper.copy(), np.zeros(n)
    free, positions, inertial = np.ones(n, bool), np.zeros(n, bool), np.zeros(n, bool)
    wrap, shifts = np.zeros(n), []
    samples = probe.samples()
    for node in _mechanisms(prog):
        at, aux, par = node[L.X], node[L.AUX], node[L.PAR]
        bodies, joint = prog.ints[aux + L.A_BODIES], prog.ints[aux + L.A_JOINT]
        places = np.arange(at, at + 2 * bodies, 2)
        if bodies == 2:
            m0, m1 = prog.par[par + L.P_M0], prog.par[par + L.P_M0 + 1]
            transform[at + 1, [at + 1, at + 3]] = m0 / (m0 + m1), m1 / (m0 + m1)
            transform[at + 2, at] = transform[at + 3, at + 1] = -1.0
            if joint == L.J_RIGID:
                free[at + 2 : at + 4] = False
            gaps[at] = -prog.par[par + L.P_GAP]
            if joint == L.J_IMPACT:
                lower[at + 2], upper[at + 2] = 0.0, prog.par[par + L.P_GAP]
        stopped = prog.ints[aux + L.A_STOP] == 1
        if stopped:
            low[places[-1]], high[places[-1]] = prog.par[par + L.P_LOW], prog.par[par + L.P_HIGH]
        direction = np.zeros(n, bool)
        direction[places] = True
        if not stopped and _unmoved(
            probe, samples, direction, probe.rng.normal() * SHIFTS["place"] * probe.sizes.states[at]
        ):
            free[at] = False
            positions[places] = True
            shifts.append(direction)
            speeds = np.zeros(n, bool)
            speeds[places + 1] = True
            if _unmoved(probe, samples, speeds, SHIFTS["speed"] * probe.sizes.states[at + 1], direction):
                free[at + 1] = False
                inertial[at + 1] = True
        elif not stopped:
            for length in _wavelengths(block):
                if _unmoved(probe, samples, direction, length, tol=RIPPLED):
                    wrap[at] = length
    mine = np.zeros(n, bool)
    for node in _mechanisms(prog):
        mine[node[L.X] : node[L.X] + 2 * prog.ints[node[L.AUX] + L.A_BODIES]] = True
    for i in np.flatnonzero(~mine):
        direction = np.arange(n) == i
        if _unmoved(probe, samples, direction, SHIFTS["state"] * probe.sizes.states[i]):
            free[i] = False
            positions[i] = True
            shifts.append(direction)
    offset, odd = np.zeros(n), False
    for trial in (gaps, _on_motor(gaps)) if np.any(gaps) else (gaps,):
        if _is_odd(probe, samples, trial):
            offset, odd = trial, True
            break
    return Symmetries(
        transform, np.linalg.inv(transform), odd, offset, np.flatnonzero(free), wrap, positions, inertial,
        lower, upper, low, high, powers(engine), _autonomous(probe, samples), shifts,
    )  # fmt: skip


def _unmoved(probe, samples, direction, shift, rate=None, tol=ALIKE):
    """Whether a shift of some states changes no margin and no rate (but `rate`, which shifts along)."""
    other, other_g, _ = probe.at_all(samples.x + shift * direction, samples.u)
    expected = samples.dx if rate is None else samples.dx + shift * rate
    return _close(other, expected, tol) and _close(other_g, samples.g, tol)


def _is_odd(probe, samples, offset):
    finite = np.all(np.isfinite(samples.dx), axis=1)
    x, u, dx, g, y = (column[finite] for column in samples)
    other, other_g, other_y = probe.at_all(offset - x, -u)
    if not (len(x) and _close(other, -dx) and _close(other_g, g)):
        return False
    return bool(np.any(offset)) or _close(other_y, -y)


def _on_motor(gaps):
    """Return the mirror about the load instead of the motor."""
    offset = np.zeros_like(gaps)
    at = np.flatnonzero(gaps)
    offset[at + 2] = -gaps[at]
    return offset


def _autonomous(probe, samples):
    half = PROBES // 2
    times = probe.rng.uniform(1, 100, half) / probe.sizes.rate
    return _close(probe.at_all(samples.x[:half], samples.u[:half], times)[0], samples.dx[:half])


def _close(a, b, tol=ALIKE):
    """Whether two arrays (m, n) agree, column by column: their units differ."""
    finite = np.isfinite(b)
    if not np.array_equal(finite, np.isfinite(a)):
        return False
    a, b = np.where(finite, a, 0.0), np.where(finite, b, 0.0)
    size = np.abs(b)
    return bool(np.all(np.abs(a - b) <= tol * size + FEW_ROUNDED * np.max(size, axis=0, initial=0.0)))


def _wavelengths(block):
    effects = getattr(block, "effects", ()) if isinstance(block, Mechanism) else ()
    return sorted({length for e in effects for length in e.periods()}, reverse=True)
