"""Messages on the whole console: they take lines from the page, stop and keys stay, and w shows every one."""

from __future__ import annotations

import random
from contextlib import AbstractAsyncContextManager
from dataclasses import replace
from functools import partial
from itertools import takewhile
from pathlib import Path

import pytest
from textual.pilot import Pilot

from console.session.station.alarms import Priority, raise_alarm
from console.session.station.state import Activity, StationState, StopState
from console.text.catalogue import load
from console.tui.app import ConsoleApp
from console.tui.keymap import PageName, actions_of
from console.tui.page import SMALLEST
from console.tui.pages.fields import name_field
from profiles.problem import Problem
from tests.tui import align_stage, run_stage
from tests.tui.scenes import Scene, console_on, rows_of, scene_of, settle
from tests.tui.stage import LANGUAGES, FixedControl, experiment

Size = tuple[int, int]

UNDELIVERED = run_stage.STATES["stop not delivered"]
REFUSED = tuple(
    Problem(code=code, key="spindle_speed_rpm", value="12345.678 rpm", limit="> 0, <= 5000 rpm")
    for code in ("rule.force_differs", "stops.other_settings", "rule.wall_border")
)
ENDLESS = (Problem(code="session.fault", value="lathe " * 300), *REFUSED)


play = partial(console_on, language="ko")


def at(page: PageName, state: StationState) -> Scene:
    return Scene(page=page, state=state, work=experiment())


def one_word(text: str) -> str:
    return "".join(text.split())


@pytest.mark.first(2)
@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("size", [(60, 18), (80, 24), (160, 48)])
@pytest.mark.parametrize("page", [PageName.JOBS, PageName.RUN])
async def test_a_stop_that_failed_is_said_in_full_beside_the_stop_key(
    page: PageName, size: Size, language: str, tmp_path: Path
) -> None:
    text = load(language)
    async with play(at(page, UNDELIVERED), tmp_path, size=size, language=language) as (app, _, _):
        rows = rows_of(app)
        assert len(rows) == size[1]
        assert rows[-1].rstrip().endswith(f"? {text('key.help')}")
        assert rows[-2].startswith(f" {text('frame.stop')} ")
        beside = " ".join(rows[-4:-1] if size[0] < 80 else rows[-2:-1])
        assert one_word(text("frame.not_delivered")) in one_word(beside.replace(text("frame.stop"), ""))


@pytest.mark.parametrize("page", PageName)
@pytest.mark.first(2)
async def test_an_answer_takes_lines_from_the_page_and_gives_them_back(page: PageName, tmp_path: Path) -> None:
    text = load("ko")
    scene = scene_of(page)
    async with play(replace(scene, state=replace(scene.state, alarms=())), tmp_path) as (app, pilot, _):
        before = rows_of(app)
        answered = app.ui.key_answer
        for said in (REFUSED, ENDLESS):
            app.ui.key_answer = said
            await settle(app, pilot)
            rows = rows_of(app)
            assert app.ui.key_answer == said, "something went wrong on a page with little room"
            assert (len(rows), rows[-1]) == (24, before[-1])
            assert text("frame.stop") in rows[-2] or text("frame.stop_in_text") in rows[-2]
            assert rows[0] == before[0]
        app.ui.key_answer = REFUSED
        await settle(app, pilot)
        rows = rows_of(app)
        more = f"+2 {text('frame.all')}"
        assert more in rows[1]
        shown = one_word(" ".join(rows[1:9]).replace(more, ""))
        assert one_word(text.problem(name_field(REFUSED[0], text))) in shown
        app.ui.key_answer = answered
        await settle(app, pilot)
        assert rows_of(app) == before or page is PageName.LOG  # which has the answers, too


async def read_through(app: ConsoleApp, pilot: Pilot[None]) -> str:
    """Everything that the open list shows, scrolled to its end."""
    seen: list[str] = []
    for _ in range(40):
        await settle(app, pilot)
        # A message may straddle two pages: what is below the list is none of it.
        shown = list(takewhile(lambda row: "PgDn" not in row, (row.rstrip() for row in rows_of(app))))
        fresh = [row for row in shown if row not in seen]
        if not fresh:
            break
        seen += fresh
        await pilot.press("pagedown")
    return one_word(" ".join(seen))


@pytest.mark.parametrize("language", LANGUAGES)
async def test_w_shows_all_answers_and_alarms_and_what_the_page_asks_for(language: str, tmp_path: Path) -> None:
    """On Set-up in a low panel: findings that had no room, several answers, an alarm."""
    text = load(language)
    scene = replace(scene_of(PageName.SETUP), keys=())
    alarms = raise_alarm((), Problem(code="machine.fault", key="X", value="tool"), Priority.HIGH, 1.0)
    async with play(scene, tmp_path, language=language) as (app, pilot, control):
        before = rows_of(app)
        control.state = replace(control.state, alarms=alarms)
        app.ui.key_answer = REFUSED
        await pilot.press("w")
        shown = await read_through(app, pilot)
        for problem in REFUSED:
            assert one_word(text.problem(name_field(problem, text))) in shown
        assert one_word(text.problem(alarms[0].problem)) in shown
        assert one_word(text("name.rule.feed_over_land")) in shown
        assert app.ui.key_answer == REFUSED
        control.state = replace(control.state, alarms=())
        await pilot.press("backspace")
        await settle(app, pilot)
        assert rows_of(app) == before


