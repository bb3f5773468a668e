"""The page Align: which keys order what, and what they say where they order nothing."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from console.session.cut.alignment import Alignment, TouchOff
from console.session.station.commands import (
    Approach,
    Command,
    ConfirmClamping,
    DisableDrives,
    EnableDrives,
    Forget,
    Home,
    Jog,
    TakeJaw,
    TakeTouchOff,
    Verify,
)
from console.session.station.state import Activity, StationState, StopState
from console.tui.pages.align import AlignPage
from console.tui.ui_context import View
from drivers.lathe.snapshot import AxisName
from drivers.simulator.plant.workshop_view import WorkshopView
from profiles.problem import Problem
from tests.tui.align_stage import (
    FAR,
    IN_PART,
    NEAR,
    NO_JAW,
    OFF,
    OTHER,
    VALID,
    later,
    look,
    shown,
    state,
    words_of,
)
from tests.tui.machine_states import CLAMPED, JAW, ON
from tests.tui.page_stage import Shown
from tests.tui.stage import FixedControl, PageStage, experiment, grid, ui_for

STOPPED = StopState(reason="space", killed=False, sent_s=99.0, rest_s=99.5)


@pytest.mark.parametrize(
    ("alignment", "flags", "order"),
    [
        (Alignment(), OFF, Verify()),
        (Alignment(settings=(), drives_on=True), ON, DisableDrives()),
        (Alignment(settings=(), clamping=CLAMPED), OFF, EnableDrives()),
        (Alignment(settings=(), clamping=CLAMPED, drives_on=True), ON, Home()),
        (replace(NO_JAW, jaw=JAW), ON, Approach(job=experiment().job)),
    ],
    ids=["verify", "hands need the drives off", "drives", "home", "touch off"],
)
def test_f4_does_the_step_that_the_machine_does(
    alignment: Alignment, flags: frozenset[str], order: Command
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
def test_enter_takes_what_hands_have_done(alignment: Alignment, flags: frozenset[str], order: Command) -> None:
    page = shown(state(alignment, snapshot=look(flags, carriage_mm=172.0), seen=NEAR), "align.take")
    assert (page.orders, page.said) == ([order], [])


@pytest.mark.parametrize("alignment", [Alignment(), replace(VALID, homed=False), replace(VALID, drives_on=False)])
def test_enter_moves_nothing(alignment: Alignment) -> None:
    page = shown(state(alignment), "align.take")
    assert (page.orders, page.said) == ([], ["screen.f4_does_it"])


def test_another_force_than_the_measured_one_is_not_clamped() -> None:
    work = experiment()
    harder = replace(work, job=replace(work.job, chucking_force_n=2000.0))
    page = shown(state(Alignment(settings=()), snapshot=look(OFF)), "align.take", work=harder)
    assert (page.orders, page.said) == ([], ["rule.force_differs"])
    assert "2000 N" in page.text


def test_without_a_job_only_what_needs_none() -> None:
    idle = state(Alignment(settings=(), clamping=CLAMPED), snapshot=look(OFF))
    assert shown(idle, "align.step", no_job=True).orders == [EnableDrives()]
    page = shown(state(), "align.take", "align.step", "align.enable", "align.in", no_job=True)
    assert page.orders == [Jog(axis=AxisName.TOOL, distance=0.01)]
    assert page.next_step == "No job is open: press 1."
    assert "so does jogging, once homed" in words_of(shown(state(), size=(160, 48), no_job=True).text)
    assert shown(state(), "align.take", no_job=True).said == ["screen.nothing_to_align"]


def test_when_all_is_valid_enter_takes_nothing_and_b_goes_back() -> None:
    turned = shown(state(VALID), "align.enable", "align.forward", "align.take")
    assert turned.orders == [Jog(axis=AxisName.SPINDLE, distance=0.1)]
    assert turned.said == ["screen.aligned"]
    back = shown(state(VALID, seen=NEAR), "align.back")
    assert (back.orders, back.said) == ([Forget()], [])
    assert "b redoes" in back.next_step
    assert shown(state(replace(VALID, touch_off=None)), "align.back").orders == [Forget()]


@pytest.mark.parametrize("alignment", [Alignment(), NO_JAW, replace(VALID, drives_on=False)])
def test_b_has_nothing_to_go_back_to_before_jaw_1(alignment: Alignment) -> None:
    page = shown(state(alignment), "align.back")
    assert (page.orders, page.said) == ([], ["screen.nothing_to_take_back"])


def test_b_goes_back_without_a_job_too() -> None:
    assert shown(state(VALID), "align.back", no_job=True).orders == [Forget()]
    assert shown(state(NO_JAW), "align.back", no_job=True).said == ["screen.nothing_to_take_back"]


@pytest.mark.parametrize(
    "beside",
    [
        # The part begins at 170 mm, the tool is at 41.2 mm; what an eye sees at the simulator changes nothing.
        state(replace(NO_JAW, jaw=JAW), seen=WorkshopView(jaw_1_past_mark_deg=0.0, tool_gap_mm=None)),
        state(replace(NO_JAW, jaw=JAW), seen=NEAR),
        state(replace(NO_JAW, jaw=JAW), simulated=False, seen=None),
    ],
    ids=["seen beside", "seen over it", "real"],
)
def test_beside_the_part_nothing_is_touched_off(beside: StationState) -> None:
    page = shown(beside, "align.take")
    assert (page.orders, page.said) == ([], ["alignment.beside_part"])


def test_over_the_part_of_a_real_lathe_the_touch_off_is_taken() -> None:
    over = state(replace(NO_JAW, jaw=JAW), simulated=False, seen=None, snapshot=look(carriage_mm=172.0))
    assert shown(over, "align.take").orders == [TakeTouchOff(radius_mm=26.0)]


def test_jaw_1_far_from_the_mark_is_taken_only_when_asked_again() -> None:
    far = state(seen=FAR)
    once = later(far, (0.0, "align.take"))
    assert (once.orders, once.said) == ([], ["screen.jaw_far"])
    assert later(far, (0.0, "align.take"), (2.0, "align.take")).orders == [TakeJaw()]
    assert later(far, (0.0, "align.take"), (3.1, "align.take")).orders == []
    assert later(far, (0.0, "align.take"), (1.0, "align.enable"), (2.0, "align.take")).orders == []


def test_jaw_1_near_the_mark_is_taken_at_once() -> None:
    assert later(
        state(seen=WorkshopView(jaw_1_past_mark_deg=-0.9, tool_gap_mm=None)), (0.0, "align.take")
    ).orders == [TakeJaw()]


def test_a_key_says_of_a_lost_machine_that_it_is_lost() -> None:
    moving = look(ON - {"desired_velocity_zero"})
    page = shown(state(VALID, activity=Activity.LOST, snapshot=moving), "align.step")
    assert (page.orders, page.said) == ([], ["session.lost"])


def test_the_tool_in_the_clamped_part_is_in_it_whatever_job_is_open() -> None:
    off = look(OFF | {"home_complete"}, carriage_mm=172.0)
    clamp = shown(state(OTHER, snapshot=off), "align.take")
    assert (clamp.orders, clamp.said) == ([], ["machine.tool_in_part"])
    assert "in or at the part" in clamp.next_step
    assert "hands out; F4 enables the drives" in words_of(clamp.text)
    # It can be jogged out only with its drive on.
    assert shown(state(OTHER, snapshot=off), "align.step").orders == [EnableDrives()]
    on = shown(state(OTHER, snapshot=IN_PART), "align.step")
    assert (on.orders, on.said) == ([], ["machine.tool_in_part"])
    assert "jog it out" in on.next_step


def test_beside_the_part_the_tool_does_not_keep_another_blank_out() -> None:
    off = look(OFF | {"home_complete"})
    assert shown(state(OTHER, snapshot=off), "align.take").orders == [ConfirmClamping(job=experiment().job)]


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


def distances(page: Shown) -> list[float]:
    return [order.distance for order in page.orders if isinstance(order, Jog)]


def test_each_ladder_has_ends() -> None:
    turning = shown(state(), "align.enable", *["align.larger"] * 9, "align.forward")
    assert distances(turning) == [30.0]
    assert "[30.00]" in turning.text
    linear = shown(state(VALID), "align.enable", *["align.larger"] * 9, "align.tail")
    assert distances(linear) == [-10.0]
    assert "[10.000]" in linear.text
    least = shown(state(VALID), "align.enable", *["align.smaller"] * 9, "align.tail").orders[0]
    assert least == Jog(axis=AxisName.CARRIAGE, distance=-0.001)


def test_a_choice_of_degrees_is_none_of_millimetres() -> None:
    """Find jaw 1 in steps of 10 deg: the first step of the tool after it is not one of 1 mm."""
    page = shown(state(), "align.enable", *["align.larger"] * 2, "align.forward", "align.out")
    assert distances(page) == [10.0, -0.01]
    assert "[10.00]" in page.text
    assert "[0.010]" in page.text


@pytest.mark.parametrize(
    ("alignment", "keys", "axes", "chosen"),
    [
        (NO_JAW, (), "C °", "[1.00]"),
        (replace(NO_JAW, jaw=JAW), (), "X Z mm", "[0.100]"),
        # What was jogged last, until the step is done.
        (NO_JAW, ("align.enable", "align.tail"), "X Z mm", "[0.100]"),
        (VALID, ("align.enable", "align.forward"), "C °", "[1.00]"),
    ],
    ids=["jaw 1", "touch off", "carriage jogged", "spindle jogged"],
)
def test_plus_changes_the_step_that_the_panel_names(
    alignment: Alignment, keys: tuple[str, ...], axes: str, chosen: str
) -> None:
    page = shown(state(alignment), *keys, "align.larger")
    assert f"(+ -: {axes})" in page.text
    assert chosen in page.text
    marked = [row for row in page.text.splitlines() if "▸" in row]
    assert len(marked) == 1 and chosen in marked[0]


def test_the_step_after_jaw_1_is_about_the_tool_again() -> None:
    found = state(replace(NO_JAW, jaw=JAW))
    page = shown(state(), "align.enable", "align.forward", then=found)
    assert "(+ -: X Z mm)" in page.text


def test_nothing_jogs_before_it_is_enabled() -> None:
    page = shown(state(), "align.in")
    assert (page.orders, page.said) == ([], ["screen.jog_not_enabled"])
    assert "jog disabled" in page.text


def test_the_jog_ends_by_idleness_and_with_the_page() -> None:
    assert "jog enabled, 30 s left" in shown(state(), "align.enable").text
    assert "jog enabled, 12 s left" in shown(state(), "align.enable", then_s=18.5).text
    assert "jog disabled" in shown(state(), "align.enable", then_s=30.0).text
    assert "jog disabled" in shown(state(), "align.enable", leave=True).text


@pytest.mark.parametrize("changes", [{"stop": STOPPED}, {"stops": 1}, {"activity": Activity.LOST}])
def test_the_jog_ends_with_a_stop_and_does_not_come_back(changes: dict[str, Any]) -> None:
    """With the first two: while it is in force, and after F2, where the page was not seen meanwhile."""
    page = shown(state(), "align.enable", then=state(**changes))
    assert "jog disabled" in page.text
    assert "jog enabled" in shown(state(), "align.enable", then=state()).text


def test_the_state_has_whether_the_jog_is_enabled() -> None:
    """The feed and `console next` name the next step by it."""
    control = FixedControl(state())
    page = AlignPage(ui_for(control, Path("/nowhere"), work=experiment()))
    page.act("align.enable")
    assert control.state.jog_enabled
    page.leave()
    assert not control.state.jog_enabled


def test_after_a_stop_the_jog_keys_want_to_be_enabled_again() -> None:
    control = FixedControl(state())
    ui = ui_for(control, Path("/nowhere"), work=experiment())
    page = AlignPage(ui)
    page.act("align.enable")
    control.state = state(stops=1)
    page.act("align.tail")
    assert (control.orders, [problem.code for problem in ui.said]) == ([], ["screen.jog_not_enabled"])


def test_while_it_moves_the_time_of_the_jog_is_whole() -> None:
    """A tick shows what was read some ms before: 30 s of 30, by the time of the view, not 31."""
    control = FixedControl(state(), now_s=100.02)
    ui = ui_for(control, Path("/nowhere"), work=experiment())
    page = AlignPage(ui)
    page.act("align.enable")
    jogging = state(activity=Activity.JOGGING)

    async def run() -> str:
        view = View(state=jogging, work=ui.work, now_s=100.0)
        app = PageStage(page, view)
        async with app.run_test(size=(80, 18)) as pilot:
            await pilot.pause()
            page.show(view)
            await pilot.pause()
            return grid(app)

    assert "jog enabled, 30 s left" in asyncio.run(run())


def test_before_the_touch_off_steps_toward_the_work_are_short() -> None:
    untouched = state(replace(NO_JAW, jaw=JAW))
    page = shown(untouched, "align.enable", *["align.larger"] * 3, "align.in")
    assert (page.orders, page.said) == ([], ["screen.step_too_long"])
    assert "≤ 1.000 mm" in page.text
    allowed = shown(untouched, "align.enable", *["align.larger"] * 2, "align.in").orders
    assert allowed == [Jog(axis=AxisName.TOOL, distance=1.0)]


def test_after_it_they_end_at_the_surface() -> None:
    # The tip stands at 26.5 mm before a part of 26.0 mm.
    page = shown(state(VALID), "align.enable", "align.larger", "align.larger", "align.in")
    assert page.said == ["screen.step_too_long"]
    assert "≤ 0.500 mm" in page.text


def test_a_step_as_long_as_the_gap_that_is_shown_is_allowed() -> None:
    # 0.9998 mm before the surface is shown as 1.000.
    near = replace(VALID, touch_off=TouchOff(zero_radius_mm=76.9998, diameter_mm=52.0, at="08:46"))
    page = shown(state(near), "align.enable", "align.larger", "align.larger", "align.in")
    assert page.orders == [Jog(axis=AxisName.TOOL, distance=1.0)]
    assert "≤ 1.000 mm" in page.text


def test_the_gap_is_that_of_the_clamped_blank() -> None:
    # 53 mm are clamped, 52 mm are in hand: the tip at R 26.5 mm touches.
    page = shown(state(OTHER), "align.enable", "align.larger", "align.in")
    assert (page.orders, page.said) == ([], ["screen.step_too_long"])
    assert "≤ 0.010 mm" in page.text
    # And none is in hand: the clamped one is still there.
    assert "≤ 0.500 mm" in shown(state(VALID), no_job=True).text


def test_the_run_on_after_a_stop_is_told_for_every_axis() -> None:
    page = shown(state(VALID), *["align.larger"] * 3)
    # 10 mm/s for 55 ms and the ramp, rounded up.
    assert "X 0.557" in page.text


def test_a_held_key_is_one_step_and_another_stops() -> None:
    control = FixedControl(state())
    ui = ui_for(control, Path("/nowhere"), work=experiment())
    page = AlignPage(ui)
    page.act("align.enable")
    page.act("align.tail")
    control.state = state(activity=Activity.JOGGING)
    page.act("align.tail")
    assert (len(control.orders), control.stops) == (1, [])
    page.act("align.chuck")
    assert ui.said[0].code == "screen.key_in_motion"
    page.act("align.larger")
    page.act("align.off")
    assert control.stops == ["change ←", "change +", "change F3"]
    assert len(control.orders) == 1


def test_a_step_may_be_chosen_while_something_else_than_a_jog_moves() -> None:
    page = shown(state(activity=Activity.HOMING), "align.larger")
    assert (page.stops, page.said) == ([], [])
    assert "[1.00]" in page.text


def test_leaving_in_mid_step_stops() -> None:
    assert shown(state(activity=Activity.JOGGING), leave=True).stops == ["page"]
    assert shown(state(activity=Activity.HOMING), leave=True).stops == []


def test_the_drives_go_off_at_rest() -> None:
    assert shown(state(), "align.off").orders == [DisableDrives()]
    assert shown(state(snapshot=look(OFF)), "align.off").said == ["screen.drives_are_off"]


@pytest.mark.parametrize("key", ["align.step", "align.take", "align.enable"])
def test_after_a_stop_the_way_on_is_named(key: str) -> None:
    page = shown(state(stop=STOPPED, activity=Activity.STOPPED), key)
    assert (page.orders, page.said) == ([], ["screen.stopped_first"])
    assert "F2" in page.next_step


@pytest.mark.parametrize("activity", [Activity.VERIFYING, Activity.SWITCHING, Activity.ARMING])
def test_a_busy_controller_takes_no_order(activity: Activity) -> None:
    page = shown(state(activity=activity), "align.take")
    assert (page.orders, page.said) == ([], ["screen.busy"])


def test_after_a_last_cut_that_ended_early_f4_enables_the_drives_to_take_the_tool_out() -> None:
    """A new console knows no clamping; nobody has to confirm one to get the tool out of the part."""
    left = replace(VALID, clamping=None, drives_on=False, lost=(Problem(code="alignment.ended_early"),))
    off = shown(state(left, snapshot=look(OFF)), "align.step")
    assert (off.orders, off.said) == ([EnableDrives()], [])
    assert "NEW blank" in off.next_step and "F8" in off.next_step
    on = shown(state(replace(left, drives_on=True)), "align.step")
    assert on.orders == [DisableDrives()]
    assert "F8" in on.next_step
    assert [type(order) for order in shown(state(left, snapshot=look(OFF)), "align.take").orders] == [
        ConfirmClamping
    ]


def test_after_a_restart_of_the_controller_f4_homes_before_the_chuck_is_opened() -> None:
    """Where the tool stands is not known then: the home search takes it out, and no blank is lied about."""
    early = (Problem(code="alignment.ended_early"),)
    left = replace(VALID, clamping=None, drives_on=False, homed=False, lost=early)
    unhomed = ON - {"home_complete"}
    off = shown(state(left, snapshot=look(OFF - {"home_complete"})), "align.step")
    assert off.orders == [EnableDrives()] and "again" not in off.said
    assert "F4 homes" in off.next_step and "F8" not in off.next_step
    on = shown(state(replace(left, drives_on=True), snapshot=look(unhomed)), "align.step")
    assert on.orders == [Home()] and "outward first" in on.next_step
    home = replace(look(), tool=replace(look().tool, position=0.0))
    out = shown(state(replace(left, drives_on=True, homed=True), snapshot=home), "align.step")
    assert out.orders == [DisableDrives()], "at its home the tool is clear of every part"
    assert "only then reach into the chuck" in out.next_step
