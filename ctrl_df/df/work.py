"""A family computed in parts: here or by an executor, saved as it goes, resumed where it stopped."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..checks import executor as checked_executor
from ..simulate.parallel import processors
from ..thresholds import LARGEST
from .executors import by_executor, check_picklable
from .family import Family
from .methods import Guarded, Method
from .points import AtPairs, compute_part
from .saving.family_file import FORMAT, place_for, read_arrays, write_arrays
from .saving.fingerprint import fingerprint
from .saving.journal import Journal, is_journal, read_header
from .threads import Threads
from .thresholds import HERE, LAW_ROWS

_REGIME = "U16"


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

    Raises
    ------
    ValueError
        The family is too large, a `save` file that belongs to another computation or is damaged, a block that
        cannot be identified.
    """

    def __init__(self, F, method: Method, A, omega, orders, save):
        self.F, self.method, self.A, self.omega, self.orders = F, method, A, omega, orders
        shape = (A.size, 1 if omega is None else omega.size)
        require_room(*shape, orders)
        self.save = None if save is None else place_for(save)
        self.fingerprint = "" if save is None else self._fingerprint()
        self._shape = shape
        self.harmonics = np.empty((0, 0, orders + 1), dtype=complex)  # until the first part is there
        self.regime, self.residual = np.empty((0, 0), dtype=_REGIME), np.empty((0, 0))
        # along amplitudes one orbit starts the next: keep columns whole
        self.by_omega = method.along_amplitudes
        self.done = np.zeros(shape[1] if self.by_omega else A.size, dtype=bool)
        self.journal: Journal | None = None
        self.written = False
        if self.save is not None and self.save.exists():
            self._resume(self.save)

    def run(self, executor, progress):
        """Compute what is still to do; `executor` and `progress` as in `describing_function_family`."""
        if executor is not None:
            checked_executor("a family", executor)
            if self.method.light:
                executor = None
            else:
                check_picklable(executor, (self.method, self.orders))
        try:
            parts = self._parts(executor is not None)
            if len(parts) > 1 or (parts and executor is not None):
                self._compute(parts, executor, progress)
            elif parts:  # no bar: importing one takes longer than most of them
                self._take(parts[0], compute_part(self.method, *self._grid(parts[0]), self.orders))
            self._finish()
        except KeyboardInterrupt:
            raise KeyboardInterrupt(f"stopped. {self._kept()}") from None
        finally:
            if self.journal is not None:
                self.journal.close()

    def _compute(self, parts, executor, progress):
        if self.save is not None and self.journal is None:
            self.journal = Journal.begin(self.save, self._header())
        bar = progress_bar(sum(map(len, parts)), progress)

        def take(part, values):
            self._take(part, values)
            bar.update(len(part))

        method, threads = self.method, None
        try:
            if executor is None:
                executor = threads = self._threads(len(parts))
            if executor is None or method.copied() is None:
                for part in parts:
                    take(part, compute_part(method, *self._grid(part), self.orders))
            else:
                tasks = ((part, (method.copied(), *self._grid(part), self.orders)) for part in parts)
                ahead = {} if threads is None else {"ahead": threads.ahead}
                by_executor(executor, compute_part, tasks, take, self._kept, **ahead)
        except BaseException:
            if threads is not None:
                threads.stop()
            if self.journal is not None and not self.done.any():
                self.journal.close()
                self.journal.path.unlink(missing_ok=True)  # nothing in it
            raise
        finally:
            bar.close()

    def _threads(self, parts: int) -> Threads | None:
        """Return threads for compiled work of so many parts; None where it is soon done, or calls Python."""
        count = min(processors(), parts)
        if count < 2 or not self.method.compiled():
            return None
        return Threads(count)

    def _parts(self, spread) -> list[np.ndarray]:
        """Lines still to do, in parts; the numbers do not depend on how they are cut.

        A static law's corners are looked for over the amplitudes of a part: these are always the same.
        """
        lines = np.nonzero(~self.done)[0]
        if self.method.static:
            return [p for p in np.split(lines, np.searchsorted(lines, _multiples(self.A.size))) if p.size]
        most = max(1, HERE // self._omega.size) if self.method.quick and not spread else 1
        return [lines[i : i + most] for i in range(0, lines.size, most)]

    def _grid(self, part):
        return (self.A, self._omega[part]) if self.by_omega else (self.A[part], self.omega)

    def _take(self, part, values):
        y, regime, residual = values
        if len(part) == self.done.size and all(array.flags.writeable for array in values):
            self.harmonics, self.regime, self.residual = values  # all of it: nothing to put together
        else:
            if not self.residual.size:
                self.harmonics = np.empty((*self._shape, self.orders + 1), dtype=complex)
                self.regime, self.residual = np.empty(self._shape, _REGIME), np.empty(self._shape)
            where = (slice(None), part) if self.by_omega else part
            if regime.dtype.itemsize > self.regime.dtype.itemsize:
                self.regime = self.regime.astype(regime.dtype)
            self.harmonics[where], self.regime[where], self.residual[where] = y, regime, residual
        self.done[part] = True
        if self.journal is not None:
            self.journal.append(lines=part, harmonics=y, regime=regime, residual=residual)

    # --- the file -------------------------------------------------------------------------------------------

    def _finish(self):
        if self.save is None or self.written:
            return
        if self.journal is not None:
            self.journal.close()
        write_arrays(self.save, self._arrays())

    def _arrays(self):
        return dict(
            self._header(),
            amplitudes=self.A,
            omega=self._omega,
            harmonics=self.harmonics,
            regime=self.regime,
            residual=self.residual,
        )

    def _header(self) -> dict:
        return dict(
            format=FORMAT,
            fingerprint=self.fingerprint,
            description=describe(self.F),
            output=self.method.output,
            lines=self.done.size,
        )

    def _resume(self, path):
        unfinished = is_journal(path)
        data = read_header(path) if unfinished else read_arrays(path)
        if str(data.get("fingerprint", "")) != self.fingerprint:
            old = int(data.get("format", FORMAT)) < FORMAT
            why = (
                "was written by an earlier ctrl_df, which could not tell all blocks apart"
                if old
                else "holds another computation (block, grid, orders, output or options differ)"
            )
            raise ValueError(f"save={str(path)!r} {why}. Give another path, or remove that file.")
        if unfinished:
            journal, records = Journal.resume(path)
            for record in records:
                self._take(record["lines"], (record["harmonics"], record["regime"], record["residual"]))
            self.journal = journal
        else:
            self.harmonics, self.regime, self.residual = data["harmonics"], data["regime"], data["residual"]
            self.done[:] = self.written = True

    def _kept(self) -> str:
        """Say what of the work is kept, and how to go on."""
        number = f"{int(self.done.sum())} of {self.done.size} lines"
        if self.save is None:
            return f"{number} were done and are lost; save= keeps them."
        if not self.done.any():
            return f"No line was done; nothing is kept in {str(self.save)!r}."
        return f"{number} are kept in {str(self.save)!r}: the same call computes the others."

    def _fingerprint(self) -> str:
        method, labels = self.method, list(getattr(self.F, "output_labels", []))
        output = labels.index(method.output) if method.output in labels else method.output
        law = method.block.law if isinstance(method.block, Guarded) else method.block
        return fingerprint(FORMAT, law, output, method.identity(), self.A, self._omega, self.orders)

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
            motion=self.regime,
            residual=self.residual,
            block=self.F,
            description=describe(self.F),
            output=self.method.output,
            at=AtPairs(self.method),
        )


