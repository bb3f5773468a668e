"""Alarms of a state as conditions of MTConnect, one for each native code. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from console.session.feed.feed_state import PRIORITIES, FeedAlarm

COMMUNICATIONS, MOTION, SYSTEM = "communications", "motion", "system"
TYPES = {COMMUNICATIONS: "COMMUNICATIONS", MOTION: "MOTION_PROGRAM", SYSTEM: "SYSTEM"}
"""Keys of the conditions, and their types."""

NORMAL, WARNING, FAULT = "NORMAL", "WARNING", "FAULT"
ENDED = "returned"  # an alarm whose cause is gone, and which nobody has acknowledged

_BY_SUBJECT = {
    "link": COMMUNICATIONS,
    "stops": COMMUNICATIONS,
    "heartbeat": COMMUNICATIONS,
    "cut": MOTION,
    "program": MOTION,
}
"""Condition of an alarm, by the first word of its code; `system` for every other one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """An active condition: WARNING or FAULT, with the code, the priority and the sentence of its alarm."""

    level: str
    code: str
    priority: str
    text: str


def conditions(alarms: Iterable[FeedAlarm]) -> dict[str, tuple[Condition, ...]]:
    """Return the active conditions by key; none where all is normal.

    A code is one condition: alarms that share theirs have the highest of their priorities, and all of their texts.
    """
    found: dict[str, dict[str, Condition]] = {key: {} for key in TYPES}
    for alarm in alarms:
        if alarm.state == ENDED:
            continue
        kept = found[_BY_SUBJECT.get(alarm.code.partition(".")[0], SYSTEM)]
        kept[alarm.code] = _joined(kept.get(alarm.code), alarm.code, alarm.priority, alarm.text)
    return {key: tuple(each.values()) for key, each in found.items()}


def _joined(before: Condition | None, code: str, priority: str, text: str) -> Condition:
    if before is not None:
        priority = min(before.priority, priority, key=PRIORITIES.index)
        text = before.text if text == before.text else f"{before.text} / {text}"
    return Condition(
        level=FAULT if priority == PRIORITIES[0] else WARNING, code=code, priority=priority, text=text
    )
