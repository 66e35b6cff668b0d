"""A family computed in parts: here or by an executor, saved as it goes, resumed where it stopped."""

from __future__ import annotations

import hashlib
import time
from pathlib import Path
from typing import Any

import numpy as np

from .dispatch import Method
from .family import FORMAT, Family, read_arrays, write_arrays

_PARTIAL_EVERY = 5.0  # [s] between saved parts


class Work:
    """A family in parts, done and to do, with the file they are kept in.

    Parameters
    ----------
    F : object
        What is described.
    method : Method
        How.
    A : ndarray, shape (na,)
    omega : ndarray, shape (nw,), or None
        [rad/s].
    orders : int
        Highest harmonic.
    save : path or None
        ``.npz`` file; if it holds a part of this very computation, that part is taken over.
    """

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
        self.save = None if save is None else in_a_folder(Path(save))
        self.saved_at = time.monotonic()
        if self.save is not None and self.save.exists():
            self._resume()

    def run(self, executor, progress):
        """Compute what is still to do; `executor` and `progress` as in `describing_function_family`."""
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
        """Return the finished family, its arrays locked."""
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


def in_a_folder(path: Path) -> Path:
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


def progress_bar(total: int | None, progress, what="describing function", unit="line") -> Any:
    """Return a bar that shows itself after two seconds; only on a terminal, unless `progress` says more."""
    from tqdm import tqdm

    disable = None if progress is None else not progress
    return tqdm(total=total, delay=0 if progress else 2, disable=disable, unit=unit, desc=what, leave=False)
