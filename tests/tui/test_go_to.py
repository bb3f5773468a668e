"""A typed target on the page Align: nothing moves while it is typed, and F6 alone goes there."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from console.session.station.commands import GoTo
from console.session.station.state import Activity, StationState, StopState
from console.tui.keymap import PageName
from drivers.lathe.snapshot import AxisName
from tests.tui import align_stage
from tests.tui.align_stage import OFF, VALID, look, shown
from tests.tui.machine_states import ON
from tests.tui.scenes import Scene, application, fill, played
from tests.tui.stage import experiment, grid

READY = align_stage.state(VALID, snapshot=look(carriage_mm=150.0))
STOPPED = StopState(reason="space", killed=False, sent_s=99.0, rest_s=99.5)


@dataclass(frozen=True)
class Typed:
    orders: list[object]
    stops: list[str]
    said: list[str]
    text: str


def typed(data: Path, *keys: str, now: StationState = READY, then: StationState | None = None) -> Typed:
    """Press keys on the whole console, 0.9 s apart; look at the end, with `then` as the machine."""
    data = data / str(len(list(data.iterdir())))
    fill(data)
    scene = Scene(page=PageName.ALIGN, state=now, work=experiment())
    app, control = application(scene, data)
    seen: list[str] = []

    async def run() -> None:
        async with played(app, scene, (80, 24)) as pilot:
            for n, key in enumerate(keys):
                control.at(100.0 + 0.9 * n)
                await pilot.press(key)
                await pilot.pause()
            control.state = then or control.state
            for _ in range(2):
                app.tick()
                await pilot.pause()
            seen.append(grid(app))

    asyncio.run(run())
    assert app.fault is None
    return Typed(list(control.orders), control.stops, [each.code for each in app.ui.said], seen[0])


@pytest.mark.parametrize("number", ["166.0", "166,0"])
@pytest.mark.first(1)
def test_a_target_is_shown_as_it_is_understood_and_f6_goes_there(number: str, tmp_path: Path) -> None:
    before = typed(tmp_path, "j", "g", *number)
    assert before.orders == []
    assert "→ 166.000 mm" in before.text
    # 16 mm at 10 mm/s, and 0.1 s of acceleration.
    assert "16.000 mm toward the chuck, 1.7 s" in before.text
    assert "-5.000 to 198.000" in before.text
    after = typed(tmp_path, "j", "g", *number, "f6")
    assert after.orders == [GoTo(axis=AxisName.CARRIAGE, target=166.0)]


@pytest.mark.long
def test_g_again_asks_for_c_which_goes_the_shorter_way(tmp_path: Path) -> None:
    # A turn and 12.6 degrees.
    page = typed(tmp_path, "j", "g", "g", "3", "5", "0")
    assert "22.60 ° against the cut" in page.text
    assert typed(tmp_path, "j", "g", "g", "3", "5", "0", "f6").orders == [
        GoTo(axis=AxisName.SPINDLE, target=350.0)
    ]
    assert "Go to" not in typed(tmp_path, "g", "g", "g").text


@pytest.mark.parametrize(
    ("keys", "code"),
    [
        (("g", "9", "0", "f6"), "screen.jog_not_enabled"),
        (("j", "f6"), "screen.nothing_typed"),
        (("j", "g", "f6"), "screen.nothing_typed"),
        (("j", "g", "9", "9", "9", "f6"), "machine.target_out_of_range"),
        (("j", "g", "1", ",", "0", "0", "0", "f6"), "value.ambiguous"),
        (("j", "g", "-", "f6"), "value.not_number"),
        (("j", "g", "1", "0", "enter"), "screen.f6_goes"),
        (("j", "g", "1", "0", "up"), "screen.entry_open"),
        (("j", "g", "1", "0", "f4"), "screen.entry_open"),
    ],
)
@pytest.mark.first(3)
def test_what_is_not_a_target_moves_nothing(keys: tuple[str, ...], code: str, tmp_path: Path) -> None:
    page = typed(tmp_path, *keys)
    assert (page.orders, page.stops, page.said) == ([], [], [code])


def test_a_target_in_the_part_is_refused_while_it_is_typed(tmp_path: Path) -> None:
    # The tip at R 26.0: at the surface of the part, whose face is at 170 mm.
    at_part = replace(VALID, touch_off=replace(VALID.touch_off, zero_radius_mm=76.0))  # type: ignore[type-var]
    page = typed(tmp_path, "j", "g", "1", "7", "5", "f6", now=replace(READY, alignment=at_part))
    assert (page.orders, page.said) == ([], ["machine.tool_in_the_way"])
    assert "✗" in page.text
    assert "the tool is, or would come, too near the part" in " ".join(page.text.split())


@pytest.mark.parametrize(
    "then",
    [
        replace(READY, stop=STOPPED, activity=Activity.STOPPED),
        replace(READY, activity=Activity.LOST),
        replace(READY, activity=Activity.HOMING),
    ],
)
@pytest.mark.first(1)
def test_an_entry_ends_with_a_stop_a_lost_machine_and_a_motion(then: StationState, tmp_path: Path) -> None:
    assert "Go to Z" in typed(tmp_path, "j", "g", "9").text
    assert "Go to Z" not in typed(tmp_path, "j", "g", "9", then=then).text


def test_space_stops_in_an_entry_too(tmp_path: Path) -> None:
    assert typed(tmp_path, "j", "g", "9", "space").stops == ["space"]


def test_without_drives_or_zeros_no_target_means_anything() -> None:
    off = align_stage.state(replace(VALID, drives_on=False), snapshot=look(OFF))
    assert shown(off, "align.goto").said == ["alignment.drives_off"]
    unhomed = align_stage.state(replace(VALID, homed=False), snapshot=look(ON - {"home_complete"}))
    assert shown(unhomed, "align.goto").said == ["alignment.not_homed"]


def test_what_moves_shows_how_long_it_still_takes() -> None:
    going = align_stage.state(VALID, activity=Activity.JOGGING, ends_s=104.2)
    assert "MOVING, 4 s left" in shown(going).text
    homing = align_stage.state(VALID, activity=Activity.HOMING, snapshot=look(ON | {"home_search"}))
    assert "HOMING X" in shown(homing).text
    searching = replace(homing, ends_s=180.4, ends_at_most=True)
    assert "HOMING X, at most 80 s" in shown(searching).text
    assert "left" not in shown(align_stage.state(VALID, ends_s=104.2)).text.split("Jog, step")[0]
