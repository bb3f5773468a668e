"""A lathe in the words of MTConnect: data items, conditions, Devices.xml, SHDR lines, messages of MQTT. Pure."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from operator import attrgetter
from typing import Any
from xml.etree import ElementTree as Xml

from console.session.feed.feed_state import PRIORITIES, FeedAlarm, FeedState

UNAVAILABLE = "UNAVAILABLE"
NORMAL, WARNING, FAULT = "NORMAL", "WARNING", "FAULT"
ENDED = "returned"  # an alarm whose cause is gone, and which nobody has acknowledged

TYPES = {"communications": "COMMUNICATIONS", "motion": "MOTION_PROGRAM", "system": "SYSTEM"}
"""Keys of the conditions, and their types."""

_BY_SUBJECT = {
    **dict.fromkeys(("link", "stops", "heartbeat"), "communications"),
    **dict.fromkeys(("cut", "program"), "motion"),
}
"""Condition of an alarm, by the first word of its code; `system` for every other one."""


@dataclass(frozen=True, slots=True)
class DataItem:
    """An event or a sample: its key, its place in the device, its type, and where its value is.

    A sample has `units`; it is unavailable while the values of a state are too old to be shown.
    """

    key: str
    component: str
    type: str
    value: Callable[[FeedState], str | None]
    sub_type: str | None = None
    units: str | None = None


def _availability(state: FeedState) -> str:
    return UNAVAILABLE if state.execution == "unavailable" else "AVAILABLE"


def _word(name: str) -> Callable[[FeedState], str | None]:
    return lambda state: str(getattr(state, name)).upper()


def _text(name: str) -> Callable[[FeedState], str | None]:
    return lambda state: None if (value := getattr(state, name)) is None else str(value)


def _number(path: str, digits: int) -> Callable[[FeedState], str | None]:
    read = attrgetter(path)
    return lambda state: None if (value := read(state)) is None else f"{value:z.{digits}f}"


DEVICE, CONTROLLER, PATH, X, Z, C = "device", "controller", "path", "x", "z", "c"
_MM, _DEG, _RPM = "MILLIMETER", "DEGREE", "REVOLUTION/MINUTE"

ITEMS = (
    DataItem("avail", DEVICE, "AVAILABILITY", _availability),
    DataItem("execution", PATH, "EXECUTION", _word("execution")),
    DataItem("mode", PATH, "CONTROLLER_MODE", _word("mode")),
    DataItem("program", PATH, "PROGRAM", _text("job")),
    DataItem("part_count", PATH, "PART_COUNT", _text("parts"), "ALL"),
    DataItem("spindle_rpm", C, "ROTARY_VELOCITY", _number("spindle_rpm", 3), "ACTUAL", _RPM),
    DataItem("spindle_deg", C, "ANGLE", _number("axes.spindle_deg", 5), "ACTUAL", _DEG),
    DataItem("tool_radius_mm", X, "POSITION", _number("axes.tool_radius_mm", 5), "ACTUAL", _MM),
    DataItem("carriage_mm", Z, "POSITION", _number("axes.carriage_mm", 5), "ACTUAL", _MM),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """An active condition: WARNING or FAULT, with the code, the priority and the sentence of its alarm."""

    level: str
    code: str
    priority: str
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class PublishedState:
    """What is published of one moment: values by key, and the active conditions; None where they are not known."""

    at_utc: str
    values: Mapping[str, str]
    conditions: Mapping[str, tuple[Condition, ...]] | None


def publish_state(state: FeedState | None, at_utc: str) -> PublishedState:
    """Return what is published of a state; without one everything is unavailable since `at_utc`."""
    if state is None:
        return PublishedState(at_utc=at_utc, values={item.key: UNAVAILABLE for item in ITEMS}, conditions=None)
    values = {item.key: _value(item, state) for item in ITEMS}
    return PublishedState(at_utc=state.at_utc, values=values, conditions=conditions(state.alarms))


def _value(item: DataItem, state: FeedState) -> str:
    unknown = item.units is not None and (state.stale or state.execution == "unavailable")
    value = None if unknown else item.value(state)
    return UNAVAILABLE if value is None else value


def conditions(alarms: Iterable[FeedAlarm]) -> dict[str, tuple[Condition, ...]]:
    """Return the active conditions by key; none where all is normal.

    A code is one condition: alarms that share theirs have the highest of their priorities, and all of their texts.
    """
    found: dict[str, dict[str, Condition]] = {key: {} for key in TYPES}
    for alarm in (each for each in alarms if each.state != ENDED):
        kept = found[_BY_SUBJECT.get(alarm.code.partition(".")[0], "system")]
        kept[alarm.code] = _join_conditions(kept.get(alarm.code), alarm.code, alarm.priority, alarm.text)
    return {key: tuple(each.values()) for key, each in found.items()}


def _join_conditions(before: Condition | None, code: str, priority: str, text: str) -> Condition:
    if before is not None:
        priority = min(before.priority, priority, key=PRIORITIES.index)
        text = before.text if text == before.text else f"{before.text} / {text}"
    level = FAULT if priority == PRIORITIES[0] else WARNING
    return Condition(level=level, code=code, priority=priority, text=text)


SCHEMA = "1.7"
NAMESPACE = f"urn:mtconnect.org:MTConnectDevices:{SCHEMA}"
_AXES = ((X, "Linear", "X"), (Z, "Linear", "Z"), (C, "Rotary", "C"))
_HEADER = {
    "creationTime": "2026-01-01T00:00:00Z",  # agents write their own
    "sender": "trilobe",
    "instanceId": "1",
    "version": f"{SCHEMA}.0.0",
    "bufferSize": "131072",
    "assetBufferSize": "1024",
    "assetCount": "0",
}


def device_name(machine: str, simulated: bool) -> str:
    """Return the name of the device: that of its machine profile; a simulated one can be told from a real one."""
    return f"{machine}-SIM" if simulated else machine


def devices_xml(machine: str, simulated: bool, lathe_id: str) -> str:
    """Return Devices.xml for an agent. Its ids have the device in them: an agent may serve several.

    Profiles of many lathes have one name: the uuid has the identity of the lathe in it, and stays with it.
    """
    name = device_name(machine, simulated)
    root = Xml.Element("MTConnectDevices", {"xmlns": NAMESPACE})
    Xml.SubElement(root, "Header", _HEADER)
    facts = {"id": _id(name, DEVICE), "name": name, "uuid": f"trilobe.{lathe_id}.{name}"}
    device = Xml.SubElement(Xml.SubElement(root, "Devices"), "Device", facts)
    about = Xml.SubElement(device, "Description", {"manufacturer": "trilobe"})
    about.text = "SIMULATED lathe, nothing is machined" if simulated else "Lathe with a fast tool axis"
    _data_items(device, name, DEVICE)
    components = Xml.SubElement(device, "Components")
    of_axes = Xml.SubElement(_component(components, "Axes", name, "axes", "axes"), "Components")
    for key, element, axis in _AXES:
        _data_items(_component(of_axes, element, name, key, axis), name, key)
    controller = _component(components, "Controller", name, CONTROLLER, CONTROLLER)
    held = Xml.SubElement(controller, "DataItems")
    for key, kind in TYPES.items():
        Xml.SubElement(held, "DataItem", _facts(name, key, "CONDITION", kind))
    _data_items(_component(Xml.SubElement(controller, "Components"), "Path", name, PATH, PATH), name, PATH)
    Xml.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + Xml.tostring(root, encoding="unicode")


def _component(parent: Xml.Element, element: str, name: str, key: str, shown: str) -> Xml.Element:
    return Xml.SubElement(parent, element, {"id": _id(name, key), "name": shown})


def _data_items(parent: Xml.Element, name: str, component: str) -> None:
    held = Xml.SubElement(parent, "DataItems")
    for item in (each for each in ITEMS if each.component == component):
        facts = _facts(name, item.key, "EVENT" if item.units is None else "SAMPLE", item.type)
        facts |= {} if item.sub_type is None else {"subType": item.sub_type}
        facts |= {} if item.units is None else {"units": item.units, "nativeUnits": item.units}
        Xml.SubElement(held, "DataItem", facts)


def _facts(name: str, key: str, category: str, kind: str) -> dict[str, str]:
    return {"id": _id(name, key), "name": key, "category": category, "type": kind}


def _id(name: str, key: str) -> str:
    """Return an id as XML allows it: no space, and a letter first."""
    return f"d_{re.sub(r'[^A-Za-z0-9_.-]', lambda found: f'_{ord(found[0]):x}', name)}_{key}"


def shdr_lines(now: PublishedState, before: PublishedState | None) -> list[str]:
    """Return the lines that take an agent from what it was told `before` to `now`; None: nothing yet."""
    told = {} if before is None else before.values
    changed = {key: value for key, value in now.values.items() if told.get(key) != value}
    pairs = [field for key, value in changed.items() for field in (key, value)]
    lines = [_line(now.at_utc, *pairs)] if pairs else []
    return lines + [_line(now.at_utc, key, *fields) for key in TYPES for fields in _of_condition(key, now, before)]


def _of_condition(key: str, now: PublishedState, before: PublishedState | None) -> list[tuple[str, ...]]:
    """Return the fields of each line. NORMAL without a code clears all of the condition, with a code that one."""
    if now.conditions is None:
        known = before is not None and before.conditions is None
        return [] if known else [(UNAVAILABLE, "", "", "", "")]
    active = now.conditions[key]
    if before is None or before.conditions is None:
        return [(NORMAL, "", "", "", ""), *map(_active, active)]
    were, codes = before.conditions[key], {each.code for each in active}
    if were and not active:
        return [(NORMAL, "", "", "", "")]
    ended = [(NORMAL, each.code, "", "", "") for each in were if each.code not in codes]
    return [*ended, *(_active(each) for each in active if each not in were)]


def _active(each: Condition) -> tuple[str, ...]:
    return each.level, each.code, each.priority, "", each.text


def _line(*fields: str) -> str:
    return "|".join(_field(each) for each in fields)


def _field(value: str) -> str:
    """Return a value as a field: on one line, and quoted where it could be taken for more than one field."""
    value = " ".join(value.split())
    if "|" not in value and not value.startswith('"'):
        return value
    escaped = value.replace("\\", "\\\\").replace('"', '\\"').replace("|", "\\|")
    return f'"{escaped}"'


AVAILABILITY, STATE = "avail", "state"  # topics of MQTT
GONE = b""  # deletes a retained message
_WILDCARDS = str.maketrans({"/": "%2F", "+": "%2B", "#": "%23", "%": "%25", "\0": "%00"})


def topic_of(prefix: str, device: str) -> str:
    """Return the topic of a device, with a slash at its end; levels and wildcards in its name are escaped."""
    return f"{prefix}/{device.translate(_WILDCARDS)}/"


def messages(published: PublishedState, state: FeedState | None) -> dict[str, bytes]:
    """Return the payload of each topic below that of the device, in the order in which they are to be sent.

    AVAILABLE comes after the values, so that who reads it has those that belong to it; UNAVAILABLE comes first.
    """
    found = {key: value.encode("utf-8", "replace") for key, value in published.values.items()}
    for key in TYPES:
        found[key] = _json(_condition(None if published.conditions is None else published.conditions[key]))
    found[STATE] = GONE if state is None else _json(asdict(state))
    availability = {AVAILABILITY: found.pop(AVAILABILITY)}
    unavailable = published.values[AVAILABILITY] == UNAVAILABLE
    return availability | found if unavailable else found | availability


def is_news(state: FeedState | None, before: FeedState | None) -> bool:
    """Whether a state says more than that time has passed."""
    return _without_moment(state) != _without_moment(before)


def _without_moment(state: FeedState | None) -> FeedState | None:
    return None if state is None else replace(state, at_utc="", age_s=None)


def _condition(active: tuple[Condition, ...] | None) -> dict[str, Any]:
    levels = {UNAVAILABLE} if active is None else {each.level for each in active}
    level = next((each for each in (UNAVAILABLE, FAULT, WARNING) if each in levels), NORMAL)
    return {"level": level, "active": [asdict(each) for each in active or ()]}


def _json(value: Mapping[str, Any]) -> bytes:
    return json.dumps(value, allow_nan=False, separators=(",", ":")).encode("ascii")
