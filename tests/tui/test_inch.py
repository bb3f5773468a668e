"""Every page in inches: each length of the metric page is there, converted; what stays metric says so and why."""

from __future__ import annotations

import asyncio
import re
import tempfile
from dataclasses import replace
from pathlib import Path

import pytest

from console.session.appearance import Appearance
from console.tui.keymap import PageName
from tests.golden_text import compare, writing
from tests.tui import run_stage
from tests.tui.scenes import Scene, application, fill, fixed_world, keys_to, played, rows_of, scene_of, settle
from tests.tui.stage import LANGUAGES, experiment

SIZE, WIDE = (80, 24), (160, 48)
LENGTH = re.compile(r"(?<![\w.:])([+-]?\d+(?:\.\d+)?) (mm|um|in|uin)(?![\w/])")
METRIC_UNIT = re.compile(r"(?<![\w/])(mm|um)(?![\w])")
OURS = {"mm": 1.0, "um": 0.001, "in": 25.4, "uin": 25.4e-6}
"""Size of each unit, mm."""

STAYS_METRIC = {
    PageName.ALIGN: "steps of a jog and what is compared with them, in the unit in which they are made",
    PageName.SETTINGS: "names of the units",
    PageName.SCOPE: "what the controller counts, with its own units",
    PageName.CONTROLLER: "what the controller says",
    PageName.CALIBRATE: "points as their file has them, and a stiffness",
    PageName.ALARMS: "messages, which quote mm with the inches beside",
    PageName.LOG: "as the page Alarms, and commands as they were sent",
}


def shown(scene: Scene, units: str, language: str, size: tuple[int, int]) -> list[str]:
    async def play(data: Path) -> list[str]:
        appearance = Appearance(language=language, units=units)
        app, _ = application(scene, data, language=language, appearance=appearance)
        async with played(app, scene, size):
            return rows_of(app)

    with fixed_world(), tempfile.TemporaryDirectory() as folder:
        fill(Path(folder))
        return asyncio.run(play(Path(folder)))


def lengths(rows: list[str]) -> list[tuple[float, float]]:
    """Every length with its unit beside it, mm, and the smallest step of its digits."""
    found = []
    for row in rows:
        for number, unit in LENGTH.findall(row):
            decimals = len(number.partition(".")[2])
            found.append((float(number) * OURS[unit], OURS[unit] / 10**decimals))
    return found


@pytest.mark.parametrize("page", [page for page in PageName if page not in STAYS_METRIC])
def test_no_length_is_left_in_millimetres(page: PageName) -> None:
    for language in LANGUAGES:
        rows = shown(scene_of(page), "inch", language, WIDE)
        left = [row for row in rows if METRIC_UNIT.search(beside_removed(row))]
        assert left == []


def beside_removed(row: str) -> str:
    """A row without lengths that have their inches beside them."""
    return re.sub(r"\S+ (mm|um) \([^)]*in\)", "", row)


@pytest.mark.parametrize("page", [PageName.JOBS, PageName.PREVIEW, PageName.ALIGN, PageName.RUN])
def test_each_length_is_that_of_the_metric_page(page: PageName) -> None:
    scene = scene_of(page)
    metric, inch = (lengths(shown(scene, units, "en", WIDE)) for units in ("mm", "inch"))
    assert metric
    assert len(inch) == len(metric)
    for (before, coarse), (after, fine) in zip(metric, inch, strict=True):
        assert after == pytest.approx(before, abs=0.5001 * (coarse + fine))
        assert fine <= coarse


@pytest.mark.parametrize("page", [PageName.SETUP, PageName.ALIGN, PageName.RUN, PageName.INSPECT])
def test_a_page_in_inches_fits_80_columns(page: PageName) -> None:
    rows = shown(scene_of(page), "inch", "en", SIZE)
    compare(rows, Path(__file__).with_name("inch_goldens") / f"{page}-80x24-en.txt", write=writing())


def test_the_unit_changes_on_every_page_while_the_console_runs() -> None:
    scene = replace(scene_of(PageName.SETUP), state=run_stage.state(), work=experiment(), keys=())

    async def play(data: Path) -> None:
        app, _ = application(scene, data, language="en")
        async with played(app, scene, SIZE) as pilot:
            assert any("D 52.000  mm" in row for row in rows_of(app))
            await pilot.press(*keys_to(PageName.SETTINGS))
            app.appear(replace(app.ui.appearance, units="inch"))
            await pilot.press(*keys_to(PageName.SETUP))
            await settle(app, pilot)
            assert any("D 2.04724  in" in row for row in rows_of(app))

    with fixed_world(), tempfile.TemporaryDirectory() as folder:
        fill(Path(folder))
        asyncio.run(play(Path(folder)))
