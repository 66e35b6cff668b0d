"""What half and twice of tuned numbers change on a few rigs and loops.

    python benchmarks/half_and_twice.py smoothing|planning|refit|horizons|records|ladder|tables [NAME ...]
    python benchmarks/half_and_twice.py predictions|orbits|maps [NAME ...]

NAME is a constant of a ``thresholds.py``, ``NAME[1]`` one number of several, ``A+B`` both at once. One line
for each of the two factors and each rig: what comes out otherwise than with the number as it is, and the
processor time over that of the number as it is. Compiled constants, and those that default arguments hold,
keep their values.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
import time
from pathlib import Path
from types import SimpleNamespace

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("NUMBA_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import control as ct
import numpy as np
from trust_loops import FAMILIES, draw
from verdicts import RIGS, drawn

import ctrl_df as cdf
from ctrl_df.identify.planning.inputs import input_that_separates
from ctrl_df.identify.residuals.horizons import error_by_horizon
from ctrl_df.identify.smoothing.missing_force import missing_force


def smoothing(name) -> dict:
    """Return what is said of the force that a model lacks, its other parameters being true."""
    rig, model = drawn(*RIGS[name][:2], **RIGS[name][2])
    mine = model.parameters
    model = model.with_parameters({k: v for k, v in rig.truth.items() if k in mine})
    m = missing_force(model, rig.train[0].measurement())
    return {"force": m.force, "std": m.std, "size": m.size, "noise": m.noise, **m.shares}


def planning(name) -> dict:
    """Return the input planned for the true block and the user's model."""
    rig, model = drawn(*RIGS[name][:2], **RIGS[name][2])
    asked = SimpleNamespace(train=[rig.train[0].measurement()])
    found = input_that_separates(asked, [model, rig.true_block], ("a", "b"))
    return {"kind": found.kind, "separation": found.separation, "stroke": found.stroke}


def records(name) -> dict:
    """Return what a diagnosis says."""
    rig, model = drawn(*RIGS[name][:2], **RIGS[name][2])
    free = [k for k, p in model.parameters.items() if p.free and k not in rig.known]
    d = cdf.diagnose(model, rig.train[0].measurement(), holdout=rig.holdout[0].measurement(), free=free)
    first = d.ranking[:3]
    return {
        "verdict": d.verdict, "first": " ".join(c.id for c in first), "evidence": [c.evidence for c in first],
        "error": d.best.nrmse_holdout if d.best else d.nrmse_holdout,
        "kinds": " ".join(d.where.kinds),
    }  # fmt: skip


def ladder(name) -> dict:
    """Return the model that a ladder ends with."""
    options = {k: v for k, v in RIGS[name][2].items() if k != "ladder"}
    rig, model = drawn(*RIGS[name][:2], **options)
    free = [k for k, p in model.parameters.items() if p.free and k not in rig.known]
    study = cdf.improve(model, rig.train[0].measurement(), rig.holdout[0].measurement(), free=free)
    return {"effects": " ".join(study.effects), "error": study.steps[-1].nrmse_holdout}


def refit(name) -> dict:
    """Return a refit of the true structure from values a quarter off, to either side in turn."""
    rig, _ = drawn(*RIGS[name][:2], **RIGS[name][2])
    block = rig.true_block
    free = [k for k, p in block.parameters.items() if p.free and p.value > 0 and k not in rig.known]
    off = {k: block.parameters[k].value * (1.25, 0.8)[i % 2] for i, k in enumerate(free)}
    fit = cdf.refit(with_allowed(block, off), rig.train[0].measurement(), free=free)
    return {"nrmse": fit.nrmse} | {k: p.value for k, p in fit.parameters.items()}


def with_allowed(block, values):
    """Return a block with those of these values that it allows."""
    for name, value in values.items():
        try:
            block = block.with_parameters({name: value})
        except ValueError:
            continue
    return block


def horizons(name) -> dict:
    """Return the error of the true structure over horizons."""
    rig, _ = drawn(*RIGS[name][:2], **RIGS[name][2])
    return {"nrmse": error_by_horizon(rig.true_block, [rig.train[0].measurement()]).nrmse}


