"""The course of a ladder on data of which all likelihoods are given: up, back, about, again from below."""

import math
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import pytest

import ctrl_df as cdf
from ctrl_df.identify.ladder.revision import revised
from ctrl_df.identify.ladder.several_at_once import Trials, several_at_once
from ctrl_df.identify.ladder.stepwise import StepwiseSelection
from ctrl_df.identify.ladder.structure import Structure
from ctrl_df.identify.ladder.visits import Visits
from ctrl_df.identify.monitor import Monitor
from ctrl_df.identify.results.explain import driven_to_bounds
from ctrl_df.identify.results.ladder import outcome
from ctrl_df.identify.selection.long_prediction import LongPrediction
from ctrl_df.identify.selection.search import Located, Remainder, Search, Words
from ctrl_df.identify.starting.extend import applicable, extended

MADE = {
    "coulomb": cdf.Coulomb(1.0),
    "stribeck": cdf.Stribeck(1.0, 0.1),
    "stiction": cdf.Stiction(1.0),
    "constant_force": cdf.ConstantForce(1.0),
    "asymmetric_coulomb": cdf.AsymmetricCoulomb(1.0),
    "quadratic_drag": cdf.QuadraticDrag(1.0),
    "position_ripple": cdf.PositionRipple(1.0, 0.1),
    "linear_spring": cdf.LinearSpring(1.0),
    "hysteresis": cdf.Hysteresis(1.0, 0.1),
}
"""Effects of which the data know."""


@dataclass(frozen=True, eq=False)
class Fit:
    block: Any
    level: float
    key: str = ""
    extra: int = 0
    evidence: float = 0.0
    evidence_fitted: float = 0.0
    evidence_validation: float = 0.0
    confirmed: bool = False


class Given(Search):
    """A search that knows the likelihood of every structure."""

    significant, significant_validation, measure = 20.0, 5.0, "output"
    words = Words("data", "the noise of these data", "", "an input", " It shows as {}.")

    def __init__(self, data, block, free):
        self.data, self.block, self.free = data, block, tuple(free)
        self.base = self.fitted(block, free, 0)
        data.asked.append(data.added(block))

    base: Any = None
    records = ((), ())

    def fitted(self, block, names, iterations, near=None):
        return Fit(block, self.data.level(block), block.newest if block.effects else "", len(names))

    def candidates(self, classes, executor=None, monitor=None):
        made = [self.data.made(c.id, self.block) for c in classes if applicable(c, self.block)]
        blocks = [extended(self.block, effect) for effect in made]
        found = [self.fitted(b, (), 0) for b in blocks if b is not None]
        ranked = self.ranked(self.base, [replace(t, extra=1) for t in found])
        return self.after(screened=ranked), ranked

    def based_on(self, block, fitted, free):
        return self.after(block=block, free=tuple(free), base=fitted)

    def confirm(self, found, monitor=None, clear=math.inf):
        return self, [replace(t, confirmed=True) for t in found]

    def ranked(self, base, judged):
        found = [replace(t, evidence=t.level - base.level - 3.0 * t.extra) for t in judged]
        return sorted(
            (replace(t, evidence_fitted=t.evidence / 2, evidence_validation=t.evidence / 2) for t in found),
            key=lambda t: -t.evidence,
        )

    def errors(self, judged):
        return (math.exp(-judged.level / 1000),) * 2

    def standard_errors(self, judged):
        return {}

    def determined(self, judged):
        return True

    def predicted(self, judged):
        return None

    def so_far(self, judged):
        return Remainder(0.01, 0.1 * self.unexplained(judged), False)

    def equivalent(self, a, b):
        return {a.key, b.key} in self.data.alike

    def alike(self, a, b):
        mine, its = (set(self.data.added(t.block)) for t in (a, b))
        return mine ^ its in self.data.alike

    def remainder(self, best, significant):
        return Remainder(0.01, 0.0, self.unexplained(best))

    def unexplained(self, judged):
        return judged.level < self.data.top - 50

    def located(self, best, remainder, unknown):
        return Located(None, ())


