"""Crossings turned into limit cycles, each with what it says about itself."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...blocks.coordinates import LINE
from ...df.family import Family
from ...thresholds import ROUNDED
from .bound import mees_bergen
from .branches import BranchCrossing
from .crossings import Crossing, Scan, linear_zeros
from .grade import DOUBTFUL, UNRELIABLE, ForcedMotion, LimitCycle, band, graded, loeb, sensitivity
from .path import End, follow_path
from .scan_grid import grid_slope, noisy
from .thresholds import (
    BAND_LEAST,
    DYNAMIC_ERROR,
    FOLD,
    GUESSED,
    IRREGULAR,
    MEMORYLESS_ERROR,
    SAFETY,
    SAME_STEPS,
    SPREADS,
    VAGUE,
)
from .waveform_response import jumps, response_of


class Assessor:
    """Turns crossings into limit cycles with everything they say about themselves."""

    def __init__(self, method, linear, F, D, grid, scan: Scan, family: Family, orders, branched=()):
        self.method, self.linear, self.F, self.D, self.scan = method, linear, F, D, scan
        self.log_a, self.log_w = grid
        self.family = family
        self.orders = orders
        self.response = response_of(F, method)
        self.branched: tuple[BranchCrossing, ...] = tuple(branched)
        named = [b.crossing for b in self.branched if b.named]
        self.named = [*self.scan.crossings, *named]  # on the motion that the describing function names

    def cycles(self) -> list[LimitCycle]:
        """All cycles of the scan and of the branches, by rising amplitude."""
        found = [self._cycle(c) for c in self.scan.crossings] + self._irregular()
        found += [self._on_branch(b) for b in self.branched]
        return sorted(near_folds(found), key=lambda c: (c.amplitude, c.omega))

    def _irregular(self) -> list[LimitCycle]:
        """Crossings among averages over irregular motion: the interpolant's zeros, one a neighbourhood."""
        irregular = noisy(self.family.regime, self.family.residual)
        if self.method.quick or not irregular.any() or min(irregular.shape) < 2:
            return []
        log_a, log_w = np.log(self.family.amplitudes), np.log(self.family.omega)
        with np.errstate(all="ignore"):
            values = 1 + self.family.N * self.linear(self.family.omega)
        cells = irregular[:-1, :-1] | irregular[1:, :-1] | irregular[:-1, 1:] | irregular[1:, 1:]
        reach = SAME_STEPS * np.array([np.diff(log_a).max(), np.diff(log_w).max()])
        known = [np.log([c.amplitude, c.omega]) for c in self.named]
        found = []
        for place in linear_zeros(log_a, log_w, values, cells):
            if any((np.abs(place - other) < reach).all() for other in known):
                continue
            known.append(place)
            w = np.exp(place[1:])
            y, regime, spread = self.method.harmonics(np.exp(place[:1]), w, 1)
            residual = float(abs(1 + y[0, 0, 1] * self.linear(w)[0]))
            explained = residual <= min(max(IRREGULAR, SPREADS * spread[0, 0]), VAGUE)
            if not noisy(regime, spread)[0, 0] or not explained:
                continue  # a jump between coexisting motions, not a crossing
            note = (
                2,
                "N is an average over irregular motion there, and the crossing is interpolated",
            )
            J = grid_slope(log_a, log_w, values, place)
            found.append(self._cycle(Crossing(float(np.exp(place[0])), float(w[0]), residual, J), [note]))
        return found

    def _on_branch(self, found: BranchCrossing) -> LimitCycle:
        """Turn a solution on a branch into a cycle that says which motion it stands on."""
        a, w = found.crossing.amplitude, found.crossing.omega
        y = found.branch.motions(np.array([found.s]), np.array([w]), self.orders).harmonics[0]
        regime = found.branch.regime
        rivals = " and ".join(f"the {name}" for name in found.rivals)
        force = getattr(self.F, "coordinates", LINE).force
        if found.named:
            notes = []
            if rivals:
                notes = [(1, f"under the same {force} {rivals} is stable too: N jumps from one to the other")]
            cycle = self._cycle(found.crossing, notes, (y, regime))
            return replace(cycle, forced_multiplier=found.multiplier)
        if found.attracts:
            note = (
                1,
                f"it belongs to the {found.branch.name}, which under this {force} is stable beside the "
                f"motion of the describing function (|1 + N H| there: {found.defect:.2g}); the start "
                f"decides which of them occurs",
            )
        else:
            note = (
                2,
                f"it belongs to the {found.branch.name}, which is unstable under this {force} alone "
                f"(multiplier {found.multiplier:.3g} a period): the block leaves it for a motion whose |1 + "
                f"N H| is {found.defect:.2g}, so that no cycle stays here",
            )
        cycle = self._cycle(found.crossing, [note], (y, regime), found.attracts)
        state = found.branch.state
        return replace(
            cycle,
            branch=found.branch.name,
            forced_multiplier=found.multiplier,
            motion=None if state is None else ForcedMotion(state(found.s, w), y * a),
        )

    def _cycle(self, crossing: Crossing, notes=(), motion=None, attracts=True) -> LimitCycle:
        """Assess a crossing; `motion` (harmonics, regime) where it is not the one of the method."""
        a, w = crossing.amplitude, crossing.omega
        y, regime = self._named_motion(a, w) if motion is None else motion
        notes = list(notes)
        distortion, beyond = self._distortion(y, w)
        if beyond:
            notes.append(
                (1, f"H is not measured at {beyond} and above: its last value stood in for the harmonics")
            )
        sense = sensitivity(crossing.jacobian)
        # only the motion that the method names can be asked for its response to returned harmonics
        spread, path, remark = self._spread(crossing, distortion, sense, regime, motion is None)
        spread = tuple(one + s * self._late(a, w) for one, s in zip(spread, sense, strict=True))
        notes += remark
        stable = loeb(crossing.jacobian) if attracts else False
        if self.method.caveat:
            notes.append((1, self.method.caveat))
        bound, remark = mees_bergen(self.method, self.linear, crossing, self.scan.crossings)
        notes.append((0, remark))
        grade, why = graded(
            distortion=distortion, sensitivity=sense, spread=spread, stable=stable, regime=regime, notes=notes
        )
        return LimitCycle(
            amplitude=a,
            output_amplitude=float(abs(y[1]) * a),
            omega=w,
            stable=stable,
            residual=crossing.residual,
            sensitivity=sense,
            distortion=distortion,
            amplitude_band=band(a, spread[0]),
            omega_band=band(w, spread[1]),
            grade=grade,
            why=why,
            regime=regime,
            corrected=path.solution if path is not None and path.end is End.REACHED else None,
            path=path,
            bound=bound,
        )

    def _late(self, a, w) -> float:
        """Relative error of N for switching at samples only.

        An oscillation of whole samples is the same wherever within a sample the law would switch: up to half
        a sample earlier or later than the mean, an error of N in its phase.
        """
        return 0.5 * w * self.linear.dt if self.linear.dt and jumps(self.method, a) else 0.0

    def _named_motion(self, a, w):
        omega = np.array([w]) if self.method.needs_omega else None
        y, regime, _ = self.method.harmonics(np.array([a]), omega, self.orders)
        return y[0, 0], str(regime[0, 0])

    def _distortion(self, y, w):
        """Sum over k >= 2 of |Y_k H(jk omega)| / a, and from which frequency on H had to be guessed."""
        k = np.arange(2, y.size)
        h, outside = self.linear.clamped(k * w)
        size = np.abs(y[2:] * np.where(np.isfinite(h), h, 0))
        size = np.where(np.isfinite(size), size, 0)
        guessed = outside & (size > GUESSED)
        return float(size.sum()), f"{k[guessed][0] * w:.3g} rad/s" if guessed.any() else ""

    def _spread(self, crossing, distortion, sense, regime, named):
        """Logarithmic half widths of the bands, the corrected solution where there is one, and notes."""
        a, w = crossing.amplitude, crossing.omega
        c1, c2 = DYNAMIC_ERROR if self.method.dynamic else MEMORYLESS_ERROR
        estimate = c1 * distortion + c2 * distortion**2  # relative error of N
        spread = tuple(s * estimate + BAND_LEAST for s in sense)
        if self.response is None or not named or regime.startswith(("aperiodic", "subharmonic")):
            return spread, None, []
        steady_state, count = self.response
        path = follow_path(steady_state, count, self.linear, a, w)
        if path.end is End.MERGED:
            other = "{:.4g} @ {:.4g} rad/s".format(*path.solution)
            note = (
                f"with {path.share:.0%} of its harmonics fed back it merges with the solution at {other}: "
                "with all of them neither is left"
            )
            return spread, path, [(2, note)]
        if path.end is not End.REACHED:
            return spread, path, [(2, path.end.value)]
        shift = [abs(math.log(path.solution[0] / a)), abs(math.log(path.solution[1] / w))]
        notes = [(2, "it passes a fold as its harmonics are fed back")] if path.folds else []
        safety = SAFETY[self.method.dynamic]
        return tuple(safety * s + BAND_LEAST for s in shift), path, notes


