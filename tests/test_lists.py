"""The lists of slow tests and of studies name tests that there are."""

from pathlib import Path

import pytest

HERE = Path(__file__).parent


@pytest.mark.parametrize("name", ["slow.txt", "studies.txt"])
def test_a_list_names_tests_that_there_are(name):
    named = {line.partition("[")[0] for line in (HERE / name).read_text().splitlines()}
    there = {
        f"{path.name}::{line[4:].partition('(')[0]}"
        for path in HERE.glob("test_*.py")
        for line in path.read_text().splitlines()
        if line.startswith("def test_")
    }
    assert not named - there, "delete these lines, or write the new names"
