"""A trainee at the console: reads the screen, presses keys, and knows nothing else."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path

from console.text.catalogue import load
from console.tui.pace import QUIET_S
from profiles.store import load_job
from tests.compact import save_compact
from tests.preloaded import is_simulator
from tests.terminal import Terminal

FIRST_JOB = "lee-2001-experiment-1"
A_NUMBER = r"([+-]?\d+(?:\.\d+)?)[^\n]*?"
SPINDLE_STEPS = (30.0, 10.0, 1.0, 0.1, 0.01)
TOOL_STEPS = (0.1, 0.01, 0.001)  # before the touch-off longer ones are refused
PACE_S = 0.15
"""Between two keys of a quick person."""

JOG_PACE_S = 0.45
"""Between two presses of a jog key: what is seen of the shortest step does not tell that it is over."""

CLOSE_DEG, CLOSE_MM = 0.05, 0.0005
"""A servo spindle stands within a count of 0.036 deg and cannot be brought nearer; that is 0.14 um of 55."""
SETTLES_DEG, SETTLES_MM = 0.05, 0.0025
"""What a jog may still be off when it is done: a count of the spindle and its rounding, 4 counts of the tool."""


def console(
    data: Path,
    language: str,
    columns: int,
    rows: int,
    *,
    short_ways: bool = False,
    plant: str = "mounted",
    words: Sequence[str] = (),
    kind: type[Terminal] = Terminal,
    **environment: str,
) -> Terminal:
    """The program in a terminal of its own, its first job half as long: to plan it takes half the time.

    With `short_ways` its lathe has everything close together: for tests that are not about the ways of its axes.
    """
    own = data / "jobs" / f"{FIRST_JOB}.toml"
    if not own.exists():
        own.parent.mkdir(parents=True, exist_ok=True)
        text = load_job(FIRST_JOB).path.read_text(encoding="utf-8")
        own.write_text(re.sub(r"(?m)^cut_length_mm = 8.0", "cut_length_mm = 4.0", text), encoding="utf-8")
    command = [sys.executable, "-m", "console", "--sim", "--plant", plant, "--data", str(data), "--lang", language]
    command += [*words, *(save_compact(data) if short_ways else ())]
    return kind(command, columns=columns, rows=rows, environment=environment or None)


def console_at(terminal: Terminal, language: str = "en") -> Trainee:
    """A trainee before the first page, with the machine connected and the first job open."""
    trainee = Trainee(terminal, language)
    trainee.opens_the_first_job()
    return trainee


def simulator_of(terminal: Terminal) -> int:
    """The process number of the simulated lathe behind the console."""
    (number,) = [pid for pid in terminal.children() if is_simulator(pid)]
    return number


class Trainee:
    """Works through the main job at one terminal, in one language."""

    def __init__(self, terminal: Terminal, language: str) -> None:
        self.terminal = terminal
        self._pressed_s = float("-inf")
        self._text = load(language)

    def sees(self, key: str, timeout_s: float = 20.0) -> re.Match[str]:
        """Wait for a sentence of the catalogue; what it leaves open may be any number or words."""
        pattern = self._pattern(key)
        self.terminal.wait_for(pattern, timeout_s)
        found = re.search(pattern, self.terminal.text)
        assert found is not None, f"{key} was there and is gone\n{self.terminal.text}"
        return found

    def finds(self, key: str) -> bool:
        """Whether a sentence of the catalogue is on the screen now."""
        return re.search(self._pattern(key), self.terminal.text) is not None

    def press(self, *keys: str, pace_s: float = PACE_S) -> None:
        """Press keys at the pace of a person: what comes faster is not taken.

        Counted from when the console read the one before: on a busy computer two would reach it as one.
        """
        for key in keys:
            if self.terminal.wait_until_read(2.0):
                self._pressed_s = time.monotonic()
            time.sleep(max(self._pressed_s + pace_s - time.monotonic(), 0.0))
            self.terminal.press(key)
            self._pressed_s = time.monotonic()

    def scans(self, text: str) -> None:
        """Hold a code in front of a scanner: all of its characters come at once. Then wait as a person would."""
        self.terminal.type(text)
        time.sleep(QUIET_S + PACE_S)

    def opens_the_first_job(self) -> None:
        self.sees("activity.ready", 30.0)
        self.press("enter")
        self.sees("setup.next.ready")

    def switches_on(self) -> None:
        """Clamp, drives on: at rest, before the home search."""
        self.press("4")
        self.sees("align_page.next.clamp")
        self.press("enter")
        self.sees("align_page.next.drives")
        self.does_step("align_page.next.home")

    def starts_homing(self) -> None:
        """The axes are on their way, one after the other, for some seconds."""
        self.does_step("activity.homing")

    def does_step(self, then: str) -> None:
        """Press F4 until the console takes it: soon after another F4 it would be taken for a key that is held."""
        for _ in range(5):
            self.press("f4")
            with suppress(AssertionError):
                self.sees(then, 1.0)
                return
            if not self.finds("problem.screen.key_repeats"):
                break
        self.sees(then)

    def aligns(self) -> None:
        """Clamp, drives on, home, jaw 1 to the mark, tool to the part."""
        self.switches_on()
        self.starts_homing()
        self.sees("align_page.next.jaw_enable", 30.0)
        self.press("j")
        self._jogs(self._jaw_to_go_deg, ("pageup", "pagedown"), SPINDLE_STEPS, CLOSE_DEG, SETTLES_DEG, "°")
        self.press("enter")
        self.sees("align_page.next.touch_off")
        self.press("f4")
        self.terminal.wait_for(lambda _: self._gap_mm() is not None, 60.0)
        self.sees("activity.ready", 30.0)
        self.press("j")
        self._jogs(self._gap_mm, ("down", "up"), TOOL_STEPS, CLOSE_MM, SETTLES_MM, "mm")
        self.press("enter")
        self.sees("align_page.valid_title")

    def starts_the_cut(self, seen: str = "run_page.next.arm") -> None:
        self.press("5")
        self.sees(seen)
        self.press("f5")
        self.sees("run_page.next.armed")
        self.press("f6")
        self.sees("activity.cutting", 30.0)

    def waits_for_the_end_of_the_cut(self) -> None:
        self.sees("run_page.next.measure", 60.0)

    def measures(self) -> None:
        self.press("6")
        self.sees("inspect_page.next.measure")
        self.press("m")
        self.sees("inspect_page.next.part")

    def _jogs(
        self,
        to_go: Callable[[], float | None],
        keys: tuple[str, str],
        steps: tuple[float, ...],
        close: float,
        settles: float,
        unit: str,
    ) -> None:
        """Jog with the largest step that does not go too far, until nothing is left to go."""
        for step in steps:
            left = self._read(to_go)
            if abs(left) < max(step, close):
                continue
            self._takes_step(step, unit)
            while abs(left := self._read(to_go)) >= max(step, close):
                self.press(keys[0] if left > 0.0 else keys[1], pace_s=JOG_PACE_S)
                expected = left - step if left > 0.0 else left + step
                self.terminal.wait_for(self._arrived(to_go, expected, 0.1 * step + settles), 30.0)
        self._waits_for_rest()
        assert abs(self._read(to_go)) <= max(close, steps[-1]) + settles

    def _arrived(
        self, to_go: Callable[[], float | None], expected: float, most_off: float
    ) -> Callable[[str], bool]:
        def arrived(_: str) -> bool:
            left = to_go()
            near = left is not None and abs(left - expected) < most_off
            return near and re.search(self._pattern("activity.ready"), self.terminal.row(0)) is not None

        return arrived

    def _takes_step(self, step: float, unit: str) -> None:
        """Press + or - until the step stands in its brackets."""
        while (before := self._step(unit)) != step:
            self._waits_for_rest()
            self.press("+" if before < step else "-")
            self.terminal.wait_for(partial(self._has_left, before, unit), 5.0)

    def _waits_for_rest(self) -> None:
        """A key that changes the step stops a jog, Enter is refused: wait until all rested for half a second."""
        ready = re.compile(self._pattern("activity.ready"))
        for _ in range(20):
            try:
                self.terminal.wait_for(lambda _: ready.search(self.terminal.row(0)) is None, 0.5)
            except AssertionError:
                return
            self.terminal.wait_for(lambda _: ready.search(self.terminal.row(0)) is not None, 30.0)

    def _has_left(self, before: float, unit: str, _: str) -> bool:
        return self._step(unit) != before

    def _step(self, unit: str) -> float:
        found = re.search(r"\[\s*([\d.]+)\s*\][^\n]*" + unit, self.terminal.text)
        assert found is not None, self.terminal.text
        return float(found[1])

    def _read(self, to_go: Callable[[], float | None]) -> float:
        seen: list[float] = []

        def is_read(_: str) -> bool:
            left = to_go()
            seen.extend(() if left is None else (left,))
            return left is not None

        self.terminal.wait_for(is_read, 10.0)
        return seen[-1]

    def _jaw_to_go_deg(self) -> float | None:
        """Degrees in the direction of the cut until jaw 1 meets the mark."""
        text = self.terminal.text
        if re.search(self._pattern("align_page.at_mark"), text):
            return 0.0
        for key, sign in (("align_page.past_mark", -1.0), ("align_page.before_mark", 1.0)):
            found = re.search(self._pattern(key, A_NUMBER), text)
            if found is not None:
                return sign * float(found[1])
        return None

    def _gap_mm(self) -> float | None:
        found = re.search(self._pattern("align_page.gap", A_NUMBER), self.terminal.text)
        if found is not None:
            return float(found[1])
        touching = re.search(self._pattern("align_page.touches", A_NUMBER), self.terminal.text)
        return None if touching is None else -float(touching[1])

    def _pattern(self, key: str, opening: str = r"[^\n]*?") -> str:
        """A regular expression for a sentence of the catalogue, with `opening` for what it leaves open.

        The sentence may be broken into rows between two words.
        """
        parts = re.split(r"\{[^}]*\}", self._text._entries[key])
        return opening.join(re.escape(part).replace(r"\ ", r"\s+") for part in parts)
