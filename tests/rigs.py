"""Virtual rigs: drives with something hidden, drawn at random, measured as a laboratory would measure them.

A rig is a base model (mass, Coulomb and viscous friction) plus hidden physics, sized so that the base model,
refitted, errs by 3 to 200 times the noise. The user's model `baseline` lacks the hidden effect and has
parameters 10 to 30 % off. Everything follows from the seed.

    rig = draw("position_ripple", seed=7, excitation="chirp", snr_db=40)
    rig = draw(("stribeck", "input_delay"), seed=8, closed_loop=True)
    rig = draw_none(9); draw_wrong_parameters(10); draw_outside(11, kind="time_varying_mass")
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from rig_setup import Lost, Record, Setup, is_free, pack
from rig_sizes import EFFECTS, ORDER, OUTSIDE

from ctrl_df.blocks.effect import effect_class
from ctrl_df.blocks.mechanism import Mass
from ctrl_df.blocks.rotary import Inertia

EXCITATIONS = ("multisine", "chirp", "steps")
NOISES = ("white", "coloured", "encoder")

__all__ = [
    "EFFECTS",
    "EQUIVALENT",
    "EXCITATIONS",
    "NOISES",
    "ORDER",
    "OUTSIDE",
    "Record",
    "Rig",
    "block",
    "draw",
    "draw_none",
    "draw_outside",
    "draw_wrong_parameters",
    "pack",
]

# The same map on the records of a rig: naming one for the other is right.
EQUIVALENT = {
    "asymmetric_coulomb": frozenset({"constant_force"}),
    "constant_force": frozenset({"asymmetric_coulomb"}),
    "input_delay": frozenset({"sensor_delay"}),
    "sensor_delay": frozenset({"input_delay"}),
}


@dataclass(frozen=True, eq=False)
class Rig:
    """A drawn rig.

    Attributes
    ----------
    hidden : tuple of str
        Ids of the hidden effects (of `OUTSIDE` kinds for rigs outside the library).
    truth : dict
        Every parameter of the true plant by the library's names; ``outside.*`` for what the library lacks.
    baseline, true_block : ctrl_df block
        The user's model; the plant's (None outside the library).
    train, holdout : tuple of Record
        `holdout` has another excitation than `train`.
    known : tuple of str
        Baseline parameters that are exact and not to be refitted (the weighed mass of an ``input_gain`` rig).
    equivalents : dict
        Per hidden id the ids that are the same map on such records.
    regions : tuple of str
        For rigs outside the library: the kinds of region that locate the fault.
    ratio : float
        Error of the refitted true-structure base model over the noise, on the training record.
    controller : tuple or None
        ``(kp, ki, kd, tf, limit)`` of the sampled PID in closed loop.
    slack : float
        ``x_motor - x`` at the start of every record [m], where there is a gap. Records start at rest, the
        measured body at x = 0.
    """

    name: str
    seed: int
    hidden: tuple[str, ...]
    truth: dict[str, float]
    baseline: Any
    true_block: Any
    train: tuple[Record, ...]
    holdout: tuple[Record, ...]
    known: tuple[str, ...] = ()
    equivalents: dict[str, frozenset[str]] = field(default_factory=dict)
    regions: tuple[str, ...] = ()
    ratio: float = 0.0
    snr_db: float = 60.0
    controller: tuple[float, ...] | None = None
    slack: float = 0.0


# --- drawing --------------------------------------------------------------------------------------


def draw(hidden, seed, **options) -> Rig:
    """Draw a rig with one hidden effect (an id) or several (a tuple of ids).

    Parameters
    ----------
    hidden : str or tuple of str
        Effect ids of the library.
    seed : int
        Everything follows from it.
    excitation : {'multisine', 'chirp', 'steps'}
        Force of the training record, or the reference in closed loop.
    snr_db : float
        rms of the centred position over rms of the noise.
    closed_loop : bool
        PID tracking; the force it gave is the recorded input.
    noise : {'white', 'coloured', 'encoder'}
        ``encoder``: white noise under an encoder whose step is 1 to 3 times the noise.
    ratio : float or None
        Error of the refitted base model over the noise; None: drawn in the range `RATIO`.
    velocity : bool
        Whether the records carry a noisy velocity channel.
    n, dt : int, float
        Samples and sample time [s].
    """
    ids = (hidden,) if isinstance(hidden, str) else tuple(hidden)
    for name in ids:
        effect_class(name)
    return _draw(tuple(sorted(ids, key=ORDER.index)), None, seed, "+".join(ids), **options)


def draw_none(seed, **options) -> Rig:
    """Draw a rig with nothing hidden and nominal values that are true."""
    return _draw((), None, seed, "none", off=(0.0, 0.0), **options)


def draw_wrong_parameters(seed, **options) -> Rig:
    """Draw a rig with nothing hidden but nominal values 10 to 30 % off."""
    return _draw((), None, seed, "wrong parameters", **options)


def draw_outside(seed, kind=None, **options) -> Rig:
    """Draw a rig with an effect the library does not have; `kind` out of `OUTSIDE`, None: drawn."""
    if kind is None:
        kind = sorted(OUTSIDE)[int(np.random.default_rng([seed, 77]).integers(len(OUTSIDE)))]
    return _draw((), kind, seed, kind, **options)


def _draw(
    ids, outside, seed, name, *, excitation="multisine", snr_db=60.0, closed_loop=False, noise="white",
    ratio=None, velocity=False, n=10_000, dt=1e-3, off=(0.1, 0.3),
):  # fmt: skip
    if excitation not in EXCITATIONS or noise not in NOISES:
        raise ValueError(
            f"excitation out of {EXCITATIONS} and noise out of {NOISES}; got {excitation!r}, {noise!r}."
        )
    for attempt in range(25):
        rng = np.random.default_rng([seed, attempt, *name.encode()])
        try:
            setup = Setup(rng, ids, outside, excitation, snr_db, closed_loop, noise, n, dt)
            rig = _attempt(setup, name, seed, ratio, velocity, off)
        except Lost:
            rig = None
        if rig is not None:
            return rig
    raise RuntimeError(f"no rig of kind {name!r} could be sized from seed {seed} in 25 attempts")


def _attempt(setup, name, seed, ratio, velocity, off):
    rng = setup.rng
    added, achieved = setup.size(ratio)
    if added is None:
        return None
    truth = {**setup.base, **added}
    train = setup.record(truth, setup.excitation, f"{name} train", velocity)
    others = [e for e in EXCITATIONS if e != setup.excitation]
    for _ in range(4):
        held = setup.record(truth, str(rng.choice(others)), f"{name} held out", velocity, sigma=train.noise)
        if not added or setup.matters(truth, held):
            break
    else:
        return None
    base = setup.base
    known = ("mass",) if "input_gain" in setup.ids else ()
    nominal = {k: v if k in known else _shift(rng, k, v, off) for k, v in base.items() if is_free(k)}
    nominal.update({k: v for k, v in base.items() if not is_free(k)})
    turns = any(effect_class(i).turns for i in setup.ids)
    return Rig(
        name=f"{name} #{seed}", seed=seed, hidden=setup.ids if setup.outside is None else (setup.outside,),
        truth=truth, baseline=block(nominal, turns),
        true_block=block(truth) if setup.outside is None else None,
        train=(train,), holdout=(held,), known=known,
        equivalents={i: EQUIVALENT.get(i, frozenset()) for i in setup.ids},
        regions=OUTSIDE[setup.outside].regions if setup.outside else (), ratio=achieved, snr_db=setup.snr_db,
        controller=setup.controller,
        slack=setup.slack * truth.get("backlash.gap", 0.0),
    )  # fmt: skip


def _shift(rng, name, value, off):
    factor = 1 + float(rng.choice([-1, 1]) * rng.uniform(*off))
    return min(value * factor, 0.95) if name.endswith("load_fraction") else value * factor


def block(values: dict[str, float], turns: bool = False):
    """Return the ctrl_df block with these parameters; effects in the rigs' canonical order."""
    groups: dict[str, dict[str, float]] = {}
    for key, value in values.items():
        if "." in key:
            effect, parameter = key.split(".")
            groups.setdefault(effect, {})[parameter] = value
    effects = [effect_class(i)(**groups[i]) for i in ORDER if i in groups]
    if any(e.turns for e in effects) or turns:
        return Inertia(values["mass"], effects, measured="load")
    return Mass(values["mass"], effects, measured="load")