class Data:
    """Log likelihoods by the effects added, the others by those they are made of."""

    def __init__(self, levels, alike=(), start=None):
        self.levels, self.alike, self.asked = {frozenset(k.split()): v for k, v in levels.items()}, alike, []
        self.start = start or cdf.Mass(1.0)
        self.top = max(self.levels.values())
        self.records, self.validation = (), ()

    def added(self, block):
        return tuple(e.id for e in block.effects[len(self.start.effects) :])

    def made(self, id, block):
        return MADE[id]

    def level(self, block):
        if block.effects[: len(self.start.effects)] != self.start.effects:
            return -1e3  # one of the user's own is missing
        mine = frozenset(self.added(block))
        # an effect that is not spoken of does nothing
        return max(v for k, v in self.levels.items() if k <= mine)

    def search(self, block, free):
        return Given(self, block, free)


def ladder_of(data, names=tuple(MADE), most=5, monitor=None):
    def free(block):
        return [k for k, p in block.parameters.items() if p.free]

    classes = [cdf.effect_class(n) for n in names]
    monitor = monitor or Monitor("improve")
    ladder = StepwiseSelection(Visits(data, data.start, classes, free, most, None, monitor))
    return monitor.run(ladder.run, lambda: None)


def test_one_effect_and_its_neighbours():
    study = ladder_of(Data({"": 0, "linear_spring": 900, "constant_force": 300}))
    assert study.effects == ("linear_spring",) and study.verdict == "effect"
    around = {n.name: n for n in study.neighbours}
    assert around["- linear_spring"].verdict == "worse"
    assert around["- linear_spring + constant_force"].evidence == pytest.approx(-600, abs=10)
    assert around["+ coulomb"].verdict == "equal" and around["+ coulomb"].change == "add"
    assert study.neighbours.complete and "none is better" in study.summary()
    table = study.neighbours.to_pandas()
    assert len(table) == len(study.neighbours)
    assert set(table["verdict"]) <= {"better", "unconfirmed", "equal", "worse"}


def test_what_stood_in_gives_way_beside_a_later_effect():
    # one curve over speed looks like dry friction and drag together
    levels = {"": 0, "stribeck": 500, "coulomb": 400, "quadratic_drag": 300, "stribeck quadratic_drag": 800,
              "coulomb quadratic_drag": 1000}  # fmt: skip
    study = ladder_of(Data(levels))
    assert set(study.effects) == {"coulomb", "quadratic_drag"}
    last = study.steps[-1]
    assert (last.effect, last.dropped, last.instead) == ("quadratic_drag", ("stribeck",), ("coulomb",))
    assert "coulomb explains the data better than stribeck" in study.summary()


def test_the_end_is_exchanged_for_a_better_neighbour():
    # what is right beside the others was nowhere near at its own step
    levels = {"": 0, "stribeck": 500, "constant_force": 100, "coulomb": 40, "stiction": 480,
              "hysteresis": 470, "asymmetric_coulomb": 460, "stribeck constant_force": 700,
              "coulomb constant_force": 900}  # fmt: skip
    study = ladder_of(Data(levels))
    assert set(study.effects) == {"coulomb", "constant_force"}
    assert "coulomb" in study.story[0] and not study.neighbours.of("better")
    # no structure is asked about twice for what it misses
    assert study.steps[-1].diagnosis.verdict == "none"


def test_what_can_act_as_the_effect_of_the_end_begins_as_that():
    """Of its own start a spring does not come as far as the pendulum that it is over a small angle."""

    class Acting(Given):
        def acting_as(self, effect, other):
            return cdf.LinearSpring(2.0) if (effect.id, other.id) == ("linear_spring", "hysteresis") else None

    class Stiff(Data):
        def level(self, block):
            stiff = any(e == cdf.LinearSpring(2.0) for e in block.effects)
            return super().level(block) + (300 if stiff else 0)

        def search(self, block, free):
            return Acting(self, block, free)

    study = ladder_of(Stiff({"": 0, "hysteresis": 510, "linear_spring": 500, "constant_force": 50}))
    assert (
        study.effects == ("linear_spring",) and study.model.parameters["linear_spring.stiffness"].value == 2
    )


