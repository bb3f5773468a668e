"""What the controller must report before a cut starts; a cut that the operator holds and resumes."""

from __future__ import annotations

import itertools
import sqlite3
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from console.session.cut.interlocks import of_machine
from console.session.station.commands import Command, EndCut, HoldFeed, Measure, Recover, ResumeFeed, Start
from console.session.station.progress import CutProgress, CutStage
from console.session.station.state import Activity, StationState
from drivers.cutting.planning import CutPlan, Strategy, plan_cut
from drivers.errors import LinkError
from drivers.lathe.snapshot import AxisName, AxisState, Snapshot
from profiles.problem import Problem
from tests.compact import compact_machine
from tests.console.floor import Floor, codes, experiment_1, in_turn, open_floor, order

READY = frozenset(
    {"activated", "amplifier_enabled", "home_complete", "desired_velocity_zero", "in_position"},
)
MACHINE = compact_machine().machine


@cache
def plan() -> CutPlan:
    return plan_cut(experiment_1(1.0), MACHINE, Strategy.PVT)


def axis(position: float, flags: frozenset[str] = READY, lag: float = 0.0) -> AxisState:
    return AxisState(position=position, following_error=lag, flags=flags)


def at_start(**axes: AxisState) -> Snapshot:
    still = {
        "tool": axis(plan().tool_start),
        "spindle": axis(plan().spindle_start),
        "carriage": axis(plan().carriage_start),
    } | axes
    return Snapshot(
        asked_s=0.0,
        at_s=0.0,
        program_running=False,
        runtime_error=False,
        tool=still["tool"],
        spindle=still["spindle"],
        carriage=still["carriage"],
    )


def problems(snapshot: Snapshot) -> list[Problem]:
    return list(of_machine(snapshot, plan(), MACHINE))


def test_a_machine_at_its_start_may_cut() -> None:
    assert problems(at_start()) == []


@pytest.mark.parametrize("name", list(AxisName))
@pytest.mark.parametrize("off", [11.0, -11.0])
def test_an_axis_that_is_not_at_its_start_is_named_with_both_places(name: AxisName, off: float) -> None:
    (told,) = problems(at_start(**{name.value: axis(at_start().axis(name).position + off)}))
    assert (told.code, told.key) == ("machine.not_at_start", name)
    assert told.value and told.limit and told.value != told.limit


def test_ten_counts_are_near_enough_and_a_lag_does_not_count() -> None:
    """2 um of the tool; where it is commanded to be is where its program goes on from."""
    start = plan().tool_start
    assert problems(at_start(tool=axis(start + 10.0))) == []
    assert problems(at_start(tool=axis(start - 40.0, lag=40.0))) == []


@pytest.mark.parametrize(
    ("flags", "code"),
    [
        (READY - {"home_complete"}, "machine.not_homed"),
        (READY - {"amplifier_enabled"} | {"open_loop"}, "machine.not_enabled"),
        (READY - {"desired_velocity_zero"}, "machine.moving"),
        (READY | {"fatal_following_error"}, "machine.fault"),
    ],
)
@pytest.mark.parametrize("name", list(AxisName))
def test_what_the_controller_reports_forbids_the_cut(name: AxisName, flags: frozenset[str], code: str) -> None:
    changed = at_start(**{name.value: replace(at_start().axis(name), flags=flags)})
    assert code in [told.code for told in problems(changed)]


def held(
    floor: Floor, then: Callable[[], None], strategy: Strategy = Strategy.PVT, turn: float = 10.0
) -> StationState:
    """Arm and start a cut, hold it in its tenth turn, and do something half a second after it is held."""
    floor.arm(experiment_1(), strategy)
    assert floor.state.armed is not None, floor.state.refusals
    floor.when(lambda _: in_turn(floor, turn), lambda: order(floor, HoldFeed()))
    since: list[float] = []

    def long_held(_: object) -> bool:
        if floor.state.paused:
            since.append(floor.sim.now_s())
        return bool(since) and floor.sim.now_s() > since[0] + 0.5

    floor.when(long_held, then)
    return floor.do(Start())


@pytest.mark.first(1)
@pytest.mark.parametrize("strategy", [Strategy.PVT, Strategy.CAM, Strategy.TIMEBASE])
def test_a_held_cut_is_as_good_as_any(aligned: Floor, strategy: Strategy) -> None:
    seen: list[CutProgress] = []
    aligned.looks.append(lambda _: seen.append(aligned.state.cut) if aligned.state.cut else None)
    state = held(aligned, lambda: order(aligned, ResumeFeed()), strategy)
    assert state.cut_done and codes(state) == [] and state.refusals == ()
    cut = state.cut
    assert cut is not None and cut.figures is not None
    assert (cut.turn, cut.fraction) == (30.0, 1.0)
    # What the tool did outside is no error of the cut, and no phase that was lost.
    assert cut.tool_error_peak_um < 3.0 and cut.figures.tool_error_um < 3.0
    (held_at_mm,) = cut.holds_mm
    assert held_at_mm == pytest.approx(0.55, abs=0.06)
    stages = [moment.stage for moment in seen]
    assert stages.index(CutStage.CUT) < stages.index(CutStage.PAUSED)
    assert {moment.in_phase for moment in seen if moment.stage is CutStage.PAUSED} <= {True, None}
    left_s = [moment.held_left_s for moment in seen if moment.held_left_s is not None]
    assert left_s[0] == pytest.approx(600.0, abs=0.2) and left_s == sorted(left_s, reverse=True)
    aligned.do(Measure())
    measured = aligned.state.measured
    assert measured is not None and measured.result.ront_um < 2.0


