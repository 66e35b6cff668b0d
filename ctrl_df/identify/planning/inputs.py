"""The input over time that separates candidates best: a few shapes, as large as the limits allow."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace

import numpy as np

from ...blocks.coordinates import moving_in
from ...numerals import digits
from ..estimation.thresholds import SCREEN_SAMPLES
from ..prediction.segments import facts, facts_of
from ..prediction.sensed import POSITION, place_unit, sensed
from ..prediction.simulator import free_run
from ..results.experiment import Experiment, separated
from .thresholds import (
    PLAN_BAND,
    PLAN_LEAST,
    PLAN_MARGIN,
    PLAN_MOVES,
    PLAN_PEAK,
    PLAN_PERIOD,
    PLAN_SINES,
    PLAN_SIZES,
    PLAN_SLACK,
    PLAN_SMOOTH,
    PLAN_STEP_RATE,
    PLAN_STEP_SIZES,
    PLAN_STEPS,
    PLAN_TRIANGLE,
)


def input_that_separates(
    diagnosis, models, names, *, force=None, stroke=None, duration=None, dt=None, loop=None
) -> Experiment:
    """Return the input whose outputs differ most between any two of the models, within the limits.

    Parameters
    ----------
    diagnosis : Diagnosis
    models : sequence of block
        Two or more.
    names : tuple of str
        What is separated.
    force, stroke : float or None
        Largest input, and largest distance from the start; None: what the records reached, and twice the
        stroke of the first.
    duration, dt, loop
        As for `next_experiment`.
    """
    record = diagnosis.train[0]
    long, strong = place_unit(record), record.input_unit
    words = moving_in(long)
    noise = facts(record).noise  # of the output; what remained may be of accelerations
    force = float(force or np.max(np.abs(record.u)) or facts_of(models[0], record).drive)
    place = facts(record).place
    centre = float(place[0])
    reach = float(stroke or 2 * np.max(np.abs(place - centre)))
    duration, dt = float(duration or record.duration), float(dt or record.dt)
    if not (force > 0 and reach > 0 and duration > PLAN_LEAST * dt):
        raise ValueError(
            f"next_experiment needs {words.force} > 0, {words.reach} > 0 and duration > {PLAN_LEAST} dt; got "
            f"{force}, {reach}, {duration}, {dt}."
        )
    t = dt * np.arange(int(round(duration / dt)))
    play = (
        _Free(models, record, t, centre, reach, force)
        if loop is None
        else _Loop(models, loop, record, t, centre, noise, reach)
    )
    sized = [(kind, size * shape) for kind, shape in play.shapes.items() for size in PLAN_SIZES]
    best, still = None, 0
    for level, size in play.ranges:
        inputs = [(kind, level + size * shape) for kind, shape in sized]
        best, still = most_separating(play, inputs, t, noise, (PLAN_MARGIN * reach * PLAN_SLACK, force))
        if best is not None:
            break
    if best is None and still == len(sized):
        raise ValueError(
            f"no model of {separated(names)} moves under ±{force:g} {strong}, though the machine did in "
            "these records: its friction or inertia is far too large. Give better values, or leave them free."
        )
    if best is None:
        raise ValueError(
            f"every input tried leaves the range of ±{reach:g} {long} ({words.reach}), needs more than "
            f"{force:g} {strong} or moves nothing. Allow more of either, or give loop= (a closed_loop whose "
            "controller holds the drive in place)."
        )
    what = (
        f"{best.kind} of up to {digits(best.force)} {strong}"
        if loop is None
        else f"reference as {best.kind}, {digits(best.force)} {strong}"
    )
    reason = (
        f"{what}: the outputs of {separated(names)} then differ by at least {digits(best.separation, 2)} "
        f"times the noise, within {digits(best.stroke)} {long} of the centre."
    )
    return replace(best, candidates=names, reason=reason)


def most_separating(play, inputs, t, noise, most) -> tuple[Experiment | None, int]:
    """Return the input that separates best, and how many move nothing.

    Parameters
    ----------
    play : callable
        ``play(u)``: outputs of the models, the largest distance and force, and how far the outputs of any
        two of them differ (rms).
    inputs : list of (str, (n,) array)
        Kinds, and values at the times `t` (n,).
    noise : float
        Of the output.
    most : (float, float)
        Largest distance and force.
    """
    best, best_moves, still = None, False, 0
    for kind, u in inputs:
        ys, far, asked, gaps = play(u)
        if not np.isfinite(far) or far > most[0] or asked > most[1]:
            continue
        spans = [float(np.ptp(y)) for y in ys]
        if max(spans) <= noise:
            still += 1
            continue
        separation = min(gaps) / noise
        # a record in which nothing may move teaches one bit, one in which all candidates move their shape
        moves = min(spans) > PLAN_MOVES * max(spans)
        if best is None or (moves, separation) > (best_moves, best.separation):
            best_moves, best = moves, Experiment(t, u, kind, (), separation, far, "", (), asked)
    return best, still


class _Free:
    """Plays a force on every model.

    Attributes
    ----------
    shapes : dict of str to (n,) array
        Inputs of peak one.
    ranges : tuple of (float, float)
        Level and largest deviation of inputs: about no force, or about the mean one of the record, which
        holds a machine that works on a spring or under its weight.
    """

    def __init__(self, models, record, t, centre, reach, force):
        self.models, self.record, self.t, self.centre = models, record, t, centre
        mean = float(np.mean(record.u))
        self.shapes, self.ranges = _shapes(t, record), ((0.0, force), (mean, force - abs(mean)))
        self.scale = centre + reach * np.linspace(-1, 1, len(t))  # tells the simulator how far outputs may go

    def __call__(self, u):
        decimation = max(1, len(self.t) // SCREEN_SAMPLES)
        played = _played(self.record, self.t, u, self.scale)
        ys = [free_run(m, played, position=self.centre, decimation=decimation) for m in self.models]
        gaps = [_apart(self.record, self.t, a - b) for i, a in enumerate(ys) for b in ys[i + 1 :]]
        return ys, _farthest(ys, self.centre), float(np.max(np.abs(u))), gaps


class _Loop:
    """Plays a reference on the loop of every model with the given controller.

    A good controller hides the differences of the models in their positions; they are in the force. What
    counts is therefore how far one model, driven by the force that another would be given, is from the
    other's position. `shapes` and `ranges` are as those of `_Free`, of the reference.
    """

    def __init__(self, models, loop, record, t, centre, noise, reach):
        from ...simulate.loop import closed_loop

        parts = getattr(loop, "parts", None)
        if parts is None:
            raise TypeError(
                f"loop must come from ctrl_df.closed_loop; got {type(loop).__name__}. Build it from a "
                "controller and the block."
            )
        self.models, self.record, self.centre = models, record, centre
        self.shapes, self.ranges = references(t, record), ((centre, PLAN_MARGIN * reach),)
        self.moves = parts.block.coordinates
        self.loops = [closed_loop(parts.controller, m, parts.dt) for m in models]
        self.t = t[:: max(1, len(t) // SCREEN_SAMPLES)]
        self.decimation = max(1, len(t) // SCREEN_SAMPLES)
        # The controller passes the noise of the sensor on to the drive.
        self.noise_peak = PLAN_PEAK * noise * _fastest_gain(parts.controller, parts.dt or float(t[1] - t[0]))

    def __call__(self, u):
        from ...simulate.response import event_response

        ys, forces = [], []
        for loop in self.loops:
            # a drive at rest at `centre`: its reference is relative to that
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", RuntimeWarning)  # its status tells the same
                    found = event_response(loop, self.t, (u - self.centre)[:: self.decimation])
            except (ValueError, RuntimeError):
                return [], math.inf, math.inf, [0.0]
            if not found.status.ok:
                return [], math.inf, math.inf, [0.0]
            labels: list[str] = list(found.output_labels or ())
            outputs = dict(zip(labels, np.atleast_2d(np.asarray(found.outputs)), strict=True))
            ys.append(self.centre + outputs[self.moves.name("x")])
            forces.append(outputs[self.moves.name("F")])
        gaps = []
        for i, force in enumerate(forces):
            played = _played(self.record, self.t, force, ys[i]).replaced(input_hold="linear")
            runs = [free_run(m, played, position=self.centre) for m in self.models]
            gaps += [_apart(self.record, self.t, y - runs[i]) for k, y in enumerate(runs) if k != i]
        asked = max(float(np.max(np.abs(f))) for f in forces) + self.noise_peak
        return ys, _farthest(ys, self.centre), asked, gaps


def _farthest(ys, centre: float) -> float:
    return max(float(np.max(np.abs(y - centre))) for y in ys)


def _played(record, t, u, place):
    """Return a record of the place that an input is to make."""
    return record.replaced(t=t, u=u, outputs={"position": place}, velocity=None, channels={})


def _apart(record, t, difference) -> float:
    """Return the rms difference of what the record's leading output would be, of two places."""
    return _rms(difference if sensed(record).columns[0] == POSITION else np.gradient(difference, t))


