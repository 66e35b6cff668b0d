"""What the rigs are driven with: forces in open loop, references and controllers in closed loop."""

from __future__ import annotations

import math

import numpy as np

REST = 0.15  # [s] at the start of every record, nothing applied


def excite(rng, kind, setup) -> np.ndarray:
    """Return a force record [N] of peak about ``setup.peak``, zero for the first 0.15 s."""
    n, dt = setup.n, setup.dt
    t = dt * np.arange(n)
    f0 = setup.f0
    if kind == "multisine":
        u = _multisine(rng, t, 0.25 * f0, 5 * f0, -0.5)
        u /= np.max(np.abs(u))
    elif kind == "chirp":
        f1, f2 = 0.35 * f0, float(rng.uniform(6, 10)) * f0
        span = t[-1] - REST
        s = np.clip(t - REST, 0, None) / span
        phase = 2 * math.pi * f1 * span / math.log(f2 / f1) * ((f2 / f1) ** s - 1)
        u = np.sin(phase + float(rng.uniform(0, 2 * math.pi))) * (0.45 + 0.55 * s)
    else:
        u = _steps(rng, n, dt, f0)
    u[t < REST] = 0.0
    return setup.peak * float(rng.uniform(0.85, 1.15)) * u


def _multisine(rng, t, low, high, slope):
    base = 1 / (t[-1] + t[1])
    k = np.unique(np.round(np.geomspace(max(low / base, 1), high / base, 24)))
    phase = rng.uniform(0, 2 * math.pi, len(k))
    weight = (k / k[0]) ** slope
    return np.sum(weight[:, None] * np.sin(2 * math.pi * base * k[:, None] * t + phase[:, None]), axis=0)


def _steps(rng, n, dt, f0):
    """Force pulses of alternating sign, random height and length, with pauses."""
    u = np.zeros(n)
    i, sign = int(REST / dt), float(rng.choice([-1, 1]))
    while i < n:
        hold = int(rng.uniform(0.15, 0.7) / f0 / dt)
        u[i : i + hold] = sign * float(rng.uniform(0.35, 1.0))
        i += hold
        if rng.uniform() < 0.2:
            i += int(rng.uniform(0.1, 0.4) / f0 / dt)
        sign = -sign
    return u


def reference(rng, kind, setup) -> np.ndarray:
    """Return a position reference [m] of half stroke about ``2 setup.stroke``, still for the first 0.15 s."""
    t = setup.dt * np.arange(setup.n)
    f0 = setup.f0
    if kind == "multisine":
        r = _multisine(rng, t, 0.25 * f0, 2.0 * f0, -1.0)
        r = (r - r[0]) / np.max(np.abs(r - r[0]))
    elif kind == "chirp":
        f1, f2 = 0.3 * f0, 2.5 * f0
        span = t[-1] - REST
        s = np.clip(t - REST, 0, None) / span
        r = np.sin(2 * math.pi * f1 * span / math.log(f2 / f1) * ((f2 / f1) ** s - 1)) * (1 - 0.75 * s)
    else:
        r = _moves(rng, t, f0)
    ramp = np.clip((t - REST) / (0.3 / f0), 0, 1)
    return 2 * setup.stroke * float(rng.uniform(0.85, 1.15)) * r * ramp * ramp * (3 - 2 * ramp)


def _moves(rng, t, f0):
    """Point-to-point moves with raised-cosine speed and dwells."""
    r = np.zeros(len(t))
    now, at = REST, 0.0
    while now < t[-1]:
        target, span = float(rng.uniform(-1, 1)), float(rng.uniform(0.5, 1.2)) / f0
        s = np.clip((t - now) / span, 0, 1)
        r += (target - at) * (s - np.sin(2 * math.pi * s) / (2 * math.pi))
        now += span + (float(rng.uniform(0.1, 0.5)) / f0 if rng.uniform() < 0.6 else 0.0)
        at = target
    return r


def controller_for(rng, setup) -> tuple[float, float, float, float, float]:
    """Return gains (kp, ki, kd, tf, limit) of a PID that tracks with the base model."""
    # Load measured behind a soft joint: only a slow loop is stable.
    soft = "compliance.stiffness" in setup.base or "compliance" in setup.ids
    w = setup.w * float(rng.uniform(0.9, 1.5) if soft else rng.uniform(2.0, 3.5))
    m = setup.base["mass"]
    kp, kd = m * w**2, 1.4 * m * w
    return kp, float(rng.uniform(0.1, 0.3)) * kp * w, kd, 0.25 / w, 40 * setup.peak
