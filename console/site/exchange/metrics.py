"""States of consoles in the text format of Prometheus (exposition format 0.0.4). Pure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from typing import Any

from console.session.feed.feed_state import ALARM_STATES, EXECUTIONS, MODES, PRIORITIES, FeedState, rank
from console.session.station.state import Activity

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"
PREFIX = "trilobe"

Labels = Mapping[str, str]
Sample = tuple[Labels, float]


def exposition(states: Sequence[FeedState]) -> str:
    """Return the metrics of these consoles; what is not known is left out.

    Of several consoles on one machine it is that which controls it: the series of a machine outlast its consoles.
    """
    apart = {(state.machine, state.simulated): state for state in sorted(states, key=rank)}
    count = _lines("consoles", "Running consoles of the data folder.", [({}, float(len(states)))])
    return "".join((*count, *_of_machines([*apart.values()])))


def _of_machines(states: Sequence[FeedState]) -> Iterable[str]:
    jobs = [({**_machine_labels(state), "job": state.job}, 1.0) for state in states if state.job is not None]
    yield from _lines("job_info", "The open job, as a label.", jobs)
    for name, about, words in _WORDS:
        pairs = product(states, words)
        told = [({**_machine_labels(at), name: each}, float(getattr(at, name) == each)) for at, each in pairs]
        yield from _lines(name, about, told)
    for name, kind, about, keys in _VALUES:
        found = [
            (_machine_labels(state), float(value))
            for state in states
            if (value := _value_at(state, keys)) is not None
        ]
        yield from _lines(name, about, found, kind)
    yield from _lines("alarms", "Alarms by priority and state.", [each for at in states for each in _alarms(at)])


_WORDS: tuple[tuple[str, str, Sequence[str]], ...] = (
    ("execution", "1 for what the machine does, in the words of MTConnect.", EXECUTIONS),
    ("mode", "1 for the mode.", MODES),
    ("activity", "1 for what the console does.", tuple(Activity)),
)
"""What has one of some words has a series for each: one that comes and goes cannot be alerted on."""

_VALUES = (
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


def _value_at(state: FeedState, keys: Sequence[str]) -> float | None:
    value: Any = state
    for key in keys:
        value = getattr(value, key, None)
    return None if value is None else float(value)


def _alarms(state: FeedState) -> Iterable[Sample]:
    """Yield the count of each kind, 0 too: a series that comes and goes cannot be alerted on."""
    count = Counter((each.priority, each.state) for each in state.alarms)
    for priority, kind in product(PRIORITIES, ALARM_STATES):
        yield {**_machine_labels(state), "priority": priority, "state": kind}, float(count[priority, kind])


def _machine_labels(state: FeedState) -> dict[str, str]:
    return {"machine": state.machine, "simulated": str(int(state.simulated))}


def _lines(name: str, about: str, samples: Sequence[Sample], kind: str = "gauge") -> Iterable[str]:
    if not samples:
        return
    yield f"# HELP {PREFIX}_{name} {about}\n# TYPE {PREFIX}_{name} {kind}\n"
    for labels, value in samples:
        named = ",".join(f'{key}="{_escape_label(each)}"' for key, each in labels.items())
        yield f"{PREFIX}_{name}{'{' if named else ''}{named}{'}' if named else ''} {value!r}\n"


def _escape_label(value: str) -> str:
    return value.replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n")
