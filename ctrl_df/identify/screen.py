"""Start values and first evidence for every effect of the library, from the residual of the refitted baseline.

What a candidate would change in the output is simulated; what the baseline's own parameters and starts could
explain is projected out of that and of the residual first. The share of the residual that remains explained is
the screening evidence, and the values that explain most are where the refit begins.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from ..blocks import effects as library
from ..blocks.core import level
from ..blocks.effect import Effect
from .trial import Fitted, Run, Scales, simulate, with_values

# Effects of which a block holds one at most, or a second of which is the first one again.
_REPEATABLE = ("position_ripple",)
# Effects that vanish as their main parameter goes to zero, in proportion to it.
_PROPORTIONAL = frozenset({
    "viscous", "coulomb", "quadratic_drag", "asymmetric_coulomb", "asymmetric_viscous", "load_friction",
    "constant_force", "linear_spring", "cubic_spring", "input_dead_zone", "input_delay", "input_lag", "sensor_delay",
    "sensor_offset", "drift",
})  # fmt: skip


@dataclass(frozen=True, eq=False)
class Screen:
    """The refitted baseline seen as a linear map: its residual, and a basis of all that refitting could change."""

    base: Fitted
    runs: tuple[Run, ...]
    scales: Scales
    residual: np.ndarray
    basis: np.ndarray

    def project(self, signal: np.ndarray) -> np.ndarray:
        """Remove what the baseline's parameters and starts can explain."""
        return signal - self.basis @ (self.basis.T @ signal)

    def change(self, block) -> np.ndarray | None:
        """Return the change of output that `block` makes against the baseline; None if it cannot be simulated."""
        parts = []
        for run, start, y in zip(self.runs, self.base.starts, self.base.outputs, strict=True):
            new = simulate(block, run, start)
            parts.append((new - y)[run.use])
        change = np.concatenate(parts)
        return change if np.all(np.isfinite(change)) else None

    @property
    def block(self):
        """The refitted baseline."""
        return self.base.block


@dataclass(frozen=True)
class Start:
    """An effect with start values and the share of the residual it is expected to leave (1: explains nothing)."""

    effect: Effect
    left: float
    values: tuple[tuple[str, float], ...] = ()  # baseline parameters that go with it


def make_screen(base: Fitted, runs, scales) -> Screen:
    """Prepare the screening about a fitted baseline."""
    residual = np.concatenate([r[run.use] for r, run in zip(base.residuals, runs, strict=True)])
    jacobian = base.jacobian if base.jacobian is not None else np.zeros((0, len(residual)))
    if len(jacobian):
        norms = np.linalg.norm(jacobian, axis=1)
        u, s, _ = np.linalg.svd((jacobian[norms > 0] / norms[norms > 0, None]).T, full_matrices=False)
        basis = u[:, s > 1e-6 * s[0]] if len(s) else u
    else:
        basis = np.zeros((len(residual), 0))
    return Screen(base, tuple(runs), scales, residual - basis @ (basis.T @ residual), basis)


def applicable(cls, block) -> bool:
    """Whether adding an effect of this class to the block can change anything."""
    ids = [e.id for e in block.effects]
    if cls.id in ids and cls.id not in _REPEATABLE:
        return False
    two = block.core.bodies == 2
    if cls.id == "load_friction":
        return two  # on a rigid block it is Coulomb friction
    if cls.id == "backlash":
        return "compliance" not in ids or cls.id not in ids
    return not (cls.role == "coupling" and two and "compliance" in ids)


def attach(block, effect):
    """Return the block with the effect added, or None where the two contradict each other."""
    try:
        grown = block.with_effect(effect)
    except (ValueError, TypeError):
        if not hasattr(effect, "level"):
            return None
        try:
            base = [e for e in block.effects if e.role == "friction" and e.side == "motor" and e.rank == 0]
            lifted = dataclasses.replace(effect, level=max(effect.level, level(base, 1.0, 1.0, 0.0)))
            grown = block.with_effect(lifted)
        except (ValueError, TypeError):
            return None
    if effect.id == "coulomb":
        # a static level must stay above the new kinetic one
        grown = with_values(grown, {})
    return grown


