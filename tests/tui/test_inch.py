"""Every page in inches: each length of the metric page is there, converted; what stays metric says so and why."""

from __future__ import annotations

import asyncio
import re
import tempfile
from dataclasses import replace
from pathlib import Path

import pytest

from console.session.appearance import Appearance
from console.text.catalogue import LiveCatalogue
from console.tui.calibrating.calibration_lines import point_lines
from console.tui.calibrating.chuck_facts import ChuckFacts
from console.tui.calibrating.draft import Draft, value_of
from console.tui.further.scope_setup import ROWS, changed, setup_lines
from console.tui.keymap import PageName
from console.units import METRIC, Units
from drivers.requests.scope_gather import ScopeSetup, Trigger
from profiles.calibration.table import COLUMNS, CalibrationKind
from profiles.problem import ProfileError
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
    PageName.CONTROLLER: "what the controller reports, in its own units",
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
@pytest.mark.first(3)
def test_no_length_is_left_in_millimetres(page: PageName) -> None:
    for language in LANGUAGES:
        rows = shown(scene_of(page), "inch", language, WIDE)
        left = [row for row in rows if METRIC_UNIT.search(beside_removed(row))]
        assert left == []


def beside_removed(row: str) -> str:
    """A row without lengths that have their inches beside them."""
    return re.sub(r"\S+ (mm|um) \([^)]*in\)", "", row)


@pytest.mark.parametrize("page", [PageName.JOBS, PageName.PREVIEW, PageName.ALIGN, PageName.RUN])
@pytest.mark.first(2)
def test_each_length_is_that_of_the_metric_page(page: PageName) -> None:
    scene = scene_of(page)
    metric, inch = (lengths(shown(scene, units, "en", WIDE)) for units in ("mm", "inch"))
    assert metric
    assert len(inch) == len(metric)
    for (before, coarse), (after, fine) in zip(metric, inch, strict=True):
        assert after == pytest.approx(before, abs=0.5001 * (coarse + fine))
        assert fine <= coarse


@pytest.mark.parametrize("page", [PageName.SETUP, PageName.ALIGN, PageName.RUN, PageName.INSPECT])
@pytest.mark.first(2)
def test_a_page_in_inches_fits_80_columns(page: PageName) -> None:
    rows = shown(scene_of(page), "inch", "en", SIZE)
    compare(rows, Path(__file__).with_name("inch_goldens") / f"{page}-80x24-en.txt", write=writing())


def test_the_scope_reads_off_inches_what_it_reads_off_millimetres() -> None:
    """Readings below the plot: 1 mm is 1/25.4 in, 1 um is 1/0.0254 uin; what is no length stays as it is."""
    metric, inch = (shown(scene_of(PageName.SCOPE), units, "en", WIDE) for units in ("mm", "inch"))
    for name, unit, other, size, digit in (
        ("Tool cmd", "mm", "in", 25.4, 1e-6),
        ("Tool FE", "um", "uin", 0.0254, 0.01),
        ("Spindle act", "°", "°", 1.0, 0.01),
    ):
        before, after = reading(metric, f"{name} {unit}"), reading(inch, f"{name} {other}")
        assert after == pytest.approx([value / size for value in before], abs=digit + 0.0005 / size), name
    assert any(re.search(r"│ +in│", row) for row in inch), "unit of the axis"


def reading(rows: list[str], label: str) -> list[float]:
    """The numbers behind a label."""
    row = next(row for row in rows if f"{label} " in row)
    return [float(each) for each in re.findall(r"-?\d+\.\d+", row.partition(label)[2])]


def test_a_level_of_the_scope_has_round_steps_in_either_unit() -> None:
    rising = replace(ScopeSetup(), trigger=Trigger.RISING)
    for units, after in ((METRIC, "2 um"), (Units("inch"), "100 uin")):
        setup = rising
        for _ in range(2):
            setup = changed(setup, ROWS.index("level"), 1, units) or setup
        text = LiveCatalogue("en")
        text.measure(units.name)
        rows = setup_lines(setup, 0, 0.5, text, 40)
        assert after in "".join(words for words, _ in rows[-1])
    assert setup.level == pytest.approx(2.54), "um, as the trigger compares it"


def test_points_of_a_calibration_are_asked_for_and_kept_in_their_own_units() -> None:
    """2 in are 50.8 mm and 100 uin 2.54 um, in the draft as in the file."""
    inch = Units("inch")
    diameter, deflection = (
        next(each for each in COLUMNS[CalibrationKind.DEFLECTION] if each.key == key)
        for key in ("diameter_mm", "deflection_um")
    )
    assert value_of("2", diameter, inch) == 50.8
    assert value_of("100", deflection, inch) == 2.54
    with pytest.raises(ProfileError) as refused:
        value_of("50", diameter, inch)
    assert "50 in" in str(refused.value), "1270 mm are too many"
    draft = Draft(
        kind=CalibrationKind.DEFLECTION, rows=((1314.0, 200.0, 0.0, 50.8, 30.48, 2.54),), modulus_gpa=206
    )
    text = LiveCatalogue("en")
    text.measure("inch")
    head, row = ("".join(words for words, _ in each) for each in point_lines(ChuckFacts(), draft, text, 84, 9))
    assert head.split() == "Fc N P N deg d in a in u uin".split()
    assert row.split() == ["1314", "200", "0", "2", "1.2", "100"]


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
