"""The search for one forced periodic orbit: transient, Newton's method, and what to try when it fails."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import control as ct
import numpy as np

from ...blocks.mechanism import Mechanism
from ...blocks.transparent import without_shifts
from ...simulate.engine import Engine, State, harmonic_drive
from ...simulate.kernel import driver
from ...simulate.program import layout, pointers
from ...simulate.program.layout import EVENT_KINDS
from ...simulate.thresholds import FAR
from ...status import Status
from ..threads import go_on
from ..thresholds import (
    ACQUAINT_STEPS,
    AT_ONCE,
    BINS,
    BLOCKS,
    COARSE,
    FAMILIAR,
    FIRST_STEP,
    KNOCKED,
    KNOCKS,
    LINEAR,
    NAN_AHEAD,
    NOTHING,
    NUDGE,
    NUDGED,
    PUSHED,
    RTOL,
    RUNS_AWAY,
    SETTLED_AT_FIRST,
    SETTLED_AT_LAST,
    SETTLED_BETTER,
    SHIFTS,
    SHOTS_ALONE,
    SIZE_AT_FIRST,
    WITHIN,
)
from . import shooting
from .linear_orbit import LinearOrbit, linear_orbit
from .newton import differentiate_of
from .period_map import PeriodMap, apply, iterate, make_period_map, set_state
from .shooting import CLOSED, SPENT, UNSTABLE, solve_periodic
from .symmetries import Probe, Sizes, Symmetries, find_symmetries


@dataclass(frozen=True, eq=False)
class _Laws:
    """What the laws say for motions of some size."""

    sizes: Sizes
    symmetries: Symmetries
    shot: PeriodMap
    free_row: bool
    linear: LinearOrbit | None


BIT = {name: 1 << i for i, name in enumerate(EVENT_KINDS)}
TOUCH = BIT["impact"] | BIT["contact"] | BIT["release"]


class OrbitSearch:
    """Finds forced periodic orbits of one block; `ctrl_df.df.forced_orbit.orbits` names them.

    Parameters
    ----------
    block : ct.NonlinearIOSystem or LTI system
        One input.
    output : str or int
        Output described, the first by default.
    transient, averages, max_steps : int
        As in `ctrl_df.df.forced_orbit.orbits.orbit_family`.
    """

    def __init__(self, block, output=None, *, transient=4, averages=64, max_steps=1_000_000):
        self.transient, self.averages, self.max_steps = (
            int(transient),
            max(int(averages), BLOCKS),
            int(max_steps),
        )
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
        self.atol = 0.0
        self.mirrored = self.repels = False
        self._about: tuple | None = None
        self._answers: dict[tuple, _Laws] = {}
        self._laws = self._asked(Sizes.ones(self.engine.nstates))
        self.forget()

    def _asked(self, sizes: Sizes) -> _Laws:
        """Find the symmetries of the laws for motions of such sizes, and what follows from them."""
        s = find_symmetries(self.engine, self.block, sizes)
        self._check(s)
        shot = make_period_map(self.engine, s, self.row + 1)
        free_row = self._row_is_free(s, sizes)
        return _Laws(sizes, s, shot, free_row, linear_orbit(self.engine, s, self.row, free_row))

    @property
    def symmetries(self) -> Symmetries:
        """Those of the laws for motions of the size aimed at."""
        return self._laws.symmetries

    @property
    def symmetric(self) -> bool:
        """Whether the laws are odd there."""
        return self.symmetries.odd

    @property
    def shot(self) -> PeriodMap:
        """The map over a period, or half of one."""
        return self._laws.shot

    @property
    def free_row(self) -> bool:
        """Whether the output described shifts with a free position."""
        return self._laws.free_row

    @property
    def linear(self) -> LinearOrbit | None:
        """The orbit in closed form, where the laws are linear."""
        return self._laws.linear

    def acquaint(self, A, omega, whatever_before=False) -> bool:
        """Ask the laws about motions of this size, unless they were asked about ones not far from it.

        With `whatever_before` what they were asked before makes no difference: answers do not depend on it.
        Returns whether they were asked: what is known of orbits is then forgotten.
        """
        if not whatever_before and self._laws.sizes.near(Sizes(self._motion(A, omega), A, omega), FAMILIAR):
            return False
        about = tuple(BINS * round(math.log10(max(size, NOTHING)) / BINS) for size in (A, omega))
        if about == self._about:
            return False
        if about not in self._answers:
            force, rate = (float(10.0**x) for x in about)
            states = self._motion(force, rate)
            # states that belong to no mechanism are as large as they get in a few periods
            run = self.engine.run(
                self.engine.start(),
                6 * np.pi / rate,
                harmonic_drive([[0.0, force]], rate),
                max_steps=ACQUAINT_STEPS,
            )
            seen = np.maximum(np.abs(run.state.x), self.shot.space.size)
            pointers.raised.clear()
            if np.all(np.isfinite(seen)):
                states = np.where((self.symmetries.power == 0) & (seen > 0), seen, states)
            laws = self._asked(Sizes(states, force, rate))
            power = laws.symmetries.power
            self._answers[about] = replace(laws, sizes=Sizes(self._motion(force, rate, power), force, rate))
        self._about, self._laws = about, self._answers[about]
        self.forget()
        return True

    def _motion(self, A, omega, power=None):
        """Return the size of each state in the motion of a free inertia under the force."""
        power = self.symmetries.power if power is None else power
        return A / (np.where(power > 0, self.inertia, 1.0) * omega**power)

    def _check(self, s):
        if not s.autonomous:
            raise ValueError(
                "a describing function needs laws that do not depend on time itself; "
                f"those of {self.block.name} do. Make the time-dependent signal an input."
            )
        if pointers.raised and not np.any(np.isfinite(self._rates(np.zeros(self.engine.nstates)))):
            raise user_error(self.block, pointers.raised[-1])
        pointers.raised.clear()

    def _rates(self, x, force=0.0):
        return Probe(self.engine).at(x, force)[0]

    def _row_is_free(self, s, sizes):
        """Whether the output described shifts with a free position."""
        probe, x = Probe(self.engine), np.zeros(self.engine.nstates)
        at_zero = probe.at(x, 0.0)[2][self.row]
        size = sizes.states
        return any(probe.at(x + SHIFTS["output"] * size * d, 0.0)[2][self.row] != at_zero for d in s.shifts)

    def forget(self):
        """Forget orbits found before: their Jacobian, their size, their step."""
        self.repels = False
        self.shot.jacobian[:] = np.nan
        self.shot.size[:] = 0.0
        self.shot.clock[:] = 0.0  # the step of the last run: a line must not depend on the one before

    # --- the search -----------------------------------------------------------------------------------------

    def aim(self, U, omega) -> bool:
        """Set the force ``Re sum U_k exp(j k omega t)`` that orbits are sought under; as `acquaint`."""
        A = float(abs(U[1]))
        asked = self.acquaint(A, omega)
        self.A, self.omega, self.period, self.budget = A, omega, 2 * np.pi / omega, self.max_steps
        self.drive = harmonic_drive([U], omega)
        self.unit = self._motion(A, omega)
        return asked

    def longest_step(self, orders):
        """Longest step in periods: ten quadrature nodes a step must hold the highest harmonic.

        Impacts are located on the interpolant of a step, which is less exact than its end.
        """
        return min(1 / 16 if self.contacts else 1 / 8, 9 / 8 / orders)

    def at_rest(self, A):
        """At rest, a joint off its faces; the sizes of the states from the motion of a free inertia."""
        n = self.engine.nstates
        y = np.zeros(n)
        for node in self.mechanisms:
            if self.engine.program.ints[node[layout.AUX]] == 2:
                y[node[layout.X] + 2] = WITHIN * self.engine.program.par[node[layout.PAR] + layout.P_GAP]
        state = self.state_at(y)
        self.resize(A)
        return state

    def resize(self, A):
        """Take the sizes of a free inertia under the force for those of the motion."""
        n = self.engine.nstates
        self.shot.space.size[:] = (
            SIZE_AT_FIRST * A / self.inertia / self.omega**self.symmetries.power if self.mechanisms else 0.0
        )
        self.shot.size[:n] = 0.0
        self.shot.scale[:] = 0.0
        self.shot.jacobian[:] = np.nan

    def forget_flight(self):
        """Forget what states that Newton's method tried have grown to, where the last one ran away."""
        if self.shot.tally[4] != driver.DONE:
            self.resize(self.A)

    def state_at(self, y, mode=None):
        """State at coordinates y."""
        x, mode = np.zeros(len(y)), self.engine.modes.copy() if mode is None else mode.copy()
        set_state(self.shot.at, np.array(y, float), x, mode)
        return State(0.0, x, mode)

    def nudged(self, state):
        """Return the state a little off: no motion stays on a repelling orbit by the grace of rounding."""
        y = self.symmetries.transform @ state.x
        y[self.symmetries.free] += NUDGE * self.shot.size[self.symmetries.free]
        return self.state_at(y, state.mode)

    def iterate(self, state, periods, rtol=COARSE):
        """Return the state after some periods (twice as many shots where mirrored)."""
        state = state.copy()
        self.trail(state, periods * 2 if self.mirrored else periods, rtol)
        return state

    def trail(self, state, shots, rtol=RTOL):
        """Coordinates before each of some shots of the state, in place."""
        trail = np.empty((shots, len(state.x)))
        for first in range(0, shots, AT_ONCE):
            self._some(state, trail[first : first + AT_ONCE], rtol, (0.0, 0.0))
        return trail

    def _some(self, state, trail, rtol, settled):
        """Take some shots of the state, in place; return how many, and after how many it repeats.

        Zero: it does not yet. `settled`: within what it has to, after one shot and after two.
        """
        reason, spent, done, repeats = iterate(
            self.shot.at, self.drive, self._span(1), state.x, state.mode, self.mirrored, rtol, self.atol,
            self.longest_step(1) * self.period, FIRST_STEP * self.period, self.budget, trail, *settled,
        )  # fmt: skip
        self.budget -= spent
        self._checked(reason, state)
        return done, repeats

    def followed(self, state, periods, orders):
        """Follow the state, in place, for some periods, and close its orbit where it seems to have settled.

        It is tried as well each time the motion has been followed twice as long as before, unless the last
        orbit closed repels. Returns state and mismatch of an attracting orbit, or None. A motion that repeats
        after two half periods, and not after one, is closed as what it is; `mirrored` then says so.
        """
        settled, shots = [SETTLED_AT_FIRST] * 2, 2 if self.mirrored else 1
        left, wait = shots * periods, shots * max(self.transient, 1)
        ahead = wait  # shots to the next attempt, settled or not
        while left > 0:
            trail = np.empty((min(left, ahead, AT_ONCE), len(state.x)))
            done, repeats = self._some(state, trail, COARSE, settled)
            left, ahead = left - done, ahead - done
            if repeats == 0 and left > 0 and ahead > 0:
                continue
            alternates = repeats == 2
            if repeats > 0 and settled[alternates] > 0:
                settled[alternates] *= SETTLED_BETTER if settled[alternates] > SETTLED_AT_LAST else 0.0
            if alternates and not self.mirrored:
                continue
            if ahead == 0:
                wait = ahead = 2 * wait
                if self.repels and repeats == 0 and left > 0:
                    continue  # there is an orbit here that the motion leaves: it has to settle first
            self.mirrored = self.mirrored and not alternates
            orbit = self.periodic(state, orders=orders)
            if orbit is not None:
                return orbit
            self.mirrored = self.mirrored or alternates
        return None

    def _checked(self, reason, state):
        go_on()
        self.raise_if_raised()
        if reason != driver.DONE or self.budget <= 0 or not np.all(np.isfinite(state.x)):
            raise self._stopped(reason, state)

    def shoot(self, state, rtol=RTOL, periods=1, spectrum=None):
        """One shot of the state, in place."""
        shot = self.shot
        orders = 1 if spectrum is None else spectrum.shape[1] - 1
        if not 0.0 < shot.clock[2] <= 5 * FIRST_STEP * self.period:
            shot.clock[2] = FIRST_STEP * self.period
        reason = apply(
            shot.at, self.drive, self._span(periods), state.x, state.mode, self.mirrored, rtol, self.atol,
            self.longest_step(orders) * self.period, shot.no_spectrum if spectrum is None else spectrum,
            self.budget,
        )  # fmt: skip
        self.budget -= int(shot.clock[3])
        self._checked(reason, state)
        return int(shot.tally[2])

    def differentiated(self, state, missed, rtol, periods, relative):
        """Take the Jacobian of a shot, kept in `shot`, by central differences; False where one ran off."""
        shot, before = self.shot, self.shot.tally[1]
        done = differentiate_of(
            shot.at, self.drive, self._span(periods), state.x, state.mode, missed, self.mirrored, rtol,
            self.atol, self.longest_step(1) * self.period, self.budget, FIRST_STEP * self.period, relative,
        )  # fmt: skip
        self.budget -= int(shot.tally[1] - before)
        go_on()
        raised = bool(pointers.raised)
        if raised and not isinstance(pointers.raised[0], Exception):
            self.raise_if_raised()
        pointers.raised.clear()
        if self.budget <= 0:
            raise OutOfWork(Status.WORK_LIMIT)
        return done and not raised

    def _span(self, periods):
        return self.period / 2 if self.mirrored else periods * self.period

    def periodic(self, state, periods=1, orders=9, *, repelling=False, near=False):
        """Newton on the shot; (state, mismatch) of an attracting orbit, or None; its integrals are kept.

        With `repelling` any orbit will do; one that is `near` the last one begins with its Jacobian.
        """
        state, shot = state.copy(), self.shot
        spectrum = np.zeros((self.row + 1, orders + 1), complex)
        if not near:
            shot.jacobian[:] = np.nan
        shot.clock[2] = FIRST_STEP * self.period
        outcome, miss = solve_periodic(
            shooting.address(), shot.at, self.drive, self._span(periods), state.x, state.mode,
            self.mirrored, RTOL, self.atol, self.longest_step(orders) * self.period, spectrum,
            self.budget, SHOTS_ALONE, False,
        )  # fmt: skip
        self.repels = outcome == UNSTABLE
        self.budget -= int(shot.clock[3]) * 4
        go_on()
        self.raise_if_raised()
        if outcome == SPENT:
            raise self._stopped(driver.STEPS, state)
        self.forget_flight()
        if outcome != CLOSED and not (repelling and outcome == UNSTABLE):
            return None
        if not self.mirrored:
            self._check_free_speed(shot.trial[1])
        if self.quantized:  # the harmonics of the centred motion
            self.shoot(state.copy(), RTOL, periods, spectrum)
        self._keep(spectrum)
        return state, miss

    def measure(self, state, periods, orders, rtol):
        """One shot of a closed orbit, for its integrals, ends and event kinds."""
        spectrum = np.zeros((self.row + 1, orders + 1), complex)
        end = state.copy()
        self.shoot(end, rtol, periods, spectrum)
        self._check_free_speed(self.symmetries.transform @ (end.x - state.x))
        self._keep(spectrum)

    def _keep(self, spectrum):
        self.integrals, self.ends = spectrum[self.row], self.shot.ends[:, self.row].copy()
        self.kinds, self.still = int(self.shot.tally[2]), bool(self.shot.tally[5])

    def _check_free_speed(self, step):
        """Raise where a speed that nothing ties to the ground has changed: something pushes the mechanism.

        The force itself does so where it has a mean.
        """
        if self.mirrored or self.drive.harmonics[0, 0] != 0:
            return
        gained = np.abs(step[self.symmetries.inertial])
        if np.max(gained, initial=0.0) > PUSHED * self.A / (self.inertia * self.omega):
            raise OutOfWork(Status.DIVERGED)

    def touching(self, orders):
        """Look for an orbit whose bodies touch, for a block found swinging freely within its gap.

        A motion without contact coexists with others at moderate force and is what a centred start leads
        to. Returns the orbit or None, and a state from which the bodies keep touching or None.
        """
        prog, keeps = self.engine.program, None
        node = next(m for m in self.mechanisms if prog.par[m[layout.PAR] + layout.P_GAP] > 0)
        at, gap = node[layout.X], prog.par[node[layout.PAR] + layout.P_GAP]
        speed = gap * self.omega + self.A / (prog.par[node[layout.PAR] + layout.P_M0 + 1] * self.omega)
        for face, leaving in KNOCKS:
            self.mirrored = self.symmetric
            y = np.zeros(self.engine.nstates)
            y[at + 2], y[at + 3] = face * gap, leaving * speed
            self.resize(self.A)
            state = self.iterate(self.state_at(y), KNOCKED)
            if not self.shot.tally[2] & TOUCH:
                continue
            orbit = self.periodic(state, orders=orders)
            if orbit is None and self.symmetric:
                self.mirrored = False
                state = self.iterate(self.nudged(state), NUDGED)
                if not self.shot.tally[2] & TOUCH:
                    continue
                orbit = self.periodic(state, orders=orders)
            if orbit is not None and self.kinds & TOUCH:
                return orbit, state
            if orbit is None:
                keeps = state if keeps is None else keeps
        return None, keeps

    def stop_if_running_away(self, y):
        """Raise where a state grows out of all bounds, or a free body steadily gains speed."""
        half, y = len(y) // 2, y / self.unit
        late, early = RUNS_AWAY
        if np.max(np.abs(y[-1])) > late * np.max(np.abs(y[half])) > early * np.max(np.abs(y[0])):
            raise OutOfWork(Status.DIVERGED)
        s = self.symmetries
        for i in range(len(s.power)):
            if s.power[i] != 1 or not s.positions[i - 1]:
                continue
            early, late = y[half, i] - y[0, i], y[-1, i] - y[-1 - half, i]
            spread = np.max(np.abs(np.diff(y[:, i]) - early / half))
            if abs(early) > LINEAR and abs(late / early - 1) < LINEAR and spread < 0.5 * abs(early / half):
                raise OutOfWork(Status.DIVERGED)

    # --- what was found -------------------------------------------------------------------------------

    def coefficients(self):
        """Return the Fourier coefficients Y_k of the orbit of one period that was found last."""
        return self.turned(self.fourier(self.integrals, self.ends, 1, self.mirrored))

    def fourier(self, integrals, ends, periods, mirrored, omega=None):
        """Fourier coefficients from the integrals of a shot, free of a steady drift and of a free mean.

        The last axis of `integrals` are the harmonics, that of `ends` the start and the end; `omega`, the one
        aimed at by default, may belong to many shots.
        """
        omega = np.asarray(self.omega if omega is None else omega)[..., None]
        period, k = 2 * np.pi / omega, np.arange(integrals.shape[-1])
        if mirrored:
            y = 4 / period * integrals
            center = 0.5 * (ends[..., 0] + ends[..., 1])
            # the integral of a constant over half a period is 2 / (j k omega)
            y[..., 1::2] -= center[..., None] * (4 / np.pi / (1j * k[1::2]))
            y[..., 0::2] = 0.0
            y[..., 0] = center
        else:
            y = integrals * 2 / (periods * period)
            drift = ends[..., 1] - ends[..., 0]
            y[..., 0] = y[..., 0] / 2 - drift / 2
            y[..., 1:] -= 1j * drift[..., None] / (np.pi * k[1:] * periods)
        if self.free_row:
            y[..., 0] = 0.0
        return y

    def turned(self, y, omega=None):
        """Delays turn the phase of every harmonic."""
        omega = np.asarray(self.omega if omega is None else omega)[..., None]
        y = y * np.exp(-1j * np.arange(y.shape[-1]) * omega * self.delay) if self.delay else y.copy()
        y[..., 0] += 0.0 if self.free_row else self.offset
        return y

    # --- how a search can fail ------------------------------------------------------------------------

    def raise_if_raised(self):
        """Raise what a law has raised within compiled code."""
        if pointers.raised:
            error = pointers.raised[0]
            pointers.raised.clear()
            raise user_error(self.block, error)

    def _stopped(self, reason, state):
        """Return what to raise for a run that ended early."""
        if reason in (driver.STEPS, driver.DONE, driver.CHATTER, driver.FULL):
            return OutOfWork(Status.WORK_LIMIT)
        x = state.x
        if np.all(np.isfinite(x)) and np.max(np.abs(x), initial=0.0) < FAR:
            force = self.A * np.cos(self.omega * self.shot.clock[0])
            with np.errstate(all="ignore"):
                slope = self._rates(x, force)
                ahead = self._rates(x + slope * NAN_AHEAD * self.period, force)
            pointers.raised.clear()
            if not (np.all(np.isfinite(slope)) and np.all(np.isfinite(ahead))):
                return user_error(self.block, ValueError(f"a law returned NaN or inf near the state {x}"))
        return OutOfWork(Status.DIVERGED)


def user_error(block, error) -> RuntimeError:
    """Return the one error for a law that raises or returns NaN; Ctrl-C is none and goes on."""
    if not isinstance(error, Exception):
        raise error
    wrapped = RuntimeError(f"{Status.USER_ERROR} (block {block.name}: {error!r})")
    wrapped.__cause__ = error
    return wrapped


class OutOfWork(Exception):
    """A point's search ended: the state ran away, or the bound on work was hit."""

    def __init__(self, status):
        super().__init__(str(status))
        self.status = status
        self.regime = "diverged" if status is Status.DIVERGED else "work limit"


def _row(block, output) -> int:
    labels = list(block.output_labels)
    if output is None:
        return 0
    if isinstance(output, int | np.integer) and 0 <= output < len(labels):
        return int(output)
    if output in labels:
        return labels.index(output)
    raise ValueError(f"output must be one of {', '.join(labels)}; got {output!r}.")
