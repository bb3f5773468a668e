"""The strict reader of a feed: what is published passes, and nothing else does; the rest is skipped and told."""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from console.session.feed.feed_state import read_state
from console.session.feed.following import LONGEST_LINE, Stream
from console.session.feed.observed_state import ObservedState
from console.session.feed.report import line_of, report
from console.session.station.progress import CutStage
from console.session.station.state import Activity
from profiles.problem import Problem
from profiles.store import load_machine
from tests.fuzz.of_feed import sound_states
from tests.tui import scenes

STATES = sound_states()
SOUND = json.loads(line_of(asdict(STATES[1])))
assert SOUND["cut"] is not None and SOUND["alarms"]

BROKEN: tuple[tuple[str, Any], ...] = (
    ("schema", 2),
    ("schema", True),
    ("at_utc", "yesterday"),
    ("at_utc", "0001-01-01T00:00:00Z"),
    ("at_utc", "2026-13-01T00:00:00Z"),
    ("process", 0),
    ("process", "7"),
    ("process", 7.5),
    ("program", "another"),
    ("simulated", "no"),
    ("machine", None),
    ("machine", {"name": "lathe"}),
    ("job", "x" * 4001),
    ("activity", "dancing"),
    ("execution", 7),
    ("mode", "semi"),
    ("controlled_by", "kim"),
    ("age_s", 1e300),
    ("age_s", 10**400),
    ("spindle_rpm", "fast"),
    ("axes", []),
    ("axes.spindle_deg", 360.5),
    ("axes.carriage_mm", float("nan")),
    ("cut.stage", "coffee"),
    ("cut.turns", True),
    ("parts", -1),
    ("alarms", None),
    ("alarms", [{}]),
    ("alarms", [[]]),
    ("alarms", [SOUND["alarms"][0]] * 1001),
    ("alarms.priority", "extreme"),
    ("alarms.state", None),
    ("alarms.number", 1.5),
    ("next", "arm"),
    ("next.word", 7),
    ("next.left_s", float("inf")),
    ("next.why", [{"code": 1}]),
    ("next.why", "none"),
)


def spoilt(name: str, value: Any) -> bytes:
    """A sound line with another value in one place."""
    table = json.loads(json.dumps(SOUND))
    above, _, last = name.rpartition(".")
    place = table[above] if above else table
    (place[0] if isinstance(place, list) else place)[last] = value
    return json.dumps(table).encode()


@pytest.mark.parametrize("place", range(len(STATES)))
def test_what_is_published_is_read_as_it_was(place: int) -> None:
    assert read_state(line_of(asdict(STATES[place]))) == STATES[place]


@pytest.mark.parametrize("activity", Activity)
@pytest.mark.parametrize("stage", CutStage)
def test_every_activity_and_stage_of_a_console_is_taken(activity: Activity, stage: CutStage) -> None:
    moment = replace(scenes.machine(activity), cut=replace(scenes.cut(), stage=stage))
    machine = load_machine("lee-2001-lathe").machine
    observed = ObservedState(state=moment, machine=machine, now_s=moment.at_s)
    state = report(observed, process=1, operator="kim", at_utc="2026-01-01T00:00:00.000Z")
    assert read_state(line_of(asdict(state))) == state


@pytest.mark.parametrize(("name", "value"), BROKEN, ids=[f"{name}-{n}" for n, (name, _) in enumerate(BROKEN)])
def test_a_value_of_another_type_or_beyond_its_limits_is_refused_by_name(name: str, value: Any) -> None:
    with pytest.raises((ValueError, TypeError)) as error:
        read_state(spoilt(name, value))
    assert str(error.value)


def test_a_line_of_an_older_console_has_no_verdict() -> None:
    older = {name: value for name, value in SOUND.items() if name != "cut_verdict"}
    assert read_state(line_of(older)).cut_verdict is None


@pytest.mark.parametrize("name", [name for name in SOUND if name not in ("cut_verdict", "next")])
def test_a_line_without_one_of_its_values_is_refused(name: str) -> None:
    with pytest.raises(TypeError, match=f"{name} missing"):
        read_state(json.dumps({key: value for key, value in SOUND.items() if key != name}).encode())


@pytest.mark.parametrize(
    "line", [b"", b"[]", b"null", b"7", b"{", b"\xff", b"[" * 100_000, b'{"schema": ' + b"9" * 5000]
)
def test_what_is_no_object_is_refused(line: bytes) -> None:
    with pytest.raises((ValueError, TypeError)):
        read_state(line)


def test_values_that_a_later_console_adds_are_ignored() -> None:
    added = {**SOUND, "coolant": {"on": [1, {}]}, "axes": {**SOUND["axes"], "tailstock_mm": "x" * 9000}}
    assert read_state(json.dumps(added).encode()) == STATES[1]


@pytest.mark.parametrize("text", ["a\nb", "a\r\n12:00:00  lathe@1  ready", "\x1b[2J", "\u2028", "\x00", "\ud800"])
def test_no_text_of_a_feed_makes_a_line_of_its_own(text: str) -> None:
    state = read_state(json.dumps({**SOUND, "job": text, "machine": text}).encode())
    assert state.job is not None and state.job.isprintable() and state.machine.isprintable()


@pytest.fixture
def link() -> Iterator[tuple[socket.socket, Stream, list[Problem]]]:
    """The sending end of a feed, its reader, and what is told of it."""
    ours, theirs = socket.socketpair()
    told: list[Problem] = []
    with theirs:
        stream = Stream(Path("1.socket"), ours, 1.0, told.append)
        theirs.recv(100)
        yield theirs, stream, told
        stream.close()


def test_lines_that_are_no_state_are_told_once(link: tuple[socket.socket, Stream, list[Problem]]) -> None:
    theirs, stream, told = link
    good = line_of(asdict(STATES[0]))
    theirs.sendall(b"x\n" + good + spoilt("parts", -1) + b"\n" + good + b'{"schema":1,"refused":"RuntimeError"}\n')
    assert stream.take() == [STATES[0], STATES[0]]
    assert [each.code for each in told] == ["feed.not_one"]
    stream.close()
    assert [(each.code, each.value) for each in told[1:]] == [("feed.refused", "3")]


def test_a_line_that_is_too_long_is_one_that_is_skipped(link: tuple[socket.socket, Stream, list[Problem]]) -> None:
    theirs, stream, told = link
    for _ in range(2 * LONGEST_LINE // 50_000):
        theirs.sendall(b" " * 50_000)
        assert stream.take() == []
    theirs.sendall(line_of(asdict(STATES[0])) * 2)
    assert stream.take() == [STATES[0]]
    assert (stream.refused, len(told)) == (1, 1)
