"""The PID controller of the paper."""

from __future__ import annotations

import control as ct

from ..checks import number, system_name


def pid(kp, ki=0.0, kd=0.0, tf=0.0, *, name=None) -> ct.TransferFunction:
    """``kp + ki/s + kd s/(tf s + 1)`` as a transfer function.

    Parameters
    ----------
    kp, ki, kd : float
        Proportional [N/m], integral [N/(m s)], derivative [N s/m] gain, finite.
    tf : float
        Time constant of the derivative filter [s], >= 0; 0 is the ideal (improper) PID of the paper, fit for
        frequency response and for `closed_loop`, which lets the derivative act on the measured velocity.

    Raises
    ------
    ValueError
        A gain that is not finite, or tf < 0.
    TypeError
        A gain that is no real number.

    References
    ----------
    Azenha & Machado (1997), eqs. (7)-(8).

    Examples
    --------
    >>> cdf.pid(2000, 44250, 130)(10j)  # 2000 + 44250 / 10j + 130 * 10j
    np.complex128(2000-3125j)
    """
    system_name("pid", name)
    kp, ki, kd = (
        number("pid", key, value, unit)
        for key, value, unit in (("kp", kp, "N/m"), ("ki", ki, "N/(m s)"), ("kd", kd, "N s/m"))
    )
    tf = number(
        "pid", "tf", tf, "s", lower=0.0, meaning="filter time constant", remedy="Use tf=0 for the ideal PID."
    )
    if ki == 0:
        num, den = [kp * tf + kd, kp], [tf, 1.0]
    else:
        num, den = [kp * tf + kd, kp + ki * tf, ki], [tf, 1.0, 0.0]
    while len(den) > 1 and den[0] == 0:
        den.pop(0)
    while len(num) > 1 and num[0] == 0:
        num.pop(0)
    return ct.tf(num, den, inputs="e", outputs="F", name=name)  # pyright: ignore[reportReturnType]
