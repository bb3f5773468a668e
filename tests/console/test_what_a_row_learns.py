"""What the parts of a row teach of an order: what repeats is learned, and nothing else."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from benchmarks.learning import MADE, job_file
from console.cli.machine import run_cut
from console.session.cut.run import plan_run
from console.session.errors import SessionError
from console.session.learning import learning
from console.session.learning.learning import TrimFolding
from console.session.learning.learning_steps import LearningOutcome, learn_from_trace
from console.session.learning.lobe_learning import LobeLearning
from console.session.learning.order_learning import LearnHow, OrderLearning
from console.session.learning.row_result import LearnedPart, LearnResult
from console.text.catalogue import load
from drivers.cutting.planning import Strategy, plan_cut
from drivers.lathe.heartbeat import cut_condition
from drivers.pmac.programs.cam_trim import MOST_TRIM_UM
from profiles.compensations.certificate import CertifiedOrder, OrderStatus
from profiles.compensations.change import OrderState
from profiles.compensations.learning import Deviation, GrownHarmonic, HarmonicFit, coefficient_of
from profiles.compensations.part_harmonics import PartHarmonics
from profiles.compensations.path import CutPath, free_state_lobe, target_path
from profiles.job import Job
from profiles.problem import Problem
from profiles.store import load_job, load_machine
from profiles.traces import Trace
from tests.console.commands import Console, JobFile
from tests.console.floor import known
from tests.tui.stage import LANGUAGES

MACHINE = load_machine("lee-2001-lathe").machine
RING = load_job("lee-2001-experiment-1").job


def part_with(sd_um: float) -> PartHarmonics:
    return cast(PartHarmonics, SimpleNamespace(sd_um=dict.fromkeys(range(1, 13), sd_um), coefficients_um={}))


def orders_after(step_um: float, how: LearnHow | None = None) -> OrderLearning:
    """Return the orders of a row whose first part has moved twice a turn by so much."""
    orders = OrderLearning(RING, MACHINE, Strategy.CAM, how or LearnHow())
    path = CutPath(target=target_path(RING), command=target_path(RING))
    moved = replace(path, target=path.target.plus({2: complex(step_um)}))
    orders.step(path, moved if step_um else path)
    return orders


def test_the_rest_of_a_large_step_is_learned_by_its_gain_though_a_trace_alone_would_not_show_it() -> None:
    """A tenth of an oval of 6 um that does not arrive is 0.6 um: below 2.45 standard errors of 0.4 um."""
    part = part_with(0.4)
    path = CutPath(target=target_path(RING), command=target_path(RING))
    assert not orders_after(0.0).teaches(2, 0.6 + 0j, part), "one part alone may show it by chance"
    orders = orders_after(6.0)
    assert orders.teaches(2, 0.6 + 0j, part)
    # P, um^2: 5 um seen with 0.41 um leave 0.17; 10 % of the step, 0.36, and 0.01 come to it. R: 0.17.
    assert orders.gain(2, 0.6 + 0j, part, path) == pytest.approx(0.75, abs=0.02), "0.54 / (0.54 + 0.17)"
    assert not orders_after(6.0, LearnHow(optimal=False)).teaches(2, 0.6 + 0j, part), "no gain weighs it there"


def test_what_is_left_of_a_lobe_is_told_apart_into_this_clamping_and_what_repeats() -> None:
    """Eleven parts of one force show the mean; a twelfth has 5 % more force: 6.1 % more of the lobe at speed."""
    learning = LobeLearning(RING, MACHINE)
    lobe_um = free_state_lobe(RING).harmonics[0].coefficient
    for factor in (*(1.0,) * 11, 1.061):
        learning.clamp(CutPath(target=target_path(RING), command=target_path(RING)), None, lambda _: 1.0 + 0j)
        learning.update_path(factor * lobe_um - lobe_um, lobe_um, 0.05)
    left = known(learning.left)
    assert left.left_um_pp == pytest.approx(0.061 * 55.0)
    assert left.own_um_pp == pytest.approx(0.061 * 55.0, rel=0.12) and left.repeats_um_pp < 0.4
    assert left.force_deviation == pytest.approx(0.05, rel=0.12)


def test_the_certificate_has_what_is_on_the_part_and_what_of_it_is_learned_apart() -> None:
    """The trim of an oval blank was at its limit: 5.5 um stay on the part, of which the table may learn 0.4."""
    orders, off = orders_after(6.0), Deviation(coefficients_um={2: 5.1 + 0j, 5: 0.9j}, sd_um=0.05)
    part = part_with(0.02)
    part.coefficients_um.update({2: 5.5 + 0j, 5: 0.8j})  # type: ignore[attr-defined]
    shown = {
        each.order: each
        for each in orders.certificate(orders.residual_orders(part, off), part, off, {}, frozenset())
    }
    oval, fifth, beyond = shown[2], shown[5], shown[orders.learned[-1] + 1]
    assert (oval.on_part_um, oval.tool_off_um, oval.left_um) == pytest.approx((5.5, 5.1, 0.4))
    assert (fifth.on_part_um, fifth.tool_off_um, fifth.left_um) == pytest.approx((0.8, 0.9, 0.8))
    assert beyond.standing is OrderStatus.NO_PROMISE and beyond.bound == beyond.bound_gain_1 > 0.95
    assert beyond.on_part_um is beyond.left_um is None, "it was not measured"


ANGLES = (0.0, 2.2, -2.0, 0.9, 3.0, -1.1)
"""Angles of an order on six parts: none is near that before it."""


class Row:
    """A row of parts, whose tool moves by `arrives` of what is known of it."""

    def __init__(self, arrives: Mapping[int, complex] | None = None) -> None:
        plan = plan_run(RING, MACHINE, Strategy.CAM, watchdog=cut_condition(MACHINE))
        self.learner = learning._Learner(plan, None, lambda *_: None, LearnHow())  # type: ignore[arg-type]
        self.arrives = arrives or {}
        self.first: CutPath | None = None
        self.shown: list[dict[int, CertifiedOrder]] = []

    def part(self, disturbed_um: Mapping[int, complex], chucked_um: Mapping[int, complex] | None = None) -> None:
        """Cut a part, and learn from it; the chuck makes more of some orders than the first path removes."""
        learner: Any = self.learner
        orders = learner._orders
        learner._path, learner._cutting = learner._lobe.clamp(learner._path, None, learner._response)
        orders.begin(learner._path, learner._watch)
        off, on_part = {}, {}
        self.first = self.first or learner._path
        for n in orders.fitted:
            moved = self.arrives.get(n, 1.0) * learner._response(n) * coefficient_of(learner._path.command, n)
            off[n] = coefficient_of(learner._path.target, n) - moved - disturbed_um.get(n, 0j)
            learned_um = coefficient_of(learner._path.target, n) - coefficient_of(self.first.target, n)
            on_part[n] = off[n] if chucked_um is None else off[n] + chucked_um.get(n, 0j) - learned_um
        seen = SimpleNamespace(mean_um=0.0, coefficients_um=on_part, sd_um=dict.fromkeys(off, 0.02))
        learner._teaching = lambda _: seen
        _, found = learner._learn_from(0j, None, Deviation(coefficients_um=off, sd_um=0.02), 1.0)
        self.shown.append({each.order: each for each in found})

    def heights_um(self, order: int) -> list[float]:
        """Return the amplitude on each part."""
        return [part[order].on_part_um or 0.0 for part in self.shown]

    def standings(self, order: int) -> list[OrderStatus]:
        return [part[order].standing for part in self.shown]


def test_what_comes_with_each_blank_is_left_as_it_comes_from_the_fourth_part_on() -> None:
    """Learned, a part has this one less the one before: 1.8 um of 1 um, which is taken for its growth."""
    row = Row()
    for angle in ANGLES:
        row.part({5: cmath.rect(1.0, angle), 4: 0.8 + 0j})
    heights = row.heights_um(5)
    assert heights == pytest.approx([1.0, 2.0 * math.sin(1.1), 1.0, 1.0, 1.0, 1.0])
    assert row.standings(5) == [OrderStatus.LEARNED, OrderStatus.GREW] + [OrderStatus.VARIES] * 4
    assert row.learner._watch.grown == ()
    assert max(row.heights_um(4)[1:]) < 0.1, "what repeats is learned"
    assert OrderStatus.VARIES not in row.standings(4)


def test_jaws_in_another_order_are_told_and_learned_from_the_part_that_shows_them() -> None:
    """An oval of 7 um lies a jaw further on from part 4 on; until then, and after it, the parts have none."""
    row, further = Row(), cmath.exp(-2j * math.pi * 2 / 3)
    for number in range(1, 7):
        row.part({}, {2: 7.0 * (further if number >= 4 else 1.0)})
    assert row.heights_um(2) == pytest.approx([7.0, 0.0, 0.0, 7.0 * math.sqrt(3.0), 0.0, 0.0], abs=0.2)
    told = [part[2].change for part in row.shown]
    assert [each is not None for each in told] == [False, False, False, True, False, False]
    assert told[3] is not None and told[3].step and told[3].part == 4
    assert set(row.standings(2)) == {OrderStatus.LEARNED}


def test_a_lobe_that_turns_with_each_part_is_met_where_it_will_be() -> None:
    """1 degree of spindle a part is 1.44 um of 27.5, which each part would keep."""
    row = Row()
    lobe_um = row.learner._path.target.harmonics[0].coefficient
    for number in range(10):
        row.part({}, {3: lobe_um * (cmath.exp(-3j * math.radians(number)) - 1.0)})
    assert row.heights_um(3)[1:3] == pytest.approx([1.44, 1.44], abs=0.05)
    assert max(row.heights_um(3)[3:]) < 0.25
    change = row.shown[-1][3].change
    assert change is not None and not change.step and change.turn_deg == pytest.approx(1.0, abs=0.1)


def test_what_varied_is_learned_again_once_it_repeats() -> None:
    row = Row()
    for angle in (*ANGLES[:3], *(0.9,) * 8):
        row.part({5: cmath.rect(1.0, angle)})
    standings = row.standings(5)
    assert standings[2] is OrderStatus.VARIES and OrderStatus.VARIES not in standings[-2:]
    assert row.heights_um(5)[-1] < 0.2


def test_an_order_that_stays_large_at_its_best_path_did_not_grow_by_learning_and_is_learned() -> None:
    """Three times the lobe: 0.15 um on the first part, and 0.9 from the second on, as the lobe became larger."""
    row = Row()
    for number in range(5):
        row.part({9: 0.9 + 0j if number else 0.15 + 0j})
    assert row.standings(9)[1:3] == [OrderStatus.GREW, OrderStatus.LEARNED]
    assert row.heights_um(9)[2] == pytest.approx(0.9), "its best path was cut again"
    assert max(row.heights_um(9)[3:]) < 0.2
    assert row.learner._watch.grown == (), "and nobody is told that its best is kept"


def test_an_order_that_learning_makes_worse_returns_to_its_best_and_stays_there() -> None:
    """The tool does 2.6 times what is known of it: a step makes -1.6 um of 1 um."""
    row = Row(arrives={5: 2.6 + 0j})
    for _ in range(6):
        row.part({5: 1.0 + 0j})
    assert row.heights_um(5) == pytest.approx([1.0, 1.6, 1.0, 1.0, 1.0, 1.0])
    assert row.standings(5) == [OrderStatus.LEARNED] + [OrderStatus.GREW] * 5


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_report_says_what_of_an_order_no_learning_removes(language: str) -> None:
    """Twice a turn it is the blank's, its trim at the limit; five times a turn what varies; the rest is small."""
    shape: dict[str, Any] = {"gain": 0.5, "factor": 0.5, "bound": 0.6, "bound_gain_1": 0.4}
    heights = ((2, 5.48, 0.37, 5.83), (4, 0.5, 0.5, 0.9), (5, 1.34, 1.34, 1.46), (7, 0.1, 0.1, 0.2))
    standings = {2: OrderStatus.LEARNED, 4: OrderStatus.LEARNED, 5: OrderStatus.VARIES, 7: OrderStatus.VARIES}
    certificate = tuple(
        CertifiedOrder(order=n, on_part_um=on, left_um=left, tool_off_um=off, standing=standings[n], **shape)
        for n, on, left, off in heights
    )
    plan: Any = SimpleNamespace(job=RING)
    part: Any = SimpleNamespace(certificate=certificate, trim_short={2: 7.1})
    none: Any = None
    of: dict[str, Any] = {"simulated": True, "figures": none, "collisions": (), "parts": (part,)}
    result = LearnResult(plan=plan, before=none, after=none, floor=none, **of)
    oval, fifth = run_cut._describe_blank_orders(result, load(language))
    assert all(figure in oval for figure in ("10.96", "11.66", "0.74", " 16 um p-p"))
    assert all(figure in fifth for figure in ("2.68", "2.92")) and " 16 um" not in fifth


