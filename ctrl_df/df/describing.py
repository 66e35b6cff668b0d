"""`describing_function` and `describing_function_family`: one call for every kind of block."""

from __future__ import annotations

import numpy as np

from ..checks import count, flag
from .arguments import (
    amplitudes_of,
    axis_of,
    check_block,
    check_omega,
    check_options,
    common_shape,
    frequencies_of,
)
from .dispatch import method_for
from .family import Family
from .points import points
from .thresholds import NUM_POINTS
from .warning import IRREGULAR, warn_of
from .work import Work


def describing_function(
    F, A, omega=None, num_points=NUM_POINTS, zero_check=True, try_method=True, output=None, **options
):
    """Return the describing function N(A, omega) of a block, for the input ``A cos(omega t)``.

    Memoryless elements and simple hysteretic ones have closed forms; any other static law is integrated to
    1e-10, split at its corners; mechanisms have closed forms where those exist, else their forced periodic
    orbit is found.

    Parameters
    ----------
    F : block, ct.NonlinearIOSystem, python-control nonlinearity or callable
        One input. A callable takes and returns one number.
    A : array_like
        Amplitudes (peak values), >= 0. Zero gives the slope at the origin for a static law.
    omega : array_like, optional
        Frequencies [rad/s], > 0; broadcast against `A`. May be left out where N does not depend on it.
    num_points : int
        As in python-control; here the least number of calls a period for a callable that keeps a memory of
        its own. No other law is sampled on a fixed grid.
    zero_check : bool
        Whether a static law must vanish at zero when A = 0 is asked.
    try_method : bool
        Whether to use the object's own ``describing_function`` method. ctrl_df's elements and
        python-control's own classes are exact either way.
    output : str or int, optional
        Output to describe; default the first.
    **options
        Passed to the general solver of forced periodic orbits.

    Returns
    -------
    ndarray of complex
        N, with the shape of A and omega broadcast; NaN where there is no periodic response.

    Warns
    -----
    DescribingFunctionWarning
        N is NaN somewhere, or that of a motion without a period, that travels, or that repels; the regime,
        the number of points and the first of them are said.

    Raises
    ------
    ValueError
        A negative or not finite, omega not positive, omega missing, a law that is not zero at zero.
    TypeError
        F is no block and no callable, or an unknown keyword.

    Examples
    --------
    >>> axis = cdf.friction_mass(mass=9, coulomb=5, viscous=0.5)
    >>> N = cdf.describing_function(axis, 9.0, 15.0)
    >>> print(f"{1e3 * 9.0 * abs(N):.4f} mm, {np.degrees(np.angle(N)):.2f} deg")
    2.2957 mm, -137.69 deg
    """
    N, regime, A, omega = _evaluated(F, A, omega, num_points, zero_check, try_method, output, options)
    warn_of(N, regime, A, omega)
    return N


def quiet_describing_function(
    F, A, omega=None, num_points=NUM_POINTS, zero_check=True, try_method=True, output=None, **options
):
    """Return N as `describing_function` does, for callers that treat NaN and regimes by themselves."""
    return _evaluated(F, A, omega, num_points, zero_check, try_method, output, options)[0]


def _evaluated(F, A, omega, num_points, zero_check, try_method, output, options):
    """Return N, regime, A and omega, all checked."""
    if isinstance(
        num_points, bool | np.bool_
    ):  # python-control's order: F, A, num_points, zero_check, try_method
        shifted = 100 if omega is None else int(omega)
        num_points, zero_check, try_method, omega = shifted, bool(num_points), zero_check, None
    A = amplitudes_of(A)
    omega = None if omega is None else frequencies_of(omega)
    num_points = check_block(F, num_points)
    shape = common_shape(A, omega)
    largest = float(A.max()) if A.size and A.max() > 0 else 1.0
    method = method_for(F, output, try_method, num_points, largest, options)
    check_options(method, options, describing_function)
    check_omega(method, omega)
    if A.size == 0 or np.prod(shape) == 0:
        return np.zeros(shape, dtype=complex), np.full(shape, ""), A, omega
    pairs = np.broadcast_to(A, shape), None if omega is None else np.broadcast_to(omega, shape)
    N, regime, _ = points(method, *pairs, zero_check)
    return N[()], regime, A, omega


