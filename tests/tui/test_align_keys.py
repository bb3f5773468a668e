"""The page Align: which keys order what, and what they say where they order nothing."""

from __future__ import annotations

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
from tests.tui.page_stage import Shown, shown_in_turn
from tests.tui.stage import CLAMPED, JAW, ON, FixedControl, PageStage, experiment, grid, ui_for

STOPPED = StopState(reason="space", killed=False, sent_s=99.0, rest_s=99.5)


MOVING = look(ON - {"desired_velocity_zero"})
JOB = experiment().job
TOUCHES = replace(NO_JAW, jaw=JAW)
KEYS: dict[str, dict[str, tuple[StationState, list[Command], list[str]]]] = {
    "align.step": {
        "verify": (state(Alignment(), snapshot=look(OFF)), [Verify()], []),
        "hands need the drives off": (state(Alignment(settings=(), drives_on=True)), [DisableDrives()], []),
        "drives": (state(Alignment(settings=(), clamping=CLAMPED), snapshot=look(OFF)), [EnableDrives()], []),
        "home": (state(Alignment(settings=(), clamping=CLAMPED, drives_on=True)), [Home()], []),
        "touch off": (state(TOUCHES), [Approach(job=JOB)], []),
        "clamp": (state(Alignment(settings=()), snapshot=look(OFF)), [], ["screen.enter_does_it"]),
        "jaw 1": (state(), [], ["screen.jog_does_it"]),
        "all valid": (state(VALID), [], ["screen.aligned"]),
        "lost": (state(VALID, activity=Activity.LOST, snapshot=MOVING), [], ["session.lost"]),
    },
    "align.take": {
        "clamp": (state(Alignment(settings=()), snapshot=look(OFF)), [ConfirmClamping(job=JOB)], []),
        "another blank": (
            state(Alignment(settings=(), clamping=CLAMPED), snapshot=look(OFF), seen=NEAR),
            [ConfirmClamping(job=JOB)],
            [],
        ),
        "jaw": (state(seen=NEAR), [TakeJaw()], []),
        "touch off": (state(TOUCHES, snapshot=IN_PART, seen=NEAR), [TakeTouchOff(radius_mm=26.0)], []),
        "touch off, real": (
            state(TOUCHES, snapshot=IN_PART, simulated=False, seen=None),
            [TakeTouchOff(radius_mm=26.0)],
            [],
        ),
        # Enter moves nothing.
        "verify": (state(Alignment()), [], ["screen.f4_does_it"]),
        "home": (state(replace(VALID, homed=False)), [], ["screen.f4_does_it"]),
        "drives": (state(replace(VALID, drives_on=False)), [], ["screen.f4_does_it"]),
        # The part begins at 170 mm, the tool is at 41.2 mm; what an eye sees at the simulator changes nothing.
        "seen beside": (state(TOUCHES, seen=replace(NEAR, tool_gap_mm=None)), [], ["alignment.beside_part"]),
        "seen over it": (state(TOUCHES, seen=NEAR), [], ["alignment.beside_part"]),
        "real": (state(TOUCHES, simulated=False, seen=None), [], ["alignment.beside_part"]),
        **{
            f"busy {busy}": (state(activity=busy), [], ["screen.busy"])
            for busy in (Activity.VERIFYING, Activity.SWITCHING, Activity.ARMING)
        },
    },
    "align.back": {
        "verify": (state(Alignment()), [], ["screen.nothing_to_take_back"]),
        "jaw 1": (state(), [], ["screen.nothing_to_take_back"]),
        "drives": (state(replace(VALID, drives_on=False)), [], ["screen.nothing_to_take_back"]),
        "touch off": (state(replace(VALID, touch_off=None)), [Forget()], []),
        "all valid": (state(VALID, seen=NEAR), [Forget()], []),
    },
    "align.off": {
        "on": (state(), [DisableDrives()], []),
        "off": (state(snapshot=look(OFF)), [], ["screen.drives_are_off"]),
    },
}


@pytest.mark.parametrize("key", KEYS)
def test_a_key_does_the_step_that_is_its_own_and_says_where_it_does_nothing(key: str) -> None:
    """F4 does what the machine does, Enter takes what hands have done, b goes back, F3 disables the drives."""
    pages = shown_in_turn(AlignPage, {name: now for name, (now, *_) in KEYS[key].items()}, key)
    found = {name: (page.orders, page.said) for name, page in pages.items()}
    assert found == {name: (orders, said) for name, (_, orders, said) in KEYS[key].items()}


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


