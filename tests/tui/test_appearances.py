"""Every page in inches: each length of the metric page is there, converted; what stays metric says so and why."""

from __future__ import annotations

import asyncio
import itertools
import math
import re
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from rich.color import Color
from rich.segment import Segment
from rich.style import Style

from console.session.appearance import THEMES, Appearance
from console.session.station.alarms import Priority, raise_alarm
from console.session.station.state import Activity, StationState, StopState
from console.text.catalogue import LiveCatalogue
from console.tui.app import ConsoleApp
from console.tui.application.themes import palette_named, theme_named
from console.tui.calibration.calibration_lines import point_lines
from console.tui.calibration.chuck_facts import ChuckFacts
from console.tui.calibration.draft import Draft, value_of
from console.tui.further.scope_setup import ROWS, change_setup, setup_lines
from console.tui.keymap import PageName
from console.tui.theme import COLOUR, MONO, Palette, Token
from console.units import METRIC, Units
from drivers.requests.scope_gather import ScopeSetup, ScopeTrigger
from profiles.calibration.table import COLUMNS, CalibrationKind
from profiles.problem import Problem, ProfileError
from tests.golden_text import compare, writing
from tests.tui import run_stage
from tests.tui.scenes import (
    NOW_S,
    Scene,
    application,
    console_on,
    fill,
    fixed_world,
    keys_to,
    played,
    rows_of,
    scene_of,
    settle,
)
from tests.tui.stage import LANGUAGES, SIZES, experiment
from tests.tui.test_goldens import golden_of

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
    rising = replace(ScopeSetup(), trigger=ScopeTrigger.RISING)
    for units, after in ((METRIC, "2 um"), (Units("inch"), "100 uin")):
        setup = rising
        for _ in range(2):
            setup = change_setup(setup, ROWS.index("level"), 1, units) or setup
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


async def test_the_unit_changes_on_every_page_while_the_console_runs(tmp_path: Path) -> None:
    scene = replace(scene_of(PageName.SETUP), state=run_stage.state(), work=experiment(), keys=())
    with fixed_world():
        async with console_on(scene, tmp_path) as (app, pilot, _):
            assert any("D 52.000  mm" in row for row in rows_of(app))
            await pilot.press(*keys_to(PageName.SETTINGS))
            app.appear(replace(app.ui.appearance, units="inch"))
            await pilot.press(*keys_to(PageName.SETUP))
            await settle(app, pilot)
            assert any("D 2.04724  in" in row for row in rows_of(app))


# Without colour: every page is there, no colour is sent to the terminal, and words and marks tell the states.


BESIDE_WORDS = " \u2500\u2502\u256d\u256e\u2570\u256f"


@dataclass(frozen=True)
class Seen:
    """The segments of the screen after all filters, and its rows."""

    segments: tuple[Segment, ...]
    rows: tuple[str, ...]

    @property
    def colours(self) -> set[str]:
        """Colours that would be sent to the terminal, in front and behind."""
        styles = [segment.style for segment in self.segments if segment.style is not None]
        named = [colour for style in styles for colour in (style.color, style.bgcolor) if colour is not None]
        return {colour.name for colour in named if not colour.is_default}


def seen(
    scene: Scene, data: Path, *, size: tuple[int, int] = SIZES[0], language: str = "en", palette: Palette = MONO
) -> Seen:
    async def play() -> Seen:
        app, _ = application(scene, data, language=language, palette=palette)
        async with played(app, scene, size):
            return Seen(segments_of(app), tuple(rows_of(app)))

    return asyncio.run(play())


def segments_of(app: ConsoleApp) -> tuple[Segment, ...]:
    return tuple(segment for strip in app.screen._compositor.render_strips() for segment in strip)


@pytest.fixture
def data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("NO_COLOR", "1")
    with fixed_world():
        fill(tmp_path)
    return tmp_path


OTHERWISE = (PageName.SETTINGS,)  # it says that NO_COLOR fixes the colours
PICTURES = [
    *((page, SIZES[0], "en") for page in PageName),
    (PageName.RUN, SIZES[0], "ko"),
    *(pytest.param(page, SIZES[-1], "en", marks=pytest.mark.long) for page in PageName),
]


@pytest.mark.parametrize(("page", "size", "language"), PICTURES)
@pytest.mark.first(3)
def test_every_page_is_shown_without_a_colour_in_the_same_words(
    page: PageName, size: tuple[int, int], language: str, data: Path
) -> None:
    """The kept texts are those of the screens with colour."""
    with fixed_world():
        shown = seen(scene_of(page), data, size=size, language=language)
    assert shown.colours == set()
    assert sum(len(row.strip(BESIDE_WORDS)) for row in shown.rows) > 200
    if page not in OTHERWISE:
        compare(shown.rows, golden_of(page, size, language), write=False)