def six(tmp_path: Path) -> Job:
    return load_job(str(job_file("six", tmp_path))).job


class Air:
    """Passes in air of a tool that arrives with `arrives` of what its model says, and how many there were."""

    def __init__(self, learner: learning._Learner, arrives: complex) -> None:
        self.learner, self.arrives, self.errors_um = learner, arrives, list[float]()
        self.coupled_um = dict[int, complex]()

    def __call__(self) -> HarmonicFit:
        path, learner = self.learner._path, self.learner
        error_um = {
            n: coefficient_of(path.target, n)
            - self.arrives * learner._response(n) * coefficient_of(path.command, n)
            + self.coupled_um.get(n, 0j)
            for n in learner._orders.fitted
        }
        self.errors_um.append(abs(error_um[2]))
        learner._in_air_at = path.target
        return HarmonicFit(mean_um=0.0, coefficients_um=error_um, amplitude_sd_um=0.01)


def learner_of(job: Job) -> learning._Learner:
    plan = plan_run(job, MACHINE, Strategy.CAM, watchdog=cut_condition(MACHINE))
    return learning._Learner(plan, None, lambda *_: None, LearnHow())  # type: ignore[arg-type]


def test_an_oval_that_the_chuck_makes_is_learned_in_air_and_only_that(tmp_path: Path) -> None:
    learner = learner_of(six(tmp_path))
    air = Air(learner, arrives=0.65 + 0.1j)
    learner._air_pass = air  # type: ignore[method-assign]
    learner._in_air_anew()
    assert air.errors_um == [], "nothing has moved: no pass"
    oval = {2: 14.0 + 0j}
    learner._path = replace(
        learner._path,
        target=learner._path.target.plus(oval),
        command=learner._path.command.plus({2: oval[2] / learner._response(2)}),
    )
    sixth = coefficient_of(learner._path.command, 6)
    learner._in_air_anew()
    # abs(1 - T'/T) = 0.364 a pass: 5.1 um, 1.9, 0.7; then 0.25.
    assert air.errors_um == pytest.approx([14.0 * 0.364**k for k in (1, 2, 3)], rel=0.01)
    assert air().coefficients_um[2] == pytest.approx(0.0, abs=0.3)
    assert coefficient_of(learner._path.command, 6) == pytest.approx(sixth), "the lobe is learned in the parts"
    learner._in_air_anew()
    assert len(air.errors_um) == 4, "the tool follows it: no pass more"


