"""Judge diagnoses of drives that hunt, and of hums that act through friction.

    python benchmarks/hunting_and_hums.py --save FILE [--given 0:12] [--hidden 0:12] [--nothing 0:12]
        [--hum 0:12] [--silent 0:6] [--library] [--table]

A drive that hunts sticks most of the time, under a PID whose integral part drives it off again. ``given``:
the true structure, all its values 10 to 30 % off; ``hidden``: the static level is hidden; ``nothing``: a
drive with no more friction at rest than in motion. ``hum``: a force at one frequency, which is not recorded,
acts on a drive in open loop through its friction; ``silent``: none does. Numbers are seeds: each draws a
machine. ``--library``: all effects are candidates, not only four that come near.

Each drive is one line of FILE, in JSON; a second run goes on from there, ``--table`` only prints. The drives
are integrated in short steps of time by code of their own. Nothing is tuned on them.
"""

from __future__ import annotations

import math
import os
import re
import sys
import time
import warnings
from dataclasses import dataclass
from pathlib import Path

for name in ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import numpy as np
from numba import njit
from saved import add_row, parser_of, rows_of
from second_table import share

import ctrl_df as cdf

KINDS = ("given", "hidden", "nothing", "hum", "silent")
CANDIDATES = ("stiction", "stribeck", "linear_spring", "constant_force")
STEP = 1e-5  # of the integration [s], at most
STUCK = (0.5, 0.9)  # share of the samples at which a drive that hunts is at rest
STARTS = 8  # times that it breaks away, at least
NEAR = 0.005  # of a frequency that is told


@njit
def _moved(reference, feed, dt, parts, machine, pid, lag, hum, noise, resolution):
    """Return force, position measured and whether the drive is at rest, at every sample.

    Semi-implicit steps: friction takes as much of the velocity as it can, and no more. `machine`: mass,
    viscous coefficient, kinetic and static level; `hum`: size, angular frequency, angle.
    """
    n, h = reference.size, dt / parts
    mass, viscous, kinetic, static = machine
    force, place, rest = np.zeros(n), np.zeros(n), np.zeros(n)
    x = v = integral = slope = before = 0.0
    for k in range(n):
        y = x + noise[k]
        if resolution > 0:
            y = resolution * np.floor(y / resolution + 0.5)
        if k == 0:
            before = y
        slope += dt / (lag + dt) * ((before - y) / dt - slope)
        error, before = reference[k] - y, y
        u = feed[k] + pid[0] * error + integral + pid[2] * slope
        integral += pid[1] * error * dt
        force[k], place[k], rest[k] = u, y, v == 0.0
        for j in range(parts):
            acting = u + hum[0] * np.sin(hum[1] * (k * dt + j * h) + hum[2])
            if v == 0.0 and abs(acting) <= static:
                continue
            free = v + h * (acting - viscous * v) / mass
            left = max(abs(free) - h * kinetic / mass, 0.0)
            v = left * np.sign(free) if v * free >= 0 else 0.0
            x += h * v
    return force, place, rest


@dataclass(frozen=True)
class Drive:
    """A machine drawn, and what it did."""

    record: cdf.Measurement
    machine: tuple[float, float, float, float]  # mass, viscous coefficient, kinetic and static level
    facts: dict


def _run(rng, t, machine, reference, feed, pid, lag, hum):
    """Return the drive with a sensor that rounds, or adds noise, as drawn."""
    dt, size = t[1], float(np.exp(rng.uniform(np.log(3e-6), np.log(3e-5))))
    rounds = rng.random() < 0.5
    noise = np.zeros(t.size) if rounds else size * rng.standard_normal(t.size)
    parts = math.ceil(dt / STEP)
    force, place, rest = _moved(
        reference, feed, dt, parts, machine, pid, lag, hum, noise, size if rounds else 0.0
    )
    facts = dict(
        stuck=float(np.mean(rest)), starts=int(np.sum(np.diff(rest) < 0)), sensor=size, rounds=bool(rounds),
        hum=[hum[0], hum[1] / (2 * math.pi)],
    )  # fmt: skip
    return Drive(cdf.Measurement(t, force, place), machine, facts)


def _machine(rng, more):
    """Return mass, viscous coefficient, kinetic and static level, the last `more` times the kinetic one."""
    mass = float(np.exp(rng.uniform(np.log(1.5), np.log(25.0))))
    kinetic = mass * rng.uniform(0.5, 1.2)
    return mass, mass * rng.uniform(3.0, 8.0), kinetic, more * kinetic


def hunting(seed, more=(1.15, 2.4)):
    """Draw a drive under a PID that holds steps, until one hunts; or one without `more` at rest."""
    rng = np.random.default_rng(seed)
    while True:
        rate = rng.choice([100, 150, 200, 250, 400, 500])
        t = np.arange(int(rng.uniform(2500, 5000))) / rate
        machine = _machine(rng, rng.uniform(*more))
        stiff = machine[0] * rng.uniform(13.0, 18.0) ** 2
        pid = (stiff, stiff * rng.uniform(1.6, 3.4), stiff * rng.uniform(0.08, 0.11))
        levels, hold = rng.uniform(-0.05, 0.05, t.size), rng.uniform(2.5, 5.0)
        levels[0] = 0.0
        reference = levels[(t / hold).astype(int)]
        drive = _run(
            rng, t, machine, reference, np.zeros(t.size), pid, rng.uniform(0.01, 0.03), (0.0, 1.0, 0.0)
        )
        hunts = STUCK[0] < drive.facts["stuck"] < STUCK[1] and drive.facts["starts"] >= STARTS
        if hunts or machine[2] == machine[3]:
            return drive