def _fastest_gain(controller, dt: float) -> float:
    """Return a controller's gain at the highest frequency that samples `dt` [s] apart hold; 0 if improper.

    A discrete controller has ticks of its own: its highest frequency is z = exp(j pi) = -1.
    """
    if not _proper(controller):  # its derivative acts on the velocity, whose noise is not stated
        return 0.0
    return abs(complex(controller(-1.0 if controller.isdtime(strict=True) else 1j * math.pi / dt)))


def _proper(controller) -> bool:
    import control as ct

    if not isinstance(controller, ct.TransferFunction):
        return isinstance(controller, ct.StateSpace)
    return len(np.trim_zeros(controller.num[0][0], "f")) <= len(np.trim_zeros(controller.den[0][0], "f"))


def _rms(values) -> float:
    return math.sqrt(float(np.mean(np.square(values))))


def references(t, record):
    """Return references of peak one that begin at rest and turn no faster than the records did."""
    period = max(facts(record).period, PLAN_PERIOD[0] * (t[1] - t[0]))
    half = max(int(round(PLAN_SMOOTH * period / (t[1] - t[0]))), 1)
    window = np.hanning(2 * half + 1)
    fade = np.sin(0.5 * math.pi * np.clip((t - t[0]) / period, 0, 1)) ** 2
    found = {}
    for kind, shape in _shapes(t, record).items():
        smooth = np.convolve(np.pad(shape, half, mode="edge"), window / window.sum(), "valid") * fade
        found[kind] = smooth / np.max(np.abs(smooth))
    return found


