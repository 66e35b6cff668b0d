"""Measured frequency responses that depend on amplitude: a table N(A, omega)."""

from __future__ import annotations

from dataclasses import dataclass

import control as ct
import numpy as np

from ...checks import positive, real_array, shown
from ...units import si_unit
from . import readers
from .text_table import refuse_text


@dataclass(frozen=True, eq=False, repr=False)
class FrequencyMeasurement:
    """A describing function as measured with stepped sines: the fundamental of the output over the input's.

    Parameters
    ----------
    A : array_like, shape (na,)
        Peak amplitudes of the input, > 0, increasing.
    omega : array_like, shape (nw,)
        Frequencies [rad/s], > 0, increasing.
    N : array_like, shape (na, nw), complex
        ``(Y1/A) exp(j phi1)`` for input ``A cos(omega t)``; NaN where nothing was measured, 0 where nothing
        moved.
    name : str
        Shown in tables and pictures.
    input_unit, output_unit : str
        Units of A and of the output behind N; converted to SI.
    noise : float or array_like, shape (na, nw), or None
        Standard error of N relative to ``|N|``, > 0, where it is known (from repeated runs, say): points
        weigh by it. None: all points alike.

    Raises
    ------
    ValueError
        Wrong shape, an amplitude or frequency that is not positive and increasing, a table without any
        measured point, a noise that is not positive.

    Examples
    --------
    >>> A, omega = np.array([8.0, 16.0]), np.geomspace(4, 20, 6)
    >>> N = cdf.describing_function_family(cdf.friction_mass(2.2, 3.0, 6.0), A, omega).N
    >>> table = cdf.FrequencyMeasurement(A, omega, N)
    >>> table.N.shape
    (2, 6)
    """

    A: np.ndarray
    omega: np.ndarray
    N: np.ndarray
    name: str = "frequency response"
    input_unit: str = "N"
    output_unit: str = "m"
    noise: float | np.ndarray | None = None

    def __post_init__(self):
        scale_u, input_unit = si_unit(self.input_unit)
        scale_y, output_unit = si_unit(self.output_unit)
        amplitudes, omega = _axis("A", self.A), _axis("omega", self.omega)
        table = _table(self.N)
        if table.ndim == 1 and 1 in (len(amplitudes), len(omega)):
            table = (
                table.reshape(len(amplitudes), len(omega))
                if table.size == len(amplitudes) * len(omega)
                else table
            )
        if table.shape != (len(amplitudes), len(omega)):
            raise ValueError(
                "FrequencyMeasurement needs N of shape (len(A), len(omega)) = "
                f"({len(amplitudes)}, {len(omega)}); "
                f"got {table.shape}. Transpose it if rows are frequencies."
            )
        if np.any(np.isinf(table)) or not np.any(np.isfinite(table)):
            raise ValueError(
                "FrequencyMeasurement needs finite N, NaN where nothing was measured, one point at least; "
                f"got {np.count_nonzero(np.isfinite(table))} finite of {table.size}. "
                "Write NaN where N is not known."
            )
        values = dict(A=amplitudes * scale_u, omega=omega, N=table * (scale_y / scale_u))
        if self.noise is not None:
            values["noise"] = _noise(self.noise, table)
        for key, array in values.items():
            array.flags.writeable = False
            object.__setattr__(self, key, array)
        object.__setattr__(self, "input_unit", input_unit)
        object.__setattr__(self, "output_unit", output_unit)

    @classmethod
    def from_csv(
        cls, path, *, amplitude="A", omega="omega", frequency=None, real=None, imag=None, magnitude=None,
        phase=None, delimiter=None, decimal=None, **keywords,
    ):  # fmt: skip
        """Read one measured point a row, in any order; points that are missing become NaN.

        Parameters
        ----------
        path : path-like
            See `Measurement.from_csv`.
        amplitude : str
            Column of peak amplitudes.
        omega, frequency : str
            Column of frequencies in rad/s, or in Hz.
        real, imag : str
            Columns of N, or
        magnitude, phase : str
            columns of ``|N|`` and of its phase [deg].
        """
        table = readers.read_csv(path, delimiter, decimal)

        def column(name):
            found = readers.find_column(table, name, str(path))[0]
            refuse_text(table, found, str(path))
            return table[found]

        if (
            (real is None) == (magnitude is None)
            or (real is None) != (imag is None)
            or (magnitude is None) != (phase is None)
        ):
            raise ValueError(
                "FrequencyMeasurement.from_csv needs either real= and imag=, or magnitude= and phase= (deg); "
                f"got real={real!r}, imag={imag!r}, magnitude={magnitude!r}, phase={phase!r}. "
                "Name the two columns."
            )
        n = (
            column(real) + 1j * column(imag)
            if real is not None
            else column(magnitude) * np.exp(1j * np.radians(column(phase)))
        )
        a = column(amplitude)
        w = column(omega) if frequency is None else 2 * np.pi * column(frequency)
        amplitudes, omegas = np.unique(a), np.unique(w)
        grid = np.full((len(amplitudes), len(omegas)), np.nan, dtype=complex)
        where = (np.searchsorted(amplitudes, a), np.searchsorted(omegas, w))
        if len(set(zip(*where, strict=True))) < len(a):
            raise ValueError(
                f"a table N(A, omega) needs each point once; {path} has some twice. Average them first."
            )
        grid[where] = n
        keywords.setdefault("name", readers.stem(path))
        return cls(amplitudes, omegas, grid, **keywords)

    @property
    def points(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Amplitude, frequency and N of the measured points, one entry each."""
        i, k = np.nonzero(np.isfinite(self.N))
        return self.A[i], self.omega[k], self.N[i, k]

    @property
    def noise_of_points(self) -> np.ndarray:
        """Relative standard errors in the order of `points`; NaN where none are stated."""
        good = np.isfinite(self.N)
        return np.full(np.count_nonzero(good), np.nan) if self.noise is None else np.asarray(self.noise)[good]

    def frd(self, amplitude: float) -> ct.FrequencyResponseData:
        """Return the measured response at the amplitude nearest to `amplitude`."""
        i = int(np.argmin(np.abs(self.A - positive("frd", "amplitude", amplitude, self.input_unit))))
        good = np.isfinite(self.N[i])
        if not np.any(good):
            raise ValueError(
                f"frd needs an amplitude with measured points; A = {self.A[i]:g} has none. Take another."
            )
        return ct.frd(self.N[i, good], self.omega[good])

    def __repr__(self) -> str:
        measured = np.count_nonzero(np.isfinite(self.N))
        return (
            f"FrequencyMeasurement({self.name!r}: {len(self.A)} amplitudes {self.A[0]:g} to {self.A[-1]:g} "
            f"{self.input_unit}, {len(self.omega)} frequencies {self.omega[0]:g} to {self.omega[-1]:g} "
            f"rad/s, {measured} of {self.N.size} points measured)"
        )


def _noise(noise, table):
    if np.asarray(noise).dtype.kind not in "fiu":
        raise TypeError(
            f"FrequencyMeasurement needs noise as real numbers; got {shown(noise)}. Leave it out if unknown."
        )
    try:
        array = np.broadcast_to(np.asarray(noise, dtype=float), table.shape).copy()
    except ValueError:
        raise ValueError(
            f"FrequencyMeasurement needs noise as one number or of the shape of N, {table.shape}; got shape "
            f"{np.shape(noise)}. Transpose it if rows are frequencies."
        ) from None
    if not np.all(array[np.isfinite(table)] > 0):
        raise ValueError(
            "FrequencyMeasurement needs noise > 0 (standard error of N over |N|) wherever N is measured; got "
            f"{float(np.nanmin(array)):g} at least. Leave it out where it is not known."
        )
    return array


def _table(values):
    if isinstance(values, np.ma.MaskedArray):
        values = np.ma.filled(values.astype(complex), np.nan)  # what is masked was not measured
    try:
        raw = np.asarray(values)
    except ValueError:
        raise ValueError(
            "FrequencyMeasurement needs N as a table; got rows of unequal length. "
            "Fill them with NaN where nothing was measured."
        ) from None
    if raw.dtype.kind not in "fiuc":
        raise TypeError(
            f"FrequencyMeasurement needs N as complex numbers; got {shown(values)}. "
            "Convert text with complex()."
        )
    return np.array(raw, dtype=complex)


def _axis(name, values):
    array = np.atleast_1d(real_array("FrequencyMeasurement", name, values)).copy()
    if array.ndim != 1 or len(array) == 0:
        raise ValueError(
            f"FrequencyMeasurement needs {name} as a 1-D array; got shape {array.shape}. "
            "Flatten it with ravel()."
        )
    if not np.all(np.isfinite(array)) or np.any(array <= 0) or np.any(np.diff(array) <= 0):
        raise ValueError(
            f"FrequencyMeasurement needs {name} finite, > 0 and increasing; got {np.array2string(array)}. "
            "Sort it, and average what was measured twice."
        )
    return array
