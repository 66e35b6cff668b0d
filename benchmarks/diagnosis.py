"""Hidden-effect tests as a table.

    python benchmarks/diagnosis.py [--first 1000] [--seeds 4] [--jobs 2] [--peers] [--save FILE]

Every rig is drawn anew (excitation, SNR, colour of noise, loop open or closed follow from the seed),
diagnosed, and scored. Beside it: the true structure refitted (the best anyone can do), standard errors, and
the peers a user would take today: a LASSO on the inverse-dynamics residual (scikit-learn) and SINDy
(pysindy), where installed. A line of the saved file is one rig; a second run goes on from there.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

for name in ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import numpy as np
import rigs
from diagnosis_peers import PEERS

from ctrl_df.identify.diagnose import diagnose
from ctrl_df.identify.estimation.segmented import prepare
from ctrl_df.identify.improve import improve
from ctrl_df.identify.refit import refit
from ctrl_df.identify.shooting.variables import default_free

PAIRS = (
    ("position_ripple", "input_delay"),
    ("stribeck", "linear_spring"),
    ("backlash", "input_saturation"),
    ("asymmetric_viscous", "cubic_spring"),
    ("coulomb", "quadratic_drag"),
)


def options(seed):
    """Return the circumstances that follow from a seed."""
    return dict(
        excitation=rigs.EXCITATIONS[seed % 3],
        snr_db=(60.0, 40.0)[seed // 3 % 2],
        noise=rigs.NOISES[seed // 2 % 3],
        closed_loop=seed % 4 == 3,
    )


def free_of(rig):
    """Return the parameters the user does not know exactly."""
    return [k for k, p in rig.baseline.parameters.items() if p.free and k not in rig.known]


def records_of(rig):
    """Return the training and the held-out record."""
    return rig.train[0].measurement(), rig.holdout[0].measurement()


def right_names(rig, effect):
    """Return the ids that name a hidden effect rightly."""
    return {effect, *rig.equivalents.get(effect, ())}


# --- one rig ----------------------------------------------------------------------------------------


def single(effect, seed, peers):
    """Return the row of one hidden effect."""
    rig = rigs.draw(effect, seed, **options(seed))
    train, held = records_of(rig)
    began = time.perf_counter()
    found = diagnose(rig.baseline, train, holdout=held, free=free_of(rig))
    seconds = time.perf_counter() - began
    right = right_names(rig, effect)
    named = [{c.id, *c.equivalents} & right for c in found.ranking]
    model = found.best.model if found.best else found.model
    row = dict(
        top1=bool(found.verdict in ("effect", "ambiguous") and named[0]),
        top3=any(named[:3]),
        verdict=found.verdict,
        over=over_the_truth(rig, train, held, model),
        seconds=seconds,
        named=found.ranking[0].id,
    )
    row["peers"] = {k: bool(right & set(peer(train))) for k, peer in PEERS.items()} if peers else {}
    return row


def over_the_truth(rig, train, held, model):
    """Return the held-out error of a model over that of the true structure refitted to these segments."""
    data = prepare(rig.baseline, [train], [held])
    free = [k for k in default_free(rig.true_block) if k not in rig.known]
    true = data.level(4).moved(data.level(16).fit(rig.true_block, free))
    same = data.level(4).fine
    return same.evaluated(model)[2] / same.evaluated(same.moved(true, 3).model)[2]


def nothing(kind, seed, peers):
    """Return the row of a rig with nothing hidden, and the standard errors of a refit."""
    rig = getattr(rigs, f"draw_{kind}")(seed, **options(seed))
    train, held = records_of(rig)
    began = time.perf_counter()
    found = diagnose(rig.baseline, train, holdout=held)
    seconds = time.perf_counter() - began
    fit = refit(rig.baseline, train)
    inside = [abs(p.value - rig.truth[k]) < 2 * p.standard_error for k, p in fit.parameters.items()]
    alarms = {k: peer(train) != () for k, peer in PEERS.items()} if peers else {}
    return dict(
        right=found.verdict == "none", inside=inside, seconds=seconds, peers=alarms, verdict=found.verdict
    )


def outside(kind, seed, peers):
    """Return the row of an effect that the library lacks."""
    rig = rigs.draw_outside(seed, kind=kind, **options(seed))
    train, held = records_of(rig)
    began = time.perf_counter()
    found = diagnose(rig.baseline, train, holdout=held)
    region = bool(set(found.regions) & set(rig.regions))
    return dict(
        right=found.verdict == "unknown", region=region, verdict=found.verdict, regions=found.regions,
        seconds=time.perf_counter() - began,
    )  # fmt: skip


def pair(names, seed, peers):
    """Return the row of two hidden effects."""
    ids = tuple(names.split("+"))
    rig = rigs.draw(ids, seed, **options(seed))
    train, held = records_of(rig)
    began = time.perf_counter()
    study = improve(rig.baseline, train, held, free=free_of(rig), max_effects=3)
    named = set(study.effects)
    for step in study.steps:
        named |= set(step.equivalents) if step.effect in study.effects else set()
    return dict(
        right=all(right_names(rig, e) & named for e in ids), named=study.effects,
        seconds=time.perf_counter() - began,
    )  # fmt: skip


# --- all of them ------------------------------------------------------------------------------------


def jobs(seeds, effects):
    """Return (function, kind, seed) of every rig."""
    every = []
    for seed in seeds:
        every += [("single", e, seed) for e in effects]
        if len(effects) == len(rigs.EFFECTS):
            every += [("nothing", k, seed) for k in ("none", "wrong_parameters")]
            every += [("outside", k, seed) for k in rigs.OUTSIDE]
            every += [("pair", "+".join(PAIRS[(seed + i) % len(PAIRS)]), seed) for i in range(2)]
    return every


def run(job, peers):
    """Run one job; a rig that cannot be drawn is left out, a failure is a row that is wrong."""
    kind, what, seed = job
    row = dict(job=list(job))
    try:
        row.update(globals()[kind](what, seed, peers))
    except RuntimeError as reason:
        row["left_out"] = str(reason)
    except Exception as reason:
        row["error"] = repr(reason)
    return row


def table(rows):
    """Return the results as markdown."""
    rows = [r for r in rows if "left_out" not in r]
    of = {k: [r for r in rows if r["job"][0] == k] for k in ("single", "nothing", "outside", "pair")}
    lines = [
        "| effect | rigs | top-1 | top-3 | held out / true structure | s | named |",
        "|---|---|---|---|---|---|---|",
    ]
    for effect in dict.fromkeys(r["job"][1] for r in of["single"]):
        part = [r for r in of["single"] if r["job"][1] == effect]
        lines.append(_line(effect, part) + f" {', '.join(r.get('named', 'error') for r in part)} |")
    if of["single"]:
        lines.append(_line("**all single effects**", of["single"]) + " |")
    lines += ["", "| question | rigs | measured |", "|---|---|---|"]

    def share(name, part, key="right"):
        if part:
            lines.append(f"| {name} | {len(part)} | {np.mean([bool(r.get(key)) for r in part]):.0%} |")

    share("nothing hidden, or only wrong parameters: none", of["nothing"])
    share("outside the library: unknown", of["outside"])
    share("outside the library: region right", of["outside"], "region")
    share("two hidden effects: both in the final model", of["pair"])
    inside = [i for r in of["nothing"] for i in r.get("inside", ())]
    if inside:
        lines.append(f"| true value within two standard errors | {len(inside)} | {np.mean(inside):.0%} |")
    for name in dict.fromkeys(k for r in of["single"] for k in r.get("peers", {})):
        hits = [r["peers"][name] for r in of["single"] if r.get("peers")]
        alarms = [r["peers"][name] for r in of["nothing"] if r.get("peers")]
        lines.append(f"| {name}: single effect right | {len(hits)} | {np.mean(hits):.0%} |")
        if alarms:
            lines.append(f"| {name}: false alarms where nothing is | {len(alarms)} | {np.mean(alarms):.0%} |")
    return "\n".join(lines)


def _line(name, part):
    over = [r["over"] for r in part if "over" in r]
    seconds = [r["seconds"] for r in part if "seconds" in r]
    return (
        f"| {name} | {len(part)} | {np.mean([r.get('top1', False) for r in part]):.0%} "
        f"| {np.mean([r.get('top3', False) for r in part]):.0%} | {np.median(over or [np.nan]):.3f} "
        f"| {np.median(seconds or [np.nan]):.0f} |"
    )


def main(arguments=None):
    """Run what is missing in the saved file and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--first", type=int, default=1000)
    parser.add_argument("--effects", default="")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--peers", action="store_true")
    parser.add_argument("--save", default="")
    args = parser.parse_args(arguments)
    effects = args.effects.split(",") if args.effects else list(rigs.EFFECTS)
    todo = jobs(range(args.first, args.first + args.seeds), effects)
    saved = Path(args.save) if args.save else None
    rows = [json.loads(line) for line in saved.read_text().splitlines()] if saved and saved.exists() else []
    known = {tuple(r["job"]) for r in rows}
    with ProcessPoolExecutor(args.jobs) as pool:
        running = [pool.submit(run, j, args.peers) for j in todo if j not in known]
        for done in as_completed(running):
            rows.append(done.result())
            if saved:
                with saved.open("a") as file:
                    file.write(json.dumps(rows[-1], default=str) + "\n")
            brief = {k: v for k, v in rows[-1].items() if k != "peers"}
            print(brief, file=sys.stderr, flush=True)
    print(table([r for r in rows if tuple(r["job"]) in set(todo)]))


if __name__ == "__main__":
    main()
