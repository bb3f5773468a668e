"""The rows of the frame are made anew as soon as anything that they show is new, and only then."""

from __future__ import annotations

import asyncio
import gc
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, ClassVar

import pytest
from textual.app import App, ComposeResult
from textual.drivers.headless_driver import HeadlessDriver
from textual.pilot import Pilot
from textual.widget import Widget

from console.__main__ import main
from console.session.station.alarms import Priority, raise_alarm
from console.session.station.state import Activity, StationState
from console.text.catalogue import LiveCatalogue, load
from console.tui import frame_rows as module
from console.tui.app import GarbageCollector
from console.tui.frame import Frame, frame_rows
from console.tui.frame_rows import MadeRows
from console.tui.gate import FieldKind
from console.tui.keymap import PageName
from console.tui.lines import Line, Sheet, line, plain_text
from console.tui.theme import COLOUR, Token
from drivers.lathe.snapshot import Snapshot
from profiles.problem import Problem
from profiles.store import load_machine
from tests.terminal_screen import Emulation
from tests.tui.scenes import application, fill, fixed_world, keys_to, played, scene_of, settle
from tests.tui.test_settings_page import EVERYWHERE

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
    rows.frame_lines(before, width, height)
    assert rows.frame_lines(now, width, height) == frame_rows(now, width, height)


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
    assert "08:41" in plain_text(rows.frame_lines(frame(ready), 100, 30)["state"])
    assert "08:42" in plain_text(
        rows.frame_lines(frame(ready, clock=CLOCK + timedelta(seconds=1)), 100, 30)["state"]
    )
    for after_s in (0.5, 1.2, 2.2, 3.2):
        shows(frame(ready), frame(ready, now_s=NOW_S + after_s))
    old = plain_text(rows.frame_lines(frame(ready, now_s=NOW_S + 7.0), 100, 30)["state"])
    older = plain_text(rows.frame_lines(frame(ready, now_s=NOW_S + 9.0), 100, 30)["state"])
    assert old != older


def test_another_size_language_unit_or_page_is_shown() -> None:
    text, rows = LiveCatalogue("en"), MadeRows()
    before = frame(SCENES[0].state, text=text)
    english = rows.frame_lines(before, 100, 30)
    assert rows.frame_lines(before, 80, 24) == frame_rows(before, 80, 24) != english
    rows.frame_lines(before, 100, 30)
    text.speak("ko")  # the texts of a screen change in place
    assert rows.frame_lines(before, 100, 30) == frame_rows(before, 100, 30) != english
    behind = Problem(code="machine.left_behind", key="tool", value="0.3 mm", limit="0.15 mm")
    alarmed = replace(before, state=replace(before.state, alarms=raise_alarm((), behind, Priority.HIGH, 1.0)))
    metric = rows.frame_lines(alarmed, 100, 30)
    text.measure("inch")
    assert rows.frame_lines(alarmed, 100, 30) == frame_rows(alarmed, 100, 30) != metric
    shows(before, replace(before, page=PageName.ALIGN))


def test_an_answer_an_alarm_and_what_to_do_next_are_shown() -> None:
    before = frame(SCENES[0].state)
    said = (Problem(code="screen.busy", key="F5"),)
    alarmed = replace(before.state, alarms=raise_alarm((), Problem(code="link.silent"), Priority.HIGH, 1.0))
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
        rows.frame_lines(replace(first, state=state, now_s=at_s + 0.05, clock=CLOCK.replace(second=poll)), 100, 30)
    assert len(made) == 1


# What a terminal shows after a row was drawn again in part: no character of a row beside it is lost.


WIDTH, HEIGHT = 40, 4


class Terminal(HeadlessDriver):
    """Keeps what is written, as a terminal draws it."""

    emulation = Emulation(WIDTH, HEIGHT)
    seen: ClassVar[list[str]] = []
    is_headless = False  # A headless one is sent nothing.

    def write(self, data: str) -> None:
        """Draw it."""
        self.emulation.feed(data.encode())


class TwoRows(App[None]):
    """A message that may take two rows above a row whose end is Korean, as at the lower edge of the console."""

    CSS = "Screen { layout: vertical } #page { height: 1fr } .row { height: 1 }"

    def compose(self) -> ComposeResult:
        """Yield the page and both rows."""
        yield Sheet(COLOUR, id="page")
        yield Sheet(COLOUR, id="message", classes="row")
        yield Sheet(COLOUR, id="stop", classes="row")


