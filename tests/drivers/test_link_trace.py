"""Links: their faults, their trace, and who has signed for what is behind them."""

from __future__ import annotations

import errno
import io
import os
import re
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.clock import Clock
from drivers.errors import ControllerError, DriverError, LinkError, LinkTimeoutError
from drivers.lathe.console_role import Signature
from drivers.lathe.ownership import ITEMS, read_signature, sign
from drivers.lathe.stop import StopPath
from drivers.link.base import StopWay
from drivers.link.memory import MemoryLink
from drivers.link.tracing import Dialogue, TracedLink, TraceFile
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.simulator.hosts.port import Port
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from profiles.problem import Problem
from tests.drivers.conftest import Bench
from tests.system.lathe_sites import compact


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
    assert text_of(sink) == (
        "12.345 > P1 P2 | 12.346 < 25 | 12.347 < 50 | 12.347 < [ACK] | 12.348 ! [^K] | 12.349 > UUU | "
        "12.350 < [BEL]ERR003"
    ).split(" | ")


def test_what_has_no_end_and_what_is_not_text_is_shown_as_it_is() -> None:
    link, sink = traced(Script(b"\x00", b"25", b"\n\xff[\r", b"\x07"))
    link.send(b"\x18\rP1")
    for _ in range(3):
        link.receive(1.0)
    link.send(b"\r")
    link.receive(1.0)
    link.close()
    marks = [line.split(" ", 1)[1] for line in text_of(sink)]
    assert (
        marks
        == "> [^X] | > [CR] | > P1 [no CR] | < [NUL] | < 25[LF][0xff][0x5b] | > [CR] | < [BEL] [no CR]".split(
            " | "
        )
    )


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
            dialogue.take_bytes(1.0, "<", data[place : place + size])
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
    assert [
        line.split(" ", 1)[1] for line in text_of(sink)
    ] == "> P1 | * link.lost unplugged | ! [^K] [not sent: link.lost] | * link.closed".split(" | ")


def test_what_cannot_be_written_to_costs_the_trace_alone() -> None:
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


# Faults of the line between the client and the card: each is told, and the next answer is the right one again.

Spoil = Callable[[bytes], list[bytes]]
"""What becomes of the answer to one line: the pieces in which it arrives."""


@dataclass(kw_only=True)
class BadLine:
    """The far end of a link. The next thing that the card says after `spoil` is set goes through it."""

    port: Port
    spoil: Spoil | None = None
    sent: list[bytes] = field(default_factory=list)
    pieces: list[bytes] = field(default_factory=list)

    def receive(self, data: bytes) -> None:
        """Hand bytes to the card. A flush makes it forget what it had not yet said."""
        self.sent.append(data)
        if b"\x18" in data:
            self.pieces.clear()
        self.port.receive(data)

    def take_output(self) -> bytes:
        """Return what arrives, a piece at a look."""
        said = self.port.take_output()
        if said:
            self.pieces += self.spoil(said) if self.spoil is not None else [said]
            self.spoil = None
        return self.pieces.pop(0) if self.pieces else b""


@dataclass(frozen=True, kw_only=True)
class FaultyBench:
    sim: SimulatedLathe
    line: BadLine
    client: PmacClient


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def bench(machine: MachineProfile, request: pytest.FixtureRequest) -> FaultyBench:
    dialect: Dialect = request.param
    sim = SimulatedLathe(machine, dialect=dialect)
    line = BadLine(port=sim.connect())
    made = FaultyBench(sim=sim, line=line, client=PmacClient(MemoryLink(line, sim), sim))
    made.client.connect()
    made.client.request("P1=25 P2=50 P3=75")
    return made


FAULTS: dict[str, Spoil] = {
    "the ACK is lost": lambda said: [said.removesuffix(b"\x06")],
    "half of it is lost": lambda said: [said[:2]],
    "all of it is lost": lambda _: [],
    "it comes when nobody waits any more": lambda said: [b""] * 5000 + [said],
    "an empty line too many": lambda said: [b"\r" + said],
    "a line too few": lambda said: [said[3:]],
    "a NUL in its place": lambda _: [b"\0"],
    "a NUL in front of it": lambda said: [b"\0", said],
    "a byte above 126": lambda said: [b"\xb2" + said[1:]],
    "a BELL without a number": lambda _: [b"\x07\r"],
    "a BELL alone": lambda _: [b"\x07"],
    "data without their CR": lambda said: [said.replace(b"\r\x06", b"\x06")],
    "a checksum behind each line": lambda said: [said.replace(b"\r", b"\r\x9b")],
}


