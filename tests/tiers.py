"""Write the list of slow tests from the times of a run; what was not run stays as it is listed.

CTRL_DF_TIMES=times.txt pytest -m "study or not study"; python tests/tiers.py times.txt

Delete the list before to forget tests that are gone.
"""

import math
import sys
from pathlib import Path

from conftest import SLOW

LONG = 0.2  # [s of processor]


def main(path) -> None:
    """Replace the lines of all tests that were timed."""
    times, alone = {}, {}
    for line in Path(path).read_text().splitlines():
        took, with_shared, name = line.split(" ", 2)
        times[name] = min(times.get(name, math.inf), float(with_shared))  # the first one may compile
        alone[name] = min(alone.get(name, math.inf), float(took))
    listed = set(SLOW.read_text().split("\n")) - {""} if SLOW.exists() else set()
    slow = {name for name in listed if name not in times} | {n for n, s in times.items() if s > LONG}
    SLOW.write_text("\n".join(sorted(slow)) + "\n")
    whole, left = sum(alone.values()), sum(s for n, s in times.items() if n not in slow)
    print(f"{len(slow)} slow tests; the others take {left:.0f} s of {whole:.0f} s of processor")


if __name__ == "__main__":
    main(sys.argv[1])
