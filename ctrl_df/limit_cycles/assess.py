"""Crossings turned into limit cycles, each with what it says about itself."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..df.family import Family
from .balance import Balance, balance, responder
from .bound import mees_bergen
from .crossings import Crossing, Scan, linear_zeros
from .grade import UNRELIABLE, LimitCycle, band, graded, loeb, sensitivity
from .scan_grid import FAST, grid_slope, noisy

SAFETY = 1.5  # on the shift that the returned harmonics cause, where they can be computed
# Relative error of N from returned harmonics d where they cannot be carried, c1 d + c2 d^2. A jump or a
# corner answers its harmonics at once; a mass hardly (friction and backlash loops of tests/problems.py:
# 0.003 at 0.10, 0.007 at 0.20, 0.21 at 0.79).
MEMORYLESS_ERROR, DYNAMIC_ERROR = (1.5, 0.0), (0.01, 0.4)
FLOOR = 1e-3  # least half width of a band


class Assessor:
    """Turns crossings into limit cycles with everything they say about themselves."""

    def __init__(self, method, linear, F, D, grid, scan: Scan, family: Family, orders):
        self.method, self.linear, self.F, self.D, self.scan = method, linear, F, D, scan
        self.log_a, self.log_w = grid
        self.family = family
        self.orders = orders
        self.answer = responder(F, method)

    def cycles(self) -> list[LimitCycle]:
        """All cycles of the scan, by rising amplitude."""
        found = [self._cycle(c) for c in self.scan.crossings] + self._irregular()
        return sorted(without_doubles(found), key=lambda c: (c.amplitude, c.omega))

    def _irregular(self) -> list[LimitCycle]:
        """Crossings among averages over irregular motion: the interpolant's zeros, one a neighbourhood."""
        irregular = noisy(self.family.regime, self.family.residual)
        if self.method.name in FAST or not irregular.any():
            return []
        log_a, log_w = np.log(self.family.amplitudes), np.log(self.family.omega)
        with np.errstate(all="ignore"):
            values = 1 + self.family.N * self.linear(self.family.omega)
        cells = irregular[:-1, :-1] | irregular[1:, :-1] | irregular[:-1, 1:] | irregular[1:, 1:]
        reach = 3 * np.array([np.diff(log_a).max(), np.diff(log_w).max()])
        known = [np.log([c.amplitude, c.omega]) for c in self.scan.crossings]
        found = []
        for place in linear_zeros(log_a, log_w, values, cells):
            if any((np.abs(place - other) < reach).all() for other in known):
                continue
            known.append(place)
            w = np.exp(place[1:])
            y, regime, spread = self.method.harmonics(np.exp(place[:1]), w, 1)
            residual = float(abs(1 + y[0, 0, 1] * self.linear(w)[0]))
            if not noisy(regime, spread)[0, 0] or not residual <= max(0.05, 3 * spread[0, 0]):
                continue  # a jump between coexisting motions, not a crossing
            note = (
                2,
                "N is an average over irregular motion there and the place of the crossing an interpolation",
            )
            J = grid_slope(log_a, log_w, values, place)
            found.append(self._cycle(Crossing(float(np.exp(place[0])), float(w[0]), residual, J), [note]))
        return found

    def _cycle(self, crossing: Crossing, notes=()) -> LimitCycle:
        a, w = crossing.amplitude, crossing.omega
        omega = np.array([w]) if self.method.needs_omega else None
        y, regime, _ = self.method.harmonics(np.array([a]), omega, self.orders)
        y, regime = y[0, 0], str(regime[0, 0])
        notes = list(notes)
        distortion, beyond = self._distortion(y, w)
        if beyond:
            notes.append(
                (1, f"H is not measured at {beyond} and above: its last value stood in for the harmonics")
            )
        sense = sensitivity(crossing.jacobian)
        spread, found, remark = self._spread(crossing, distortion, sense, regime)
        notes += remark
        stable = loeb(crossing.jacobian)
        if self.method.name == "memory":
            notes.append((1, "the block keeps its own memory and could only be sampled"))
        if self._neighbour(crossing):
            notes.append((1, "another solution lies close by, where the curves nearly touch"))
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
            corrected=found.solution,
            waveform=found.waveform,
            bound=bound,
        )

    def _distortion(self, y, w):
        """Sum over k >= 2 of |Y_k H(jk omega)| / a, and from which frequency on H had to be guessed."""
        k = np.arange(2, y.size)
        h, outside = self.linear.clamped(k * w)
        size = np.abs(y[2:] * np.where(np.isfinite(h), h, 0))
        size = np.where(np.isfinite(size), size, 0)
        guessed = outside & (size > 1e-6)
        return float(size.sum()), f"{k[guessed][0] * w:.3g} rad/s" if guessed.any() else ""

    def _spread(self, crossing, distortion, sense, regime):
        """Logarithmic half widths of the bands, the corrected solution where there is one, and notes."""
        a, w = crossing.amplitude, crossing.omega
        c1, c2 = DYNAMIC_ERROR if self.method.name in ("friction", "backlash", "orbit") else MEMORYLESS_ERROR
        estimate = c1 * distortion + c2 * distortion**2  # relative error of N
        spread = tuple(s * estimate + FLOOR for s in sense)
        if self.answer is None or regime in ("aperiodic", "subharmonic"):
            return spread, Balance(None), []
        respond, count = self.answer
        found = balance(respond, count, self.linear, a, w, crossing.jacobian)
        if found.solution is None:
            return (
                spread,
                found,
                [(2 if "no cycle" in found.reason or "reach" in found.reason else 1, found.reason)],
            )
        shift = abs(math.log(found.solution[0] / a)), abs(math.log(found.solution[1] / w))
        return tuple(SAFETY * s + FLOOR for s in shift), found, []

    def _neighbour(self, crossing) -> bool:
        step_a = np.diff(self.log_a).max(initial=0)
        step_w = np.diff(self.log_w).max(initial=0)
        for other in self.scan.crossings:
            if other is crossing:
                continue
            near_a = abs(math.log(other.amplitude / crossing.amplitude)) < 3 * step_a
            near_w = abs(math.log(other.omega / crossing.omega)) < 3 * step_w
            if near_a and near_w:
                return True
        return False


def without_doubles(cycles):
    """Mark predictions that become the same cycle once harmonics are kept: the nearest stands for it."""
    out = list(cycles)
    for i, one in enumerate(cycles):
        for other in cycles:
            if other is one or one.corrected is None or other.corrected is None:
                continue
            same = np.abs(np.log(np.divide(one.corrected, other.corrected))).max() < 0.01
            mine, its = (abs(math.log(c.corrected[0] / c.amplitude)) for c in (one, other))
            if same and mine > its:
                text = (
                    f"With its harmonics kept it becomes the cycle predicted at {other.amplitude:.4g} @ "
                    f"{other.omega:.4g} "
                    "rad/s: there is hardly a cycle of its own. "
                )
                out[i] = replace(one, grade=UNRELIABLE, why=text + one.why)
    return out
