"""What fits would gain by exact derivatives: fits by the usual differences beside fits by derivatives.

    python benchmarks/derivatives.py [--first 300] [--rigs 30]

Variational equations with saltation matrices give the derivative of a simulation exactly; so do central
differences over a step a hundred times smaller than a fit takes, at a price that is no matter here. The true
structures of rigs of the second generator are fitted from values up to 30 % off by both. Counted: steps of
Levenberg and Marquardt, what is left beyond the best of the two, how far the parameters are apart. The share
of a fit's processor time that its derivatives take bounds what cheaper ones could save.
"""

from __future__ import annotations

import argparse
import os
import time
from contextlib import contextmanager

for _name in ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import numpy as np
import rigs_second as rigs

import ctrl_df as cdf
from ctrl_df.identify.shooting import outputs
from ctrl_df.identify.shooting.outputs import SegmentOutputs

SMALLER, STATES_SMALLER = 0.01, 0.1
"""Step of the central differences that stand for exact derivatives, over the usual one; those of initial
states are near what simulations err by."""

SAME = 1e-4
"""Error over the better one's, less one, up to which two fits ended in the same optimum."""


@contextmanager
def derivatives(exact: bool, told: dict):
    """Count and time the derivatives of fits; exact ones in place of the usual differences."""
    usual, sizes = SegmentOutputs.jacobian, (outputs.STATE_NUDGE, outputs.HIDDEN_NUDGE)

    def jacobian(self, theta, states, base, central=False):
        began = time.process_time()
        found = usual(self, theta, states, base, central)
        told["time"] += time.process_time() - began
        told["steps"] += 1
        if not exact:
            return found
        steps = dict(enumerate(self.problem.steps))
        for i, step in steps.items():
            self.problem.steps[i] = step * SMALLER
        outputs.STATE_NUDGE, outputs.HIDDEN_NUDGE = (s * STATES_SMALLER for s in sizes)
        try:
            found = usual(self, theta, states, base, True)
        finally:
            outputs.STATE_NUDGE, outputs.HIDDEN_NUDGE = sizes
            for i, step in steps.items():
                self.problem.steps[i] = step
        return found

    SegmentOutputs.jacobian = jacobian
    try:
        yield
    finally:
        SegmentOutputs.jacobian = usual


def fitted(rig, start, free, exact: bool):
    """Return a fit, its steps, and the share of its processor time that derivatives took."""
    told = {"time": 0.0, "steps": 0}
    with derivatives(exact, told):
        began = time.process_time()
        fit = cdf.refit(rig.truth.with_parameters(start), rig.train, free, budget=6000)
        whole = time.process_time() - began
    return fit, told["steps"], told["time"] / whole


def row(number: int):
    """Return what one rig shows: steps by both, errors over the better, parameters apart, share of time."""
    rig = rigs.rig("single", number)
    free = [k for k, p in rig.truth.parameters.items() if p.free and (k in rig.free or "." in k)]
    rng = np.random.default_rng(number)
    start = {k: rig.truth.parameters[k].value * rng.uniform(0.75, 1.3) for k in free}
    (usual, steps, share), (exact, steps_exact, _) = (fitted(rig, start, free, e) for e in (False, True))
    best = min(usual.comparison.rmse, exact.comparison.rmse)
    apart = [
        abs(p.value - exact.parameters[k].value) / p.standard_error
        for k, p in usual.parameters.items()
        if np.isfinite(p.standard_error) and p.standard_error > 0
    ]
    errors = usual.comparison.rmse / best - 1, exact.comparison.rmse / best - 1
    return rig.hidden[0], steps, steps_exact, *errors, max(apart, default=0.0), share


def main() -> None:
    """Print a line for every rig, and what they come to."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=300)
    parser.add_argument("--rigs", type=int, default=30)
    asked = parser.parse_args()
    rows = []
    print("| rig | effect | steps | exact | error over the better | exact | standard errors apart | share |")
    print("|---|---|---|---|---|---|---|---|")
    for number in range(asked.first, asked.first + asked.rigs):
        name, *figures = row(number)
        rows.append(figures)
        steps, steps_exact, error, error_exact, apart, share = figures
        print(
            f"| {number} | {name} | {steps} | {steps_exact} | {error:.2%} | {error_exact:.2%} "
            f"| {apart:.3f} | {share:.0%} |",
            flush=True,
        )
    steps, steps_exact, error, error_exact, apart, share = np.array(rows).T
    print(f"steps: {steps.sum():.0f}, with exact derivatives {steps_exact.sum():.0f}")
    print(f"over 1 % worse: {np.sum(error > 0.01)}, with exact derivatives {np.sum(error_exact > 0.01)}")
    same = (error < SAME) & (error_exact < SAME)
    print(f"in the same optimum ({same.sum()}): at most {np.max(apart[same], initial=0):.3f} apart,", end=" ")
    print(f"median {np.median(apart[same]):.4f} standard errors; share of time {np.median(share):.0%}")


if __name__ == "__main__":
    main()
