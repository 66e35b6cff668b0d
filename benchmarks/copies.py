"""Every effect of the library, copied into a file of a user's own: is it found as the original is.

    python benchmarks/copies.py [--jobs 2] [--only PART] [--whole | --units]

One rig an effect; the copy has other names for its parameters as well. The diagnosis is made twice: with the
original among the candidates, and with its copy in its place. `--whole`: against the whole library; else
against three others. `--units`: the original alone, in three other systems of units (a third of these the
tests see), alike to 1e-6. One line each: verdict, evidence, and what differs.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
if "--jobs" in sys.argv:
    os.environ.setdefault("NUMBA_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import rigs
from units_apart import OTHER, alike, candidate, diagnosed, rig_of, scales_of
from user_copies import copied

import ctrl_df as cdf

OTHERS = ("quadratic_drag", "linear_spring", "asymmetric_coulomb")
SEEDS = {"position_ripple": 6001}  # of seed 21 it is none that fits can follow
Row = tuple[str, str, str, float, list[str], float]


def asked_of(name):
    """Return model, a record to fit, one held out and what is refitted: a rig with an effect hidden in it."""
    if name in OTHER:
        return rig_of(name)
    rig = rigs.draw(name, SEEDS.get(name, 21), excitation="multisine", snr_db=60)
    free = [k for k, p in rig.baseline.parameters.items() if p.free and k not in rig.known]
    return rig.baseline, rig.train[0].measurement(), rig.holdout[0].measurement(), free


def with_own(model, own, original):
    """Return a model in which a copy stands in the place of its original."""
    effects = [own(*e.values) if type(e) is original else e for e in model.effects]
    return type(model)(model.mass, effects)


def told_apart(before, name, scale) -> list[str]:
    """Return what a diagnosis in other units does not have the same, in a line; nothing where all is."""
    after = diagnosed(name, [candidate(name)], *scale)
    try:
        alike(before, after, scale)
    except AssertionError as error:
        return [f"in units {', '.join(f'{s:g}' for s in scale)}: {error}".splitlines()[0]]
    return []


def in_units(name) -> Row:
    """Return a line of `row` for an effect in other systems of units."""
    began, differs = time.process_time(), []
    before = diagnosed(name, [candidate(name)])
    for scale in scales_of(name):
        differs += told_apart(before, name, scale)
    named = before.best.id if before.best else "-"
    return name, before.verdict, named, before.ranking[0].evidence, differs, time.process_time() - began


def row(job) -> Row:
    """Return effect, verdict and name of the original, its evidence, what differs, processor time."""
    name, whole = job
    began = time.process_time()
    library, hidden = cdf.effect_library(), candidate(name)
    others = [c for k, c in library.items() if k not in (name, hidden) and (whole or k in OTHERS)]
    model, train, held, free = asked_of(name)

    def found_by(model, first):
        return cdf.diagnose(model, train, holdout=held, free=free, candidates=[first, *others])

    before = found_by(model, library[hidden])
    with tempfile.TemporaryDirectory() as folder, copied(library[name], folder) as own:
        if hidden == name:
            after = found_by(model, own)
        else:  # it is no candidate: it stands in the model
            after = found_by(with_own(model, own, library[name]), library[hidden])
    pairs = [(c.id.replace("own_", ""), c.evidence) for c in after.ranking]
    differs = [] if before.verdict == after.verdict else [f"{before.verdict} -> {after.verdict}"]
    for c, (key, evidence) in zip(before.ranking, pairs, strict=True):
        if key != c.id or abs(evidence - c.evidence) > 1e-6 * abs(c.evidence) + 1e-6:
            differs.append(f"{c.id} {c.evidence:.6g} -> {key} {evidence:.6g}")
    named = before.best.id if before.best else "-"
    same = ", ".join(before.best.equivalents) if before.best else ""
    called = f"{named} = {same}" if same else named
    return name, before.verdict, called, before.ranking[0].evidence, differs, time.process_time() - began


def main() -> int:
    """Print a line an effect; return 1 if a copy differs from its original."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--only", default="")
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--whole", action="store_true")
    how.add_argument("--units", action="store_true")
    args = parser.parse_args()
    names = [n for n in (*rigs.ORDER, *OTHER) if args.only in n]
    jobs = [(n, args.whole) for n in names]
    if args.units:
        jobs = names
    same = 0
    with ProcessPoolExecutor(args.jobs) as pool:
        for name, verdict, called, evidence, differs, seconds in pool.map(
            in_units if args.units else row, jobs
        ):
            same += not differs
            says = "; ".join(differs) or "alike"
            print(
                f"{name:<20} {verdict:<10} {called:<36} {evidence:>10.1f}  {says}  {seconds:.0f} s",
                flush=True,
            )
    said = "the same in other units" if args.units else "copies found as their originals"
    print(f"{same} of {len(names)} {said}")
    return int(same < len(names))


if __name__ == "__main__":
    sys.exit(main())
