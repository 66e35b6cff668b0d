"""Starts for the simulations of a loop, measured by the scale at which its nonlinearity matters."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

from ...blocks.core import level
from ...blocks.elements.element import Element
from ...simulate.sampled import Sampled
from ...thresholds import HALVINGS, ROUNDED, SQRT_EPS
from .thresholds import (
    BENT,
    DECADES,
    FACTORS,
    INSIDE_STOPS,
    JUMP_HIDES,
    LAW_JUMPED,
    REAL_ROOT,
    SAMPLED_OMEGA,
    SAMPLED_POINTS,
    SAMPLED_SLOWEST,
)


class Starts:
    """Starts of one loop, by size.

    Parameters
    ----------
    loop : ct.NonlinearIOSystem
    engine : Engine

    Attributes
    ----------
    unit : str
        What a size is measured in: ``m`` of displacement, ``at the block's input``, or ``of every state``.
    scale : float
        The size at which the block's nonlinearity matters.
    omega : float
        A frequency at which the loop moves [rad/s].
    straight : float
        Input of an element or a law up to which it is a straight line (a law within a hundredth); 0 where
        that is not known, as for mechanisms, which may have friction on a scale of its own.
    """

    def __init__(self, loop, engine):
        self.loop, self.engine = loop, engine
        self.parts: Any = getattr(loop, "parts", None)
        self.block: Any = None if self.parts is None else self.parts.block
        self.core: Any = getattr(self.block, "core", None)
        self.straight = 0.0
        if self.core is not None:
            self.omega = corner_frequency(self.parts)
            self.scale, self.unit = self._length_scale(), self.block.coordinates.unit
        elif self.parts is not None:
            self.omega = _pole_frequency(self._controller())
            self.scale, self.straight = self._corner()
            self.unit = "at the block's input"
        else:
            self.omega, self.scale, self.unit = 1.0, 1.0, "of every state"

    def all(self, factors=FACTORS) -> list[tuple[float, np.ndarray]]:
        """(size, state) of every start, in the order in which they are tried; `factors` are of the scale."""
        return [(f * self.scale, self.state(f * self.scale)) for f in factors]

    def state(self, size: float) -> np.ndarray:
        """Return the start of a size: a displacement at rest, or what brings the block's input there."""
        if self.core is not None:
            return self._displaced(size)
        if self.parts is not None:
            return self._oscillating(size)
        return size * np.ones(self.engine.nstates)

    def _displaced(self, size):
        core, offset = self.core, self.loop.syslist[0].nstates or 0
        x = np.zeros(self.engine.nstates)
        x[offset] = size
        if core.bodies == 2:
            x[offset + 2] = size + 0.5 * core.gap
        if self.parts.block.output_labels.index(self.loop.output_labels[0]) % 2:
            # nothing drives a loop closed on the velocity back to a place
            x[offset + 1 : offset + 2 * core.bodies : 2] = size * self.omega
        if core.stop is not None:
            low, high = core.stop.span
            places = slice(offset, offset + 2 * core.bodies, 2)
            x[places] = np.clip(x[places], INSIDE_STOPS * low, INSIDE_STOPS * high)
        return x

    def _oscillating(self, size):
        """States of the linear part as a harmonic output of the block leaves them, its input that large."""
        x = np.zeros(self.engine.nstates)
        states, output = self._harmonic_response()
        if not isinstance(self.block, Element):
            x[self.loop.syslist[0].nstates or 0 :] = size  # nothing is known of the states of a user's system
        if output != 0:
            x[: len(states)] = np.real(size * states / output)
        return x

    def _harmonic_response(self) -> tuple[np.ndarray, complex]:
        """States and output of the linear part under a harmonic input of size one at the loop's frequency."""
        a, b, c, dt = self._controller()
        z = np.exp(1j * self.omega * dt) if dt else 1j * self.omega
        states = np.linalg.solve(z * np.eye(len(a)) - a, b[:, :1]).ravel()
        return states, complex((c[:1] @ states)[0])

    def _controller(self):
        controller = self.loop.syslist[0]
        if isinstance(controller, Sampled):
            a, b, c, _, dt = controller.sampled
            return a, b, c, dt
        if isinstance(controller, ct.StateSpace) and controller.nstates:
            return *(np.asarray(m, float) for m in (controller.A, controller.B, controller.C)), 0.0
        return np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 0.0

    def _corner(self) -> tuple[float, float]:
        """Input at which an element or a law bends, and `straight`.

        Of one that jumps at zero the former is what its jump drives.
        """
        primitive = getattr(self.block, "primitive", None)
        corners = [abs(corner) for corner in getattr(primitive, "corners", ())]
        step = getattr(primitive, "step", 0.0)
        size = max([*corners, step, getattr(primitive, "gap", 0.0)])
        if size > 0:
            return size, 0.0 if self.block.nstates else min([*corners, 0.5 * step] if step else corners)
        if self.block.nstates:
            return 1.0, 0.0
        least = 10.0 ** DECADES[0]
        law = self._law
        gain = self._gain()
        jump = 0.5 * abs(law(least) - law(-least))
        if jump > JUMP_HIDES * abs(law(LAW_JUMPED * least)):
            return jump * gain or 1.0, 0.0
        bend = _bend(law, 1 / gain if gain else 0.0)
        return bend or 1.0, bend or 0.0

    def _gain(self) -> float:
        """Gain of the linear part at the loop's frequency."""
        return abs(self._harmonic_response()[1])

    def _law(self, u) -> float:
        return float(
            np.squeeze(np.asarray(self.block.outfcn(0.0, np.zeros(0), np.array([u]), self.block.params))[0])
        )

    def _length_scale(self) -> float:
        """Displacement at which the block's nonlinearity matters [m]."""
        core = self.core
        stiffness = sum(core.masses) * self.omega**2
        scales = [core.gap, sum(level(chain, 0.0, 1.0, 0.0) for chain in core.friction) / stiffness]
        for element, _ in core.input_channel:
            scales += [abs(c) / stiffness for c in getattr(element, "corners", ())]
            scales.append(getattr(element, "step", 0.0) / stiffness)
        scales += [getattr(element, "step", 0.0) for element, _ in core.output_channel]
        if core.stop is not None:
            scales.append(0.5 * (core.stop.span[1] - core.stop.span[0]))
        if max(scales) > 0:
            return max(scales)
        return self._smooth_scale() or 1.0

    def _smooth_scale(self):
        """Displacement at which a smooth law adds a share of the loop's own stiffness."""
        n, mass = self.block.nstates, sum(self.core.masses)

        def force(place, speed):
            x = np.zeros(n)
            x[0 : 2 * self.core.bodies : 2], x[1 : 2 * self.core.bodies : 2] = place, speed
            dx = np.asarray(self.block.updfcn(0.0, x, np.zeros(1), self.block.params), float)
            return mass * dx[2 * self.core.driven + 1]

        stiffness = mass * self.omega**2
        bends = [_bend(lambda x: stiffness * x + force(x, 0.0))]
        slow = _bend(lambda v: stiffness / self.omega * v + force(0.0, v))
        bends.append(None if slow is None else slow / self.omega)
        known = [b for b in bends if b]
        return min(known) if known else None


