"""What is true of each of the paper's loops: described, exact, simulated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..limit_cycles.predicted.predict import DescribingFunctionResponse, describing_function_response
from ..limit_cycles.verify import NONE, NOT_FOUND, Check, verify
from ..simulate.loop import closed_loop
from ..simulate.response import EventResponse, event_response
from .systems import PaperLoop

_GONE = 1.0  # [m]: motions of the paper are millimetres


@dataclass(frozen=True, eq=False)
class Settled:
    """What the end of a simulation does.

    Attributes
    ----------
    omega : float
        Periods a second times 2 pi [rad/s], averaged over the last third.
    force, position : float
        Fundamental amplitudes at that frequency [N], [m].
    peak : float
        Half of the peak-to-peak value [m].
    trend : float
        Amplitude of the last third over that of the third before.
    """

    omega: float
    force: float
    position: float
    peak: float
    trend: float


@dataclass(frozen=True, eq=False)
class Finding:
    """One loop: prediction, check, simulations."""

    loop: PaperLoop
    response: DescribingFunctionResponse
    check: Check | None
    runs: list[tuple[float, EventResponse]]

    def cells(self) -> tuple[str, str, str, str]:
        """Return the row of the table: claim, describing function, exact, simulated."""
        return self.loop.claim, self._predicted(), self._exact(), self._simulated()

    def _predicted(self) -> str:
        lines = [
            f"{c.omega:.4f} rad/s, {_stability(c.stable)}, {c.grade}\n"
            f"  F1 {c.amplitude:.3f} N, x1 {1e3 * c.output_amplitude:.3f} mm" + _standing(c)
            for c in self.response.limit_cycles
        ]
        return "\n".join(lines) or "no limit cycle"

    def _exact(self) -> str:
        if self.check is None:
            return "not periodic: the sampler's clock and the motion have no common period"
        lines = []
        for row in self.check.rows:
            if row.verdict in (NONE, NOT_FOUND) and row.predicted is not None:
                how = "none" if row.verdict == NONE else "none found"
                lines.append(f"{how} near {row.predicted.omega:.2f} rad/s")
            elif row.exact is not None and row.exact.status.ok:
                o = row.exact
                lines.append(
                    f"{o.omega:.6f} rad/s, {_stability(o.stable)}\n"
                    f"  F1 {o.amplitude:.5f} N, x1 {1e3 * o.output_amplitude:.4f} mm\n"
                    f"  multiplier {o.multiplier:.5f}"
                )
        return "\n".join(lines) or "no limit cycle"

    def _simulated(self) -> str:
        lines = []
        for start, run in self.runs:
            end = ending(run)
            lines.append(f"from {1e3 * start:g} mm:\n{end}")
        return "\n".join(lines)


def find(loop: PaperLoop, known: list[Finding] | None = None) -> Finding:
    """Predict, verify and simulate one loop; `known` findings lend a prediction for the same plant."""
    same = [f.response for f in known or () if f.loop.plant == loop.plant and f.loop.box is loop.box]
    response = same[0] if same else describing_function_response(loop.controller, loop.plant, *loop.box)
    system = closed_loop(loop.controller, loop.plant, dt=loop.dt)  # type: ignore[arg-type]
    check = verify(response, loop=system, search=loop.search) if not loop.dt else None
    runs = [(start, simulate(loop, start)) for start in loop.starts]
    return Finding(loop, response, check, runs)


def simulate(loop: PaperLoop, start: float, time: float | None = None, step: float = 2e-3) -> EventResponse:
    """Run the closed loop from rest, displaced by `start` [m], integral empty."""
    system = closed_loop(loop.controller, loop.plant, dt=loop.dt)  # type: ignore[arg-type]
    state = np.zeros(system.nstates)
    for i, label in enumerate(system.state_labels):
        if label in ("plant_x", "plant_x_motor"):
            state[i] = start
    times = np.arange(0.0, loop.time if time is None else time, step)
    return event_response(system, times, 0, state, keep_events=False)  # type: ignore[arg-type]


def ending(run: EventResponse) -> str:
    """Say in a few words how a simulation ends."""
    x = np.asarray(run.outputs)[0]
    if np.abs(x).max() > _GONE:
        return "  grows without bound"
    end = settled(run)
    if end is None:
        return "  comes to rest"
    how = "decays" if end.trend < 0.97 else "grows" if end.trend > 1.03 else ""
    if how:
        return f"  {how} slowly, at {end.omega:.2f} rad/s"
    return f"  {end.omega:.3f} rad/s\n  F1 {end.force:.3f} N, x1 {1e3 * end.position:.3f} mm"


def settled(run: EventResponse) -> Settled | None:
    """Frequency and amplitudes over the last third of a run; None if it is at rest there."""
    t, y = np.asarray(run.time), np.asarray(run.outputs)
    third = len(t) // 3
    late, before = slice(2 * third, None), slice(third, 2 * third)
    x = y[0, late] - y[0, late].mean()
    ups = np.flatnonzero((x[:-1] < 0) & (x[1:] >= 0))
    if len(ups) < 3 or np.ptp(x) < 1e-6 * np.ptp(y[0]):
        return None
    crossing = t[late][ups] - x[ups] * (t[1] - t[0]) / (x[ups + 1] - x[ups])
    omega = 2 * np.pi * (len(ups) - 1) / (crossing[-1] - crossing[0])
    inside = (t >= crossing[0]) & (t < crossing[-1])
    turn = np.exp(-1j * omega * t[inside])
    position, force = (2 * abs(np.mean((row[inside] - row[inside].mean()) * turn)) for row in (y[0], y[1]))
    trend = np.ptp(y[0, late]) / max(np.ptp(y[0, before]), 1e-300)
    return Settled(float(omega), float(force), float(position), float(np.ptp(x) / 2), float(trend))


def _stability(stable) -> str:
    return {True: "stable", False: "unstable", None: "stability unknown"}[stable]


def _standing(cycle) -> str:
    """Say on which motion of the block a crossing stands, where N names another."""
    if not cycle.branch:
        return ""
    rest = "unstable under this force alone" if cycle.forced_multiplier >= 1 else "beside others"
    return f"\n  of the {cycle.branch}, {rest}"