def require_room(na: int, nw: int, orders: int) -> None:
    """Refuse a family that would not fit into memory, with the size that would."""
    point = 16 * (orders + 1) + np.dtype(_REGIME).itemsize + 8
    if na * nw * point > LARGEST:
        side = math.isqrt(LARGEST // point)
        raise ValueError(
            f"a family of {na} x {nw} points with {orders} harmonics needs {na * nw * point / 1e9:.3g} GB; "
            f"at most {LARGEST / 1e9:.3g} GB are computed at once. Give at most {side} x {side} points or "
            f"{LARGEST // point} in all, fewer harmonics, or several families side by side."
        )


def _multiples(size):
    return np.arange(LAW_ROWS, size, LAW_ROWS)


def describe(F) -> str:
    """Return a block in words: its value where it has one, else its name."""
    text = repr(F) if type(F).__module__.startswith("ctrl_df") else getattr(F, "__name__", None)
    return text or getattr(F, "name", None) or type(F).__name__


def progress_bar(total: int | None, progress, what="describing function", unit="line") -> Any:
    """Return a bar that shows itself after two seconds; only on a terminal, unless `progress` says more."""
    from tqdm import tqdm

    disable = None if progress is None else not progress
    return tqdm(total=total, delay=0 if progress else 2, disable=disable, unit=unit, desc=what, leave=False)
