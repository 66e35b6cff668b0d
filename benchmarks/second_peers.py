"""Peers on the rigs of the second generator: sparse regression, a grey box over structures picked by hand.

The regressions see the smoothed motion and the terms of `diagnosis_peers`. The grey box is what one does with
MATLAB's idnlgrey: for each structure on a list a simulation of the whole record is fitted by least squares
(initial place and speed too), and the least criterion of Schwarz wins. Its simulator is that of the generator
itself, events and all, which is more than MATLAB has. Each returns the ids it would name.

    python benchmarks/second_peers.py [--single 0:58] [--nothing 0:14]

runs them alone.
"""

from __future__ import annotations

import argparse
import math
import warnings

import numpy as np
import rigs_second as rigs
import second_physics as physics
from diagnosis_peers import terms
from scipy.optimize import least_squares
from second_table import share


def _columns(rig):
    """Return the target, the columns the model has, and those it might lack, where the mass moves."""
    force, columns, good = terms(rig.train)
    known = {"mass", *(e.id for e in rig.baseline.effects)} & set(columns)
    base = np.column_stack([columns[k][good] for k in columns if k in known])
    extra = [k for k in columns if k not in known]
    more = np.column_stack([columns[k][good] for k in extra])
    return force[good], base, extra, more


def lasso(rig):
    """LASSO on what the base terms leave of the force; its penalty by five folds, one standard error up."""
    force, base, extra, more = _columns(rig)
    q, _ = np.linalg.qr(base / np.linalg.norm(base, axis=0))
    target, more = force - q @ (q.T @ force), more - q @ (q.T @ more)
    more /= np.std(more, axis=0) + 1e-300
    target = target / (np.std(force) + 1e-300)
    top = np.max(np.abs(more.T @ target)) / len(target)
    penalties = top * np.geomspace(1, 1e-3, 30)
    folds = np.arange(len(target)) * 5 // len(target)
    errors = np.array([
        [np.mean((target[mine] - more[mine] @ w) ** 2) for w in _paths(more[~mine], target[~mine], penalties)]
        for mine in (folds == f for f in range(5))
    ])  # fmt: skip
    mean, spread = errors.mean(0), errors.std(0) / math.sqrt(5)
    least = int(np.argmin(mean))
    chosen = int(np.flatnonzero(mean <= mean[least] + spread[least])[0])
    weights = np.abs(_paths(more, target, penalties)[chosen])
    best = int(np.argmax(weights))
    return (extra[best],) if weights[best] > 0 else ()


def _paths(matrix, target, penalties):
    """Return weights along penalties that fall, by coordinate descent."""
    n = len(target)
    square, against = matrix.T @ matrix / n, matrix.T @ target / n
    w, found = np.zeros(matrix.shape[1]), []
    for penalty in penalties:
        for _ in range(300):
            before = w.copy()
            for j in range(len(w)):
                rest = against[j] - square[j] @ w + square[j, j] * w[j]
                w[j] = math.copysign(max(abs(rest) - penalty, 0.0), rest) / square[j, j]
            if np.max(np.abs(w - before)) < 1e-9:
                break
        found.append(w.copy())
    return found


def sindy(rig):
    """Sparse regression of the force, sequentially thresholded; the threshold by a third held out."""
    force, base, extra, more = _columns(rig)
    matrix = np.column_stack([base, more])
    size = np.linalg.norm(matrix, axis=0) + 1e-300
    matrix, target = matrix / size, force / np.linalg.norm(force)
    held = np.arange(len(target)) * 9 // len(target) % 3 == 2
    best, told = math.inf, ()
    for threshold in np.geomspace(0.005, 0.5, 12):
        kept = np.ones(matrix.shape[1], bool)
        for _ in range(10):
            w = np.zeros(matrix.shape[1])
            w[kept] = np.linalg.lstsq(matrix[~held][:, kept], target[~held], rcond=1e-10)[0]
            now = kept & (np.abs(w) > threshold)
            now[: base.shape[1]] = True
            if np.array_equal(now, kept):
                break
            kept = now
        error = np.mean((target[held] - matrix[held] @ w) ** 2) * (1 + 0.01 * kept.sum())
        if error < best:
            weights = np.abs(w[base.shape[1] :])
            best, told = error, ((extra[int(np.argmax(weights))],) if np.any(weights > 0) else ())
    return told


