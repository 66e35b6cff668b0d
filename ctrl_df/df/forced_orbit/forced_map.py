"""The period map of one block under one force, its evaluations (shots), and how they can fail."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...simulate.engine import State, harmonic_drive
from ...simulate.kernel.run import reasons
from ...simulate.program import layout, pointers
from ...simulate.program.layout import Drive
from ...simulate.thresholds import STATE_MOST
from ...status import Status
from ..threads import go_on
from ..thresholds import (
    DRIFTS,
    FIRST_STALE,
    FIRST_STEP,
    NAN_AHEAD,
    RTOL_FOLLOWED,
    RTOL_SHOTS,
    SHOTS_AT_ONCE,
    SIZE_AT_FIRST,
    WITHIN_GAP,
)
from .driven_block import DrivenBlock, Laws, user_error
from .kernel.newton import differentiate_of
from .kernel.period_map import apply, iterate, set_state, with_own_sizes


class OutOfWork(Exception):
    """A point's search ended: the state ran away, or the bound on work was hit."""

    def __init__(self, status):
        super().__init__(str(status))
        self.status = status
        self.regime = "diverged" if status is Status.DIVERGED else "work limit"


@dataclass(frozen=True)
class Force:
    """The force ``Re sum U_k exp(j k omega t)`` on the block.

    Attributes
    ----------
    drive : Drive
        As the engine takes it.
    A, omega : float
        Amplitude of the fundamental, frequency [rad/s].
    """

    drive: Drive
    A: float
    omega: float

    @classmethod
    def of(cls, U, omega: float) -> Force:
        """Return the force with coefficients U_k, k = 0, 1, ..."""
        return cls(harmonic_drive([U], omega), float(abs(U[1])), omega)

    @property
    def period(self) -> float:
        """Of the force [s]."""
        return 2 * np.pi / self.omega


@dataclass
class Work:
    """Counter of the integration steps that are left for one point; all its shots draw on it."""

    left: int

    def spend(self, steps: int) -> None:
        """Take off what a shot has cost."""
        self.left -= steps


class Image(NamedTuple):
    """Where the map takes a state, the kinds of events on the way (bits), and the output at both ends."""

    end: State
    kinds: int
    ends: np.ndarray


class Iterates(NamedTuple):
    """What some shots in a row led to.

    Attributes
    ----------
    samples : (done, n) array
        Coordinates before each shot.
    end : State
    kinds : int
        Kinds of events in the last one (bits).
    done, repeats : int
        How many there were, and after how many the motion repeats; 0: it does not yet.
    """

    samples: np.ndarray
    end: State
    kinds: int
    done: int
    repeats: int


