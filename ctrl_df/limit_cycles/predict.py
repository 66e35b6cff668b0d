"""Prediction of limit cycles: every solution of 1 + N(a, omega) H(j omega) = 0, each with its trust."""

from __future__ import annotations

import importlib
import math
import warnings
from dataclasses import replace
from typing import Any

import control as ct
import numpy as np
from control.descfcn import DescribingFunctionResponse as _PythonControlResponse

from ..df.describing import _amplitudes, describing_function, describing_function_family, points
from ..df.dispatch import Method, method_for
from ..df.family import Family, minus_inverse
from .balance import Balance, balance, responder
from .bound import mees_bergen
from .crossings import Crossing, Scan, find_crossings, linear_zeros
from .grade import UNRELIABLE, LimitCycle, band, graded, loeb, sensitivity
from .linear import LinearPart

ORDERS = 9
SAFETY = 1.5  # on the shift that the returned harmonics cause, where they can be computed
# Relative error of N from returned harmonics d where they cannot be carried, c1 d + c2 d^2. A jump or a
# corner answers its harmonics at once; a mass hardly (friction and backlash loops of tests/problems.py:
# 0.003 at 0.10, 0.007 at 0.20, 0.21 at 0.79).
MEMORYLESS_ERROR, DYNAMIC_ERROR = (1.5, 0.0), (0.01, 0.4)
FLOOR = 1e-3  # least half width of a band
_FAST = ("element", "law", "rate", "linear", "friction")
_NOISE = 1e-6  # spread of an average from which N jumps from point to point
_OMEGA_POINTS = {True: 1000, False: 200}  # of a range: memoryless, dynamic


class DescribingFunctionResponse(_PythonControlResponse):
    """What a describing-function analysis found; python-control's result with the family and the cycles.

    Attributes
    ----------
    limit_cycles : list of LimitCycle
        All solutions in the box, by rising amplitude; empty if there is none.
    status : str
        What was scanned and what was left out.
    family : Family
        N on the grid.
    H : LTI system
        The linear part.
    block : object
        The nonlinear part.
    response : NyquistResponseData
        H along its Nyquist contour.
    N_vals : ndarray of complex
        -1/N: by amplitude for a memoryless block, by amplitude and frequency otherwise.
    positions : list of complex
        H at the crossings.
    intersections : list of (amplitude, omega)
    """

    def __init__(
        self,
        response,
        N_vals,
        positions,
        intersections,
        *,
        family=None,
        limit_cycles=(),
        status="",
        H=None,
        block=None,
    ):
        super().__init__(response, N_vals, positions, intersections)
        self.family: Family | None = family
        self.limit_cycles: list[LimitCycle] = list(limit_cycles)
        self.status: str = status
        self.H = H
        self.block = block

    def plot(self, **kwargs) -> ct.ControlPlot:
        """Draw the Nyquist plot with the -1/N curves; see `describing_function_plot`."""
        return importlib.import_module("ctrl_df.plot.describing").describing_function_plot(self, **kwargs)

    def __repr__(self) -> str:
        """Return the status."""
        return f"<DescribingFunctionResponse: {self.status}>"


