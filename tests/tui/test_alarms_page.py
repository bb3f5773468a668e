"""Page Alarms on the whole console: what waits, what is over, the selected one in full; and the log."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Awaitable, Callable
from dataclasses import replace
from pathlib import Path

import pytest
from textual.pilot import Pilot

from console.session.station.alarms import CONDITIONS, FAULT, Priority, raised
from console.session.station.commands import Acknowledge, Home, Jog
from console.session.station.session_log import LOG_MOST, LogKind
from console.session.station.state import Activity, StopState
from console.text.catalogue import load
from console.tui.app import ConsoleApp
from console.tui.keymap import PageName
from drivers.lathe.snapshot import AxisName
from profiles.problem import Problem
from tests.tui.scenes import Scene, application, machine, played, rows_of, scene_of, settle
from tests.tui.stage import LANGUAGES, FixedControl

Act = Callable[[ConsoleApp, Pilot[None], FixedControl], Awaitable[None]]
SPINDLE, POLL = Problem(code="cut.spindle_stands"), Problem(code="link.silent", value="2 s")
QUIET = Scene(page=PageName.ALARMS, state=machine(Activity.READY))
IDENTIFIER = re.compile(r"[a-z]+[_.][a-z_]+")


def play(scene: Scene, act: Act, data: Path, *, language: str = "en", size: tuple[int, int] = (80, 24)) -> None:
    app, control = application(scene, data, language=language)

    async def run() -> None:
        async with played(app, scene, size) as pilot:
            await act(app, pilot, control)

    asyncio.run(run())
    assert app.fault is None


async def text_after(app: ConsoleApp, pilot: Pilot[None], *keys: str) -> str:
    await pilot.press(*keys)
    await settle(app, pilot)
    return "\n".join(rows_of(app))


def test_k_acknowledges_the_selected_alarm_and_the_foremost_again_after_it(tmp_path: Path) -> None:
    async def act(app: ConsoleApp, pilot: Pilot[None], control: FixedControl) -> None:
        front, second, *_ = app.ui.log.alarms.listed
        await pilot.press("down", "k")
        assert control.orders[-1] == Acknowledge(shown=(second.problem,))
        await pilot.press("up", "ㅏ")
        assert control.orders[-1] == Acknowledge(shown=(front.problem,))
        await pilot.press("end", "k")  # that one is over: k is as on every page
        assert control.orders[-1] == Acknowledge(shown=(front.problem,))
        await pilot.press("a")
        assert control.orders[-1] == Acknowledge(shown=(front.problem, second.problem))

    play(scene_of(PageName.ALARMS), act, tmp_path)


def test_what_has_ended_is_gone_when_it_is_acknowledged_and_stays_among_those_that_are_over(
    tmp_path: Path,
) -> None:
    async def act(app: ConsoleApp, pilot: Pilot[None], control: FixedControl) -> None:
        alarm = raised((), SPINDLE, Priority.HIGH, 90.0)
        for alarms, word in (
            (alarm, "new"),
            ((replace(alarm[0], active=False),), "returned"),
            ((), "over"),
        ):
            control.state = replace(control.state, alarms=alarms)
            shown = await text_after(app, pilot, "home")
            assert re.search(rf"1 08:51:50 {word} ", shown), shown
        assert "Alarms (0) · over (1)" in shown
        assert "no alarms" in shown
        assert "acknowledged 08:52:00 · ended 08:52:00" in shown

    play(QUIET, act, tmp_path)


def test_the_selection_stays_on_its_alarm_while_others_come(tmp_path: Path) -> None:
    async def act(app: ConsoleApp, pilot: Pilot[None], control: FixedControl) -> None:
        before = await text_after(app, pilot, "down")
        assert "No. 3 " in before
        alarms = raised(control.state.alarms, SPINDLE, Priority.HIGH, 99.0)
        control.state = replace(control.state, alarms=raised(alarms, POLL, Priority.HIGH, 99.5))
        after = await text_after(app, pilot)
        assert "▸!!!    3 " in after
        assert "No. 3 " in after

    play(scene_of(PageName.ALARMS), act, tmp_path)


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_alarm_is_said_in_words_and_whole(language: str, tmp_path: Path) -> None:
    """The sentence in the panel of the selected one, or in the list of messages where it is longer than that."""
    text = load(language)

    async def act(app: ConsoleApp, pilot: Pilot[None], control: FixedControl) -> None:
        for code in sorted(CONDITIONS):
            value = "tool: amplifier_fault, spindle: fatal_following_error" if code == FAULT else "3"
            problem = Problem(code=code, value=value, key="rest" if code == FAULT else "")
            control.state = replace(control.state, alarms=raised((), problem, Priority.HIGH, 90.0))
            shown = await text_after(app, pilot)
            panel = shown[shown.index("╰") :]
            assert IDENTIFIER.findall(panel) == [], panel
            said = "".join(text.problem(problem).split())
            in_panel = "".join(panel.replace("│", "").split())
            if said not in in_panel:
                assert text("panel.more") in panel
                read = "".join((await text_after(app, pilot, "w")).split())
                assert said in read
                await pilot.press("w")

    play(QUIET, act, tmp_path, language=language)


def log_of(app: ConsoleApp) -> list[tuple[LogKind, str]]:
    return [
        (entry.kind, entry.word or (entry.problem.code if entry.problem else "")) for entry in app.ui.log.entries
    ]


def test_the_log_has_commands_stops_and_messages_in_their_order_with_their_times(tmp_path: Path) -> None:
    async def act(app: ConsoleApp, pilot: Pilot[None], control: FixedControl) -> None:
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
            "08:51:56 at rest      1.5 s after the stop",
            f"08:52:00 message      {app.ui.text.problem(Problem(code='session.busy'))[:30]}",
        ):
            assert row in shown, shown
        assert "Alarms (0)" in await text_after(app, pilot, "ㅣ")

    play(QUIET, act, tmp_path)


def test_a_command_that_the_machine_did_not_take_is_logged_as_such(tmp_path: Path) -> None:
    async def act(app: ConsoleApp, pilot: Pilot[None], control: FixedControl) -> None:
        control.post = lambda intent: False  # type: ignore[method-assign]
        app.ui.control.post(Home())
        assert "08:52:00 not taken    home" in await text_after(app, pilot, "l")

    play(QUIET, act, tmp_path)


def test_what_was_typed_in_free_text_is_not_in_the_log(tmp_path: Path) -> None:
    """A name that cannot be a file: its refusal repeats it on the screen, but not in the log."""
    scene = replace(scene_of(PageName.SETUP), keys=())

    async def act(app: ConsoleApp, pilot: Pilot[None], _: FixedControl) -> None:
        await pilot.press("s", *["backspace"] * 40, *"geheim", "slash", *"x", "enter")
        await settle(app, pilot)
        assert any("geheim" in problem.value for problem in app.ui.said), app.ui.said
        logged = [entry for entry in app.ui.log.entries if entry.problem is not None]
        assert logged
        assert "geheim" not in repr(app.ui.log.entries)

    play(scene, act, tmp_path)


def test_a_long_log_is_bounded_scrolls_and_follows_its_end(tmp_path: Path) -> None:
    def said(n: int) -> tuple[Problem, ...]:
        return (Problem(code="screen.key_in_motion", key=f"<{n}>"),)

    async def act(app: ConsoleApp, pilot: Pilot[None], control: FixedControl) -> None:
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

    play(QUIET, act, tmp_path)


def test_no_key_breaks_an_empty_page(tmp_path: Path) -> None:
    async def act(app: ConsoleApp, pilot: Pilot[None], control: FixedControl) -> None:
        keys = ("up", "down", "pageup", "pagedown", "home", "end", "a", "k")
        shown = await text_after(app, pilot, *keys)
        assert "No alarm in this session." in shown
        assert shown.count("╭") == 1, "an empty panel"
        await text_after(app, pilot, "l", *keys, "w", "w", "l")
        assert (control.stops, control.kills) == ([], [])

    play(QUIET, act, tmp_path)