def near_folds(cycles):
    """Grade down pairs of predictions that come together as their harmonics are fed back.

    Near a fold the distance of two solutions goes with the square root of what is missing to it: from d0 as
    predicted and d1 with all harmonics, the two merge at ``1 / (1 - (d1 / d0)^2)`` times the harmonics there
    are.
    """
    out = list(cycles)
    for i, one in enumerate(cycles):
        for other in cycles:
            if other is one or one.corrected is None or other.corrected is None:
                continue
            before = np.log([one.amplitude / other.amplitude, one.omega / other.omega])
            after = np.log(np.divide(one.corrected, other.corrected))
            ratio = np.abs(after).max() / max(np.abs(before).max(), ROUNDED)
            margin = math.inf if ratio >= 1 else 1 / (1 - ratio**2)
            if margin > FOLD[0]:
                continue
            near = margin < FOLD[1]
            text = (
                f"As its harmonics are fed back it nears the cycle predicted at {other.amplitude:.4g} @ "
                f"{other.omega:.4g} rad/s: the two would merge at {margin:.2f} times the harmonics there are"
                f"{'; there may be neither' if near else ''}. "
            )
            grade = UNRELIABLE if near or out[i].grade == UNRELIABLE else DOUBTFUL
            out[i] = replace(one, grade=grade, why=text + out[i].why)
    return out