class Paired(Data):
    """Data of which the changes of the output tell which two effects go together."""

    def __init__(self, levels, *pairs, **keywords):
        super().__init__(levels, **keywords)
        self.pairs = pairs

    def search(self, block, free):
        found = Given(self, block, free)
        blocks = [extended(extended(block, MADE[a]), MADE[b]) for a, b in self.pairs if block is self.start]

        def singles(t, classes):
            more = [extended(t.block, MADE[c.id]) for c in classes if applicable(c, t.block)]
            # errors are those of `Given.errors`
            left = [(b, math.exp((t.level - self.level(b)) / 500)) for b in more if b is not None]
            return sorted(left, key=lambda f: f[1])

        return found.after(pairs=lambda classes: [(b, 0.0) for b in blocks], singles=singles)


def test_two_at_once_go_before_one_that_stands_in_for_both():
    levels = {"": 0, "hysteresis": 600, "coulomb": 100, "linear_spring": 100, "coulomb linear_spring": 1000,
              "hysteresis coulomb": 800, "stribeck linear_spring": 1001}  # fmt: skip
    data = Paired(levels, ("stribeck", "linear_spring"), ("linear_spring", "coulomb"))
    study = ladder_of(data)
    assert study.effects == ("linear_spring", "coulomb") and study.verdict == "effect"
    # nothing that stands in for them is asked what it misses, nor one of them alone
    assert data.asked == [(), study.effects]
    assert [s.signs for s in study.steps] == [(), ("+ linear_spring",), ("+ coulomb",)]
    assert study.steps[1].diagnosis is None and study.steps[2].evidence == pytest.approx(897, abs=10)
    assert "linear spring" in study.summary()


def test_what_makes_the_same_output_in_the_place_of_an_effect_is_told_however_that_was_added():
    levels = {"": 0, "hysteresis": 600, "coulomb": 100, "linear_spring": 100, "coulomb linear_spring": 1000,
              "stribeck linear_spring": 1001}  # fmt: skip
    data = Paired(levels, ("linear_spring", "coulomb"))
    data.alike = [{"coulomb", "stribeck"}]
    study = ladder_of(data)
    assert study.effects == ("linear_spring", "coulomb")
    assert [s.equivalents for s in study.steps] == [(), (), ("stribeck",)]


def test_of_two_at_once_those_count_beside_which_a_third_explains_most():
    levels = {"": 0, "hysteresis": 600, "hysteresis stribeck": 900, "coulomb linear_spring": 800,
              "coulomb linear_spring quadratic_drag": 2500}  # fmt: skip
    data = Paired(levels, ("hysteresis", "stribeck"), ("coulomb", "linear_spring"))
    study = ladder_of(data)
    right = ("coulomb", "linear_spring", "quadratic_drag")
    assert study.effects == right and study.verdict == "effect"
    assert data.asked == [(), right]
    assert [s.effect for s in study.steps] == ["", *right]
    # where a ladder may have but two
    assert len(ladder_of(Paired(levels, *data.pairs), most=2).effects) == 2


def test_what_a_third_promises_is_no_error():
    """A pair far behind was preferred to the right one for what a fit did not keep of its promise."""
    levels = {"": 0, "hysteresis": 600, "hysteresis quadratic_drag": 1500, "hysteresis stribeck": 900,
              "hysteresis stribeck linear_spring": 901, "hysteresis quadratic_drag linear_spring": 1501,
              "constant_force": 1600}  # fmt: skip
    data = Paired(levels, ("hysteresis", "stribeck"), ("hysteresis", "quadratic_drag"))
    search, asked = data.search(data.start, ()), []

    def singles(t, classes):
        asked.append(data.added(t.block))
        left = 1e-4 if "stribeck" in data.added(t.block) else 0.49
        return [(extended(t.block, MADE["linear_spring"]), left)]

    assert _several(data, search.after(singles=singles)) == {"hysteresis", "quadratic_drag"}
    assert len(asked) == 2


