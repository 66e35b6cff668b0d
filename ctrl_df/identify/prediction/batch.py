"""Segments of many models, run in as few calls of the engine as their states allow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Any

import numpy as np

from ...simulate.groups import grouped
from ...simulate.kernel.many import Drives
from ...simulate.runs import run_many, sampled_drives
from ...status import Status
from ..data.measurement import Measurement
from .prepared import PreparedModel
from .segments import Segments
from .sensed import POSITION
from .thresholds import STEPS_AT_LEAST, STEPS_PER_SAMPLE

Early = tuple[float, Status]
"""When a run ended that did not reach its end [s], and how."""

Input = tuple[np.ndarray, np.ndarray]
"""Times and values."""

_KEPT = 8
"""Schedules that are kept."""


def most_steps(samples):
    """Return how many steps a run over so many samples may take; an integer, or an array of them."""
    return STEPS_PER_SAMPLE * samples + STEPS_AT_LEAST


@dataclass(frozen=True)
class Course:
    """A model over some segments of a record.

    Attributes
    ----------
    part : PreparedModel
    segments : Segments
    begin : (nw, nx) array
        States in which they begin.
    inputs, drive : list of (time, value), (nw,) integers
        What drives them, and which of these drives which.
    hidden : (nx, nx) array or None
        Projection on the states that go on from one into the next.
    """

    part: PreparedModel
    segments: Segments
    begin: np.ndarray
    inputs: list[Input]
    drive: np.ndarray
    hidden: np.ndarray | None = None

    @property
    def kind(self) -> tuple:
        """What courses share that can run in one call."""
        part, hidden = self.part, self.hidden
        told = None if hidden is None else hidden.tobytes()
        return part.engine.nstates, len(part.drive_time), part.hold, told


@dataclass(frozen=True)
class _Schedule:
    """When the segments of some courses run, and when they are read.

    Attributes
    ----------
    segments : list of Segments
        Those of each course, kept as long as this is.
    rows, samples : list of (n,) integers, list of (begin, end)
        Which of all runs are a course's, and which of all samples.
    length, since : (runs,) arrays
        Samples of each run, and when it begins [s].
    followed : tuple
        Which runs another follows, and when that begins [s].
    readings : list of (columns, times, first)
        Outputs read together, when (nt,) [s], and where in these each run begins.
    """

    segments: list[Segments]
    rows: list[np.ndarray]
    samples: list[tuple[int, int]]
    length: np.ndarray
    since: np.ndarray
    followed: tuple[np.ndarray, Any]
    readings: list[tuple[tuple[int, ...], np.ndarray, np.ndarray]]


class Batch:
    """Courses over one record, many at once.

    Parameters
    ----------
    record : Measurement
    columns : tuple of int
        Which states of the model are its outputs.
    rtol : float
        Relative tolerance of the engine.
    """

    def __init__(self, record: Measurement, columns: tuple[int, ...], rtol: float):
        self.record, self.columns, self.rtol = record, columns, rtol
        self._kept_drives: Any = (), None
        self._schedules: dict[tuple, _Schedule] = {}

    def outputs(self, courses: Sequence[Course]) -> tuple[list[np.ndarray], list[Early]]:
        """Return the outputs of every course at its samples, one output after the other, (n,) each.

        With them the runs that did not reach their end.
        """
        found: list[np.ndarray] = [np.empty(0)] * len(courses)
        early: list[Early] = []
        kinds = [course.kind for course in courses]
        for kind in dict.fromkeys(kinds):
            which = [i for i, k in enumerate(kinds) if k == kind]
            outputs, some = self._alike([courses[i] for i in which])
            early += some
            for i, out in zip(which, outputs, strict=True):
                found[i] = out
        return found, early

    def ends(self, course: Course, stop: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the states (nw, nx) in which segments come to samples `stop` (nw,), and whether they do."""
        segments, runs = course.segments, np.arange(len(course.segments))
        times = self.record.t[np.column_stack((segments.first, stop))] - course.part.late
        drives = _Inputs()
        drive = drives.numbers(course)
        result = run_many(
            grouped([(course.part.engine, runs)]), course.begin, times[:, 0], times[:, 1], times.ravel(),
            self._sampled(drives, course.part.hold), drive=drive, first=2 * runs, count=2, order=5,
            rtol=self.rtol, max_steps=most_steps(segments.stop - segments.first),
        )  # fmt: skip
        for error in result.errors.values():
            raise error
        return result.x, np.array([status.ok for status in result.status])

    def _alike(self, courses: Sequence[Course]) -> tuple[list[np.ndarray], list[Early]]:
        """Run all segments of courses of one kind; hidden states go on."""
        early: list[Early] = []
        parts, hidden = [c.part for c in courses], courses[0].hidden
        plan = self._schedule(courses)
        drives = _Inputs()
        drive = joined([drives.numbers(c) for c in courses])
        begin = joined([c.begin for c in courses])
        groups = grouped([(p.engine, rows) for p, rows in zip(parts, plan.rows, strict=True)])
        sampled, outputs, result = self._sampled(drives, parts[0].hold), {}, None
        which, until = plan.followed
        for columns, times, first in plan.readings:
            if hidden is not None and result is not None:
                # what is read beside it begins where that has begun
                on = which[[result.status[i].ok for i in which]]
                begin = begin.copy()
                begin[on + 1] += (result.x[on] - begin[on + 1]) @ hidden.T
                which, until = which[:0], 0.0
            after, end = np.full(len(plan.length), -1), times[first + plan.length - 1]
            after[which + 1], end[which] = which, until
            result = run_many(
                groups, begin, plan.since, end, times, sampled, drive=drive, first=first, count=plan.length,
                order=5, rtol=self.rtol, max_steps=most_steps(plan.length), after=after, hidden=hidden,
            )  # fmt: skip
            for error in result.errors.values():
                raise error
            for i in (result.recorded < plan.length).nonzero()[0]:
                early.append((float(result.time[i]), result.status[i]))
            outputs |= {column: result.outputs[:, column] for column in columns}
        return [joined([outputs[c][i:j] for c in self.columns]) for i, j in plan.samples], early

    def _schedule(self, courses: Sequence[Course]) -> _Schedule:
        """Return when segments run and are read: the same for all parameters; the latest are kept."""
        follow = courses[0].hidden is not None
        key = follow, *((id(c.segments), c.part.delay, c.part.late) for c in courses)
        known = self._schedules.get(key)
        if known is None:
            if len(self._schedules) >= _KEPT:
                self._schedules.pop(next(iter(self._schedules)), None)
            known = self._schedules[key] = self._scheduled(courses, follow)
        return known

    def _scheduled(self, courses: Sequence[Course], follow: bool) -> _Schedule:
        segments, delays = [c.segments for c in courses], [c.part.delay for c in courses]
        runs = [0, *accumulate(len(w) for w in segments)]
        return _Schedule(
            segments=segments,
            rows=[np.arange(i, j) for i, j in pairwise(runs)],
            length=joined([w.counts for w in segments]),
            since=joined([self.record.t[c.segments.first] - c.part.late for c in courses]),
            followed=self._followed(courses) if follow else (np.zeros(0, int), 0.0),
            readings=[(columns, *self._instants(segments, d)) for columns, d in self._readings(delays)],
            samples=list(pairwise([0, *accumulate(len(w.samples) for w in segments)])),
        )

    def _instants(self, segments: Sequence[Segments], delays) -> tuple[np.ndarray, np.ndarray]:
        """Return the times (nt,) at which outputs are read, each once, and where segments begin in them."""
        times, first, known, count = [], [], {}, 0
        for some, delay in zip(segments, delays, strict=True):
            key = id(some), delay
            if key not in known:
                known[key] = count
                times.append(self.record.t[some.samples] - delay)
                count += len(times[-1])
            first.append(known[key] + some.begins[: len(some)])
        return joined(times), joined(first)

    def _followed(self, courses: Sequence[Course]) -> tuple[np.ndarray, np.ndarray]:
        """Return which of all segments another goes on from, and when [s]."""
        which, begin, at = [], [], 0
        for course in courses:
            segments = course.segments
            w = np.flatnonzero(segments.follow[1:])
            which.append(at + w)
            begin.append(self.record.t[segments.first[w + 1]] - course.part.late)
            at += len(segments)
        return np.concatenate(which), np.concatenate(begin)

    def _readings(self, delays) -> list[tuple[tuple[int, ...], list[float]]]:
        """Return outputs that are read at the same instants, and how long after these they are seen [s].

        Sensors that delay are of the position: those that segments begin with come first.
        """
        columns, none = self.columns, [0.0] * len(delays)
        if not any(delays):
            return [(columns, none)]
        return [
            ((c,), delays if c == POSITION else none) for c in sorted(columns, key=lambda c: c != POSITION)
        ]

    def _sampled(self, drives: _Inputs, hold: str) -> Drives:
        """Return what drives these, as the engine takes it; the last is kept, mostly asked for again."""
        inputs = tuple(array for pair in drives.pairs for array in pair)
        kept, sampled = self._kept_drives
        if len(kept) != len(inputs) or any(a is not b for a, b in zip(kept, inputs, strict=True)):
            sampled = sampled_drives(
                np.array(inputs[::2]),
                np.array(inputs[1::2])[:, None],
                hold or self.record.input_hold,
            )
            self._kept_drives = inputs, sampled
        return sampled


class _Inputs:
    """Inputs, each pair of arrays once: they are shared by segments and by models."""

    def __init__(self):
        self.pairs: list[Input] = []
        self._known: dict[tuple[int, int], int] = {}

    def numbers(self, course: Course) -> np.ndarray:
        """Return which inputs drive the segments of a course (nw,); those that are new are kept."""
        return np.array([self._add(*pair) for pair in course.inputs])[course.drive]

    def _add(self, time: np.ndarray, value: np.ndarray) -> int:
        number = self._known.setdefault((id(time), id(value)), len(self.pairs))
        if number == len(self.pairs):
            self.pairs.append((time, value))
        return number


def joined(arrays: Sequence[np.ndarray]) -> np.ndarray:
    """Return arrays one after the other; a single one as it is."""
    return arrays[0] if len(arrays) == 1 else np.concatenate(arrays)
