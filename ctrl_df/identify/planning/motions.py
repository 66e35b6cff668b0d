"""The motion that separates candidates best, where motion is imposed: within stroke and speed of records."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...blocks.coordinates import moving_in
from ...numerals import digits
from ..data.signals import noise_floor
from ..prediction.segments import facts, make_segments
from ..prediction.simulators import simulator_of
from ..results.experiment import Experiment, separated
from .inputs import most_separating, references
from .thresholds import PLAN_LEAST, PLAN_MARGIN, PLAN_SIZES


def motion_that_separates(
    diagnosis, models, names, *, force=None, stroke=None, duration=None, dt=None, loop=None
) -> Experiment:
    """Return the imposed motion under which the forces of any two of the models differ most.

    It is as fast as that of the records at most.

    Parameters
    ----------
    diagnosis, models, names, duration, dt
        As for `input_that_separates`.
    force : float or None
        Largest input, which is the position; None: any.
    stroke : float or None
        Largest distance from where the first record begins; None: what that record reached.
    loop
        Refused: there is nothing to be controlled.
    """
    record = diagnosis.train[0]
    known, words = facts(record), moving_in(record.input_unit)
    if loop is not None:
        raise ValueError(
            f"next_experiment takes loop= for machines that a {words.force} drives; here motion is imposed. "
            "Leave it out."
        )
    centre = float(known.place[0])
    reach = float(stroke or np.max(np.abs(known.place - centre)))
    duration, dt = float(duration or record.duration), float(dt or record.dt)
    if not (reach > 0 and duration > PLAN_LEAST * dt):
        raise ValueError(
            f"next_experiment needs {words.reach} > 0 and duration > {PLAN_LEAST} dt; got {reach}, "
            f"{duration}, {dt}."
        )
    t = dt * np.arange(int(round(duration / dt)))
    fastest = max(float(np.max(np.abs(facts(r).velocity))) for r in diagnosis.train)
    play = _Imposed(models, record, t, centre, (force or np.inf, fastest, noise_floor(record.t, record.u)))
    shapes = references(t, record)
    inputs = [(k, centre + PLAN_MARGIN * reach * size * s) for k, s in shapes.items() for size in PLAN_SIZES]
    best, _ = most_separating(play, inputs, t, known.noise, (reach, np.inf))
    if best is None:
        place = f", up to {force:g} {record.input_unit} ({words.position})" if force else ""
        raise ValueError(
            f"no motion within {reach:g} {record.input_unit} ({words.reach}) of where the records begin"
            f"{place}, as slow as theirs and beyond the noise of its sensor, tells {separated(names)} apart. "
            "Allow more, or a longer duration."
        )
    reason = (
        f"{best.kind} within {digits(best.stroke)} {record.input_unit} of the centre: the {words.force}s of "
        f"{separated(names)} then differ by at least {digits(best.separation, 2)} times the noise, and reach "
        f"{digits(best.force)} {record.output_unit}."
    )
    return replace(best, candidates=names, reason=reason)


class _Imposed:
    """Imposes a motion on every model, from rest.

    `limits`: largest position and speed, and what a motion has to be larger than.
    """

    def __init__(self, models, record, t, centre, limits: tuple[float, float, float]):
        self.models, self.record, self.t, self.centre, self.limits = models, record, t, centre, limits

    def __call__(self, u):
        furthest, fastest, least = self.limits
        too_fast = np.max(np.abs(np.gradient(u, self.t))) > fastest
        if too_fast or np.max(np.abs(u)) > furthest or np.ptp(u) <= least:
            return [], np.inf, np.inf, [0.0]
        outputs = {self.record.output: np.zeros(len(u))}
        played = self.record.replaced(t=self.t, u=u, outputs=outputs, velocity=None, channels={})
        whole, forces = make_segments(played), []
        for model in self.models:
            simulator = simulator_of(model, played)
            start = np.zeros((1, len(simulator.free_states)))
            forces.append(simulator.run_all([(whole, None, start)])[0])
        gaps = [float(np.sqrt(np.mean((a - b) ** 2))) for i, a in enumerate(forces) for b in forces[i + 1 :]]
        largest = max(float(np.max(np.abs(f))) for f in forces)
        return forces, float(np.max(np.abs(u - self.centre))), largest, gaps
