"""An armed cut is what was read in its summary: disarm it at a poll that shows anything else, or comes late."""

from __future__ import annotations

import time

from console.session.station.commands import (
    Acknowledge,
    Command,
    DisableDrives,
    Disarm,
    EndCut,
    HoldFeed,
    ReadLoop,
    Recover,
    TakeControl,
    Verify,
)
from console.session.station.context import StationContext
from drivers.clock import FROZEN_S, OLD_S, boot_s
from drivers.lathe.snapshot import REAL_TIME_PERCENT, Snapshot
from profiles.problem import Problem

OVERRIDE_BAND_PERCENT = 0.5
AWAKE_S = 0.5  # time after a pause in which what waited through it may still be read
AT_ANY_AGE = (
    Acknowledge,
    DisableDrives,
    Disarm,
    EndCut,
    HoldFeed,
    ReadLoop,
    Recover,
    TakeControl,
    Verify,
)
"""Commands that move nothing, or end a motion."""


def watch_armed(context: StationContext, snapshot: Snapshot) -> None:
    """Disarm once a poll differs from what was armed: alignment, drives, home; somebody moves an axis."""
    armed = context.state.armed
    if armed is None:
        return
    changed = None
    if context.state.alignment != armed.alignment:
        changed = Problem(code="session.arm_realigned")
    elif snapshot.moving:
        changed = Problem(code="session.arm_moved")
    elif abs(snapshot.override_percent - REAL_TIME_PERCENT) > OVERRIDE_BAND_PERCENT:
        changed = Problem(code="session.arm_override")
    if changed is not None:
        context.tell(armed=None, refusals=(changed,))


def age_problem(command: Command, posted_s: float) -> Problem | None:
    """Return why a command of a time of `boot_s` is too old to be carried out, None where it may be."""
    age_s = boot_s() - posted_s
    return None if age_s <= OLD_S or isinstance(command, AT_ANY_AGE) else _frozen(age_s)


class PollPause:
    """Time without a poll of the idle machine; after it nothing is armed, and no undated order is obeyed."""

    def __init__(self, context: StationContext) -> None:
        self._context = context
        self._polled = self._now()

    def end(self, froze_s: float = 0.0) -> None:
        """Note the end of a command, which polls as it needs; disarm if this process was frozen within it."""
        self._polled = self._now()
        self._judge(froze_s)

    def see(self) -> None:
        """Note a poll; after a pause disarm."""
        pause_s = self._pause_s()
        self._polled = self._now()
        self._judge(pause_s)

    def _judge(self, pause_s: float) -> None:
        if pause_s > FROZEN_S and self._context.state.armed is not None:
            self._context.tell(armed=None, refusals=(_frozen(pause_s),))

    def problem(self) -> Problem | None:
        """Return why an order that has no date is not obeyed; None where there was no pause just now."""
        freezes = self._context.lathe.stop.freezes
        pause_s = 0.0 if freezes is None else freezes.woke_from_s(AWAKE_S)
        return _frozen(pause_s) if pause_s else None

    def _pause_s(self) -> float:
        """Return the time since the last poll, less that of a paused lathe, plus that of a suspended computer."""
        screen, machine, asleep = (now - at for now, at in zip(self._now(), self._polled, strict=True))
        return min(screen, machine) + asleep

    def _now(self) -> tuple[float, float, float]:
        return self._context.screen_s(), self._context.clock.now_s(), boot_s() - time.monotonic()


def _frozen(pause_s: float) -> Problem:
    return Problem(code="session.frozen", value=f"{pause_s:.1f} s")
