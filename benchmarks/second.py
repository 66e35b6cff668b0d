"""Judge diagnoses on the rigs of the second generator.

    python benchmarks/second.py --save FILE [--single 0:87] [--nothing 0:21] [--outside 0:16] [--double 0:14]
        [--triple 0:6] [--limit 600] [--peers] [--table] [--diagram PNG]

Each rig is one line of FILE; a second run goes on from there, ``--table`` only prints. One process works; a
rig that takes more processor time than the limit [s] is stopped and counts as a miss. A miss is told with its
cause: ``not screened`` (the right effect is not among the candidates confirmed), ``bad optimum`` (its fit
errs more than the true structure fitted from the truth does), ``lost on evidence``, ``refused`` (it comes
first, the verdict denies it), ``stopped``.
"""

from __future__ import annotations

import json
import math
import multiprocessing
import os
import sys
import time
import warnings
from pathlib import Path

for name in ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import numpy as np
import rigs_second as rigs
from saved import add_row, parser_of, rows_of
from second_table import claims_of, draw_reliability, table

import ctrl_df as cdf
from ctrl_df.identify.prediction.simulator import free_run

KINDS = ("single", "nothing", "outside", "double", "triple")
WORSE = 1.1
"""A fit whose error is that many times the true structure's has missed its optimum."""


def judged(kind, number, peers):
    """Return the row of one rig."""
    rig = rigs.rig(kind, number)
    began, work = time.perf_counter(), time.process_time()
    if kind in ("double", "triple"):
        row, model = _several(rig)
    else:
        row, model = _one(rig)
    row["seconds"], row["work"] = time.perf_counter() - began, time.process_time() - work
    if peers and kind in ("single", "nothing"):
        row["peers"] = _peers(rig)
    if rig.truth is not None:
        row.update(_beside_truth(rig, model, row.get("right")))
    if row.pop("right", None) is not None and not row["first"]:
        row["cause"] = _cause(row)
    return row


def _one(rig):
    found = cdf.diagnose(rig.baseline, rig.train, holdout=rig.held, free=list(rig.free))
    row = dict(verdict=found.verdict, regions=list(found.regions), hidden=rig.hidden, facts=rig.facts)
    row["doubts"] = list(found.doubts)
    row["ranking"] = [
        dict(
            id=c.id, same=list(c.equivalents), p=c.probability, evidence=c.evidence, held=c.evidence_holdout,
            nrmse=c.nrmse, nrmse_held=c.nrmse_holdout, confirmed=c.confirmed,
        )
        for c in found.ranking[:6]
    ]  # fmt: skip
    row["baseline"] = [found.nrmse, found.nrmse_holdout]
    first = found.ranking[0] if found.ranking else None
    row["said"] = 0.0 if first is None else first.probability + sum(
        c.probability for c in found.ranking if c.id in first.equivalents
    )  # fmt: skip
    if rig.kind == "single":
        right = rig.accepted[rig.hidden[0]]
        named = [{c.id, *c.equivalents} & right for c in found.ranking]
        told = found.verdict in ("effect", "ambiguous")
        row["strict"] = bool(found.verdict == "effect" and named and first.id in right)
        row["first"] = bool(told and named and named[0])
        row["three"] = bool(told and any(named[:3]))
        row["leads"] = bool(named and named[0])
        mine = [c for c in found.ranking if c.id in right]
        row["place"] = found.ranking.index(mine[0]) if mine else -1
        row["right"] = mine[0] if mine else False
        row["values"] = _held_values(rig, first) if row["first"] and first.id in rig.hidden else []
    if rig.kind == "outside":
        row["region"] = bool(set(found.regions) & set(rig.regions))
    if rig.kind == "single" and found.verdict == "ambiguous":
        row["experiment"] = _experiment(rig, found)
    best = found.best
    return row, found.model if best is None else best.model


def _experiment(rig, found):
    """Return what a diagnosis with the record of the experiment that it asked for says.

    It is played on the true structure, as the library runs it, under white noise of the sensor's size.
    """
    try:
        t, u = planned = found.next_experiment
    except ValueError as reason:  # nothing within the limits moves the machine and keeps to its range
        return dict(refused=str(reason))
    before = rig.train
    played = before.replaced(
        t=t, u=u, outputs={"position": np.full(len(t), before.y[0])}, velocity=None, channels={},
        input_hold="zoh",
    )  # fmt: skip
    y = free_run(rig.truth, played, position=float(before.y[0]))
    noise = before.noise_floor() * np.random.default_rng(rig.number).standard_normal(len(t))
    record = played.replaced(outputs={"position": y + noise})
    again = cdf.diagnose(rig.baseline, [before, record], holdout=rig.held, free=list(rig.free))
    first = again.best
    right = first is not None and bool({first.id, *first.equivalents} & rig.accepted[rig.hidden[0]])
    return dict(
        separates=planned.candidates, separation=planned.separation, verdict=again.verdict, right=right
    )


def _apart(a, b, turns):
    """Return how far two values lie apart; angles of a wave by the shorter way round."""
    return abs(math.remainder(a - b, 2 * math.pi)) if turns else abs(a - b)


def _held_values(rig, found):
    """Return for each parameter of the effect found how many standard errors it is off."""
    truth = rig.truth.named_effects[rig.truth.newest]
    off = []
    for name, error in found.errors.items():
        value = getattr(truth, name, None)
        if value is not None and np.isfinite(error) and error > 0:
            turns = truth.parameters[name].unit == "rad" or name == "angle0"
            off.append(_apart(found.parameters[name], value, turns) / error)
    return off


