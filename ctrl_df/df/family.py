"""The result of a describing-function computation over amplitudes and frequencies."""

from __future__ import annotations

import html
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import control as ct
import numpy as np

from ..cached import cached_property
from ..checks import no_file, number, path_of, shown, warn
from ..drawing import draw
from ..table import Table
from ..thresholds import ROUNDED
from .dispatch import method_for
from .points import AtPairs
from .saving.family_file import FORMAT, read_arrays, write_arrays
from .saving.journal import is_journal, lines_done, read_header
from .thresholds import PROBED_POINTS, SAME_BLOCK
from .warning import IRREGULAR, DescribingFunctionWarning, warn_of

_SEVERAL = "subharmonic"


@dataclass(frozen=True, eq=False, repr=False)
class Family:
    """Harmonics of a block's steady output for ``u = A cos(omega t)`` on a grid of A and omega.

    Attributes
    ----------
    amplitudes : ndarray, shape (na,)
        Peak values of the input, unit of the input.
    omega : ndarray, shape (nw,)
        [rad/s]; ``[nan]`` for a memoryless block asked without frequencies.
    harmonics : ndarray of complex, shape (na, nw, orders + 1)
        Y_k / A for ``y = Y_0 + Re sum Y_k exp(j k omega t)``; index 0 is the mean.
    motion : ndarray of str, shape (na, nw)
        Regime of each point, ``subharmonic`` with its number of periods, such as ``subharmonic 3``.
    residual : ndarray, shape (na, nw)
        How well each orbit closes, or the estimated error of a quadrature, relative.
    block : object
        What was described; None after loading without it.
    description : str
        The block in words.
    output : str
        Name of the output described.
    at : AtPairs or None
        Computes N and regime at further pairs (amplitude, omega) as the family was computed; None after
        loading without the block.

    Examples
    --------
    >>> axis = cdf.friction_mass(mass=9, coulomb=5, viscous=0.5)
    >>> family = cdf.describing_function_family(axis, [9.0, 14.0], np.geomspace(4, 40, 10))
    >>> family.counts
    {'slip': 10, 'stick-slip': 10}
    >>> family.frd(9.0).ninputs
    1
    """

    amplitudes: np.ndarray
    omega: np.ndarray
    harmonics: np.ndarray
    motion: np.ndarray
    residual: np.ndarray
    block: Any = None
    description: str = ""
    output: str = "y"
    at: AtPairs | None = field(default=None, repr=False)

    @property
    def N(self) -> np.ndarray:
        """Describing function, complex, shape (na, nw); NaN where there is no periodic response."""
        return self.harmonics[..., 1]

    @cached_property
    def regime(self) -> np.ndarray:
        """What the motion is: ``slip``, ``impact``, ``subharmonic`` ...; str, shape (na, nw)."""
        several = self._several
        return np.where(several, _SEVERAL, self.motion) if several.any() else self.motion

    @property
    def periods(self) -> np.ndarray:
        """Periods of the input in one of the motion: 1 unless ``subharmonic``; int, shape (na, nw)."""
        periods, several = np.ones(self.motion.shape, int), self._several
        periods[several] = [int(name.split()[1]) for name in self.motion[several]]
        return periods

    @property
    def _several(self) -> np.ndarray:
        return np.char.startswith(self.motion, f"{_SEVERAL} ")

    @property
    def minus_inverse(self) -> np.ndarray:
        """-1/N, complex, shape (na, nw): the curves that cross the Nyquist plot at limit cycles."""
        return minus_inverse(self.N)

    @property
    def orders(self) -> int:
        """Highest harmonic."""
        return self.harmonics.shape[-1] - 1

    @property
    def counts(self) -> dict[str, int]:
        """Number of grid points in each regime."""
        names, numbers = np.unique(self.regime, return_counts=True)
        return dict(zip(names.tolist(), numbers.tolist(), strict=True))

    def frd(self, amplitude: float) -> ct.FrequencyResponseData:
        """Return the frequency response N(amplitude, omega).

        Parameters
        ----------
        amplitude : float
            Within the grid. Off its nodes N is computed again from the block, or, for a family loaded without
            its block, interpolated linearly over the logarithm of the amplitude.

        Warns
        -----
        DescribingFunctionWarning
            N is interpolated; or NaN, or that of a motion without a period, as `describing_function` warns.

        Raises
        ------
        ValueError
            Outside the grid, or a family without frequencies.
        """
        if not np.isfinite(self.omega).all():
            raise ValueError("frd needs frequencies; this family has none. Give omega when computing it.")
        amplitude = within("frd", "amplitude", amplitude, self.amplitudes)
        row = np.nonzero(np.isclose(self.amplitudes, amplitude, rtol=ROUNDED, atol=0))[0]
        if row.size:
            response, regime = self.N[row[0]], self.regime[row[0]]
        elif self.at is not None:
            response, regime = self.at(amplitude, self.omega)
        else:
            response, regime = self._between(amplitude)
        warn_of(response, regime, amplitude, self.omega, look_at="family")
        name = f"N({amplitude:g})".replace(".", "_")  # python-control allows no point in a name
        return ct.frd(np.array(response), self.omega, name=name)

    def _between(self, amplitude) -> tuple[np.ndarray, np.ndarray]:
        """Return N and regime between two amplitudes of the grid, with a warning that N is interpolated."""
        order = np.argsort(self.amplitudes)
        a, N, regime = self.amplitudes[order], self.N[order], self.regime[order]
        upper = int(np.clip(np.searchsorted(a, amplitude), 1, a.size - 1))
        lower = upper - 1
        share = np.log(amplitude / a[lower]) / np.log(a[upper] / a[lower])
        warn(
            f"between its amplitudes a family that was loaded without its block has no N of its own; that at "
            f"{amplitude:g} is interpolated from {a[lower]:g} and {a[upper]:g}. Load it with the block, "
            "load_family(path, block), or ask describing_function for that amplitude.",
            DescribingFunctionWarning,
        )
        lost = np.isnan(N[upper])
        between = (1 - share) * N[lower] + share * N[upper]
        return between, np.where(lost, regime[upper], regime[lower])

    def plot(self, **kwargs) -> ct.ControlPlot:
        """Draw -1/N in the complex plane, at constant amplitude and at constant frequency."""
        return draw("family", self, **kwargs)

    def plot_harmonics(self, **kwargs) -> ct.ControlPlot:
        """Draw ``|Y_k| / A`` over frequency or amplitude, as Figs. 4 and 8 of Azenha & Machado (1997)."""
        return draw("harmonics", self, **kwargs)

    def save(self, path) -> Path:
        """Write the family to an ``.npz`` file (no pickle inside), whole or not at all."""
        return write_arrays(path_of("save", "path", path), _arrays(self))

    def __repr__(self) -> str:
        """Return what was described, its size and regimes."""
        regimes = ", ".join(f"{name} {count}" for name, count in self.counts.items())
        size = f"{self.N.shape[0]} x {self.N.shape[1]} points"
        return f"<Family of {self.description or 'a block'}: {size}; {regimes}>"

    def _repr_html_(self) -> str:
        """Return the same above its regimes."""
        rows = tuple((name, str(count)) for name, count in self.counts.items())
        return f"<p>{html.escape(repr(self)[1:-1])}</p>{Table(('regime', 'points'), rows)._repr_html_()}"


