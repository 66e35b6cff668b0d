"""What is moved and answers with a force: a damper, a bearing, a joint on a test machine."""

from __future__ import annotations

import numpy as np

from .coordinates import AXIS
from .core import build_core
from .mechanism import Mechanism
from .ordinary import compliant

IMPOSED_ROLES = ("force", "friction", "presliding", "contact")
"""Roles of effects that answer an imposed motion with a force."""


def without_answer(effects) -> str | None:
    """Return why one of these effects, or classes, gives no force under an imposed motion; None: all do."""
    for effect in effects:
        if effect.role not in IMPOSED_ROLES or effect.side == "load":
            return f"{effect.id} acts between a driving force and a free mass"
        if effect.role == "contact" and (effect.divides or effect.law is None):
            return f"{effect.id} is a contact of free masses, and imposed motion would pass through it"
    return None


class Massless(Mechanism):
    """Effects without an inertia: motion goes in, force comes out; add physics with `with_effect`.

    A damper on a test machine, a bearing turned by hand. Inputs ``x`` [m], ``v`` [m/s]; output ``F`` [N], the
    force that imposes the motion, positive along +x: ``F = - effects``. Its states are those that effects
    hide (bristles, hysteresis). Where the motion stands still dry friction keeps the direction of the last
    motion, as it does in the limit of stiff bristles.

    `imposed_response` simulates it exactly, `compare`, `refit`, `diagnose` and `improve` take records of a
    displacement and a force. As a ``ct.NonlinearIOSystem`` it is the compliant form: the friction of the
    ordinary ``outfcn`` rises linearly up to ``ctrl_df.stick_velocity``.

    Parameters
    ----------
    effects : sequence of Effect
        What opposes the motion.
    rotary : bool
        Whether it turns: inputs ``angle`` [rad], ``speed`` [rad/s], output ``torque`` [N m].
    name : str
        System name.

    Raises
    ------
    ValueError
        An effect that acts between a force and a free mass (backlash, compliance, a lag of the input, ...).

    Examples
    --------
    >>> damper = cdf.Massless().with_effect(cdf.Coulomb(50.0)).with_effect(cdf.Viscous(300.0))
    >>> damper.input_labels, damper.output_labels, damper.nstates
    (['x', 'v'], ['F'], 0)
    >>> [float(damper.output(0, [], [0.0, v])[0]) for v in (0.1, -0.1)]
    [80.0, -80.0]
    >>> cdf.Massless(rotary=True).with_effect(cdf.Coulomb(0.2)).parameters["coulomb.level"].unit
    'N m'
    """

    def __new__(cls, effects=(), *, rotary=False, name=None):
        """Make one that turns where that is asked for."""
        return object.__new__(MasslessRotary if rotary else cls)

    def __init__(self, effects=(), *, rotary=False, name=None):
        super().__init__({}, effects, name=name)

    def _build(self, values, effects):
        why = without_answer(effects)
        if why is not None:
            raise ValueError(
                f"Massless needs effects that answer a motion with a force; got {why}. Give the block a mass "
                "(Mass, Inertia) and drive it by a force."
            )
        return build_core((0.0,), False, effects, "load")

    def _labels(self):
        called = self._coordinates.name
        return [called("x"), called("v")], [called("F")], list(self._core.state_names[2:])

    @property
    def signals(self):
        """Unit of each input and of the output, by label."""
        mine, units = self._coordinates, {"x": "m", "v": "m/s", "F": "N"}
        return {mine.name(k): mine.unit_of(unit) for k, unit in units.items()}

    @property
    def rotary(self) -> bool:
        """Whether it turns."""
        return self._coordinates is AXIS

    @classmethod
    def _make(cls, inertias, effects, measured, name=None):
        return cls(effects, rotary=cls is MasslessRotary, name=name)

    def __repr__(self) -> str:
        own = "Massless(rotary=True)" if self.rotary else "Massless()"
        return own + "".join(f".with_effect({e})" for e in self.effects)

    def _answer(self, t, x, u, params):
        state = [float(u[0]), float(u[1]), *map(float, x)]
        return compliant.holding_force(self._core_for(params), t, state, 0.0)

    def _updfcn(self, t, x, u, params):
        return np.array(self._answer(t, x, u, params)[1][2:])

    def _outfcn(self, t, x, u, params):
        return np.array([self._answer(t, x, u, params)[0]])


class MasslessRotary(Massless):
    """A `Massless` that turns; made by ``Massless(rotary=True)``."""

    _coordinates = AXIS
