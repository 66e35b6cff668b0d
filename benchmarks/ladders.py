"""Ladders to two and three hidden effects, and how often all of them are in the final model.

    python benchmarks/ladders.py [--only PART] [--candidates IDS] [--save FILE]

The whole library unless told otherwise; one line a rig. The rigs are drawn with seeds that no other benchmark
or test has.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import rigs

import ctrl_df as cdf

PID, GAP, NOISY = dict(closed_loop=True), dict(gap=True), dict(snr_db=40.0, noise="coloured")
SLOW = dict(n=5_000, dt=2e-3)

RIGS = {
    "two, stribeck, spring": (("stribeck", "linear_spring"), 7101, dict()),
    "two, coulomb, drag": (("coulomb", "quadratic_drag"), 7102, dict(excitation="chirp")),
    "two, ripple, delay": (("position_ripple", "input_delay"), 7103, dict(excitation="steps")),
    "two, asymmetric, cubic, noisy": (("asymmetric_viscous", "cubic_spring"), 7104, NOISY),
    "two, stribeck, offset, PID": (("stribeck", "constant_force"), 7105, PID | dict(excitation="chirp")),
    "two, joint, ripple": (("compliance", "position_ripple"), 7106, dict()),
    "two, spring, saturation, PID": (("linear_spring", "input_saturation"), 7107, PID),
    "two, drag, offset, gap": (("quadratic_drag", "constant_force"), 7108, GAP),
    "three, coulomb, offset, ripple": (("coulomb", "constant_force", "position_ripple"), 7201, SLOW),
    "three, stribeck, spring, delay": (("stribeck", "linear_spring", "input_delay"), 7202, SLOW),
    "three, asymmetric, cubic, offset, PID": (
        ("asymmetric_viscous", "cubic_spring", "constant_force"), 7203, SLOW | PID,
    ),
    "three, drag, spring, ripple": (("quadratic_drag", "linear_spring", "position_ripple"), 7204, SLOW),
    "three, stribeck, drag, offset": (
        ("stribeck", "quadratic_drag", "constant_force"), 7205, SLOW | dict(excitation="chirp"),
    ),
}  # fmt: skip
"""Effects hidden, seed, circumstances by name."""


def several(hidden, seed, *, gap=False, **options):
    """Return a rig with several effects hidden and the user's model of it."""
    if not gap:
        rig = rigs.draw(hidden, seed, **options)
        return rig, rig.baseline
    rig = rigs.draw(("backlash", *hidden), seed, **options)
    of = {k.partition(".")[2]: v for k, v in rig.truth.items() if k.startswith("backlash.")}
    return rig, rig.baseline.with_effect(cdf.Backlash(**of | {"gap": 1.1 * of["gap"]}))


def row(name, candidates=None) -> dict:
    """Return what the ladder comes to on one rig."""
    hidden, seed, options = RIGS[name]
    rig, model = several(hidden, seed, **options)
    free = [k for k, p in model.parameters.items() if p.free and k not in rig.known]
    train, held = rig.train[0].measurement(), rig.holdout[0].measurement()
    wall, processor = time.perf_counter(), time.process_time()
    study = cdf.improve(model, train, held, free=free, candidates=candidates)
    seconds = time.perf_counter() - wall, time.process_time() - processor
    ids = [e.id for e in study.model.effects[len(model.effects) :]]
    found = [h for h in hidden if {h, *rig.equivalents.get(h, ())} & set(ids)]
    return dict(
        name=name, right=len(found) == len(hidden), found=ids, hidden=list(hidden), verdict=study.verdict,
        more=len(ids) - len(hidden), steps=[s.name for s in study.steps], held=study.steps[-1].nrmse_holdout,
        noise=rig.holdout[0].noise / float(rig.holdout[0].clean.std()), wall=seconds[0], processor=seconds[1],
        neighbours=str(getattr(study, "neighbours", "")),
    )  # fmt: skip


def main() -> None:
    """Print a line a rig, and how many were right."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--only", default="")
    parser.add_argument("--candidates", default="", help="ids, by commas")
    parser.add_argument("--save", default="")
    args = parser.parse_args()
    rows = []
    for name in (n for n in RIGS if args.only in n):
        try:
            rows.append(row(name, args.candidates.split(",") if args.candidates else None))
        except Exception as reason:
            rows.append(dict(name=name, right=False, found=[repr(reason)], wall=0.0, processor=0.0))
        r = rows[-1]
        print(f"{name}: {'right' if r['right'] else 'WRONG'}, {r['found']}, {r.get('steps')}, "
              f"{r.get('verdict')}, {r.get('held', 0):.3g} (noise {r.get('noise', 0):.3g}), "
              f"{r['wall']:.0f} s, {r['processor']:.0f} s of processor", flush=True)  # fmt: skip
        if args.save:
            with open(args.save, "a") as file:
                file.write(json.dumps(r) + "\n")
    for kind in ("two", "three"):
        part = [r["right"] for r in rows if r["name"].startswith(kind)]
        print(f"{kind} hidden: {sum(part)} of {len(part)} right")


if __name__ == "__main__":
    main()