async def test_w_closes_what_w_opened_and_a_hangul_layout_has_it_too(tmp_path: Path) -> None:
    async with play(scene_of(PageName.RUN), tmp_path) as (app, pilot, _):
        before = rows_of(app)
        for key in ("w", "ㅈ"):
            await pilot.press(key, "end")
            await settle(app, pilot)
            assert load("ko")("messages.close") in "\n".join(rows_of(app))
            await pilot.press(key)
            await settle(app, pilot)
            assert rows_of(app) == before


@pytest.mark.parametrize("opening", ["w", "?"])
async def test_while_a_list_is_read_its_keys_jog_nothing(opening: str, tmp_path: Path) -> None:
    """With the jog enabled PgDn would turn the spindle, and the arrows move the tool."""
    scene = at(PageName.ALIGN, align_stage.state(align_stage.VALID))
    async with play(scene, tmp_path) as (_, pilot, control):
        await pilot.press("j", opening, "pagedown", "down", "pageup", "up")
        assert (control.orders, control.stops) == ([], [])
        await pilot.press("backspace", "pagedown")
        assert len(control.orders) == 1


async def test_in_motion_a_message_is_read_without_a_stop_and_other_keys_stop(tmp_path: Path) -> None:
    async with play(at(PageName.RUN, run_stage.cutting()), tmp_path) as (_, pilot, control):
        assert control.state.activity is Activity.CUTTING
        await pilot.press("w", "pagedown", "up")
        assert (control.orders, control.stops) == ([], [])
        await pilot.press("x")
        assert control.stops == ["unbound x"]
        await pilot.press("space")
        assert control.stops == ["unbound x", "space"]
        await pilot.press("w", "pagedown")
        assert control.stops == ["unbound x", "space", "unbound PgDn"], "PgDn means nothing on Run"


async def test_an_entry_stays_in_its_row_while_an_answer_comes_and_goes_on_after_a_list(tmp_path: Path) -> None:
    """The form moves up under the cursor: what is typed is seen where its brackets are."""
    async with play(scene_of(PageName.SETUP), tmp_path) as (app, pilot, _):
        for said in (ENDLESS, ()):
            app.ui.key_answer = said
            await settle(app, pilot)
            assert [row for row in rows_of(app) if "▸" in row and "[1,200     ]" in row]
        for key, expected in (("w", "[1,2009    ]"), ("?", "[1,20099   ]")):
            await pilot.press(key)
            await settle(app, pilot)
            await pilot.press(*([key] if key == "w" else [key, key, key]))
            await settle(app, pilot)
            await pilot.press("9")
            await settle(app, pilot)
            assert [row for row in rows_of(app) if expected in row]


@pytest.mark.parametrize("language", LANGUAGES)
async def test_a_terminal_that_is_too_small_still_says_what_cannot_wait(language: str, tmp_path: Path) -> None:
    text = load(language)
    alarms = raise_alarm((), Problem(code="machine.not_at_rest", value="5 s"), Priority.HIGH, 1.0)
    stop = StopState(reason="space", killed=False, sent_s=98.0, delivered=False)
    scene = at(PageName.JOBS, replace(UNDELIVERED, stop=stop, alarms=alarms))
    async with play(scene, tmp_path, size=(40, 12), language=language) as (app, _, _):
        shown = one_word(" ".join(rows_of(app)))
        for sentence in (text("frame.not_delivered"), text.problem(alarms[0].problem)):
            assert one_word(sentence) in shown
        assert "60x18" in shown


# A terminal that is too small says so, starts nothing, still stops and leaves; and no resize breaks anything.


USUAL = (80, 24)
TOO_SMALL = ((59, 24), (80, 17), (20, 5), (1, 1))
STORM = 12
"""Sizes that each page goes through: others on each of them."""


def in_scene(
    page: PageName, data: Path, *, size: Size = USUAL, language: str = "en"
) -> AbstractAsyncContextManager[tuple[ConsoleApp, Pilot[None], FixedControl]]:
    """Go to a page in its scene."""
    return console_on(scene_of(page), data, size, language=language)


async def resize(app: ConsoleApp, pilot: Pilot[None], size: Size) -> None:
    await pilot.resize_terminal(*size)
    await settle(app, pilot)


