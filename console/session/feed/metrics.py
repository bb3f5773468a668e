"""States of consoles in the text format of Prometheus (exposition format 0.0.4). Pure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from console.session.feed.feed_state import ALARM_STATES, PRIORITIES, FeedState

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"
PREFIX = "trilobe"

Labels = Mapping[str, str]
Sample = tuple[Labels, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """Metrics of one name."""

    name: str
    kind: str
    about: str
    samples: Sequence[Sample]


def exposition(states: Sequence[FeedState]) -> str:
    """Return the metrics of these consoles; what is not known is left out. No series may come twice."""
    apart = {(state.machine, state.process): state for state in states}
    return "".join(line for family in _families([*apart.values()]) for line in _lines(family))


def _families(states: Sequence[FeedState]) -> Iterable[Family]:
    yield Family(
        name=f"{PREFIX}_consoles",
        kind="gauge",
        about="Running consoles of the data folder.",
        samples=[({}, float(len(states)))],
    )
    info = [
        ({**_who(state), **_labels(state, "program", "job", "activity", "execution", "mode")}, 1.0)
        for state in states
    ]
    yield Family(
        name=f"{PREFIX}_state_info", kind="gauge", about="What each console does, as labels.", samples=info
    )
    for name, kind, about, keys in _VALUES:
        found = [(_who(state), float(value)) for state in states if (value := _at(state, keys)) is not None]
        yield Family(name=f"{PREFIX}_{name}", kind=kind, about=about, samples=found)
    alarms = [sample for state in states for sample in _alarms(state)]
    yield Family(name=f"{PREFIX}_alarms", kind="gauge", about="Alarms by priority and state.", samples=alarms)


_VALUES = (
    ("simulated", "gauge", "1 for a simulated machine.", ("simulated",)),
    ("controls", "gauge", "1 where this console controls the machine.", ("controls",)),
    ("age_seconds", "gauge", "Age of speed and positions.", ("age_s",)),
    ("spindle_rpm", "gauge", "Spindle speed.", ("spindle_rpm",)),
    ("tool_radius_mm", "gauge", "Radius of the tool tip.", ("axes", "tool_radius_mm")),
    ("carriage_mm", "gauge", "Position of the carriage.", ("axes", "carriage_mm")),
    ("spindle_degrees", "gauge", "Spindle angle from its index.", ("axes", "spindle_deg")),
    ("cut_turn", "gauge", "Turns of the cut that are done.", ("cut", "turn")),
    ("cut_turns", "gauge", "Turns of the cut.", ("cut", "turns")),
    ("cut_left_seconds", "gauge", "Time left of the cut.", ("cut", "left_s")),
    ("tool_error_um", "gauge", "Tool against its target path.", ("tool_error_um",)),
    ("parts_total", "counter", "Cuts that this console has made to their end.", ("parts",)),
)


def _at(state: FeedState, keys: Sequence[str]) -> float | None:
    value: Any = state
    for key in keys:
        value = getattr(value, key, None)
    return None if value is None else float(value)


def _alarms(state: FeedState) -> Iterable[Sample]:
    """Yield the count of each kind, 0 too: a series that comes and goes cannot be alerted on."""
    count = Counter((each.priority, each.state) for each in state.alarms)
    for priority, kind in product(PRIORITIES, ALARM_STATES):
        yield {**_who(state), "priority": priority, "state": kind}, float(count[priority, kind])


def _who(state: FeedState) -> dict[str, str]:
    return _labels(state, "machine", "process")


def _labels(state: FeedState, *names: str) -> dict[str, str]:
    return {name: "" if (value := getattr(state, name)) is None else str(value) for name in names}


def _lines(family: Family) -> Iterable[str]:
    if not family.samples:
        return
    yield f"# HELP {family.name} {family.about}\n# TYPE {family.name} {family.kind}\n"
    for labels, value in family.samples:
        named = ",".join(f'{name}="{_escaped(each)}"' for name, each in labels.items())
        yield f"{family.name}{'{' if named else ''}{named}{'}' if named else ''} {value!r}\n"


def _escaped(value: str) -> str:
    return value.replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n")