@pytest.mark.parametrize("stepped", [False, True])
def test_what_friction_makes_of_the_motion_after_a_step_is_learned_in_air(stepped: bool) -> None:
    """Twice a turn has another angle; 4 and 5 times a turn follow from that. Of a first step parts show them."""
    learner = learner_of(RING)
    air = Air(learner, arrives=1.0)
    air.coupled_um = {2: 4.0 + 0j, 4: 1.8 + 0j, 5: 0.6j, 3: 2.0 + 0j}
    learner._air_pass = air  # type: ignore[method-assign]
    learner._orders._states = {2: OrderState(since=3, fresh=stepped, stepped_um=12.0 + 0j)}
    learner._path = replace(learner._path, target=learner._path.target.plus({2: 12.0 + 0j}))
    learner._in_air_anew()
    left_um = {n: abs(c) for n, c in air().coefficients_um.items()}
    assert left_um[2] < 0.1 and left_um[3] == pytest.approx(2.0), "the lobe is learned in the parts"
    assert (left_um[4], left_um[5]) == pytest.approx((0.0, 0.0) if stepped else (1.8, 0.6), abs=0.05)


@pytest.mark.parametrize("jaws", [2, 3, 4, 6])
def test_a_batch_is_as_quick_with_many_jaws_and_shows_each_learned_order(jaws: int) -> None:
    """What is fetched between two polls is short: with twice the samples half as many batches trim a cut."""
    orders = OrderLearning(replace(RING, jaws=jaws), MACHINE, Strategy.CAM, LearnHow())
    assert orders.samples_a_turn <= 36
    assert orders.samples_a_turn >= 3 * max(orders.learned)
    assert orders.of_blanks == ((3,) if jaws == 2 else (2,))