@dataclass(frozen=True, eq=False)
class ForcedMap:
    """The period map of a block under a force, over whole periods or over half of one.

    Attributes
    ----------
    block : DrivenBlock
    laws : Laws
        Those for motions of this size.
    force : Force
    work : Work
    mirrored : bool
        Whether a shot takes half a period and its end is mirrored.
    """

    block: DrivenBlock
    laws: Laws
    force: Force
    work: Work
    mirrored: bool = False

    def over(self, *, mirrored: bool) -> ForcedMap:
        """Return the map over half a period, mirrored, or over whole ones."""
        return replace(self, mirrored=mirrored)

    def with_own_sizes(self) -> ForcedMap:
        """Return the map with sizes of coordinates apart from those of other orbits, and none known yet."""
        return replace(self, laws=replace(self.laws, period_map=with_own_sizes(self.laws.period_map)))

    @property
    def a_period(self) -> int:
        """How many shots there are in a period."""
        return 2 if self.mirrored else 1

    def span(self, periods: int = 1) -> float:
        """Time [s] of a shot over so many periods of the force."""
        return self.force.period / 2 if self.mirrored else periods * self.force.period

    def longest_step(self, orders: int) -> float:
        """Longest step [s] where harmonics up to `orders` are integrated."""
        return self.block.longest_step(orders) * self.force.period

    # --- states -----------------------------------------------------------------------------------

    def state_at(self, y, mode=None) -> State:
        """State at coordinates y."""
        x = np.zeros(len(y))
        mode = self.block.engine.modes.copy() if mode is None else mode.copy()
        set_state(self.laws.period_map.at, np.array(y, float), x, mode)
        return State(0.0, x, mode)

    def at_rest(self) -> State:
        """At rest, a joint off its faces; sizes are those of a free inertia."""
        y = np.zeros(self.block.engine.nstates)
        prog = self.block.engine.program
        for node in self.block.mechanisms:
            if prog.ints[node[layout.AUX]] == 2:
                y[node[layout.X] + 2] = WITHIN_GAP * prog.par[node[layout.PAR] + layout.P_GAP]
        state = self.state_at(y)
        self.reset_sizes()
        return state

    def reset_sizes(self) -> None:
        """Take the sizes of a free inertia under the force for those of the motion."""
        block, at = self.block, self.laws.period_map
        at.space.size[:] = (
            SIZE_AT_FIRST * self.force.A / block.inertia / self.force.omega**block.power
            if block.mechanisms
            else 0.0
        )
        at.size[: block.engine.nstates] = 0.0
        at.scale[:] = 0.0
        self.laws.forget_jacobian()

    def reset_failed(self) -> None:
        """Reset sizes where the last run failed: states that Newton's method tried have grown out of them."""
        if self.laws.period_map.tally[4] != reasons.DONE:
            self.reset_sizes()

    # --- shots ------------------------------------------------------------------------------------

    def apply(self, state: State, rtol: float = RTOL_SHOTS, periods: int = 1, spectrum=None) -> Image:
        """Take one shot; integrals of the outputs against the harmonics go to `spectrum` (rows, orders+1)."""
        at, period = self.laws.period_map, self.force.period
        state, orders = state.copy(), 1 if spectrum is None else spectrum.shape[1] - 1
        if not 0.0 < at.clock[2] <= FIRST_STALE * FIRST_STEP * period:
            at.clock[2] = FIRST_STEP * period
        reason = apply(
            at.at, self.force.drive, self.span(periods), state.x, state.mode, self.mirrored, rtol, 0.0,
            self.longest_step(orders), at.no_spectrum if spectrum is None else spectrum, self.work.left,
        )  # fmt: skip
        self.work.spend(int(at.clock[3]))
        self._check(reason, state)
        return Image(state, int(at.tally[2]), at.ends[:, self.block.row].copy())

    def iterates(self, state: State, most: int, rtol: float = RTOL_SHOTS, settled=(0.0, 0.0)) -> Iterates:
        """Take some shots in a row.

        `settled`: relative change after one shot, and after two, within which the motion repeats and is left.
        """
        samples = np.empty((most, len(state.x)))
        at, state, done, repeats = self.laws.period_map, state.copy(), 0, 0
        while done < most and not repeats:
            some = samples[done : done + SHOTS_AT_ONCE]
            reason, spent, count, repeats = iterate(
                at.at, self.force.drive, self.span(), state.x, state.mode, self.mirrored, rtol, 0.0,
                self.longest_step(1), FIRST_STEP * self.force.period, self.work.left, some, *settled,
            )  # fmt: skip
            self.work.spend(spent)
            self._check(reason, state)
            done += count
        return Iterates(samples, state, int(at.tally[2]), done, repeats)

    def after(self, state: State, periods: int, rtol: float = RTOL_FOLLOWED) -> State:
        """State after some periods."""
        return self.iterates(state, self.a_period * periods, rtol).end

    def jacobian(self, state: State, missed, rtol: float, periods: int, relative: float) -> np.ndarray | None:
        """Return the Jacobian by central differences; None where a shot ran away."""
        at = self.laws.period_map
        jacobian = np.empty_like(at.jacobian)
        before = at.tally[1]
        done = differentiate_of(
            at.at, self.force.drive, self.span(periods), state.x, state.mode, missed, jacobian,
            self.mirrored, rtol, 0.0, self.longest_step(1), self.work.left, FIRST_STEP * self.force.period,
            relative,
        )  # fmt: skip
        self.work.spend(int(at.tally[1] - before))
        go_on()
        raised = bool(pointers.raised)
        if raised and not isinstance(pointers.raised[0], Exception):
            self.block.raise_if_raised()
        pointers.raised.clear()
        if self.work.left <= 0:
            raise OutOfWork(Status.WORK_LIMIT)
        return jacobian if done and not raised else None

    # --- how they fail ----------------------------------------------------------------------------

    def check_free_speed(self, step) -> None:
        """Raise where a speed that nothing ties to the ground has changed: something pushes the mechanism.

        The force itself does so where it has a mean.
        """
        if self.mirrored or self.force.drive.harmonics[0, 0] != 0:
            return
        gained = np.abs(step[self.laws.symmetries.inertial])
        if np.max(gained, initial=0.0) > DRIFTS * self.force.A / (self.block.inertia * self.force.omega):
            raise OutOfWork(Status.DIVERGED)

    def stopped(self, reason, state: State) -> Exception:
        """Return what to raise for a run that ended early."""
        if reason in (reasons.STEPS, reasons.DONE, reasons.CHATTER, reasons.FULL):
            return OutOfWork(Status.WORK_LIMIT)
        x = state.x
        if np.all(np.isfinite(x)) and np.max(np.abs(x), initial=0.0) < STATE_MOST:
            force = self.force.A * np.cos(self.force.omega * self.laws.period_map.clock[0])
            with np.errstate(all="ignore"):
                slope = self.block.rates(x, force)
                ahead = self.block.rates(x + slope * NAN_AHEAD * self.force.period, force)
            pointers.raised.clear()
            if not (np.all(np.isfinite(slope)) and np.all(np.isfinite(ahead))):
                return user_error(
                    self.block.block, ValueError(f"a law returned NaN or inf near the state {x}")
                )
        return OutOfWork(Status.DIVERGED)

    def _check(self, reason, state):
        go_on()
        self.block.raise_if_raised()
        if reason != reasons.DONE or self.work.left <= 0 or not np.all(np.isfinite(state.x)):
            raise self.stopped(reason, state)
