"""Faults of the line between the client and the card: each is told, and the next answer is the right one again."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import product

import pytest

from drivers.errors import ControllerError, LinkError, LinkTimeoutError
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.simulator.hosts.port import Port
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile

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
class Bench:
    sim: SimulatedLathe
    line: BadLine
    client: PmacClient


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def bench(machine: MachineProfile, request: pytest.FixtureRequest) -> Bench:
    dialect: Dialect = request.param
    sim = SimulatedLathe(machine, dialect=dialect)
    line = BadLine(port=sim.connect())
    made = Bench(sim=sim, line=line, client=PmacClient(MemoryLink(line, sim), sim))
    made.client.connect()
    made.client.request("P1=25 P2=50 P3=75")
    return made


HARMLESS: dict[str, Spoil] = {
    "two segments": lambda said: [said[:1], said[1:]],
    "byte by byte": lambda said: [said[n : n + 1] for n in range(len(said))],
    "late, but in time": lambda said: [b""] * 500 + [said],
}


@pytest.mark.parametrize("spoil", HARMLESS.values(), ids=HARMLESS)
def test_an_answer_may_come_in_any_pieces_and_a_little_late(bench: Bench, spoil: Spoil) -> None:
    """Half an answer is waited for; it is never left over for the next command."""
    bench.line.spoil = spoil
    assert bench.client.query("P1", "P2") == ("25", "50")
    assert bench.client.query("P3") == ("75",)


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
def test_a_fault_is_told_and_the_next_answer_is_that_of_its_own_question(bench: Bench, spoil: Spoil) -> None:
    bench.line.spoil = spoil
    with pytest.raises(LinkError):
        bench.client.numbers("P1", "P2")
    for _ in range(3):
        assert bench.client.query("P3") == ("75",)
        assert bench.client.query("P2", "P1") == ("50", "25")


@pytest.mark.parametrize("name", ["all of it is lost", "the ACK is lost", "a NUL in its place"])
def test_silence_and_garbage_are_followed_by_a_flush(bench: Bench, name: str) -> None:
    bench.line.spoil = FAULTS[name]
    bench.line.sent.clear()
    with pytest.raises(LinkTimeoutError if "lost" in name else LinkError):
        bench.client.query("P1")
    assert bench.line.sent == [b"P1\r", b"\x18"], "and nothing is sent twice"


def test_a_buffer_that_somebody_left_open_is_found_by_the_refusal(bench: Bench) -> None:
    """A question is no line of a program."""
    bench.client.request("OPEN PROG 1 CLEAR")
    with pytest.raises(ControllerError) as refused:
        bench.client.numbers("P1", "M1")
    assert refused.value.error_number == 3
    bench.client.request("CLOSE")
    assert bench.client.query("P1") == ("25",)


def test_a_connection_begins_with_a_flush_an_end_of_line_and_the_handshake_and_ends_with_a_proof(
    bench: Bench,
) -> None:
    bench.line.sent.clear()
    bench.client.connect()
    *first, proof = bench.line.sent
    assert first == [b"\x18", b"\rI4=0\r", b"I3=2 I6=1\r", b"VERSION TYPE\r"]
    assert re.fullmatch(rb"I3=2 I6=1 I4=0 I64=1 P1001=(\d+) P1001\r", proof)


def test_each_proof_has_a_number_of_its_own(bench: Bench) -> None:
    bench.line.sent.clear()
    for _ in range(3):
        bench.client.resynchronise()
    proofs = [sent for sent in bench.line.sent if sent != b"\x18"]
    assert len(proofs) == len(set(proofs)) == 3


def test_a_card_is_reached_whatever_handshake_it_was_saved_with(bench: Bench) -> None:
    """One document has I4 = 1 for what a Turbo leaves the factory with."""
    for saved in product(range(4), repeat=3):
        bench.line.port.receive(b"I3=%d I4=%d I6=%d\rP1=7" % saved)
        bench.sim.wait(0.02)
        bench.line.port.take_output()
        bench.client.connect()
        assert bench.client.query("P1", "I3", "I4", "I6") == ("25", "2", "0", "1"), saved