@pytest.mark.long
@pytest.mark.timeout(300)
def test_with_six_jaws_the_second_is_rounder(console: Console, close: tuple[str, str], tmp_path: Path) -> None:
    """Jaw 1 makes 13.8 um of oval, more than twice the lobe; 0.90 of a path arrives, so 2.7 um p-p of it stay."""
    path = job_file("six", tmp_path)
    words = "--sim --plant realistic --seed 3 --strategy cam --learn 2 --json".split()
    first, second = console("run", str(path), *close, *words).json["passes"]
    assert first["RONt_um"] > 25.0
    assert second["RONt_um"] < 0.25 * first["RONt_um"]
    assert MADE["six"]["jaws"] == 6 and MOST_TRIM_UM < 13.8, "a trim alone could not"


def part(ront_um: float, grown: tuple[GrownHarmonic, ...] = (), tool_um: float = 0.0) -> LearnedPart:
    of: dict[str, Any] = {"grown": grown, "tool_off": Deviation(coefficients_um={2: complex(tool_um)})}
    of |= {"trim_short": {}, "clamped": None, "changes": ()}
    found: Any = SimpleNamespace(roundness=SimpleNamespace(ront_um=ront_um), **of)
    return cast(LearnedPart, found)


def row(parts: tuple[LearnedPart, ...], before_um: float = 60.0) -> LearnResult:
    none: Any = None
    of: dict[str, Any] = {"simulated": True, "after": None, "collisions": (), "parts": parts}
    before: Any = SimpleNamespace(ront_um=before_um)
    return LearnResult(plan=none, before=before, floor=none, figures=none, **of)