def _several(rig):
    study = cdf.improve(
        rig.baseline, rig.train, rig.held, max_effects=len(rig.hidden) + 2, free=list(rig.free)
    )
    named = list(study.effects)
    same = set(named)
    for step in study.steps:
        same |= set(step.equivalents) if step.effect in study.effects else set()
    row = dict(verdict=study.verdict, hidden=rig.hidden, facts=rig.facts, named=named)
    row["all"] = all(rig.accepted[h] & same for h in rig.hidden)
    row["exact"] = row["all"] and len(named) == len(rig.hidden)
    return row, study.model


def _beside_truth(rig, model, right):
    """Return errors over those of the true structure fitted from the truth, how far its values are off."""
    free = [k for k, p in rig.truth.parameters.items() if p.free and (k in rig.free or "." in k)]
    truth = cdf.refit(rig.truth, rig.train, free)
    true_values = {k: p.value for k, p in rig.truth.parameters.items()}
    row: dict = dict(
        off=[
            _apart(p.value, true_values[k], k.endswith((".phase", ".angle0"))) / p.standard_error
            for k, p in truth.parameters.items()
            if p.identifiable and not p.at_bound and np.isfinite(p.standard_error) and p.standard_error > 0
        ]
    )

    def error(block, record, mode):
        try:
            return float(cdf.compare(block, record, mode=mode).rmse)
        except (ValueError, ArithmeticError):
            return float("inf")

    # of the truth itself where its refit ended worse: the best that is known
    best = {}
    for name, record, mode in (
        ("free", rig.held, "free"), ("auto", rig.held, "auto"), ("windows", rig.train, "windows")
    ):  # fmt: skip
        refitted = error(truth.model, record, mode)
        best[name] = min(refitted, error(rig.truth, record, mode))
        row[f"over_{name}"] = error(model, record, mode) / best[name]
        row[f"over_refit_{name}"] = error(model, record, mode) / refitted
    if right:
        row["optimum"] = error(right.model, rig.train, "windows") / best["windows"]
        row["optimum_held"] = error(right.model, rig.held, "windows") / error(
            truth.model, rig.held, "windows"
        )
    return row


def _cause(row):
    if row.get("leads"):
        return "refused"
    if row["place"] < 0 or not row["ranking"][min(row["place"], 5)]["confirmed"] or row["place"] > 5:
        return "not screened" if row.get("optimum", np.inf) > WORSE else "screened out"
    return "bad optimum" if row["optimum"] > WORSE else "lost on evidence"


def _peers(rig):
    from second_peers import PEERS, told

    return {name: told(peer, rig) for name, peer in PEERS.items()}


# --- one process that can be stopped -----------------------------------------------------------------------


def _worker(pipe, peers):
    warnings.simplefilter("ignore")
    while True:
        kind, number = pipe.recv()
        try:
            row = judged(kind, number, peers)
        except Exception as reason:  # a failure is a miss
            row = dict(error=repr(reason)[:500])
        pipe.send(json.dumps(row, default=_plain))


def _plain(value):
    if isinstance(value, set):
        return sorted(value)
    return value.item() if hasattr(value, "item") else str(value)


def _work(pid):
    """Return the processor time of a process [s]; the clock where that is not to be had."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return time.perf_counter()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Worker:
    """A process that judges one rig after the other."""

    def __init__(self, peers):
        self.peers, self.process, self.pipe = peers, None, None

    def ask(self, job, limit):
        """Return the row of a job, or that it was stopped."""
        if self.process is None:
            context = multiprocessing.get_context("spawn")
            self.pipe, theirs = context.Pipe()
            self.process = context.Process(target=_worker, args=(theirs, self.peers), daemon=True)
            self.process.start()
        self.pipe.send(job)
        before = _work(self.process.pid)
        try:
            while _work(self.process.pid) - before < limit:
                if self.pipe.poll(1.0):
                    return json.loads(self.pipe.recv())
        except EOFError:
            pass
        self.close()
        return dict(stopped=limit)

    def close(self):
        """End the process."""
        if self.process is not None:
            self.process.kill()
            self.process.join()
        self.process = None


def main(arguments=None):
    """Judge what is missing in the saved file and print the tables."""
    parser = parser_of(__doc__, KINDS)
    parser.add_argument("--limit", type=float, default=600.0)
    parser.add_argument("--until", default="", help="HH:MM, begin no rig after that")
    parser.add_argument("--peers", action="store_true")
    parser.add_argument("--diagram", metavar="PNG", help="draw the reliability of the probabilities")
    args = parser.parse_args(arguments)
    saved = Path(args.save)
    rows = rows_of(saved)
    known = {tuple(r["job"]) for r in rows}
    shares = [
        (i / max(len(getattr(args, k)), 1), k, n) for k in KINDS for i, n in enumerate(getattr(args, k))
    ]
    worker = Worker(args.peers)
    for _, kind, number in sorted(shares, key=lambda s: s[0]):
        if args.table or (kind, number) in known:
            continue
        if args.until and time.strftime("%H:%M") >= args.until:
            break
        row = dict(job=[kind, number], **worker.ask((kind, number), args.limit))
        rows.append(row)
        add_row(saved, row)
        brief = {
            k: row.get(k) for k in ("job", "hidden", "verdict", "first", "cause", "all", "error") if k in row
        }
        print(brief, f"{row.get('seconds', args.limit):.0f} s", file=sys.stderr, flush=True)
    worker.close()
    print(table(rows))
    if args.diagram:
        draw_reliability(claims_of(rows), args.diagram)


if __name__ == "__main__":
    main()
