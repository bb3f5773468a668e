"""Data items of a lathe in the words of MTConnect, and their values in a state of the feed. Pure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from operator import attrgetter

from console.session.feed.feed_state import FeedState
from console.site.exchange.conditions import Condition, conditions

UNAVAILABLE = "UNAVAILABLE"


@dataclass(frozen=True, slots=True, kw_only=True)
class DataItem:
    """An event or a sample: its key, its place in the device, its type, and where its value is.

    `kind` is EVENT or SAMPLE. A `current` one is unavailable while the values of a state are too old to be shown.
    """

    key: str
    component: str
    kind: str
    type: str
    value: Callable[[FeedState], str | None]
    sub_type: str | None = None
    units: str | None = None
    current: bool = False


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
    DataItem(key="avail", component=DEVICE, kind="EVENT", type="AVAILABILITY", value=_availability),
    DataItem(key="execution", component=PATH, kind="EVENT", type="EXECUTION", value=_word("execution")),
    DataItem(key="mode", component=PATH, kind="EVENT", type="CONTROLLER_MODE", value=_word("mode")),
    DataItem(key="program", component=PATH, kind="EVENT", type="PROGRAM", value=_text("job")),
    DataItem(
        key="part_count", component=PATH, kind="EVENT", type="PART_COUNT", sub_type="ALL", value=_text("parts")
    ),
    DataItem(
        key="spindle_rpm",
        component=C,
        kind="SAMPLE",
        type="ROTARY_VELOCITY",
        sub_type="ACTUAL",
        units=_RPM,
        value=_number("spindle_rpm", 3),
        current=True,
    ),
    DataItem(
        key="spindle_deg",
        component=C,
        kind="SAMPLE",
        type="ANGLE",
        sub_type="ACTUAL",
        units=_DEG,
        value=_number("axes.spindle_deg", 5),
        current=True,
    ),
    DataItem(
        key="tool_radius_mm",
        component=X,
        kind="SAMPLE",
        type="POSITION",
        sub_type="ACTUAL",
        units=_MM,
        value=_number("axes.tool_radius_mm", 5),
        current=True,
    ),
    DataItem(
        key="carriage_mm",
        component=Z,
        kind="SAMPLE",
        type="POSITION",
        sub_type="ACTUAL",
        units=_MM,
        value=_number("axes.carriage_mm", 5),
        current=True,
    ),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Published:
    """What is published of one moment: values by key, and the active conditions; None where they are not known."""

    at_utc: str
    values: Mapping[str, str]
    conditions: Mapping[str, tuple[Condition, ...]] | None


def published(state: FeedState | None, at_utc: str) -> Published:
    """Return what is published of a state; without one everything is unavailable since `at_utc`."""
    if state is None:
        return Published(at_utc=at_utc, values={item.key: UNAVAILABLE for item in ITEMS}, conditions=None)
    return Published(
        at_utc=state.at_utc,
        values={item.key: _value(item, state) for item in ITEMS},
        conditions=conditions(state.alarms),
    )


def _value(item: DataItem, state: FeedState) -> str:
    if item.current and (state.stale or state.execution == "unavailable"):
        return UNAVAILABLE
    value = item.value(state)
    return UNAVAILABLE if value is None else value
