"""Where fits begin: tuned numbers, each with what it follows from or what chose it (`../thresholds.py`)."""

from __future__ import annotations

import numpy as np

SPECTRUM_SAMPLES = 25_000
"""Samples of a record beyond which ripples are sought in means over several."""

JOINTS_TRIED = 4
"""Joints of a share of load from which those that begin are chosen."""

STRONG = 0.5
"""Share of the mean squared force that is missing up to which a single law leaves: it takes more of it than
all that is left, and the model's own parameters are bent by it."""

RESONANCES, JOINT_DAMPING = np.geomspace(1.5, 40.0, 12), 0.1
"""Joints tried: resonance over the rate of the motion (its speed over its stroke), neighbours a third apart;
damping ratio."""

LONG_WAVES, LONG_WAVE_TURNS = 5, (6.0, 30.0)
"""Ripples that fits begin with by what they change in the output; wavelengths to the stroke up to which they
are sought there, of one body and of two (200 runs of the segments then, a second at most)."""

RIPPLE_TURNS, RIPPLE_STEP, RIPPLE_COARSEST = 400.0, 0.3, 6.0
"""Ripples tried: wavelengths to the stroke at most; between two of them (one turn apart they are orthogonal);
shortest wavelength over the error of the smoothed position."""
