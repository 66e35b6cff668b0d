"""What a fitted model still misses, estimated by forces added to it.

Each kind adds forces of no particular law: over time, place, speed or load, after reversals, of the past of
the motion, at one frequency (bumps along the record, along the stroke, ...). Their effect on the output is
simulated, what the model's own parameters and initial states could do is projected out, and the residual is
regressed on the rest, whitened. A kind that explains more than chance tells that something is missing, and
where.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...blocks.coordinates import moving_in
from ...simulate.parallel import side_by_side
from ...thresholds import NOTHING
from ..estimation.fit import FitResult
from ..estimation.segmented import CandidateFit, SegmentedData
from ..estimation.sensitivity import OutputSensitivity
from ..prediction.segments import facts
from ..prediction.sensed import POSITION, force_scale, sensed
from ..shooting.noise_model import NoiseModel, noise_of_outputs, prediction_error_filter
from ..shooting.thresholds import NOISE_ORDER
from ..thresholds import BY_CHANCE, DEPENDENT
from .force_shapes import (
    HOW,
    acceleration,
    bump,
    direction,
    drive,
    grid,
    one,
    relaxing,
    since,
    size,
    speed,
    times,
    wave,
    within,
)
from .rounding import error_of_rounding, steps_of_outputs
from .thresholds import (
    FORCE_STEPS,
    FORCES_FINER,
    FORCES_TOGETHER,
    HUM_FINER,
    HUM_LEAST,
    HUM_WINDOW,
    NOISES_TRIED,
    RELAXATIONS,
    REVERSAL_REACHES,
    TEST_FORCE,
)

HUM = "frequency"
"""A sinusoidal force of unknown frequency: a sine and a cosine. A noise model can predict it as well."""


@dataclass(frozen=True)
class FittedForces:
    """Missing forces of one kind, fitted to a residual.

    Attributes
    ----------
    kind : str
        As in `ctrl_df.identify.residuals.regions`: time, position, low_speed, load, after_reversal,
        frequency; or acceleration, past_motion.
    evidence : float
        Log likelihood ratio [nats] less the penalty for the forces (Schwarz).
    rms : float
        Of the error these forces explain, and the model does not, in the unit of the fit's `rmse`.
    left : float
        Of the error that these forces do not explain either, in the same unit.
    span : (float, float)
        Where the force found is largest, in the unit of the kind.
    sentence : str
    by_rounding : float
        The rms that these forces explain, in the same unit, of what the sensors' rounding errs by, by chance
        once in 370; 0 where they do not round.
    """

    kind: str
    evidence: float
    rms: float
    left: float
    span: tuple[float, float]
    sentence: str
    by_rounding: float = 0.0


@dataclass(frozen=True, eq=False)
class _Family:
    """Forces of one kind, and what they change in the output.

    `how`: what they are in proportion to, in words; `matrix`: (n, forces), the changes; `spans`: where each
    force is.
    """

    kind: str
    how: str
    matrix: np.ndarray
    spans: Sequence[tuple[float, float]]

    @property
    def counted(self) -> int:
        """How many parameters they count as: a frequency is found by looking at many."""
        return self.matrix.shape[1] + (2 if self.kind == HUM else 0)


@dataclass(frozen=True, eq=False)
class _Residual:
    """What a model errs by, less what its own parameters and initial states could do.

    `rounding`: (n, k), errors that rounding of the sensors makes, likewise; `outputs`: how many there are;
    `units`: of place and force.
    """

    error: np.ndarray
    rounding: np.ndarray
    sensitivity: OutputSensitivity
    outputs: int
    units: Mapping[str, str]

    def noise_beside(self, explained: float | np.ndarray = 0.0) -> NoiseModel:
        """Return the noise model of what is left beside an error that is explained."""
        left = self.error - explained
        pieces = [left[w] for w in self.sensitivity.pieces]
        return noise_of_outputs(pieces, self.outputs, max_order=NOISE_ORDER)

    def fitted(self, families: Sequence[_Family], noise: NoiseModel) -> list[tuple[FittedForces, np.ndarray]]:
        """Fit the forces of each family; return what they tell, and the error that they explain."""
        beside = self.sensitivity.beside(noise)

        def whitened(x):
            return beside(noise.filtered(x, self.sensitivity.pieces))

        white = whitened(np.column_stack([self.error, self.rounding]))
        return [self._regressed(f, white, whitened(f.matrix)) for f in families]

    def _regressed(self, family: _Family, white, filtered) -> tuple[FittedForces, np.ndarray]:
        solved, *_ = np.linalg.lstsq(filtered, white, rcond=DEPENDENT)
        white, weights, matrix = white[:, 0], solved[:, 0], family.matrix
        left, count = white - filtered @ weights, len(white)
        gain = 0.5 * count * math.log(float(white @ white) / float(left @ left))
        gain -= 0.5 * family.counted * math.log(count)
        explained = matrix @ weights
        span = family.spans[int(np.argmax(np.linalg.norm(matrix * weights, axis=0)))]
        rms, rest = (float(np.sqrt(np.mean(e * e))) for e in (explained, self.error - explained))
        said = _SENTENCES[family.kind].format(*span, how=family.how, **self.units)
        sentence, by_rounding = moving_in(self.units["x"]).text(said), _by_chance(matrix, solved[:, 1:])
        return FittedForces(family.kind, gain, rms, rest, span, sentence, by_rounding), explained


def missing_forces(tried: CandidateFit, data: SegmentedData, noise: NoiseModel) -> list[FittedForces]:
    """Return every kind of missing force with what it explains, the most telling first."""
    sensitivity = tried.train.sensitivity
    if sensitivity is None:
        return []
    error = sensitivity.project(tried.train.residual)
    rounding = [sensitivity.project(e) for e in _rounding_errors(tried.train, data)]
    units = dict(zip("xf", facts(data.train.records[0]).units, strict=True))
    rounding = np.reshape(rounding, (len(rounding), len(error))).T
    residual = _Residual(error, rounding, sensitivity, tried.train.outputs, units)
    families = _families(_Scene(tried, data), sensitivity)
    if not families:
        return []
    # of disturbance forces the residual is one of forces, as the fits see it
    found = residual.fitted(families, residual.noise_beside() if data.disturbed else noise)
    # The noise is what the most telling kind leaves: structure would pass for noise of its own spectrum.
    count, own = len(error), residual.noise_beside()
    evidence = [
        # its own past predicts a hum, as that of noise a resonance: the spectrum that it leaves tells
        0.5 * (own.cost(count) - residual.noise_beside(explained).cost(count, family.counted))
        if family.kind == HUM
        else forces.evidence
        for family, (forces, explained) in zip(families, found, strict=True)
    ]
    found = residual.fitted(families, residual.noise_beside(found[int(np.argmax(evidence))][1]))
    unit, best = tried.train.unit, {}
    for forces, _ in sorted(found, key=lambda f: -f[0].evidence):
        sizes = dict(rms=forces.rms / unit, left=forces.left / unit, by_rounding=forces.by_rounding / unit)
        best.setdefault(forces.kind, replace(forces, **sizes))
    return list(best.values())


def _families(scene: _Scene, sensitivity: OutputSensitivity) -> list[_Family]:
    """Return the families of forces that change the output by more than the model's own parameters could.

    Of a kind with several families all their forces together are one more.
    """
    kinds, found = list(scene.kinds()), []
    shapes = [shape for _, families in kinds for _, family in families for shape, _ in family]
    together = [shapes[i : i + FORCES_TOGETHER] for i in range(0, len(shapes), FORCES_TOGETHER)]
    responses = side_by_side(lambda some: [sensitivity.project(r) for r in scene.responses(some)], together)
    changes = iter([change for some in responses for change in some])
    for kind, families in kinds:
        answers = [(how, [(next(changes), span) for _, span in family]) for how, family in families]
        if len(answers) > 1:
            answers.append(("", [a for _, family in answers for a in family]))
        for how, family in answers:
            alive = [
                (c, span)
                for c, span in family
                if np.linalg.norm(c) > DEPENDENT * scene.scale * math.sqrt(len(c))
            ]
            if alive:
                matrix = np.array([c for c, _ in alive]).T
                found.append(_Family(kind, how, matrix, [span for _, span in alive]))
    return found


def _by_chance(matrix, weights) -> float:
    """Return the rms of the output by which forces explain errors of rounding, by chance once in 370.

    So many of its values are independent as there are forces. `weights`: of the forces, by error.
    """
    if not weights.size:
        return 0.0
    usual = math.sqrt(float(np.mean(np.square(matrix @ weights))))
    return math.exp(BY_CHANCE / math.sqrt(matrix.shape[1])) * usual


_SENTENCES = {
    "time": "a force that varies over time{how}, largest between {0:.3g} and {1:.3g} s",
    "position": "a force that depends on the position{how}, largest between {0:.3g} and {1:.3g} {x}",
    "low_speed": "a force that depends on the velocity, of a form not in the library, largest between "
    "{0:.3g} and {1:.3g} {x}/s",
    "load": "a force that depends on the load{how}, largest between {0:.3g} and {1:.3g} {f}",
    "after_reversal": "a force that builds up after each reversal, over {1:.3g} {x}",
    HUM: "a force at one frequency, {0:.4g} Hz",
    "past_motion": "a force that relaxes after motion, over {1:.3g} s, as of a spring and a damper in series",
    "acceleration": "a force in proportion to the acceleration, up to {1:.3g} {x}/s^2, as inertia makes it",
}


def _rounding_errors(fit: FitResult, data: SegmentedData) -> list[list[np.ndarray]]:
    """Return what rounding of the outputs errs by, with grids at several places; nothing if none is rounded.

    Of a body that stands still it is the same from sample to sample, unlike noise.
    """
    steps = [steps_of_outputs(r) for r in data.train.records]
    if not np.any(np.concatenate(steps)):
        return []

    def of_record(y, segments, own, at) -> np.ndarray:
        parts = zip(segments.blocks, own, strict=True)
        return np.concatenate([error_of_rounding(y[block], step, at) for block, step in parts])

    records = list(zip(fit.simulated, data.train.segments, steps, strict=True))
    return [[of_record(*record, at) for record in records] for at in np.arange(NOISES_TRIED) / NOISES_TRIED]


class _Scene:
    """The motion the model makes, and its answer to small forces."""

    def __init__(self, tried, data):
        self.view, self.data = data.train, data
        self.fit = tried.train
        self.scale = data.scales.position
        self.size = TEST_FORCE * data.scales.force
        self.period = float(np.median([facts(r).period for r in data.train.records]))
        self.given = self.size / force_scale(tried.block)  # what makes a force of that size
        self.motion = [
            _motion(r, w, y)
            for r, w, y in zip(self.view.records, self.view.segments, tried.train.simulated, strict=True)
        ]
        # one scale for all records: a force that goes with the velocity is the same law in each
        sizes = {k: size(self._every(k)) for k in "xvau"}
        for motion in self.motion:
            motion["rms"] = sizes

    def _every(self, name: str) -> np.ndarray:
        """Return the values of a quantity within all segments."""
        return np.concatenate([m[name][m["inside"]] for m in self.motion])

    def responses(self, shapes) -> list[list[np.ndarray]]:
        """Return the changes of output by forces: each `shape(motion)` (n,) of one record, of order one."""
        changes: list[list[np.ndarray]] = [[] for _ in shapes]
        for record, segments, start, y, motion in zip(
            self.view.records,
            self.view.segments,
            self.fit.starts,
            self.fit.simulated,
            self.motion,
            strict=True,
        ):
            force = record.u if not facts(record).imposed else facts(record).load
            simulator = self.data.simulator(self.fit.model, record)
            forces = [force + self.given * shape(motion) for shape in shapes]
            for change, moved in zip(changes, simulator.run_driven(segments, start, forces), strict=True):
                change.append((moved - y) / self.size)
        return changes

    def kinds(self):
        """Yield (kind, families): in words what its forces are in proportion to, and a list of (shape, span).

        Coarse and fine along what the kind is of. Over the place a force may vary, but also the friction, the
        damping (a seat, a conical pin), or what the drive makes of its input (the poles of a motor).
        """
        every = {k: self._every(k) for k in "txvu"}
        for kind, name, tail, count, factors in (
            ("time", "t", *FORCE_STEPS["time"], (one, direction, acceleration)),
            ("position", "x", *FORCE_STEPS["position"], (one, direction, speed, drive)),
            ("low_speed", "v", *FORCE_STEPS["low_speed"], (one,)),
            ("load", "u", *FORCE_STEPS["load"], (one, direction)),
        ):
            if np.ptp(every[name]) == 0:  # no curve is over what stays the same
                continue
            families = []
            for n in (count, FORCES_FINER * count):
                middles, width = grid(every[name], tail, n)
                families += [
                    (
                        HOW[f],
                        [
                            (times(bump(name, m, width), f), within(every[name], m - width, m + width))
                            for m in middles
                        ],
                    )
                    for f in factors
                ]
            yield kind, families
        reaches = [f * self.scale for f in REVERSAL_REACHES]
        yield "after_reversal", [("", [(since(x), (0.0, x)) for x in reaches])]
        fastest = max(float(np.max(np.abs(m["a"][m["inside"]]))) for m in self.motion)
        yield "acceleration", [("", [(acceleration, (0.0, fastest))])]
        lasting = [f * self.period for f in RELAXATIONS]
        yield "past_motion", [("", [(relaxing(t), (0.0, t)) for t in lasting])]
        yield HUM, [("", [(wave(f, c), (f, f)) for c in (np.cos, np.sin)]) for f in self._lines()]

    def _lines(self) -> list[float]:
        """Return the frequencies [Hz] at which the residual of the longest record stands out most.

        Whitened, and as it is: what hums for long, whitening takes away.
        """
        i, fit = int(np.argmax([len(e) for e in self.fit.residual])), self.fit
        noise = prediction_error_filter(fit.residual_pieces, fit.error_filter, fit.outputs).of(0)
        segments = self.view.segments[i]
        parts = segments.slices[: len(segments)]
        t, residual = self.view.records[i].t[segments.samples], fit.residual[i][segments.blocks[0]]
        dt = float(np.median(np.diff(t)))
        found = [
            _line(t[f.rows(parts)], f.filtered(residual, parts), dt, noise.step)
            for f in (noise, replace(noise, a=np.zeros(0)))
        ]
        return list(dict.fromkeys(found))


def _line(t, e, dt: float, step: int) -> float:
    """Return the frequency [Hz] at which a signal of means of `step` samples stands out most."""
    from scipy.ndimage import median_filter

    # each value at its time: a line keeps its phase over the gaps that segments held out leave
    place = np.rint((t - t[0]) / dt).astype(int)
    whole = np.zeros(int(place[-1]) + 1)
    whole[place] = e
    # fine enough that a line between two bins is not lost
    count = HUM_FINER * len(whole)
    power = np.abs(np.fft.rfft(whole, count)) ** 2
    power = power[: len(power) // step]
    ratio = power / (median_filter(power, HUM_WINDOW, mode="reflect") + NOTHING)
    ratio[: HUM_LEAST * HUM_FINER] = 0.0
    return float(np.argmax(ratio)) / (count * dt)


def _motion(record, segments, y):
    """Return the motion that the model makes, and outside the segments that of the record.

    Within the segments speeds and accelerations are backward differences: a force must not know what comes,
    as under a controller that is made of the sensor's noise of now, and the residual would explain itself.
    """
    known, inside = facts(record), segments.samples
    x, v, load = (np.array(c, float) for c in (known.place, known.velocity, known.load))
    a = np.gradient(v, record.t)
    y, t = y[segments.blocks[0]], record.t[inside]
    parts = segments.slices[: len(segments)]
    if known.imposed:
        load[inside] = y
    elif sensed(record).columns[0] == POSITION:
        # the output is the model's own: what it errs by is no function of itself
        x[inside], v[inside], a[inside] = y, _rate(y, t, parts, 1), _rate(y, t, parts, 2)
    else:
        v[inside], a[inside] = y, _rate(y, t, parts, 1)
    return {"t": record.t - record.t[0], "x": x, "v": v, "a": a, "u": load, "inside": inside}


def _rate(y, t, parts, order):
    """Return backward differences within each part; its first samples have those of the next."""
    found = np.zeros(len(y))
    for where in parts:
        rate, at = y[where], t[where]
        for _ in range(order):
            rate, at = np.diff(rate) / np.diff(at), 0.5 * (at[1:] + at[:-1])
        found[where] = np.concatenate((np.repeat(rate[:1], order), rate)) if len(rate) else 0.0
    return found