def _several(data, search, best="asymmetric_coulomb"):
    """Return the ids of the effects added at once beside the start, three at most; `best`: of single ones."""
    best, classes = MADE[best] if isinstance(best, str) else best, [type(e) for e in MADE.values()]
    one = extended(data.start, best)
    trials = Trials(search, lambda block: (), classes)
    found = several_at_once(Structure(data.start, 0), (), one, 0.5, trials, 3)
    return found and {e.id for e in found.structure.added}


def test_where_the_best_effect_is_among_several_the_next_is_sought_beside_it():
    """Stribeck friction and a ripple were added at once, where the second was a spring that acts slowly."""
    levels = {"": 0, "hysteresis": 600, "hysteresis stribeck": 900}
    data = Paired(levels, ("hysteresis", "stribeck"))
    search, pair = data.search(data.start, ()), {"hysteresis", "stribeck"}
    more = search.after(so_far=lambda t: Remainder(1.0, 1.0, False))
    assert _several(data, more) == pair
    assert _several(data, more, "hysteresis") is None
    # unless noise is all that they leave
    assert _several(data, search, "hysteresis") == pair
    # nor where they are three
    three = Paired(levels | {"hysteresis stribeck linear_spring": 2000}, ("hysteresis", "stribeck"))
    more = three.search(three.start, ()).after(so_far=lambda t: Remainder(1.0, 1.0, False))
    assert len(_several(three, more, "hysteresis")) == 3


@pytest.mark.parametrize(
    ("verdict", "status", "expected"),
    [("none", "complete", "effect"), ("none", "under way", "effect"), ("ambiguous", "complete", "effect"),
     ("ambiguous", "under way", "unknown"), ("unknown", "complete", "unknown")],
)  # fmt: skip
def test_what_is_missing_is_found_only_where_the_last_model_was_asked_to_the_end(verdict, status, expected):
    """A ladder whose budget was spent said `effect` while its last diagnosis saw that more is missing."""
    last = SimpleNamespace(diagnosis=SimpleNamespace(verdict=verdict, status=status))
    assert outcome([SimpleNamespace(), last]) == expected


def test_pairs_begin_with_what_they_share_with_the_best_one():
    """A gap was found beside a ripple of 9 m that stood in for the right spring, and beside that missed."""

    class Valued(Paired):
        def level(self, block):
            return super().level(block) + 500 * (found in block.effects)

    found, missed, drag, spring = (
        cdf.Hysteresis(1.0, 0.2), MADE["hysteresis"], MADE["quadratic_drag"], MADE["linear_spring"]
    )  # fmt: skip
    data = Valued({"": 0, "hysteresis quadratic_drag": 600, "hysteresis linear_spring": 700})
    pairs = [extended(extended(data.start, e), h) for e, h in ((drag, found), (spring, missed))]
    search = data.search(data.start, ()).after(so_far=lambda t: Remainder(1.0, 1.0, False))
    assert _several(data, search.after(pairs=lambda classes: [(b, 0.0) for b in pairs])) == {
        "hysteresis", "linear_spring"
    }  # fmt: skip


def test_the_best_effect_with_other_values_than_alone_is_another():
    """A ripple of a quarter of the length stood in for a Stribeck curve and the ripple that acted."""

    class Valued(Paired):
        def level(self, block):
            return super().level(block) - 100 * (alone in block.effects and len(block.effects) > 1)

    alone = cdf.PositionRipple(1.0, 0.025)
    data = Valued(
        {"": 0, "position_ripple": 600, "position_ripple stribeck": 900}, ("position_ripple", "stribeck")
    )
    more = data.search(data.start, ()).after(so_far=lambda t: Remainder(1.0, 1.0, False))
    assert _several(data, more, "position_ripple") is None
    assert _several(data, more, alone) == {"position_ripple", "stribeck"}


