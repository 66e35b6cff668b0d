"""The steady answer of a block with dynamics to a periodic waveform that holds more than its fundamental."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...blocks.mechanism import Mechanism
from ...blocks.transparent import without_delays
from ...df.forced_orbit.symmetries import Sizes, find_symmetries
from ...simulate.engine import Engine, harmonic_drive
from ...simulate.program import layout

# Steps, delays and samplers answer small changes of the state with none, later, or at their ticks: no Newton.
_UNSUITED = (layout.QUANTIZER, layout.DELAY, layout.SAMPLED)
_CLOSED = 1e-8  # mismatch after a period, relative to the size of the motion
_FAMILIAR = 100.0  # factor between sizes of motions from which on the laws are asked anew
_DIFFERENCE = 1e-5  # step of difference quotients, relative to the size of a coordinate
RTOL = 1e-9


class WaveformOrbit:
    """Forced periodic motions of one block, each started from the one before.

    Under one force there may be several. Who follows one of them keeps `motion` and sets it again before
    going on from another point; without one, several starts are tried.

    Parameters
    ----------
    block : ct.NonlinearIOSystem
    output : str
        Output described.
    max_steps : int
        Bound on the work of one motion, in integration steps.

    Attributes
    ----------
    motion : State or None
        The motion last answered with, at t = 0.
    """

    def __init__(self, block, output, max_steps=60_000):
        self.row = list(block.output_labels).index(output)
        self.max_steps = max_steps
        self.motion = None
        self.core = block.core if isinstance(block, Mechanism) else None
        self.delay = 0.0
        if isinstance(block, Mechanism):
            # a pure delay only shifts a periodic answer; of the sensor's the position alone knows
            block, self.delay, late, _ = without_delays(block)
            self.delay += late if self.row == 0 else 0.0
        self.engine = Engine(block)
        kinds = self.engine.program.nodes[:, layout.KIND]
        self.suited = not np.isin(kinds, _UNSUITED).any()
        if self.suited:
            self.block = block
            self._ask(Sizes.ones(self.engine.nstates))

    def _ask(self, sizes: Sizes):
        """Ask the laws for their symmetries, about motions of such sizes."""
        self.sizes = sizes
        laws = find_symmetries(self.engine, self.block, sizes)
        self.autonomous, self.power = laws.autonomous, laws.power
        # a free mass may be anywhere, and has no mean position of its own
        self.adrift = self.core is not None and bool(laws.shifts)
        self.transform, self.inverse, self.kept = laws.transform, laws.inverse, laws.free

    def __call__(self, U, omega: float):
        """Return Y_k, k < len(U), for the input ``Re sum U_k exp(j k omega t)``, or None."""
        return next(self._answers(U, omega), None)

    def nearest(self, U, omega: float, apart: Callable, near: float):
        """Return of the answers from all starts the one least ``apart(Y)``; the first one `near`."""
        self.motion, best, least = None, None, np.inf
        motion = None
        for Y in self._answers(U, omega):
            if apart(Y) < least:
                best, least, motion = Y, apart(Y), self.motion
            if least < near:
                break
            self.motion = None
        self.motion = motion
        return best

    def _answers(self, U, omega):
        U = np.asarray(U, dtype=complex)
        if not self.suited:
            return
        self._acquaint(float(abs(U[1])), float(omega))
        if not self.autonomous:
            return
        self.omega, self.period, self.left = omega, 2 * np.pi / omega, self.max_steps
        self.drive = harmonic_drive([U], omega)
        for state in self._starts(float(abs(U[1]))):
            orbit = None if state is None else self._close(state)
            Y = None if orbit is None else self._harmonics(orbit, U.size)
            if Y is not None:
                self.motion = orbit
                yield Y

    def _acquaint(self, size, omega):
        """Ask the laws again where a motion is of another size than the one they were asked about."""
        inertia = np.where(self.power > 0, sum(self.core.masses) if self.core is not None else 1.0, 1.0)
        sizes = Sizes(size / (inertia * omega**self.power), size, omega)
        if not sizes.near(self.sizes, _FAMILIAR):
            self._ask(sizes)

    def _starts(self, size):
        """States to start from: the last motion; if there is none, rest, or a knock against a gap's faces."""
        gap = 0.0 if self.core is None else self.core.gap
        if self.motion is not None:
            yield self.motion
            if gap > 0:  # any other start may lead to another motion
                yield self._follow(self.motion, 20)
                return
        if self.core is None or gap == 0:
            for periods in (3, 30):
                yield self._follow(self.engine.start(), periods)
            return
        driven = size / (sum(self.core.masses) * self.omega)
        crossing = gap * self.omega / np.pi  # one gap in half a period: the two-impact motion
        for speed in (3.0 * driven, crossing, -crossing, 2.0 * crossing, -driven):
            x = np.zeros(self.engine.nstates)
            x[2], x[3] = 0.5 * gap, speed
            yield self._follow(self.engine.start(x), 20)

    def _follow(self, state, periods):
        for _ in range(periods):
            state = self._map(state)
            if state is None:
                return None
        return state

    def _map(self, state):
        """State after one period, its time back at zero; None where the run fails or the work is spent."""
        if self.left <= 0:
            return None
        start = state.copy()
        start.time, start.fresh = 0.0, True
        run = self.engine.run(
            start, self.period, self.drive, rtol=RTOL, max_step=self.period / 8, log=1, max_steps=self.left
        )
        self.left -= run.steps
        if not run.status.ok or not np.isfinite(run.state.x).all():
            return None
        run.state.time = 0.0
        return run.state

    def _close(self, state):
        """Newton on the period map, the Jacobian by differences, kept while it serves."""
        matrix, best = None, np.inf
        for _ in range(14):
            after = self._map(state)
            if after is None:
                return None
            before_y, after_y = self.transform @ state.x, self.transform @ after.x
            step = (after_y - before_y)[self.kept]
            size = self._sizes(before_y, after_y)
            mismatch = np.max(np.abs(step) / size[self.kept], initial=0.0)
            if mismatch < _CLOSED:
                return after
            if mismatch > 0.5 * best:
                matrix = None
            best = min(best, mismatch)
            if matrix is None:
                matrix = self._differences(state, after_y, size)
                if matrix is None:
                    return None
            scale = size[self.kept]
            relative = (np.eye(step.size) - matrix) * scale / scale[:, None]
            # directions that differences cannot tell from neutral ones (a steady travel) stay as they are
            change = scale * np.linalg.lstsq(relative, step / scale, rcond=10 * RTOL / _DIFFERENCE)[0]
            if not np.isfinite(change).all() or np.any(np.abs(change) > 3 * size[self.kept]):
                state, matrix = after, None
                continue
            target = before_y.copy()
            target[self.kept] += change
            state = self._at(target)
        return None

    def _sizes(self, one, other):
        """Sizes of the coordinates; speed and position of a body set each other's scale."""
        size = np.maximum(np.abs(one), np.abs(other))
        if self.core is not None:
            bodies = 2 * self.core.bodies
            drive = np.abs(self.drive.harmonics[0]).max() / (sum(self.core.masses) * self.omega)
            speed = max(size[1:bodies:2].max(), drive)
            size[1:bodies:2] = speed
            size[0:bodies:2] = np.maximum(size[0:bodies:2], speed / self.omega)
        return np.maximum(size, 1e-6 * size.max(initial=0.0) or 1.0)

    def _differences(self, state, after_y, size):
        base = self.transform @ state.x
        columns = []
        for i in self.kept:
            y = base.copy()
            y[i] += _DIFFERENCE * size[i] * (1 if base[i] <= 0 else -1)
            moved = self._at(y)
            h = (self.transform @ moved.x)[i] - base[i]
            after = self._map(moved) if h else None
            if after is None:
                return None
            columns.append((self.transform @ after.x - after_y)[self.kept] / h)
        return np.array(columns).T

    def _at(self, y):
        """Return a fresh state at coordinates y, kept within the gap and the stops."""
        x = self.inverse @ y
        if self.core is not None:
            if self.core.joint == "impact":
                x[2] = x[0] + min(max(x[2] - x[0], 0.0), self.core.gap)
            if self.core.stop is not None:
                low, high = self.core.stop.span  # pyright: ignore[reportAttributeAccessIssue]
                b = 2 * self.core.driven
                x[b] = min(max(x[b], low), high)
        return self.engine.start(x)

    def _harmonics(self, orbit, count):
        """Fourier coefficients over one period, free of a steady travel."""
        start = orbit.copy()
        start.time, start.fresh = 0.0, True
        spectrum = np.zeros((self.engine.noutputs, count), complex)
        ends = np.array([0.0, self.period])
        run = self.engine.run(
            start,
            self.period,
            self.drive,
            ends,
            rtol=RTOL,
            max_step=self.period / 8,
            spectrum=spectrum,
            omega=self.omega,
            max_steps=self.max_steps,
        )
        if not run.status.ok:
            return None
        Y = spectrum[self.row] * 2 / self.period
        travel = run.outputs[-1, self.row] - run.outputs[0, self.row]
        Y[1:] -= 1j * travel / (np.pi * np.arange(1, count))  # coefficients of the ramp travel t / period
        Y[0] = 0.0 if self.adrift else Y[0] / 2
        return Y * np.exp(-1j * self.omega * self.delay * np.arange(count))