def said(*ront_um: float) -> list[tuple[str, str, str, str]]:
    return [(each.code, each.key, each.value, each.limit) for each in row(tuple(map(part, ront_um))).warnings]


@pytest.mark.parametrize(
    ("ront_um", "told"),
    [
        ((2.1, 1.9, 2.3), [("learning.no_gain", "3", "2.3 um", "2.1 um")]),
        ((2.1, 1.2, 1.9), [("learning.no_gain", "3", "1.9 um", "2.1 um")]),
        ((18.4, 5.0, 3.0), []),
        ((1.5, 0.9), []),
        ((4.0,), []),
    ],
)
def test_no_rounder_part_is_no_gain(ront_um: tuple[float, ...], told: list[tuple[str, str, str, str]]) -> None:
    assert said(*ront_um) == told


def test_parts_that_are_all_less_round_than_the_plain_one_are_advised_against() -> None:
    told = row(tuple(map(part, (2.4, 2.6, 2.5))), before_um=1.8).warnings
    assert [(each.code, each.value, each.limit) for each in told][-1:] == [("learning.worse", "2.4 um", "1.8 um")]
    for better in ((2.4, 2.6, 2.0), (2.4,)):
        assert "learning.worse" not in {each.code for each in row(tuple(map(part, better)), 1.8).warnings}