@pytest.mark.parametrize("spoil", FAULTS.values(), ids=FAULTS)
def test_a_fault_is_told_and_the_next_answer_is_that_of_its_own_question(bench: FaultyBench, spoil: Spoil) -> None:
    bench.line.spoil = spoil
    with pytest.raises(LinkError):
        bench.client.numbers("P1", "P2")
    for _ in range(3):
        assert bench.client.query("P3") == ("75",)
        assert bench.client.query("P2", "P1") == ("50", "25")


@pytest.mark.parametrize("name", ["all of it is lost", "the ACK is lost", "a NUL in its place"])
def test_silence_and_garbage_are_followed_by_a_flush(bench: FaultyBench, name: str) -> None:
    bench.line.spoil = FAULTS[name]
    bench.line.sent.clear()
    with pytest.raises(LinkTimeoutError if "lost" in name else LinkError):
        bench.client.query("P1")
    assert bench.line.sent == [b"P1\r", b"\x18"], "and nothing is sent twice"


def test_a_buffer_that_somebody_left_open_is_found_by_the_refusal(bench: FaultyBench) -> None:
    """A question is no line of a program."""
    bench.client.request("OPEN PROG 1 CLEAR")
    with pytest.raises(ControllerError) as refused:
        bench.client.numbers("P1", "M1")
    assert refused.value.error_number == 3
    bench.client.request("CLOSE")
    assert bench.client.query("P1") == ("25",)


def test_a_connection_begins_with_a_flush_and_the_handshake_and_ends_with_a_proof(bench: FaultyBench) -> None:
    bench.line.sent.clear()
    bench.client.connect()
    *first, proof = bench.line.sent
    assert first == [b"\x18", b"\rI4=0\r", b"I3=2 I6=1\r", b"VERSION TYPE\r"]
    assert re.fullmatch(rb"I3=2 I6=1 I4=0 I64=1 P1001=(\d+) P1001\r", proof)


def test_each_proof_has_a_number_of_its_own(bench: FaultyBench) -> None:
    bench.line.sent.clear()
    for _ in range(3):
        bench.client.resynchronise()
    proofs = [sent for sent in bench.line.sent if sent != b"\x18"]
    assert len(proofs) == len(set(proofs)) == 3


def test_a_card_is_reached_whatever_handshake_it_was_saved_with(bench: FaultyBench) -> None:
    """One document has I4 = 1 for what a Turbo leaves the factory with."""
    for saved in product(range(4), repeat=3):
        bench.line.port.receive(b"I3=%d I4=%d I6=%d\rP1=7" % saved)
        bench.sim.wait(0.02)
        bench.line.port.take_output()
        bench.client.connect()
        assert bench.client.query("P1", "I3", "I4", "I6") == ("25", "2", "0", "1"), saved


# Who controls a machine, in words: written by the console that has claimed it, read by those who look on.


@pytest.fixture(params=["pmac", "turbo"])
def client(request: pytest.FixtureRequest) -> PmacClient:
    sim = SimulatedLathe(compact(request.param))
    clock: Clock = sim
    made = PmacClient(MemoryLink(sim.connect(), sim), clock)
    made.connect()
    return made


# 15 bytes hold five syllables of Hangul; a sixth is left out whole.
@pytest.mark.parametrize(
    ("name", "read"), [("kim", "kim"), ("김철수", "김철수"), ("가나다라마바", "가나다라마"), ("a" * 40, "a" * 15)]
)
def test_it_is_read_as_it_was_written(client: PmacClient, name: str, read: str) -> None:
    sign(client, Signature(number=2**31 - 1, name=name, host="lathe-2", minute=29_900_000))
    assert read_signature(client, 2**31 - 1) == Signature(
        number=2**31 - 1, name=read, host="lathe-2", minute=29_900_000
    )


def test_another_number_has_not_signed(client: PmacClient) -> None:
    sign(client, Signature(number=4711, name="kim", host="lathe-2", minute=29_900_000))
    assert read_signature(client, 4712) is None


def test_what_no_console_has_written_is_no_name(client: PmacClient) -> None:
    client.request(" ".join(f"{item}=0.5" for item in ITEMS[2:]))
    client.request(f"{ITEMS[0]}=4711 {ITEMS[1]}=-3.5")
    assert read_signature(client, 4711) is None
    client.request(f"{ITEMS[1]}=3")
    assert read_signature(client, 4711) is None
