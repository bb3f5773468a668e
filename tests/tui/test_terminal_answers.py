"""What a terminal sends that is no key, in a cut: its answers are dropped, and a key among them still stops."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from textual import constants, events
from textual._ansi_sequences import ANSI_SEQUENCES_KEYS
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

ANSWERS = {
    # By the control sequences of xterm, with what terminals are seen to answer.
    "background, ST": "\x1b]11;rgb:1c1c/1c1c/1c1c\x1b\\",
    "background, BEL": "\x1b]11;rgb:1c1c/1c1c/1c1c\x07",
    "palette": "\x1b]4;7;rgb:e5e5/e5e5/e5e5\x1b\\",
    "DA1, VT420": "\x1b[?64;1;2;6;9;15;16;17;18;21;22;28c",
    "DA1, tmux": "\x1b[?1;2c",
    "DA2, xterm": "\x1b[>41;377;0c",
    "DA2, PuTTY": "\x1b[>0;136;0c",
    "DA3": "\x1bP!|00000000\x1b\\",
    "XTVERSION": "\x1bP>|tmux 3.4\x1b\\",
    "XTGETTCAP": "\x1bP1+r544e=787465726d\x1b\\",
    "DECRQSS": "\x1bP1$r0m\x1b\\",
    "kitty's flags": "\x1b[?27u",
    "kitty's graphics": "\x1b_Gi=31;OK\x1b\\",
    "mode 2026": "\x1b[?2026;2$y",
    "mode 4": "\x1b[4;2$y",
    "status": "\x1b[0n",
    "colour scheme": "\x1b[?997;1n",
    "cursor": "\x1b[12;40R",
    "cursor, DECXCPR": "\x1b[?1;2R",
    "cursor, DECXCPR with page": "\x1b[?12;40;1R",
    "window": "\x1b[8;24;80t",
    "modifyOtherKeys": "\x1b[>4;2m",
    "sixel": "\x1b[?2;0;800;600S",
}
STOPS = [("\x1b[24~", "f12"), ("\x1b[27u", "escape"), (" ", "space")]
HALF_S = 0.5  # that a line takes its time within an answer
UNMISTAKABLE = 5  # characters after which every one of them is held for longer than a key


def keys_of(reader: Reader, typed: str, now_s: float) -> list[str]:
    said = [message for character in typed for message in reader.read(character, now_s)]
    said += reader.idle(now_s)
    return [each.key for each in said if isinstance(each, events.Key)]


@pytest.mark.parametrize("name", ANSWERS)
def test_an_answer_that_nobody_waits_for_is_no_key_however_it_is_split(name: str) -> None:
    answer = ANSWERS[name]
    for split in range(len(answer) + 1):
        reader = Reader()
        assert keys_of(reader, answer[:split], 0.0) + keys_of(reader, answer[split:], 0.01) == [], split
        assert keys_of(reader, "x", 0.02) == ["x"]


@pytest.mark.parametrize("name", [name for name, answer in ANSWERS.items() if answer[1] + answer[2] != "[0"])
def test_an_answer_may_come_in_pieces_over_a_slow_line(name: str) -> None:
    answer = ANSWERS[name]
    if answer[2].isdigit() and answer[1] == "[":
        pytest.skip("it begins like a key: half of it is invalid input")
    for split in range(UNMISTAKABLE, len(answer)):
        if answer[split - 1] == "\x1b" or answer[split] == " ":
            continue  # after a pause these are pressed
        reader = Reader()
        assert keys_of(reader, answer[:split], 0.0) + keys_of(reader, answer[split:], HALF_S) == [], split


@pytest.mark.parametrize("name", ANSWERS)
@pytest.mark.parametrize(
    ("typed", "key"), [("\x1b[24~", "f12"), ("\x1b[27u", "escape"), (" ", "space"), ("x", "x")]
)
def test_a_key_before_between_and_after_answers_arrives(name: str, typed: str, key: str) -> None:
    answer = ANSWERS[name]
    assert keys_of(Reader(), typed + answer + typed + answer + typed, 0.0) == [key] * 3


@pytest.mark.parametrize("name", ANSWERS)
@pytest.mark.parametrize(("typed", "key"), STOPS)
def test_a_stop_key_within_an_unfinished_answer_stops(
    name: str, typed: str, key: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(constants, "ESCAPE_DELAY", 0.0)
    answer = ANSWERS[name]
    for split in range(3, len(answer)):
        reader = Reader()
        for character in answer[:split]:
            reader.read(character, 0.0)
        assert key in keys_of(reader, typed, 0.3), split


@pytest.mark.parametrize("name", ANSWERS)
def test_a_bare_escape_within_an_unfinished_answer_stops(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(constants, "ESCAPE_DELAY", 0.0)
    reader = Reader()
    keys_of(reader, ANSWERS[name][:4], 0.0)
    said = keys_of(reader, "\x1b", 0.3) + keys_of(reader, "", 0.4) + keys_of(reader, "", 0.5)
    assert "escape" in said


@pytest.mark.parametrize("begun", ["\x1b]11;rgb:1c1c", "\x1b[?64;1", "\x1bP>|tmux", "\x1b_Gi=31"])
def test_an_answer_without_an_end_is_invalid_input_and_takes_no_more_keys(begun: str) -> None:
    reader = Reader()
    assert keys_of(reader, begun, 0.0) == []
    assert keys_of(reader, "", 0.9) == []
    assert keys_of(reader, "", 1.1) == [UNREADABLE]
    assert keys_of(reader, "x", 1.2) == ["x"]
    reader = Reader()
    assert UNREADABLE in keys_of(reader, begun + "y" * 500, 0.0), "nor does it become ever longer"


def test_no_key_that_is_known_is_taken_for_an_answer() -> None:
    nothing = [s for s in ANSI_SEQUENCES_KEYS if len(s) > 1 and not keys_of(Reader(), s, 0.0)]
    assert nothing == [s for s in nothing if s.startswith("\x1b\x1b") or s in ("\x1b[200~", "\x1b[201~")]


def test_an_answer_to_textual_reaches_it() -> None:
    reader = Reader()
    said = [message for character in ANSWERS["mode 2026"] for message in reader.read(character, 0.0)]
    assert [type(each).__name__ for each in said] == ["TerminalSupportsSynchronizedOutput"]


def test_the_cursor_is_heard_and_is_not_shift_f3() -> None:
    reader = Reader()
    assert keys_of(reader, "\x1b[1;2R", 0.0) == ["shift+f3"]
    said = [each for typed in ("\x1b[12;40R", "\x1b[?1;2R") for c in typed for each in reader.read(c, 0.0)]
    assert [(each.y + 1, each.x + 1) for each in said if isinstance(each, events.CursorPosition)] == [
        (12, 40),
        (1, 2),
    ]


# The mouse: it shows pages and chooses rows at rest, and no report of it is a key, moves or stops anything.


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
        app.ui.key_answer = ()
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