@pytest.mark.parametrize(("off_um", "code"), [(0.3, "learning.grew_beside"), (1.5, "learning.grew")])
def test_the_tool_is_blamed_for_an_order_that_grew_only_if_it_was_off_its_path(off_um: float, code: str) -> None:
    grown = (GrownHarmonic(order=2, best_um=0.4, grown_um=2.2),)
    told = row((part(3.0), part(2.0, grown, off_um))).warnings
    assert [(each.code, each.value) for each in told] == [(code, "2.20 um")]
    in_air = row((part(3.0, grown, off_um), part(2.0, grown, off_um))).warnings
    assert [each.code for each in in_air] == ["learning.grew"], "in air there is only the tool"


@pytest.mark.parametrize(("language", "words"), [("en", "gained nothing"), ("ko", "나아진 것이 없습니다")])
def test_it_is_said_with_both_figures(language: str, words: str) -> None:
    parts = tuple(map(part, (2.1, 2.3)))
    (problem,) = row(parts).warnings
    sentence = load(language).problem(problem)
    assert words in sentence and "2.1 um" in sentence and "2.3 um" in sentence


def test_with_three_jaws_all_of_a_trim_goes_into_the_table() -> None:
    folding = TrimFolding(3)
    assert [folding.change(2.0 + 1j, 0.5j) for _ in range(3)] == [2.0 + 1j] * 3
    assert folding.fraction == 1.0


def needs(chance: np.random.Generator, parts: int) -> list[complex]:
    """Return what parts need whose blanks are oval by 6 um at any angle, beside 1 um that repeats."""
    return [1.0 + 6.0 * complex(np.exp(2j * np.pi * chance.uniform())) for _ in range(parts)]


def trims(folding: TrimFolding, needed: list[complex]) -> list[float]:
    """Return the trim of each part, which makes up for what its table does not have."""
    table, found = 0j, []
    for need in needed:
        trim = need - table
        found.append(abs(trim))
        table += folding.change(trim, 0j)
    return found


def test_with_two_jaws_the_trim_of_a_blank_is_not_on_the_next_part() -> None:
    chance = np.random.default_rng(3)
    rows = [needs(chance, 6) for _ in range(300)]
    two = np.array([trims(TrimFolding(2), row) for row in rows])
    all_of_it = np.array([trims(TrimFolding(3), row) for row in rows])
    # A table with the whole trim before: the difference of two blanks, sqrt(2) of one; beyond 8 um for many.
    assert np.mean(all_of_it[:, 1:] > 8.0) > 0.4
    assert np.mean(two[:, 1:] > 8.0) < 0.05
    assert np.sqrt(np.mean(two[:, 1:] ** 2)) < 1.08 * 6.1


def test_with_two_jaws_what_repeats_comes_into_the_table() -> None:
    folding, table = TrimFolding(2), 0j
    for _ in range(36):
        table += folding.change(5.0 - table, 0j)
    assert table == pytest.approx(5.0 * 36 / 40)
    assert folding.fraction == pytest.approx(1 / 37)


JOB = load_job("lee-2001-experiment-1")
LATHE = load_machine("lee-2001-lathe")
ANGLE = np.arange(360.0)
OFF_UM = 2.0 * np.cos(5 * np.radians(ANGLE - 11.0)) + 1.5 * np.cos(2 * np.radians(ANGLE - 40.0))


def lesson(data: Path, strategy: str, extra: tuple[int, ...]) -> LearningOutcome:
    noise = np.random.default_rng(7).normal(0.0, 0.02, 360)
    meta = {
        "state": "free",
        "simulated": "yes",
        "direction": "spindle",
        "start_mark": "spindle index",
        "compensation": "none",
        "strategy": strategy,
        "stage": "full",
    }
    trace = Trace(angle_deg=ANGLE, deviation_um=OFF_UM + noise, meta=meta)
    date = "2001-11-30T14:05:00Z"
    return learn_from_trace(trace, JOB, LATHE, data, {}, gain=None, robust=False, date=date, extra=extra)


