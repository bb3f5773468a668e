"""What is published of a moment, by topic of MQTT. Pure."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

from console.session.feed.feed_state import FeedState
from console.site.exchange.conditions import FAULT, NORMAL, TYPES, WARNING, Condition
from console.site.exchange.data_items import UNAVAILABLE, Published

AVAILABILITY, STATE = "avail", "state"
GONE = b""  # deletes a retained message
_WILDCARDS = str.maketrans({"/": "%2F", "+": "%2B", "#": "%23", "%": "%25", "\0": "%00"})


def topic_of(prefix: str, device: str) -> str:
    """Return the topic of a device, with a slash at its end; levels and wildcards in its name are escaped."""
    return f"{prefix}/{device.translate(_WILDCARDS)}/"


def messages(published: Published, state: FeedState | None) -> dict[str, bytes]:
    """Return the payload of each topic below that of the device, in the order in which they are to be sent.

    AVAILABLE comes after the values, so that who reads it has those that belong to it; UNAVAILABLE comes first.
    """
    found = {key: value.encode("utf-8", "replace") for key, value in published.values.items()}
    for key in TYPES:
        found[key] = _json(_condition(None if published.conditions is None else published.conditions[key]))
    found[STATE] = GONE if state is None else _json(asdict(state))
    availability = {AVAILABILITY: found.pop(AVAILABILITY)}
    if published.values[AVAILABILITY] == UNAVAILABLE:
        return availability | found
    return found | availability


def is_news(state: FeedState | None, before: FeedState | None) -> bool:
    """Whether a state says more than that time has passed."""
    return _without_moment(state) != _without_moment(before)


def _without_moment(state: FeedState | None) -> FeedState | None:
    return None if state is None else replace(state, at_utc="", age_s=None)


def _condition(active: tuple[Condition, ...] | None) -> dict[str, Any]:
    if active is None:
        return {"level": UNAVAILABLE, "active": []}
    levels = {each.level for each in active}
    level = FAULT if FAULT in levels else WARNING if levels else NORMAL
    told = [
        {"level": each.level, "code": each.code, "priority": each.priority, "text": each.text} for each in active
    ]
    return {"level": level, "active": told}


def _json(value: Mapping[str, Any]) -> bytes:
    return json.dumps(value, allow_nan=False, separators=(",", ":")).encode("ascii")