def tables(name) -> dict:
    """Return what a diagnosis of describing functions says."""
    import test_frequency as known

    data, candidates = {
        "drag": (known.table(grid=known.MIDDLE, DRAG=60.0), ("quadratic_drag", "stribeck", "linear_spring")),
        "delay": (known.table(grid=known.MIDDLE, DELAY=0.012), ("input_delay", "quadratic_drag")),
        "breakaway": (known.lower(STATIC=8.5), ("stiction", "quadratic_drag")),
        "gap": (
            known.table(
                grid=(known.MIDDLE[0], tuple(known.OMEGA)),
                JOINT=known.physics.IMPACT, LOAD=4.0, GAP=2e-3, RESTITUTION=0.3,
            ),
            ("backlash", "linear_spring"),
        ),
    }[name]  # fmt: skip
    d = cdf.diagnose(known.user_block(), data, candidates=candidates)
    first = d.ranking[:2]
    return {
        "verdict": d.verdict, "first": " ".join(c.id for c in first), "evidence": [c.evidence for c in first],
        "errors": [v for c in first[:1] for v in c.errors.values()],
    }  # fmt: skip


def predictions(name) -> dict:
    """Return the limit cycles that are predicted of a loop."""
    return told(predicted(name).limit_cycles, "grade")


def predicted(name):
    """Return a describing function response of a loop of `trust_loops`, named by family and seed."""
    family, _, seed = name.rpartition(" ")
    loop = draw(family, np.random.default_rng([1, int(seed)]))
    return cdf.describing_function_response(loop.H, loop.block, *loop.box(24, 30))


def told(cycles, say) -> dict:
    """Return what is said of limit cycles, one `say` among it."""
    return {
        "amplitudes": [c.amplitude for c in cycles], "omegas": [c.omega for c in cycles],
        "corrected": [x for c in cycles for x in getattr(c, "corrected", None) or ()],
        "words": " ".join(f"{c.stable} {getattr(c, say)}" for c in cycles),
    }  # fmt: skip


FRICTION, BACKLASH = cdf.pid(2000, 44250, 130), cdf.pid(1800, 19500, 100)

SOUGHT = {
    "sliding": (FRICTION, cdf.friction_mass(9, 5, 0.5), (11.082, 13.898)),
    "hunting": (FRICTION, cdf.friction_mass(9, 5, 0.5, static=5.5), None),
    "no hunting": (FRICTION, cdf.friction_mass(9, 5, 0.5, static=6.0), None),
    "chatter": (BACKLASH, cdf.backlash_masses(1, 8, 0.018, 0.2), (17.75, 14.84)),
    "rattle": (BACKLASH, cdf.backlash_masses(1, 8, 0.018, 0.8), (10.278, 125.754)),
}
"""Loops of `tests/test_exact_orbits.py`, and the guesses from which an orbit is sought."""


def orbits(name) -> dict:
    """Return the exact limit cycles of a loop."""
    if name in SOUGHT:
        controller, block, guess = SOUGHT[name]
        found = cdf.find_limit_cycle(cdf.closed_loop(controller, block), guess=guess)
        return told([found] if found else [], "status")
    if name in ("fold", "border"):
        import test_trust as known

        response = known.near_fold() if name == "fold" else cdf.describing_function_response(
            FRICTION, SOUGHT["sliding"][1], np.geomspace(5.8, 60, 12), np.geomspace(5, 40, 12)
        )  # fmt: skip
        check = cdf.verify(response)
        said = " ".join([*(row.verdict for row in check), *(row.fate for row in check.fate)])
        edges = [edge for b in check.fate.borders for edge in (b.below, b.above)]
        return told(check.orbits, "status") | {"verdicts": said, "borders": edges}
    return told(cdf.verify(predicted(name)).orbits, "status")


def maps(name) -> dict:
    """Return a map over two gains."""
    friction, hunting = SOUGHT["sliding"][1], SOUGHT["hunting"][1]
    at, checks = {"kp": (500, 4000), "ki": (0, 80000), "kd": 130}, 0
    if name == "ki, kd":
        at = {"kp": 2000, "ki": (0, 80000), "kd": (20, 300)}
    elif name == "saturation":
        friction, at = (
            cdf.saturation(1),
            {"kp": (4, 24), "ki": (0.0, 0.02), "plant": ct.tf([1], [1, 3, 3, 1])},
        )
    elif name == "checked":
        friction, checks = hunting, 16
    found = cdf.limit_cycle_map(friction, **at, n=10, exact_check=checks)
    return {
        "verdicts": " ".join(found.verdict.ravel()), "omegas": np.nan_to_num(found.omega).ravel(),
        "folds": [len(f) for f in found.folds], "borders": [len(found.linear_border)],
    }  # fmt: skip


