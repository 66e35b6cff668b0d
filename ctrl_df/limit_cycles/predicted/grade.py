"""What a predicted limit cycle says about itself: stability, sensitivity, error bands, grade and reason."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from .path import Path
from .thresholds import BAND, BAND_MOST, DISTORTION, LOEB, SENSITIVITY

TRUSTED, DOUBTFUL, UNRELIABLE = "trusted", "doubtful", "unreliable"

# Thresholds of the grades; benchmarks of tests/problems.py stand behind them.

_IRREGULAR = ("aperiodic", "subharmonic", "diverged", "work limit", "stuck", "free", "resonance", "unstable")


class Sensitivity(NamedTuple):
    """Relative change of amplitude and frequency per relative error in N, worst phase of the error."""

    amplitude: float
    omega: float


class ForcedMotion(NamedTuple):
    """Motion of the block under ``a cos(omega t)``: its state at t = 0, and Y_k of the output from k = 0."""

    state: np.ndarray
    harmonics: np.ndarray


@dataclass(frozen=True)
class LimitCycle:
    """One solution of 1 + N(a, omega) H(j omega) = 0, and how far to trust it.

    N is the describing function or, where `branch` names a motion, that of this motion: under the same force
    a block may have several, and each may balance the loop.

    Attributes
    ----------
    amplitude : float
        Peak value of the fundamental at the block's input.
    output_amplitude : float
        The same at the block's output, ``|N| a``.
    omega : float
        [rad/s].
    stable : bool or None
        Loeb's criterion: whether a slightly larger oscillation decays. A quasi-static heuristic, not a
        proof; None where the curves are nearly tangent. False also where the block leaves the motion of
        `branch` under the force alone. The exact verdict is the Floquet multipliers of the orbit.
    residual : float
        ``|1 + N H|`` that remains.
    sensitivity : Sensitivity
        ``(amplitude, omega)``: d ln a and d ln omega per relative error in N.
    distortion : float
        Harmonics that return to the block's input, summed, relative to its fundamental.
    omega_band, amplitude_band : tuple of float
        (low, high): where the exact cycle is expected.
    grade : str
        ``trusted``, ``doubtful`` or ``unreliable``.
    why : str
        The reason, a sentence.
    regime : str
        What the block does there, as in `Family.motion`.
    path : Path or None
        The way from this solution to the cycle with all its harmonics, where the block's response to them is
        known.
    corrected : tuple of float or None
        (amplitude, omega) with the fed-back harmonics taken into account, where that path leads so far.
    bound : tuple or None
        ((a low, a high), (omega low, omega high)) proven to hold a cycle, after Mees & Bergen, whose theorem
        is about odd memoryless blocks of bounded slope and a continuous, strictly proper H. None for other
        loops, and where it proves nothing, which `why` then says.
    branch : str
        Empty where N is the describing function; else the motion of the block it stands for, one that the
        describing function does not name there (it repels, or another one attracts beside it).
    forced_multiplier : float
        Of a motion known as a branch: its largest multiplier over a period of the force, alone; NaN else.
    motion : ForcedMotion or None
        That motion, where `branch` names one and it is known.

    Examples
    --------
    >>> H = ct.tf([8], [1, 2, 2, 1])
    >>> resp = cdf.describing_function_response(H, cdf.saturation(1), np.linspace(1, 5, 20))
    >>> cycle = resp.limit_cycles[0]
    >>> cycle.grade, cycle.stable
    ('trusted', True)
    >>> print(f"{cycle.amplitude:.4f} at {cycle.omega:.4f} rad/s, harmonics {cycle.distortion:.3f}")
    3.3440 at 1.4142 rad/s, harmonics 0.013
    """

    amplitude: float
    output_amplitude: float
    omega: float
    stable: bool | None
    residual: float
    sensitivity: Sensitivity
    distortion: float
    omega_band: tuple[float, float]
    amplitude_band: tuple[float, float]
    grade: str
    why: str
    regime: str = ""
    corrected: tuple[float, float] | None = None
    path: Path | None = field(default=None, repr=False, compare=False)
    bound: tuple[tuple[float, float], tuple[float, float]] | None = None
    branch: str = ""
    forced_multiplier: float = math.nan
    motion: ForcedMotion | None = field(default=None, repr=False, compare=False)

    def __repr__(self) -> str:
        """Return amplitude, frequency, stability and grade."""
        stable = {True: "stable", False: "unstable", None: "stability unknown"}[self.stable]
        return f"<LimitCycle: {self.amplitude:.5g} @ {self.omega:.5g} rad/s, {stable}, {self.grade}>"

    @property
    def period(self) -> float:
        """2 pi / omega [s]."""
        return 2 * math.pi / self.omega


def loeb(jacobian) -> bool | None:
    """Sign of growth after a small rise of the amplitude.

    With s = sigma + j omega, D_a da + D_s ds = 0 and D_s = -j dD/domega give dsigma/da = Im(D_a / D_omega);
    in the matrix of derivatives by (ln a, ln omega) that is minus its determinant, up to a positive factor.

    References
    ----------
    Loeb (1956); Gelb & Vander Velde (1968), sec. 3.2. Its extension to N(a, omega) is quasi-static.
    """
    by_a, by_w = jacobian[:, 0], jacobian[:, 1]
    size = np.linalg.norm(by_a) * np.linalg.norm(by_w)
    if not np.isfinite(size) or size == 0:
        return None
    sine = np.linalg.det(jacobian) / size
    return None if abs(sine) < LOEB else bool(sine > 0)


def sensitivity(jacobian) -> Sensitivity:
    """Worst shift per relative error e in N: D changes by -e, so the shift is J^-1 (Re e, Im e)."""
    try:
        inverse = np.linalg.inv(jacobian)
    except np.linalg.LinAlgError:
        return Sensitivity(math.inf, math.inf)
    rows = np.linalg.norm(inverse, axis=1)
    return Sensitivity(float(rows[0]), float(rows[1]))


def band(value: float, spread: float) -> tuple[float, float]:
    """Interval around a positive value, `spread` on either side of its logarithm."""
    spread = min(spread, BAND_MOST)
    return value * math.exp(-spread), value * math.exp(spread)


def graded(*, distortion, sensitivity, spread, stable, regime, notes=()) -> tuple[str, str]:
    """Grade and reason of a prediction.

    Parameters
    ----------
    distortion : float
    sensitivity : Sensitivity
    spread : tuple of float
        Half widths of the bands of (amplitude, omega), logarithmic.
    stable : bool or None
    regime : str
    notes : sequence of (level, text)
        Further reasons; level 0 (informs), 1 (doubtful) or 2 (unreliable).
    """
    reasons: list[tuple[int, str]] = []
    if regime.startswith(_IRREGULAR):
        reasons.append((2, f"the block's motion there is {regime}, so a single N does not describe it"))
    elif regime == "asymmetric":
        reasons.append((1, "the block's output is asymmetric there: a mean and even harmonics are left out"))
    reasons += _over(
        distortion, DISTORTION, f"harmonics of {100 * distortion:.0f} % of the fundamental are fed back"
    )
    reasons += _over(
        sensitivity.amplitude,
        SENSITIVITY,
        f"the curves cross nearly tangentially: 1 % in N moves the amplitude by {sensitivity.amplitude:.1f} "
        f"%",
    )
    told = any(level for level, _ in reasons)
    for wide, of in zip(spread, ("amplitude", "frequency"), strict=True):
        only = f"the {of} is known to a factor of {math.exp(min(wide, BAND_MOST)):.2g} only"
        reasons += _over(wide, BAND, "" if told else only)
    if stable is None:
        reasons.append((1, "the sign that decides stability is close to zero"))
    reasons += list(notes)
    level = max((lvl for lvl, _ in reasons), default=0)
    texts = [text for lvl, text in sorted(reasons, key=lambda r: -r[0]) if text and lvl > 0]
    if level == 0:
        texts = [
            f"harmonics fed back are {100 * distortion:.1f} % of the fundamental and the curves cross "
            f"cleanly "
            f"(1 % in N moves the amplitude by {sensitivity.amplitude:.1f} %)"
        ]
    texts += [text for lvl, text in reasons if lvl == 0 and text]
    sentence = "; ".join(texts)
    return (TRUSTED, DOUBTFUL, UNRELIABLE)[level], sentence[:1].upper() + sentence[1:] + "."


def _over(value, limits, text):
    if value <= limits[0]:
        return []
    return [(2 if value > limits[1] or math.isnan(value) else 1, text)]
