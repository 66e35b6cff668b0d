"""Names of forced motions: what a body does in an orbit, and what can stand in the way of one."""

from __future__ import annotations

from ...simulate.program import layout
from ...simulate.program.layout import EVENT_KINDS
from ..thresholds import DRIFTS, EVEN_LEAST, EVEN_MISS, LONGEST_PERIOD
from .driven_block import DrivenBlock, Laws

ORBIT_REGIMES = (
    "slip",
    "stick-slip",
    "stuck",
    "impact",
    "contact",
    "asymmetric",
    "subharmonic",
    "aperiodic",
    "smooth",
    "diverged",
    "work limit",
    "drifting",
    "free",
    "resonance",
    *(f"subharmonic {k}" for k in range(2, LONGEST_PERIOD + 1)),
)
"""Names of the motions: a sliding mass that never rests; one that does; nothing moves (N is NaN); impacts
without and with sustained contact; one period but no half-wave symmetry although the laws have it; several
periods, with their number; none; no dry friction and no contact; the state runs away (NaN); the bound on
work was hit (NaN); the mass travels steadily besides oscillating (the ramp is no part of the harmonics);
a load never touched; an undamped linear mechanism driven at its natural frequency, whose oscillation grows
without bound (NaN)."""

CODE = {name: i for i, name in enumerate(ORBIT_REGIMES)}

BIT = {name: 1 << i for i, name in enumerate(EVENT_KINDS)}
TOUCH = BIT["impact"] | BIT["contact"] | BIT["release"]
"""Kinds of events by which the bodies of a joint touch."""


def regime_of(
    block: DrivenBlock, laws: Laws, *, mirrored: bool, kinds: int, stuck: bool, fundamental, even, ends, error
) -> str:
    """Return the regime of a motion of one period.

    Parameters
    ----------
    block : DrivenBlock
    laws : Laws
    mirrored : bool
        Whether it was found over half a period.
    kinds : int
        Kinds of events in it (bits).
    stuck : bool
        Whether every body is held at its end.
    fundamental, even : complex, float
        Y_1, and the largest even harmonic over it.
    ends : (2,)
        The output at the start and the end of the shot.
    error : float
        Of the orbit, relative.
    """
    s = laws.symmetries
    if stuck and not kinds & ~(BIT["corner"] | BIT["switch"]):
        return "stuck"
    if block.gap and not kinds & TOUCH:
        return "free"
    drift = abs(ends[1] - ends[0]) if not mirrored else 0.0
    if drift > DRIFTS * abs(fundamental) and (s.wrap.any() or (s.shifts and not s.inertial.any())):
        return "drifting"
    if laws.odd and even > max(EVEN_LEAST, EVEN_MISS * error):
        return "asymmetric"
    rigid = kinds & (BIT["impact"] | BIT["stop"])
    if kinds & BIT["stop contact"] or (kinds & BIT["contact"] and not _elastic(block)):
        return "contact"
    if rigid:
        return "impact"
    if kinds & (BIT["stick"] | BIT["breakaway"]):
        return "stick-slip"
    return "slip" if kinds & BIT["reversal"] else "smooth"


def _elastic(block):
    prog = block.engine.program
    return any(prog.ints[n[layout.AUX] + layout.A_JOINT] == layout.J_ELASTIC for n in block.mechanisms)
