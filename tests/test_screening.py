"""Effects that only long segments show: what these lead to is not lost."""

from dataclasses import dataclass
from types import SimpleNamespace

import pytest

from ctrl_df.identify.selection.screening import _over_long_segments


@dataclass(frozen=True)
class Tried:
    key: str
    train: SimpleNamespace


def error(rmse):
    return SimpleNamespace(rmse=rmse)


@pytest.mark.parametrize(
    ("short", "long", "moved", "enough"),
    [
        # a ripple in a neighbouring minimum (nine tenths of the error), in the right one over long segments
        ({"ripple": 0.9, "spring": 0.98}, {"ripple": 0.05, "spring": 0.9}, ["ripple", "spring"], ["ripple"]),
        # nothing shows over short segments: what does over long ones is fitted there
        ({"ripple": 0.999, "spring": 1.0}, {"ripple": 0.05, "spring": 0.9}, ["ripple", "spring"], []),
        # long segments show no more
        ({"ripple": 0.9, "spring": 0.98}, {"ripple": 0.9, "spring": 1.0}, ["ripple", "spring"], []),
        # short ones are clear
        ({"ripple": 0.01, "spring": 0.98}, {"ripple": 0.01, "spring": 1.0}, [], []),
    ],
)
def test_what_explains_enough_over_long_segments_is_told(short, long, moved, enough):
    found = [Tried(k, SimpleNamespace(rmse=e, key=k)) for k, e in short.items()]
    longest = SimpleNamespace(moved=lambda train, *effort: error(long[train.key]))
    at = SimpleNamespace(segmentations=[longest], base=SimpleNamespace(train=error(1.0)))
    there, explains = _over_long_segments(at, 1.0, found)
    assert [t.key for t in there] == moved and [t.key for t in explains] == enough
