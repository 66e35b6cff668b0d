"""Fits of all effects: tuned numbers, each with what it follows from or chose it (`../thresholds.py`)."""

from __future__ import annotations

PROMISES = 0.25
"""Share of the squared error the best candidate explains that an effect has to explain for one that contains
it to be tried: the special case of a right law is right over a part of the motion."""

ANOTHER_START = (1.5, 0.02)
"""Share of the residual that a start leaves from which none is started: over that of the best, and beyond it
(rigs). Only work depends on it."""

EFFORT_TRIED = (6, 1e-2)
"""Iterations of the fit of an effect at most, and relative gain of its cost at which it ends: 1e-2 is 12 nats
of 2,500 samples (`SCREEN_SAMPLES`), less than what makes an effect. Numbers of iterations were chosen on the
rigs."""

EFFORT_ILL_CONDITIONED = (14, 3e-3)
"""The same of an ill-conditioned fit, which gains less a step and takes more of them: down to 4 nats."""

EFFORT_MOVED = (4, 1e-2)
"""The same of a fit that moves from segments to others: fewer steps are left."""

BEGUN = 2
"""Iterations of every fit before the first comparison: one of Gauss and Newton, one that corrects what it did
not foresee. Only work depends on it while the right start is among the best."""

KEPT = 2
"""Fits of an effect that are continued after this comparison."""

JOINTS = 3
"""Joints of a share of load that fits start from."""

LOAD_SHARES = (0.15, 0.35, 0.6, 0.85)
"""Shares of the mass behind the joints that fits start from, a quarter apart or less, so that a share is off
by an eighth of the mass; at the ends a part of 0.15 changes the motion little."""
