"""The file of a family that is not finished: every line is appended as it is done, so that none is lost.

A header says which computation it is; records follow, each with its length and checksum. A process that is
killed while it writes leaves a torn record at the end, which the next one cuts off. The finished family takes
the file's place.
"""

from __future__ import annotations

import json
import os
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

MAGIC = b"ctrl_df unfinished family\n"
_RECORD = struct.Struct("<QI")  # length, checksum


class Journal:
    """An unfinished family on disk, open for appending; use `begin` or `resume`."""

    def __init__(self, path: Path, file):
        self.path, self._file = path, file
        _lock(file, path)

    @classmethod
    def begin(cls, path: Path, header: dict) -> Journal:
        """Make the file, whole or not at all; OSError where it cannot be made."""
        temporary = path.with_name(f"{path.name}.{os.getpid()}.part")
        try:
            with open(temporary, "wb") as file:
                file.write(MAGIC + json.dumps(header).encode() + b"\n")
            os.replace(temporary, path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
        return cls(path, open(path, "ab", buffering=0))

    @classmethod
    def resume(cls, path: Path) -> tuple[Journal, Iterator[dict[str, np.ndarray]]]:
        """Open a file for going on; also return its records, the torn end cut off once they are read."""
        journal = cls(path, open(path, "r+b", buffering=0))
        return journal, journal._replay()

    def append(self, **arrays):
        """Add a record; when this returns, no death of the process loses it."""
        head = {name: (a.dtype.str, a.shape) for name, a in arrays.items()}
        payload = json.dumps(head).encode() + b"\n" + b"".join(a.tobytes() for a in arrays.values())
        start, rest = self._file.tell(), memoryview(_RECORD.pack(len(payload), zlib.crc32(payload)) + payload)
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except BaseException as error:
            self._file.truncate(start)  # an interrupt must not leave half a record before others
            if isinstance(error, OSError):
                raise OSError(
                    f"save={str(self.path)!r} can be written no further ({error.strerror}). What is done is "
                    "kept: make room and repeat the call."
                ) from None
            raise

    def close(self):
        """Close the file; another process may have it then."""
        self._file.close()

    def _replay(self):
        end = _after_header(self._file)
        for record, after in _records(self._file):
            yield record
            end = after
        self._file.seek(end)
        self._file.truncate()


def is_journal(path) -> bool:
    """Whether a file is an unfinished family."""
    with open(path, "rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def read_header(path) -> dict:
    """Return what an unfinished family says of itself."""
    with open(path, "rb") as file:
        file.seek(len(MAGIC))
        try:
            return json.loads(file.readline())
        except ValueError:
            raise ValueError(
                f"{path} is a damaged unfinished family: its header is torn. Remove it."
            ) from None


def lines_done(path) -> int:
    """Count the lines that an unfinished family holds."""
    with open(path, "rb") as file:
        _after_header(file)
        return sum(record["lines"].size for record, _ in _records(file))


def _after_header(file) -> int:
    file.seek(len(MAGIC))
    file.readline()
    return file.tell()


def _records(file):
    """Yield each whole record as arrays by name, and where it ends."""
    while len(frame := file.read(_RECORD.size)) == _RECORD.size:
        length, checksum = _RECORD.unpack(frame)
        if length > os.fstat(file.fileno()).st_size - file.tell():
            return
        payload = file.read(length)
        if zlib.crc32(payload) != checksum:
            return
        head, at = payload.partition(b"\n")[0], payload.index(b"\n") + 1
        arrays = {}
        for name, (dtype, shape) in json.loads(head).items():
            count = int(np.prod(shape))
            arrays[name] = np.frombuffer(payload, dtype, count, at).reshape(shape)
            at += arrays[name].nbytes
        yield arrays, file.tell()


def _lock(file, path):
    """Refuse a file that another process is writing, where the system can tell."""
    try:
        import fcntl
    except ImportError:  # Windows: a file that is open there cannot be replaced anyway
        return
    try:
        fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        file.close()
        raise BlockingIOError(
            f"save={str(path)!r} is being written by another process. Wait for it, or give another path."
        ) from None
    except OSError:  # a file system without locks
        return
