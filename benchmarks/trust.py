"""How far the grades can be trusted: random loops of seven families, predicted and held against exact orbits.

``python benchmarks/trust.py [--seed 1] [--loops 20] [--units 10]`` draws so many loops of each family,
predicts their cycles, traces the exact orbits, closes each orbit once more by an integrator of its own,
repeats the prediction on other grids and in other units, and prints Markdown tables.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
import warnings
from collections import defaultdict

for _name in ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import numpy as np  # noqa: E402
from independent import lap_error  # noqa: E402
from trust_loops import FAMILIES, Units, draw  # noqa: E402

import ctrl_df as cdf  # noqa: E402
from ctrl_df.limit_cycles.exact.closing import NoClosure  # noqa: E402
from ctrl_df.limit_cycles.finder import SAME_CYCLE, OrbitFinder  # noqa: E402
from ctrl_df.limit_cycles.forced_start import harmonic_start  # noqa: E402

GRIDS = ((14, 17), (47, 61))
TRIES = 30  # starts about a prediction without an orbit, from which one is sought all the same
LAP = 1e-6  # mismatch of an orbit by the integrator of its own, from which on it counts as wrong


class Tally:
    """Everything counted."""

    def __init__(self):
        self.grade = defaultdict(lambda: defaultdict(int))
        self.errors = defaultdict(list)
        self.orbits = self.checked = self.wrong = 0
        self.denied = self.falsely_denied = self.overlooked = self.unstable = self.unstable_found = 0
        self.grids = self.units = self.units_wrong = self.loops = 0
        self.remarks: list[str] = []


def judge(loop, tally: Tally, rng, name):
    """One loop: predict, verify, count."""
    A, omega = loop.box()
    response = cdf.describing_function_response(loop.H, loop.block, A, omega)
    check = cdf.verify(response)
    tally.loops += 1
    finder = None
    for row in check.rows:
        if row.predicted is None:
            continue
        cycle = row.predicted
        counts = tally.grade[cycle.grade]
        counts["predicted"] += 1
        truth = row.exact or row.motion
        if row.verdict == "not tested":
            counts["not tested"] += 1
            continue
        if truth is not None:
            counts["exists"] += 1
            counts["in band"] += bool(row.in_band)
            tally.errors[cycle.grade].append((abs(row.omega_error), abs(row.amplitude_error)))
            if truth.stable is False and cycle.grade != "unreliable":
                tally.unstable += 1
                tally.unstable_found += 1
            if not row.in_band:
                tally.remarks.append(
                    f"{name}: {cycle.grade} {cycle.amplitude:.4g} @ {cycle.omega:.4g}, exact "
                    f"{truth.amplitude:.4g} @ {truth.omega:.4g}, band "
                    f"{cycle.amplitude_band[0]:.4g}..{cycle.amplitude_band[1]:.4g} @ "
                    f"{cycle.omega_band[0]:.4g}..{cycle.omega_band[1]:.4g}"
                )  # fmt: skip
            continue
        counts[row.verdict] += 1
        finder = finder or (None if check.loop is None else OrbitFinder(check.loop))
        other = None if finder is None or finder.by_simulation else sought(finder, cycle, check.orbits, rng)
        tally.denied += row.verdict == "no such orbit"
        if other is not None:
            tally.falsely_denied += row.verdict == "no such orbit"
            tally.overlooked += row.verdict != "no such orbit"
            if other.stable is False and cycle.grade != "unreliable":
                tally.unstable += 1
        if cycle.grade != "unreliable" or other is not None:
            tally.remarks.append(
                f"{name}: {cycle.grade} {cycle.amplitude:.4g} @ {cycle.omega:.4g} {row.verdict}"
                f"{'' if other is None else f', yet {other.amplitude:.5g} @ {other.omega:.5g} is there'}; "
                f"{row.why[:300]}"
            )
    for orbit in check.orbits:
        tally.orbits += 1
        error = lap_error(loop, orbit) if orbit.status.ok else float("nan")
        if np.isfinite(error):
            tally.checked += 1
            # an unstable orbit lets errors grow by its multiplier
            bad = error > LAP * max(1.0, orbit.multiplier)
            tally.wrong += bad
            if bad:
                tally.remarks.append(
                    f"{name}: orbit {orbit.amplitude:.5g} @ {orbit.omega:.5g} closes to {error:.1g}"
                )
    return response, check


def sought(finder, cycle, known, rng):
    """Return an orbit near a prediction, from many starts about it; None if there is none new."""
    for _ in range(TRIES):
        a = cycle.amplitude * np.exp(rng.uniform(-0.4, 0.4))
        w = cycle.omega * np.exp(rng.uniform(-0.15, 0.15))
        try:
            orbit = finder.closing.close(harmonic_start(finder.loop, a, w), 2 * np.pi / w)
        except NoClosure:
            continue
        near_w = max(orbit.omega / cycle.omega, cycle.omega / orbit.omega) < SAME_CYCLE[0]
        near_a = max(orbit.amplitude / cycle.amplitude, cycle.amplitude / orbit.amplitude) < SAME_CYCLE[1]
        if near_w and near_a and not any(orbit.same_as(k) for k in known):
            return orbit
    return None


def other_grids(loop, response, tally, name):
    """Predictions on other grids: all but unreliable ones must be there again, with the same grade."""
    for grid in GRIDS:
        again = cdf.describing_function_response(loop.H, loop.block, *loop.box(*grid))
        for one, two in ((response, again), (again, response)):
            for c in one.limit_cycles:
                if c.grade == "unreliable":
                    continue
                same = [
                    d for d in two.limit_cycles
                    if abs(d.amplitude / c.amplitude - 1) < 1e-6 and abs(d.omega / c.omega - 1) < 1e-6
                ]  # fmt: skip
                if not same or (same[0].grade != c.grade):
                    tally.grids += 1
                    tally.remarks.append(
                        f"{name}: {c.grade} {c.amplitude:.5g} @ {c.omega:.5g} is "
                        f"{'missing' if not same else same[0].grade} on another grid ({grid})"
                    )


def other_units(loop, check, response, tally, rng, name):
    """Write the same loop in other units of force, length and time: nothing may change beyond 1e-6."""
    factors = 10.0 ** rng.integers(-9, 10, 3)
    units = Units(*factors)
    scaled = loop.scaled(units)
    again = cdf.describing_function_response(scaled.H, scaled.block, *scaled.box())
    recheck = cdf.verify(again)
    tally.units += 1

    def told(r, c, u):
        predicted = [(p.amplitude / u.force, p.omega * u.time, p.grade) for p in r.limit_cycles]
        verdicts = [row.verdict for row in c.rows]
        orbits = sorted((o.omega * u.time, o.amplitude / u.force) for o in c.orbits if o.status.ok)
        fate = [row.fate for row in c.fate]
        return predicted, verdicts, orbits, fate

    one, two = told(response, check, Units()), told(again, recheck, units)
    same = one[1] == two[1] and one[3] == two[3] and [p[2] for p in one[0]] == [p[2] for p in two[0]]
    for a, b in zip(one[0] + one[2], two[0] + two[2], strict=False):
        same = same and np.allclose(a[:2], b[:2], rtol=1e-6, atol=0)
    if not same:
        tally.units_wrong += 1
        tally.remarks.append(f"{name}: units {factors}: {one} became {two}")


def report(tally: Tally, seconds):
    """Print the tables."""
    print("\n| grade | predicted | an orbit exists | and lies in the band | no such orbit | not found | "
          "not tested | error of omega, median and 95 % | error of amplitude |")  # fmt: skip
    print("|---|---|---|---|---|---|---|---|---|")
    for grade in ("trusted", "doubtful", "unreliable"):
        c = tally.grade[grade]
        tested = max(c["predicted"] - c["not tested"], 1)
        e = np.array(tally.errors[grade] or [(np.nan, np.nan)])
        w, a = (f"{100 * np.median(e[:, k]):.2g} %, {100 * np.quantile(e[:, k], 0.95):.2g} %" for k in (0, 1))
        print(
            f"| {grade} | {c['predicted']} | {100 * c['exists'] / tested:.1f} % | "
            f"{100 * c['in band'] / tested:.1f} % | {c['no such orbit']} | {c['not found']} | "
            f"{c['not tested']} | {w} | {a} |"
        )
    found = 100 * tally.unstable_found / max(tally.unstable, 1)
    print("\n| what | measured |\n|---|---|")
    print(f"| loops | {tally.loops}, {seconds:.0f} s |")
    print(f"| `no such orbit` said | {tally.denied}, of orbits that exist: {tally.falsely_denied} |")
    print(f"| orbits that exist near a prediction and were not found | {tally.overlooked} |")
    print(
        "| unstable orbits near a trusted or doubtful prediction, found | "
        f"{found:.1f} % of {tally.unstable} |"
    )
    print(
        f"| exact orbits wrong by an integrator of its own | {tally.wrong} of {tally.checked} "
        f"({tally.orbits} in all) |"
    )
    print(f"| trusted or doubtful answers that change with the grid | {tally.grids} |")
    print(f"| loops that answer otherwise in other units | {tally.units_wrong} of {tally.units} |")


def main(arguments=None):
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--loops", type=int, default=20, help="of each family")
    parser.add_argument(
        "--units", type=int, default=10, help="of each family, written in other units as well"
    )
    parser.add_argument("--families", nargs="*", default=FAMILIES)
    parser.add_argument("--grids", action=argparse.BooleanOptionalAction, default=True)
    chosen = parser.parse_args(arguments)
    warnings.simplefilter("ignore")
    tally, begin = Tally(), time.perf_counter()
    for family in chosen.families:
        for k in range(chosen.loops):
            rng = np.random.default_rng([chosen.seed, FAMILIES.index(family), k])
            loop = draw(family, rng)
            name = f"{loop.name} {chosen.seed}/{k}"
            at = time.perf_counter()
            response, check = judge(loop, tally, rng, name)
            spent = time.perf_counter() - at
            if chosen.grids:
                other_grids(loop, response, tally, name)
            if k < chosen.units:
                other_units(loop, check, response, tally, rng, name)
            told = f"{len(response.limit_cycles)} predicted, {len(check.orbits)} orbits"
            print(f"{name}: {told}, {spent:.1f} s", file=sys.stderr, flush=True)
    for remark in tally.remarks:
        print("-", remark)
    report(tally, time.perf_counter() - begin)


if __name__ == "__main__":
    main()
