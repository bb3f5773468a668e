"""Page Alarms on the whole console: what waits, what is over, the selected one in full; and the log."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from textual.pilot import Pilot

from console.session.appearance import Appearance
from console.session.station.alarms import (
    CONDITIONS,
    FAULT,
    Alarms,
    Priority,
    acknowledge_alarms,
    clear_alarms,
    raise_alarm,
)
from console.session.station.commands import Acknowledge, Home, Jog
from console.session.station.history.session_log import LOG_MOST, LogKind
from console.session.station.state import Activity, StationState, StopState
from console.text.catalogue import load
from console.tui.app import ConsoleApp
from console.tui.application.bell import APART_S, Bell
from console.tui.application.lost_lines import lost_step
from console.tui.key_help import TERMS, glossary_lines
from console.tui.keymap import PageName
from console.tui.lines import plain_text, width_of
from drivers.lathe.snapshot import AxisName
from profiles.problem import Problem
from profiles.words.sentences import entries_in
from tests.tui import align_stage
from tests.tui.page_stage import run_apart
from tests.tui.run_stage import shown, state
from tests.tui.scenes import (
    Scene,
    console_at,
    console_on,
    machine,
    rows_of,
    scene_of,
    settle,
)
from tests.tui.stage import LANGUAGES

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
        front, second, *_ = app.ui.log.alarms.list_entries
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
        alarm = raise_alarm((), SPINDLE, Priority.HIGH, 90.0)
        for alarms, word in ((alarm, "new"), ((replace(alarm[0], active=False),), "returned"), ((), "over")):
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
        alarms = raise_alarm(control.state.alarms, SPINDLE, Priority.HIGH, 99.0)
        control.state = replace(control.state, alarms=raise_alarm(alarms, POLL, Priority.HIGH, 99.5))
        after = await text_after(app, pilot)
        assert "▸!!!    3 " in after
        assert "No. 3 " in after


async def test_each_priority_has_a_sign_and_a_word_and_no_key_breaks_an_empty_page(tmp_path: Path) -> None:
    keys = ("up", "down", "pageup", "pagedown", "home", "end", "a", "k")
    async with play(QUIET, tmp_path) as (app, pilot, control):
        shown = await text_after(app, pilot, *keys)
        assert "No alarm in this session." in shown
        assert shown.count("╭") == 1, "an empty panel"
        await text_after(app, pilot, "l", *keys, "w", "w", "8", "l", "8")
        assert (control.stops, control.kills) == ([], [])
        for priority, sign, word in (
            (Priority.HIGH, "!!!", "high"),
            (Priority.MEDIUM, "!!", "medium"),
            (Priority.LOW, "!", "low"),
        ):
            problem = Problem(code="cut.spindle_stands", value=word)
            control.state = replace(control.state, alarms=raise_alarm((), problem, priority, 90.0))
            shown = await text_after(app, pilot, "home")
            assert re.search(rf"▸{re.escape(sign)} +\d ", shown), shown
            assert f"{word} priority" in shown


@pytest.mark.parametrize("language", LANGUAGES)
async def test_every_alarm_is_said_in_words_and_whole(language: str, tmp_path: Path) -> None:
    """The sentence in the panel of the selected one, or in the list of messages where it is longer than that."""
    text = load(language)
    async with play(QUIET, tmp_path, language=language) as (app, pilot, control):
        for code in sorted(CONDITIONS):
            value = "tool: amplifier_fault, spindle: fatal_following_error" if code == FAULT else "3"
            problem = Problem(code=code, value=value, key="rest" if code == FAULT else "")
            control.state = replace(control.state, alarms=raise_alarm((), problem, Priority.HIGH, 90.0))
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


# Page Log on the whole console: what is in it, how it is scrolled, searched and exported.


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
        assert any("geheim" in problem.value for problem in app.ui.key_answer), app.ui.key_answer
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
        assert [problem.code for problem in app.ui.key_answer] == []
        await pilot.press("enter")
        assert [problem.code for problem in app.ui.key_answer] == ["screen.log_no_entry"]
        assert (control.stops, control.kills) == ([], [])


async def test_an_export_is_a_text_file_with_every_entry_and_can_be_refused(tmp_path: Path) -> None:
    async with play(scene_of(PageName.LOG), tmp_path) as (app, pilot, _):
        before = app.ui.log.entries
        await text_after(app, pilot, "slash", *"disk", "enter", "x")
        (path,) = (tmp_path / "logs").iterdir()
        assert str(path) in app.ui.key_answer[0].value and path.stat().st_mode & 0o077 == 0
        title, blank, *rows = path.read_text(encoding="utf-8").splitlines()
        assert not blank and title.startswith("Log of machine lee-2001-lathe, exported ")
        assert len(rows) == len(before), "an entry is one line, whatever is in it"
        assert rows[0].split()[:2] == ["2026-01-02T08:50:40", "alarm"] and "disk full" in "".join(rows)
        path.unlink()
        (tmp_path / "logs").rmdir()
        (tmp_path / "logs").write_text("a file in its place")
        await text_after(app, pilot, "x")
        assert [problem.code for problem in app.ui.key_answer] == ["file.not_writable"]


async def test_it_is_one_of_the_pages_of_more_too(tmp_path: Path) -> None:
    async with play(QUIET, tmp_path) as (app, pilot, _):
        await text_after(app, pilot, "0", "l")
        assert app.page is PageName.LOG
        await text_after(app, pilot, "8", "ㅣ")
        assert app.page is PageName.LOG


# The bell: once for a new alarm of high priority, rarely in a flood, never for an answer; off, it says so.


RESET, HEARTBEAT = Problem(code="controller.was_reset"), Problem(code="heartbeat.lost")


def high(alarms: Alarms, *problems: Problem) -> Alarms:
    for problem in problems:
        alarms = raise_alarm(alarms, problem, Priority.HIGH, 0.0)
    return alarms


def test_each_new_alarm_of_high_priority_rings_once_and_a_flood_rarely() -> None:
    bell, first, both = Bell(), high((), RESET), high((), RESET, HEARTBEAT)
    assert not bell.rings((), 0.0)
    assert not bell.rings(raise_alarm((), RESET, Priority.MEDIUM, 0.0), 0.0)
    assert [bell.rings(first, 0.1 * n) for n in range(100)] == [True] + [False] * 99
    assert not bell.rings(acknowledge_alarms(first), 10.0)
    assert bell.rings(high(acknowledge_alarms(first), RESET), 20.0), "it came again"
    assert not bell.rings(both, 20.0 + 0.9 * APART_S)
    assert bell.rings(high(clear_alarms(both, RESET.code), RESET), 20.0 + 1.1 * APART_S)
    flood = Bell()
    many = [high((), *(Problem(code=f"a.{n}") for n in range(m))) for m in range(1, 101)]
    assert sum(flood.rings(each, 0.1 * n) for n, each in enumerate(many)) == 2


def rung(data: Path, appearance: Appearance) -> tuple[list[str], str]:
    """What rang while an answer, an alarm, and nothing came; and the row of alarms before it."""
    heard, now = list[str](), ["start"]
    given = {"appearance": appearance, "language": appearance.language}

    async def run() -> str:
        async with console_at(data, PageName.ALIGN, align_stage.state(), **given) as (app, pilot, control):
            app.bell = lambda: heard.append(now[0])  # type: ignore[method-assign]
            row = rows_of(app)[1]
            now[0] = "answer"
            await pilot.press("pageup")
            app.tick()
            assert app.ui.key_answer
            now[0] = "alarm"
            control.state = replace(control.state, alarms=high((), RESET))
            app.tick()
            now[0] = "later"
            for n in range(20):
                control.at(101.0 + n)
                app.tick()
            return row

    row = run_apart(run)
    return heard, row


def test_the_terminal_rings_for_an_alarm_and_not_for_an_answer(tmp_path: Path) -> None:
    heard, row = rung(tmp_path, Appearance())
    assert heard == ["alarm"]
    assert row.split() == ["·", "no", "alarms"]


@pytest.mark.parametrize("language", LANGUAGES)
def test_switched_off_it_is_silent_and_says_so(tmp_path: Path, language: str) -> None:
    heard, row = rung(tmp_path, Appearance(bell="off", language=language))
    assert heard == []
    assert {"en": "bell off", "ko": "벨 꺼짐"}[language] in row


# What the screens advise while the machine does not answer: no restart where they come back by themselves.


def lost(code: str, *, stopped: bool) -> StationState:
    """Return the moment after a poll failed: nothing is known yet of how long it lasts."""
    stop = StopState(reason=code, killed=False, sent_s=99.0, delivered=False) if stopped else None
    return state(
        activity=Activity.LOST, stop=stop, alarms=raise_alarm((), Problem(code=code), Priority.HIGH, 99.0)
    )


@pytest.mark.parametrize("code", ["link.silent", "link.not_in_step"])
def test_a_controller_that_is_silent_is_asked_again_and_no_restart_is_advised(code: str) -> None:
    now = lost(code, stopped=True)
    said = lost_step(load("en"), now)
    assert "stop is sent again until it does" in said and said.endswith("when it answers, press F2.")
    assert "restart" not in said + shown(now).words


@pytest.mark.parametrize("stopped", [True, False])
def test_where_nothing_is_tried_again_the_way_is_to_quit(stopped: bool) -> None:
    """The connection is gone and is not opened again."""
    assert lost_step(load("en"), lost("link.lost", stopped=stopped)).endswith("quit with ^Q and restart.")


def test_a_machine_that_has_never_answered_is_asked_again() -> None:
    said = lost_step(load("en"), lost("link.not_in_step", stopped=False))
    assert "opens the link again and asks" in said and said.endswith("^Q quits.")


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_alarm_of_a_silent_controller_names_no_restart_either(language: str) -> None:
    said = load(language).problem(Problem(code="link.not_in_step", value="0.3 s"))
    assert "0.3 s" in said and "restart" not in said and "다시 시작" not in said


# The terms of the pages: each is explained in both languages, in one line, and stands on its page.


GOLDENS = Path(__file__).with_name("goldens")
TEXTS = Path(__file__).parents[2] / "console" / "text"
FILES = {"preview": ("preview_page",), "inspect": ("inspect_page",), "records": ("records_page",)}


def page_text(page: PageName, language: str) -> str:
    """What the page shows in its kept pictures, and the sentences of its catalogue that they do not show."""
    shown = "".join(path.read_text("utf-8") for path in sorted(GOLDENS.glob(f"{page}-*-{language}.txt")))
    said = entries_in(TEXTS / language)
    names = (f"{page}_page.", f"{page}.", f"key.{page}.", f"key_help.{page}.")
    return (shown + " ".join(words for key, words in said.items() if key.startswith(names))).casefold()


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("page", TERMS)
def test_every_term_stands_on_its_page_and_is_explained_in_one_line(page: PageName, language: str) -> None:
    text, shown = load(language), page_text(page, language)
    rows = glossary_lines(text, page, 78)
    assert all(width_of(row) <= 78 for row in rows) and len(rows) <= 18
    assert len(rows) == len(TERMS[page]) + 3, "one line each, between the title and the last row"
    for term, row in zip(TERMS[page], rows[1:], strict=False):
        assert text(f"term.{term}").casefold() in shown, term
        assert plain_text([row]).startswith(text(f"term.{term}")) and text(f"glossary.{term}") in plain_text([row])


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_explained_term_is_one_of_a_page(language: str) -> None:
    keys = {key for key in entries_in(TEXTS / language) if key.startswith(("term.", "glossary."))}
    used = {term for terms in TERMS.values() for term in terms}
    expected = {f"{kind}.{term}" for kind in ("term", "glossary") for term in used} | {"glossary.title"}
    assert keys == expected
