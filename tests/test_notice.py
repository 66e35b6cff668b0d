"""Whoever waits for machine code is told what for; nobody is told of what takes no time."""

import time
from types import SimpleNamespace

from ctrl_df.simulate.compiler import notice


def _compile(seconds, listener, inner=None):
    event = SimpleNamespace(data={"dispatcher": SimpleNamespace(py_func=_compile, known=True)})
    listener.on_start(event)
    time.sleep(seconds)
    if inner:
        inner()
    listener.on_end(event)


def test_long_compilations_are_told_with_their_time(monkeypatch, capsys):
    monkeypatch.setattr(notice, "PATIENCE", 0.02)
    listener = notice.Notice(lambda made: made.known)
    _compile(0.2, listener)
    said = capsys.readouterr()
    assert not said.out
    assert "_compile ..." in said.err and "_compile compiled in 0 s" in said.err


def test_short_and_foreign_ones_are_not(monkeypatch, capsys):
    monkeypatch.setattr(notice, "PATIENCE", 5.0)
    _compile(0.0, notice.Notice(lambda made: True))
    monkeypatch.setattr(notice, "PATIENCE", 0.01)
    _compile(0.1, notice.Notice(lambda made: False))
    time.sleep(0.05)
    assert capsys.readouterr().err == ""


def test_functions_compiled_within_each_other(monkeypatch, capsys):
    monkeypatch.setattr(notice, "PATIENCE", 0.05)
    listener = notice.Notice(lambda made: made.known)
    _compile(0.1, listener, lambda: _compile(0.0, listener))
    assert capsys.readouterr().err.count("compiled in") == 1
