"""Machines that turn: `Inertia` and `TwoInertias`, with the effects of `Mass` and `TwoMass`."""

from __future__ import annotations

from .coordinates import AXIS
from .mechanism import Mechanism


class Inertia(Mechanism):
    """A body that turns about an axis, driven by a torque; add physics with `with_effect`.

    ``inertia dspeed/dt = torque + effects``; input ``torque`` [N m]; outputs ``angle`` [rad], ``speed``
    [rad/s]. The effects are those of `Mass`, their parameters in units of rotation: a Coulomb level in N m, a
    viscous coefficient in N m s/rad, a gap or a ripple's period in rad. With `Backlash` or `Compliance` the
    inertia divides into motor and load, and ``angle_motor``, ``speed_motor`` are outputs too. A gear is
    referred to one side before: inertias by the square of its ratio, torques by the ratio.

    Parameters
    ----------
    inertia : float
        [kg m^2], > 0.
    effects, measured, name
        As in `Mass`.

    Raises
    ------
    ValueError
        Inertia not positive, contradictory effects; the message gives rule, value, remedy.

    Examples
    --------
    >>> import ctrl_df as cdf
    >>> drive = cdf.Inertia(2e-4, [cdf.Coulomb(0.03), cdf.Viscous(1e-4)])
    >>> drive.parameters["coulomb.level"].unit, drive.parameters["viscous.coefficient"].unit
    ('N m', 'N m s/rad')
    >>> drive.output_labels
    ['angle', 'speed']
    """

    _inertias = ("inertia",)
    _coordinates = AXIS

    def __init__(self, inertia, effects=(), *, measured="load", name=None):
        super().__init__({"inertia": inertia}, effects, measured=measured, name=name)

    @property
    def inertia(self) -> float:
        """Moment of inertia [kg m^2]."""
        return self._values["inertia"]


class TwoInertias(Mechanism):
    """A motor and a load about one axis, rigidly joined until `Backlash` or `Compliance` loosens the joint.

    Input ``torque`` [N m] on the motor; outputs ``angle`` and ``speed`` (of the load, or of the motor with
    ``measured="motor"``), ``angle_motor``, ``speed_motor``. Friction, springs and gravity act on the motor,
    or with ``side="load"`` on the load.

    Parameters
    ----------
    motor_inertia, load_inertia : float
        [kg m^2], > 0, both seen from the same side of a gear.
    effects, measured, name
        As in `Mass`.

    Raises
    ------
    TypeError, ValueError
        An inertia not a positive number, contradictory effects; the message gives rule, value, remedy.

    Examples
    --------
    >>> gear = cdf.TwoInertias(0.001, 0.02).with_effect(cdf.Backlash(0.01, restitution=0.3))
    >>> gear.parameters["backlash.gap"].unit
    'rad'
    """

    _inertias = ("load_inertia", "motor_inertia")
    _coordinates = AXIS

    def __init__(self, motor_inertia, load_inertia, effects=(), *, measured="load", name=None):
        super().__init__(
            {"load_inertia": load_inertia, "motor_inertia": motor_inertia}, effects, measured=measured,
            name=name,
        )  # fmt: skip

    @property
    def motor_inertia(self) -> float:
        """Moment of inertia of the motor [kg m^2]."""
        return self._values["motor_inertia"]

    @property
    def load_inertia(self) -> float:
        """Moment of inertia of the load [kg m^2]."""
        return self._values["load_inertia"]