def describing_function_response(
    H,
    F,
    A,
    omega=None,
    refine=True,
    warn_nyquist=None,
    _check_kwargs=True,
    *,
    output=None,
    orders=ORDERS,
    num_points=100,
    try_method=True,
    executor=None,
    save=None,
    progress=None,
    options=None,
    **kwargs,
) -> DescribingFunctionResponse:
    """Find all limit cycles that the describing function predicts for H in feedback with a block.

    Parameters
    ----------
    H : TransferFunction, StateSpace or FrequencyResponseData
        Linear part: one input, one output; continuous, discrete or measured. It may be improper (the ideal
        PID).
    F : block, ct.NonlinearIOSystem, python-control nonlinearity or callable
        Nonlinear part; the loop is negative feedback, ``u = -H y``.
    A : array_like
        Amplitudes at the block's input; the box to search reaches from the least positive to the greatest.
    omega : array_like, optional
        Frequencies [rad/s]; a two-element list is a range, an array are points. Default: from the poles and
        zeros of H.
    refine : bool
        Whether to converge each solution; False gives grid estimates.
    warn_nyquist : bool, optional
        As in python-control: whether its Nyquist contour may warn; default only if `omega` is left out.
    output : str or int, optional
        Output of the block that H sees; default the first.
    orders : int
        Harmonics kept, >= 2.
    num_points, try_method, executor, save, progress
        As in `describing_function_family`.
    options : dict, optional
        For the general solver of forced periodic orbits.
    **kwargs
        Passed to ``ct.nyquist_response``.

    Returns
    -------
    DescribingFunctionResponse

    Raises
    ------
    TypeError, ValueError
        H not linear or not SISO, frequencies outside measured data or above the Nyquist frequency, a block
        whose sampling time differs from H's, amplitudes negative or not finite, an unknown keyword.

    References
    ----------
    Gelb & Vander Velde (1968), ch. 3; Azenha & Machado (1997), eq. (5).
    """
    linear = LinearPart(H)
    amplitudes = np.atleast_1d(_amplitudes(A))
    if amplitudes.ndim != 1 or not (amplitudes > 0).any():
        raise ValueError(f"A needs at least one amplitude > 0 in a 1-D array; got {A!r}.")
    positive = np.unique(amplitudes[amplitudes > 0])
    method = method_for(F, output, try_method, num_points, float(positive[-1]), options)
    _check_timebase(linear, F, method)
    nyquist = _nyquist(linear, omega, warn_nyquist, _check_kwargs, kwargs)
    limits = kwargs.get("omega_limits")
    frequencies = linear.grid(
        omega if omega is not None else (list(limits) if limits is not None else None),
        _OMEGA_POINTS[not method.needs_omega],
    )
    given: dict[str, Any] = dict(
        output=output, try_method=try_method, num_points=num_points, **(options or {})
    )
    family = describing_function_family(
        F, positive, frequencies, max(orders, 2), executor, save=save, progress=progress, **given
    )
    if method.needs_omega:
        N_vals = family.minus_inverse
    else:
        with_zero = describing_function(F, amplitudes, zero_check=False, **given)
        N_vals = minus_inverse(with_zero)

    D = _defect(method, linear)
    log_a, log_w, values = _scan_grid(method, linear, family)
    scan = find_crossings(D, log_a, log_w, values, refine)
    assessor = _Assessor(method, linear, F, D, (log_a, log_w), scan, family, max(orders, 2))
    cycles = assessor.cycles()
    return DescribingFunctionResponse(
        nyquist,
        N_vals,
        [complex(linear.clamped(np.array([c.omega]))[0][0]) for c in cycles],
        [(c.amplitude, c.omega) for c in cycles],
        family=family,
        limit_cycles=cycles,
        status=_status(scan, cycles, positive, frequencies),
        H=H,
        block=F,
    )


def _defect(method: Method, linear: LinearPart):
    """D(ln a, ln omega) = 1 + N H, for matching 1-D arrays; NaN where N is a noisy average."""

    def D(p, q):
        a, w = np.exp(p), np.exp(q)
        h, _ = linear.clamped(w)
        N, regime, spread = points(method, a, w)
        with np.errstate(all="ignore"):
            return np.where(_noisy(regime, spread), np.nan, 1 + N * h)

    return D


def _noisy(regime, spread):
    """Where N is an average over irregular motion rather than a function of (a, omega)."""
    return (np.asarray(regime) == "aperiodic") & ~(np.asarray(spread) < _NOISE)


def _scan_grid(method: Method, linear: LinearPart, family: Family):
    """Return the grid to search: the family's, finer where that costs little or H varies fast."""
    w = _refined_omega(linear, family.omega)
    if method.name in _FAST:
        coarse = family.amplitudes
        a = _refined(coarse, 160 if not method.needs_omega else 60)
        if method.needs_omega and a.size * w.size > 60_000:
            a = coarse
        N = method.harmonics(a, w if method.needs_omega else None, 1)[0][..., 1]
    else:
        a, N = family.amplitudes, _interpolated(np.log(family.omega), family.N, np.log(w))
    with np.errstate(all="ignore"):
        values = 1 + np.broadcast_to(N, (a.size, w.size)) * linear(w)
    return np.log(a), np.log(w), values


def _refined(grid, least):
    """Points between those of a grid, equally many in each step, so that there are at least `least`."""
    if grid.size < 2:
        return grid
    cuts = max(1, math.ceil(least / (grid.size - 1)))
    return np.unique(
        np.concatenate([np.geomspace(lo, hi, cuts + 1) for lo, hi in zip(grid[:-1], grid[1:], strict=True)])
    )


def _refined_omega(linear, w, change=0.15, most=3000):
    """Halve steps of ln omega until H changes by at most `change` (relative) from point to point."""
    for _ in range(12):
        if w.size < 2 or w.size >= most:
            break
        h = linear(w)
        with np.errstate(all="ignore"):
            step = np.abs(np.diff(h)) / np.minimum(np.abs(h[1:]), np.abs(h[:-1]))
        coarse = (step > change) & (np.diff(np.log(w)) > 1e-5)
        if not coarse.any():
            break
        w = np.unique(np.concatenate([w, np.sqrt(w[:-1] * w[1:])[coarse]]))
    return w


def _interpolated(q, N, fine):
    """N between columns, linear in log magnitude and phase over ln omega (a power of omega is exact)."""
    if q.size == fine.size:
        return N
    upper = np.clip(np.searchsorted(q, fine), 1, q.size - 1)
    share = (fine - q[upper - 1]) / (q[upper] - q[upper - 1])
    left, right = N[:, upper - 1], N[:, upper]
    with np.errstate(all="ignore"):
        turn = np.where(left == 0, 0, right / np.where(left == 0, 1, left))
        smooth = left * np.exp(share * np.log(np.where(turn == 0, 1, turn)))
    return np.where(turn == 0, (1 - share) * left + share * right, smooth)


