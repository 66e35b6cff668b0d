"""Prediction of limit cycles: every solution of 1 + N(a, omega) H(j omega) = 0, each with its trust."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np
from control.descfcn import DescribingFunctionResponse as _PythonControlResponse

from ...blocks.coordinates import LINE
from ...calls import keywords_of, unknown_keywords
from ...checks import shown
from ...df.arguments import amplitudes_of
from ...df.describing import quiet_describing_function, quiet_family
from ...df.dispatch import method_for
from ...df.family import Family, minus_inverse
from ...df.thresholds import NUM_POINTS
from ...df.work import progress_bar
from ...drawing import draw
from ...table import Table, frame, without_empty
from ...thresholds import ROUNDED
from .assess import Assessor
from .branches import branch_crossings
from .crossings import Scan, find_crossings, merged, real_crossings
from .grade import LimitCycle
from .linear import LinearPart
from .nyquist import BEGINNINGS, KEYWORDS, nyquist_of
from .scan_grid import defect, scan_grid
from .thresholds import OMEGA_POINTS, ORDERS


class DescribingFunctionResponse(_PythonControlResponse):
    """What a describing-function analysis found; python-control's result with the family and the cycles.

    Attributes
    ----------
    limit_cycles : list of LimitCycle
        All solutions in the box, by rising amplitude; empty if there is none. Those on a known motion that N
        does not name (unstable under the force alone, or attracting beside another one) have it in
        ``.branch``.
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

    Examples
    --------
    >>> H = ct.tf([8], [1, 2, 2, 1])
    >>> resp = cdf.describing_function_response(H, cdf.saturation(1), np.linspace(1, 5, 20))
    >>> isinstance(resp, ct.DescribingFunctionResponse)
    True
    >>> len(resp.limit_cycles), resp.status
    (1, 'scanned A 1 to 5, omega 0.01 to 100 rad/s (500499 cells): 1 solution')
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
        return draw("analysis", self, **kwargs)

    def table(self) -> Table:
        """Return the predicted limit cycles, a row each."""
        return without_empty(
            ("amplitude", "omega", "corrected", "stable", "grade", "why"),
            [
                (
                    f"{c.amplitude:.5g}",
                    f"{c.omega:.5g}",
                    "{:.5g} @ {:.5g}".format(*c.corrected) if c.corrected else "",
                    {True: "yes", False: "no", None: "unknown"}[c.stable],
                    c.grade,
                    c.why,
                )
                for c in self.limit_cycles
            ],
        )

    def to_pandas(self):
        """Return the predicted limit cycles as a pandas DataFrame."""
        names = ("amplitude", "output_amplitude", "omega", "stable", "corrected", "distortion", "omega_band")
        names += ("amplitude_band", "grade", "why", "regime", "branch")
        return frame({name: getattr(c, name) for name in names} for c in self.limit_cycles)

    def _repr_html_(self) -> str:
        return self.table()._repr_html_()

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
    num_points=NUM_POINTS,
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

    Examples
    --------
    >>> H = ct.tf([8], [1, 2, 2, 1])
    >>> resp = cdf.describing_function_response(H, cdf.saturation(1), np.linspace(1, 5, 20))
    >>> resp.limit_cycles
    [<LimitCycle: 3.344 @ 1.4142 rad/s, stable, trusted>]
    """
    if _check_kwargs:
        known = [k for k in keywords_of(describing_function_response) if not k.startswith("_")]
        unknown = {k: v for k, v in kwargs.items() if k not in KEYWORDS and not k.startswith(BEGINNINGS)}
        unknown_keywords("describing_function_response", unknown, (*known, *KEYWORDS))
    linear = LinearPart(H)
    if not isinstance(orders, int | np.integer) or isinstance(orders, bool) or orders < 2:
        raise ValueError(f"describing_function_response needs orders as an integer >= 2; got {orders!r}.")
    amplitudes = np.atleast_1d(amplitudes_of(A))
    if amplitudes.ndim != 1 or not (amplitudes > 0).any():
        raise ValueError(
            f"describing_function_response needs A with at least one amplitude > 0 in a 1-D array; got "
            f"{shown(A)}. Give the amplitudes of the box, np.ravel(A)."
        )
    positive = np.unique(amplitudes[amplitudes > 0])
    method = method_for(F, output, try_method, num_points, float(positive[-1]), options)
    _check_timebase(linear, F, method)
    nyquist = nyquist_of(linear, omega, warn_nyquist, _check_kwargs, kwargs)
    limits = kwargs.get("omega_limits")
    frequencies = linear.grid(
        omega if omega is not None else (list(limits) if limits is not None else None),
        OMEGA_POINTS[not method.needs_omega],
    )
    given: dict[str, Any] = dict(
        output=output, try_method=try_method, num_points=num_points, **(options or {})
    )
    zeros = (amplitudes == 0).any() or (omega is not None and np.any(np.asarray(omega) == 0))
    family = quiet_family(F, positive, frequencies, orders, executor, save=save, progress=progress, **given)
    if method.needs_omega:
        N_vals = family.minus_inverse
    else:
        with_zero = quiet_describing_function(F, amplitudes, zero_check=False, **given)
        N_vals = minus_inverse(with_zero)

    log_a, log_w, values = scan_grid(method, linear, family)
    with progress_bar(None, progress, "refining crossings", "point") as bar:
        D = defect(method, linear, bar)
        scan = find_crossings(D, log_a, log_w, values, refine)
        if refine and method.static and log_a.size > 1:
            N: Any = method.harmonics(np.exp(log_a), None, 1)[0][:, 0, 1]
            if (np.abs(N.imag) <= ROUNDED * np.abs(N)).all():
                more = real_crossings(D, log_a, log_w, N.real, lambda w: linear.clamped(w)[0])
                scan = merged(scan, more)
        branched = branch_crossings(method, linear, family, (log_a, log_w), values, scan.crossings, refine)
    cycles = Assessor(method, linear, F, D, (log_a, log_w), scan, family, orders, branched).cycles()
    return DescribingFunctionResponse(
        nyquist,
        N_vals,
        [complex(linear.clamped(np.array([c.omega]))[0][0]) for c in cycles],
        [(c.amplitude, c.omega) for c in cycles],
        family=family,
        limit_cycles=cycles,
        status=getattr(F, "coordinates", LINE).text(_status(scan, cycles, positive, frequencies, zeros)),
        H=H,
        block=F,
    )


def _check_timebase(linear, F, method):
    dt = getattr(F, "dt", None)
    if dt is None or not isinstance(F, ct.NonlinearIOSystem) or not method.needs_omega:
        return
    if bool(linear.dt) != bool(dt) or (
        linear.dt and dt is not True and abs(float(dt) - linear.dt) > ROUNDED * linear.dt
    ):
        mine = f"dt={linear.H.dt}"
        raise ValueError(
            f"H and the block need one timebase; got {mine} for H and dt={dt} for the block. "
            "Give H in the block's timebase (ct.sample_system makes a continuous H discrete), or simulate "
            "the sampled loop with closed_loop(dt=)."
        )


def _status(scan: Scan, cycles, A, w, zeros) -> str:
    box = f"A {A[0]:.4g} to {A[-1]:.4g}, omega {w[0]:.4g} to {w[-1]:.4g} rad/s"
    if scan.cells == 0:
        return f"nothing scanned: {box} spans no area; give at least two amplitudes and two frequencies"
    number = {0: "no solution", 1: "1 solution"}.get(len(cycles), f"{len(cycles)} solutions")
    parts = [f"scanned {box} ({scan.cells} cells): {number}"]
    for name in dict.fromkeys(c.branch for c in cycles if c.branch):
        mine = [c for c in cycles if c.branch == name]
        how = "unstable under the force alone" if mine[0].forced_multiplier >= 1 else "not the one N names"
        parts.append(f"{len(mine)} of them on the {name}, {how}")
    if zeros:
        parts.append("zero amplitudes and frequencies were left out: no cycle can be there")
    if scan.missing:
        parts.append(f"{scan.missing} grid points have no periodic answer and were skipped")
    if scan.unresolved:
        changes = "1 sign change holds" if scan.unresolved == 1 else f"{scan.unresolved} sign changes hold"
        parts.append(f"{changes} no solution (N jumps there, or the curves only come near)")
    if scan.truncated:
        parts.append("the search stopped at its bound on work: narrow the box or the step")
    return "; ".join(parts)
