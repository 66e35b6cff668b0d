"""Families in files: npz without pickles, written whole or not at all, read rightly or refused."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...checks import path_of
from ..thresholds import COMPRESSED

FORMAT = 2
"""Of saved families: 1 to version 0.1.0; raised when files, or the numbers in them, change their meaning."""


def place_for(save) -> Path:
    """Return the path of a file to be written, or say why there can be none: to be asked before work."""
    path = path_of("a family", "save", save)
    if not path.parent.is_dir():
        raise FileNotFoundError(f"save needs a folder that exists; got {path.parent}. Make it first.")
    if path.is_dir():
        raise IsADirectoryError(f"save needs the path of a file; got the folder {path}. Add a name, f.npz.")
    if not os.access(path.parent, os.W_OK) or (path.exists() and not os.access(path, os.W_OK)):
        raise PermissionError(f"save needs a file that can be written; got {path}. Choose another folder.")
    return path


def write_arrays(path, arrays: Mapping[str, Any]) -> Path:
    """Write arrays as npz through a temporary file beside `path`: a break leaves the old file whole."""
    path = place_for(path)
    arrays = {k: np.asarray(v) for k, v in arrays.items()}
    write = np.savez_compressed if sum(a.nbytes for a in arrays.values()) < COMPRESSED else np.savez
    temporary = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        with open(temporary, "wb") as file:
            write(file, allow_pickle=False, **arrays)
        os.replace(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    return path


def read_arrays(path) -> dict[str, np.ndarray]:
    """Read an npz file of a family, refusing pickles, strangers and what is damaged."""
    try:
        with open(path, "rb") as handle:
            file = np.load(handle, allow_pickle=False)
            if isinstance(file, np.ndarray):
                raise ValueError("it holds one bare array")
            data = {key: file[key] for key in file.files}
    except (FileNotFoundError, IsADirectoryError, PermissionError):
        raise
    except Exception as error:  # a damaged zip fails in many ways, each with an error of its own
        # numpy's words may advise to load with pickles: only its kind is told
        raise ValueError(
            f"{path} is no family file or a damaged one (half copied, cut off; {type(error).__name__}). "
            "A family file is an npz without pickled objects, written by Family.save. Copy it again, or "
            "compute the family again."
        ) from None
    missing = _KEYS - data.keys()
    if missing:
        raise ValueError(
            f"{path} is no family file: it lacks {', '.join(sorted(missing))}. Give a file that "
            "Family.save or save= wrote."
        )
    wrong = _wrong(data)
    if wrong:
        raise ValueError(f"{path} holds no sound family: {wrong}. Remove it and compute the family again.")
    if int(data["format"]) > FORMAT:
        raise ValueError(
            f"{path} was written by a newer ctrl_df (format {int(data['format'])}); update the package."
        )
    return data


_KEYS = {"format", "amplitudes", "omega", "harmonics", "regime", "residual", "description", "output"}


def _wrong(data) -> str:
    """Say which rule the arrays of a family break, "" if none."""
    kinds = {"format": "iu", "amplitudes": "fiu", "omega": "fiu", "harmonics": "c", "residual": "fiu"}
    kinds |= {"regime": "U", "description": "U", "output": "U"}
    words = {"fiu": "real numbers", "iu": "an integer", "c": "complex numbers", "U": "text"}
    for key, kind in kinds.items():
        if data[key].dtype.kind not in kind:
            return f"{key} must be {words[kind]}, and is of type {data[key].dtype}"
    for key in ("format", "description", "output"):
        if data[key].ndim:
            return f"{key} must be one value, and has shape {data[key].shape}"
    A, omega, harmonics = data["amplitudes"], data["omega"], data["harmonics"]
    if A.ndim != 1 or not A.size or not (np.isfinite(A) & (A > 0)).all():
        return "amplitudes must be a 1-D array of positive finite numbers"
    if omega.ndim != 1 or not omega.size:
        return "omega must be a 1-D array"
    if not ((np.isfinite(omega) & (omega > 0)).all() or (omega.size == 1 and np.isnan(omega[0]))):
        return "omega must be positive and finite (one NaN for a family without frequencies)"
    grid = (A.size, omega.size)
    if harmonics.ndim != 3 or harmonics.shape[:2] != grid or harmonics.shape[2] < 2:
        return f"harmonics must have shape {grid + ('orders + 1',)}, and has {harmonics.shape}".replace(
            "'", ""
        )
    for key in ("regime", "residual"):
        if data[key].shape != grid:
            return f"{key} must have shape {grid}, and has {data[key].shape}"
    whole = _whole(data)
    if np.isinf(harmonics[whole]).any():
        return "harmonics must be finite, or NaN where there is no periodic answer"
    if (data["residual"][whole] < 0).any():
        return "residual must not be negative"
    if (data["regime"][whole] == "").any():
        return "regime must name every point"
    return ""


def _whole(data):
    """Select what is done of a family of format 1, everything of others."""
    done, shape = data.get("done"), data["regime"].shape
    if done is None:
        return np.ones(shape, dtype=bool)
    return np.broadcast_to(done[:, None] if done.size == shape[0] else done[None, :], shape)