def test_what_a_single_effect_hides_is_sought_beside_it():
    """A Stribeck curve hides a ripple from the model without it; alone it was not the best."""
    levels = {"": 0, "linear_spring": 700, "stribeck": 600, "coulomb linear_spring": 760,
              "stribeck position_ripple": 2000}  # fmt: skip
    data = Paired(levels, ("coulomb", "linear_spring"))
    study = ladder_of(data, most=2)  # with room for three one of these might give way
    assert study.effects == ("stribeck", "position_ripple") and study.verdict == "effect"
    assert data.asked == [(), study.effects]


def test_a_third_shows_that_one_of_two_stood_in_for_it():
    """Of a ripple and drag a ripple and a saturation were found, drag beside them, and all were refused."""
    levels = {"": 0, "hysteresis": 600, "hysteresis stribeck": 900, "hysteresis stribeck linear_spring": 1801,
              "stribeck linear_spring": 1800}  # fmt: skip
    data = Paired(levels, ("hysteresis", "stribeck"))
    assert _several(data, data.search(data.start, ())) == {"stribeck", "linear_spring"}
    # it stays with the evidence that it would need to be added
    data = Paired(levels | {"hysteresis stribeck linear_spring": 1900}, ("hysteresis", "stribeck"))
    assert len(_several(data, data.search(data.start, ()))) == 3


def test_two_at_once_need_more_than_the_best_alone_and_room():
    levels = {"": 0, "hysteresis": 600, "coulomb linear_spring": 610}
    pair = ("linear_spring", "coulomb")
    assert ladder_of(Paired(levels, pair)).effects == ("hysteresis",)
    better = levels | {"coulomb linear_spring": 1000}
    assert ladder_of(Paired(better, pair), most=1).effects == ("hysteresis",)
    assert set(ladder_of(Paired(better, pair)).effects) == set(pair)
    # of two that hide each other none is significant alone
    assert set(ladder_of(Paired({"": 0, "coulomb linear_spring": 1000}, pair)).effects) == set(pair)


def test_two_at_once_are_sought_where_long_horizons_leave_none_to_be_added(monkeypatch):
    """The ladder ended with nothing, and the words that something is missing."""

    def long_prediction(ranking, base, significant):
        better = ("", "linear_spring") if ranking[0].id == "hysteresis" else ()
        errors = {ranking[0].id: 0.9, "linear_spring": 0.3, "": 0.2}
        return LongPrediction(1.0, errors, better, bool(better))

    for module in ("ladder.node", "selection.verdict"):
        monkeypatch.setattr(f"ctrl_df.identify.{module}.long_prediction", long_prediction)
    levels = {"": 0, "hysteresis": 900, "linear_spring": 15, "coulomb constant_force": 930}
    study = ladder_of(Paired(levels, ("coulomb", "constant_force")))
    assert study.steps[0].diagnosis.verdict == "ambiguous"
    assert study.effects == ("coulomb", "constant_force")


def test_what_only_a_later_effect_leaves_to_be_seen_is_exchanged_before_it_is_asked():
    # at its own step what is right is behind more than its rivals there
    levels = {"": 0, "stribeck": 500, "constant_force": 100, "coulomb": 40, "stiction": 480,
              "hysteresis": 470, "asymmetric_coulomb": 460, "stribeck constant_force": 700,
              "coulomb constant_force": 900}  # fmt: skip
    data = Data(levels)
    study = ladder_of(data)
    assert set(study.effects) == {"coulomb", "constant_force"}
    assert ("stribeck", "constant_force") not in data.asked
    assert (study.steps[-1].dropped, study.steps[-1].instead) == (("stribeck",), ("coulomb",))