def within(owner: str, name: str, value, grid: np.ndarray) -> float:
    """Return a value between the ends of a family's grid; ValueError outside."""
    value = number(owner, name, value)
    if not np.isfinite(grid).all():
        raise ValueError(f"{owner} takes no {name}, as this family has none; got {value!r}. Leave it out.")
    low, high = grid.min(), grid.max()
    if not low * (1 - ROUNDED) <= value <= high * (1 + ROUNDED):
        raise ValueError(
            f"{owner} needs {low:g} <= {name} <= {high:g} (the family's grid); got {value!r}. "
            "Compute a family that reaches it."
        )
    return value


def load_family(path, block=None) -> Family:
    """Read a family written by `Family.save`, or by ``save=`` of `describing_function_family`.

    Parameters
    ----------
    path : path
    block : as for `describing_function_family`, optional
        What the family was computed of. A file does not hold it; with it the family computes N between the
        amplitudes of its grid as it did before, with the default options of its solver.

    Returns
    -------
    Family

    Raises
    ------
    FileNotFoundError
        There is no such file.
    TypeError
        `path` is no path.
    ValueError
        The file is damaged, holds no family or no complete one (interrupted work is finished by the call that
        began it), or needs pickle; or `block` has another N than the file.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> axis = cdf.friction_mass(mass=9, coulomb=5, viscous=0.5)
    >>> family = cdf.describing_function_family(axis, [9.0, 14.0], [10.0, 15.0])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = family.save(pathlib.Path(folder) / "axis.npz")
    ...     again = cdf.load_family(path)
    >>> bool((again.N == family.N).all())
    True
    """
    path = path_of("load_family", "path", path)
    if not path.exists():
        raise no_file("load_family", "path", path)
    if is_journal(path):
        done, lines = lines_done(path), read_header(path)["lines"]
        raise ValueError(_incomplete(path, done, lines))
    data = read_arrays(path)
    if "done" in data and not data["done"].all():  # format 1
        raise ValueError(_incomplete(path, int(data["done"].sum()), data["done"].size))
    family = Family(
        amplitudes=data["amplitudes"],
        omega=data["omega"],
        harmonics=data["harmonics"],
        motion=data["regime"],
        residual=data["residual"],
        description=str(data["description"]),
        output=str(data["output"]),
    )
    return family if block is None else _of_block(family, block, path)


def _of_block(family: Family, block, path) -> Family:
    """Return a loaded family with its block, after asking the block for some of the family's values."""
    method = method_for(block, family.output, largest=float(family.amplitudes.max()))
    known = np.argwhere(~np.isnan(family.N) & ~np.isin(family.regime, IRREGULAR))
    i, k = known[:: max(1, len(known) // PROBED_POINTS)].T
    agreed = method.needs_omega <= bool(np.isfinite(family.omega).all())
    if agreed and i.size:
        at = AtPairs(method)
        N = at(family.amplitudes[i], family.omega[k])[0]
        agreed = (abs(N - family.N[i, k]) <= SAME_BLOCK * abs(family.N[i, k])).any()
    if not agreed:
        raise ValueError(
            f"load_family needs the block that the family was computed of; {path} holds {family.description}"
            f", with another N than {shown(block)}. Give that block, or leave it out."
        )
    return replace(family, block=block, at=AtPairs(method))


def _incomplete(path, done, lines) -> str:
    return (
        f"load_family needs a complete family; {path} holds {done} of {lines} lines. Repeat the call of "
        "describing_function_family with the same save= to finish it."
    )


def minus_inverse(N) -> np.ndarray:
    """-1/N; NaN stays NaN, and N = 0 gives minus infinity."""
    N = np.asarray(N, dtype=complex)
    with np.errstate(all="ignore"):
        return np.where(N == 0, complex(-np.inf, 0.0), -1 / np.where(N == 0, 1.0, N))


def _arrays(family: Family) -> dict[str, Any]:
    return dict(
        format=FORMAT,
        amplitudes=family.amplitudes,
        omega=family.omega,
        harmonics=family.harmonics,
        regime=np.asarray(family.motion, dtype=str),
        residual=family.residual,
        description=family.description,
        output=family.output,
    )
