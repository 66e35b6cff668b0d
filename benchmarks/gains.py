"""How right a map over gains is: its border of "no cycle" against simulations at random gains.

``python benchmarks/gains.py [--seed 1] [--loops 10] [--gains 10] [--checks 50]`` draws friction masses (with
and without a static level above the kinetic one) and two masses with a gap, over decades of mass, friction,
gap and speed; maps two of the three gains of each; draws gains at random within each map, simulates the loop
there from twelve starts of random size, and prints for how many the map, and the describing function alone,
are right about whether the loop cycles. The starts are none of those that the map was made with.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections import defaultdict

import numpy as np

import ctrl_df as cdf
from ctrl_df.limit_cycles.finder import OrbitFinder

STARTS = 12
SIZES = (0.03, 30.0)  # of the size at which the block's nonlinearity matters


def friction(rng):
    mass, pace = 10 ** rng.uniform(-2, 3), 10 ** rng.uniform(-0.5, 2.5)
    level = mass * 10 ** rng.uniform(-2, 1)
    static = None if rng.random() < 0.5 else level * rng.uniform(1.02, 1.6)
    viscous = mass * pace * 10 ** rng.uniform(-3, -0.5)
    return cdf.friction_mass(mass, level, viscous, static=static), mass, pace


def backlash(rng):
    motor, pace = 10 ** rng.uniform(-1, 2), 10 ** rng.uniform(-0.5, 2.5)
    load = motor * 10 ** rng.uniform(-1, 1)
    gap, restitution = 10 ** rng.uniform(-4, -1), rng.uniform(0.0, 0.9)
    return cdf.backlash_masses(motor, load, gap, restitution=restitution), motor + load, pace


def ranges(mass, pace, rng):
    """Two gains as ranges around what suits the mass at a pace, the third a number."""
    size = {"kp": mass * pace**2, "ki": mass * pace**3, "kd": mass * pace}
    fixed = rng.choice(["kp", "ki", "kd"])
    box = {"kp": (0.2, 2.0), "ki": (0.0, 2.0), "kd": (0.2, 2.0)}
    middle = {"kp": 1.0, "ki": 0.5, "kd": 1.0}
    return {
        name: size[name] * middle[name] * rng.uniform(0.5, 1.5) if name == fixed
        else (size[name] * box[name][0], size[name] * box[name][1])
        for name in size
    }  # fmt: skip


def simulated(gains_map, gains, rng):
    """Whether the loop cycles from any of twelve starts of random size."""
    finder = OrbitFinder(gains_map.structure.loop(gains))
    factors = np.exp(rng.uniform(*np.log(SIZES), STARTS))
    fate = finder.explorer.explore(edges=False, factors=factors)
    return bool(fate.cycles), str(fate)


def main():
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for name, default in (("seed", 1), ("loops", 10), ("gains", 10), ("checks", 50)):
        options.add_argument(f"--{name}", type=int, default=default)
    options.add_argument("--told", action="store_true", help="print where the map is wrong")
    options = options.parse_args()
    rng = np.random.default_rng(options.seed)
    warnings.simplefilter("ignore")
    print(
        "| loops | gains | map right | describing function right | seconds a map, predicted | with checks |"
    )
    print("|---|---|---|---|---|---|")
    for draw in (friction, backlash):
        tally = defaultdict(list)
        for loop in range(options.loops):
            block, mass, pace = draw(rng)
            box = ranges(mass, pace, rng)
            begin = time.process_time()
            cdf.limit_cycle_map(block, **box, exact_check=0)
            tally["predicting"].append(time.process_time() - begin)
            begin = time.process_time()
            found = cdf.limit_cycle_map(block, **box, exact_check=options.checks)
            tally["checking"].append(time.process_time() - begin)
            for _ in range(options.gains):
                at = {name: rng.uniform(*box[name]) for name in found.free}
                said = found.at(**at)
                truth, told = simulated(found, said.gains, rng)
                tally["map"].append(("cycles" in said.verdict) == truth)
                tally["df"].append(("cycles" in said.predicted) == truth)
                if options.told and not tally["map"][-1]:
                    print(f"  {draw.__name__} {loop}: {said!r}; {told}", dict(block.parameters))
        print(
            f"| {draw.__name__} | {len(tally['map'])} | {sum(tally['map'])} | {sum(tally['df'])} "
            f"| {np.mean(tally['predicting']):.1f} | {np.mean(tally['checking']):.1f} |"
        )


if __name__ == "__main__":
    main()