def test_two_that_stood_in_for_one_are_merged():
    # a bad optimum: beside either half the right one shows what it can do, and the other half is idle
    levels = {"": 0, "constant_force": 300, "linear_spring": 200, "hysteresis": 150, "stiction": 180,
              "constant_force linear_spring": 600, "hysteresis linear_spring": 700,
              "hysteresis constant_force": 700}  # fmt: skip
    data = Data(levels)
    found = data.level

    def level(block):
        bad = data.added(block) == ("hysteresis",) and ("constant_force",) not in data.asked
        return 150 if bad else 700 if "hysteresis" in data.added(block) else found(block)

    data.level = level
    study = ladder_of(data)
    assert study.effects == ("hysteresis",)
    assert any(len(n.dropped) == 1 and n.change == "drop" for n in study.neighbours)


def test_a_step_has_to_hold_on_the_data_that_judge_it():
    class Short(Data):
        def search(self, block, free):
            # with a spring the model is judged over longer segments, where the spring explains nothing
            self.short = "linear_spring" not in self.added(block)
            return Given(self, block, free)

        def level(self, block):
            return 0.0 if not self.short else super().level(block)

    data = Short({"": 0, "linear_spring": 900})
    study = ladder_of(data)
    assert study.effects == () and study.verdict == "unknown"
    last = study.steps[-1].diagnosis
    assert last.doubts and "was not added" in last.explanation and last.explanation in study.summary()
    assert not study.neighbours.of("better")


def test_equals_are_told_by_fewer_parameters_and_plain_terms_whatever_the_order():
    levels = {"": 0, "constant_force": 500, "asymmetric_coulomb": 501, "hysteresis": 503}
    data = Data(levels, alike=[{"constant_force", "asymmetric_coulomb"}])
    for names in (tuple(MADE), tuple(reversed(MADE))):
        assert ladder_of(data, names).effects == ("constant_force",)


def test_where_something_remains_the_ladder_begins_again_from_what_was_not_followed():
    levels = {"": 0, "hysteresis": 600, "linear_spring": 500, "quadratic_drag": 100,
              "linear_spring quadratic_drag": 2000}  # fmt: skip
    study = ladder_of(Data(levels))
    assert set(study.effects) == {"linear_spring", "quadratic_drag"} and study.verdict == "effect"
    back = next(s for s in study.steps if not s.effect and s.changes)
    assert back.dropped == ("hysteresis",) and back.instead == ("linear_spring",)
    assert "The ladder went back" in study.summary()


def test_what_an_earlier_step_has_seen_is_tried_again():
    # beside dry friction the search for ripples ends at the wrong length; before, it had the right one
    class Blind(Data):
        def made(self, id, block):
            wrong = id == "position_ripple" and "coulomb" in self.added(block)
            return cdf.PositionRipple(1.0, 5.0) if wrong else MADE[id]

        def level(self, block):
            wrong = any(getattr(e, "wavelength", 0.0) == 5.0 for e in block.effects)
            return super().level(block.without_effect("position_ripple") if wrong else block)

    levels = {"": 0, "coulomb": 900, "position_ripple": 300, "coulomb position_ripple": 1500}
    study = ladder_of(Blind(levels))
    assert set(study.effects) == {"coulomb", "position_ripple"} and study.verdict == "effect"
    assert [s.effect for s in study.steps] == ["", "coulomb", "position_ripple"]


@pytest.fixture
def falling(monkeypatch):
    """Let errors fall by what evidence hardly tells from chance."""
    monkeypatch.setattr(Given, "errors", lambda self, t: (math.exp(-t.level / 100),) * 2)


@pytest.mark.usefixtures("falling")
def test_of_two_that_hide_each_other_neither_need_be_significant():
    levels = {"": 0, "coulomb": 15, "constant_force": 5, "coulomb constant_force": 900}
    study = ladder_of(Data(levels))
    assert set(study.effects) == {"coulomb", "constant_force"}


@pytest.mark.usefixtures("falling")
def test_a_better_end_is_left_by_its_own_branches():
    # two pairs of effects, of which neither shows alone
    levels = {"": 0, "coulomb": 15, "stiction": 10, "hysteresis": 8, "coulomb linear_spring": 200,
              "coulomb linear_spring constant_force": 215,
              "coulomb linear_spring constant_force quadratic_drag": 1000}  # fmt: skip
    study = ladder_of(Data(levels))
    assert set(study.effects) == {"coulomb", "linear_spring", "constant_force", "quadratic_drag"}
    # a rival added where nothing was followed has the evidence that it has over the model without it
    assert [(s.effect, s.evidence) for s in study.steps[1:3]] == [("coulomb", 12), ("linear_spring", 182)]


