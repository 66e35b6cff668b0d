"""A block under a periodic force: compiled, one input, one output, its laws known by size of motion."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import control as ct
import numpy as np

from ...blocks.mechanism import Mechanism
from ...simulate.engine import Engine, harmonic_drive
from ...simulate.program import layout, pointers
from ...status import Status
from ...thresholds import NOTHING
from ..thresholds import BINS, FAMILIAR, SHIFTS, SIZING_STEPS
from ..transparent import without_shifts
from .kernel.period_map import PeriodMap, make_period_map
from .linear_orbit import LinearOrbit, linear_orbit
from .symmetries import Probe, Sizes, Symmetries, autonomous, find_symmetries, powers


@dataclass(frozen=True, eq=False)
class Laws:
    """What the laws of a block say for motions of some size.

    Attributes
    ----------
    sizes : Sizes
        Of the motions.
    symmetries : Symmetries
    period_map : PeriodMap
        Over a period, or half of one; its arrays are the workspace of all shots.
    free_row : bool
        Whether the output described shifts with a free position.
    linear : LinearOrbit or None
        The orbit in closed form, where the laws are linear.
    """

    sizes: Sizes
    symmetries: Symmetries
    period_map: PeriodMap
    free_row: bool
    linear: LinearOrbit | None

    @property
    def odd(self) -> bool:
        """Whether they are odd, so that half a period may tell the whole one."""
        return self.symmetries.odd

    def reset(self) -> None:
        """Clear the workspace of what it keeps from orbit to orbit: Jacobian, sizes, step."""
        self.forget_jacobian()
        self.period_map.size[:] = 0.0
        self.period_map.clock[:] = 0.0  # the step of the last run: a line must not depend on the one before

    def forget_jacobian(self) -> None:
        """Let the next orbit begin with a Jacobian of its own."""
        self.period_map.jacobian[:] = np.nan


class DrivenBlock:
    """One block with one input, compiled, and what is known of it.

    Parameters
    ----------
    block : ct.NonlinearIOSystem or LTI system
        One input.
    output : str or int
        Output described, the first by default.

    Attributes
    ----------
    engine : Engine
        Of the block without its pure delays and offsets.
    row : int
        Index of the output described.
    delay, offset : float
        Of the input and this output: they turn the phase and move the mean, outside the simulation.
    mechanisms : list
        Nodes of the program.
    inertia : float
        Sum of all of them, 1 without a mechanism.
    power : (n,) int array
        As in `Symmetries`.
    quantized, gap, contacts : bool
        Whether it has a quantizer, a joint with a gap, bodies that can hit something.
    """

    def __init__(self, block, output=None):
        self.block = block
        if block.ninputs != 1:
            raise ValueError(
                f"a describing function needs one input; {block.name} has {block.ninputs}. "
                "Fix the others inside the block."
            )
        self.row = _row(block, output)
        self.delay, self.offset = 0.0, 0.0
        inner = ct.ss(block) if isinstance(block, ct.TransferFunction) else block
        if isinstance(block, Mechanism):
            # delays turn the phase, offset and drift move the mean: all exactly, outside the simulation
            inner, self.delay, late, offset = without_shifts(block)
            if self.row == 0:
                self.delay, self.offset = self.delay + late, offset
        self.engine = Engine(inner)
        prog = self.engine.program
        if np.any(prog.nodes[:, layout.KIND] == layout.SAMPLED):
            raise ValueError(
                f"forced periodic orbits need continuous time; {block.name} holds a sampled system, whose "
                "ticks have no common period with the forcing. Take its continuous equivalent here."
            )
        pointers.raised.clear()
        self.mechanisms = [n for n in prog.nodes if n[layout.KIND] == layout.MECHANISM]
        self.inertia = sum(
            prog.par[n[layout.PAR] + b] for n in self.mechanisms for b in range(prog.ints[n[layout.AUX]])
        ) or 1.0  # fmt: skip
        self.quantized = bool(np.any(prog.nodes[:, layout.KIND] == layout.QUANTIZER))
        self.gap = any(prog.par[n[layout.PAR] + layout.P_GAP] > 0 for n in self.mechanisms)
        self.contacts = self.gap or any(
            prog.ints[n[layout.AUX] + layout.A_STOP] == 1 for n in self.mechanisms
        )
        self.power = powers(self.engine)
        self._check(autonomous(self.engine))
        self._known: dict[tuple, Laws] = {}

    def laws_for(self, A: float, omega: float, near: Laws | None = None) -> Laws:
        """Return the laws for motions under a force of this size.

        `near` is returned if its motions are not far from them. Without it the result depends on the size
        alone.
        """
        sizes = Sizes(self.free_motion(A, omega), A, omega)
        if near is not None and near.sizes.near(sizes, FAMILIAR):
            return near
        about = tuple(BINS * round(math.log10(max(size, NOTHING)) / BINS) for size in (A, omega))
        if about not in self._known:
            self._known[about] = self._laws_about(*(float(10.0**x) for x in about))
        return self._known[about]

    def free_motion(self, A, omega):
        """Return the size of each state in the motion of a free inertia under the force."""
        return A / (np.where(self.power > 0, self.inertia, 1.0) * omega**self.power)

    def longest_step(self, orders: int) -> float:
        """Longest step in periods: ten quadrature nodes a step must hold the highest harmonic.

        Impacts are located on the interpolant of a step, which is less exact than its end.
        """
        return min(1 / 16 if self.contacts else 1 / 8, 9 / 8 / orders)

    def rates(self, x, force=0.0):
        """Return the rates of the states at x."""
        return Probe(self.engine).at(x, force)[0]

    def raise_if_raised(self):
        """Raise what a law has raised within compiled code."""
        if pointers.raised:
            error = pointers.raised[0]
            pointers.raised.clear()
            raise user_error(self.block, error)

    def _laws_about(self, force, rate):
        free = self.free_motion(force, rate)
        laws = self._laws(Sizes(self._sized(free, force, rate), force, rate))
        return replace(laws, sizes=Sizes(free, force, rate))

    def _sized(self, states, force, rate):
        """Return sizes of states, those that belong to no mechanism as large as they get in a few periods."""
        beside = self.power == 0
        if not beside.any():
            return states
        run = self.engine.run(
            self.engine.start(),
            6 * np.pi / rate,
            harmonic_drive([[0.0, force]], rate),
            max_steps=SIZING_STEPS,
        )
        seen = np.maximum(np.abs(run.state.x), self.engine.space.size)
        pointers.raised.clear()
        return np.where(beside & (seen > 0), seen, states) if np.all(np.isfinite(seen)) else states

    def _laws(self, sizes: Sizes) -> Laws:
        """Find the symmetries of the laws for motions of such sizes, and what follows from them."""
        s = find_symmetries(self.engine, self.block, sizes)
        self._check(s.autonomous)
        period_map = make_period_map(self.engine, s, self.row + 1)
        free_row = self._row_is_free(s, sizes)
        return Laws(sizes, s, period_map, free_row, linear_orbit(self.engine, s, self.row, free_row))

    def _check(self, timeless):
        if not timeless:
            raise ValueError(
                "a describing function needs laws that do not depend on time itself; "
                f"those of {self.block.name} do. Make the time-dependent signal an input."
            )
        if pointers.raised and not np.any(np.isfinite(self.rates(np.zeros(self.engine.nstates)))):
            raise user_error(self.block, pointers.raised[-1])
        pointers.raised.clear()

    def _row_is_free(self, s, sizes):
        """Whether the output described shifts with a free position."""
        probe, x = Probe(self.engine), np.zeros(self.engine.nstates)
        at_zero = probe.at(x, 0.0)[2][self.row]
        size = sizes.states
        return any(probe.at(x + SHIFTS["output"] * size * d, 0.0)[2][self.row] != at_zero for d in s.shifts)


def user_error(block, error) -> RuntimeError:
    """Return the one error for a law that raises or returns NaN; Ctrl-C is none and goes on."""
    if not isinstance(error, Exception):
        raise error
    wrapped = RuntimeError(f"{Status.USER_ERROR} (block {block.name}: {error!r})")
    wrapped.__cause__ = error
    return wrapped


def _row(block, output) -> int:
    labels = list(block.output_labels)
    if output is None:
        return 0
    if isinstance(output, int | np.integer) and 0 <= output < len(labels):
        return int(output)
    if output in labels:
        return labels.index(output)
    raise ValueError(f"output must be one of {', '.join(labels)}; got {output!r}.")
