"""How long a diagnosis and a ladder take: rows for `run.py`, one a line as JSON.

    NUMBA_NUM_THREADS=2 python benchmarks/studies.py [--each 10] [--first 5000]

Rigs of 10 s at 1 kHz, the whole library; wall time is what counts, processor time stands beside it.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import rigs
from verdicts import drawn

import ctrl_df as cdf

KINDS = {
    "open loop": (6.0, [dict()]),
    "PID or a gap in the baseline": (12.0, [dict(closed_loop=True), dict(gap=True)]),
}
"""Circumstances by name: wall time [s] that a diagnosis may take, how rigs are drawn, in turn."""

# What a baseline with a gap does not have as well.
_JOINTS = ("backlash", "compliance", "load_friction")

LADDERS = (("linear_spring", 20.0), (("stribeck", "linear_spring"), 40.0))
"""Effects hidden, and the wall time [s] that a ladder to them may take."""


def studied(study, rig, model):
    """Return wall time, processor time [s] and outcome of a study of a rig."""
    train, held = rig.train[0].measurement(), rig.holdout[0].measurement()
    free = [k for k, p in model.parameters.items() if p.free and k not in rig.known]
    wall, processor = time.perf_counter(), time.process_time()
    found = study(model, train, holdout=held, free=free)
    return time.perf_counter() - wall, time.process_time() - processor, found


def show(what, wall, processor, limit):
    """Print a row: what, measured, demanded, whether it is so."""
    measured = f"{wall:.1f} s, {processor:.1f} s of processor"
    print(json.dumps([what, measured, f"{limit:.0f} s", wall <= limit]), flush=True)


def diagnoses(kind: str, first: int, each: int) -> None:
    """Diagnose so many rigs, each with another effect hidden."""
    limit, circumstances = KINDS[kind]
    walls, processors, right = [], [], 0
    for i in range(each):
        drawing = circumstances[i % len(circumstances)]
        names = [e for e in rigs.EFFECTS if not drawing.get("gap") or e not in _JOINTS]
        hidden = names[7 * i % len(names)]
        rig, model = drawn(hidden, first + i, excitation=rigs.EXCITATIONS[i % 3], **drawing)
        wall, processor, found = studied(cdf.diagnose, rig, model)
        walls.append(wall)
        processors.append(processor)
        best = found.ranking[0]
        named = bool({hidden, *rig.equivalents[hidden]} & {best.id, *best.equivalents})
        right += named
        print(
            f"{rig.name} {drawing}: {best.id}, {wall:.1f} s, {processor:.1f} s", file=sys.stderr, flush=True
        )
    what = f"diagnosis, 10 s at 1 kHz, {kind}, median of {each} ({right} named)"
    show(what, statistics.median(walls), statistics.median(processors), limit)


def main() -> None:
    """Print the rows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--each", type=int, default=10)
    parser.add_argument("--first", type=int, default=5000)
    args = parser.parse_args()
    studied(cdf.diagnose, *drawn("linear_spring", args.first - 1))
    for kind in KINDS:
        diagnoses(kind, args.first, args.each)
    for i, (hidden, limit) in enumerate(LADDERS):
        wall, processor, found = studied(cdf.improve, *drawn(hidden, args.first + 50 + i))
        show(f"ladder, 10 s at 1 kHz, to {', '.join(found.effects)}", wall, processor, limit)


if __name__ == "__main__":
    main()
