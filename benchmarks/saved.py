"""Benchmarks that go on where their file ends: numbers of rigs on the command line, one row a rig."""

from __future__ import annotations

import argparse
import json
from pathlib import Path


def numbers(text: str) -> range:
    """Return the rigs of ``3`` or ``3:8`` (the last one left out)."""
    low, _, high = text.partition(":")
    return range(int(low), int(high)) if high else range(int(low), int(low) + 1)


def parser_of(description: str, kinds) -> argparse.ArgumentParser:
    """Return a parser that asks for rigs of every kind, and for the file of their rows."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawTextHelpFormatter)
    for kind in kinds:
        parser.add_argument(f"--{kind}", type=numbers, default=range(0), metavar="FIRST:END")
    parser.add_argument("--save", required=True)
    parser.add_argument("--table", action="store_true")
    return parser


def rows_of(path: Path) -> list[dict]:
    """Return the rows of a file, none where there is no such file."""
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def add_row(path: Path, row: dict) -> None:
    """Append a row to a file."""
    with path.open("a") as file:
        file.write(json.dumps(row) + "\n")
