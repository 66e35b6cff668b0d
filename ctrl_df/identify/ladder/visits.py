"""The models that a ladder visits: each is refitted, and diagnosed once."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ...simulate.parallel import side_by_side
from ..monitor import UNDER_WAY, Monitor
from ..results.diagnosis import Diagnosis
from ..results.ladder import Step, Study, last_diagnosis, outcome
from ..results.neighbours import Neighbours
from ..selection.search import Search
from ..selection.thresholds import REFUTED_MOST, STOPPED_EARLY
from ..selection.verdict import Diagnosed, diagnosed
from ..thresholds import ONLY_NOISE
from .node import Node
from .steps import step_of, with_model
from .structure import Structure
from .thresholds import STEPS_COMPARED


class Visits:
    """The models visited, and how others are.

    Parameters
    ----------
    dataset : Dataset
    start : Mechanism
    classes : sequence of effect classes
        Candidates; what is found does not depend on their order.
    free : callable
        Parameters of a block that may be refitted.
    max_effects : int
        Most effects added.
    executor : concurrent.futures.Executor or None
    monitor : Monitor
        Receives the `Study` as it stands.
    """

    def __init__(self, dataset, start, classes, free: Callable, max_effects: int, executor, monitor: Monitor):
        self.dataset, self.free, self.executor, self.monitor = dataset, free, executor, monitor
        self.classes = sorted(dict.fromkeys(classes), key=lambda c: c.id)
        self.max_effects = max_effects
        self.start = Structure(start, len(start.effects))
        self._nodes: dict[tuple[str, ...], Node] = {}
        self._sharpened: list[tuple[Any, Any]] = []  # the last model under way, and what is reported of it

    def __contains__(self, key: tuple[str, ...]) -> bool:
        """Whether the structure of a key has been visited."""
        return key in self._nodes

    def node(self, structure: Structure) -> Node | None:
        """Return the node of a structure; None where it has not been visited."""
        return self._nodes.get(structure.key)

    def keep(self, node: Node) -> Node:
        """Remember a node, in place of the one before of the same structure."""
        self._nodes[node.structure.key] = node
        return node

    def visit(
        self,
        structure: Structure,
        parent: Node | None,
        how: dict,
        step: Step | None = None,
        best: Study | None = None,
        between: tuple[Step, ...] = (),
    ) -> Node:
        """Refit a structure and diagnose what it misses.

        `step`: reported until that is known; `best`: reported meanwhile in its place, where a better model is
        known; `between`: steps that lead to it from the parent.
        """
        steps = (*(parent.steps if parent else ()), *between)
        self.monitor.stage(f"step {len(steps)}: the model refitted")
        search = self.dataset.search(structure.block, self.free(structure.block))
        if parent is not None:
            search = search.following(parent.search)
        last = step or (steps[-1] if steps else None)

        def last_step(found: Diagnosis) -> Step:
            errors = found.nrmse, found.nrmse_holdout
            if last is not None and not math.isfinite(errors[1]):  # not tried on what is held out yet
                errors = last.nrmse, last.nrmse_holdout
            return step_of(found, found.model, errors, how)

        def standing(known: Diagnosed) -> tuple[tuple[Step, ...], Search]:
            found = known.diagnosis
            if parent is not None and found.measure != parent.diagnosis.measure:
                # not over the same data yet: errors of the steps before are of something else
                return (*steps, step) if step else steps, parent.search
            return (*steps, last_step(found)), known.search

        def so_far(known: Diagnosed) -> Study:
            return best or self._under_way(*standing(known))

        def at_once(known: Diagnosed) -> Study:
            return best or self.study(*standing(known), UNDER_WAY)

        room = len(structure.added) < self.max_effects

        def searched(without: frozenset[str] = frozenset(), set_aside=()) -> tuple[Node, frozenset[str]]:
            classes = [c for c in self.classes if c.id not in without] if room else []
            part = self.monitor.within(so_far, at_once)
            known = diagnosed(search, classes, self.executor, part, clear=STOPPED_EARLY)
            found = known.diagnosis
            at = structure.at(found.model)
            node = Node(at, known.search, found, (*steps, last_step(found)), parent, set_aside=set_aside)
            return node, without.union(known.refuted)

        node = self._firmly(searched)
        self.monitor.stage("all models over the same data")
        node = replace(node, steps=self._on_common_data(node.steps, node.search))
        if best is None:
            self.publish(node.steps, node.search)
        return self.keep(node)

    def _firmly(self, searched: Callable[..., tuple[Node, frozenset[str]]]) -> Node:
        """Return a node whose next effect is of a size that the data determine, where one explains anything.

        Hidden states and a parameter of the model at its bound may stand in for several effects at once: a
        joint against a motor mass too large to move is a spring and a damper, of no size of its own. Such a
        candidate errs so much less than any single one of them that these are given up, and no later step
        leads back. The search is therefore repeated without it, and takes smaller steps; it remains an
        alternative.

        `searched`: ``searched(without, set_aside)``, the node as a search without these ids finds it, and all
        ids that another search can do without.
        """
        node, without = searched()
        first, aside = node, ()
        while (best := node.next) is not None and best.size_undetermined:
            if len(aside) == REFUTED_MOST:
                return first
            aside = (*aside, best)
            self.monitor.stage(f"the search repeated without {best.id.replace('_', ' ')}: provisional")
            node, without = searched(without | {best.id}, aside)
        return first if node.next is None else node

    def _on_common_data(self, steps: tuple[Step, ...], search: Search) -> tuple[Step, ...]:
        """Return steps with the errors of their models over the data on which the last one is validated."""
        again = search.final([s.model for s in steps], self.free)
        if again is None:
            return steps
        return tuple(with_model(s, *errors) for s, errors in zip(steps, again, strict=True))

    # --- comparison -------------------------------------------------------------------------------------

    def beats(self, block, end, search: Search) -> bool:
        """Whether a model is better than another on the data of a search, and no worse on those held out."""
        evidence, held_out = self.compared(block, end, search)
        return evidence > search.significant and not held_out[0] > ONLY_NOISE * held_out[1]

    def compared(self, block, other, search: Search) -> tuple[float, tuple[float, float]]:
        """Return the evidence for a model over another on the data of a search, and both errors held out."""
        old, new = side_by_side(lambda b: search.fitted(b, self.free(b), STEPS_COMPARED), (other, block))
        ranked = search.ranked_over(old, [new])[0]
        return ranked.evidence, (search.errors(new)[1], search.errors(old)[1])

    # --- reporting --------------------------------------------------------------------------------------

    def publish(self, steps, search: Search, neighbours: Neighbours | None = None) -> None:
        """Report the ladder as it stands."""
        self.monitor.known(self.study(steps, search, UNDER_WAY, neighbours))

    def publish_begun(self, steps, search: Search) -> None:
        """Report the ladder as it stands, of whose last step no diagnosis is known."""
        self.monitor.within(
            lambda begun: self._under_way(begun, search),
            lambda begun: self.study(begun, search, UNDER_WAY),
        ).known(steps)

    def _under_way(self, steps, search: Search) -> Study:
        """Return the ladder as it stands while its last step is under way, with final parameters."""
        *before, last = steps
        if all(last.model is not model for model, _ in self._sharpened):
            self._sharpened[:] = [(last.model, search.sharpened(last.model, self.free))]
        ((_, found),) = self._sharpened
        last = with_model(last, found, last.nrmse, last.nrmse_holdout)
        return self.study((*before, last), search, UNDER_WAY)

    def study(self, steps, search: Search, status: str, neighbours: Neighbours | None = None) -> Study:
        """Return the ladder that has ended, or stands, with these steps."""
        # the diagnosis known last may be of an earlier step: what errs less has no more noise
        noise = min(search.relative(last_diagnosis(steps).noise), steps[-1].nrmse)
        return Study(
            tuple(steps), steps[-1].model, outcome(steps), noise,
            self.start.block, self.dataset.records, self.dataset.validation, self.monitor.seconds, status,
            neighbours or Neighbours(complete=False),
        )  # fmt: skip