def starts_for(cls, screen: Screen, keep: int = 2) -> list[Start]:
    """Return the best start values for one effect class, best first."""
    found: list[Start] = []
    total = float(screen.residual @ screen.residual)
    for effect in _proposals(cls, screen):
        found += _judged(effect, screen, total)
    found.sort(key=lambda s: s.left)
    chosen: list[Start] = list(_regressed(cls, screen))
    keep += len(chosen)
    for start in found:
        if all(_apart(start.effect, other.effect) for other in chosen):
            chosen.append(start)
        if len(chosen) == keep:
            break
    return chosen


def _judged(effect, screen, total) -> Iterator[Start]:
    block = attach(screen.block, effect)
    change = None if block is None else screen.change(block)
    if block is None or change is None or total == 0:
        return
    change = screen.project(change)
    power = float(change @ change)
    if power == 0:
        return
    left = screen.residual - change
    yield Start(block.effects[-1], float(left @ left) / total)
    if effect.id in _PROPORTIONAL:
        # For a small effect the change is proportional to it: scale it to the residual.
        factor = float(change @ screen.residual) / power
        scaled = _scaled(effect, factor)
        if scaled is not None and not 0.8 < factor < 1.25:
            again = attach(screen.block, scaled)
            moved = None if again is None else screen.change(again)
            if again is not None and moved is not None:
                left = screen.residual - screen.project(moved)
                yield Start(again.effects[-1], float(left @ left) / total)


def _scaled(effect, factor):
    name, p = next(iter(effect.parameters.items()))
    value = p.value * min(max(factor, -300.0), 300.0)
    if value < p.lower or value > p.upper or (p.strict and value <= p.lower) or value == 0:
        return None
    return effect.replace(**{name: value})


def _apart(a, b):
    return any(
        abs(x - y) > 0.25 * max(abs(x), abs(y), 1e-300) for x, y in zip(a.values, b.values, strict=True)
    )


def _regressed(cls, screen) -> Iterator[Start]:
    """Yield start values for Stribeck friction and the baseline together, by regression of the force on motion.

    The refitted baseline has bent its own friction towards the truth as far as it could; the right start lies
    elsewhere for all parameters at once.
    """
    if cls is not library.Stribeck:
        return
    s = screen.scales
    names = {"mass", "coulomb.level", "viscous.coefficient"} & set(screen.block.parameters)
    if "mass" not in names or screen.block.core.bodies > 1:
        return
    scored = []
    for speed in s.speed * np.array([0.04, 0.08, 0.15, 0.3, 0.6]):
        weights, left = force_regression(
            screen.runs, s, lambda v, speed=speed: np.sign(v) * np.exp(-np.square(v / speed)), friction=names
        )
        scored.append((left, speed, weights))
    _, speed, w = min(scored, key=lambda x: x[0])
    mass, kinetic, viscous, extra = w
    if mass <= 0 or extra <= 0:
        return
    values = {
        "mass": mass,
        "coulomb.level": max(kinetic, 0.01 * s.force),
        "viscous.coefficient": max(viscous, 1e-3 * s.force / s.speed),
    }
    kinetic = values["coulomb.level"] if "coulomb.level" in names else 0.0
    yield Start(
        library.Stribeck(kinetic + extra, speed), 0.0, tuple((k, v) for k, v in values.items() if k in names)
    )


def force_regression(runs, scales, shape=None, friction=("coulomb.level", "viscous.coefficient")):
    """Regress the force on acceleration, direction, speed (and a further shape of speed) where the mass moves.

    Returns
    -------
    weights : array
        mass [kg], Coulomb level [N], viscous coefficient [N s/m], weight of the shape [N]; 0 for those left out.
    left : float
        Mean squared force that remains [N^2].
    """
    rows, forces = [], []
    for run in runs:
        dt = float(np.median(np.diff(run.t)))
        a = np.gradient(run.v, dt)
        moving = np.abs(run.v) > 0.03 * scales.speed
        moving[:5] = moving[-5:] = False
        v = run.v[moving]
        columns = [
            a[moving],
            np.sign(v) * ("coulomb.level" in friction),
            v * ("viscous.coefficient" in friction),
            np.zeros(len(v)) if shape is None else shape(v),
        ]
        rows.append(np.column_stack(columns))
        forces.append(run.u[moving])
    matrix, force = np.concatenate(rows), np.concatenate(forces)
    size = np.linalg.norm(matrix, axis=0)
    size[size == 0] = 1.0
    weights = np.linalg.lstsq(matrix / size, force, rcond=None)[0] / size
    return weights, float(np.mean((force - matrix @ weights) ** 2))