def test_what_predicts_better_over_long_stretches_goes_first(monkeypatch):
    # over segments hysteresis stands in for both that are missing; freely it follows nothing
    levels = {"": 0, "hysteresis": 700, "linear_spring": 500, "constant_force": 40,
              "linear_spring constant_force": 1000, "hysteresis constant_force": 720}  # fmt: skip

    def long_prediction(ranking, base, significant):
        better = ("linear_spring", "") if "linear_spring" in [c.id for c in ranking] else ()
        return LongPrediction(1.0, {"hysteresis": 0.7, "linear_spring": 0.1, "": 0.3}, better)

    monkeypatch.setattr("ctrl_df.identify.ladder.node.long_prediction", long_prediction)
    study = ladder_of(Data(levels))
    assert [s.effect for s in study.steps[1:]] == ["linear_spring", "constant_force"]
    assert set(study.effects) == {"linear_spring", "constant_force"}


def test_what_has_no_size_of_its_own_comes_after_what_has():
    """A joint against a mass at its upper bound was spring and damper at once, and nothing led back."""

    class Open(Given):
        def candidates(self, classes, executor=None, monitor=None):
            after, found = super().candidates(classes, executor, monitor)
            near = [t for t in found if t.evidence > 0.5 * found[0].evidence]  # the others are given up
            return after, near

        def undetermined(self, t):
            return ("force",) if t.key == "hysteresis" else ()

    class Bounded(Data):
        def search(self, block, free):
            return Open(self, block, free)

    levels = {"": 0, "hysteresis": 900, "linear_spring": 300, "linear_spring constant_force": 2000}
    study = ladder_of(Bounded(levels))
    assert [s.effect for s in study.steps[1:]] == ["linear_spring", "constant_force"]
    # what nothing else comes near to is where the ladder ends all the same
    for others in ({}, {"linear_spring": 300}):
        study = ladder_of(Bounded({"": 0, "hysteresis": 900, "hysteresis constant_force": 2000} | others))
        assert set(study.effects) == {"hysteresis", "constant_force"}


def test_a_bound_that_an_added_effect_comes_to_speaks_against_that_one():
    # beside viscous friction the stroke of a hysteresis shrinks to that of dry friction
    class Shrinking(Given):
        def displaced(self, candidate):
            both = {"hysteresis", "linear_spring"} == {e.id for e in candidate.block.effects}
            return ("hysteresis.stroke",) if both else ()

    class Dry(Data):
        def search(self, block, free):
            return Shrinking(self, block, free)

    levels = {"": 0, "hysteresis": 900, "hysteresis linear_spring": 1500, "hysteresis constant_force": 1000}
    study = ladder_of(Dry(levels))
    assert [s.effect for s in study.steps[1:3]] == ["hysteresis", "linear_spring"]


def test_several_of_a_kind_are_known_by_their_places():
    # names of several ripples change as soon as one of them goes
    start = cdf.Mass(1.0, [cdf.PositionRipple(2.0, 0.3)])
    data = Data({"": 0, "position_ripple": 500, "bristle": 700}, start=start)
    added = [cdf.PositionRipple(1.0, 0.1), cdf.PositionRipple(1.0, 0.2), cdf.Bristle(1e4, 10.0)]
    block = start
    for effect in added:
        block = block.with_effect(effect)
    search = Given(data, start, ("mass",))
    found = revised(Structure(block, 1, ((), (), ())), search, lambda b: ["mass"], lambda *_: [])
    assert found.dropped == ("position_ripple", "position_ripple")
    assert found.structure.block.effects == (start.effects[0], added[2])
    assert ladder_of(Data({"": 0, "position_ripple": 500}, start=start)).effects == ("position_ripple",)


