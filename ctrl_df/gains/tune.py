"""`tune_pid`: gains that meet bandwidth and margin, without a limit cycle or with the smallest one."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, cast

import control as ct
import numpy as np
from scipy.optimize import NonlinearConstraint, OptimizeResult, differential_evolution

from ..checks import number, positive, shown
from ..df.dispatch import method_for
from ..df.work import progress_bar
from ..limit_cycles.check import Check
from ..limit_cycles.predicted.predict import describing_function_response
from ..limit_cycles.predicted.thresholds import OMEGA_BEYOND
from ..limit_cycles.verify import verify
from ..simulate.parallel import side_by_side
from ..table import Table
from .arguments import bounds, gain_units
from .controller import GAINS, Structure
from .plane import Plane, plane_of, require_linear
from .simulated import Simulated, simulated, worded
from .stability import far_loop, unstable_poles
from .thresholds import (
    EXTREME,
    FURTHER,
    GENERATIONS,
    INTEGRAL,
    LINEAR_CHANGE,
    MARGIN_POINTS,
    MAX_SENSITIVITY,
    MEMBERS,
    SOFTER,
    VERIFIED,
    WIDER,
)

_OWNER = "tune_pid"


@dataclass(frozen=True, repr=False, eq=False)
class TunedPID:
    """Gains chosen, what they meet, and what the loop does with them.

    Attributes
    ----------
    gains : dict
        kp, ki, kd.
    controller : ct.TransferFunction
        The PID.
    loop : ct.InterconnectedSystem
        The closed loop.
    bandwidth : float
        Crossover frequency [rad/s] of the loop where it is linear: in the large, where friction, gap and the
        like are negligible; of a saturation below its limits.
    max_sensitivity : float
        Its largest ``|1/(1 + L)|``: the modulus margin is the inverse.
    phase_margin : float
        [rad].
    feasible : bool
        Whether bandwidth and margin asked for are met.
    verdict : str
        What the loop does from twelve starts: ``rests``, ``cycles``, ``diverges``, or several of these.
    simulated : Simulated
        The simulations; ``.orbit`` is the exact cycle, None without one.
    check : Check
        Predictions at these gains against exact orbits; see `ctrl_df.verify`.
    tried : int
        Gains simulated.

    Examples
    --------
    >>> import ctrl_df as cdf
    >>> axis = cdf.friction_mass(mass=9, coulomb=5, viscous=0.5)
    >>> tuned = cdf.tune_pid(axis, bandwidth=12, kp=1500, ki=3000, kd=130)
    >>> tuned
    <TunedPID kp=1500, ki=3000, kd=130: rests>
    >>> round(tuned.bandwidth, 1), tuned.feasible
    (16.6, True)
    """

    gains: dict[str, float]
    controller: ct.TransferFunction
    loop: Any
    bandwidth: float
    max_sensitivity: float
    phase_margin: float
    feasible: bool
    simulated: Simulated
    check: Check
    tried: int
    structure: Structure = field(repr=False)

    @property
    def verdict(self) -> str:
        """What the loop does from its starts, and on exact orbits that none of them came to."""
        stable = any(orbit.stable for orbit in self.check.orbits)
        return worded(self.simulated.rests, self.simulated.cycles or stable, self.simulated.diverges)

    def summary(self) -> str:
        """Return gains, margins and verdict in words."""
        units = gain_units(self.structure.block, self.structure.output)
        gains = ", ".join(
            f"{name} = {value:.5g} {units[name]}".rstrip() for name, value in self.gains.items()
        )
        orbit = self.simulated.orbit
        cycle = "" if orbit is None else f" ({orbit.output_amplitude:.4g} at {orbit.omega:.4g} rad/s)"
        met = "" if self.feasible else " Bandwidth and margin asked for are not met together."
        return (
            f"{gains}: crossover {self.bandwidth:.4g} rad/s, largest sensitivity {self.max_sensitivity:.3g}, "
            f"phase margin {math.degrees(self.phase_margin):.3g} deg.{met}\n"
            f"From {len(self.simulated.fate)} starts the loop {self.verdict}{cycle}; {self.tried} gains were "
            "simulated."
        )

    def table(self) -> Table:
        """Return gains, margins and verdict, a row each."""
        units = gain_units(self.structure.block, self.structure.output)
        rows = [(name, f"{value:.5g} {units[name]}".rstrip()) for name, value in self.gains.items()]
        rows += [
            ("crossover", f"{self.bandwidth:.5g} rad/s"),
            ("largest sensitivity", f"{self.max_sensitivity:.4g}"),
            ("phase margin", f"{math.degrees(self.phase_margin):.4g} deg"),
            ("verdict", self.verdict),
        ]
        return Table(("what", "value"), tuple(rows))

    def __repr__(self) -> str:
        """Return gains and verdict."""
        at = ", ".join(f"{name}={value:.5g}" for name, value in self.gains.items())
        return f"<TunedPID {at}: {self.verdict}>"

    def _repr_html_(self) -> str:
        return self.table()._repr_html_()


def tune_pid(
    block,
    *,
    bandwidth: Any,
    max_sensitivity: float = MAX_SENSITIVITY,
    kp: Any = None,
    ki: Any = None,
    kd: Any = None,
    tf: float = 0.0,
    plant: Any = None,
    output: str | None = None,
    seed: int = 0,
    progress: bool | None = None,
) -> TunedPID:
    """Choose the gains of a PID by what the loop really does: no limit cycle, or the smallest one.

    Among the gains whose loop, where it is linear, is stable, crosses over within `bandwidth` and keeps its
    sensitivity below `max_sensitivity`, differential evolution looks for those without a limit cycle and,
    among these, for the greatest stiffness against slow forces, kp + ki / bandwidth; where every loop cycles,
    for the smallest cycle. Each is evaluated by simulations from twelve starts, not by the describing
    function, which does not predict the hunting that static friction causes.

    A loop is linear in the large if its block keeps its gain there (friction, gaps, dead zones are
    negligible then), else in the small (a saturation below its limits). A relay is linear nowhere.

    Parameters
    ----------
    block : block
        As in `limit_cycle_map`.
    bandwidth : float or (low, high)
        Crossover frequency [rad/s], > 0: the least one (up to half as much again is allowed then), or a
        range.
    max_sensitivity : float
        Largest ``|1/(1 + L)|``, > 1; 1.7 keeps a gain margin of 2.4 and a phase margin of 34 degrees.
    kp, ki, kd : float or (low, high), optional
        A gain, or bounds of it; left out: chosen from the bandwidth. ``ki=0`` is a PD controller, ``ki=(low,
        high)`` insists on integral action.
    tf, plant, output
        As in `limit_cycle_map`.
    seed : int
        Of the search.
    progress : bool, optional
        Progress bar; default: only on a terminal and only after two seconds.

    Returns
    -------
    TunedPID

    Raises
    ------
    TypeError, ValueError
        A bandwidth or sensitivity out of range, gains that are no number and no range, a block that is linear
        nowhere (a relay); what `closed_loop` refuses.

    Examples
    --------
    >>> import ctrl_df as cdf
    >>> axis = cdf.friction_mass(mass=9, coulomb=5, viscous=0.5)
    >>> tuned = cdf.tune_pid(axis, bandwidth=12)
    >>> tuned.verdict, tuned.feasible
    ('rests', True)
    >>> tuned.bandwidth >= 12 and tuned.max_sensitivity <= 1.7
    True
    """
    if np.ndim(bandwidth) == 0:
        least = positive(_OWNER, "bandwidth", bandwidth, "rad/s", meaning="crossover frequency")
        band = least, WIDER * least
    else:
        band = cast("tuple[float, float]", bounds(_OWNER, "bandwidth", bandwidth, "rad/s"))
    limit = number(_OWNER, "max_sensitivity", max_sensitivity, lower=1.0, strict=True)
    tf = number(_OWNER, "tf", tf, "s", lower=0.0, meaning="filter time constant")
    if plant is not None:
        require_linear(plant)
    structure = Structure(block, tf, plant, output)
    linear_at, N = _where_linear(structure, np.array(band))
    need = np.abs(1 / (N * structure.beside(np.array(band))))
    ranges = _ranges(structure, band, need, {"kp": kp, "ki": ki, "kd": kd})
    omega = band[0] / OMEGA_BEYOND, band[1] * OMEGA_BEYOND
    plane = plane_of(structure, _corners(ranges), omega=omega, linear_at=linear_at, progress=progress)
    free = [name for name in GAINS if ranges[name][0] < ranges[name][1]]
    search = _Search(plane, ranges, free, band, limit, float(need[0]))
    if free:
        box = [(math.log(ranges[name][0]), math.log(ranges[name][1])) for name in free]
        with progress_bar(None, progress, "simulating gains", "point") as bar:
            search.after_each = bar.update
            evolve: Any = differential_evolution  # seed is called rng from SciPy 1.15 on
            found: OptimizeResult = evolve(
                search.cost, box, constraints=NonlinearConstraint(search.margins, -np.inf, 0.0),
                popsize=MEMBERS, maxiter=GENERATIONS, seed=seed, polish=False, updating="deferred",
                init="halton",
                workers=side_by_side,
            )  # fmt: skip
        gains = search.gains(found.x)
    else:
        gains = search.gains(np.zeros(0))
    truth = search.known.get(_key(gains)) or simulated(structure, gains)
    crossover, sensitivity, margin = _margins(plane, gains)
    return TunedPID(
        gains, structure.pid(gains), structure.loop(gains), crossover, sensitivity, margin,
        bool((search.margins(np.array([math.log(gains[n]) for n in free])) <= 0).all()), truth,
        _verified(structure, plane, gains), len(search.known), structure,
    )  # fmt: skip


class _Search:
    """What the optimiser asks of gains, given by their logarithms."""

    def __init__(self, plane: Plane, ranges, free, band, limit, need):
        self.plane, self.ranges, self.free = plane, ranges, free
        self.band, self.limit, self.need = band, limit, need
        self.known: dict[tuple, Simulated] = {}
        self.after_each: Any = lambda: None

    def gains(self, x) -> dict[str, float]:
        """All three gains."""
        given = dict(zip(self.free, np.exp(x).tolist(), strict=True))
        return {name: float(given.get(name, self.ranges[name][0])) for name in GAINS}

    def margins(self, x) -> np.ndarray:
        """How far stability, bandwidth and margin are missed, each met at 0 or below."""
        gains = self.gains(x)
        poles = int(unstable_poles(self.plane, gains["kp"], gains["ki"], gains["kd"]))
        crossover, sensitivity, _ = _margins(self.plane, gains)
        low, high = (math.log(b / crossover) for b in self.band)
        return np.array([poles, low, -high, math.log(sensitivity / self.limit)])

    def cost(self, x) -> float:
        """Rank gains: first those without a cycle, by stiffness, then the others by the size of the cycle."""
        gains = self.gains(x)
        truth = self.known.get(_key(gains))
        if truth is None:
            truth = self.known[_key(gains)] = simulated(self.plane.structure, gains)
            self.after_each()
        if truth.diverges:
            return math.inf
        if truth.cycles and truth.orbit is not None:
            size = truth.orbit.output_amplitude / max(row.size for row in truth.fate)
            return 1.0 + size
        return 1.0 / (1.0 + (gains["kp"] + gains["ki"] / self.band[0]) / self.need)


def _key(gains):
    return tuple(gains[name] for name in GAINS)


def _ranges(structure, band, need, given: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """Bounds of every gain: those given, the others around what crosses over within the band."""
    low, high = SOFTER * float(need.min()), float(need.max())
    ranges = {
        "kp": (low, high),
        "ki": (INTEGRAL[0] * band[0] * low, INTEGRAL[1] * band[1] * high),
        "kd": (SOFTER * low / band[1], high / band[0]),
    }
    units = gain_units(structure.block, structure.output)
    for name, value in given.items():
        if value is not None and np.ndim(value) == 0:
            fixed = number(_OWNER, name, value, units[name], lower=0.0)
            ranges[name] = (fixed, fixed)
        elif value is not None:
            ranges[name] = cast("tuple[float, float]", bounds(_OWNER, name, value, units[name]))
    return ranges


def _corners(ranges):
    """Gains at the ends of their ranges together, and in their middle."""
    middle = {name: math.sqrt(low * high) for name, (low, high) in ranges.items()}
    return [{name: r[0] for name, r in ranges.items()}, middle, {name: r[1] for name, r in ranges.items()}]


def _where_linear(structure: Structure, omega) -> tuple[float, np.ndarray]:
    """Return an amplitude at which the block is linear, and N there at some frequencies."""
    method = method_for(structure.block, structure.output)
    for at, further in ((EXTREME, FURTHER * EXTREME), (1 / EXTREME, 1 / FURTHER / EXTREME)):
        by_size = np.sort([at, further])
        N = method.harmonics(by_size, omega if method.needs_omega else None, 1)[0][..., 1]
        with np.errstate(invalid="ignore"):
            same = (np.abs(N[1] - N[0]) < LINEAR_CHANGE * np.abs(N[0])).all()
        if same:
            return at, np.broadcast_to(N[int(by_size[1] == at)], omega.shape)
    raise ValueError(
        f"{_OWNER} needs a block that keeps its gain for large or for small amplitudes: there the loop is "
        f"linear, which bandwidth and margin are taken from. {shown(structure.block)} keeps none. Map the "
        "gains of a relay with limit_cycle_map; tune a machine with friction and a limited input without "
        "the limit (block.without_effect), and verify with it."
    )


def _margins(plane: Plane, gains) -> tuple[float, float, float]:
    """Crossover frequency [rad/s], largest sensitivity, phase margin [rad] of the loop where it is linear."""
    q = np.linspace(plane.log_w[0], plane.log_w[-1], MARGIN_POINTS)
    L = far_loop(plane, gains, q)
    size = np.log(np.abs(L))
    falls = np.flatnonzero((size[:-1] >= 0) & (size[1:] < 0))
    sensitivity = float((1 / np.abs(1 + L)).max())
    if not falls.size:
        edge = plane.log_w[0] if size[0] < 0 else plane.log_w[-1]
        return float(np.exp(edge)), sensitivity, math.nan
    k = falls[-1]
    share = size[k] / (size[k] - size[k + 1])
    phase = np.unwrap(np.angle(L[k : k + 2]))
    margin = math.remainder(float(phase[0] + share * (phase[1] - phase[0])) + math.pi, 2 * math.pi)
    return float(np.exp(q[k] + share * (q[k + 1] - q[k]))), sensitivity, margin


def _verified(structure, plane, gains) -> Check:
    """Predict and verify at the gains chosen."""
    a, w = np.exp(plane.log_a), np.exp(plane.log_w)
    box = np.geomspace(a[0], a[-1], VERIFIED[0]), np.geomspace(w[0], w[-1], VERIFIED[1])
    response = describing_function_response(
        structure.controller(gains), structure.block, *box, output=structure.output, progress=False
    )  # fmt: skip
    return verify(response)
