"""Names of records that also tell which run they are of, as names alone may be anybody's."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable


class RecordName(str):
    """Name of a record, with the run it is of.

    Attributes
    ----------
    run : str
        Digest of the data of that run; a part of it has that of the whole.
    given : bool
        Whether a user gave the name, to this record alone. Else it is made up (a default, a number) and says
        nothing of which run it is.
    """

    run: str
    given: bool

    def __new__(cls, name: str, run: str = "", given: bool = True):
        """Take the name as text, the run, and where the name is from."""
        self = super().__new__(cls, name)
        self.run, self.given = run, given
        return self

    def __getnewargs__(self):
        return str(self), self.run, self.given

    def is_as(self, other: str) -> bool:
        """Whether both name the same record: by a name given to both, else by the run."""
        if not isinstance(other, RecordName) or (self.given and other.given):
            return self == other
        return self.run == other.run


def among(name: str, known: Iterable[str]) -> str | None:
    """Return which of some names is that of the same record, or None; plain text is taken at its word."""
    known = list(known)
    if not isinstance(name, RecordName):
        return next((other for other in known if other == name), None)
    same = [other for other in known if name.is_as(other)]
    # of several parts of one run the whole names tell which
    return next((other for other in same if other == name), same[0] if len(same) == 1 else None)


def digest(arrays: Iterable) -> str:
    """Return what tells data from others."""
    found = hashlib.blake2b(digest_size=16)
    for array in arrays:
        found.update(array.tobytes())
    return found.hexdigest()