def refused(data: Path, strategy: str, extra: tuple[int, ...]) -> list[Problem]:
    with pytest.raises(SessionError) as caught:
        lesson(data, strategy, extra)
    return list(caught.value.problems)


def test_waves_that_are_asked_for_are_learned_and_can_be_cut(tmp_path: Path) -> None:
    found = lesson(tmp_path, "cam", (2, 5)).step
    assert {2, 5} <= set(found.learned) <= {2, 3, 5, 6, 9}
    assert found.expected_ront_um < 0.2
    path = found.next.path
    harmonics = {harmonic.lobes: harmonic for harmonic in path.target.overtones}
    assert (harmonics[5].amplitude_um, harmonics[5].phase_deg % 72.0) == pytest.approx((2.0, 11.0), abs=0.1)
    assert harmonics[2].amplitude_um == pytest.approx(1.5, abs=0.02)
    planned = plan_cut(JOB.job, LATHE.machine, Strategy.CAM, path=path).target
    assert replace(planned, along=path.target.along) == path.target
    plain = lesson(tmp_path, "cam", ()).step
    assert not {2, 5} & set(plain.learned)
    assert plain.expected_ront_um > 3.0


def test_the_command_line_asks_for_them(console: Console, tmp_path: Path) -> None:
    path = tmp_path / "part.csv"
    head = ("state: free", "simulated: yes", "direction: spindle", "start_mark: spindle index")
    cut = ("compensation: none", "strategy: cam", "stage: full")
    rows = [f"{a:g},{d:.4f}" for a, d in zip(ANGLE, OFF_UM, strict=True)]
    path.write_text("\n".join([*(f"# {line}" for line in (*head, *cut)), "angle_deg,deviation_um", *rows]))
    said = console("learn", str(path), "--job", JOB.job.name, "--extra", "2,5", "--json")
    assert (said.code, {2, 5} <= set(said.json["learned_waves"])) == (0, True)
    refused_words = console("learn", str(path), "--job", JOB.job.name, "--extra", "1")
    assert refused_words.code == 1 and "1/rev" in refused_words.err
    unused = console("learn", "--list", "--job", JOB.job.name, "--extra", "5")
    assert unused.code == 1 and "--extra" in unused.err


def test_waves_that_cannot_be_cut_are_refused(tmp_path: Path) -> None:
    assert [p.limit for p in refused(tmp_path, "pvt", (5,))] == ["--strategy cam"]
    # Once a turn is the place of the part on the gauge; 48 times a turn at 1000 rpm, 800 Hz, nothing follows.
    problems = refused(tmp_path, "cam", (1, 51, 48, 4))
    assert [p.code for p in problems] == 3 * ["learned.extra"]
    assert [p.value.partition(" ")[0] for p in problems] == ["1/rev", "51/rev", "48/rev"]


BLIND = """\
schema = 1
source = "a gauge without a mark, and a lobe 10 % larger than the job says"
[chuck]
lobe_factor = 1.1
[gauge]
start_mark = "unknown"
"""


@pytest.fixture
def ring(job_file: JobFile) -> str:
    """Experiment 1 over a few turns."""
    return str(job_file(cut_length_mm="0.5", feed_mm_per_rev="0.1"))


def test_a_blind_gauge_teaches_none(console: Console, ring: str, close: tuple[str, str], tmp_path: Path) -> None:
    plant = tmp_path / "blind.toml"
    plant.write_text(BLIND, encoding="utf-8")
    words = (*close, "--sim", "--plant", str(plant), "--seed", "4", "--strategy", "cam", "--learn", "2")
    said = console("run", ring, *words)
    assert said.code == 1
    assert "the phase of the trace is unknown" in said.err
    # The gauge has shown it on the part in front of all others: none is cut that learns.
    assert "SIM  before  " in said.out and "SIM  air  " not in said.out and "SIM  part  " not in said.out
