"""What a trace shows of a dialogue, and that it is in nobody's way."""

from __future__ import annotations

import errno
import io
import os
import re
from collections import deque
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import DriverError, LinkError
from drivers.lathe.stop import StopPath
from drivers.link.base import StopWay
from drivers.link.memory import MemoryLink
from drivers.link.tracing import Dialogue, TracedLink, TraceFile
from drivers.pmac.client import PmacClient
from profiles.problem import Problem

if TYPE_CHECKING:
    from tests.drivers.conftest import Bench


class Script:
    """A link that says what it is told to, and a clock that goes on a millisecond each time it is asked."""

    address = "script"
    stop_way = StopWay.RESERVED
    checks_bytes = True

    def __init__(self, *replies: bytes) -> None:
        self.replies = deque(replies)
        self.sent: list[bytes] = []
        self.broken = self.closed = False
        self.ticks = 12_344

    def now_s(self) -> float:
        self.ticks += 1
        return self.ticks / 1000.0

    def send(self, data: bytes) -> None:
        if self.broken:
            raise LinkError(Problem(code="link.lost", value="unplugged"))
        self.sent.append(data)

    send_urgent = send

    def receive(self, timeout_s: float) -> bytes:
        if self.broken:
            raise LinkError(Problem(code="link.closed"))
        return self.replies.popleft() if self.replies else b""

    def close(self) -> None:
        self.closed = True


class FullDisk:
    def __init__(self, lines: int) -> None:
        self.left = lines
        self.asked = 0

    def write(self, text: str) -> None:
        self.asked += 1
        if not self.left:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        self.left -= 1


def text_of(sink: io.StringIO) -> list[str]:
    return sink.getvalue().splitlines()


def traced(script: Script) -> tuple[TracedLink, io.StringIO]:
    sink = io.StringIO()
    return TracedLink(script, sink, script.now_s), sink


def test_a_dialogue_reads_as_one() -> None:
    link, sink = traced(Script(b"25\r5", b"0\r\x06", b"\x07ERR003\r"))
    link.send(b"P1 P2\r")
    link.receive(1.0)
    link.receive(1.0)
    link.send_urgent(b"\x0b")
    link.send(b"UUU\r")
    link.receive(1.0)
    assert text_of(sink) == [
        "12.345 > P1 P2",
        "12.346 < 25",
        "12.347 < 50",
        "12.347 < [ACK]",
        "12.348 ! [^K]",
        "12.349 > UUU",
        "12.350 < [BEL]ERR003",
    ]


def test_what_has_no_end_and_what_is_not_text_is_shown_as_it_is() -> None:
    link, sink = traced(Script(b"\x00", b"25", b"\n\xff[\r", b"\x07"))
    link.send(b"\x18\rP1")
    for _ in range(3):
        link.receive(1.0)
    link.send(b"\r")
    link.receive(1.0)
    link.close()
    marks = [line.split(" ", 1)[1] for line in text_of(sink)]
    assert marks == [
        "> [^X]",
        "> [CR]",
        "> P1 [no CR]",
        "< [NUL]",
        "< 25[LF][0xff][0x5b]",
        "> [CR]",
        "< [BEL] [no CR]",
    ]


NAMED = {"NUL": 0, "STX": 2, "ACK": 6, "BEL": 7, "LF": 10, "CR": 13}
SHOWN = re.compile(r"\[(?:(\^.)|(0x..)|([A-Z]+))\]|(.)", re.DOTALL)
ENDING = {*range(0x20)} - {2, 7, 9, 10, 13}


def bytes_of(line: str) -> bytes:
    """The bytes that a line of the trace stands for."""
    text, without_end = line.removesuffix(" [no CR]"), line.endswith(" [no CR]")
    if text == "[CR]":
        return b"\r"
    data = bytearray()
    for control, number, name, plain in SHOWN.findall(text):
        if control:
            data.append(ord(control[1]) - 0x40)
        else:
            data.append(int(number, 16) if number else NAMED[name] if name else ord(plain))
    return bytes(data) if without_end or data[-1] in ENDING else bytes(data) + b"\r"


@given(st.lists(st.tuples(st.booleans(), st.binary(max_size=12)), max_size=12))
def test_every_byte_both_ways_can_be_read_back(dialogue: list[tuple[bool, bytes]]) -> None:
    script = Script(*(data for outward, data in dialogue if not outward and data))
    link, sink = traced(script)
    for outward, data in dialogue:
        if outward:
            link.send(data)
        elif data:
            link.receive(1.0)
    link.close()
    assert script.closed
    lines = [line.split(" ", 2)[1:] for line in sink.getvalue().split("\n")[:-1]]
    for outward, mark in ((True, ">"), (False, "<")):
        expected = b"".join(data for there, data in dialogue if there is outward)
        assert b"".join(bytes_of(text) for said, text in lines if said == mark) == expected


