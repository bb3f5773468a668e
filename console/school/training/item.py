"""What can count in a lesson."""

from __future__ import annotations

from enum import StrEnum


class Item(StrEnum):
    """What counts, in the order of the debrief."""

    STEPS = "steps"
    MET = "met"
    NEAR = "near"
    CONTACT = "contact"
    ROUND = "round"
    DIAMETER = "diameter"
    JAW = "jaw"
    TOUCH_OFF = "touch_off"
    STOPS = "stops"
    ANSWER = "answer"
    ALARMS = "alarms"
    REACTION = "reaction"
    TIME = "time"
