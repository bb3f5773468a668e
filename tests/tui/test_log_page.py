"""Page Log on the whole console: what is in it, how it is scrolled, searched and exported."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from console.session.station.commands import Home, Jog
from console.session.station.history.session_log import LOG_MOST, LogKind
from console.session.station.state import Activity, StopState
from console.tui.app import ConsoleApp
from console.tui.keymap import PageName
from drivers.lathe.snapshot import AxisName
from profiles.problem import Problem
from tests.tui.scenes import scene_of, settle
from tests.tui.test_alarms_page import QUIET, play, text_after


def log_of(app: ConsoleApp) -> list[tuple[LogKind, str]]:
    return [
        (entry.kind, entry.word or (entry.problem.code if entry.problem else "")) for entry in app.ui.log.entries
    ]


async def test_the_log_has_commands_stops_and_messages_in_their_order_with_their_times(tmp_path: Path) -> None:
    async with play(QUIET, tmp_path) as (app, pilot, control):
        app.ui.control.post(Home())
        for _ in range(12):
            app.ui.control.post(Jog(axis=AxisName.TOOL, distance=-0.01))
        app.tick()
        stop = StopState(reason="space", killed=False, sent_s=95.0)
        control.state = replace(control.state, stop=stop, activity=Activity.STOPPING)
        app.tick()
        control.state = replace(control.state, stop=replace(stop, rest_s=96.5), activity=Activity.STOPPED)
        app.tick()
        control.state = replace(control.state, refusals=(Problem(code="session.busy"),))
        shown = await text_after(app, pilot, "l")
        assert log_of(app) == [
            (LogKind.COMMAND, "Home"),
            (LogKind.COMMAND, "Jog"),
            (LogKind.STOPPED, "space"),
            (LogKind.REST, "1.5"),
            (LogKind.MESSAGE, "session.busy"),
        ]
        for row in (
            "08:52:00 command      home",
            "08:52:00 command      jog: X tool -0.010 mm ×12",
            "08:51:55 stop ",
            "08:51:56 at rest      proven 1.5 s after the stop",
            f"08:52:00 message      {app.ui.text.problem(Problem(code='session.busy'))[:30]}",
        ):
            assert row in shown, shown
        assert "Alarms (0)" in await text_after(app, pilot, "8")


async def test_a_command_that_the_machine_did_not_take_is_logged_as_such(tmp_path: Path) -> None:
    async with play(QUIET, tmp_path) as (app, pilot, control):
        control.post = lambda intent: False  # type: ignore[method-assign]
        app.ui.control.post(Home())
        assert "08:52:00 not taken    home" in await text_after(app, pilot, "l")


async def test_what_was_typed_in_free_text_is_not_in_the_log(tmp_path: Path) -> None:
    """A name that cannot be a file: its refusal repeats it on the screen, but not in the log."""
    scene = replace(scene_of(PageName.SETUP), keys=())
    async with play(scene, tmp_path) as (app, pilot, _):
        await pilot.press("s", *["backspace"] * 40, *"geheim", "slash", *"x", "enter")
        await settle(app, pilot)
        assert any("geheim" in problem.value for problem in app.ui.said), app.ui.said
        logged = [entry for entry in app.ui.log.entries if entry.problem is not None]
        assert logged
        assert "geheim" not in repr(app.ui.log.entries)


async def test_a_long_log_is_bounded_scrolls_and_follows_its_end(tmp_path: Path) -> None:
    def said(n: int) -> tuple[Problem, ...]:
        return (Problem(code="screen.key_in_motion", key=f"<{n}>"),)

    async with play(QUIET, tmp_path) as (app, pilot, control):
        last = LOG_MOST + 20
        for n in range(1, last + 1):
            control.state = replace(control.state, refusals=said(n))
            app.tick()
        shown = await text_after(app, pilot, "l")
        assert len(app.ui.log.entries) == LOG_MOST
        assert f"<{last}>" in shown
        assert "older: 20, no longer kept" in shown
        assert "<21>" in await text_after(app, pilot, "home")
        shown = await text_after(app, pilot, "up", "up", "down")
        assert "<21>" not in shown
        here = await text_after(app, pilot, "pagedown")
        control.state = replace(control.state, refusals=said(last + 1))
        there = await text_after(app, pilot)
        bottoms = [re.findall(r"│.*<(\d+)>", shown)[-1] for shown in (here, there)]
        assert bottoms[0] == bottoms[1], "it moved while it was read"
        assert int(bottoms[0]) < 40
        assert f"<{last + 1}>" in await text_after(app, pilot, "end")


async def test_a_search_shows_what_was_found_and_an_empty_one_everything(tmp_path: Path) -> None:
    async with play(scene_of(PageName.LOG), tmp_path) as (app, pilot, control):
        shown = await text_after(app, pilot, "slash", *"ALARM disk")
        assert "[F12] STOP MOTION" in shown and "alarm ended" in shown, "a search counts with its Enter"
        shown = await text_after(app, pilot, "enter")
        assert '"ALARM disk", 1 of 10' in shown and "no. 4" in shown and "no. 1" not in shown
        assert "No entry has these words." in await text_after(app, pilot, "slash", *"xyzzy", "enter")
        shown = await text_after(app, pilot, "slash", *["backspace"] * 20, "enter")
        assert "Log of this session (10)" in shown and "no. 2" in shown
        assert [problem.code for problem in app.ui.said] == []
        await pilot.press("enter")
        assert [problem.code for problem in app.ui.said] == ["screen.log_no_entry"]
        assert (control.stops, control.kills) == ([], [])


async def test_an_export_is_a_text_file_with_every_entry_and_can_be_refused(tmp_path: Path) -> None:
    async with play(scene_of(PageName.LOG), tmp_path) as (app, pilot, _):
        before = app.ui.log.entries
        await text_after(app, pilot, "slash", *"disk", "enter", "x")
        (path,) = (tmp_path / "logs").iterdir()
        assert str(path) in app.ui.said[0].value and path.stat().st_mode & 0o077 == 0
        title, blank, *rows = path.read_text(encoding="utf-8").splitlines()
        assert not blank and title.startswith("Log of machine lee-2001-lathe, exported ")
        assert len(rows) == len(before), "an entry is one line, whatever is in it"
        assert rows[0].split()[:2] == ["2026-01-02T08:50:40", "alarm"] and "disk full" in "".join(rows)
        path.unlink()
        (tmp_path / "logs").rmdir()
        (tmp_path / "logs").write_text("a file in its place")
        await text_after(app, pilot, "x")
        assert [problem.code for problem in app.ui.said] == ["file.not_writable"]


async def test_it_is_one_of_the_pages_of_more_too(tmp_path: Path) -> None:
    async with play(QUIET, tmp_path) as (app, pilot, _):
        await text_after(app, pilot, "0", "l")
        assert app.page is PageName.LOG
        await text_after(app, pilot, "8", "ㅣ")
        assert app.page is PageName.LOG