def test_a_message_that_gets_longer_cuts_no_wide_character_below_it() -> None:
    async def lengthen(pilot: Pilot[object]) -> None:
        message, stop = pilot.app.query_one("#message", Sheet), pilot.app.query_one("#stop", Sheet)
        message.show([(("3", Token.TEXT),)])
        stop.show([((" " * 33 + "정지 중", Token.TEXT),)])
        await pilot.pause()
        message.styles.height = 2
        # The second row ends in column 34, which is the middle of the first wide character below it.
        message.show([(("Enter", Token.TEXT),), (("x" * 34, Token.TEXT),)])
        await pilot.pause()
        Terminal.seen = Terminal.emulation.rows()
        pilot.app.exit()

    asyncio.run(TwoRows(driver_class=Terminal).run_async(size=(WIDTH, HEIGHT), auto_pilot=lengthen))
    assert [row.strip() for row in Terminal.seen][1:] == ["Enter", "x" * 34, "정지 중"]


# What the first page needs is painted before anything heavy is loaded, and before garbage is looked for.


HEAVY = (
    *(
        "numpy",
        "scipy",
        "control",
        "plotext",
        "textual_plotext",
        "serial",
        "sqlite3",
        "tomlkit",
        "secrets",
        "json",
    ),
    *("drivers.pmac", "profiles.rules", "console.session.station.commands"),
)
FIRST_PAGE = "import console.__main__, console.screens.start, console.tui.pages.jobs"


def test_the_first_page_imports_nothing_heavy() -> None:
    show = f"{FIRST_PAGE}; import sys; print(*(name for name in {HEAVY!r} if name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", show], capture_output=True, text=True, timeout=30)
    assert (done.stdout.strip(), done.stderr) == ("", "")


async def test_garbage_is_collected_from_the_first_picture_on(tmp_path: Path) -> None:
    """A console that did not would grow over the shift."""
    scene = scene_of(PageName.JOBS)
    app, _ = application(scene, tmp_path)
    gc.disable()
    try:
        async with played(app, scene, (80, 24)):
            assert gc.isenabled()
    finally:
        gc.enable()
    assert app.fault is None


def test_garbage_is_collected_after_a_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0 and main(["jobs", "--help"]) == 0
    assert gc.isenabled()


# While nothing changes nothing is painted: on no page, at no size, however often the screen ticks.


TICKS = 3


@pytest.mark.parametrize("size", [(80, 24), (160, 48)])
@pytest.mark.long
async def test_a_tick_without_news_paints_nothing_on_any_page(
    size: tuple[int, int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    painted: Counter[tuple[str, str]] = Counter()
    here = PageName.JOBS

    def counted(widget: Widget, *regions: object, **how: object) -> Widget:
        painted[here, widget.id or type(widget).__name__] += 1
        return refresh(widget, *regions, **how)  # type: ignore[arg-type]

    refresh = Widget.refresh
    fill(tmp_path)
    with fixed_world():
        app, _ = application(replace(EVERYWHERE, page=PageName.JOBS), tmp_path)
        async with played(app, replace(EVERYWHERE, page=PageName.JOBS), size) as pilot:
            for page in PageName:
                await pilot.press(*keys_to(page))
                await settle(app, pilot)
                here = page
                with monkeypatch.context() as patch:
                    patch.setattr(Widget, "refresh", counted)
                    for _ in range(TICKS):
                        app.tick()
                        await pilot.pause()
                    assert painted == {}
                    app.ui.say("screen.key_repeats")
                    app.tick()
                    assert painted, "what is painted would not be seen"
                painted.clear()
                app.ui.key_answer = ()
        assert app.fault is None


# What garbage collection costs a stop: a full one stops every thread, the one that reads the keys too.


OBJECTS = 100_000
AS_BUILT = (700, 10, 10)
"""The thresholds of an interpreter; those of the tests are others."""


@pytest.fixture
def full() -> Iterator[Callable[[], int]]:
    """Count the full collections, in a process that is left as it was."""
    thresholds, enabled, seen = gc.get_threshold(), gc.isenabled(), []

    def note(phase: str, facts: dict[str, Any]) -> None:
        if phase == "start" and facts["generation"] == 2:
            seen.append(facts)

    gc.callbacks.append(note)
    gc.set_threshold(*AS_BUILT)
    gc.enable()
    yield lambda: len(seen)
    gc.callbacks.remove(note)
    gc.set_threshold(*thresholds)
    gc.unfreeze()
    (gc.enable if enabled else gc.disable)()


def test_nothing_old_is_collected_while_something_may_move(full: Callable[[], int]) -> None:
    collector = GarbageCollector()
    collector.spare(True)
    kept = [[number] for number in range(OBJECTS)]
    assert full() == 0
    collector.spare(False)
    kept += [[number] for number in range(len(kept))]
    assert full() > 0


def test_young_garbage_is_collected_while_something_may_move(full: Callable[[], int]) -> None:
    collector = GarbageCollector()
    collector.spare(True)
    before = len(gc.get_objects())
    for _ in range(OBJECTS // 10):
        circle: list[Any] = []
        circle.append(circle)
    assert len(gc.get_objects()) < before + OBJECTS // 20
    collector.spare(False)
