"""Where a prediction starts the search for its orbit: the loop as its block's forced motion would have it."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

from ..simulate.engine import Engine, harmonic_drive
from ..simulate.sampled import Sampled
from ..simulate.thresholds import INTERVAL_STEPS
from .exact.thresholds import STEPS_A_PERIOD, TRAJECTORY_RTOL
from .predicted.path import Path
from .predicted.waveform_response import described_gain, has_mean, response_of_block
from .thresholds import FORCED_PERIODS, FORCED_STARTS


def harmonic_start(loop: Any, amplitude, omega: float, output_amplitude=None, motion=None) -> np.ndarray:
    """State of a loop at t = 0 when its block is driven by ``amplitude cos(omega t)``.

    Parameters
    ----------
    loop : ct.InterconnectedSystem
        From `closed_loop`.
    amplitude : float or array of complex
        Peak value at the block's input, or its Fourier coefficients U_k, k = 0, 1, ...
    omega : float
        [rad/s].
    output_amplitude : float, optional
        Of several coexisting motions the one nearest to it is taken; default the largest.
    motion : ForcedMotion, optional
        The block's motion, where it is known; no simulation would find one that repels.

    Raises
    ------
    ValueError
        The loop does not tell its controller and block apart.
    """
    if getattr(loop, "parts", None) is None:
        raise ValueError(
            "a guess of amplitude and frequency needs a loop made by closed_loop; "
            "give a state instead, or no guess."
        )
    U = np.array([0.0, amplitude], complex) if np.ndim(amplitude) == 0 else np.asarray(amplitude, complex)
    x_block, Y = motion if motion is not None else _forced_motion(loop, U, omega, output_amplitude)
    controller = loop.syslist[0]
    nc = controller.nstates or 0
    x_control = np.zeros(nc)
    if nc and isinstance(controller, ct.StateSpace | Sampled):
        is_sampled = isinstance(controller, Sampled)
        a, b = controller.sampled[:2] if is_sampled else (np.asarray(controller.A), np.asarray(controller.B))
        if len(U) > 2 and has_mean(Y) and np.linalg.matrix_rank(a - is_sampled * np.eye(len(a))) == len(a):
            x_control[: len(a)] = np.linalg.solve(is_sampled * np.eye(len(a)) - a, b[:, 0] * -Y[0].real)
        for k in range(1, len(Y)):
            inputs = np.array([-Y[k], 1j * k * omega * Y[k]])[: controller.ninputs]
            z = np.exp(1j * k * omega * loop.parts.dt) if is_sampled else 1j * k * omega
            x_control[: len(a)] += np.real(np.linalg.solve(z * np.eye(len(a)) - a, b @ inputs))
    return np.concatenate([x_control, x_block])


def path_starts(loop: Any, path: Path, count: int) -> list[np.ndarray]:
    """States of a loop at equal steps of time along the cycle at the end of a path, `count` in a period."""
    turns = np.exp(2j * np.pi * np.outer(np.arange(count) / count, np.arange(len(path.waveform))))
    waveforms = path.waveform * turns
    if path.motion is None:
        return [harmonic_start(loop, U, path.omega) for U in waveforms]
    block = loop.parts.block
    engine, core = Engine(block), getattr(block, "core", None)
    row = list(block.output_labels).index(loop.output_labels[0])
    period = 2 * np.pi / path.omega
    run = engine.run(
        path.motion.state, period, harmonic_drive([path.waveform], path.omega),
        period * np.arange(count) / count, **_options(period, path.waveform),
    )  # fmt: skip
    starts = []
    for U, x in zip(waveforms, run.states, strict=True):
        motion = _measured(engine, core, row, engine.start(x), U, path.omega)
        starts.append(harmonic_start(loop, U, path.omega, motion=motion))
    return starts


def _forced_motion(loop, U, omega, wanted):
    """State of the block alone at t = 0 under the guessed input, its mean position removed, and its Y_k."""
    block, amplitude = loop.parts.block, abs(U[1])
    if not block.nstates:
        if len(U) > 2:
            known = response_of_block(block)
            Y = None if known is None else known[0](U, omega)[0]
            if Y is not None:
                return np.zeros(0), Y
        return np.zeros(0), np.array([0.0, described_gain(block, amplitude) * U[1]])
    engine = Engine(block)
    core = getattr(block, "core", None)
    row = list(block.output_labels).index(loop.output_labels[0])
    starts = [np.zeros(engine.nstates)]
    if core is not None:
        # the bare mass moves with v = (a / m w) sin wt: at rest at t = 0
        reach = amplitude / (sum(core.masses) * omega**2)
        starts[0][0] = -reach
        if core.bodies == 2:
            starts[0][2] = -reach
            for place, speed in FORCED_STARTS:
                x = starts[0].copy()
                x[2] += place * core.gap
                x[3] = speed * core.gap * omega
                x[1] = (
                    -core.masses[1] / core.masses[0] * x[3]
                )  # no net momentum: the pair must not drift away
                starts.append(x)
    found = [_forced_from(engine, core, row, x, U, omega) for x in starts]
    if wanted is not None:
        return min(found, key=lambda f: abs(abs(f[1][1]) - wanted))
    return max(found, key=lambda f: abs(f[1][1]))


def _forced_from(engine, core, row, x0, U, omega):
    drive, period = harmonic_drive([U], omega), 2 * np.pi / omega
    run = engine.run(engine.start(x0), FORCED_PERIODS * period, drive, **_options(period, U))
    if not np.all(np.isfinite(run.state.x)):
        return np.zeros(engine.nstates), np.zeros(2, complex)
    return _measured(engine, core, row, run.state, U, omega)


def _options(period, U) -> dict[str, Any]:
    return dict(
        rtol=TRAJECTORY_RTOL,
        max_step=period / STEPS_A_PERIOD / (len(U) - 1) ** 0.5,
        log=1,
        max_steps=INTERVAL_STEPS,
    )


def _measured(engine, core, row, state, U, omega):
    """State of a periodic motion at t = 0, its mean position removed, and the harmonics of its output."""
    drive, period = harmonic_drive([U], omega), 2 * np.pi / omega
    state = state.copy()
    state.time, state.fresh = 0.0, True
    spectrum = np.zeros((engine.noutputs, len(U)), complex)
    ends = np.array([0.0, period])
    run = engine.run(state, period, drive, ends, spectrum=spectrum, omega=omega, **_options(period, U))
    x, Y = run.state.x.copy(), 2 * spectrum[row] / period
    drift = run.outputs[-1, row] - run.outputs[0, row]
    k = np.arange(1, len(U))
    Y[1:] -= 1j * drift / (np.pi * k)
    if core is not None:
        mean, travel = 2 * spectrum[0, 0].real / period / 2, run.outputs[-1, 0] - run.outputs[0, 0]
        x[: 2 * core.bodies : 2] -= mean + travel / 2
    return x, Y