def _shapes(t, record):
    """Return inputs of peak one, each ending its motion near where it began."""
    f0 = 1.0 / max(facts(record).period, PLAN_PERIOD[1] * (t[1] - t[0]))
    span, (lowest, many, highest) = t[-1] + t[1], PLAN_BAND
    rng = np.random.default_rng(0)
    k = np.unique(np.round(np.geomspace(max(lowest * f0 * span, 1), many * f0 * span, PLAN_SINES)))
    sum_of_sines = np.sum(
        np.sin(2 * math.pi * k[:, None] * t / span + rng.uniform(0, 2 * math.pi, len(k))[:, None]), axis=0
    )
    low, high = lowest * f0, highest * f0
    rate = math.log(high / low)
    chirp = np.sin(2 * math.pi * low * span / rate * (np.exp(rate * t / span) - 1))
    least, more = PLAN_STEP_SIZES
    # each period + - - +: neither speed nor place is left over
    quarter = np.floor(4 * t * PLAN_STEP_RATE * f0) % 4
    pulses = (
        np.where((quarter == 0) | (quarter == 3), 1.0, -1.0)
        * (least + more * rng.uniform(size=PLAN_STEPS))[
            np.floor(t * PLAN_STEP_RATE * f0).astype(int) % PLAN_STEPS
        ]
    )
    triangle = 2 / math.pi * np.arcsin(np.cos(2 * math.pi * PLAN_TRIANGLE * f0 * t))
    return {
        "multisine": sum_of_sines / np.max(np.abs(sum_of_sines)),
        "chirp": chirp,
        "steps": pulses,
        "triangle": triangle,
    }
