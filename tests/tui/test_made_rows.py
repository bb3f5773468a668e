"""The rows of the frame are made anew as soon as anything that they show is new, and only then."""

from __future__ import annotations

from dataclasses import fields, replace
from datetime import datetime, timedelta

import pytest

from console.session.station.alarms import Priority, raised
from console.session.station.state import Activity, StationState
from console.text.catalogue import LiveCatalogue, load
from console.tui import frame_rows as module
from console.tui.frame import Frame, frame_rows
from console.tui.frame_rows import MadeRows
from console.tui.gate import FieldKind
from console.tui.keymap import PageName
from console.tui.lines import Line, line, plain
from drivers.lathe.snapshot import Snapshot
from profiles.problem import Problem
from profiles.store import load_machine
from tests.tui.scenes import scene_of

MACHINE = load_machine("lee-2001-lathe").machine
CLOCK, NOW_S = datetime(2026, 1, 2, 8, 41, 59), 100.4
SCENES = [scene_of(page) for page in (PageName.JOBS, PageName.RUN, PageName.ALARMS, PageName.INSPECT)]


def frame(state: StationState, **changes: object) -> Frame:
    made = Frame(
        text=load("en"),
        state=state,
        machine=MACHINE,
        page=PageName.RUN,
        field=FieldKind.NONE,
        next_step=line("what to do"),
        said=(),
        clock=CLOCK,
        now_s=NOW_S,
        job="ring-52",
    )
    return replace(made, **changes)  # type: ignore[arg-type]


def shows(before: Frame, now: Frame, width: int = 100, height: int = 30) -> None:
    """What is shown after another frame is what would be shown without it."""
    rows = MadeRows()
    rows.of(before, width, height)
    assert rows.of(now, width, height) == frame_rows(now, width, height)


STATES = [
    *(scene.state for scene in SCENES),
    StationState(),
    replace(SCENES[0].state, activity=Activity.LOST),
    replace(SCENES[0].state, spindle_rpm=212.0, stop_waits=True, speed=0.0, onlookers=2),
]


@pytest.mark.parametrize("name", [each.name for each in fields(StationState)])
def test_each_field_of_the_state_is_shown_as_soon_as_it_is_new(name: str) -> None:
    for before in STATES:
        for other in STATES:
            shows(frame(before), frame(replace(before, **{name: getattr(other, name)})))


@pytest.mark.parametrize("name", [each.name for each in fields(Snapshot)])
def test_each_field_of_a_poll_is_shown_as_soon_as_it_is_new(name: str) -> None:
    polls = [state.snapshot for state in STATES if state.snapshot is not None]
    moving = replace(polls[0], asked_s=90.0, program_running=True, driven=polls[0].driven[:1])
    for before in polls:
        for other in (*polls, moving):
            now = replace(before, **{name: getattr(other, name)})
            for state in STATES:
                shows(frame(replace(state, snapshot=before)), frame(replace(state, snapshot=now)))


def test_the_clock_shows_its_next_minute_and_an_old_state_its_age() -> None:
    ready = SCENES[0].state
    rows = MadeRows()
    assert "08:41" in plain(rows.of(frame(ready), 100, 30)["state"])
    assert "08:42" in plain(rows.of(frame(ready, clock=CLOCK + timedelta(seconds=1)), 100, 30)["state"])
    for after_s in (0.5, 1.2, 2.2, 3.2):
        shows(frame(ready), frame(ready, now_s=NOW_S + after_s))
    old = plain(rows.of(frame(ready, now_s=NOW_S + 7.0), 100, 30)["state"])
    older = plain(rows.of(frame(ready, now_s=NOW_S + 9.0), 100, 30)["state"])
    assert old != older


def test_another_size_language_unit_or_page_is_shown() -> None:
    text, rows = LiveCatalogue("en"), MadeRows()
    before = frame(SCENES[0].state, text=text)
    english = rows.of(before, 100, 30)
    assert rows.of(before, 80, 24) == frame_rows(before, 80, 24) != english
    rows.of(before, 100, 30)
    text.speak("ko")  # the texts of a screen change in place
    assert rows.of(before, 100, 30) == frame_rows(before, 100, 30) != english
    behind = Problem(code="machine.left_behind", key="tool", value="0.3 mm", limit="0.15 mm")
    alarmed = replace(before, state=replace(before.state, alarms=raised((), behind, Priority.HIGH, 1.0)))
    metric = rows.of(alarmed, 100, 30)
    text.measure("inch")
    assert rows.of(alarmed, 100, 30) == frame_rows(alarmed, 100, 30) != metric
    shows(before, replace(before, page=PageName.ALIGN))


def test_an_answer_an_alarm_and_what_to_do_next_are_shown() -> None:
    before = frame(SCENES[0].state)
    said = (Problem(code="screen.busy", key="F5"),)
    alarmed = replace(before.state, alarms=raised((), Problem(code="link.silent"), Priority.HIGH, 1.0))
    for now in (
        replace(before, said=said),
        replace(before, state=alarmed),
        replace(before, state=replace(before.state, refusals=said)),
        replace(before, next_step=line("something else")),
        replace(before, field=FieldKind.TEXT),
        replace(before, job="ring-60"),
        replace(before, silent=True),
    ):
        assert frame_rows(now, 100, 30) != frame_rows(before, 100, 30)
        shows(before, now)


def test_polls_of_a_machine_at_rest_make_no_row_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Frame] = []

    def counted(frame: Frame, width: int, height: int) -> dict[str, list[Line]]:
        made.append(frame)
        return frame_rows(frame, width, height)

    monkeypatch.setattr(module, "frame_rows", counted)
    rows, first = MadeRows(), frame(SCENES[0].state)
    assert first.state.snapshot is not None
    for poll in range(20):
        at_s = 100.0 + 0.1 * poll
        tool = replace(first.state.snapshot.tool, position=float(poll % 2))  # the last count of an encoder
        snapshot = replace(first.state.snapshot, asked_s=at_s, at_s=at_s, tool=tool)
        state = replace(first.state, snapshot=snapshot, at_s=at_s)
        rows.of(replace(first, state=state, now_s=at_s + 0.05, clock=CLOCK.replace(second=poll)), 100, 30)
    assert len(made) == 1
