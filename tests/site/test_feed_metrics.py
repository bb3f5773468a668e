"""What `console metrics` serves keeps to the exposition format of Prometheus, whatever the names of jobs are."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.session.feed.feed_state import FeedState
from console.session.feed.observed import Observed
from console.session.feed.report import report
from console.session.station.state import Activity, StationState
from console.site.exchange.metrics import exposition
from drivers.lathe.standing import Standing
from profiles.store import load_machine
from tests.tui import scenes

MACHINE = load_machine("lee-2001-lathe").machine
CUTTING = replace(scenes.machine(Activity.CUTTING), cut=scenes.cut(), spindle_rpm=1000.314)

# https://prometheus.io/docs/instrumenting/exposition_formats/: the text format, version 0.0.4.
NAME, LABEL = r"[a-zA-Z_:][a-zA-Z0-9_:]*", r"[a-zA-Z_][a-zA-Z0-9_]*"
QUOTED = r'"((?:[^"\\\n]|\\["\\n])*)"'
SAMPLE = re.compile(rf"({NAME})(?:\{{((?:{LABEL}={QUOTED},?)*)\}})? (\S+)")
PAIR = re.compile(rf"({LABEL})={QUOTED}")
UNESCAPED = {r"\\": "\\", r"\"": '"', r"\n": "\n"}
Series = tuple[str, frozenset[tuple[str, str]]]


def parsed(text: str) -> dict[Series, float]:
    """The series of a text, which must keep every rule of the format."""
    assert text.endswith("\n")
    found: dict[Series, float] = {}
    helped: set[str] = set()
    typed: dict[str, str] = {}
    for line in text.split("\n")[:-1]:
        if line.startswith("# HELP "):
            name = line.split(" ", 3)[2]
            assert name not in helped  # only one for a name
            helped.add(name)
        elif line.startswith("# TYPE "):
            _, _, name, kind = line.split(" ")
            assert name not in typed and kind in ("gauge", "counter")
            assert (kind == "counter") == name.endswith("_total")
            typed[name] = kind
        else:
            match = SAMPLE.fullmatch(line)
            assert match is not None, line
            assert (
                match[1] == list(typed)[-1] and match[1] in helped
            )  # all lines of a name in one group, TYPE first
            pairs = [
                (key, re.sub(r"\\.", lambda m: UNESCAPED[m[0]], value))
                for key, value in PAIR.findall(match[2] or "")
            ]
            assert len(dict(pairs)) == len(pairs)
            series = match[1], frozenset(pairs)
            assert series not in found  # each series once
            found[series] = float(match[4])
    return found


def state(of: StationState, process: int = 7, **more: Any) -> FeedState:
    observed = Observed(state=of, machine=MACHINE, now_s=of.at_s, **more)
    return report(observed, process=process, operator="kim", at_utc="2026-01-01T00:00:00Z")


def of_machine(**more: str) -> frozenset[tuple[str, str]]:
    return frozenset({"machine": MACHINE.name, "simulated": "1", **more}.items())


def test_a_cut_and_its_alarms_are_counted() -> None:
    alarms, _ = scenes.alarmed()
    cutting = replace(CUTTING, alarms=alarms)
    looking_on = StationState(machine=MACHINE.name, standing=Standing.OWNER)
    found = parsed(exposition([state(cutting, parts=3), state(looking_on, 8)]))
    assert found["trilobe_consoles", frozenset()] == 2.0
    assert found["trilobe_spindle_rpm", of_machine()] == 1000.314
    assert found["trilobe_cut_turn", of_machine()] == 83.2
    assert found["trilobe_parts_total", of_machine()] == 3.0
    assert found["trilobe_activity", of_machine(activity="cutting")] == 1.0
    assert sum(value for (name, _), value in found.items() if name == "trilobe_activity") == 1.0
    counted = {labels: value for (name, labels), value in found.items() if name == "trilobe_alarms"}
    assert sum(counted.values()) == len(alarms)
    assert counted[of_machine(priority="high", state="new")] >= 1.0
    only = parsed(exposition([state(looking_on, 8)]))
    assert ("trilobe_spindle_rpm", of_machine()) not in only  # not known: no series, and no zero
    assert only["trilobe_parts_total", of_machine()] == 0.0


def test_neither_a_part_nor_a_console_makes_a_series_of_its_own() -> None:
    """Each series is kept for months: a hundred consoles, each for a part, have those of one."""
    made = set[Series]()
    for process in range(1, 101):
        for of in (CUTTING, replace(scenes.machine(Activity.MEASURING), spindle_rpm=0.0)):
            made |= parsed(
                exposition([state(of, process, job="ring", parts=process, run_id=f"{process:032x}")])
            ).keys()
    assert len(made) == len(parsed(exposition([state(CUTTING, job="ring")])))


def test_without_a_console_there_is_their_number() -> None:
    assert parsed(exposition([])) == {("trilobe_consoles", frozenset()): 0.0}


@given(st.text(alphabet=st.characters(exclude_categories=["Cs"]), max_size=20))
def test_any_name_of_a_job_comes_through(job: str) -> None:
    found = parsed(exposition([state(CUTTING, job=job)]))
    (labels,) = (dict(labels) for name, labels in found if name == "trilobe_job_info")
    assert labels["job"] == job


@pytest.mark.parametrize("job", ['a"b', "a\\nb", "a\nb", "가공"])
def test_quotes_and_lines_in_a_name_are_escaped(job: str) -> None:
    test_any_name_of_a_job_comes_through.hypothesis.inner_test(job)  # type: ignore[attr-defined]