def test_a_colour_would_be_found(data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR")
    assert len(seen(scene_of(PageName.RUN), data, palette=COLOUR).colours) > 3


def test_what_is_a_block_of_colour_is_a_reversed_one(data: Path) -> None:
    """SIM, the stop key and the page that is seen stand out by more than their words."""
    reversed_ = {
        s.text.strip() for s in seen(scene_of(PageName.JOBS), data).segments if s.style and s.style.reverse
    }
    assert {"SIM", "[SPACE] STOP MOTION", "1 Jobs"} <= reversed_


def ready(state: StationState) -> StationState:
    return state


def stopped(state: StationState) -> StationState:
    stop = StopState(reason="space", killed=False, sent_s=NOW_S - 2.0, rest_s=NOW_S - 0.7, tool_in_part=True)
    return replace(state, activity=Activity.STOPPED, stop=stop)


def alarmed(state: StationState) -> StationState:
    fault = Problem(code="machine.fault", key="arm", value="tool: amplifier fault")
    return replace(state, alarms=raise_alarm((), fault, Priority.HIGH, NOW_S))


def stale(state: StationState) -> StationState:
    assert state.snapshot is not None
    return replace(state, snapshot=replace(state.snapshot, asked_s=NOW_S - 3.0))


def lost(state: StationState) -> StationState:
    return replace(stale(state), activity=Activity.LOST)


STATES: dict[Callable[[StationState], StationState], tuple[str, ...]] = {
    ready: ("· ready", "no alarms", "at standstill"),
    stopped: ("STOPPED", "F2", "1.3 s"),
    alarmed: ("!!!", "amplifier fault"),
    stale: ("STALE, 3 s",),
    lost: ("LINK LOST", "STALE, 3 s"),
}


@pytest.mark.parametrize("change", STATES)
def test_states_are_told_apart_by_words(change: Callable[[StationState], StationState], data: Path) -> None:
    scene = scene_of(PageName.ALIGN)
    rows = seen(replace(scene, state=change(scene.state), keys=()), data).rows
    frame = "\n".join([*rows[:3], *rows[-3:]])
    assert [words for words in STATES[change] if words not in frame] == []
    others = {words for other, many in STATES.items() for words in many if other is not change}
    assert [words for words in others - set(STATES[change]) if words in frame and change is ready] == []


# The themes by outside measures: contrast after WCAG 2.1, and colours as dichromats see them.


PAINTED = [name for name in THEMES if name != "16-colour"]


LEAST = {Token.RING: 2.0, **dict.fromkeys((Token.AXIS, Token.DIM, Token.STALE), 3.0)}
"""Contrast of frames and what needs no attention: 3 to 1 (WCAG 1.4.11), of the rings of a plot less; else 4.5."""

# G. M. Machado et al., A Physiologically-based Model for Simulation of Color Vision Deficiency, 2009; severity 1.
DEFICIENCIES = {
    "protanopia": (
        (0.152286, 1.052583, -0.204868),
        (0.114503, 0.786281, 0.099216),
        (-0.003882, -0.048116, 1.051998),
    ),
    "deuteranopia": (
        (0.367322, 0.860646, -0.227968),
        (0.280085, 0.672501, 0.047413),
        (-0.01182, 0.04294, 0.968881),
    ),
}


def linear(colour: Color) -> tuple[float, float, float]:
    triplet = colour.get_truecolor()
    red, green, blue = (
        part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4
        for part in (each / 255.0 for each in triplet)
    )
    return red, green, blue


def luminance(colour: Color) -> float:
    red, green, blue = linear(colour)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def contrast(style: Style) -> float:
    assert style.color is not None and style.bgcolor is not None
    dark, light = sorted((luminance(style.color), luminance(style.bgcolor)))
    return (light + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("name", PAINTED)
def test_every_token_can_be_read_on_its_background(name: str) -> None:
    factor = 7.0 / 4.5 if name == "contrast" else 1.0  # AAA in place of AA
    low = {
        token.name: round(contrast(style), 1)
        for token, style in palette_named(name).items()
        if contrast(style) < LEAST.get(token, 4.5) * (factor if token not in LEAST else 1.0)
    }
    assert low == {}


def as_seen(colour: Color, matrix: tuple[tuple[float, float, float], ...]) -> tuple[float, float, float]:
    """CIE L*a*b* of a colour as a dichromat sees it."""
    rgb = linear(colour)
    red, green, blue = (max(sum(m * c for m, c in zip(row, rgb, strict=True)), 0.0) for row in matrix)
    x = (0.4124 * red + 0.3576 * green + 0.1805 * blue) / 0.9505
    y = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    z = (0.0193 * red + 0.1192 * green + 0.9505 * blue) / 1.089
    fx, fy, fz = (t ** (1 / 3) if t > 0.008856 else 7.787 * t + 16 / 116 for t in (x, y, z))
    return 116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)


def colour_of(palette: Palette, token: Token) -> Color:
    style = palette[token]
    found = style.bgcolor if token in (Token.ALARM, Token.SIM) else style.color
    assert found is not None
    return found


def nearest(name: str) -> float:
    """The least difference (CIE 1976) of any two colours that mean something, to either kind of dichromat."""
    palette = palette_named(name)
    pairs = itertools.combinations((Token.ALARM, Token.WARNING, Token.ACTION, Token.SIM), 2)
    wanted = [*pairs, (Token.BEFORE, Token.AFTER)]
    return min(
        math.dist(*(as_seen(colour_of(palette, token), matrix) for token in pair))
        for pair in wanted
        for matrix in DEFICIENCIES.values()
    )


def test_the_colour_blind_safe_theme_keeps_its_colours_apart_for_dichromats() -> None:
    assert nearest("colour-blind") > 20.0
    assert nearest("colour-blind") > nearest("dark")


def test_sixteen_colours_are_those_of_the_terminal_on_its_own_background() -> None:
    for token, style in palette_named("16-colour").items():
        for colour in (style.color, style.bgcolor):
            assert colour is not None and (colour.is_default or (colour.number or 0) < 16), token
    assert theme_named("16-colour").ansi


@pytest.mark.parametrize("name", THEMES)
def test_every_token_has_a_style_and_blocks_stand_out(name: str) -> None:
    palette = palette_named(name)
    assert set(palette) == set(Token)
    text = palette[Token.TEXT]
    for token in (Token.SELECTED, Token.ALARM, Token.SIM, Token.STOP):
        assert palette[token].reverse or palette[token].bgcolor != text.bgcolor