@pytest.mark.long
def test_one_turn_after_the_other_may_be_cut(aligned: Floor) -> None:
    turns: list[float] = []

    def next_turn(_: object) -> None:
        cut = aligned.state.cut
        if cut is None or not aligned.state.paused or (turns and cut.turn < turns[-1] + 0.5):
            return
        turns.append(cut.turn)
        order(aligned, ResumeFeed(one_turn=len(turns) < 3))

    aligned.arm(experiment_1())
    aligned.when(lambda _: in_turn(aligned, 10.0), lambda: order(aligned, HoldFeed()))
    aligned.looks.append(next_turn)
    state = aligned.do(Start())
    assert state.cut_done and codes(state) == []
    assert [b - a for a, b in itertools.pairwise(turns)] == pytest.approx([1.0, 1.0], abs=0.01)


def test_f7_ends_a_held_cut_with_the_tool_out_and_a_stop_leaves_no_mark_and_is_not_resumed(aligned: Floor) -> None:
    state = held(aligned, lambda: order(aligned, EndCut()))
    assert state.activity is Activity.READY and codes(state) == []
    assert state.cut is not None and state.cut.stage is CutStage.HELD and not state.cut_done
    assert state.snapshot is not None and state.snapshot.at_rest
    aligned.looks.clear()
    state = held(aligned, lambda: aligned.stop.stop("space"))
    assert state.activity is Activity.STOPPED and state.stop is not None
    assert (state.stop.tool_in_part, state.stop.mark_mm, state.marks_mm) == (False, None, ())
    assert not aligned.station.post(ResumeFeed())
    aligned.do(Recover())
    before = aligned.idle().snapshot
    assert not aligned.station.post(ResumeFeed())
    after = aligned.idle(1.0).snapshot
    assert before is not None and after is not None and after.still(before, 100.0)


def test_a_link_that_is_lost_while_held_brings_nothing_in(aligned: Floor, monkeypatch: pytest.MonkeyPatch) -> None:
    def lose() -> None:
        def fails(*_: object) -> bytes:
            raise LinkError(Problem(code="link.lost"))

        monkeypatch.setattr(aligned.link, "receive", fails)
        monkeypatch.setattr(aligned.link, "send", fails)

    state = held(aligned, lose)
    assert state.activity is Activity.LOST and "link.lost" in codes(state)
    assert not aligned.station.post(ResumeFeed())
    tool = aligned.sim.controller.motors[1]
    aligned.sim.wait(2.0)
    assert aligned.context.plan is not None
    assert tool.actual < aligned.context.plan.setup.retracted + 500


def test_a_hold_that_cannot_be_is_refused_with_the_reason(aligned: Floor) -> None:
    found: list[str] = []

    def ask(command: Command) -> Callable[[], None]:
        def act() -> None:
            assert not aligned.station.post(command)
            found.extend(problem.code for problem in aligned.state.refusals)

        return act

    assert not aligned.station.post(HoldFeed())
    assert [problem.code for problem in aligned.state.refusals] == ["session.nothing_to_hold"]
    aligned.arm(experiment_1(), Strategy.PAPER)
    aligned.when(lambda _: in_turn(aligned, 3.0), ask(HoldFeed()))
    aligned.when(lambda _: in_turn(aligned, 4.0), ask(ResumeFeed()))
    aligned.do(Start())
    assert found == ["cut.no_hold", "cut.not_held"]


@pytest.mark.long
def test_the_record_has_the_hold_and_who_asked(aligned: Floor) -> None:
    held(aligned, lambda: order(aligned, ResumeFeed()))
    aligned.station.close("quit")
    with sqlite3.connect(aligned.context.records / "records.sqlite3") as record:
        rows = record.execute("SELECT kind FROM events ORDER BY number").fetchall()
    kinds = [kind for (kind,) in rows if kind in ("started", "feed_hold", "resumed", "held_at", "cut")]
    assert kinds == ["started", "feed_hold", "resumed", "held_at", "cut"]


@pytest.mark.long
@pytest.mark.first(1)
@pytest.mark.parametrize(("seed", "strategy"), [(11, Strategy.PVT), (2, Strategy.CAM)])
def test_a_held_cut_is_not_called_disturbed(tmp_path: Path, seed: int, strategy: Strategy) -> None:
    """Back in the part the tool is deflected less until the chip is full: that is no other host's doing.

    Nor is a cut outside its plan that ends at another segment than planned: of `cam` one is 48 degrees here.
    """
    floor = open_floor(tmp_path, seed, "steady")
    floor.set_up(experiment_1())
    state = held(floor, lambda: order(floor, ResumeFeed()), strategy)
    assert state.cut_done and codes(state) == []


@pytest.mark.long
def test_a_hold_in_the_last_turn_comes_too_late_and_raises_no_alarm(tmp_path: Path) -> None:
    """The cut is done: the spindle that comes to rest then is no spindle that stands in the part."""
    floor = open_floor(tmp_path, 6, "steady")
    floor.set_up(experiment_1())
    seen: list[CutProgress] = []
    floor.looks.append(lambda _: seen.append(floor.state.cut) if floor.state.cut else None)
    state = held(floor, lambda: order(floor, ResumeFeed()), Strategy.CAM, 28.5)
    assert any(moment.hold.asked for moment in seen)
    assert state.cut_done and codes(state) == []
    assert next(moment.turn for moment in seen if moment.stage is CutStage.RETRACT) == 30.0
