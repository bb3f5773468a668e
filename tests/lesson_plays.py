"""How a trainee works through each lesson at a terminal: by what is on the screen, and keys."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from types import MappingProxyType

from console.session.cut.jaw_by_indicator import between_deg
from tests.trainee import CLOSE_MM, SETTLES_MM, TOOL_STEPS, Trainee

HALF_JAW_DEG = 11.5
DEG_PER_UM = 0.0011459  # of a stylus 50 mm from the axis
END_UM = 500.0
READINGS = 6
RADIUS_MM = 26.0  # of the blank of the job that blind lessons are about
FREE_MM = 0.65  # so far from where the part is believed the spindle may turn
SURE_MM = 0.35  # the tip is where it is believed within this


class Pupil(Trainee):
    """Works through lessons. `jaw_1_deg` is where it takes jaw 1 whatever the lathe shows, None to look."""

    jaw_1_deg: float | None = None

    def shows(self, key: str) -> bool:
        """Whether a sentence of the catalogue is on the screen now."""
        return re.search(self._pattern(key), self.terminal.text) is not None

    def begins(self, downs: int) -> None:
        """Open the job that is so far down in the list."""
        self.press("1", *["down"] * downs, "enter")
        self.sees("setup.next.ready", 60.0)

    def answers(self, number: int) -> None:
        """Answer the question of the lesson that is due, by its number from 0."""
        self.press("9")
        self.terminal.wait_for("▸ ", 20.0)
        self.press(*["down"] * number, "enter")
        self.terminal.wait_for(lambda text: "▸ " not in text, 10.0)

    def homes(self) -> None:
        self.switches_on()
        self.starts_homing()
        self.sees("align_page.next.jaw_enable", 60.0)

    def turns_to(self, angle_deg: float) -> None:
        """Go to a spindle angle by its number; the jog is enabled."""
        self._asks_for("align_page.asked.c")
        self.press(*f"{angle_deg % 360.0:.2f}", "f6", pace_s=0.25)
        try:
            self.terminal.wait_for(lambda _: self._is_at(angle_deg), 10.0)
        except AssertionError:  # keys that a busy computer read together are asked back
            self.press("enter", "f6", pace_s=0.5)
            self.terminal.wait_for(lambda _: self._is_at(angle_deg), 20.0)
        self._waits_for_rest()
        time.sleep(1.0)  # the entry closes by itself
        self._asks_for("")

    def _is_at(self, angle_deg: float) -> bool:
        return abs(between_deg(self._angle_deg(), angle_deg)) < 0.1

    def _asks_for(self, key: str) -> None:
        """Press g until the number of an axis is asked for; none, where the key is empty."""
        for _ in range(5):
            if (before := self._asked()) == key:
                return
            self.press("g")
            self.terminal.wait_for(lambda _, before=before: self._asked() != before, 10.0)  # type: ignore[misc]
        raise AssertionError(f"{key} is not asked for\n{self.terminal.text}")

    def _asked(self) -> str:
        """The axis whose number is asked for, by the title of the panel."""
        keys = ("align_page.asked.z", "align_page.asked.c")
        return next((key for key in keys if f"╭─ {self._text(key)} ─" in self.terminal.text), "")

    def takes_jaw(self) -> None:
        """Turn jaw 1 to the mark, or to where it is believed."""
        self.press("j")
        for _ in range(2):
            known = self.jaw_1_deg
            self.turns_to(self._angle_deg() + self._read(self._jaw_to_go_deg) if known is None else known)
        self.takes_it()

    def takes_it(self) -> None:
        """Take jaw 1 where it is, also against the console's advice."""
        for _ in range(2):
            self.press("enter")
            with suppress(AssertionError):
                self.sees("align_page.next.touch_off", 2.0)
                return
        self.sees("align_page.next.touch_off")

    def touches_off(self) -> None:
        """Bring the tool to the part and take its radius; the last tenth in small steps."""
        self.comes_over()
        self._jogs(self._gap_mm, ("down", "up"), TOOL_STEPS, CLOSE_MM, SETTLES_MM, "mm")
        self.press("enter")
        self.sees("align_page.valid_title")

    def comes_over(self) -> None:
        if not self.shows("align_page.next.touch_off_over_enable"):
            self.press("f4")
            self.sees("align_page.next.touch_off_over_enable", 90.0)
        self._waits_for_rest()
        self.press("j")

    def sets_up(self) -> None:
        self.homes()
        self.takes_jaw()
        self.touches_off()

    def enables(self) -> None:
        """Enable the drives again, jaw 1 and touch-off still known."""
        self.press("4")
        self.sees("align_page.next.drives")
        self.does_step("align_page.valid_title")

    def retracts(self) -> None:
        """Take the tool out of the part."""
        self.sees("run_page.next.retract", 20.0)
        self.press("f8")
        self.terminal.wait_for(lambda text: not re.search(self._pattern("run_page.next.retract"), text), 40.0)
        self._waits_for_rest()

    def clamps_the_next(self) -> None:
        self.press("4")
        self.sees("align_page.next.clamp")
        self.press("enter")
        self.enables()

    def cuts(self) -> None:
        self.starts_the_cut()
        self.sees("run_page.next.measure", 120.0)

    def inspects(self, then: str) -> None:
        self.press("6")
        self.sees("inspect_page.next_measure")
        self.press("m")
        self.sees(then, 40.0)

    def acknowledges_and_resets(self) -> None:
        """Read the alarm, acknowledge it, reset."""
        self.sees("frame.recover", 90.0)
        for _ in range(6):  # a cause may be found and told after the alarm
            time.sleep(1.5)
            if self.shows("frame.acknowledge"):
                self.press("k")
        self.resets()

    def resets(self) -> None:
        self.sees("frame.recover", 30.0)
        self.press("f2")
        self.terminal.wait_for(lambda text: not re.search(self._pattern("frame.recover"), text), 20.0)

    def chooses(self, word: str, key: str) -> None:
        """Press a key on Preview until this is chosen."""
        self.press("3")
        for _ in range(8):
            time.sleep(1.0)
            if re.search(word, self.terminal.text):
                return
            self.press(key)
        raise AssertionError(f"{word} cannot be chosen\n{self.terminal.text}")

    def stage(self, name: str) -> None:
        self.chooses(re.escape(self._text(f"made.{name}")) + r" ─*╯", "s")

    # Blind ------------------------------------------------------------------------------------------------------

    def finds_jaw_by_dial(self) -> None:
        """Turn to each flank of jaw 1, three times, until the indicator shows 0."""
        eye = re.search(r"≈\s*([+-]?\d+)", self.terminal.text)
        assert eye is not None, self.terminal.text
        self.press("j")
        self.turns_to(self._angle_deg() - float(eye[1]) + HALF_JAW_DEG)
        for number in range(READINGS):
            side = 1 if number % 4 in (0, 3) else -1
            self._finds_flank(side)
            self.press("i")
            time.sleep(0.6)
            if number % 2 == 0:
                self.turns_to(self._angle_deg() - 2.0 * side * HALF_JAW_DEG)
        self.sees("align_page.next.jaw_flanks_all")
        self.press("enter")
        self.sees("align_page.next.touch_off")

    def _finds_flank(self, side: int) -> None:
        for _ in range(14):
            read_um = self._dial_um()
            if read_um is None:
                self.turns_to(self._angle_deg() - 0.4 * side)
            elif abs(read_um) >= END_UM:
                self.turns_to(self._angle_deg() + 0.4 * side)
            elif abs(read_um) > 30.0:
                self.turns_to(self._angle_deg() + read_um * DEG_PER_UM * side)
            else:
                return

    def feels(self) -> None:
        """Come to the part in ever smaller steps until contact is heard, the last time at a fresh place."""
        self.comes_over()
        while self._tool_mm() - RADIUS_MM > 1.0 + SURE_MM:
            self._steps_in(1.0)
        while self._tool_mm() - RADIUS_MM > 0.1 + SURE_MM:
            self._steps_in(0.1)
        while not self._hears():
            self._steps_in(0.01)
        contact_mm = self._tool_mm()
        self._takes_step(0.1, "mm")
        while self._tool_mm() - RADIUS_MM < FREE_MM or self._tool_mm() - contact_mm < FREE_MM / 2.0:
            self.press("up", pace_s=0.8)
            self._waits_for_rest()
        self.turns_to(self._angle_deg() + 20.0)
        while self._tool_mm() - contact_mm > 0.15:
            self._steps_in(0.1)
        while self._tool_mm() - contact_mm > 0.04:
            self._steps_in(0.01)
        while not self._hears():
            self._steps_in(0.001)

    def skims(self) -> None:
        """Go some hundredths deeper, take the tool away, measure."""
        for _ in range(3):
            self._steps_in(0.01)
        self.press("m")
        time.sleep(1.0)
        self._takes_step(1.0, "mm")
        for _ in range(3):
            self.press("up", pace_s=0.8)
        self._waits_for_rest()
        found = self.sees("align_page.micrometer")
        number = re.search(r"\d+\.\d+", found[0] + self.terminal.text[self.terminal.text.index(found[0]) :][:40])
        assert number is not None
        self.press("m")
        self.sees("align_page.next.asked_diameter")
        self.press(*number[0], "enter")

    def _steps_in(self, step_mm: float) -> None:
        self._takes_step(step_mm, "mm")
        self.press("down", pace_s=0.5)
        self._waits_for_rest_briefly()

    def _waits_for_rest_briefly(self) -> None:
        ready = re.compile(self._pattern("activity.ready"))
        time.sleep(0.25)
        self.terminal.wait_for(lambda _: ready.search(self.terminal.row(0)) is not None, 20.0)

    def _hears(self) -> bool:
        time.sleep(0.3)
        return re.search(self._pattern("align_page.no_contact"), self.terminal.text) is None

    def _dial_um(self) -> float | None:
        """The indicator: None while its stylus is free, its end as a great number."""
        time.sleep(0.4)
        row = next(row for row in self.terminal.text.split("\n") if re.search("SIM [├◂▸●]", row))
        text = row.split("SIM ", 1)[1].split("││")[0].partition(" ")[2]
        if re.search(self._pattern("align_page.dial.end"), text):
            return END_UM
        number = re.search(r"[+-]?\d+", text)
        return None if number is None else float(number[0])

    def _angle_deg(self) -> float:
        found = re.search(r"│ C \S+\s+(-?\d+\.\d+) °", self.terminal.text)
        assert found is not None, self.terminal.text
        return float(found[1])

    def _tool_mm(self) -> float:
        found = re.search(r"│ X \S+\s+R (\d+\.\d+)", self.terminal.text)
        assert found is not None, self.terminal.text
        return float(found[1])


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
    pupil.inspects("inspect_page.next_cut_with")
    pupil.clamps_the_next()
    pupil.stage("full")
    pupil.cuts()
    pupil.inspects("inspect_page.next_cut_with")


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
    pupil.sees("inspect_page.next_kept")
    pupil.clamps_the_next()
    pupil.cuts()
    pupil.inspects("inspect_page.next_cut_with")


