"""Verdicts of a few rigs, to be compared before and after a change.

    python benchmarks/verdicts.py [--jobs 2] [--only PART] [--save FILE] [--against FILE]

One line a rig: verdict, the first three of the ranking with their evidence, errors, processor and wall time.
`--against` sets a saved table beside it and tells what changed: verdict, order, evidence, parameters by more
than a tenth of their standard errors, and by how much the time. Where times count let one job run alone.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
if "--jobs" in sys.argv:
    os.environ.setdefault("NUMBA_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import numpy as np
import rigs

import ctrl_df as cdf

OPEN, PID = dict(snr_db=60.0), dict(snr_db=60.0, closed_loop=True)
NOISY = dict(snr_db=40.0, noise="coloured")

RIGS = {
    "ripple, open": ("position_ripple", 6001, OPEN | dict(excitation="multisine")),
    "stribeck, open": ("stribeck", 6002, NOISY | dict(excitation="chirp")),
    "spring, open": ("linear_spring", 6003, OPEN | dict(excitation="steps", noise="encoder")),
    "backlash, open": ("backlash", 6004, OPEN | dict(excitation="multisine")),
    "saturation, open": ("input_saturation", 6005, NOISY | dict(excitation="steps")),
    "stop, open": ("hard_stop", 6006, OPEN | dict(excitation="chirp")),
    "rubbing load, open": ("load_friction", 6007, OPEN | dict(excitation="multisine")),
    "delay, PID": ("input_delay", 6008, PID | dict(excitation="multisine")),
    "joint, PID": ("compliance", 6009, PID | dict(excitation="chirp")),
    "drag, gap": ("quadratic_drag", 6010, OPEN | dict(excitation="multisine", gap=True)),
    "spring, gap, PID": ("linear_spring", 6011, PID | dict(excitation="chirp", gap=True)),
    "nothing, open": ((), 6012, OPEN | dict(excitation="steps")),
    "nothing, PID": ((), 6013, NOISY | dict(closed_loop=True)),
    "outside, open": ("friction_zone", 6014, OPEN | dict(outside=True)),
    "two, ladder": (("stribeck", "linear_spring"), 6015, OPEN | dict(ladder=True)),
}


def drawn(hidden, seed, *, gap=False, outside=False, **options):
    """Return a rig and the user's model of it; `gap`: with a gap that the model has, too, 10 % off."""
    if outside:
        rig = rigs.draw_outside(seed, kind=hidden, **options)
        return rig, rig.baseline
    if not hidden:
        rig = rigs.draw_wrong_parameters(seed, **options)
        return rig, rig.baseline
    if not gap:
        rig = rigs.draw(hidden, seed, **options)
        return rig, rig.baseline
    rig = rigs.draw(("backlash", hidden), seed, **options)
    of = {k.partition(".")[2]: v for k, v in rig.truth.items() if k.startswith("backlash.")}
    return rig, rig.baseline.with_effect(cdf.Backlash(**of | {"gap": 1.1 * of["gap"]}))


def row(name) -> dict:
    """Return what is said of one rig, and what it took."""
    hidden, seed, options = RIGS[name]
    ladder = options.get("ladder", False)
    rig, model = drawn(hidden, seed, **{k: v for k, v in options.items() if k != "ladder"})
    free = [k for k, p in model.parameters.items() if p.free and k not in rig.known]
    train, held = rig.train[0].measurement(), rig.holdout[0].measurement()
    wall, processor = time.perf_counter(), time.process_time()
    if ladder:
        study = cdf.improve(model, train, held, free=free, max_effects=3)
        found, first, last = study.verdict, study.effects, study.model
        candidates = [s.diagnosis.ranking[0] for s in study.steps if s.diagnosis and s.diagnosis.ranking]
        error = study.steps[-1].nrmse_holdout
    else:
        d = cdf.diagnose(model, train, holdout=held, free=free)
        found, candidates = d.verdict, d.ranking[:3]
        first = tuple(c.id for c in candidates)
        last = d.best.model if d.best else d.model
        error = d.best.nrmse_holdout if d.best else d.nrmse_holdout
    times = time.perf_counter() - wall, time.process_time() - processor
    return dict(
        verdict=found, first=list(first), evidence=[c.evidence for c in candidates], error=error,
        parameters={k: p.value for k, p in last.parameters.items()}, truth=rig.truth,
        errors={f"{c.model.newest}.{k}": e for c in candidates[:1] for k, e in c.errors.items()},
        wall=times[0], processor=times[1],
    )  # fmt: skip


def changes(before, after) -> list[str]:
    """Return what is not as it was."""
    found = []
    for key in ("verdict", "first"):
        if before[key] != after[key]:
            found.append(f"{key} {before[key]} -> {after[key]}")
    pairs = zip(before["evidence"], after["evidence"], strict=False)
    if any(abs(a - b) > 1 + 0.01 * abs(a) for a, b in pairs):
        found.append(f"evidence {_rounded(before['evidence'])} -> {_rounded(after['evidence'])}")
    if abs(after["error"] - before["error"]) > 0.01 * before["error"]:
        found.append(f"held-out error {before['error']:.4g} -> {after['error']:.4g}")
    for k, a in before["parameters"].items():
        b = after["parameters"].get(k, np.nan)
        enough = max(0.1 * before["errors"].get(k, 0.0), 1e-3 * abs(a))
        if not abs(a - b) <= enough:
            true = before["truth"].get(k)
            found.append(f"{k} {a:.5g} -> {b:.5g}" + (f" (true {true:.5g})" if true is not None else ""))
    return found


def _rounded(values) -> list[float]:
    return [round(v, 1) for v in values]


def main(arguments=None) -> int:
    """Print, save and compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--only", default="")
    parser.add_argument("--save", default="")
    parser.add_argument("--against", default="")
    args = parser.parse_args(arguments)
    before = json.loads(Path(args.against).read_text()) if args.against else {}
    names = [n for n in RIGS if args.only in n]
    table, ratios = {}, []
    with ProcessPoolExecutor(args.jobs) as pool:
        for name, r in zip(names, pool.map(row, names), strict=True):
            table[name] = r
            print(
                f"{name:<20} {r['verdict']:<10} {', '.join(r['first']):<50} {_rounded(r['evidence'])} "
                f"{r['error']:.4g}, {r['processor']:.1f} s of processor, {r['wall']:.1f} s", flush=True,
            )  # fmt: skip
            if name in before:
                ratios.append(before[name]["processor"] / r["processor"])
                for change in changes(before[name], r):
                    print(f"    {change}")
                print(f"    {ratios[-1]:.2f} times as fast")
    if ratios:
        print(f"all: {float(np.exp(np.mean(np.log(ratios)))):.2f} times as fast")
    if args.save:
        Path(args.save).write_text(json.dumps(table, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
