"""What drives the machines of the second generator, and what their sensors add."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter


def multisine(rng, t):
    """Lines of random phase from slow to a few times the period of the machine."""
    f = rng.uniform(0.15, rng.uniform(1.2, 3.5), rng.integers(3, 13))
    size = rng.uniform(0.3, 1.0, f.size) / np.maximum(f, 0.5) ** rng.uniform(0.0, 1.0)
    return (size[:, None] * np.sin(2 * np.pi * f[:, None] * t + rng.uniform(0, 2 * np.pi, (f.size, 1)))).sum(
        0
    )


def ramped_steps(rng, t):
    """Levels held for a while, joined by ramps."""
    edges, levels, at, side = [0.0], [0.0], 0.0, 1.0
    hold, ramp = rng.uniform(0.3, 1.5), rng.uniform(0.03, 0.5)
    while at < t[-1]:
        at += hold * rng.uniform(0.4, 1.6)
        edges.append(at)
        levels.append(levels[-1])
        at += ramp * rng.uniform(0.5, 1.5)
        side = -side
        edges.append(at)
        levels.append(side * rng.uniform(0.3, 1.0))
    return np.interp(t, edges, levels)


def moves(rng, t):
    """Trapezoidal moves to and fro with pauses: a profile of place from 0 to 1 and back."""
    out, at, place = np.zeros_like(t), 0.0, 0.0
    while at < t[-1]:
        goal = rng.uniform(-1, 1) if rng.random() < 0.5 else (1.0 if place < 0 else -1.0)
        length, blend = rng.uniform(0.5, 2.0), rng.uniform(0.15, 0.5)
        s = np.clip((t - at) / length, 0, 1)
        edge = blend * (1 - blend)
        soft = np.where(
            s < blend, s**2 / 2, np.where(s > 1 - blend, edge - (1 - s) ** 2 / 2, blend * (s - blend / 2))
        )
        out = np.where(t >= at, place + (goal - place) * soft / edge, out)
        place = goal
        at += length + rng.choice([0.0, rng.uniform(0.2, 1.5)])
    return out


def pulses(rng, t):
    """Accelerate, brake, pause: pulses of force of both signs."""
    out, at, side = np.zeros_like(t), rng.uniform(0, 0.5), 1.0
    while at < t[-1]:
        width, size = rng.uniform(0.2, 0.8), rng.uniform(0.4, 1.0)
        ramp = rng.uniform(0.02, 0.15)
        on = np.clip((t - at) / ramp, 0, 1) - np.clip((t - at - width) / ramp, 0, 1)
        off = np.clip((t - at - width) / ramp, 0, 1) - np.clip((t - at - 2 * width) / ramp, 0, 1)
        out += side * size * (on - off)
        at += 2 * width + ramp + rng.choice([0.0, rng.uniform(0.3, 1.2)])
        side = -side
    return out


def chirp(rng, t):
    """Return a sine whose frequency rises or falls, with an amplitude that changes."""
    low, high = rng.uniform(0.1, 0.4), rng.uniform(1.0, 3.0)
    s = t / t[-1]
    if rng.random() < 0.3:
        s = 1 - s
    phase = 2 * np.pi * t[-1] * low * (np.exp(s * np.log(high / low)) - 1) / np.log(high / low)
    return (
        0.5 + 0.5 * np.sin(2 * np.pi * rng.uniform(0.5, 2.5) * t / t[-1] + rng.uniform(0, 6)) ** 2
    ) * np.sin(phase)


def telegraph(rng, t):
    """Return a random telegraph, which jumps between two levels at times of no order."""
    out, at, side = np.empty_like(t), 0.0, rng.choice([-1.0, 1.0])
    least, mean = rng.uniform(0.08, 0.3), rng.uniform(0.2, 0.7)
    while at < t[-1]:
        out[t >= at] = side
        side = -side
        at += least + rng.exponential(mean)
    return out


FORCES = dict(
    multisine=multisine,
    ramped_steps=ramped_steps,
    pulses=pulses,
    chirp=chirp,
    telegraph=telegraph,
    moves=moves,
)
REFERENCES = dict(
    multisine=multisine, ramped_steps=ramped_steps, moves=moves, chirp=chirp, telegraph=telegraph
)


def excitation(kind, rng, t, closed):
    """Return a signal of unit peak; a force has no mean and moves the machine nowhere for long."""
    s = (REFERENCES if closed else FORCES)[kind](rng, t)
    if closed and kind == "telegraph":  # nobody asks a drive to jump at full height
        s = lfilter(*_first_order(0.08, t[1] - t[0]), s)
    if not closed:
        s = s - s.mean()
        push = np.cumsum(s) * (t[1] - t[0])  # of its impulse only what swings
        s = s - np.polyfit(t, push, 1)[0]
    return s / np.max(np.abs(s))


def _first_order(time, dt):
    weight = dt / (time + dt)
    return [weight], [1.0, weight - 1.0]


def noise(kind, rng, n):
    """Return noise of unit rms: white, coloured (one corner or several), or the white part of an encoder."""
    white = rng.standard_normal(n)
    if kind == "coloured":
        pole = rng.uniform(0.5, 0.97)
        white = lfilter([1.0], [1.0, -pole], rng.standard_normal(n + 500))[500:]
    elif kind == "pink":
        parts = [
            lfilter([np.sqrt(1 - p * p)], [1.0, -p], rng.standard_normal(n + 2000))[2000:]
            for p in (0.3, 0.8, 0.97)
        ]
        white = white * 0.5 + sum(parts)
    return white / np.std(white)
