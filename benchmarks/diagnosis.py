"""Hidden-effect tests as a table: python benchmarks/diagnosis.py [--seeds 2] [--first 1000] [--effects a,b] [--peers].

Every rig is drawn anew (excitation, SNR, colour of noise, loop open or closed follow from the seed), diagnosed,
and scored. Peers: a LASSO on the inverse-dynamics residual (scikit-learn) and pysindy, where installed.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from collections import defaultdict
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
import rigs

from ctrl_df.identify.diagnose import diagnose
from ctrl_df.identify.improve import improve


def options(seed):
    """Return the circumstances that follow from a seed."""
    return dict(
        excitation=rigs.EXCITATIONS[seed % 3], snr_db=(60.0, 40.0)[seed // 3 % 2], noise=rigs.NOISES[seed // 2 % 3],
        closed_loop=seed % 4 == 3,
    )  # fmt: skip


def free_of(rig):
    """Return the parameters the user does not know exactly."""
    return [k for k, p in rig.baseline.parameters.items() if p.free and k not in rig.known]


def run_single(effect, seed):
    """Return one row for one hidden effect."""
    rig = rigs.draw(effect, seed, **options(seed))
    train, held = ([r.measurement() for r in part] for part in (rig.train, rig.holdout))
    began = time.perf_counter()
    found = diagnose(rig.baseline, train, holdout=held, free=free_of(rig))
    seconds = time.perf_counter() - began
    right = {effect, *rig.equivalents.get(effect, ())}
    named = [{c.id, *c.equivalents} for c in found.ranking]
    hits = [bool(n & right) for n in named]
    spread = float(np.std(held[0].y))
    floor = rig.holdout[0].noise / spread
    chosen = found.best.nrmse_holdout if found.best else found.nrmse_holdout
    return dict(
        top1=bool(found.verdict in ("effect", "ambiguous") and hits[0]), top3=any(hits[:3]), verdict=found.verdict,
        over=chosen / floor, seconds=seconds, named=found.ranking[0].id,
    )  # fmt: skip


def run_none(draw, seed):
    """Return whether nothing was found where nothing is."""
    rig = draw(seed, **options(seed))
    found = diagnose(rig.baseline, rig.train[0].measurement(), holdout=rig.holdout[0].measurement())
    return found.verdict == "none"


def run_outside(kind, seed):
    """Return (recognised, region right) for an effect that the library lacks."""
    rig = rigs.draw_outside(seed, kind=kind, **options(seed))
    found = diagnose(rig.baseline, rig.train[0].measurement(), holdout=rig.holdout[0].measurement())
    return found.verdict == "unknown", bool(set(found.regions) & set(rig.regions))


def run_pair(pair, seed):
    """Return whether both of two hidden effects end up in the model."""
    rig = rigs.draw(pair, seed, **options(seed))
    study = improve(
        rig.baseline,
        rig.train[0].measurement(),
        rig.holdout[0].measurement(),
        free=free_of(rig),
        max_effects=3,
    )
    named = set(study.effects)
    for step in study.steps:
        named |= set(step.equivalents) if step.effect in study.effects else set()
    return all(({e} | set(rig.equivalents.get(e, ()))) & named for e in pair)


# --- peers ------------------------------------------------------------------------------------------


def library_columns(record):
    """Return smoothed motion and the columns a user would offer to a sparse regression, by effect id."""
    v, a = record.velocity_estimate(), record.acceleration_estimate()
    x, u = record.y, record.u
    columns = {
        "mass": a, "coulomb": np.sign(v), "viscous": v, "quadratic_drag": v * np.abs(v), "asymmetric_viscous": np.abs(v),
        "constant_force": np.ones_like(v), "linear_spring": x, "cubic_spring": x**3, "input_gain": u,
        "stribeck": np.sign(v) * np.exp(-np.square(v / (0.1 * np.std(v) + 1e-12))),
        "input_delay": np.gradient(u, record.t),
    }  # fmt: skip
    return columns, u, np.abs(v) > 0.02 * np.std(v)


def lasso_names(rig):
    """Name the largest extra term of a LASSO on the inverse-dynamics residual; None if none or not installed."""
    try:
        from sklearn.linear_model import LassoCV
    except ImportError:
        return None
    columns, force, good = library_columns(rig.train[0].measurement())
    base = np.column_stack([columns[k] for k in ("mass", "coulomb", "viscous")])[good]
    extra = [k for k in columns if k not in ("mass", "coulomb", "viscous", "input_gain")]
    q, _ = np.linalg.qr(base / np.linalg.norm(base, axis=0))
    target = force[good] - q @ (q.T @ force[good])
    matrix = np.column_stack([columns[k][good] for k in extra])
    matrix = matrix - q @ (q.T @ matrix)
    matrix /= np.std(matrix, axis=0) + 1e-12
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        weights = np.abs(LassoCV(cv=5).fit(matrix, target).coef_)
    return extra[int(np.argmax(weights))] if weights.max() > 0 else "none"


def main(arguments=None):
    """Run and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--first", type=int, default=1000)
    parser.add_argument("--effects", default="")
    parser.add_argument("--peers", action="store_true")
    parser.add_argument("--pairs", type=int, default=3)
    args = parser.parse_args(arguments)
    seeds = range(args.first, args.first + args.seeds)
    effects = args.effects.split(",") if args.effects else list(rigs.EFFECTS)
    rows, peers = defaultdict(list), defaultdict(list)
    print("| effect | top-1 | top-3 | held-out / noise | s | named |\n|---|---|---|---|---|---|")
    for effect in effects:
        for seed in seeds:
            rows[effect].append(run_single(effect, seed))
            if args.peers:
                rig = rigs.draw(effect, seed, **options(seed))
                peers["LASSO"].append(lasso_names(rig) in {effect, *rig.equivalents.get(effect, ())})
        part = rows[effect]
        print(
            f"| {effect} | {np.mean([r['top1'] for r in part]):.0%} | {np.mean([r['top3'] for r in part]):.0%} "
            f"| {np.median([r['over'] for r in part]):.3f} | {np.median([r['seconds'] for r in part]):.1f} "
            f"| {', '.join(r['named'] for r in part)} |",
            flush=True,
        )
    every = [r for part in rows.values() for r in part]
    print(
        f"| **all** | {np.mean([r['top1'] for r in every]):.0%} | {np.mean([r['top3'] for r in every]):.0%} "
        f"| {np.median([r['over'] for r in every]):.3f} | {np.median([r['seconds'] for r in every]):.1f} | |"
    )
    for name, hits in peers.items():
        print(f"| {name} | {np.mean(hits):.0%} | | | | |")
    if args.effects:
        return
    none = [run_none(d, s) for d in (rigs.draw_none, rigs.draw_wrong_parameters) for s in seeds]
    print(f"| nothing hidden: none | {np.mean(none):.0%} | | | | |")
    outside = [run_outside(k, s) for k in rigs.OUTSIDE for s in seeds]
    seen, placed = (np.mean([o[i] for o in outside]) for i in (0, 1))
    print(f"| outside the library: unknown | {seen:.0%} | | | | region {placed:.0%} |")
    pairs = [
        ("position_ripple", "input_delay"),
        ("stribeck", "linear_spring"),
        ("backlash", "input_saturation"),
    ]
    both = [run_pair(p, s) for p in pairs[: args.pairs] for s in seeds]
    print(f"| two effects: both | {np.mean(both):.0%} | | | | |")


if __name__ == "__main__":
    main()