def test_an_effect_is_begun_anew_beside_those_added_later():
    """Its values made up for what was missing: with them it would lose to another begun beside the last."""
    plain, right = cdf.Mass(1.0), {"backlash": 3000, "linear_spring": 2000, "compliance": 2500}

    def fitted(block, names, steps, near=None):
        known = sum(right[e.id] for e in block.effects)
        off = sum(e.id == "backlash" and e.values[0] < 1e-3 for e in block.effects)
        return SimpleNamespace(block=block, evidence=known - 2900 * off, extra=len(block.effects))

    def ranked_over(less, tried):
        return sorted(tried, key=lambda t: -t.evidence)

    search = SimpleNamespace(fitted=fitted, ranked_over=ranked_over, significant=20.0)
    gap, spring, joint = cdf.Backlash(1e-4), cdf.LinearSpring(5.0), cdf.Compliance(900.0, 2.0, 0.4)
    structure = Structure(plain.with_effect(gap).with_effect(spring), 0, ((), ()))

    def in_place(structure, place, less):
        old = structure.added[place]
        return [less.block.with_effect(e) for e in (joint, cdf.Backlash(2e-3)) if old.id != "linear_spring"]

    found = revised(structure, search, lambda block: (), in_place)
    assert found.dropped == found.instead == ()
    assert found.structure.key == ("backlash", "linear_spring")
    assert {e.values[0] for e in found.structure.added} == {2e-3, 5.0}
    # with the same values it stays what it was
    again = revised(found.structure, search, lambda block: (), in_place)
    assert again.structure == found.structure


def test_no_exchange_makes_a_second_of_what_can_be_there_once():
    # each is a rival of the other's step
    levels = {"": 0, "stribeck": 500, "quadratic_drag": 480, "quadratic_drag stribeck": 900,
              "quadratic_drag coulomb": 1000, "coulomb": 470}  # fmt: skip
    study = ladder_of(Data(levels))
    assert len(set(study.effects)) == len(study.effects) == 2


def test_what_the_user_gave_stays_and_is_told_of():
    class Idle(Data):
        def level(self, block):
            mine = frozenset(e.id for e in block.effects if e.id not in ("viscous",))
            return max(v for k, v in self.levels.items() if k <= mine)

    start = cdf.Mass(1.0, [cdf.Viscous(1.0)])
    study = ladder_of(Idle({"": 0, "linear_spring": 500}, start=start))
    own = next(n for n in study.neighbours if n.given)
    assert own.dropped == ("viscous",) and own.verdict == "equal"
    assert study.model.effects[0] == start.effects[0]
    assert "do not need viscous" in study.summary()


def test_a_longest_ladder_of_nothing():
    study = ladder_of(Data({"": 0, "linear_spring": 500}), most=0)
    assert study.effects == () and not [n for n in study.neighbours if n.change != "drop"]


@pytest.mark.parametrize("after", range(1, 12, 3))
def test_ctrl_c_keeps_the_best_so_far(after):
    heard = []

    def stop(study):
        heard.append(study)
        if len(heard) == after:
            raise KeyboardInterrupt

    data = Data({"": 0, "linear_spring": 900, "constant_force": 300, "constant_force linear_spring": 1200})
    study = ladder_of(data, monitor=Monitor("improve", False, stop, None))
    assert study.status in ("interrupted", "complete") and study.model is study.steps[-1].model
    assert study.summary() and str(study.neighbours) is not None


def test_parameters_that_a_ladder_drives_to_a_bound_are_told():
    start = cdf.friction_mass(95.0, 20.0, 240.0)
    ended = start.with_parameters({"coulomb.level": 0.0}).with_effect(cdf.Stribeck(18.0, 0.12))
    said = driven_to_bounds(ended, start)
    assert "(coulomb.level at 0 N)" in said and "velocity" not in said
    assert driven_to_bounds(start, start) == driven_to_bounds(ended, ended) == ""