def describing_function_family(
    F,
    A,
    omega=None,
    orders=9,
    executor=None,
    output=None,
    save=None,
    progress=None,
    *,
    try_method=True,
    num_points=NUM_POINTS,
    **options,
) -> Family:
    """Harmonics of the steady output on a grid of amplitudes and frequencies.

    Parameters
    ----------
    F : block, ct.NonlinearIOSystem, python-control nonlinearity or callable
    A : array_like, shape (na,)
        Amplitudes, > 0.
    omega : array_like, shape (nw,), optional
        Frequencies [rad/s], > 0; may be left out where N does not depend on it.
    orders : int
        Highest harmonic, >= 1.
    executor : concurrent.futures.Executor, optional
        Computes amplitudes in parallel, with bitwise the same result; anything with
        ``submit(f, *args).result()``. For processes F must be picklable.
    output : str or int, optional
        Output to describe; default the first.
    save : path, optional
        ``.npz`` file the result goes to. Every finished line of long work is kept there at once, whatever
        ends the process, and the same call computes the others. The file is taken up only if everything that
        decides N is the same, the code of a callable included; F needs an attribute ``fingerprint``, a text
        of yours, where that cannot be told (a function of a C library).
    progress : bool, optional
        Progress bar; default: only on a terminal and only after two seconds.
    try_method, num_points, **options
        As in `describing_function`.

    Returns
    -------
    Family
        Where the motion has no period its `regime` is ``aperiodic`` and N an average over many turns; where
        there is no steady answer N is NaN, and `regime` says why.

    Warns
    -----
    DescribingFunctionWarning
        N is such an average somewhere; the number of points and the first of them are said.

    Raises
    ------
    ValueError
        As `describing_function`; also an empty grid, one whose result would take more than 2 GB, a `save`
        file that is damaged or belongs to another computation, an F that cannot be told from others.
    TypeError
        As `describing_function`; also an executor without ``submit``, or a process pool and an F that cannot
        be pickled.
    RuntimeError
        A worker process died, or the executor is shut down.
    OSError
        `save` is no place for a file, or written by another process.

    Examples
    --------
    >>> axis = cdf.friction_mass(mass=9, coulomb=5, viscous=0.5)
    >>> family = cdf.describing_function_family(axis, [4.0, 9.0, 14.0], [10.0, 15.0])
    >>> family.N.shape
    (3, 2)
    >>> print(family.regime[:, 1])
    ['stuck' 'stick-slip' 'slip']
    """
    family = quiet_family(
        F, A, omega, orders, executor, output, save, progress,
        try_method=try_method, num_points=num_points, **options,
    )  # fmt: skip
    at = np.broadcast_arrays(family.amplitudes[:, None], family.omega)
    warn_of(family.N, family.regime, *at, regimes=IRREGULAR, missing=False, look_at="family")
    return family


def quiet_family(
    F, A, omega=None, orders=9, executor=None, output=None, save=None, progress=None, *,
    try_method=True, num_points=NUM_POINTS, **options,
) -> Family:  # fmt: skip
    """Return the family, for callers that treat its regimes by themselves."""
    A = axis_of("A", amplitudes_of(A), "unit of the input")
    if (A <= 0).any():
        raise ValueError(
            "a family needs A > 0; got A=0. Leave it out, or ask describing_function for the slope."
        )
    omega = None if omega is None else axis_of("omega", frequencies_of(omega), "rad/s")
    orders = count("a family", "orders", orders, meaning="highest harmonic")
    if progress is not None:
        flag("a family", "progress", progress)
    num_points = check_block(F, num_points)
    method = method_for(F, output, try_method, num_points, float(A.max()), options)
    check_options(method, options, describing_function_family)
    check_omega(method, omega)
    work = Work(F, method, A, omega, orders, save)
    work.run(executor, progress)
    return work.family()