# --- proposals ------------------------------------------------------------------------------------


def _proposals(cls, screen: Screen):
    own = getattr(cls, "suggest", None)
    if own is not None:
        return own(screen)
    maker = _MAKERS.get(cls.id)
    if maker is not None:
        return maker(screen)
    return _generic(cls, screen)


def _generic(cls, screen: Screen):
    """Yield the effect at sizes of the main parameter from small to large, others at default or typical size."""
    values, main = {}, None
    for f in dataclasses.fields(cls):
        spec = f.metadata.get("parameter")
        if spec is None:
            continue
        if main is None:
            main = (f.name, spec)
        elif f.default is dataclasses.MISSING:
            values[f.name] = screen.scales.of(spec["unit"])
    if main is None:
        yield cls()
        return
    name, spec = main
    usual = screen.scales.of(spec["unit"])
    sizes = (0.02, 0.1, 0.4) if cls.id in _PROPORTIONAL else (0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0)
    signs = (1.0, -1.0) if spec["lower"] < 0 and cls.id not in _PROPORTIONAL else (1.0,)
    for size, sign in itertools.product(sizes, signs):
        try:
            yield cls(**{name: sign * size * usual, **values})
        except ValueError:
            continue


def _kinetic(block):
    base = [e for e in block.effects if e.role == "friction" and e.side == "motor" and e.rank == 0]
    return level(base, 1.0, 1.0, 0.0)


def _stiction(screen):
    kinetic, force = _kinetic(screen.block), screen.scales.force
    levels = (
        {kinetic * f for f in (1.03, 1.08, 1.15, 1.3, 1.5, 1.8, 2.3, 3.0)}
        if kinetic > 0.01 * force
        else set()
    )
    return [
        library.Stiction(x) for x in sorted(levels | {0.1 * force, 0.3 * force, 0.6 * force}) if x > kinetic
    ]


def _stribeck(screen):
    kinetic, s = _kinetic(screen.block), screen.scales
    low = max(kinetic, 0.02 * s.force)
    grid = itertools.product((1.1, 1.35, 1.8, 2.4), (0.05, 0.12, 0.3, 0.8))
    return [library.Stribeck(low * a, s.speed * b) for a, b in grid]


def _bristle(screen):
    kinetic, s = _kinetic(screen.block), screen.scales
    found = []
    for bend in (0.001, 0.003, 0.01, 0.03, 0.1, 0.3):
        k = max(kinetic, 0.05 * s.force) / (bend * s.position)
        found.append(library.Bristle(k, 0.5 * math.sqrt(k * s.mass)))
    return found


def _hard_stop(screen):
    reach = max(float(np.max(np.abs(r.y))) for r in screen.runs)
    return [library.HardStop(reach * f, e) for f in (0.999, 0.99, 0.96, 0.9) for e in (0.05, 0.5)]


def _saturation(screen):
    top = max(float(np.quantile(np.abs(r.u), 0.999)) for r in screen.runs)
    return [library.InputSaturation(top * f) for f in (0.97, 0.93, 0.87, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3)]


def _gain(screen):
    return [library.InputGain(g) for g in (0.7, 0.9, 0.97, 1.03, 1.1, 1.3)]


def _backlash(screen):
    s = screen.scales
    gaps = (0.003, 0.01, 0.03, 0.08, 0.2, 0.5)
    if screen.block.core.bodies == 2:
        return [library.Backlash(s.position * g, 0.2) for g in gaps]
    return [library.Backlash(s.position * g, 0.2, f) for g in gaps for f in (0.3, 0.6)]


def _compliance(screen):
    s = screen.scales
    shares = (0.3, 0.6) if screen.block.core.bodies == 1 else (0.5,)
    found = []
    for bend, share in itertools.product((0.003, 0.01, 0.03, 0.08, 0.2, 0.5), shares):
        k = share * s.force / (bend * s.position)
        damping = 0.12 * math.sqrt(k * share * (1 - share) * s.mass)
        found.append(library.Compliance(k, damping, share))
    return found