@given(st.binary(max_size=40) | st.text("ab\r\x06\x02\x07\n\x18[", max_size=40).map(str.encode), st.integers(1, 7))
def test_the_lines_of_a_dialogue_do_not_depend_on_how_the_bytes_arrive(data: bytes, at_once: int) -> None:
    whole, pieces = list[tuple[float, str, str]](), list[tuple[float, str, str]]()
    for found, size in ((whole, len(data) or 1), (pieces, at_once)):
        dialogue = Dialogue(lambda *line, found=found: found.append(line))
        for place in range(0, len(data), size):
            dialogue.heard(1.0, "<", data[place : place + size])
        dialogue.end(1.0, "<")
    assert whole == pieces
    assert sum(line.count("[ACK]") for _, _, line in whole) == data.count(b"\x06")


def test_a_link_that_breaks_breaks_as_without_a_trace_and_the_trace_says_so() -> None:
    script = Script()
    link, sink = traced(script)
    script.broken = True
    with pytest.raises(LinkError) as lost:
        link.send(b"P1\r")
    assert lost.value.problems[0].code == "link.lost"
    with pytest.raises(LinkError):
        link.send_urgent(b"\x0b")
    with pytest.raises(LinkError):
        link.receive(1.0)
    assert [line.split(" ", 1)[1] for line in text_of(sink)] == [
        "> P1",
        "* link.lost unplugged",
        "! [^K] [not sent: link.lost]",
        "* link.closed",
    ]


def test_a_full_disk_costs_the_trace_and_nothing_else() -> None:
    script, disk = Script(b"25\r\x06"), FullDisk(1)
    link = TracedLink(script, disk, script.now_s)
    link.send(b"P1\r")
    assert disk.asked == 1
    assert link.receive(1.0) == b"25\r\x06"
    link.send_urgent(b"\x0b")
    link.send(b"P2\r")
    assert script.sent == [b"P1\r", b"\x0b", b"P2\r"]
    assert link.problem == Problem(code="link.trace_lost", where="script", value="No space left on device")
    assert disk.asked == 2


def test_something_that_never_ends_a_line_is_written_down_all_the_same() -> None:
    link, sink = traced(Script(*[b"x" * 1000] * 9))
    for _ in range(9):
        link.receive(1.0)
    assert len(text_of(sink)) == 2


def test_the_session_of_a_client_is_the_same_with_a_trace(closed: Bench) -> None:
    sink = io.StringIO()
    link = TracedLink(MemoryLink(closed.sim.connect(), closed.sim), sink, closed.sim.now_s)
    client, stop = PmacClient(link, closed.sim), StopPath(link)
    client.connect()
    client.request("P1=125")
    assert client.numbers("P1") == (125.0,)
    stop.kill("operator")
    lines = [line.split(" ", 1)[1] for line in text_of(sink)]
    assert lines[-4:] == ["> P1", "< 125", "< [ACK]", "! [^K]"]
    assert stop.way is StopWay.DIRECT
    times = [float(line.split(" ")[0]) for line in text_of(sink)]
    assert times == sorted(times)


def test_a_file_is_appended_to_and_each_session_says_where_it_begins(tmp_path: Path) -> None:
    path = tmp_path / "trace"
    for _ in range(2):
        file = TraceFile(path, "serial:/dev/ttyUSB0")
        file.write("0.001 > P1\n")
        assert path.read_text().endswith("0.001 > P1\n")  # before anything is closed
        file.close()
        file.write("0.002 > never\n")
    lines = path.read_text().splitlines()
    assert [bool(re.fullmatch(r"# \d{4}-\d\d-\d\dT[\d:+-]+ serial:/dev/ttyUSB0", line)) for line in lines] == [
        True,
        False,
    ] * 2
    assert lines[1] == lines[3] == "0.001 > P1"


def test_a_file_does_not_grow_for_ever_and_the_newest_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "trace"
    file = TraceFile(path, "memory", limit_bytes=1000)
    written = [f"{number:03d} > P1\n" for number in range(500)]
    for line in written:
        file.write(line)
    file.close()
    older = tmp_path / "trace.1"
    assert path.stat().st_size <= 1000 and older.stat().st_size <= 1000
    assert "".join(written).endswith(older.read_text() + path.read_text())
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["trace", "trace.1"]


@pytest.mark.parametrize("name", [".", "no-such-folder/trace", "fifo"])
def test_a_file_that_cannot_be_written_is_refused_before_anything_begins(tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / "fifo")
    with pytest.raises(DriverError) as refused:
        TraceFile(tmp_path / name, "memory")
    (problem,) = refused.value.problems
    assert (problem.code, problem.where) == ("link.trace_unwritable", str(tmp_path / name))


def test_a_disk_that_is_full_from_the_beginning_is_refused_too() -> None:
    with pytest.raises(DriverError) as refused:
        TraceFile(Path("/dev/full"), "memory")
    assert refused.value.problems[0].value == "No space left on device"
