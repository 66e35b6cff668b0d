"""The force that is missing, as a signal, and the quantity that it is a curve over."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import ClassVar

import numpy as np

from ...blocks.coordinates import moving_in
from ...blocks.mechanism import Mechanism
from ...cached import cached_property
from ...checks import choice
from ...drawing import draw
from ...numerals import digits
from ...thresholds import NOTHING
from ..data.measurement import Measurement
from ..prediction.loop_force import driven_by_force
from ..prediction.prepared import recorded_reference
from ..prediction.segments import facts, load_of, make_segments
from ..prediction.simulators import simulator_of
from ..residuals.motion_phases import reversals
from ..residuals.regions import Region, Regions, chance
from ..shooting.variables import default_free
from ..thresholds import BY_CHANCE, DEPENDENT, LEVEL, RULED_OUT, SIGNIFICANT, SLOWLY
from .curves import Curve, curve_over, explained_shares
from .smoother import smooth_record
from .thresholds import FORCE_KNOWN, MADE_LEAST, PARAMETER_NUDGE

_WORDS = {
    "force": "force", "time": "time", "position": "position", "velocity": "velocity",
    "load": "force recorded", "reversal": "distance since the last reversal",
    "acceleration": "acceleration",
}  # fmt: skip


class Curves(Regions):
    """What a missing force is made of, as regions: curves over quantities, and what the model could do."""

    heading: ClassVar[str] = "what is missing"
    measure: ClassVar[str] = "share of its square [%]"
    apart: ClassVar[str] = " "
    columns: ClassVar[str] = f"{heading:<52} {'share':>6} {'p':>8}"

    @staticmethod
    def line(r: Region) -> str:
        """Return what a force is made of as a line of the table."""
        return f"{f'{r.kind} {r.label}':<52} {r.share:>6.1%} {chance(r.p_value):>8}"


@dataclass(frozen=True, eq=False)
class MissingForce:
    """The force that would have to be added to a model, at every instant, for it to follow a record.

    Attributes
    ----------
    time : (n,) array
        [s]; of a record of many samples every few of them, in the middle between two.
    force, std : (n,) array
        The force (a torque, of machines that turn) and its standard deviation [`unit`]. Where the machine
        sticks nothing is known of it, and the standard deviation says so.
    quantities : mapping
        position, velocity, load (the force recorded; under an imposed motion the model's) and reversal
        (distance moved since the last reversal), (n,) each; under an imposed motion acceleration, too.
    units : mapping
        Of the quantities and of the time.
    unit : str
        N or N m.
    own : (n, p) array
        Force that a small change of each of the model's own parameters makes, over that change.
    noise : float
        Standard deviation of the sensor's noise, estimated with the force [unit of the output].
    size : float
        Standard deviation of the force where nothing is measured, estimated too [`unit`].
    name : str
        Of the record.
    """

    time: np.ndarray
    force: np.ndarray
    std: np.ndarray
    quantities: Mapping[str, np.ndarray]
    units: Mapping[str, str]
    unit: str
    own: np.ndarray
    noise: float
    size: float
    name: str

    @property
    def words(self) -> dict[str, str]:
        """What force, time and quantities are called: a torque, an angle, where something turns."""
        said = moving_in(self.units["position"]).text
        return {name: said(word) for name, word in _WORDS.items()}

    @property
    def known(self) -> np.ndarray:
        """Where the record determines the force, (n,) bool."""
        return self.std < FORCE_KNOWN * self.size

    @cached_property
    def shares(self) -> dict[str, float]:
        """Share of the force's variance that is a curve over each quantity alone, 0 to 1, the largest first.

        What the model's own parameters could do is left aside. A force that is a curve over velocity is a law
        of friction, one over position a spring or a ripple, one over the distance since the last reversal
        presliding or a gap, one over the acceleration of an imposed motion a mass.
        """
        return {name: curve.share for name, curve in self._curves.items()}

    @cached_property
    def _curves(self) -> dict[str, Curve]:
        found = {name: self._over(name) for name in ("time", *self.quantities)}
        return dict(sorted(found.items(), key=lambda item: -item[1].share))

    @cached_property
    def law(self) -> Curve | None:
        """The likeliest curve over a quantity of the motion; None where it may be chance, or one over time.

        Forces that vary of themselves are curves over time, and over a motion that does not return as much.
        """
        over_time = self._curves["time"].evidence
        best = max((self._curves[name] for name in self.quantities), key=lambda curve: curve.evidence)
        found = best.evidence > SIGNIFICANT and best.evidence > over_time + RULED_OUT
        return best if self.significant and found else None

    @property
    def significant(self) -> bool:
        """Whether it is beyond its uncertainty anywhere: by three standard deviations."""
        return bool(np.any(self.known & (np.abs(self.force) > BY_CHANCE * self.std)))

    @property
    def rms(self) -> float:
        """Rms over the record [`unit`]."""
        return float(np.sqrt(np.mean(self.force**2)))

    @cached_property
    def made(self) -> tuple[float, float]:
        """Share of its square that other values of the model's own parameters make; that a constant adds."""
        return explained_shares(self.force, self.std, self.own, self.known)

    @property
    def _left(self) -> bool:
        """Whether parameters and a constant leave anything to be a curve."""
        return sum(self.made) < 1.0 - MADE_LEAST

    @cached_property
    def regions(self) -> Curves:
        """What it is a curve over, as regions of an error are; none where it is not significant."""
        if not self.significant:
            return Curves()
        words, (own, constant) = self.words, self.made
        size = f"the missing {words['force']} ({digits(self.rms)} {self.unit} rms)"
        makes = f"of {size} could be explained by other values of the model's parameters"
        rows = [
            (own, "parameters", "of the model", float(own < MADE_LEAST), makes),
            (constant, "constant", words["force"], float(constant < MADE_LEAST),
             f"of {size} is a constant {words['force']}"),
        ]  # fmt: skip
        rest = f"of what neither other parameter values nor a constant explain of {size} is a"
        for name, curve in self._curves.items() if self._left else ():
            said = f"{rest} function of the {words[name]}"
            rows.append((curve.share, "curve", f"over the {words[name]}", curve.p_value, said))
        found = [
            Region(kind, label, share, 0.0, p_value, 0.0, 1.0, (-inf, inf), f"{share:.0%} {said}.")
            for share, kind, label, p_value, said in rows
        ]
        return Curves(sorted(found, key=lambda region: (region.p_value >= LEVEL, -region.share)))

    def curve(self, against: str) -> Curve:
        """Return the force as a curve over a quantity, what the model's own parameters could do left aside.

        Parameters
        ----------
        against : {'position', 'velocity', 'load', 'reversal', 'acceleration'}
            Over the distance since the last reversal, the force is that along the motion.
        """
        choice("the curve of a missing force", "against", against, tuple(self.quantities))
        return self._over(against)

    def _over(self, against) -> Curve:
        signs = np.sign(self.quantities["velocity"]) if against == "reversal" else np.ones(len(self.time))
        own, beside = self.own, self._at_scale if against == "load" else self.own
        values = {"time": self.time, **self.quantities}[against]
        return curve_over(
            values, self.force * signs, self.std, own * signs[:, None],
            beside * signs[:, None], self.known,
        )  # fmt: skip

    @cached_property
    def _at_scale(self) -> np.ndarray:
        """The model's own parameters, their common scale held, (n, p).

        All of them larger by a factor, and a force in proportion to the load, would be any force there is.
        """
        own = self.own / np.maximum(np.linalg.norm(self.own, axis=0), NOTHING)
        scale = np.linalg.lstsq(own, self.force + self.quantities["load"], rcond=DEPENDENT)[0]
        scale /= max(float(np.linalg.norm(scale)), NOTHING)
        return own - np.outer(own @ scale, scale)

    def plot(self, against: str = "time", **keywords):
        """Draw it over time, or as points and a curve over another quantity; returns a ``ct.ControlPlot``.

        Parameters
        ----------
        against : {'time', 'position', 'velocity', 'load', 'reversal', 'acceleration'}
            The acceleration under an imposed motion alone.
        """
        choice("the picture of a missing force", "against", against, ("time", *self.quantities))
        return draw("missing force", self, against=against, **keywords)

    def summary(self) -> str:
        """Return in sentences how large it is, how well it is known, and what it is a curve over."""
        words, load = self.words, float(np.sqrt(np.mean(self.quantities["load"] ** 2)))
        size = (
            f"{digits(self.rms)} {self.unit} rms, standard deviation {digits(np.median(self.std), 2)} "
            f"{self.unit} (median); the {words['load']} is {digits(load)} {self.unit} rms"
        )
        if not self.significant:
            return (
                f"No missing {words['force']} in {self.name!r}: the estimate nowhere exceeds three standard "
                f"deviations ({size})."
            )
        own, constant = self.made
        curves = [
            f"{share:.0%} is a function of the {words[name]}"
            for name, share in self.shares.items()
            if self._left and share >= MADE_LEAST
        ]
        rest = f" Of the rest {', '.join(curves)}." if curves else ""
        return (
            f"Missing {words['force']} in {self.name!r}: {size}. Other parameter values of the model could "
            f"explain {own:.0%} of its mean square, a constant {words['force']} {constant:.0%}.{rest}"
        )

    def __repr__(self) -> str:
        seen = next((f"{r.share:.0%} {r.kind} {r.label}" for r in self.regions), "not significant")
        return f"<MissingForce {self.name}: {digits(self.rms)} {self.unit} rms, {seen}>"


def missing_force(model, record: Measurement) -> MissingForce:
    """Return the force that a model lacks beside a record, with its uncertainty.

    Parameters
    ----------
    model : block of masses or inertias and effects, or loop of `ctrl_df.closed_loop` round one
        Of a loop the block is taken, driven by the force that was recorded, or that its controller makes of
        the reference and the output that were.
    record : Measurement
        Of position, velocity or both; or of an imposed motion and the force that it took.

    Raises
    ------
    TypeError
        A model that is no mechanism: nobody knows where a force acts in it.
    ValueError
        A loop, and a record whose input may be its reference: neither its unit nor a channel tells.
    """
    if facts(record).imposed:
        return missing_of_imposed(model, record)
    parts = getattr(model, "parts", None)
    block = model if parts is None else parts.block
    if not isinstance(block, Mechanism):
        raise TypeError(
            f"a missing force needs a block of masses and effects; got {type(block).__name__}. Build it from "
            "ctrl_df.Mass, TwoMass, Inertia or TwoInertias and effects."
        )
    record = driven_by_force(model, record)
    if parts is not None and recorded_reference(record) is None:
        force = block.coordinates.force
        raise ValueError(
            f"a missing {force} of a loop needs the {force} that was recorded, and the input of "
            f"{record.name!r} may be the reference. State input_unit= of a reference, as that of the output, "
            f"or give the {force} as the input u and the reference as the channel 'reference'."
        )
    found = smooth_record(block, record)
    coordinates, core = block.coordinates, block.core
    at = 2 if core.bodies == 2 and core.measured == 1 else 0
    load = np.interp(found.time, record.t, load_of(block, record))
    return MissingForce(
        found.time, found.force, found.std,
        *_quantities(coordinates, found.states[:, at], found.states[:, at + 1], load),
        found.own, found.noise, found.size, record.name,
    )  # fmt: skip


def missing_of_imposed(model, record: Measurement, residual=None) -> MissingForce:
    """Return the force that a model lacks under an imposed motion: what it errs by, at every sample.

    Its standard deviation is that of the load cell's noise, by the record's noise floor. `residual`: None:
    that of the model started at rest.
    """
    known = facts(record)
    simulator = simulator_of(model, record)
    whole = make_segments(record)
    start = np.zeros((1, len(simulator.free_states)))
    table = simulator.block.parameters
    free = [k for k in default_free(simulator.block) if table[k].value != 0]
    steps = {k: PARAMETER_NUDGE * table[k].value for k in free}
    runs = simulator.run_all(
        [(whole, None, start), *((whole, {k: table[k].value + d}, start) for k, d in steps.items())]
    )
    residual = record.y - runs[0] if residual is None else residual
    # over the load that the model gives: the force recorded holds what is missing
    load = runs[0] if np.ptp(runs[0]) > 0 else known.load
    own = np.array([(y - runs[0]) / d for y, d in zip(runs[1:], steps.values(), strict=True)])
    moved = known.place, known.velocity, load, np.gradient(known.velocity, record.t)
    return MissingForce(
        record.t, residual, np.full(len(record), known.noise),
        *_quantities(simulator.block.coordinates, *moved),
        own.reshape(len(steps), len(record)).T, known.noise, float(np.std(residual)), record.name,
    )  # fmt: skip


def _quantities(coordinates, position, velocity, load, acceleration=None):
    """Return what forces are drawn against, the units of these and of the time, and that of the force."""
    slow = SLOWLY * float(np.sqrt(np.mean(velocity**2)))
    travelled = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(position)))))
    marks = np.maximum.accumulate(np.where(_turned(velocity, slow), travelled, 0.0))
    unit, force = coordinates.unit, coordinates.force_unit
    quantities = {"position": position, "velocity": velocity, "load": load, "reversal": travelled - marks}
    units = {"time": "s", "position": unit, "velocity": f"{unit}/s", "load": force, "reversal": unit}
    if acceleration is not None:
        quantities["acceleration"], units["acceleration"] = acceleration, f"{unit}/s^2"
    return quantities, units, force


def _turned(velocity, slow) -> np.ndarray:
    """Return the samples at which the motion turns, (n,) bool."""
    turned = np.zeros(len(velocity), bool)
    turned[reversals(velocity, slow)] = True
    return turned
