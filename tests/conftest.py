"""Machine code is made once, before the workers start; tests that take long are marked by lists.

`studies.txt` names the studies: diagnoses and refits of whole machines that vary what another test shows,
most of the examples, code of the tutorials, the demo; seconds each. `pytest` leaves them out unless they are
asked for, by name or by ``pytest -m study``.

`pytest -m "not slow"` leaves out what `slow.txt` names: tests of more than a fifth of a second of
processor, with the fixtures that they share with others. The list is made of a whole run,
``CTRL_DF_TIMES=times.txt pytest -m "study or not study"``, by ``python tests/tiers.py times.txt``.
"""

import gc
import os
from pathlib import Path

import pytest

# Threads of linear algebra wait for work in circles: beside those of the package, and with a worker on every
# processor, they took more than half of the processor time of diagnoses. Said before NumPy is loaded.
for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

if "PYTEST_XDIST_WORKER" in os.environ:
    # A worker on every processor: threads besides only wait for each other (a tenth of a diagnosis).
    os.environ.setdefault("NUMBA_NUM_THREADS", "1")

from ctrl_df.warm import is_warm, warm_up  # noqa: E402

SLOW, STUDIES = (Path(__file__).with_name(name) for name in ("slow.txt", "studies.txt"))


def pytest_sessionstart(session):
    """Compile ahead where nothing is kept of the engine as it stands."""
    if not hasattr(session.config, "workerinput") and not is_warm():
        warm_up()


def pytest_collection_modifyitems(config, items):
    """Mark the tests of the lists, those aside that are to be quick; a bare name stands for all its cases."""
    slow, studies = (set(p.read_text().split("\n")) if p.exists() else set() for p in (SLOW, STUDIES))
    slow |= studies  # whether the list of times knows them yet or not
    takes_long, left_out = set(), set()
    for item in items:
        name = item.nodeid.rpartition("tests/")[2]
        if studies & {name, name.partition("[")[0]}:
            item.add_marker(pytest.mark.study)
            left_out.add(item)
        if slow & {name, name.partition("[")[0]}:
            takes_long.add(item)
            if not item.get_closest_marker("quick"):
                item.add_marker(pytest.mark.slow)
    if left_out and not config.option.markexpr and not any("::" in arg for arg in config.args):
        config.hook.pytest_deselected(items=[i for i in items if i in left_out])
        items[:] = [i for i in items if i not in left_out]
    # first what takes long: workers that share the others end together, and one that stands for its kind in
    # the quick tier stays beside those it shares fixtures with
    items.sort(key=lambda item: item not in takes_long and item.get_closest_marker("slow") is None)


def pytest_collection_finish():
    """Look for garbage seldom, and not among what is imported: a tenth of the processor time of all tests."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 50, 100)


_shared, _open = {}, []  # what fixtures of files took [s]; those being made


@pytest.hookimpl(hookwrapper=True)
def pytest_fixture_setup(fixturedef):
    """Note what a fixture takes that several tests share, without those that it needs itself."""
    if fixturedef.scope == "function":
        yield
        return
    began = processor_time()
    _open.append(0.0)
    yield
    took = processor_time() - began
    _shared[fixturedef.baseid, fixturedef.argname] = took - _open.pop()
    if _open:
        _open[-1] += took


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_protocol(item):
    """Write how long a test took [s of processor], processes included, where that is asked.

    A second figure is what the fixtures took that it shares with others: whichever test comes first pays.
    """
    began, made = processor_time(), set(_shared)
    yield
    if times := os.environ.get("CTRL_DF_TIMES"):
        took = processor_time() - began
        needs = {key for key in _shared if key[1] in item.fixturenames and item.nodeid.startswith(key[0])}
        paid = sum(_shared[key] for key in needs - made)
        shared = sum(_shared[key] for key in needs)
        with open(times, "a") as file:
            file.write(f"{took:.3f} {took - paid + shared:.3f} {item.nodeid.rpartition('tests/')[2]}\n")


def processor_time():
    """Return what this process and those it started and waited for have taken of processors [s]."""
    return sum(os.times()[:4])
