"""The mouse: it shows pages and chooses rows at rest, and no report of it is a key, moves or stops anything."""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from textual import events
from textual.pilot import Pilot

from console.session.appearance import Appearance
from console.session.station.state import Activity
from console.tui.app import ConsoleApp
from console.tui.driver import MOUSE_OFF, MOUSE_ON, Reader, StopDriver
from console.tui.gate import UNREADABLE
from console.tui.keymap import DIGITS, PageName
from tests.tui import align_stage, run_stage
from tests.tui.scenes import Scene, application, console_on, fixed_world, keys_to, rows_of, scene_of, settle
from tests.tui.stage import FixedControl, experiment
from tests.tui.test_settings_page import EVERYWHERE

Act = Callable[[ConsoleApp, Pilot[None], FixedControl], Awaitable[None]]
PAGES_ROW = 2


@asynccontextmanager
async def play(data: Path, scene: Scene) -> AsyncIterator[tuple[ConsoleApp, Pilot[None], FixedControl]]:
    with fixed_world():
        async with console_on(scene, data, appearance=Appearance(mouse="on")) as running:
            running[0]._acted_s = float("-inf")  # the keys to the page were pressed a while ago
            yield running


async def click(app: ConsoleApp, pilot: Pilot[None], words: str, row: int | None = None) -> None:
    """Press the left button on the first place with these words."""
    rows = rows_of(app)
    y = next(n for n, each in enumerate(rows) if words in each) if row is None else row
    x = float(rows[y].index(words))
    await app.on_event(events.MouseDown(None, x, float(y), 0, 0, 1, False, False, False, screen_x=x, screen_y=y))
    await settle(app, pilot)


async def turn(app: ConsoleApp, pilot: Pilot[None], way: type[events.MouseEvent]) -> None:
    """Turn the wheel by one notch in the middle of the page."""
    await app.on_event(way(None, 20.0, 10.0, 0, 0, 0, False, False, False, screen_x=20.0, screen_y=10.0))
    await settle(app, pilot)


@pytest.mark.long
async def test_a_click_shows_the_page_of_that_name(tmp_path: Path) -> None:
    async with play(tmp_path, EVERYWHERE) as (app, pilot, control):
        for page, digit in DIGITS.items():
            name = f"{digit} {app.ui.text(f'page.{page}')}"
            await click(app, pilot, name if page is not PageName.MORE else "0 ", PAGES_ROW)
            assert app.page is page
        assert (control.orders, control.stops, control.kills) == ([], [], [])


async def test_a_click_chooses_a_row_and_the_wheel_goes_through_the_list(tmp_path: Path) -> None:
    alarms = scene_of(PageName.ALARMS)
    async with play(
        tmp_path, Scene(page=PageName.JOBS, state=alarms.state, work=experiment(), log=alarms.log)
    ) as (app, pilot, _):
        await click(app, pilot, "steel-bar-65")
        assert "steel-bar-65 ─" in "\n".join(rows_of(app)), "its details are shown"
        assert app.page is PageName.JOBS and app.ui.job is experiment().job, "it is not opened"
        await turn(app, pilot, events.MouseScrollUp)
        assert "steel-bar-65 ─" not in "\n".join(rows_of(app))
        app.ui.said = ()
        for page, words in ((PageName.SETTINGS, "signs"), (PageName.MORE, "Log"), (PageName.ALARMS, " 3 08:5")):
            await pilot.press(*keys_to(page))
            app._acted_s = float("-inf")
            await settle(app, pilot)
            await click(app, pilot, words)
            assert any(mark in row and words in row for row in rows_of(app) for mark in "▸▶"), page


async def test_it_moves_nothing_confirms_nothing_and_does_nothing_while_something_moves_or_is_typed(
    tmp_path: Path,
) -> None:
    async with play(
        tmp_path / "align", Scene(page=PageName.ALIGN, state=align_stage.state(), work=experiment())
    ) as (app, pilot, control):
        await pilot.press("j")
        for way in (events.MouseScrollUp, events.MouseScrollDown):
            await turn(app, pilot, way)  # the arrows jog there
        for row in range(3, 23):
            await app.on_event(events.MouseDown(None, 5.0, float(row), 0, 0, 1, False, False, False))
        assert control.orders == []
    moving = run_stage.state(activity=Activity.CUTTING, cut=run_stage.cut())
    async with play(tmp_path / "run", Scene(page=PageName.RUN, state=moving, work=experiment())) as (
        app,
        pilot,
        control,
    ):
        await click(app, pilot, "1 Jobs")
        await turn(app, pilot, events.MouseScrollDown)
        assert app.page is PageName.RUN
        assert (control.orders, control.stops, control.kills) == ([], [], [])
    async with play(tmp_path / "log", scene_of(PageName.LOG)) as (app, pilot, _):
        await pilot.press("slash", "s")
        await click(app, pilot, "1 Jobs")
        assert app.page is PageName.LOG


@pytest.mark.parametrize(
    "report",
    [
        "\x1b[<0;10;5M\x1b[<0;10;5m",  # press and release, as in xterm's control sequences, mode 1006
        "\x1b[<64;10;5M",
        "\x1b[<32;11;5M" * 50,  # a drag, from a terminal that sends it unasked
        "\x1b[<66;300;200M",
        "\x1b[M !!",  # X10: no terminal is asked for it
    ],
)
def test_no_report_of_a_mouse_is_a_key(report: str) -> None:
    reader = Reader()
    said = [message for character in report for message in reader.read(character, 0.0)]
    said += reader.idle(0.2)
    assert [message for message in said if isinstance(message, events.Key)] == []


def test_half_a_report_is_a_key_that_means_nothing() -> None:
    """It stops what moves: what cannot be read might have been a stop."""
    reader = Reader()
    said = [message for character in "\x1b[<0;1" for message in reader.read(character, 0.0)]
    import time

    time.sleep(0.15)  # the parser waits for the rest by its own clock
    said += reader.idle(0.2)
    assert [getattr(message, "key", "") for message in said] == [UNREADABLE]


def test_the_terminal_reports_only_at_rest_only_where_it_was_switched_on_and_not_after_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent: list[str] = []
    app, control = application(EVERYWHERE, tmp_path)
    driver = StopDriver.__new__(StopDriver)
    driver._reports_mouse = False
    monkeypatch.setattr(driver, "write", sent.append, raising=False)
    monkeypatch.setattr(driver, "flush", lambda: None, raising=False)
    assert "1002" not in MOUSE_ON and "1003" not in MOUSE_ON, "a drag would send a report for each cell"
    for mouse, activity, expected in (
        ("off", Activity.READY, []),
        ("on", Activity.READY, [MOUSE_ON]),
        ("on", Activity.READY, []),
        ("on", Activity.CUTTING, [MOUSE_OFF]),
        ("on", Activity.READY, [MOUSE_ON]),
        ("off", Activity.READY, [MOUSE_OFF]),
    ):
        control.state = run_stage.state(activity=activity, cut=run_stage.cut() if activity != "ready" else None)
        sent.clear()
        driver.report_mouse(mouse == "on" and app._is_known_at_rest)
        assert sent == expected, (mouse, activity)
