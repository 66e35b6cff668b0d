"""An orbit of a loop of straight pieces, sought by the times it spends on each.

A waveform that just reaches a further level of a quantizer tells the pieces its cycle runs through: which,
in what order, about how long. With these times unknown beside the state, the equations (each piece ends at
its corner, the last at the start) stay smooth where a corner is only just reached; Newton on the state alone
misses the brief visit, and finds a neighbour without it.

References
----------
Astrom (1995), Oscillations in systems with relay feedback; di Bernardo et al. (2008), Piecewise-smooth
Dynamical Systems, ch. 2.
"""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np
from scipy.linalg import expm

from ..blocks.primitives import PiecewiseAffine, Quantizer
from ..thresholds import NEWTON_FAR, NOTHING, ROUNDED
from .exact.thresholds import PIECES_LONGEST
from .predicted.path import Path
from .thresholds import VISIT_CLOSED, VISIT_SAMPLES, VISIT_SIZE, VISITS


def by_pieces(loop: Any, path: Path) -> tuple[np.ndarray, float] | None:
    """Return a state on the cycle at the end of a path, and its period; None where it is not found so.

    For laws without time of straight pieces, behind a strictly proper controller in continuous time.
    """
    law = getattr(loop.parts.block, "primitive", None)
    controller = loop.syslist[0]
    if not isinstance(controller, ct.StateSpace) or controller.dt or np.any(controller.D):
        return None
    if loop.nstates != controller.nstates or not isinstance(law, Quantizer | PiecewiseAffine):
        return None
    visits = _visits(law, path)
    if visits is None:
        return None
    pieces, times, begin = visits
    a, b, c = (np.asarray(m, float) for m in (controller.A, controller.B, controller.C))
    b, c = b[:, :1], c[:1]
    n, count = len(a), len(pieces)
    lines = [_line(law, k) for k in pieces]
    corners = np.array(
        [_corner(law, k, after) for k, after in zip(pieces, [*pieces[1:], pieces[0]], strict=True)]
    )
    modes = []
    for slope, intercept in lines:
        mode = np.zeros((n + 1, n + 1))
        mode[:n, :n], mode[:n, n] = a - slope * b @ c, -b[:, 0] * intercept
        modes.append(mode)

    k = np.arange(1, path.response.size)
    response = [np.linalg.solve(1j * m * path.omega * np.eye(n) - a, -b[:, 0]) for m in k]
    x = np.real(np.array(response).T @ (path.response[1:] * np.exp(1j * k * path.omega * begin)))
    size = np.maximum(np.abs(x), VISIT_SIZE * np.abs(x).max())
    height = float(np.abs(path.waveform).sum())
    times = np.array(times)

    for _ in range(NEWTON_FAR):
        at, moved = np.append(x, 1.0), np.eye(n + 1)
        defect, J = np.zeros(n + count), np.zeros((n + count, n + count))
        ends = np.zeros((n + 1, count))  # derivatives of the state here by the times so far
        for i, mode in enumerate(modes):
            step = expm(mode * times[i])
            at, moved, ends = step @ at, step @ moved, step @ ends
            ends[:, i] = mode @ at
            defect[n + i] = (float(c[0] @ at[:n]) - corners[i]) / height
            J[n + i, :n] = c[0] @ moved[:n, :n] * size / height
            J[n + i, n:] = c[0] @ ends[:n] * times / height
        defect[:n] = (at[:n] - x) / size
        J[:n, :n] = moved[:n, :n] * size / size[:, None] - np.eye(n)
        J[:n, n:] = ends[:n] * times / size[:, None]
        if not np.isfinite(J).all():
            return None
        if np.abs(defect).max() < VISIT_CLOSED:
            longest = int(np.argmax(times))
            at = np.append(x, 1.0)
            for i in range(longest):
                at = expm(modes[i] * times[i]) @ at
            return (expm(0.5 * modes[longest] * times[longest]) @ at)[:n], float(times.sum())
        change = np.linalg.lstsq(J, -defect, rcond=ROUNDED)[0]
        change *= min(1.0, PIECES_LONGEST / max(float(np.abs(change).max()), NOTHING))
        x, times = x + change[:n] * size, times * np.exp(change[n:])  # times stay positive
    return None


def _visits(law, path):
    """Pieces that the waveform runs through, the time on each, and when the first one begins; or None."""
    full = np.zeros(VISIT_SAMPLES // 2 + 1, complex)
    full[: path.waveform.size] = path.waveform * VISIT_SAMPLES / 2
    full[0] *= 2
    u = np.fft.irfft(full, VISIT_SAMPLES)
    at = np.round(u / law.step).astype(int) if isinstance(law, Quantizer) else np.searchsorted(law.corners, u)
    changes = np.flatnonzero(at != np.roll(at, 1))
    if not 2 <= changes.size <= VISITS or np.abs(at[changes] - at[changes - 1]).max() > 1:
        return None
    tick = 2 * np.pi / path.omega / VISIT_SAMPLES
    spans = np.diff(np.append(changes, changes[0] + VISIT_SAMPLES)) * tick
    return [int(v) for v in at[changes]], spans, changes[0] * tick


def _line(law, k):
    return (0.0, law.step * k) if isinstance(law, Quantizer) else (law.slope[k], law.intercept[k])


def _corner(law, k, after):
    low = min(k, after)
    return (low + 0.5) * law.step if isinstance(law, Quantizer) else law.corners[low]
