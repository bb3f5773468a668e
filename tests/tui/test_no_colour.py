"""Without colour: every page is there, no colour is sent to the terminal, and words and marks tell the states."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from rich.segment import Segment

from console.session.station.alarms import Priority, raised
from console.session.station.state import Activity, StationState, StopState
from console.tui.app import ConsoleApp
from console.tui.keymap import PageName
from console.tui.theme import COLOUR, MONO, Palette
from profiles.problem import Problem
from tests.golden_text import compare
from tests.tui.scenes import NOW_S, Scene, application, fill, fixed_world, played, rows_of, scene_of
from tests.tui.stage import SIZES
from tests.tui.test_goldens import golden_of

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
    scene: Scene,
    data: Path,
    *,
    size: tuple[int, int] = SIZES[0],
    language: str = "en",
    palette: Palette = MONO,
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
    return replace(state, alarms=raised((), fault, Priority.HIGH, NOW_S))


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