def _quantization(screen):
    """Find the grid to which values keep: where the mean of exp(2 pi j y / step) has modulus near one."""
    y = np.concatenate([r.y[r.use] for r in screen.runs])
    span = float(np.ptp(y))
    noise = math.sqrt(float(screen.residual @ screen.residual) / len(screen.residual))
    if span == 0 or noise == 0:
        return []
    # An error of the size seen belongs to a step of sqrt(12) times it; look half a decade to both sides.
    guess = math.sqrt(12) * noise
    low, high = 0.3 * guess, min(3.0 * guess, 2 * span)
    count = int(min(max((1 / low - 1 / high) * span * 6, 10), 4000))
    inverse = np.linspace(1 / high, 1 / low, count)
    some = y[:: max(1, len(y) // 4000)]
    contrast = np.array([abs(np.mean(np.exp(2j * math.pi * some * q))) for q in inverse])
    best = [int(np.argmax(contrast))]
    strong = np.flatnonzero(contrast > 0.8 * contrast[best[0]])
    best.append(int(strong[0]))  # the coarsest of the grids that fit as well
    steps = []
    for i in best:
        fine = np.linspace(inverse[max(i - 1, 0)], inverse[min(i + 1, count - 1)], 81)
        value = [abs(np.mean(np.exp(2j * math.pi * some * q))) for q in fine]
        steps.append(1 / fine[int(np.argmax(value))])
    return [library.SensorQuantization(s) for s in dict.fromkeys(steps)]


def _ripple(screen):
    """Try wavelengths over the stroke: sine and cosine are two small changes, fitted together."""
    s = screen.scales
    span = max(float(np.ptp(r.y)) for r in screen.runs)
    turns = list(np.geomspace(0.6, 12.0, 30)) + list(force_ripple_turns(screen, span))
    amplitude = 0.01 * s.force
    total = float(screen.residual @ screen.residual)
    scored = []
    for turn in turns:
        pair = []
        for phase in (0.0, math.pi / 2):
            block = attach(screen.block, library.PositionRipple(amplitude, span / turn, phase))
            change = screen.change(block)
            if change is None:
                break
            pair.append(screen.project(change))
        if len(pair) < 2:
            continue
        matrix = np.array(pair).T
        weights, *_ = np.linalg.lstsq(matrix, screen.residual, rcond=None)
        left = screen.residual - matrix @ weights
        scored.append((float(left @ left) / total, turn, weights))
    scored.sort(key=lambda x: x[0])
    found = []
    for _, turn, weights in scored[:5]:
        size = amplitude * float(np.hypot(*weights))
        phase = math.atan2(weights[1], weights[0])
        for factor in (1.0, 0.5):
            found.append(library.PositionRipple(min(size * factor, 2 * s.force), span / turn, phase))
    return found


def force_ripple_turns(screen: Screen, span: float, count: int = 5) -> list[float]:
    """Return the strongest periods of the force residual over position, as turns over the stroke `span`.

    The force that motion demands minus the force given, cleaned of mass, friction and offset by least squares
    where the mass moves; its spectrum is taken over position, not time.
    """
    tops: dict[float, float] = {}
    grid = np.linspace(0.5, 60.0, 600)
    power = np.zeros(len(grid))
    for run in screen.runs:
        dt = float(np.median(np.diff(run.t)))
        a = np.gradient(run.v, dt)
        moving = np.abs(run.v) > 0.2 * screen.scales.speed
        moving[:5] = moving[-5:] = False
        if np.count_nonzero(moving) < 100:
            continue
        x, v, u = run.y[moving], run.v[moving], run.u[moving]
        columns = np.column_stack([a[moving], np.sign(v), v, np.ones(len(v)), x, v * np.abs(v)])
        columns = columns / (np.linalg.norm(columns, axis=0) + 1e-300)
        w, *_ = np.linalg.lstsq(columns, u, rcond=None)
        left = u - columns @ w
        phase = np.exp(2j * math.pi * np.outer(grid / span, x))
        power += np.abs(phase @ left) ** 2 / len(x)
    for _ in range(count):
        i = int(np.argmax(power))
        if power[i] == 0:
            break
        tops[float(grid[i])] = power[i]
        power[max(i - 6, 0) : i + 7] = 0.0
    return list(tops)


_MAKERS: dict[str, Callable] = {
    "stiction": _stiction,
    "stribeck": _stribeck,
    "bristle": _bristle,
    "hard_stop": _hard_stop,
    "input_saturation": _saturation,
    "input_gain": _gain,
    "backlash": _backlash,
    "compliance": _compliance,
    "sensor_quantization": _quantization,
    "position_ripple": _ripple,
}
