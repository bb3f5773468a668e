"""A terminal that is too small says so, starts nothing, still stops and leaves; and no resize breaks anything."""

from __future__ import annotations

import random
from collections.abc import Awaitable, Callable
from contextlib import AbstractAsyncContextManager
from pathlib import Path

import pytest
from textual.pilot import Pilot

from console.session.station.state import Activity
from console.text.catalogue import load
from console.tui.app import ConsoleApp
from console.tui.keymap import PageName, actions_of
from console.tui.layout import SMALLEST
from tests.tui.scenes import console_on, rows_of, scene_of, settle
from tests.tui.stage import LANGUAGES, FixedControl

Size = tuple[int, int]
Act = Callable[[ConsoleApp, Pilot[None], FixedControl], Awaitable[None]]

USUAL = (80, 24)
TOO_SMALL = ((59, 24), (80, 17), (20, 5), (1, 1))
STORM = 12
"""Sizes that each page goes through: others on each of them."""


def play(
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
    async with play(PageName.RUN, tmp_path, language=language) as (app, pilot, _):
        for size in ((59, 24), (80, 17), (40, 5)):
            await resize(app, pilot, size)
            assert " ".join(rows_of(app)).split() == target, size
        await resize(app, pilot, (20, 5))
        rows = rows_of(app)
        assert rows[0].startswith(" SIM ")
        assert "60 x 18" in "\n".join(rows)


async def test_space_stops_there(tmp_path: Path) -> None:
    async with play(PageName.RUN, tmp_path) as (app, pilot, control):
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
    async with play(page, tmp_path) as (app, pilot, control):
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
    async with play(PageName.RUN, tmp_path) as (app, pilot, control):
        assert control.state.activity is Activity.CUTTING
        await resize(app, pilot, (40, 10))
        await pilot.press("f6", "1")
        assert control.stops == ["unbound F6", "unbound 1"]
        assert control.orders == []


@pytest.mark.parametrize("size", [TOO_SMALL[0], TOO_SMALL[-1]])
async def test_the_console_can_be_left_there(size: Size, tmp_path: Path) -> None:
    async with play(PageName.INSPECT, tmp_path) as (app, pilot, _):
        await resize(app, pilot, size)
        await pilot.press("ctrl+q")
        await pilot.pause()
    assert app.return_code == 0


@pytest.mark.first(3)
@pytest.mark.parametrize("page", sorted({*PageName} - {*WITH_KEYS}))
async def test_growing_again_brings_the_page_back(page: PageName, tmp_path: Path) -> None:
    async with play(page, tmp_path) as (app, pilot, _):
        before = rows_of(app)
        for size in (TOO_SMALL[0], TOO_SMALL[-1]):  # those above have all
            await resize(app, pilot, size)
            assert rows_of(app) != before, size
            await resize(app, pilot, USUAL)
            assert rows_of(app) == before, size


@pytest.mark.parametrize("size", TOO_SMALL)
async def test_a_console_that_begins_too_small_can_grow(size: Size, tmp_path: Path) -> None:
    async with play(PageName.JOBS, tmp_path, size=size) as (app, pilot, _):
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
    async with play(page, tmp_path) as (app, pilot, _):
        before = rows_of(app)
        for size in sizes:
            await pilot.resize_terminal(*size)
            app.tick()
        await resize(app, pilot, USUAL)
        assert rows_of(app) == before
        assert app.ui.said == ()