def _bend(law, least=0.0):
    """Smallest argument at which a law leaves its tangent at zero, by a share of its slope or `least`."""

    def secant(u):
        try:
            with np.errstate(all="ignore"):
                return (law(u) - law(0.0)) / u
        except Exception:  # a law of the user's may raise beyond its range: there it is not asked
            return np.nan

    straight = secant(10.0 ** DECADES[0])
    if not np.isfinite(straight):
        return None
    for u in 10.0**DECADES:
        slope = secant(u)
        if not np.isfinite(slope):
            return None
        if np.isfinite(slope) and abs(slope - straight) > BENT * max(abs(straight), least):
            low, high = u / 10.0, u
            for _ in range(HALVINGS):  # to the argument itself: decades belong to a unit
                middle = np.sqrt(low * high)
                now = secant(middle)
                if abs(now - straight) > BENT * max(abs(straight), least):
                    high = middle
                else:
                    low = middle
            return float(high)
    return None


def _pole_frequency(controller) -> float:
    """Geometric mean of the pole frequencies of a linear part [rad/s]."""
    a, _, _, dt = controller
    if not len(a):
        return 1.0
    poles = np.linalg.eigvals(a)
    if dt:
        poles = np.log(poles[np.abs(poles) > ROUNDED]) / dt
    sizes = np.abs(poles)
    sizes = sizes[sizes > SQRT_EPS * sizes.max(initial=0.0)]
    return float(np.exp(np.mean(np.log(sizes)))) if sizes.size else (1.0 if not dt else SAMPLED_OMEGA / dt)


def corner_frequency(parts) -> float:
    """Highest frequency at which the controller balances the block's inertia, |H(jw)| = m w^2 [rad/s].

    A loop closed on the velocity has its corner elsewhere, for which this serves as well as a scale.
    """
    mass = sum(parts.block.core.masses)
    controller: Any = parts.controller
    if isinstance(controller, int | float):
        controller = ct.tf([float(controller)], [1.0])
    dt = float(getattr(controller, "dt", 0) or 0)
    if not dt:
        rational: Any = ct.tf(controller)
        num, den = (np.asarray(p[0][0], float) for p in (rational.num, rational.den))
        gap = np.polysub(_power(num), mass**2 * np.concatenate([_power(den), [0.0, 0.0, 0.0, 0.0]]))
        roots = np.roots(np.trim_zeros(gap, "f"))
        real = roots[(np.abs(roots.imag) < REAL_ROOT * np.abs(roots)) & (roots.real > 0)].real
        return float(real.max()) if real.size else 1.0
    omega = np.geomspace(SAMPLED_SLOWEST, 1.0, SAMPLED_POINTS) * np.pi / dt
    gain = np.abs(np.asarray(controller(np.exp(1j * omega * dt))).ravel())
    above = gain > mass * omega**2
    return float(omega[np.flatnonzero(above)[-1]]) if above.any() else float(omega[0])


def _power(p):
    """Coefficients of |p(jw)|^2 as a polynomial of w."""
    n = len(p) - 1
    rotated = p * (1j ** np.arange(n, -1, -1))
    return np.real(np.polymul(rotated, np.conj(rotated)))
