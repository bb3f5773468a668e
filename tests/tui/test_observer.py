"""The screens of a console that looks on: what stands there, what its keys do, how it takes over."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest

from console.session.guide.situation import Situation
from console.session.station.alarms import Priority, raised
from console.session.station.commands import TakeControl
from console.session.station.state import Activity, StationState
from console.text.catalogue import load
from console.tui.align.align_lines import why_lines
from console.tui.frame import Frame, next_row, state_row
from console.tui.gate import FieldKind
from console.tui.keymap import PageName
from console.tui.lines import line, plain, width_of
from drivers.lathe.standing import Standing
from profiles.problem import Problem
from profiles.store import load_machine
from tests.golden_text import compare, writing
from tests.tui import align_stage, run_stage
from tests.tui.machine_states import ON
from tests.tui.scenes import ALIGNED, Scene, application, fill, fixed_world, machine, played, rows_of, signed
from tests.tui.stage import LANGUAGES, MACHINE, FixedControl, experiment

GOLDENS = Path(__file__).with_name("observer_goldens")
HOLDER = 1_683_503_496
"""Numbers are drawn up to ten digits."""

LOOKING_ON: dict[str, Any] = {"standing": Standing.OBSERVER, "holder": HOLDER}
ALARMS = raised((), Problem(code="owner.held", value=str(HOLDER)), Priority.MEDIUM, 1.0)
MOVING = align_stage.look(ON - {"desired_velocity_zero"})


def frame(state: StationState, language: str = "en", **changes: Any) -> Frame:
    made = Frame(
        text=load(language),
        state=state,
        machine=load_machine(MACHINE).machine,
        page=PageName.RUN,
        field=FieldKind.NONE,
        next_step=line("what to do"),
        said=(),
        clock=datetime(2026, 1, 2, 8, 41),
        now_s=100.1,
    )
    return replace(made, **changes)


def pressed(
    data: Path, now: StationState, page: PageName, *presses: tuple[float, str]
) -> tuple[FixedControl, list[str]]:
    """Press keys at these times, s after the first look; return what was ordered, and each answer to a key."""
    fill(data)
    scene = Scene(page=page, state=now, work=experiment())
    app, control = application(scene, data)
    said: list[str] = []

    async def run() -> None:
        async with played(app, scene, (80, 24)) as pilot:
            for after_s, key in presses:
                control.at(100.0 + after_s)
                await pilot.press(key)
                await pilot.pause()
                said.append(" ".join(problem.code for problem in app.ui.said))

    asyncio.run(run())
    assert app.fault is None
    return control, said


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("standing", [Standing.OBSERVER, Standing.OUSTED])
def test_the_state_row_says_who_controls_and_the_next_row_what_helps(standing: Standing, language: str) -> None:
    text, now = load(language), frame(run_stage.state(standing=standing, holder=HOLDER), language)
    first, following = plain(state_row(now, 80)), plain(next_row(now, 80))
    assert text("frame.looks_on", holder=HOLDER) in first and str(HOLDER) in first
    assert text("frame.observer") in following and " t " in following
    assert "what to do" not in following
    for width in (60, 80, 160):
        assert all(width_of(row) <= width for row in (*state_row(now, width), *next_row(now, width)))


def test_a_stop_comes_before_who_controls() -> None:
    stopped = replace(run_stage.stopped(), **LOOKING_ON)
    assert "F2" in plain(next_row(frame(stopped), 80))


@pytest.mark.parametrize("activity", [Activity.CONNECTING, Activity.LOST])
def test_nothing_is_said_of_who_controls_where_that_is_not_known(activity: Activity) -> None:
    now = frame(run_stage.state(activity=activity, **LOOKING_ON))
    assert str(HOLDER) not in plain(state_row(now, 80))


@pytest.mark.parametrize("key", ["t", "ㅅ"])
def test_t_twice_within_five_seconds_takes_the_machine_over(key: str, tmp_path: Path) -> None:
    control, said = pressed(tmp_path, run_stage.state(**LOOKING_ON), PageName.RUN, (0.0, key), (2.0, key))
    assert control.orders == [TakeControl()] and control.stops == []
    assert said == ["screen.take_over_again", ""]


def test_t_once_or_again_too_late_takes_nothing(tmp_path: Path) -> None:
    presses = ((0.0, "t"), (6.0, "t"), (12.0, "t"))
    control, said = pressed(tmp_path, run_stage.state(**LOOKING_ON), PageName.RUN, *presses)
    assert control.orders == []
    assert said == ["screen.take_over_again"] * 3


def test_a_machine_that_nobody_controls_is_called_so(tmp_path: Path) -> None:
    free: dict[str, Any] = {"standing": Standing.OBSERVER, "holder": 0}
    control, said = pressed(tmp_path, run_stage.state(**free), PageName.RUN, (0.0, "t"), (2.0, "t"))
    assert (control.orders, said) == ([TakeControl()], ["screen.take_control_again", ""])
    text, shown = load("en"), align_stage.state(**free)

    def situation(state: StationState) -> Situation:
        return Situation(state=state, work=None, machine=load_machine(MACHINE).machine)

    lines = plain(why_lines(text, situation(shown), 60, 4))
    assert "No console has control" in lines and "t twice" in lines
    held = align_stage.state(**LOOKING_ON)
    assert "Another console" in plain(why_lines(text, situation(held), 60, 4))


def test_who_controls_already_is_told_so(tmp_path: Path) -> None:
    control, said = pressed(tmp_path, run_stage.state(), PageName.RUN, (0.0, "t"), (1.0, "t"))
    assert (control.orders, said) == ([], ["screen.controls_already"] * 2)


@pytest.mark.parametrize(
    ("page", "key"),
    [(PageName.ALIGN, "f4"), (PageName.ALIGN, "enter"), *((PageName.RUN, key) for key in ("f5", "f8"))],
)
def test_a_key_that_would_move_is_refused_with_what_helps(page: PageName, key: str, tmp_path: Path) -> None:
    now = align_stage.state(**LOOKING_ON) if page is PageName.ALIGN else run_stage.state(**LOOKING_ON)
    control, said = pressed(tmp_path, now, page, (0.0, key))
    assert (control.orders, control.stops, said) == ([], [], ["screen.observes"])


def test_a_key_without_a_meaning_does_not_stop_what_another_console_moves(tmp_path: Path) -> None:
    moving = align_stage.state(snapshot=MOVING, **LOOKING_ON)
    control, _ = pressed(tmp_path, moving, PageName.ALIGN, (0.0, "z"), (1.0, "f3"))
    assert control.stops == []


@pytest.mark.parametrize(("key", "stops", "kills"), [("space", ["space"], []), ("f9", [], ["f9"])])
def test_space_and_f9_stop_whoever_controls(key: str, stops: list[str], kills: list[str], tmp_path: Path) -> None:
    moving = align_stage.state(snapshot=MOVING, **LOOKING_ON)
    control, _ = pressed(tmp_path, moving, PageName.ALIGN, (0.0, key))
    assert (control.stops, control.kills) == (stops, kills)


def test_an_observer_may_leave_while_the_owner_moves(tmp_path: Path) -> None:
    control, said = pressed(
        tmp_path, align_stage.state(snapshot=MOVING, **LOOKING_ON), PageName.ALIGN, (0.0, "ctrl+q")
    )
    assert (control.stops, said) == ([], [""])


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("page", [PageName.RUN, PageName.ALIGN])
def test_the_screen_of_an_observer_looks_as_it_did(page: PageName, language: str, tmp_path: Path) -> None:
    state = replace(machine(Activity.READY), simulated=False, alignment=ALIGNED, alarms=ALARMS, **LOOKING_ON)
    scene = Scene(page=page, state=state, work=signed())

    async def play() -> list[str]:
        app, _ = application(scene, tmp_path, language=language)
        async with played(app, scene, (80, 24)):
            return rows_of(app)

    with fixed_world():
        fill(tmp_path)
        rows = asyncio.run(play())
    compare(rows, GOLDENS / f"{page}-{language}.txt", write=writing())
