"""The page Align: what is known of the machine, what is missing, and which keys order what."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
from rich.cells import cell_len

from console.session.alignment import Alignment, Clamping, JawAngle, TouchOff
from console.session.intents import (
    Approach,
    ConfirmClamping,
    Home,
    Intent,
    Jog,
    SwitchOff,
    SwitchOn,
    TakeJaw,
    TakeTouchOff,
    Verify,
)
from console.session.state import Activity, StationState, StopState
from console.session.work import Work
from console.tui.desk import View
from console.tui.pages.align import AlignPage
from drivers.simulator.shop_view import ShopView
from drivers.snapshot import AxisName, AxisState, Snapshot
from tests.tui.stage import FRAME_ROWS, LANGUAGES, SIZES, FixedControl, PageStage, desk_for, experiment, grid

REST = frozenset({"desired_velocity_zero", "in_position"})
ON = REST | {"amplifier_enabled", "home_complete"}
OFF = REST | {"open_loop"}

# 50 mm in from the zero at 76 mm: the surface of the part; a turn and 12.6 degrees; 41.2 mm.
TOOL_COUNTS, SPINDLE_COUNTS, CARRIAGE_COUNTS = 250_000.0, 10_350.0, 41_200.0
ALL_BUT = {"settings": (), "drives_on": True, "homed": True}
CLAMPED = Clamping(force_n=1314.0, diameter_mm=52.0, at="08:40")
JAW = JawAngle(angle_deg=12.6, at="08:45")
TOUCHED = TouchOff(zero_radius_mm=76.5, at="08:46")
VALID = Alignment(settings=(), drives_on=True, homed=True, clamping=CLAMPED, jaw=JAW, touch_off=TOUCHED)
NO_JAW = replace(VALID, jaw=None, touch_off=None)


def look(flags: frozenset[str] = ON, *, running: bool = False) -> Snapshot:
    def axis(position: float, error: float = 0.0) -> AxisState:
        return AxisState(position=position, following_error=error, flags=flags)

    return Snapshot(
        at_s=100.0,
        tool=axis(TOOL_COUNTS, 3.0),
        spindle=axis(SPINDLE_COUNTS),
        carriage=axis(CARRIAGE_COUNTS),
        program_running=running,
        runtime_error=False,
    )


def state(alignment: Alignment = NO_JAW, **changes: Any) -> StationState:
    known: dict[str, Any] = {
        "activity": Activity.READY,
        "looked_s": 100.0,
        "snapshot": look(),
        "seen": ShopView(jaw_1_past_mark_deg=12.34, tool_gap_mm=0.25),
    }
    return StationState(alignment=alignment, **{**known, **changes})


@dataclass(frozen=True)
class Shown:
    """What came of some keys."""

    text: str
    next_step: str
    orders: Sequence[Intent]
    stops: Sequence[str]
    said: Sequence[str]


def shown(
    now: StationState,
    *actions: str,
    size: tuple[int, int] = (80, 24),
    language: str = "en",
    work: Work | None = None,
    no_job: bool = False,
    then_s: float = 0.0,
    leave: bool = False,
) -> Shown:
    """Show a state, press keys, wait `then_s`, and look at the page."""
    control = FixedControl(now)
    job = None if no_job else work or experiment()
    desk = desk_for(control, Path("/nowhere"), language, job)
    page = AlignPage(desk)
    view = View(state=now, work=job, now_s=100.0)

    async def run() -> str:
        app = PageStage(page, view)
        async with app.run_test(size=(size[0], size[1] - FRAME_ROWS)) as pilot:
            await pilot.pause()
            for action in actions:
                page.act(action)
            if leave:
                page.leave()
            for _ in range(2):
                page.show(replace(view, now_s=100.0 + then_s))
                await pilot.pause()
            return grid(app)

    text = asyncio.run(run())
    return Shown(
        text=text,
        next_step="".join(words for words, _ in page.next_step(view)),
        orders=control.orders,
        stops=control.stops,
        said=[problem.code for problem in desk.said],
    )


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("size", [*SIZES, (60, 18)])
@pytest.mark.parametrize(
    "alignment", [Alignment(), NO_JAW, VALID], ids=["nothing done", "jaw not found", "all done"]
)
def test_no_row_is_wider_than_the_terminal(size: tuple[int, int], language: str, alignment: Alignment) -> None:
    page = shown(state(alignment), "align.enable", size=size, language=language)
    rows = page.text.splitlines()
    assert len(rows) <= size[1] - FRAME_ROWS
    assert max(cell_len(row) for row in rows) <= size[0]
    assert cell_len(page.next_step) <= 77
    assert "align_page." not in page.text + page.next_step


@pytest.mark.parametrize("language", LANGUAGES)
def test_positions_have_their_units_in_every_language(language: str) -> None:
    text = shown(state(), language=language).text
    # 76 mm less 50 mm, 41200 counts of 1 um, 350 counts of 360/10000 degrees after one whole turn.
    assert "R 26.0000 mm" in text
    assert "41.200 mm" in text
    assert "12.60 °" in text
    assert "0.6 um" in text


def test_the_touch_off_moves_the_radius() -> None:
    assert "R 26.5000 mm" in shown(state(VALID)).text


def test_old_values_say_their_age() -> None:
    assert "STALE: last look 3 s ago" in shown(state(looked_s=97.0)).text
    assert "STALE" not in shown(state()).text


def test_nothing_known_is_shown_as_nothing() -> None:
    page = shown(state(Alignment(), snapshot=None, seen=None), "align.step")
    assert "R " not in page.text.split("Jog")[0]
    assert "–" in page.text
    assert (page.orders, page.said) == ([], ["screen.nothing_known"])


def test_steps_have_marks_and_the_present_one_says_how() -> None:
    text = shown(state()).text
    assert "✓ 4 homed" in text
    assert "● 5 jaw 1" in text
    assert "○ 6 tool" in text
    assert "until jaw 1 meets the mark" in text


def test_a_valid_alignment_names_what_it_rests_on() -> None:
    text = shown(state(VALID), size=(100, 30)).text
    assert "Alignment: valid" in text
    for stamp in ("1314 N  08:40", "12.60 °  08:45", "R 76.500 mm  08:46"):
        assert stamp in text


def test_what_is_seen_is_told_as_simulated() -> None:
    text = shown(state()).text
    assert "SIM jaw 1 is 12.34° past the mark" in text
    assert "SIM gap tool to part 0.250 mm" in text
    touching = shown(state(seen=ShopView(jaw_1_past_mark_deg=-0.5, tool_gap_mm=-0.002))).text
    assert "0.50° before the mark" in touching
    assert "touches, 0.002 mm deep" in touching


def test_a_real_machine_has_no_simulated_view() -> None:
    page = shown(state(simulated=False, seen=None), size=(100, 30))
    assert "SIM" not in page.text
    assert "indicator" in page.text
    assert "seen" not in page.text


def test_a_larger_terminal_has_a_picture_of_the_chuck() -> None:
    assert "◂" in shown(state(), size=(100, 30)).text
    assert "◂" not in shown(state()).text


@pytest.mark.parametrize(
    ("alignment", "flags", "order"),
    [
        (Alignment(), OFF, Verify()),
        (Alignment(settings=(), drives_on=True), ON, SwitchOff()),
        (Alignment(settings=(), clamping=CLAMPED), OFF, SwitchOn()),
        (Alignment(settings=(), clamping=CLAMPED, drives_on=True), ON, Home()),
        (replace(NO_JAW, jaw=JAW), ON, Approach(job=experiment().job)),
    ],
    ids=["verify", "hands need the drives off", "drives", "home", "touch off"],
)
def test_f4_does_the_step_that_the_machine_does(
    alignment: Alignment, flags: frozenset[str], order: Intent
) -> None:
    page = shown(state(alignment, snapshot=look(flags)), "align.step")
    assert (page.orders, page.said) == ([order], [])


@pytest.mark.parametrize(
    ("alignment", "flags", "code"),
    [
        (Alignment(settings=()), OFF, "screen.enter_does_it"),
        (NO_JAW, ON, "screen.jog_does_it"),
        (VALID, ON, "screen.aligned"),
    ],
)
def test_f4_says_where_it_does_nothing(alignment: Alignment, flags: frozenset[str], code: str) -> None:
    page = shown(state(alignment, snapshot=look(flags)), "align.step")
    assert (page.orders, page.said) == ([], [code])


@pytest.mark.parametrize(
    ("alignment", "flags", "order"),
    [
        (Alignment(settings=()), OFF, ConfirmClamping(job=experiment().job)),
        (Alignment(settings=(), clamping=CLAMPED), OFF, ConfirmClamping(job=experiment().job)),
        (NO_JAW, ON, TakeJaw()),
        (replace(NO_JAW, jaw=JAW), ON, TakeTouchOff(radius_mm=26.0)),
    ],
    ids=["clamp", "another blank", "jaw", "touch off"],
)
def test_enter_takes_what_hands_have_done(alignment: Alignment, flags: frozenset[str], order: Intent) -> None:
    page = shown(state(alignment, snapshot=look(flags)), "align.take")
    assert (page.orders, page.said) == ([order], [])


@pytest.mark.parametrize("alignment", [Alignment(), replace(VALID, homed=False), replace(VALID, drives_on=False)])
def test_enter_moves_nothing(alignment: Alignment) -> None:
    page = shown(state(alignment), "align.take")
    assert (page.orders, page.said) == ([], ["screen.f4_does_it"])


def test_the_clamping_names_blank_and_force_and_why() -> None:
    text = " ".join(shown(state(Alignment(settings=()), snapshot=look(OFF)), size=(160, 48)).text.split())
    assert "D 52.000 mm" in text
    assert "1314 N total" in text
    assert "its error of 55.0 um" in text


def test_another_force_than_the_measured_one_is_not_clamped() -> None:
    work = experiment()
    harder = replace(work, job=replace(work.job, chucking_force_n=2000.0))
    page = shown(state(Alignment(settings=()), snapshot=look(OFF)), "align.take", work=harder)
    assert (page.orders, page.said) == ([], ["rule.force_differs"])
    assert "2000 N" in page.text


def test_without_a_job_only_what_needs_none() -> None:
    idle = state(Alignment(settings=(), clamping=CLAMPED), snapshot=look(OFF))
    assert shown(idle, "align.step", no_job=True).orders == [SwitchOn()]
    page = shown(state(), "align.take", "align.step", "align.enable", "align.in", no_job=True)
    assert page.orders == [Jog(axis=AxisName.TOOL, distance=0.01)]
    assert page.next_step == "Open a job first: 1."
    assert shown(state(), "align.take", no_job=True).said == ["screen.nothing_to_align"]


def test_when_all_is_valid_enter_takes_again_only_what_was_jogged() -> None:
    assert shown(state(VALID), "align.take").said == ["screen.aligned"]
    turned = shown(state(VALID), "align.enable", "align.forward", "align.take")
    assert turned.orders == [Jog(axis=AxisName.SPINDLE, distance=0.1), TakeJaw()]
    assert "jaw 1 again at 12.60" in turned.next_step
    moved = shown(state(VALID), "align.enable", "align.out", "align.take")
    assert moved.orders[-1] == TakeTouchOff(radius_mm=26.0)


@pytest.mark.parametrize(
    ("key", "axis", "distance"),
    [
        ("align.in", AxisName.TOOL, 0.01),
        ("align.out", AxisName.TOOL, -0.01),
        ("align.chuck", AxisName.CARRIAGE, 0.01),
        ("align.tail", AxisName.CARRIAGE, -0.01),
        ("align.forward", AxisName.SPINDLE, 0.1),
        ("align.backward", AxisName.SPINDLE, -0.1),
    ],
)
def test_a_jog_key_is_one_step_of_its_axis(key: str, axis: AxisName, distance: float) -> None:
    assert shown(state(), "align.enable", key).orders == [Jog(axis=axis, distance=distance)]


def test_the_ladder_has_ends() -> None:
    page = shown(state(), "align.enable", *["align.larger"] * 9, "align.tail", "align.forward")
    assert [order.distance for order in page.orders if isinstance(order, Jog)] == [-10.0, 30.0]
    assert "[10.000]" in page.text
    assert "[30.00]" in page.text
    least = shown(state(), "align.enable", *["align.smaller"] * 9, "align.tail").orders[0]
    assert least == Jog(axis=AxisName.CARRIAGE, distance=-0.001)


def test_nothing_jogs_before_it_is_enabled() -> None:
    page = shown(state(), "align.in")
    assert (page.orders, page.said) == ([], ["screen.jog_not_enabled"])
    assert "jog off" in page.text


def test_the_jog_ends_by_idleness_and_with_the_page() -> None:
    assert "jog enabled, 30 s left" in shown(state(), "align.enable").text
    assert "jog enabled, 12 s left" in shown(state(), "align.enable", then_s=18.5).text
    assert "jog off" in shown(state(), "align.enable", then_s=30.0).text
    assert "jog off" in shown(state(), "align.enable", leave=True).text


def test_before_the_touch_off_steps_toward_the_work_are_short() -> None:
    page = shown(state(), "align.enable", *["align.larger"] * 3, "align.in")
    assert (page.orders, page.said) == ([], ["screen.step_too_long"])
    assert "≤ 1.000 mm" in page.text
    allowed = shown(state(), "align.enable", *["align.larger"] * 2, "align.in").orders
    assert allowed == [Jog(axis=AxisName.TOOL, distance=1.0)]


def test_after_it_they_end_at_the_surface() -> None:
    # The tip stands at 26.5 mm before a part of 26.0 mm.
    page = shown(state(VALID), "align.enable", "align.larger", "align.larger", "align.in")
    assert page.said == ["screen.step_too_long"]
    assert "≤ 0.500 mm" in page.text


def test_the_run_on_after_a_stop_is_told_for_every_axis() -> None:
    page = shown(state(), *["align.larger"] * 3)
    # 10 mm/s for 55 ms and the ramp, rounded up.
    assert "X 0.557" in page.text


def test_a_held_key_is_one_step_and_another_stops() -> None:
    control = FixedControl(state())
    desk = desk_for(control, Path("/nowhere"), work=experiment())
    page = AlignPage(desk)
    page.act("align.enable")
    page.act("align.tail")
    control.state = state(activity=Activity.JOGGING)
    page.act("align.tail")
    assert (len(control.orders), control.stops) == (1, [])
    page.act("align.chuck")
    assert len(control.stops) == 1
    assert desk.said[0].code == "screen.key_in_motion"
    page.act("align.larger")
    page.act("align.off")
    assert len(control.stops) == 3
    assert len(control.orders) == 1


def test_leaving_in_mid_step_stops() -> None:
    assert shown(state(activity=Activity.JOGGING), leave=True).stops == ["page"]
    assert shown(state(activity=Activity.HOMING), leave=True).stops == []


def test_the_drives_go_off_at_rest() -> None:
    assert shown(state(), "align.off").orders == [SwitchOff()]
    assert shown(state(snapshot=look(OFF)), "align.off").said == ["screen.drives_are_off"]


@pytest.mark.parametrize("key", ["align.step", "align.take", "align.enable"])
def test_after_a_stop_the_way_on_is_named(key: str) -> None:
    stopped = state(
        stop=StopState(reason="space", killed=False, sent_s=99.0, rest_s=99.5), activity=Activity.STOPPED
    )
    page = shown(stopped, key)
    assert (page.orders, page.said) == ([], ["screen.stopped_first"])
    assert "F2" in page.next_step


@pytest.mark.parametrize("activity", [Activity.VERIFYING, Activity.SWITCHING, Activity.ARMING])
def test_a_busy_controller_takes_no_order(activity: Activity) -> None:
    page = shown(state(activity=activity), "align.take")
    assert (page.orders, page.said) == ([], ["screen.busy"])


def test_showing_the_same_again_paints_nothing() -> None:
    desk = desk_for(FixedControl(state()), Path("/nowhere"), work=experiment())
    page = AlignPage(desk)
    view = View(state=state(), work=desk.work, now_s=100.0)

    async def run() -> int:
        app = PageStage(page, view)
        async with app.run_test(size=(80, 18)) as pilot:
            await pilot.pause()
            page.show(view)
            painted = 0
            for sheet in page.query("Sheet"):
                original = sheet.refresh

                def count(*regions: Any, original: Any = original, **more: Any) -> Any:
                    nonlocal painted
                    painted += 1
                    return original(*regions, **more)

                sheet.refresh = count  # type: ignore[method-assign]
            page.show(view)
            return painted

    assert asyncio.run(run()) == 0
