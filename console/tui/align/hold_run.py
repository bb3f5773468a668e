"""Hold-to-run: while a jog key is held, one finite step follows the other; and which presses are of a finger.

A terminal repeats a held key; how fast is measured while the operator holds one (`Repeat`). No step is commanded
when no repeat came within the timeout, and once that has happened the key has to be pressed anew: what a stalled
line brings later moves nothing. Where the terminal reports releases too, any release ends the run at once; the
timeout stays, so that a lost release does no more than a lost repeat. One step is under way at most and none
waits, so that doing nothing stops the machine. Times are of any monotonic clock.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum, auto

from console.tui.application.key_releases import Stroke

CALIBRATION_S = 3.0
LEAST_REPEATS = 12  # in the calibration: slower than some five a second is no hold-to-run
FLOOR_S = 0.1  # shortest timeout, however fast a terminal repeats
MOST_GAP_S = 0.12  # a terminal, or a line, that repeats slower or with larger gaps is not used
MOST_FIRST_S = 0.7
LONGEST_STEP_S = 0.6
"""Longest step that may follow another by itself; longer ones are single presses."""

RELEASE_S = 0.25
"""From the release to the end of commanding, besides the timeout: hold-back of a key, tick of the screen, link."""

HEARD_S = 0.05
"""The same from a release that the terminal reports, besides its way: it is not held back, and needs no tick."""

SOONEST = 0.5
"""Of the delay of the first repeat: one that comes sooner was written before, and waited somewhere."""


class Tier(Enum):
    """What a held jog key does: it runs until its release is reported or its repeats end, or makes one step."""

    RELEASE = auto()
    REPEAT = auto()
    STEP = auto()


@dataclass(frozen=True, slots=True, kw_only=True)
class Repeat:
    """Measured repeat of a held key: the delay before the first one, and the largest gap after it, s."""

    first_s: float
    gap_s: float

    @property
    def timeout_s(self) -> float:
        """Longest time without a repeat while the key is held."""
        return max(1.5 * self.gap_s, FLOOR_S)

    def overrun_steps(self, step_s: float) -> int:
        """Return how many steps may be made after the release: the one under way, and those begun till then.

        The last repeat may itself have been late by the timeout.
        """
        return 2 + math.floor((2.0 * self.timeout_s + RELEASE_S) / step_s)


UNMEASURED = Repeat(first_s=MOST_FIRST_S, gap_s=MOST_GAP_S)
"""What is expected of a terminal that reports releases and was not measured: no better than allowed."""

SOONEST_REPORTED_S = 0.1  # no keyboard repeats a key sooner after its press


@dataclass(frozen=True, slots=True)
class Overrun:
    """How far an axis may still go, mm or degrees: once the repeats end, and behind a release that is reported.

    `released` is None where the terminal reports none.
    """

    silent: float
    released: float | None = None


def overrun(repeat: Repeat, step: float, step_s: float, round_trip_s: float | None) -> Overrun:
    """Return the overrun in whole steps; `round_trip_s` is that of a terminal that reports releases."""
    silent = repeat.overrun_steps(step_s)
    if round_trip_s is None:
        return Overrun(silent * step)
    released = 2 + math.floor((round_trip_s + HEARD_S) / step_s)
    return Overrun(silent * step, min(released, silent) * step)


class KeyRepeatCalibration:
    """A key that is held for `CALIBRATION_S`; `measured` is None until then, and where it did not repeat well."""

    def __init__(self) -> None:
        self.measured: Repeat | None = None
        self._times: list[float] = []
        self._over = False

    def press(self, now_s: float) -> bool:
        """Note the key; return whether the calibration is over, as long as the key is held on."""
        if not self._times or now_s - self._times[-1] > MOST_FIRST_S + FLOOR_S:
            self._times, self._over, self.measured = [], False, None
        self._times.append(now_s)
        if not self._over and now_s - self._times[0] >= CALIBRATION_S:
            first, *rest = (after - before for before, after in zip(self._times, self._times[1:], strict=False))
            good = len(rest) >= LEAST_REPEATS and max(rest) <= MOST_GAP_S and first <= MOST_FIRST_S
            self.measured = Repeat(first_s=first, gap_s=max(rest)) if good else None
            self._over = True
        return self._over


class HoldRun:
    """One held jog key. It runs from its second repeat on, or its first one that is reported as such.

    `lost`: the repeats of a key ended whose release would have been reported, and was not.
    """

    def __init__(self) -> None:
        self.lost = False
        self._pressed_s = self._repeated_s = -math.inf
        self._releases: int | None = None
        self._begun = False

    def begin(self, now_s: float) -> None:
        """Note a press of a finger: it may be held from now on."""
        self._pressed_s, self._repeated_s, self._begun = now_s, -math.inf, True
        self._releases, self.lost = None, False

    def end(self) -> None:
        """Run no more before the next press."""
        self._begun = False

    def repeat(self, now_s: float, repeat: Repeat, releases: int | None = None) -> None:
        """Note a repeat; one that is late, or that came too soon after the press, ends the run.

        `releases`: how many the terminal had reported before it, None where it reports none.
        """
        soonest_s = SOONEST * repeat.first_s if releases is None else SOONEST_REPORTED_S
        if math.isinf(self._repeated_s):
            latest_s = self._pressed_s + repeat.first_s + repeat.timeout_s
            if now_s < self._pressed_s + soonest_s:
                self.end()
            self._releases = releases
        else:
            latest_s = self._repeated_s + repeat.timeout_s
        if now_s > latest_s:
            self._lose()
        self._repeated_s = now_s

    def runs(self, now_s: float, repeat: Repeat | None, releases: int | None = None) -> bool:
        """Whether the key is held, as far as is known; False, once it was not. `releases` were heard so far."""
        if repeat is None or not self._begun or math.isinf(self._repeated_s):
            return False
        if releases != self._releases:
            self.end()
        elif now_s - self._repeated_s > repeat.timeout_s:
            self._lose()
        return self._begun

    def _lose(self) -> None:
        self.lost = self.lost or (self._begun and self._releases is not None)
        self.end()


REPEAT_S = 0.12  # presses of one key closer together are a terminal's repeats of a held key
SURE_S = REPEAT_S  # decision time for a press that may be such a repeat: the next one follows within it


class JogPresses:
    """Presses of one jog key. `held`: the key repeats.

    Times are of any monotonic clock. No press is decided later than `SURE_S` after it.
    """

    def __init__(self) -> None:
        self.held = False
        self._key: str | None = None
        self._pressed_s = -math.inf
        self._sure_at_s: float | None = None

    def forget(self) -> None:
        """Reset after another key or a stop: no press waits for its decision."""
        self.held = False
        self._key, self._sure_at_s = None, None

    def press(self, key: str, now_s: float) -> bool:
        """Note a press; return whether a finger made it. For one that `waits`, `take_due_key` decides."""
        gap_s = now_s - self._pressed_s if key == self._key else math.inf
        self._key, self._pressed_s, self._sure_at_s = key, now_s, None
        self.held = gap_s < REPEAT_S
        if self.held:
            return False
        if math.isfinite(gap_s):
            # However long ago the one before was: a line that stood still brings all repeats at once.
            self._sure_at_s = now_s + SURE_S
            return False
        return True

    @property
    def waits(self) -> bool:
        """Whether a press waits until it is known to be no repeat."""
        return self._sure_at_s is not None

    def take_due_key(self, now_s: float) -> str | None:
        """Return the key of a press that was no repeat, once."""
        if self._sure_at_s is None or now_s < self._sure_at_s:
            return None
        self._sure_at_s = None
        return self._key


class ReportedStrokes:
    """A press so close behind another stroke that no finger made both waited somewhere on the line."""

    def __init__(self) -> None:
        self._heard_s = -math.inf

    def is_finger(self, stroke: Stroke, now_s: float) -> bool:
        """Note a stroke of a jog key, at a time of any monotonic clock; return whether a finger presses now."""
        gap_s, self._heard_s = now_s - self._heard_s, now_s
        return not stroke.repeated and gap_s >= REPEAT_S