STRUCTURES = {
    # what is added: its names, start values in units of the record, whether it may be negative
    "": (), "viscous": (("viscous", 0.3, False),), "coulomb": (("coulomb", 0.1, False),),
    "quadratic_drag": (("drag", 0.3, False),), "constant_force": (("constant", 0.02, True),),
    "linear_spring": (("spring", 0.2, True),), "cubic_spring": (("cubic", 0.1, True),),
    "asymmetric_viscous": (("uneven_viscous", 0.05, True),), "input_delay": (("late_in", 0.01, False),),
    "input_lag": (("lag", 0.01, False),), "input_saturation": (("limit", 1.2, False),),
    "input_dead_zone": (("dead", 0.05, False),),
    "stribeck": (("more", 0.05, False), ("stribeck_speed", 0.1, False)),
}  # fmt: skip
NAMED = {
    "mass": "motor", "inertia": "motor", "coulomb.level": "coulomb", "viscous.coefficient": "viscous",
    "linear_spring.stiffness": "spring", "cubic_spring.stiffness": "cubic",
}  # fmt: skip


def grey_box(rig):
    """Every structure on the list fitted to a simulation of the whole record; the least criterion wins."""
    record = rig.train
    table = rig.baseline.parameters
    if any(k not in NAMED and table[k].free for k in table):
        return ()  # two bodies: nothing on the list
    swing, time, push = np.std(record.y), 20 * record.dt, np.std(record.u)
    time = max(time, record.duration / 30)
    unit = dict(
        motor=push * time**2 / swing, coulomb=push, viscous=push * time / swing, spring=push / swing,
        cubic=push / swing**3,
    )  # fmt: skip
    start = {NAMED[k]: table[k].value / unit[NAMED[k]] for k in table if k in NAMED}
    free = [NAMED[k] for k in table if k in rig.free]
    y, u, tick = record.y / swing, record.u / push, record.dt / time
    v0 = float(record.velocity_estimate()[0] * time / swing)

    def simulated(values, more):
        p = physics.blank()
        full = {**start, **dict(zip([*free, *(m[0] for m in more)], values[2:], strict=True))}
        late = max(full.pop("late_in", 0.0), 0.0)
        if "more" in full:
            full["static"] = full.get("coulomb", 0.0) + full.pop("more")
        for name, value in full.items():
            p[physics.AT[name]] = value
        h = max(physics.longest_step(p, tick, 10.0, 30.0, 3.0), tick / 4)
        y0 = np.zeros(8)
        y0[:2] = values[:2]
        x = physics.run(
            p, y0, u, False, tick, h, record.input_hold == "linear", late, 0.0, False, np.zeros(6),
            np.zeros(len(u)), 0.0,
        )[0]  # fmt: skip
        return np.clip(np.nan_to_num(x - y, nan=1e3), -1e3, 1e3)

    scores = {}
    for name, more in STRUCTURES.items():
        if any(m[0] in start for m in more):
            continue
        values = np.array([y[0], v0, *(start[k] for k in free), *(m[1] for m in more)])
        low = np.array([-np.inf, -np.inf, *(1e-6 if k == "motor" else 0.0 for k in free),
                        *(-np.inf if m[2] else 1e-9 for m in more)])  # fmt: skip
        scale = np.maximum(np.abs(values), [1.0, 1.0, *np.full(len(values) - 2, 1e-3)])
        fit = least_squares(
            simulated, np.maximum(values, low + 1e-9), "2-point", (low, np.inf), x_scale=scale,
            diff_step=1e-5, max_nfev=12, args=(more,),
        )  # fmt: skip
        scores[name] = len(y) * math.log(2 * fit.cost / len(y)) + len(values) * math.log(len(y))
    best = min(scores, key=lambda k: scores[k])
    return (best,) if best and scores[""] - scores[best] > 10 else ()


PEERS = {"LASSO": lasso, "sparse regression (SINDy)": sindy, "grey box": grey_box}


def told(peer, rig):
    """Return whether a peer names what is hidden, or nothing where nothing is."""
    try:
        named = set(peer(rig))
    except (ValueError, ArithmeticError, IndexError):
        named = {"failed"}
    return bool(named & rig.accepted[rig.hidden[0]]) if rig.hidden else not named


def main(arguments=None):
    """Run the peers on rigs and print how often they are right."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    for kind in ("single", "nothing"):
        parser.add_argument(f"--{kind}", default="0:0")
    args = parser.parse_args(arguments)
    for kind in ("single", "nothing"):
        low, high = map(int, getattr(args, kind).split(":"))
        right: dict[str, list[bool]] = {name: [] for name in PEERS}
        for number in range(low, high):
            rig = rigs.rig(kind, number)
            for name, peer in PEERS.items():
                right[name].append(told(peer, rig))
            print(kind, number, rig.hidden, {k: v[-1] for k, v in right.items()}, flush=True)
        for name, those in right.items():
            if those:
                print(f"| {name} | {kind} | {share(sum(those), len(those))} |")


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main()
