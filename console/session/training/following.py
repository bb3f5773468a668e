"""Follow a try on its machine: take every state, and let its events come."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from console.session.station.commands import Control
    from console.session.training.attempt import Attempt


def followed(attempt: Attempt, control: Control) -> Attempt:
    """Return the try up to now; the simulated lathe has got the faults that were due."""
    now_s = control.now_s()
    attempt = attempt.seen(control.state, now_s)
    for number in attempt.due(now_s):
        from console.session.station.commands import InjectFault  # not for the first page

        control.post(InjectFault(line=f"inject {attempt.lesson.events[number].fault}"))
        attempt = attempt.gave(number, now_s)
    return attempt
