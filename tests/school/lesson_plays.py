"""How each lesson is walked at a terminal, to its last step; and how a careless trainee does it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

from tests.school.lesson_pupil import Pupil

Play = Callable[[Pupil, int], None]
"""A lesson to its last step; the number is that of the right answer, from 0."""


def first_look(pupil: Pupil, _: int) -> None:
    pupil.begins(0)
    pupil.homes()


def first_chucking(pupil: Pupil, right: int) -> None:
    pupil.answers(right)
    first_look(pupil, 0)


def jaw_1(pupil: Pupil, _: int) -> None:
    first_look(pupil, 0)
    pupil.finds_jaw_by_dial()


def touch_off(pupil: Pupil, _: int) -> None:
    jaw_1(pupil, 0)
    pupil.feels()
    pupil.press("enter")
    pupil.sees("align_page.valid_title")


def skim(pupil: Pupil, _: int) -> None:
    jaw_1(pupil, 0)
    pupil.feels()
    pupil.skims()


def air_half_full(pupil: Pupil, _: int) -> None:
    pupil.begins(0)
    pupil.sets_up()
    pupil.stage("air")
    pupil.starts_the_cut()
    pupil.sees("run_page.next.arm_air", 120.0)
    pupil.stage("partial")
    pupil.cuts()
    pupil.inspects()
    pupil.clamps_the_next()
    pupil.stage("full")
    pupil.cuts()
    pupil.inspects()


def stop_in_mid_cut(pupil: Pupil, _: int) -> None:
    pupil.begins(0)
    pupil.sets_up()
    pupil.starts_the_cut()
    pupil.sees("run_page.next.cutting", 30.0)
    time.sleep(1.0)
    pupil.press("space")
    pupil.resets()
    pupil.retracts()


def feed_hold(pupil: Pupil, _: int) -> None:
    pupil.begins(0)
    pupil.sets_up()
    pupil.starts_the_cut()
    pupil.sees("run_page.next.cutting", 30.0)
    time.sleep(0.7)
    pupil.press("f4")
    pupil.sees("run_page.next.paused", 30.0)
    pupil.press("f6")
    pupil.sees("run_page.next.measure", 120.0)


def two_parts(pupil: Pupil, _: int) -> None:
    pupil.begins(0)
    pupil.sets_up()
    pupil.cuts()
    pupil.inspects("inspect_page.next_cut_with")
    pupil.press("a")
    pupil.sees("inspect_page.next.kept")
    pupil.clamps_the_next()
    pupil.cuts()
    pupil.inspects("inspect_page.next_cut_with")


def one_part(downs: int) -> Play:
    def play(pupil: Pupil, _: int) -> None:
        pupil.begins(downs)
        pupil.sets_up()
        pupil.cuts()
        pupil.inspects()

    return play


def paper(pupil: Pupil, _: int) -> None:
    pupil.begins(0)
    pupil.sets_up()
    pupil.chooses("▸ paper", "c")
    pupil.cuts()
    pupil.inspects("inspect_page.next.failed")


def alarm_that_matters(pupil: Pupil, _: int) -> None:
    first_look(pupil, 0)
    pupil.acknowledges_and_resets()
    time.sleep(22.0)
    pupil.press("4")
    pupil.sees("align_page.next.drives")
    pupil.does_step("align_page.next.jaw_enable")


def drive_fails(pupil: Pupil, _: int) -> None:
    pupil.begins(0)
    pupil.sets_up()
    pupil.starts_the_cut()
    pupil.acknowledges_and_resets()
    time.sleep(12.0)
    pupil.press("4")
    pupil.does_step("align_page.valid_title")
    pupil.press("5")
    pupil.retracts()


def no_answer(pupil: Pupil, _: int) -> None:
    pupil.begins(0)
    pupil.sets_up()
    pupil.starts_the_cut()
    pupil.acknowledges_and_resets()
    pupil.enables()


def following_error(pupil: Pupil, _: int) -> None:
    first_look(pupil, 0)
    pupil.takes_jaw()
    time.sleep(2.0)
    pupil.press("f4")
    pupil.acknowledges_and_resets()
    pupil.sees("align_page.next.drives")
    pupil.press("f4")  # the tool stands where it was jammed: over the part, or on its way
    pupil.terminal.wait_for(lambda _: not pupil.shows("align_page.next.drives"), 20.0)
    pupil._waits_for_rest()
    pupil.touches_off()


def lost_index(pupil: Pupil, _: int) -> None:
    pupil.begins(0)
    pupil.switches_on()
    pupil.starts_homing()
    pupil.acknowledges_and_resets()
    time.sleep(26.0)
    pupil.press("4")
    for _ in range(30):  # a limit switch that is still open stops it again
        time.sleep(1.5)
        if pupil.shows("frame.recover"):
            pupil.resets()
        elif pupil.shows("align_page.next.jaw_enable"):
            return
        elif not pupil.is_doing("activity.homing"):
            pupil.press("f4")
    pupil.sees("align_page.next.jaw_enable", 60.0)


def cable_cut(pupil: Pupil, _: int) -> None:
    pupil.begins(0)
    pupil.sets_up()
    pupil.starts_the_cut()
    pupil.sees("activity.lost", 30.0)
    pupil.sees("frame.recover", 60.0)
    pupil.press("f2")
    pupil.sees("run_page.next.align", 30.0)
    pupil.enables()


def calibrate_a_lobe(pupil: Pupil, _: int) -> None:
    pupil.begins(0)
    pupil.sets_up()
    pupil.chooses("▸ none", "c")
    pupil.cuts()
    pupil.inspects("inspect_page.next.lobe")
    pupil.press("a")
    pupil.sees("inspect_page.next.lobe_taken")
    pupil.clamps_the_next()
    pupil.chooses("▸ pvt", "c")
    pupil.cuts()
    pupil.inspects("inspect_page.next_cut_with")


def read_a_plot(pupil: Pupil, right: int) -> None:
    one_part(0)(pupil, right)
    pupil.answers(right)


def clamping_force(pupil: Pupil, _: int) -> None:
    pupil.begins(3)
    pupil.sets_up()
    pupil.chooses("▸ none", "c")
    pupil.cuts()
    pupil.inspects("inspect_page.next.lobe")
    pupil.press("2", *["down"] * 5, "enter", *"300", "enter")
    pupil.sees("setup.next.ready")
    pupil.clamps_the_next()
    pupil.cuts()
    pupil.inspects("inspect_page.next.no_lobe")


def second_console(pupil: Pupil, right: int) -> None:
    first_look(pupil, 0)
    pupil.sees("frame.acknowledge", 30.0)
    time.sleep(1.0)
    pupil.press("k")
    pupil.answers(right)
    pupil.press("t")
    time.sleep(1.2)
    pupil.press("t")
    pupil.terminal.wait_for(lambda _: "park" not in pupil.terminal.row(0), 20.0)
    pupil.press("4")
    pupil.sees("align_page.next.clamp_drives_on")
    pupil.press("f3")
    pupil.sees("align_page.next.clamp")
    pupil.press("enter")
    pupil.sees("align_page.next.drives")
    pupil.does_step("align_page.next.jaw_enable")
    pupil.takes_jaw()


PLAYS: Mapping[str, Play] = MappingProxyType(
    {
        "first-look": first_look,
        "first-chucking": first_chucking,
        "jaw-1": jaw_1,
        "touch-off": touch_off,
        "skim": skim,
        "air-half-full": air_half_full,
        "stop-in-mid-cut": stop_in_mid_cut,
        "feed-hold": feed_hold,
        "two-parts": two_parts,
        "thin-ring": one_part(3),
        "paper-experiment-1": paper,
        "alarm-that-matters": alarm_that_matters,
        "drive-fails": drive_fails,
        "following-error": following_error,
        "lost-index": lost_index,
        "cable-cut": cable_cut,
        "no-answer": no_answer,
        "calibrate-a-lobe": calibrate_a_lobe,
        "read-a-plot": read_a_plot,
        "clamping-force": clamping_force,
        "second-console": second_console,
    }
)
"""Every bundled lesson, by its name."""


def careless(pupil: Pupil, steps: Sequence[str]) -> None:
    """Answer without a look, stop for no reason, take jaw 1 by a glance, and give up."""
    if steps[0] == "answered":
        pupil.answers(0)
    pupil.begins(0)
    if steps[-1] == "homed":
        pupil.press("4")
        pupil.sees("align_page.next.clamp")
        pupil.press("enter")
        pupil.sees("align_page.next.drives")
        return
    pupil.switches_on()
    for _ in range(3):
        pupil.starts_homing()
        pupil.press("space")
        pupil.resets()
        pupil.sees("align_page.next.home", 20.0)
    if steps[0] == "homed" and steps[1] in ("stopped", "ousted"):
        return
    pupil.starts_homing()
    pupil.sees("align_page.next.jaw_enable", 60.0)
    pupil.takes_it()