def humming(seed, hums=True):
    """Draw a drive that sines move in open loop, on which a force that is not recorded acts as well."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(rng.uniform(2500, 4000))) / 500.0
    machine = _machine(rng, 1.0)
    lines = np.array([[3.0, 0.5], [2.0, 1.1], [1.3, 2.7]]) * rng.uniform(0.8, 1.2, (3, 2))
    feed = sum(machine[2] * a * np.sin(2 * math.pi * (f * t + rng.random())) for a, f in lines)
    size = machine[2] * rng.uniform(0.15, 0.5)
    hum = (size, 2 * math.pi * np.exp(rng.uniform(np.log(7.0), np.log(30.0))), 2 * math.pi * rng.random())
    return _run(rng, t, machine, np.zeros(t.size), feed, (0.0,) * 3, 0.01, hum if hums else (0.0, *hum[1:]))


def drawn(kind, seed):
    """Return the drive, and the user's model of it, whose values are 10 to 30 % off."""
    if kind in ("hum", "silent"):
        drive = humming(seed, kind == "hum")
    else:
        drive = hunting(seed, (1.0, 1.0) if kind == "nothing" else (1.15, 2.4))
    rng = np.random.default_rng((seed, 1))
    off = 1 + rng.choice([-1, 1], 4) * rng.uniform(0.1, 0.3, 4)
    mass, viscous, kinetic, static = np.array(drive.machine) * off
    more = dict(static=max(static, 1.02 * kinetic)) if kind == "given" else {}
    return drive, cdf.friction_mass(mass, kinetic, viscous, **more)


def judged(kind, seed, library):
    """Return the row of one drive."""
    drive, model = drawn(kind, seed)
    began = time.process_time()
    found = cdf.diagnose(model, drive.record, **({} if library else dict(candidates=CANDIDATES)))
    first, told = found.best, re.search(r"at one frequency, ([\d.e+-]+) Hz", found.explanation)
    last = found.model if first is None else first.model
    ranking = [dict(id=c.id, same=list(c.equivalents), evidence=c.evidence) for c in found.ranking[:3]]
    return dict(
        job=[kind, seed], verdict=found.verdict, ranking=ranking, machine=drive.machine, facts=drive.facts,
        values={k: p.value for k, p in last.parameters.items()}, nrmse=[found.nrmse, found.nrmse_holdout],
        hertz=float(told[1]) if told else None, explanation=found.explanation,
        work=time.process_time() - began,
    )  # fmt: skip


# --- the table ---------------------------------------------------------------------------------------------


def names(row, effect="stiction"):
    """Whether the first of the ranking is an effect, or has it for an equal."""
    first = row["ranking"][0] if row["ranking"] else dict(id="", same=[])
    return effect in (first["id"], *first["same"])


def tells(row):
    """Whether the frequency told is that of the hum."""
    return row["hertz"] is not None and abs(row["hertz"] / row["facts"]["hum"][1] - 1) < NEAR


def level_off(row):
    """Return how much the static level found is off, over the true one; nan where there is none."""
    levels = [v for k, v in row["values"].items() if k in ("stiction.level", "stribeck.level")]
    return abs(levels[0] / row["machine"][3] - 1) if levels else math.nan


def table(rows):
    """Return the results as markdown."""
    lines = ["| drives | found |", "|---|---|"]

    def line(what, kind, key):
        of = [r for r in rows if r["job"][0] == kind]
        if of:
            lines.append(f"| {what} | {share(sum(map(bool, map(key, of))), len(of))} |")

    line("hunts, true structure given: `none`", "given", lambda r: r["verdict"] == "none")
    line("hunts, static level hidden: `effect`, stiction first or equal to the first", "hidden",
         lambda r: r["verdict"] == "effect" and names(r))  # fmt: skip
    line("the same: `effect`, a bump over speed alone", "hidden",
         lambda r: r["verdict"] == "effect" and names(r, "stribeck") and not names(r))  # fmt: skip
    line("the same: `ambiguous`", "hidden", lambda r: r["verdict"] == "ambiguous")
    line("under a PID, no more friction at rest: `none`", "nothing", lambda r: r["verdict"] == "none")
    line("hum: `unknown`", "hum", lambda r: r["verdict"] == "unknown")
    line("the same: its frequency within 0.5 %", "hum", tells)
    line("no hum: `none`", "silent", lambda r: r["verdict"] == "none")
    off = [level_off(r) for r in rows if r["job"][0] in ("given", "hidden")]
    off = [x for x in off if not math.isnan(x)]
    if off:
        lines.append(f"| static level off by, median and most | {np.median(off):.2%}, {max(off):.2%} |")
    work = [r["work"] for r in rows]
    if work:
        lines.append(f"| processor time, median and most | {np.median(work):.0f} s, {max(work):.0f} s |")
    return "\n".join(lines)


def main(arguments=None):
    """Judge what is missing in the saved file and print the table."""
    parser = parser_of(__doc__, KINDS)
    parser.add_argument("--library", action="store_true")
    args = parser.parse_args(arguments)
    warnings.simplefilter("ignore")
    saved = Path(args.save)
    rows = rows_of(saved)
    known = {tuple(r["job"]) for r in rows}
    jobs = [(kind, seed) for kind in KINDS for seed in getattr(args, kind)]
    for job in [j for j in jobs if j not in known and not args.table]:
        row = judged(*job, args.library)
        rows.append(row)
        add_row(saved, row)
        first = row["ranking"][0] if row["ranking"] else dict(id="", same=[])
        brief = job, row["verdict"], first["id"], first["same"], f"{row['work']:.0f} s"
        print(*brief, file=sys.stderr, flush=True)
    print(table(rows))


if __name__ == "__main__":
    main()