def test_when_all_is_valid_enter_takes_nothing_and_b_goes_back_without_a_job_too() -> None:
    turned = shown(state(VALID), "align.enable", "align.forward", "align.take")
    assert turned.orders == [Jog(axis=AxisName.SPINDLE, distance=0.1)]
    assert turned.said == ["screen.aligned"]
    assert "b redoes" in shown(state(VALID, seen=NEAR), "align.back").next_step
    assert shown(state(VALID), "align.back", no_job=True).orders == [Forget()]
    assert shown(state(NO_JAW), "align.back", no_job=True).said == ["screen.nothing_to_take_back"]


def test_jaw_1_far_from_the_mark_is_taken_only_when_asked_again() -> None:
    far, near = state(seen=FAR), state(seen=WorkshopView(jaw_1_past_mark_deg=-0.9, tool_gap_mm=None))
    once = later(far, (0.0, "align.take"))
    assert (once.orders, once.said) == ([], ["screen.jaw_far"])
    assert later(far, (0.0, "align.take"), (2.0, "align.take")).orders == [TakeJaw()]
    assert later(far, (0.0, "align.take"), (3.1, "align.take")).orders == []
    assert later(far, (0.0, "align.take"), (1.0, "align.enable"), (2.0, "align.take")).orders == []
    assert later(near, (0.0, "align.take")).orders == [TakeJaw()], "near the mark at once"


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


def test_a_jog_key_is_one_step_of_its_axis() -> None:
    jogs = {"in": "X", "out": "-X", "chuck": "Z", "tail": "-Z", "forward": "C", "backward": "-C"}
    axes = {"X": (AxisName.TOOL, 0.01), "Z": (AxisName.CARRIAGE, 0.01), "C": (AxisName.SPINDLE, 0.1)}
    for key, way in jogs.items():
        axis, distance = axes[way[-1]]
        signed = -distance if way[0] == "-" else distance
        assert shown(state(), "align.enable", f"align.{key}").orders == [Jog(axis=axis, distance=signed)]


def distances(page: Shown) -> list[float]:
    return [order.distance for order in page.orders if isinstance(order, Jog)]


def test_each_ladder_has_ends_and_a_choice_of_degrees_is_none_of_millimetres() -> None:
    """Find jaw 1 in steps of 10 deg: the first step of the tool after it is not one of 1 mm."""
    for now, steps, key, ends, mark in (
        (state(), ["larger"] * 9, "forward", 30.0, "[30.00]"),
        (state(VALID), ["larger"] * 9, "tail", -10.0, "[10.000]"),
        (state(VALID), ["smaller"] * 9, "tail", -0.001, "[0.001]"),
    ):
        page = shown(now, "align.enable", *(f"align.{step}" for step in steps), f"align.{key}")
        assert distances(page) == [ends] and mark in page.text
    both = shown(state(), "align.enable", *["align.larger"] * 2, "align.forward", "align.out")
    assert distances(both) == [10.0, -0.01]
    assert "[10.00]" in both.text and "[0.010]" in both.text


@pytest.mark.parametrize(
    ("alignment", "keys", "axes", "chosen"),
    [
        (NO_JAW, (), "C °", "[1.00]"),
        (TOUCHES, (), "X Z mm", "[0.100]"),
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
    (marked,) = [row for row in page.text.splitlines() if "▸" in row]
    assert chosen in marked
    done = shown(state(), "align.enable", "align.forward", then=state(TOUCHES))
    assert "(+ -: X Z mm)" in done.text, "after jaw 1 it is about the tool again"


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
    assert (control.orders, [problem.code for problem in ui.key_answer]) == ([], ["screen.jog_not_enabled"])


async def test_while_it_moves_the_time_of_the_jog_is_whole() -> None:
    """A tick shows what was read some ms before: 30 s of 30, by the time of the view, not 31."""
    control = FixedControl(state(), now_s=100.02)
    ui = ui_for(control, Path("/nowhere"), work=experiment())
    page = AlignPage(ui)
    page.act("align.enable")
    view = View(state=state(activity=Activity.JOGGING), work=ui.work, now_s=100.0)
    async with (app := PageStage(page, view)).run_test(size=(80, 18)) as pilot:
        await pilot.pause()
        page.show(view)
        await pilot.pause()
        assert "jog enabled, 30 s left" in grid(app)


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
    assert ui.key_answer[0].code == "screen.key_in_motion"
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


@pytest.mark.parametrize("key", ["align.step", "align.take", "align.enable"])
def test_after_a_stop_the_way_on_is_named(key: str) -> None:
    page = shown(state(stop=STOPPED, activity=Activity.STOPPED), key)
    assert (page.orders, page.said) == ([], ["screen.stopped_first"])
    assert "F2" in page.next_step


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
