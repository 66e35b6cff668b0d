"""The examples in public docstrings run and print what they say; nine public names of ten have one."""

import doctest
import functools
import importlib
import inspect
import pickle
import types

import control as ct
import matplotlib.pyplot as plt
import numpy as np
import pytest

import ctrl_df as cdf
from ctrl_df.blocks import effect

# What public functions return, documented as the names that make them are.
RESULTS = {
    "simulate.response": ("EventResponse",),
    "limit_cycles.check": ("Check",),
    "identify.results.comparison": ("Comparison",),
    "identify.refit": ("Fit",),
    "identify.results.diagnosis": ("Diagnosis", "CandidateEffect"),
    "identify.results.ladder": ("Study",),
    "identify.results.neighbours": ("Neighbours",),
}
MEMBERS = {name: getattr(cdf, name) for name in sorted(set(cdf.__all__))} | {
    name: getattr(importlib.import_module(f"ctrl_df.{room}"), name)
    for room, names in RESULTS.items()
    for name in names
}
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
PARSER = doctest.DocTestParser()


def examples(name, member):
    """Return the examples of a docstring and, of a class, those of its public methods."""
    found = {name: inspect.getdoc(member) or ""}
    if inspect.isclass(member):
        for key, method in vars(member).items():
            if not key.startswith("_") and isinstance(
                method, types.FunctionType | classmethod | staticmethod
            ):
                found[f"{name}.{key}"] = inspect.getdoc(getattr(member, key)) or ""
    return {key: text for key, text in found.items() if ">>>" in text}


CASES = {key: text for name, member in MEMBERS.items() for key, text in examples(name, member).items()}


def remembered(function):
    """Return a function that answers a question put before as it did then: results are values."""
    known = []

    @functools.wraps(function)
    def answer(model, *args, **keywords):
        rest = pickle.dumps((args, keywords))
        for asked, question, result in known:
            if question == rest and asked == model:  # blocks are equal whatever their names
                return result
        known.append((model, rest, function(model, *args, **keywords)))
        return known[-1][-1]

    return answer


# several classes are shown on one diagnosis, or one ladder, of one record
REMEMBERED = {name: remembered(getattr(cdf, name)) for name in ("diagnose", "improve")}


@pytest.mark.parametrize("name", sorted(CASES))
def test_example_in_docstring(name, monkeypatch):
    for function, answer in REMEMBERED.items():
        monkeypatch.setattr(cdf, function, answer)
    monkeypatch.setattr(effect, "_LIBRARY", dict(effect._LIBRARY))  # an effect registered here ends here
    names = {"cdf": cdf, "ct": ct, "np": np, "__name__": "example"}
    said = []
    test = PARSER.get_doctest(CASES[name], names, name, None, 0)
    failed = doctest.DocTestRunner(optionflags=FLAGS, verbose=False).run(test, out=said.append).failed
    plt.close("all")
    assert not failed, "".join(said)


def test_nine_public_names_of_ten_have_an_example():
    without = [name for name, member in MEMBERS.items() if ">>>" not in (inspect.getdoc(member) or "")]
    assert len(without) <= 0.1 * len(MEMBERS), without


def test_examples_stand_in_the_last_section():
    """Where numpydoc expects them."""
    for name, text in CASES.items():
        heads = [a for a, b in zip(text.split("\n"), text.split("\n")[1:], strict=False) if set(b) == {"-"}]
        assert heads[-1] == "Examples", name
