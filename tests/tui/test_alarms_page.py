"""Page Alarms on the whole console: what waits, what is over, the selected one in full; and the log."""

from __future__ import annotations

import re
from collections.abc import Awaitable, Callable
from dataclasses import replace
from pathlib import Path

import pytest
from textual.pilot import Pilot

from console.session.station.alarms import CONDITIONS, FAULT, Priority, raised
from console.session.station.commands import Acknowledge
from console.session.station.state import Activity
from console.text.catalogue import load
from console.tui.app import ConsoleApp
from console.tui.keymap import PageName
from profiles.problem import Problem
from tests.tui.scenes import Scene, console_on, machine, rows_of, scene_of, settle
from tests.tui.stage import LANGUAGES, FixedControl

Act = Callable[[ConsoleApp, Pilot[None], FixedControl], Awaitable[None]]
SPINDLE, POLL = Problem(code="cut.spindle_stands"), Problem(code="link.silent", value="2 s")
QUIET = Scene(page=PageName.ALARMS, state=machine(Activity.READY))
IDENTIFIER = re.compile(r"[a-z]+[_.][a-z_]+")


play = console_on


async def text_after(app: ConsoleApp, pilot: Pilot[None], *keys: str) -> str:
    await pilot.press(*keys)
    await settle(app, pilot)
    return "\n".join(rows_of(app))


async def test_k_acknowledges_the_selected_alarm_and_the_foremost_again_after_it(tmp_path: Path) -> None:
    async with play(scene_of(PageName.ALARMS), tmp_path) as (app, pilot, control):
        front, second, *_ = app.ui.log.alarms.listed
        await pilot.press("down", "k")
        assert control.orders[-1] == Acknowledge(shown=(second.problem,))
        await pilot.press("up", "ㅏ")
        assert control.orders[-1] == Acknowledge(shown=(front.problem,))
        await pilot.press("end", "k")  # that one is over: k is as on every page
        assert control.orders[-1] == Acknowledge(shown=(front.problem,))
        await pilot.press("a")
        assert control.orders[-1] == Acknowledge(shown=(front.problem, second.problem))


async def test_what_has_ended_is_gone_when_it_is_acknowledged_and_stays_among_those_that_are_over(
    tmp_path: Path,
) -> None:
    async with play(QUIET, tmp_path) as (app, pilot, control):
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


async def test_the_selection_stays_on_its_alarm_while_others_come(tmp_path: Path) -> None:
    async with play(scene_of(PageName.ALARMS), tmp_path) as (app, pilot, control):
        before = await text_after(app, pilot, "down")
        assert "No. 3 " in before
        alarms = raised(control.state.alarms, SPINDLE, Priority.HIGH, 99.0)
        control.state = replace(control.state, alarms=raised(alarms, POLL, Priority.HIGH, 99.5))
        after = await text_after(app, pilot)
        assert "▸!!!    3 " in after
        assert "No. 3 " in after


@pytest.mark.parametrize(
    ("priority", "sign", "word"),
    [(Priority.HIGH, "!!!", "high"), (Priority.MEDIUM, "!!", "medium"), (Priority.LOW, "!", "low")],
)
async def test_each_priority_has_a_sign_and_a_word(
    priority: Priority, sign: str, word: str, tmp_path: Path
) -> None:
    async with play(QUIET, tmp_path) as (app, pilot, control):
        control.state = replace(control.state, alarms=raised((), SPINDLE, priority, 90.0))
        shown = await text_after(app, pilot, "home")
        assert re.search(rf"▸{re.escape(sign)} +1 ", shown), shown
        assert f"{word} priority" in shown


@pytest.mark.parametrize("language", LANGUAGES)
async def test_every_alarm_is_said_in_words_and_whole(language: str, tmp_path: Path) -> None:
    """The sentence in the panel of the selected one, or in the list of messages where it is longer than that."""
    text = load(language)
    async with play(QUIET, tmp_path, language=language) as (app, pilot, control):
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


async def test_no_key_breaks_an_empty_page(tmp_path: Path) -> None:
    async with play(QUIET, tmp_path) as (app, pilot, control):
        keys = ("up", "down", "pageup", "pagedown", "home", "end", "a", "k")
        shown = await text_after(app, pilot, *keys)
        assert "No alarm in this session." in shown
        assert shown.count("╭") == 1, "an empty panel"
        await text_after(app, pilot, "l", *keys, "w", "w", "8", "l")
        assert (control.stops, control.kills) == ([], [])