class _Assessor:
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
        return sorted(_without_doubles(found), key=lambda c: (c.amplitude, c.omega))

    def _irregular(self) -> list[LimitCycle]:
        """Crossings among averages over irregular motion: the interpolant's zeros, one a neighbourhood."""
        noisy = _noisy(self.family.regime, self.family.residual)
        if self.method.name in _FAST or not noisy.any():
            return []
        log_a, log_w = np.log(self.family.amplitudes), np.log(self.family.omega)
        with np.errstate(all="ignore"):
            values = 1 + self.family.N * self.linear(self.family.omega)
        cells = noisy[:-1, :-1] | noisy[1:, :-1] | noisy[:-1, 1:] | noisy[1:, 1:]
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
            if not _noisy(regime, spread)[0, 0] or not residual <= max(0.05, 3 * spread[0, 0]):
                continue  # a jump between coexisting motions, not a crossing
            note = (
                2,
                "N is an average over irregular motion there and the place of the crossing an interpolation",
            )
            J = _grid_slope(log_a, log_w, values, place)
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


def _grid_slope(log_a, log_w, values, place):
    """Return the derivatives of the interpolant in the cell that holds `place`."""
    i = int(np.clip(np.searchsorted(log_a, place[0]) - 1, 0, log_a.size - 2))
    k = int(np.clip(np.searchsorted(log_w, place[1]) - 1, 0, log_w.size - 2))
    v = values[i : i + 2, k : k + 2]
    by_a = (v[1] - v[0]).mean() / (log_a[i + 1] - log_a[i])
    by_w = (v[:, 1] - v[:, 0]).mean() / (log_w[k + 1] - log_w[k])
    return np.array([[by_a.real, by_w.real], [by_a.imag, by_w.imag]])


def _without_doubles(cycles):
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


def _nyquist(linear, omega, warn, check, kwargs):
    """python-control's Nyquist response of H, for plots and for whoever reads `.response`."""
    if warn is None:
        warn = omega is None
    H = linear.H
    if linear.measured:
        own = np.asarray(H.omega)
        w = own if omega is None else linear.grid(omega, 500)
        H = ct.frd(linear(w[w > 0]), w[w > 0], dt=H.dt, name=H.name)
        omega, warn = None, False
    elif isinstance(omega, list | tuple) and len(omega) == 2:
        omega = linear.grid(omega, 1000)
    elif omega is not None:
        omega = linear.grid(np.asarray(omega, dtype=float).reshape(-1))
        omega = _refined_omega(
            linear, omega, most=1000
        )  # so that the drawn curve passes through the crossings
    if omega is None and not linear.proper:  # its contour never closes: draw what is scanned
        omega, warn = linear.grid(), False
    with warnings.catch_warnings():
        if not warn:
            warnings.simplefilter("ignore")
        return ct.nyquist_response(
            H, omega, warn_encirclements=warn, warn_nyquist=warn, _check_kwargs=check, **_rest(kwargs, check)
        )


def _rest(kwargs, check):
    known = {"omega_limits", "omega_num", "return_contour", "_kwargs"}
    unknown = [k for k in kwargs if k not in known and not k.startswith(("indent_", "encirclement_"))]
    if check and unknown:
        raise TypeError(f"unrecognized keywords: {', '.join(unknown)}")
    return kwargs


def _check_timebase(linear, F, method):
    dt = getattr(F, "dt", None)
    if dt is None or not isinstance(F, ct.NonlinearIOSystem) or not method.needs_omega:
        return
    if bool(linear.dt) != bool(dt) or (
        linear.dt and dt is not True and abs(float(dt) - linear.dt) > 1e-12 * linear.dt
    ):
        mine = f"dt={linear.H.dt}"
        raise ValueError(
            f"H and the block need one timebase; got {mine} for H and dt={dt} for the block. "
            "Convert H with ct.sample_system or ct.d2c's like, or simulate the sampled loop with "
            "closed_loop(dt=)."
        )


def _status(scan: Scan, cycles, A, w) -> str:
    box = f"A {A[0]:.4g} to {A[-1]:.4g}, omega {w[0]:.4g} to {w[-1]:.4g} rad/s"
    if scan.cells == 0:
        return f"nothing scanned: {box} spans no area; give at least two amplitudes and two frequencies"
    number = {0: "no solution", 1: "1 solution"}.get(len(cycles), f"{len(cycles)} solutions")
    parts = [f"scanned {box} ({scan.cells} cells): {number}"]
    if scan.missing:
        parts.append(f"{scan.missing} grid points have no periodic answer and were skipped")
    if scan.unresolved:
        parts.append(
            f"{scan.unresolved} sign changes hold no solution (N jumps there, or the curves only come near)"
        )
    if scan.truncated:
        parts.append("the search stopped at its bound on work: narrow the box or the step")
    return "; ".join(parts)
