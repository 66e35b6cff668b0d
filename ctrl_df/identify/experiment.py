"""The next experiment: the input that separates the candidates that remain."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .simulator import free_run


@dataclass(frozen=True, eq=False)
class Experiment:
    """An input ready to be played.

    Attributes
    ----------
    t, u : arrays
        Times [s] and force [N], held between samples.
    kind : str
        ``multisine``, ``chirp``, ``steps`` or ``triangle``.
    candidates : tuple of str
        What it separates.
    separation : float
        rms difference of their outputs, over the noise; the least over all pairs.
    stroke : float
        Largest position any candidate reaches [m].
    reason : str
        A sentence.
    """

    t: np.ndarray
    u: np.ndarray
    kind: str
    candidates: tuple[str, ...]
    separation: float
    stroke: float
    reason: str

    def __iter__(self):
        return iter((self.t, self.u))


def next_experiment(diagnosis, *, force=None, stroke=None, duration=None, dt=None) -> Experiment | None:
    """Choose the input that separates the remaining candidates best.

    Parameters
    ----------
    diagnosis : Diagnosis
    force, stroke : float or None
        Limits [N], [m] about the start; None: those of the diagnosis, else what the records reached.
    duration, dt : float or None
        [s]; None: as the first record.

    Without a stroke given, twice the stroke of the first record is allowed.

    Returns
    -------
    Experiment or None
        None where nothing remains to be separated (verdict ``none``).
    """
    remaining = [c for c in diagnosis.remaining if c.model is not None]
    if diagnosis.verdict == "none" or not remaining:
        return None
    record = diagnosis.train[0]
    given = diagnosis.limits
    force = float(force or given.get("force") or np.max(np.abs(record.u)))
    centre = float(record.y[0])
    reach = float(stroke or given.get("stroke") or 2 * np.max(np.abs(record.y - centre)))
    duration, dt = float(duration or record.duration), float(dt or record.dt)
    if not (force > 0 and reach > 0 and duration > 20 * dt):
        raise ValueError(
            f"next_experiment needs force > 0, stroke > 0 and duration > 20 dt; got {force}, {reach}, {duration}, {dt}."
        )
    models = [diagnosis.model] if len(remaining) == 1 else []
    models += [c.model for c in remaining]
    names = tuple(c.id for c in remaining)
    t = dt * np.arange(int(round(duration / dt)))
    scale = centre + reach * np.linspace(-1, 1, len(t))  # tells the simulator how far outputs may go
    best = None
    for kind, shape in _shapes(t, record).items():
        for size in (1.0, 0.8, 0.6, 0.45, 0.35, 0.25, 0.15):
            u = force * size * shape
            played = record._with(t=t, u=u, y=scale, velocity=None, channels={})
            ys = [free_run(m, played, position=centre, thin=max(1, len(t) // 2500)) for m in models]
            far = max(float(np.max(np.abs(y - centre))) for y in ys)
            if not np.isfinite(far) or far > reach * 1.0001:
                continue
            gaps = [math.sqrt(float(np.mean((a - b) ** 2))) for i, a in enumerate(ys) for b in ys[i + 1 :]]
            separation = min(gaps) / max(diagnosis.noise, 1e-300)
            if best is None or separation > best.separation:
                best = Experiment(t, u, kind, names, separation, far, "")
    if best is None:
        raise ValueError(
            f"every input tried leaves the stroke of {reach:g} m: the candidates drift. Allow more stroke, or close a loop."
        )
    words = " and ".join(n.replace("_", " ") for n in names)
    reason = (
        f"{best.kind} of up to {np.max(np.abs(best.u)):.3g} N: the outputs of {words} then differ by at least "
        f"{best.separation:.2g} times the noise, within {best.stroke:.3g} m of stroke."
    )
    return Experiment(best.t, best.u, best.kind, best.candidates, best.separation, best.stroke, reason)


def _shapes(t, record):
    """Return inputs of peak one, each ending its motion near where it began."""
    from .simulator import facts

    f0 = 1.0 / max(facts(record).swing, 10 * (t[1] - t[0]))
    span = t[-1] + t[1]
    rng = np.random.default_rng(0)
    k = np.unique(np.round(np.geomspace(max(0.3 * f0 * span, 1), 8 * f0 * span, 20)))
    sum_of_sines = np.sum(
        np.sin(2 * math.pi * k[:, None] * t / span + rng.uniform(0, 2 * math.pi, len(k))[:, None]), axis=0
    )
    low, high = 0.3 * f0, 10 * f0
    rate = math.log(high / low)
    chirp = np.sin(2 * math.pi * low * span / rate * (np.exp(rate * t / span) - 1))
    # each period + - - +: neither speed nor place is left over
    quarter = np.floor(4 * t * 0.5 * f0) % 4
    pulses = (
        np.where((quarter == 0) | (quarter == 3), 1.0, -1.0)
        * (0.4 + 0.6 * rng.uniform(size=400))[np.floor(t * 0.5 * f0).astype(int) % 400]
    )
    triangle = 2 / math.pi * np.arcsin(np.cos(2 * math.pi * 0.4 * f0 * t))
    return {
        "multisine": sum_of_sines / np.max(np.abs(sum_of_sines)), "chirp": chirp, "steps": pulses, "triangle": triangle,
    }  # fmt: skip
