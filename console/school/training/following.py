"""Follow a try on its machine: take every state, and let its events come."""

from __future__ import annotations

import time
from random import SystemRandom
from typing import TYPE_CHECKING

from console.session.station.state import Activity, StationState

if TYPE_CHECKING:
    from console.school.training.attempt import Attempt
    from console.school.training.event import LessonEvent
    from console.session.station.commands import Control


def follow_attempt(attempt: Attempt, control: Control) -> Attempt:
    """Return the try up to now; the simulated lathe has got the faults that were due."""
    now_s = control.now_s()
    attempt = attempt.see_state(control.state, now_s)
    for number in attempt.due_events(now_s):
        from console.session.station.commands import InjectFault  # not for the first page

        event = attempt.lesson.events[number]
        if event.console and not _may_be_taken(control.state):
            continue
        for line in (event.fault,) if event.fault else _claim(event, control.state.holder):
            control.post(InjectFault(line=f"inject {line}"))
        attempt = attempt.gave(number, now_s)
    return attempt


def _may_be_taken(state: StationState) -> bool:
    """Whether another console may take control: at rest, as the rule is (docs/ownership.md)."""
    snapshot = state.snapshot
    return state.controls and state.activity is Activity.READY and snapshot is not None and snapshot.at_rest


def _claim(event: LessonEvent, holder: int) -> tuple[str, ...]:
    """Return how another host takes control from the holder, and signs as consoles do."""
    from drivers.lathe.console_role import Signature
    from drivers.lathe.ownership import HIGHEST, exchange_line, signing_line

    name, _, host = event.console.partition("@")
    number = SystemRandom().randint(1, HIGHEST)
    signature = Signature(number=number, name=name, host=host, minute=int(time.time() // 60))
    lines = (exchange_line(holder, number), signing_line(signature))
    return tuple(f"stranger-writes 'line={line}'" for line in lines)
