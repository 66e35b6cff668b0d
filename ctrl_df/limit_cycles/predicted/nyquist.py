"""python-control's Nyquist response of H, for plots and for whoever reads ``.response``."""

from __future__ import annotations

import warnings

import control as ct
import numpy as np

from .linear import LinearPart
from .scan_grid import refined_omega
from .thresholds import INDENT, OMEGA_POINTS, OMEGA_POINTS_DRAWN

KEYWORDS = ("omega_limits", "omega_num", "return_contour", "indent_radius")
"""Of ``ct.nyquist_response`` that `describing_function_response` hands on, beside `BEGINNINGS`."""

BEGINNINGS = ("indent_", "encirclement_", "_kwargs")


def nyquist_of(linear: LinearPart, omega, warn, check, kwargs):
    """Return the Nyquist response of H over `omega`, or over python-control's own choice.

    Parameters
    ----------
    linear : LinearPart
    omega : array_like or None
        As in `describing_function_response`.
    warn : bool or None
        Whether the contour may warn; None: only if `omega` is None.
    check : bool
        Whether python-control refuses unknown keywords.
    kwargs : dict
        Further keywords of ``ct.nyquist_response``.
    """
    if warn is None:
        warn = omega is None
    H = linear.H
    if linear.measured:
        own = np.asarray(H.omega)
        w = own if omega is None else linear.grid(omega, OMEGA_POINTS_DRAWN)
        # python-control evaluates points along j omega only; a sampled H gets its circle afterwards
        H = ct.frd(linear(w[w > 0]), w[w > 0], name=H.name)
        omega, warn = None, False
    elif isinstance(omega, list | tuple) and len(omega) == 2:
        omega = linear.grid(omega, OMEGA_POINTS[True])
    elif omega is not None:
        omega = linear.grid(np.asarray(omega).reshape(-1))
        # the drawn curve passes through the crossings
        omega = refined_omega(linear, omega, most=OMEGA_POINTS[True])
    if omega is None and not linear.proper:  # its contour never closes: draw what is scanned
        omega, warn = linear.grid(), False
    if not linear.measured and "indent_radius" not in kwargs:
        # python-control's own is in rad/s: where a period takes days it swallows the contour
        seen = linear.grid() if omega is None else np.asarray(omega)
        kwargs = {**kwargs, "indent_radius": INDENT * float(np.sqrt(seen[seen > 0].min() * seen.max()))}
    with warnings.catch_warnings():
        if not warn:
            warnings.simplefilter("ignore")
        response = ct.nyquist_response(
            H, omega, warn_encirclements=warn, warn_nyquist=warn, _check_kwargs=check, **kwargs
        )
    if linear.measured and linear.dt:
        response.contour, response.dt = np.exp(np.asarray(response.contour) * linear.dt), linear.H.dt
    return response
