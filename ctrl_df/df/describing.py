"""`describing_function` and `describing_function_family`: one call for every kind of block."""

from __future__ import annotations

import hashlib
import time
from pathlib import Path
from typing import Any

import numpy as np

from .dispatch import Method, method_for
from .family import FORMAT, Family, read_arrays, write_arrays

_PARTIAL_EVERY = 5.0  # [s] between saved parts
_RECTANGLE = (
    4  # compute the whole grid of distinct A and omega if it holds at most this many times the points asked
)


def describing_function(
    F, A, omega=None, num_points=100, zero_check=True, try_method=True, output=None, **options
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
        N, with the shape of A and omega broadcast; NaN where there is no periodic answer.

    Raises
    ------
    ValueError
        A negative or not finite, omega not positive, omega missing, a law that is not zero at zero.
    TypeError
        F is no block and no callable, or an unknown keyword.
    """
    if isinstance(
        num_points, bool | np.bool_
    ):  # python-control's order: F, A, num_points, zero_check, try_method
        shifted = 100 if omega is None else int(omega)
        num_points, zero_check, try_method, omega = shifted, bool(num_points), zero_check, None
    A = _amplitudes(A)
    omega = None if omega is None else _frequencies(omega)
    shape = _common_shape(A, omega)
    largest = float(A.max()) if A.size and A.max() > 0 else 1.0
    method = method_for(F, output, try_method, num_points, largest, options)
    _check_options(method, options)
    _check_omega(method, omega)
    if A.size == 0 or np.prod(shape) == 0:
        return np.zeros(shape, dtype=complex)
    pairs = np.broadcast_to(A, shape), None if omega is None else np.broadcast_to(omega, shape)
    return points(method, *pairs, zero_check)[0][()]


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
    num_points=100,
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
        Computes amplitudes in parallel; anything with ``submit(f, *args).result()``. F must then be
        picklable.
    output : str or int, optional
        Output to describe; default the first.
    save : path, optional
        ``.npz`` file the result goes to; long work saves its finished part there, and the same call resumes
        it.
    progress : bool, optional
        Progress bar; default: only on a terminal and only after two seconds.
    try_method, num_points, **options
        As in `describing_function`.

    Returns
    -------
    Family

    Raises
    ------
    ValueError
        As `describing_function`; also an empty grid, or a `save` file that belongs to another computation.
    """
    A = _axis("A", _amplitudes(A), "unit of the input")
    if (A <= 0).any():
        raise ValueError(
            "a family needs A > 0; got A=0. Leave it out, or ask describing_function for the slope."
        )
    omega = None if omega is None else _axis("omega", _frequencies(omega), "rad/s")
    if not isinstance(orders, int | np.integer) or isinstance(orders, bool) or orders < 1:
        raise ValueError(f"a family needs orders as an integer >= 1 (highest harmonic); got {orders!r}.")
    method = method_for(F, output, try_method, num_points, float(A.max()), options)
    _check_options(method, options)
    _check_omega(method, omega)
    work = _Work(F, method, A, omega, int(orders), save)
    work.run(executor, progress)
    return work.family()


class _Work:
    """A family in parts, done and to do, with the file they are kept in."""

    def __init__(self, F, method: Method, A, omega, orders, save):
        self.F, self.method, self.A, self.omega, self.orders = F, method, A, omega, orders
        shape = (A.size, 1 if omega is None else omega.size)
        self.harmonics = np.full((*shape, orders + 1), np.nan + 0j)
        self.regime = np.full(shape, "", dtype="U24")
        self.residual = np.full(shape, np.nan)
        self.by_omega = (
            method.name == "orbit"
        )  # along amplitudes one orbit starts the next: keep columns whole
        self.done = np.zeros(shape[1] if self.by_omega else A.size, dtype=bool)
        self.save = None if save is None else _in_a_folder(Path(save))
        self.saved_at = time.monotonic()
        if self.save is not None and self.save.exists():
            self._resume()

    def run(self, executor, progress):
        lines = np.nonzero(~self.done)[0]
        if lines.size == 0:
            return
        quick = self.method.name != "orbit" and self.method.name not in ("backlash", "memory")
        parts = [lines] if quick and executor is None else [lines[i : i + 1] for i in range(lines.size)]
        if len(parts) == 1 and executor is None:  # no bar: importing one takes longer than most of them
            self._take(parts[0], compute_part(self.method, *self._grid(parts[0]), self.orders))
            return self._finish()
        bar = progress_bar(lines.size, progress)
        try:
            if executor is None:
                for part in parts:
                    self._take(part, compute_part(self.method, *self._grid(part), self.orders))
                    bar.update(len(part))
            else:
                pending = [
                    (part, executor.submit(compute_part, self.method, *self._grid(part), self.orders))
                    for part in parts
                ]
                for part, future in pending:
                    self._take(part, future.result())
                    bar.update(len(part))
        finally:  # an interruption must not lose what is done
            bar.close()
            self._finish()

    def _finish(self):
        if self.save is not None and self.done.any():
            self._write()

    def _grid(self, part):
        return (self.A, self._omega[part]) if self.by_omega else (self.A[part], self.omega)

    def _take(self, part, values):
        where = (slice(None), part) if self.by_omega else part
        self.harmonics[where], self.regime[where], self.residual[where] = values
        self.done[part] = True
        if self.save is not None and time.monotonic() - self.saved_at > _PARTIAL_EVERY:
            self._write()

    def _write(self):
        arrays = dict(
            format=FORMAT,
            amplitudes=self.A,
            omega=self._omega,
            harmonics=self.harmonics,
            regime=self.regime,
            residual=self.residual,
            description=describe(self.F),
            output=self.method.output,
            done=self.done,
            fingerprint=self._fingerprint(),
        )
        write_arrays(self.save, arrays)
        self.saved_at = time.monotonic()

    def _resume(self):
        data = read_arrays(self.save)
        if str(data.get("fingerprint", "")) != self._fingerprint():
            raise ValueError(
                f"save={str(self.save)!r} holds another computation (block, grid, orders or output differ). "
                "Give another path, or remove that file."
            )
        done = data["done"]
        self.done[:] = done
        for mine, name in (
            (self.harmonics, "harmonics"),
            (self.regime, "regime"),
            (self.residual, "residual"),
        ):
            where = (slice(None), done) if self.by_omega else done
            mine[where] = data[name][where]

    def _fingerprint(self) -> str:
        text = hashlib.sha256(
            f"{identity(self.F)}|{self.method.output}|{self.orders}|{self.method.options}".encode()
        )
        text.update(self.A.tobytes())
        text.update(self._omega.tobytes())
        return text.hexdigest()

    @property
    def _omega(self):
        return np.array([np.nan]) if self.omega is None else self.omega

    def family(self) -> Family:
        for array in (self.harmonics, self.regime, self.residual, self.A):
            array.flags.writeable = False
        return Family(
            amplitudes=self.A,
            omega=self._omega,
            harmonics=self.harmonics,
            regime=self.regime,
            residual=self.residual,
            block=self.F,
            description=describe(self.F),
            output=self.method.output,
        )


def _in_a_folder(path: Path) -> Path:
    """Refuse a file in a folder that does not exist, before the work and not after it."""
    if not path.parent.is_dir():
        raise FileNotFoundError(f"save needs a folder that exists; got {path.parent}. Make it first.")
    return path


def compute_part(method: Method, A, omega, orders):
    """Compute a few lines of a family; a plain function, so that it can be sent to another process."""
    return method.harmonics(A, omega, orders)


def describe(F) -> str:
    """Return a block in words: its value where it has one, else its name."""
    text = repr(F) if type(F).__module__.startswith("ctrl_df") else getattr(F, "__name__", None)
    return text or getattr(F, "name", None) or type(F).__name__


def identity(F) -> str:
    """Return a text that changes when the block does, to the last digit of its parameters."""
    parameters = getattr(F, "parameters", None)
    if parameters is None:
        return f"{describe(F)}|{getattr(F, 'params', '')}"
    numbers = {name: float(p).hex() for name, p in parameters.items()}
    return f"{describe(F)}|{numbers}|{getattr(F, 'values', '')}|{getattr(F, 'measured', '')}"


def points(method: Method, A, omega, zero_check=False):
    """N, regime and residual at pairs (A, omega), grouped so that grid solvers see grids.

    Parameters
    ----------
    method : Method
    A, omega : ndarray of one shape; omega may be None for a memoryless block
    zero_check : bool
        As in `describing_function`.

    Returns
    -------
    N : ndarray of complex
    regime : ndarray of str
    residual : ndarray
    """
    N, regime, residual = (
        np.empty(A.shape, dtype=complex),
        np.full(A.shape, "", dtype="U24"),
        np.zeros(A.shape),
    )
    flat, names, errors, a = N.reshape(-1), regime.reshape(-1), residual.reshape(-1), A.reshape(-1)
    zero = a == 0
    if zero.any():
        flat[zero] = _slope_at_zero(method, a.max(), zero_check)
    live = np.nonzero(~zero)[0]
    if not live.size:
        return N, regime, residual
    levels, row = np.unique(a[live], return_inverse=True)
    if not method.needs_omega or omega is None:
        y, kind, error = method.harmonics(levels, None, 1)
        flat[live], names[live], errors[live] = y[row, 0, 1], kind[row, 0], error[row, 0]
        return N, regime, residual
    w = omega.reshape(-1)[live]
    frequencies, column = np.unique(w, return_inverse=True)
    if levels.size * frequencies.size <= _RECTANGLE * live.size:
        y, kind, error = method.harmonics(levels, frequencies, 1)
        flat[live], names[live] = y[row, column, 1], kind[row, column]
        errors[live] = error[row, column]
        return N, regime, residual
    for k, frequency in enumerate(frequencies):
        mine = np.nonzero(column == k)[0]
        some, where = np.unique(row[mine], return_inverse=True)
        y, kind, error = method.harmonics(levels[some], np.array([frequency]), 1)
        flat[live[mine]], names[live[mine]] = y[where, 0, 1], kind[where, 0]
        errors[live[mine]] = error[where, 0]
    return N, regime, residual


def _slope_at_zero(method, largest, zero_check):
    """Limit of N for A -> 0: the slope at the origin, infinite across a jump."""
    if method.needs_omega:
        raise ValueError(
            "a dynamic block has no describing function at A = 0; got A=0. Leave zero out, or use "
            "ct.linearize."
        )
    if method.own_method is not None:
        return complex(method.own_method(0.0))
    if zero_check and method.name != "element":
        at_zero = np.squeeze(np.asarray(method.subject(0.0), dtype=float))
        if at_zero != 0:
            raise ValueError(
                f"function must evaluate to zero at zero; got f(0) = {at_zero}. "
                "Subtract the bias, or pass zero_check=False."
            )
    small = (largest or 1.0) * np.array([1e-9, 1e-8])
    N = method.harmonics(small, None, 1)[0][:, 0, 1]
    if abs(N[0]) > 5 * abs(N[1]):
        return complex(np.inf)
    return N[0] if abs(N[0]) > 1e-13 else 0j


def _amplitudes(A) -> np.ndarray:
    A = _real("A", A)
    if np.isnan(A).any() or np.isinf(A).any():
        raise ValueError(
            "cannot evaluate describing function: A must be finite; got NaN or infinity. Remove it."
        )
    if (A < 0).any():
        bad = A[A < 0].flat[0]
        raise ValueError(
            f"cannot evaluate describing function for A < 0; got A={bad:g}. An amplitude is a peak value."
        )
    return A


def _frequencies(omega) -> np.ndarray:
    omega = _real("omega", omega)
    if not ((omega > 0) & np.isfinite(omega)).all():
        bad = omega[~((omega > 0) & np.isfinite(omega))].flat[0]
        raise ValueError(
            f"a describing function needs omega > 0 and finite [rad/s]; got omega={bad}. Remove it."
        )
    return omega


def _real(name, values) -> np.ndarray:
    array = np.asarray(values)
    if np.iscomplexobj(array):
        raise TypeError(f"{name} must be real numbers; got complex ones. An amplitude is a peak value.")
    try:
        return array.astype(float)
    except (TypeError, ValueError):
        raise TypeError(f"{name} must be real numbers; got {values!r}.") from None


def _common_shape(A, omega):
    if omega is None:
        return A.shape
    try:
        return np.broadcast_shapes(A.shape, omega.shape)
    except ValueError:
        raise ValueError(
            f"A and omega must broadcast; got shapes {A.shape} and {omega.shape}. "
            "For every pair of both use describing_function_family."
        ) from None


def _axis(name, values, unit) -> np.ndarray:
    values = np.array(np.atleast_1d(values))
    if values.ndim != 1 or values.size == 0:
        raise ValueError(
            f"a family needs {name} as a 1-D array with at least one value [{unit}]; got shape "
            f"{values.shape}."
        )
    return values


def _check_omega(method, omega):
    if method.needs_omega and omega is None:
        raise ValueError(
            "a block with dynamics has N(A, omega): give omega [rad/s]. Only memoryless blocks do without it."
        )


def _check_options(method, options):
    if options and method.name != "orbit":
        raise TypeError(f"unrecognized keywords: {', '.join(options)}")


def progress_bar(total: int | None, progress, what="describing function", unit="line") -> Any:
    """Return a bar that shows itself after two seconds, on a terminal only unless `progress` says otherwise."""
    from tqdm import tqdm

    disable = None if progress is None else not progress
    return tqdm(total=total, delay=0 if progress else 2, disable=disable, unit=unit, desc=what, leave=False)