def one_part(downs: int, then: str) -> Play:
    def play(pupil: Pupil, _: int) -> None:
        pupil.begins(downs)
        pupil.sets_up()
        pupil.cuts()
        pupil.inspects(then)

    return play


def paper(pupil: Pupil, _: int) -> None:
    pupil.begins(0)
    pupil.sets_up()
    pupil.chooses("▸ paper", "c")
    pupil.cuts()
    pupil.inspects("inspect_page.next_failed")


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
        elif not pupil.shows("activity.homing"):
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
    pupil.inspects("inspect_page.next_lobe")
    pupil.press("a")
    pupil.sees("inspect_page.next_lobe_taken")
    pupil.clamps_the_next()
    pupil.chooses("▸ pvt", "c")
    pupil.cuts()
    pupil.inspects("inspect_page.next_cut_with")


def read_a_plot(pupil: Pupil, right: int) -> None:
    one_part(0, "inspect_page.next_question")(pupil, right)
    pupil.answers(right)


def clamping_force(pupil: Pupil, _: int) -> None:
    pupil.begins(3)
    pupil.sets_up()
    pupil.chooses("▸ none", "c")
    pupil.cuts()
    pupil.inspects("inspect_page.next_lobe")
    pupil.press("2", *["down"] * 5, "enter", *"300", "enter")
    pupil.sees("setup.next.ready")
    pupil.clamps_the_next()
    pupil.cuts()
    pupil.inspects("inspect_page.next_no_lobe")


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
        "thin-ring": one_part(3, "inspect_page.next_cut_with"),
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
