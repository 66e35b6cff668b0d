"""An integrator of its own for loops of straight lines: exact matrix exponentials between located corners.

It shares nothing with the engine: the loop is written as affine modes ``dx/dt = M x + c`` with guards, the
flow of a mode is a matrix exponential, a guard is met by bisection.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

_PIECES = 2000  # a lap is looked at so finely for guards


class Affine:
    """A loop of affine modes."""

    def __init__(self, modes):
        """`modes`: name -> (M, c, [(row, constant, next mode or callable)]); a guard falls below zero."""
        self.modes = modes

    def flow(self, mode, x, t):
        """Return the state after t seconds in a mode."""
        M, c, _ = self.modes[mode]
        n = len(x)
        big = np.zeros((n + 1, n + 1))
        big[:n, :n], big[:n, n] = M, c
        return (expm(big * t) @ np.append(x, 1.0))[:n]

    def _met(self, mode, x, h, row, constant, resolution):
        """Return the time within h at which a guard is met."""
        return brentq(
            lambda s: float(row @ self.flow(mode, x, s) + constant), 0.0, h, xtol=resolution, rtol=1e-15
        )

    def run(self, mode, x, span):
        """Follow the loop; returns the state at the end."""
        t, step, events = 0.0, span / _PIECES, 0
        while t < span and events < 2000:
            h = min(step, span - t)
            ahead = self.flow(mode, x, h)
            first, after = None, None
            for row, constant, following in self.modes[mode][2]:
                here, there = row @ x + constant, row @ ahead + constant
                if there < 0 <= here or (here < 0 and there < here):
                    at = self._met(mode, x, h, row, constant, 1e-15 * span) if here > 0 else 0.0
                    if first is None or at < first:
                        first, after = at, following
            if first is None:
                x, t = ahead, t + h
                continue
            x = self.flow(mode, x, first)
            t += first
            events += 1
            mode, x = after(x) if callable(after) else (after, x)
        return x


def lap_error(loop, orbit) -> float:
    """Return the mismatch after one period, relative to the size of each state; nan if not known."""
    block = loop.block
    x0 = np.asarray(orbit.states)[:, 0]
    size = np.maximum(np.abs(np.asarray(orbit.states)).max(axis=1), 1e-12 * np.abs(orbit.states).max())
    if loop.dt:
        return float("nan")
    if loop.family == "friction":
        return _friction(loop, orbit, x0, size)
    if loop.family == "gap":
        return _gap(loop, orbit, x0, size)
    controller = orbit.loop.syslist[0]
    A, B, C = (np.asarray(m, float) for m in (controller.A, controller.B, controller.C))
    lines = _lines(block)
    if lines is not None:
        modes = {}
        for i, (low, high, slope, intercept) in enumerate(lines):
            M, c = A - slope * B @ C, -B[:, 0] * intercept
            guards = []
            if np.isfinite(low):
                guards.append((C[0], -low, _next(lines, i, -1)))
            if np.isfinite(high):
                guards.append((-C[0], high, _next(lines, i, +1)))
            modes[i] = (M, c, guards)
        u = float(C[0] @ x0[: len(A)])
        inside = [i for i, (low, high, *_) in enumerate(lines) if low <= u <= high]
        best = np.inf
        for mode in inside:  # within a hysteresis both branches are possible
            x = Affine(modes).run(mode, x0[: len(A)], orbit.period)
            best = min(best, float(np.max(np.abs(x - x0[: len(A)]) / size[: len(A)])))
        return best
    if callable(block) and not hasattr(block, "kind"):
        law = block
        run = solve_ivp(lambda t, x: A @ x - B[:, 0] * law(float(C[0] @ x)), (0, orbit.period), x0, "DOP853",
                        rtol=1e-12, atol=1e-14 * size)  # fmt: skip
        return float(np.max(np.abs(run.y[:, -1] - x0) / size))
    return float("nan")


def _lines(block):
    law = getattr(block, "primitive", None)
    if law is None:
        return None
    if hasattr(law, "slope"):
        return list(zip(law.low, law.high, law.slope, law.intercept, strict=True))
    if hasattr(law, "step"):
        reach = range(-200, 201)
        return [((k - 0.5) * law.step, (k + 0.5) * law.step, 0.0, k * law.step) for k in reach]
    return None


def _next(lines, i, side):
    return min(max(i + side, 0), len(lines) - 1)


def _friction(loop, orbit, x0, size):
    p = loop.block.parameters
    m, b = p["mass"].value, p["viscous.coefficient"].value
    level = p["coulomb.level"].value
    static = p["stiction.level"].value if "stiction.level" in p else level
    kp, ki, kd = _gains(loop.H)
    # states: integral of -x, x, v
    scale = orbit.loop.syslist[0]
    gain = float(np.asarray(scale.C)[0, 0] * np.asarray(scale.B)[0, 0])
    z0 = np.array([x0[0] * float(np.asarray(scale.C)[0, 0]) / ki if gain else 0.0, x0[1], x0[2]])
    force = np.array([ki, -kp, -kd])
    modes = {}
    for d in (1, -1):
        M = np.array([[0, -1, 0], [0, 0, 1], [0, 0, 0]], float)
        M[2] = (force + [0, 0, -b]) / m
        c = np.array([0, 0, -d * level / m])

        def reversal(z, d=d):
            z = np.array([z[0], z[1], 0.0])
            f = force @ z
            if abs(f) <= static * (1 - 1e-13) if static > level else abs(f) <= level:
                return "stuck", z
            return (1 if f > 0 else -1), z

        modes[d] = (M, c, [(np.array([0, 0, float(d)]), 0.0, reversal)])
    M = np.array([[0, -1, 0], [0, 0, 0], [0, 0, 0]], float)
    modes["stuck"] = (M, np.zeros(3), [(-force, static, 1), (force, static, -1)])
    mode = "stuck" if x0[2] == 0 else (1 if x0[2] > 0 else -1)
    z = Affine(modes).run(mode, z0, orbit.period)
    sizes = np.array([size[0] * abs(z0[0] / x0[0]) if x0[0] else np.inf, size[1], size[2]])
    return float(np.max(np.abs(z - z0) / sizes))


def _gap(loop, orbit, x0, size):
    p = loop.block.parameters
    motor, load = p["motor_mass"].value, p["load_mass"].value
    gap, e = p["backlash.gap"].value, p["backlash.restitution"].value
    kp, ki, kd = _gains(loop.H)
    scale = float(np.asarray(orbit.loop.syslist[0].C)[0, 0])
    z0 = np.array([x0[0] * scale / ki, *x0[1:5]])  # integral, load x v, motor x v
    M = np.zeros((5, 5))
    M[0, 1], M[1, 2], M[3, 4] = -1, 1, 1
    M[4] = np.array([ki, -kp, -kd, 0, 0]) / motor

    def knock(z, high):
        z = z.copy()
        common = (load * z[2] + motor * z[4]) / (load + motor)
        back = -e * (z[4] - z[2])
        z[2], z[4] = common - motor / (load + motor) * back, common + load / (load + motor) * back
        z[3] = z[1] + (gap if high else 0.0)
        return 0, z

    row = np.array([0, -1, 0, 1, 0], float)
    modes = {
        0: (M, np.zeros(5), [(row, 0.0, lambda z: knock(z, False)), (-row, gap, lambda z: knock(z, True))])
    }
    if any(event.kind == "contact" for event in orbit.events):
        return float("nan")  # chatter that ends in contact: not written here
    z = Affine(modes).run(0, z0, orbit.period)
    sizes = np.array([max(size[0] * abs(scale / ki), 1e-300), *size[1:5]])
    return float(np.max(np.abs(z - z0) / sizes))


def _gains(H):
    num, den = np.asarray(H.num[0][0], float), np.asarray(H.den[0][0], float)
    if len(den) == 1:
        num, den = np.append(num, 0.0), np.append(den, 0.0)
    kd, kp, ki = num / den[0]
    return kp, ki, kd
