"""What an instructor may type: an order, or a refusal that names what is possible; nothing else."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.cli.commands import build
from console.school.instructing.dispatcher import MOST_CHECKPOINTS, CarryOut
from console.school.instructing.mailbox import InstructorAct, Mailbox
from console.school.instructing.order import (
    FASTEST,
    SLOWEST,
    OrderKind,
    OrderReply,
    encode_answer,
    read_answer,
    read_order,
)
from console.school.training.debrief import reactions
from console.school.training.happenings import HappeningKind
from console.session.errors import SessionError
from console.session.station.commands import (
    Acknowledge,
    Arm,
    Command,
    ConfirmClamping,
    DisableDrives,
    EnableDrives,
    Home,
    Recover,
)
from console.session.station.context import Training
from console.session.station.state import Activity
from console.text.catalogue import load
from drivers.clock import TrainingClock
from drivers.cutting.planning import Strategy
from profiles.problem import Problem
from tests.console.floor import Floor, experiment_1, open_floor
from tests.school.test_debrief import Pupil, part_lesson

WORD = st.sampled_from(("inject", "speed", "pause", "return", "log", "help", "hang", "for=3", "2", '"', "'", "\\"))


@given(st.text() | st.lists(WORD | st.text(max_size=5), max_size=5).map(" ".join))
def test_a_line_is_an_order_or_is_refused(line: str) -> None:
    try:
        order = read_order(line)
    except SessionError as error:
        (problem,) = error.problems
        assert problem.code in ("instruct.unknown", "instruct.speed", "instruct.name")
    else:
        assert SLOWEST <= order.speed <= FASTEST
        assert order.line.isprintable()
        assert order.do is not OrderKind.FAULT or shlex.split(order.line) == shlex.split(line)


@pytest.mark.parametrize(
    ("line", "do"),
    [
        ("inject hang for=3", OrderKind.FAULT),
        ("speed 2", OrderKind.SPEED),
        ("speed x0.5", OrderKind.SPEED),
        ("checkpoint", OrderKind.CHECKPOINT),
        ("return before-cut", OrderKind.RETURN),
        ("screen", OrderKind.SCREEN),
    ],
)
def test_orders(line: str, do: OrderKind) -> None:
    assert read_order(line).do is do


@pytest.mark.parametrize("line", ["", "spindle 500", "speed", "speed 5", "speed nan", "speed 0", "checkpoint a/b"])
def test_refused_lines(line: str) -> None:
    with pytest.raises(SessionError):
        read_order(line)


def test_only_what_changes_the_lathe_is_kept_from_the_trainee() -> None:
    hidden = {
        line for line in ("inject hang", "clear", "power-cycle", "active", "list") if read_order(line).is_fault
    }
    assert hidden == {"inject hang", "clear", "power-cycle"}


@given(st.lists(st.text()), st.none() | st.builds(Problem, code=st.text(), value=st.text()))
def test_an_answer_arrives_as_it_was_given(lines: list[str], problem: Problem | None) -> None:
    answer = OrderReply(lines=tuple(lines), problem=problem)
    line = encode_answer(answer)
    assert line.count(b"\n") == 1
    assert read_answer(line) == answer


@given(st.recursive(st.none() | st.integers() | st.text(), lambda inner: st.dictionaries(st.text(), inner)))
def test_what_is_no_answer_is_not_taken_for_one(value: object) -> None:
    with pytest.raises(ValueError, match="answer"):
        read_answer(json.dumps({"lines": value}).encode())


@pytest.mark.parametrize("typed", ["--data /d speed 2", "speed 2 --data /d", "speed --data /d 2"])
def test_options_stand_wherever_they_are_typed(typed: str) -> None:
    options = build(load("en")).parse_args(["instruct", "tcp:127.0.0.1:4444", *typed.split()])
    assert (options.words, options.data) == (["speed", "2"], "/d")


# What an instructor does to a lathe: time stands still for all, checkpoints are of rest, a try has it in it.


JOB = experiment_1()


class Trained:
    """A lathe that is told what an instructor asks for."""

    def __init__(self) -> None:
        self.told: list[object] = []

    def set_speed(self, speed: float) -> None:
        self.told.append(speed)

    def checkpoint(self, name: str) -> None:
        self.told.append(name)

    def return_to(self, name: str) -> None:
        self.told.append(f"return {name}")


class Site:
    """A floor with an instructor. `looks` are made in a pause, one after the other; after them F2 is pressed."""

    def __init__(self, floor: Floor) -> None:
        self.floor, self.lathe, self.real_s = floor, Trained(), 0.0
        self.looks: list[Callable[[], object]] = []
        self.clock = TrainingClock(lambda: self.real_s, self._sleep)
        floor.context.training = Training(lathe=self.lathe, clock=self.clock)

    def _sleep(self, seconds: float) -> None:
        self.real_s += seconds
        (self.looks.pop(0) if self.looks else lambda: self.floor.station.post(Recover()))()

    def orders(self, line: str) -> list[OrderReply]:
        """Give an order; return the list that gets its answer."""
        answers: list[OrderReply] = []
        assert self.floor.station.post(CarryOut(order=read_order(line), answered=answers.append))
        return answers

    def done(self, line: str) -> str:
        """Give an order and have it carried out; return the code of its refusal, or ""."""
        answers = self.orders(line)
        self.floor.station.step()
        (answer,) = answers
        return "" if answer.problem is None else answer.problem.code


@pytest.fixture
def site(tmp_path: Path) -> Site:
    floor = open_floor(tmp_path)
    floor.idle()
    return Site(floor)


def refused(site: Site, command: Command) -> list[str]:
    assert not site.floor.station.post(command)
    return [problem.code for problem in site.floor.state.refusals]


def test_in_a_pause_nothing_is_asked_of_the_controller_and_nothing_is_taken_but_f2(site: Site) -> None:
    seen: list[object] = []

    def look() -> None:
        state = site.floor.state
        seen.append((state.speed, state.at_s, refused(site, ConfirmClamping(job=JOB)), refused(site, Home())))

    site.looks = [look, look]
    assert site.done("pause") == ""
    before, after = seen
    assert before == after
    assert before[0] == 0.0  # type: ignore[index]
    assert before[2] == ["instruct.paused"]  # type: ignore[index]
    assert (site.floor.state.speed, site.lathe.told) == (1.0, [0.0, 1.0])
    assert site.floor.do(ConfirmClamping(job=JOB)).alignment.clamping is not None


def test_the_speed_that_was_set_is_back_after_a_pause(site: Site) -> None:
    assert site.done("speed 2") == ""
    site.looks = [lambda: site.orders("speed 0.5"), lambda: site.orders("resume")]
    assert site.done("pause") == ""
    assert site.lathe.told == [2.0, 0.0, 0.5]
    assert (site.floor.state.speed, site.clock.speed) == (0.5, 0.5)


def test_a_stop_in_a_pause_is_told_and_settled_after_it(site: Site) -> None:
    floor = site.floor
    floor.do(ConfirmClamping(job=JOB))
    floor.do(EnableDrives())
    told: list[bool] = []
    site.looks = [lambda: floor.stop.stop("f9"), lambda: None, lambda: told.append(floor.state.stop_waits)]
    site.done("pause")
    assert told == [True]
    assert not floor.state.stop_waits
    floor.idle()
    assert floor.state.activity is Activity.STOPPED


def test_who_leaves_in_a_pause_is_not_held_up_and_paused_no_more(site: Site) -> None:
    site.looks = [site.clock.leave]
    site.done("pause")
    assert site.floor.state.speed == 1.0
    assert site.done("pause") == "instruct.leaving"
    site.floor.station.close("quit")


def test_a_checkpoint_is_of_rest_with_nothing_armed(site: Site) -> None:
    assert site.done("checkpoint a") == ""
    floor = site.floor
    floor.set_up(JOB)
    floor.do(Arm(job=JOB, job_sha256="0" * 64, strategy=Strategy.PVT))
    assert floor.state.armed is not None
    assert site.done("checkpoint b") == "instruct.not_at_rest"
    moving: list[list[OrderReply]] = []
    floor.when(lambda snapshot: snapshot.moving, lambda: moving.append(site.orders("checkpoint c")))
    floor.do(DisableDrives())
    floor.do(EnableDrives())
    floor.do(Home())
    ((answer,),) = moving
    assert answer.problem is not None
    assert answer.problem.code == "instruct.not_at_rest"
    assert site.lathe.told == ["a"]


def test_checkpoints_are_few_and_known_by_name(site: Site) -> None:
    for number in range(MOST_CHECKPOINTS):
        assert site.done(f"checkpoint {number}") == ""
    assert site.done("checkpoint more") == "instruct.too_many"
    assert site.done("checkpoint 3") == ""
    answers = site.orders("checkpoints")
    site.floor.station.step()
    assert len(answers[0].lines) == MOST_CHECKPOINTS
    assert site.done("return nowhere") == "instruct.no_checkpoint"


def test_without_an_instructor_there_are_no_orders(tmp_path: Path) -> None:
    floor, answers = open_floor(tmp_path), list[OrderReply]()
    floor.station.post(CarryOut(order=read_order("pause"), answered=answers.append))
    floor.station.step()
    assert answers[0].problem is not None
    assert floor.state.speed == 1.0


def act(line: str, at_s: float) -> InstructorAct:
    return InstructorAct(at=datetime(2026, 1, 1, 8, 0, 0), at_s=at_s, order=read_order(line))


def test_a_fault_of_the_instructor_counts_as_one_of_the_lesson(tmp_path: Path) -> None:
    pupil = Pupil(open_floor(tmp_path, plant="easy"), part_lesson())
    tried = pupil.tried.record_instruction(act("inject hang for=2", pupil.tried.began_s + 3.0))
    tried = tried.record_instruction(act("pause", pupil.tried.began_s + 4.0))
    assert [(each.what, each.word, round(each.at_s, 6)) for each in tried.happened] == [
        (HappeningKind.FAULT, "hang for=2", 3.0),
        (HappeningKind.INSTRUCTOR, "pause", 4.0),
    ]
    assert tried.faults == 1
    assert reactions(tried, pupil.tried.began_s + 10.0) == pytest.approx((7.0,))
    assert tried.end_attempt(0.0).record_instruction(act("clear", 0.0)).happened == tried.happened


def test_steps_made_since_a_checkpoint_are_made_again_after_a_return(tmp_path: Path) -> None:
    tried = replace(Pupil(open_floor(tmp_path), part_lesson()).tried, reached=(("touched_off", 5.0),))
    tried = tried.record_instruction(act("checkpoint", 6.0))
    tried = replace(tried, reached=(*tried.reached, ("full_cut", 9.0), ("measured", 11.0)))
    assert tried.record_instruction(act("return", 12.0)).reached == (("touched_off", 5.0),)
    assert tried.record_instruction(act("return other", 12.0)).step == 3


def test_faults_are_hidden_from_the_log_that_a_trainee_sees() -> None:
    mailbox = Mailbox(lambda hidden: tuple(each.order.line for each in hidden))
    for line in ("inject hang", "pause", "clear"):
        mailbox.note(act(line, 0.0))
    assert mailbox.log() == ("inject hang", "clear")
    assert [each.order.line for each in mailbox.fresh()] == ["inject hang", "pause", "clear"]
    assert mailbox.fresh() == []


def test_an_acknowledgement_is_taken_in_a_pause(site: Site) -> None:
    taken: list[bool] = []
    site.looks = [lambda: taken.append(site.floor.station.post(Acknowledge()))]
    site.done("pause")
    assert taken == [True]
