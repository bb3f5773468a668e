"""What a trainee of a lesson does at a terminal: by what is on the screen, and keys."""

from __future__ import annotations

import re
import time
from contextlib import suppress

from console.session.cut.jaw_by_indicator import between_deg
from tests.trainee import CLOSE_MM, SETTLES_MM, TOOL_STEPS, Trainee

HALF_JAW_DEG = 11.5
DEG_PER_UM = 0.0011459  # of a stylus 50 mm from the axis
END_UM = 500.0
READINGS = 6
RADIUS_MM = 26.0  # of the blank of the job that blind lessons are about
FREE_MM = 1.75  # so far from where the part is believed the spindle may turn
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

    def inspects(self, then: str = "") -> None:
        """Measure the part, until a sentence is there; without one, until it is measured."""
        self.press("6")
        self.sees("inspect_page.next.measure")
        self.press("m")
        if then:
            self.sees(then, 40.0)
            return
        over = ("inspect_page.next.measure", "inspect_page.next.wait")
        self.terminal.wait_for(lambda _: not any(self.shows(key) for key in over), 40.0)

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

    def is_doing(self, activity: str) -> bool:
        """Whether the first row names an activity; an alarm may have the same words."""
        return re.search(self._pattern(activity), self.terminal.row(0)) is not None

    def _waits_for_rest_briefly(self) -> None:
        time.sleep(0.25)
        self.terminal.wait_for(lambda _: self.is_doing("activity.ready"), 20.0)

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