PARTS = {
    "smoothing": (smoothing, ("ripple, open", "stribeck, open", "spring, open", "delay, PID")),
    "planning": (planning, ("ripple, open", "stribeck, open", "spring, open", "drag, gap")),
    "records": (
        records,
        ("ripple, open", "stribeck, open", "backlash, open", "joint, PID", "outside, open", "drag, gap"),
    ),
    "ladder": (ladder, ("two, ladder",)),
    "refit": (refit, ("stribeck, open", "spring, open", "backlash, open", "joint, PID")),
    "horizons": (horizons, ("ripple, open", "stribeck, open", "joint, PID")),
    "tables": (tables, ("drag", "delay", "breakaway", "gap")),
    "predictions": (
        predictions,
        tuple(f"{f} {k}" for f in FAMILIES for k in range(2)),
    ),
    "orbits": (
        orbits,
        (
            *SOUGHT,
            "fold",
            "border",
            "friction 1",
            "gap 1",
            "saturation 0",
            "saturation 1",
            "dead zone 0",
            "dead zone 1",
            "relay 0",
            "relay 1",
        ),
    ),
    "maps": (maps, ("kp, ki", "ki, kd", "saturation", "checked")),
}


def scaled(value, factor, at):
    """Return a number, or those of a tuple or only the one `at` a place, times a factor."""
    if isinstance(value, tuple):
        return tuple(scaled(v, factor, None) if at in (None, i) else v for i, v in enumerate(value))
    if isinstance(value, dict):
        return {k: scaled(v, factor, None) for k, v in value.items()}
    new = value * factor
    return max(int(new), 1) if isinstance(value, int) else new


def modules_with(name):
    """Return the modules of the library that have a constant of this name from a file of thresholds."""
    modules = [m for k, m in sys.modules.items() if k.startswith("ctrl_df") and name in vars(m)]
    values = [vars(m)[name] for m in modules if m.__name__.endswith(".thresholds")]
    return [m for m in modules if any(vars(m)[name] is value for value in values)]


def changes(before, after) -> list[str]:
    """Return what came out otherwise: of signals, the rms of the difference over that of the signal."""
    said = []
    for key, a in before.items():
        b = after.get(key)
        if isinstance(a, str):
            if a != b:
                said.append(f"{key} {a} -> {b}")
            continue
        a, b = np.atleast_1d(a), np.atleast_1d(b)
        if len(a) != len(b):
            said.append(f"{key} {len(a)} -> {len(b)}")
        elif len(a) > 10:
            change = np.sqrt(np.mean((a - b) ** 2) / np.mean(a**2))
            said += [f"{key} by {change:.1%}"] if change > 1e-3 else []
        elif not np.allclose(a, b, rtol=1e-3, atol=1e-3 * np.max(np.abs(a), initial=0.0)):
            said.append(f"{key} {_few(a)} -> {_few(b)}")
    return said


def _few(values) -> str:
    return ", ".join(f"{v:.4g}" for v in values)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("part", choices=PARTS)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--only", default="")
    args = parser.parse_args()
    run, of = PARTS[args.part]
    of = [rig for rig in of if re.search(args.only, rig)]

    def timed(rig):
        begun = time.process_time()
        return run(rig), time.process_time() - begun

    for rig in of:
        run(rig)
    plain = {rig: timed(rig) for rig in of}
    for rig, (result, took) in plain.items():
        print(f"{rig}: {took:.2f} s", {k: v for k, v in result.items() if np.size(v) < 10}, flush=True)
    for wish in args.names:
        constants = re.findall(r"(\w+)(?:\[(\d+)\])?", wish)
        for factor in (0.5, 2.0):
            kept = [(m, n, vars(m)[n]) for n, _ in constants for m in modules_with(n)]
            for n, at in constants:
                for m in modules_with(n):
                    setattr(m, n, scaled(vars(m)[n], factor, int(at) if at else None))
            for rig, (result, took) in plain.items():
                try:
                    now, spent = timed(rig)
                    said = "; ".join(changes(result, now)) or "the same"
                except Exception as error:
                    said, spent = f"{type(error).__name__}: {error}", np.nan
                print(f"{wish} x {factor:g}, {rig}: {said} ({spent / took:.2f})", flush=True)
            for m, n, value in kept:
                setattr(m, n, value)


if __name__ == "__main__":
    main()