@pytest.mark.parametrize("language", LANGUAGES)
async def test_a_terminal_that_is_too_small_says_what_it_needs(language: str, tmp_path: Path) -> None:
    """In a few rows the size comes first."""
    text = load(language)
    target = [*text("small.title").split(), *text("small.say", columns=SMALLEST[0], rows=SMALLEST[1]).split()]
    async with in_scene(PageName.RUN, tmp_path, language=language) as (app, pilot, _):
        for size in ((59, 24), (80, 17), (40, 5)):
            await resize(app, pilot, size)
            assert " ".join(rows_of(app)).split() == target, size
        await resize(app, pilot, (20, 5))
        rows = rows_of(app)
        assert rows[0].startswith(" SIM ")
        assert "60 x 18" in "\n".join(rows)


async def test_space_stops_there(tmp_path: Path) -> None:
    async with in_scene(PageName.RUN, tmp_path) as (app, pilot, control):
        for size in TOO_SMALL:
            await resize(app, pilot, size)
            control.stops, control.kills = [], []
            for number, key in enumerate(("space", "f12", "escape"), start=1):
                await pilot.press(key)
                assert len(control.stops) == number, size
            await pilot.press("f9")
            assert len(control.kills) == 1, size


WITH_KEYS = (PageName.ALIGN, PageName.RUN, PageName.INSPECT)


@pytest.mark.first(1)
@pytest.mark.parametrize("page", WITH_KEYS)
async def test_no_other_key_does_anything_and_growing_again_brings_the_page_back(
    page: PageName, tmp_path: Path
) -> None:
    keys = [action.keys[0] for action in actions_of(page)]
    async with in_scene(page, tmp_path) as (app, pilot, control):
        # The page of a cut is there with a machine at rest: a key that means nothing would stop it else.
        control.state = scene_of(PageName.JOBS).state
        await resize(app, pilot, USUAL)
        before, orders = rows_of(app), len(control.orders)
        for size in TOO_SMALL:
            await resize(app, pilot, size)
            assert rows_of(app) != before, size
            await pilot.press("f6", "1", "?", *keys)
            assert (len(control.orders), control.stops, control.kills) == (orders, [], []), size
            await resize(app, pilot, USUAL)
            assert rows_of(app) == before, size


async def test_a_key_that_means_nothing_stops_what_moves(tmp_path: Path) -> None:
    async with in_scene(PageName.RUN, tmp_path) as (app, pilot, control):
        assert control.state.activity is Activity.CUTTING
        await resize(app, pilot, (40, 10))
        await pilot.press("f6", "1")
        assert control.stops == ["unbound F6", "unbound 1"]
        assert control.orders == []


@pytest.mark.parametrize("size", [TOO_SMALL[0], TOO_SMALL[-1]])
async def test_the_console_can_be_left_there(size: Size, tmp_path: Path) -> None:
    async with in_scene(PageName.INSPECT, tmp_path) as (app, pilot, _):
        await resize(app, pilot, size)
        await pilot.press("ctrl+q")
        await pilot.pause()
    assert app.return_code == 0


@pytest.mark.first(3)
@pytest.mark.parametrize("page", sorted({*PageName} - {*WITH_KEYS}))
async def test_growing_again_brings_the_page_back(page: PageName, tmp_path: Path) -> None:
    async with in_scene(page, tmp_path) as (app, pilot, _):
        before = rows_of(app)
        for size in (TOO_SMALL[0], TOO_SMALL[-1]):  # those above have all
            await resize(app, pilot, size)
            assert rows_of(app) != before, size
            await resize(app, pilot, USUAL)
            assert rows_of(app) == before, size


@pytest.mark.parametrize("size", TOO_SMALL)
async def test_a_console_that_begins_too_small_can_grow(size: Size, tmp_path: Path) -> None:
    async with in_scene(PageName.JOBS, tmp_path, size=size) as (app, pilot, _):
        await resize(app, pilot, USUAL)
        assert rows_of(app)[0].startswith(" SIM   lee-2001-lathe")
        assert "lee-2001-experiment-1" in "\n".join(rows_of(app))


@pytest.mark.first(1)
@pytest.mark.parametrize(
    "page",
    [
        page if page in (PageName.JOBS, PageName.RUN) else pytest.param(page, marks=pytest.mark.long)
        for page in PageName
    ],
)
async def test_a_storm_of_sizes_breaks_nothing(page: PageName, tmp_path: Path) -> None:
    chance = random.Random(page)
    sizes = [(1, 1), *((chance.randint(1, 200), chance.randint(1, 60)) for _ in range(STORM - 2)), (1, 1)]
    async with in_scene(page, tmp_path) as (app, pilot, _):
        before = rows_of(app)
        for size in sizes:
            await pilot.resize_terminal(*size)
            app.tick()
        await resize(app, pilot, USUAL)
        assert rows_of(app) == before
        assert app.ui.key_answer == ()
