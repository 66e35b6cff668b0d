"""What is installed: for reports of faults."""

from __future__ import annotations

import platform
import sys
from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as installed

_PACKAGES = ("control", "numpy", "scipy", "matplotlib", "numba", "llvmlite", "tqdm", "tabulate", "pandas")


def version() -> str:
    """Return the version of ctrl_df."""
    try:
        return installed("ctrl_df")
    except PackageNotFoundError:  # a folder on the path, not installed
        return "not installed"


def show_versions() -> None:
    """Print the versions of ctrl_df, Python and the packages it stands on; paste it into a report.

    Examples
    --------
    >>> import ctrl_df as cdf
    >>> cdf.show_versions()  # doctest: +ELLIPSIS
    ctrl_df ...
    """
    print(f"ctrl_df {version()}")
    print(f"python {sys.version.split()[0]}, {platform.platform()}")
    for name in _PACKAGES:
        try:
            print(f"{name} {installed(name)}")
        except PackageNotFoundError:
            print(f"{name} not installed")
