"""A client that lost its step finds it again, on a line of any speed."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import ControllerError, DriverError, LinkError, LinkTimeoutError, RefusedError
from drivers.link.memory import MemoryLink
from drivers.link.serial import LinePace
from drivers.pmac.client import REPLY_TIMEOUT_S, PmacClient
from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.framing import FaultKind
from drivers.pmac.reserved import MARKER
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from tests.drivers.commissioned import Recorded, recorded

FAULTS: dict[str, tuple[dict[str, float], FaultKind]] = {
    "dropped-ack": ({"replies": 1}, FaultKind.UNFINISHED),
    "late-reply": ({"replies": 1, "delay_ms": 1000 * REPLY_TIMEOUT_S + 200}, FaultKind.SILENT),
    "extra-line": ({"replies": 1}, FaultKind.LINE_COUNT),
    "nul": ({"replies": 1}, FaultKind.NUL),
    "bare-bel": ({"replies": 1}, FaultKind.BARE_BELL),
    "hang": ({"for_s": REPLY_TIMEOUT_S + 0.2}, FaultKind.SILENT),
}
"""What is injected, and what the client calls it when a question is spoiled by it."""


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def bench(machine: MachineProfile, request: pytest.FixtureRequest) -> Recorded:
    dialect: Dialect = request.param
    return recorded(machine, dialect)


def codes(error: DriverError) -> list[str]:
    return [problem.code for problem in error.problems]


def answers_are_right(bench: Recorded) -> None:
    for _ in range(3):
        assert bench.client.query("P3") == ("75",)
        assert bench.client.query("P2", "P3") == ("50", "75")


@pytest.mark.parametrize("fault", FAULTS)
def test_a_spoiled_question_is_told_counted_and_not_repeated_unasked(bench: Recorded, fault: str) -> None:
    parameters, kind = FAULTS[fault]
    bench.inject(fault, **parameters)
    with pytest.raises(LinkError) as told:
        bench.client.query("P1", "P2")
    assert "link.outcome_unknown" not in codes(told.value), "it only asks"
    assert told.value.problems[0].key == "P1 P2"
    assert bench.times_sent("P1 P2") == 1
    assert bench.client.faults.count(kind) == 1
    assert bench.client.faults.seen[kind].line == "P1 P2"
    assert (bench.client.in_step, bench.client.faults.total) == (False, 1)
    bench.sim.wait(0.3)
    answers_are_right(bench)
    assert (bench.client.in_step, bench.client.faults.total) == (True, 1)


@pytest.mark.parametrize("fault", FAULTS)
def test_a_question_that_may_be_asked_again_is_asked_once_more_in_step(bench: Recorded, fault: str) -> None:
    parameters, _ = FAULTS[fault]
    bench.inject(fault, **parameters)
    assert bench.client.query("P1", "P2", again=True) == ("25", "50")
    assert bench.times_sent("P1 P2") == 2
    first, second = (n for n, sent in enumerate(bench.line.sent) if sent == b"P1 P2\r")
    between = b"".join(bench.line.sent[first + 1 : second])
    assert b"\x18" in between
    assert b"P%d=" % MARKER in between


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("line", ["P1=P1+1", "P1=26", "#1J/", "P1=26 P1"])
def test_what_writes_or_moves_is_sent_once_with_an_unknown_outcome(bench: Recorded, fault: str, line: str) -> None:
    bench.inject(fault, **FAULTS[fault][0])
    with pytest.raises(LinkError) as told:
        bench.client.request(line, lines=int(line.endswith(" P1")))
    assert codes(told.value)[-1] == "link.outcome_unknown"
    assert told.value.problems[-1].key == line
    bench.sim.wait(0.3)
    answers_are_right(bench)
    assert bench.times_sent(line) == 1
    assert bench.value(1) == (26 if line.startswith("P1") and fault != "hang" else 25)


@pytest.mark.parametrize("line", ["#1J+", "P1=3", "P1=3 P1", "UUU", "B1R LIST PC"])
def test_what_may_change_something_is_never_asked_again(bench: Recorded, line: str) -> None:
    with pytest.raises(RefusedError) as refused:
        bench.client.query(line, again=True)
    assert codes(refused.value) == ["controller.not_a_question"]
    assert bench.line.sent == []


@pytest.mark.parametrize("fault", ["bare-bel", "nul", "extra-line"])
def test_what_can_be_no_reply_is_noticed_at_once(bench: Recorded, fault: str) -> None:
    """Not after the 2 s of a reply that does not come: after a short quiet time, and another behind the flush."""
    bench.sim.faults.inject(fault, replies=1)
    before_s = bench.sim.now_s()
    with pytest.raises(LinkError):
        bench.client.query("P1")
    assert bench.sim.now_s() - before_s < 0.3


def test_a_reply_in_pieces_and_one_on_a_slow_line_are_no_faults(bench: Recorded) -> None:
    bench.sim.faults.inject("split-segments", pieces=4, gap_ms=60)
    bench.sim.faults.inject("9600-baud")
    assert bench.client.query("P1", "P2", "P3") == ("25", "50", "75")
    with pytest.raises(ControllerError):
        bench.client.request("UUU")
    assert bench.client.faults.total == 0


def test_a_checksum_that_somebody_has_switched_on_is_a_fault_and_is_switched_off(bench: Recorded) -> None:
    bench.sim.faults.inject("stranger-writes", line="I4=1")
    bench.sim.wait(0.02)
    bench.sim.faults.inject("wrong-checksum")
    with pytest.raises(LinkError):
        bench.client.query("P1", "P2")
    answers_are_right(bench)
    assert bench.client.query("I4") == ("0",)


@pytest.mark.parametrize("line", ["$$$", "I3=1", "I3=1 I6=3", "I6=3", "I6=0", "I3=0 I6=2"])
def test_a_card_that_was_reset_or_set_otherwise_is_recognised_and_set_again(bench: Recorded, line: str) -> None:
    bench.sim.faults.inject("stranger-writes", line=line)
    bench.sim.wait(0.02)
    with pytest.raises(LinkError):
        bench.client.query("P1")
        bench.client.request("UUU")
    marks = {FaultKind.HANDSHAKE, FaultKind.BARE_BELL, FaultKind.UNFINISHED, FaultKind.SILENT}
    assert set(bench.client.faults.seen) <= marks
    assert bench.client.query("I3", "I4", "I6", "I64") == ("2", "0", "1", "1")
    with pytest.raises(ControllerError) as refused:
        bench.client.request("UUU")
    assert refused.value.error_number == 3


def test_data_in_the_reply_to_a_command_are_a_fault(bench: Recorded) -> None:
    with pytest.raises(LinkError) as told:
        bench.client.request("P1=26 P1", lines=0)
    assert codes(told.value) == ["link.out_of_step", "link.outcome_unknown"]
    assert (told.value.problems[0].value, told.value.problems[0].limit) == ("1 CR", "≠ 0 CR")


def test_a_late_reply_that_nobody_waits_for_is_no_reply_to_the_next_question(bench: Recorded) -> None:
    """It comes behind the flush: the card of this line does not forget what it has begun to say."""
    bench.line.port.announce(b"25\r\x06")
    bench.sim.wait(0.02)
    assert bench.client.query("P2") == ("50",)
    assert bench.client.faults.count(FaultKind.UNASKED) == 1


def test_a_request_whose_reply_was_not_taken_is_given_up_before_the_next_one(bench: Recorded) -> None:
    bench.client.send("P1")
    assert bench.client.query("P2") == ("50",)
    assert bench.client.faults.count(FaultKind.ABANDONED) == 1


def test_a_silent_card_keeps_a_request_no_longer_than_its_own_time_and_two_quiet_ones(bench: Recorded) -> None:
    """The stop is repeated between two looks: a way back must not hold them up."""
    bench.sim.faults.inject("hang")
    for _ in range(4):
        before_s = bench.sim.now_s()
        with pytest.raises(LinkTimeoutError):
            bench.client.query("P1", timeout_s=0.1)
        assert bench.sim.now_s() - before_s < 0.31
    assert bench.times_sent("P1") == 1, "what cannot be in step is not sent"


def test_a_cut_cable_is_told_with_the_outcome_of_what_was_on_its_way(bench: Recorded) -> None:
    bench.client.send("#1J/")
    bench.sim.faults.inject("cut-cable")
    with pytest.raises(LinkError) as lost:
        bench.client.reply("#1J/")
    assert codes(lost.value) == ["link.lost", "link.outcome_unknown"]
    with pytest.raises(LinkError) as lost:
        bench.client.query("P1", again=True)
    assert codes(lost.value)[0] == "link.lost"


def test_a_stop_between_a_line_and_its_reply_spoils_nothing(bench: Recorded) -> None:
    bench.client.request("#1J/ #2J/ #3J/")
    for stop in (b"\x01", b"\x0b"):
        bench.client.send("P1")
        bench.client.link.send_urgent(stop)
        assert bench.client.reply("P1") == ("25",)
    assert bench.client.faults.total == 0


def test_what_programs_say_is_kept_and_never_taken_for_data(bench: Recorded) -> None:
    bench.plc('SEND"one"', 'SEND"two"')
    bench.client.send("P1")
    bench.sim.wait(0.1)
    assert bench.client.reply("P1") == ("25",)
    answers_are_right(bench)
    assert bench.client.take_messages() == ("one", "two")
    assert bench.client.take_messages() == ()
    assert bench.client.faults.total == 0


def test_an_unmarked_text_is_a_fault_and_the_mark_is_set_again(bench: Recorded) -> None:
    bench.sim.faults.inject("stranger-writes", line="I64=0")
    bench.sim.wait(0.02)
    bench.plc('SEND"75"')
    bench.sim.wait(0.1)
    assert bench.client.query("P1") == ("25",)
    assert bench.client.faults.count(FaultKind.UNASKED) == 1
    assert bench.client.query("I64") == ("1",)


def test_of_very_many_messages_the_latest_are_kept(bench: Recorded) -> None:
    for number in range(150):
        bench.line.port.announce(b"\x02%d\r" % number)
    bench.sim.wait(0.02)
    bench.client.query("P1")
    assert bench.client.take_messages() == tuple(str(number) for number in range(50, 150))


@pytest.mark.parametrize("line", ["P1=26", "P1", "#1J/"])
def test_the_error_of_a_program_is_not_taken_for_the_refusal_of_a_line(bench: Recorded, line: str) -> None:
    """A PLC gives a command that is refused: its BEL stands in the stream of every host, in front of the reply."""
    bench.client.send(line)
    bench.line.port.announce(b"\x07ERR012\r")
    with pytest.raises(LinkError) as told:
        bench.client.reply(line)
    assert codes(told.value)[0] == "link.out_of_step"
    assert ("link.outcome_unknown" in codes(told.value)) is (line != "P1")
    assert bench.client.faults.count(FaultKind.UNASKED) == 1
    assert bench.times_sent(line) == 1
    answers_are_right(bench)


def test_a_true_refusal_is_one_though_it_was_proven(bench: Recorded) -> None:
    with pytest.raises(ControllerError) as refused:
        bench.client.request("P1 UUU")
    assert refused.value.error_number == 3
    assert bench.client.faults.total == 0
    answers_are_right(bench)


def test_connecting_tells_the_family_and_before_that_there_is_none(machine: MachineProfile) -> None:
    for dialect in (PMAC, TURBO):
        sim = SimulatedLathe(machine, dialect=dialect)
        client = PmacClient(MemoryLink(sim.connect(), sim), sim)
        with pytest.raises(RefusedError) as refused:
            _ = client.dialect
        assert codes(refused.value) == ["link.not_connected"]
        client.connect()
        assert client.dialect is dialect


@pytest.mark.parametrize(
    ("answers", "code", "value"),
    [
        ([b"", b"", b"\x06", b"login:\r"], "link.silent", "2 s"),
        ([b"", b"", b"\x06", b"OK\r\x06"], "link.not_a_pmac", "1 CR"),
        ([b"", b"", b"\x06", b"hello\rworld\r\x06"], "link.not_a_pmac", "hello"),
        ([b"", b"", b"\x06", b"2.5\rPower PMAC UMAC\r\x06"], "link.unknown_type", "Power PMAC UMAC"),
        ([b"", b"", b"\x00"], "link.not_a_pmac", "byte 0x00 in a reply"),
        ([], "link.silent", "2 s"),
    ],
)
def test_a_wrong_device_is_told(machine: MachineProfile, answers: list[bytes], code: str, value: str) -> None:
    sim = SimulatedLathe(machine)

    class Device:
        waiting = b""

        def receive(self, data: bytes) -> None:
            self.waiting = answers.pop(0) if answers else b""

        def take_output(self) -> bytes:
            said, self.waiting = self.waiting, b""
            return said

    with pytest.raises(LinkError) as told:
        PmacClient(MemoryLink(Device(), sim), sim).connect()
    assert (codes(told.value), told.value.problems[0].value) == ([code], value)


@pytest.mark.parametrize(("changes", "code"), [("echo", "link.echoes"), ("line feeds", "link.line_feeds")])
def test_a_line_that_changes_what_is_sent_is_told(machine: MachineProfile, changes: str, code: str) -> None:
    """A terminal server with its local echo on, or with line ends of its own, before a sound controller."""
    sim = SimulatedLathe(machine)

    class Server:
        port = sim.connect()
        echoed = b""

        def receive(self, data: bytes) -> None:
            self.echoed += data if changes == "echo" else b""
            self.port.receive(data)

        def take_output(self) -> bytes:
            said, self.echoed = self.echoed + self.port.take_output(), b""
            return said.replace(b"\r", b"\r\n") if changes == "line feeds" else said

    with pytest.raises(LinkError) as told:
        PmacClient(MemoryLink(Server(), sim), sim).connect()
    assert codes(told.value) == [code]


@pytest.mark.parametrize("late_s", [0.1, 0.4, 0.9])
def test_a_controller_that_answers_late_is_one(machine: MachineProfile, late_s: float) -> None:
    """The computer that serves it is busy: nothing comes while the line is drained, and then all at once."""
    sim = SimulatedLathe(machine)

    class Late:
        """Holds back what the card says until `late_s` after the first byte."""

        port = sim.connect()
        begun_s: float | None = None

        def receive(self, data: bytes) -> None:
            self.begun_s = sim.now_s() if self.begun_s is None else self.begun_s
            self.port.receive(data)

        def take_output(self) -> bytes:
            held = self.begun_s is None or sim.now_s() < self.begun_s + late_s
            return b"" if held else self.port.take_output()

    client = PmacClient(MemoryLink(Late(), sim), sim)
    assert client.connect()[1].startswith("PMAC1")
    assert client.numbers("I3", "I6") == (2.0, 1.0)


SPOILERS = ("dropped-ack", "extra-line", "nul", "bare-bel")


@given(
    seed=st.integers(0, 1000),
    faults=st.lists(st.sampled_from(SPOILERS), min_size=1, max_size=2, unique=True),
    asked=st.lists(st.integers(2, 3), min_size=1, max_size=6),
)
def test_under_any_faults_an_answer_is_the_right_one_or_an_error_and_nothing_is_counted_twice(
    machine: MachineProfile, seed: int, faults: list[str], asked: list[int]
) -> None:
    bench = recorded(machine, PMAC)
    for fault in faults:
        bench.sim.faults.inject(fault, seed=seed, share=0.3)
    for index in asked:
        before, told = bench.value(1), False
        try:
            bench.client.request("P1=P1+1")
        except LinkError:
            told = True
        assert bench.value(1) in ((before, before + 1) if told else (before + 1,))
        try:
            assert bench.client.query(f"P{index}") == (str(25 * index),)
        except LinkError:
            continue
    bench.sim.faults.clear()
    answers_are_right(bench)


@pytest.mark.parametrize(("late_s", "least_s"), [(1.5, 1.5), (1.9, 1.9), (2.5, 2.0), (3.5, 2.0)])
def test_late_answers_are_not_taken_for_silence(machine: MachineProfile, late_s: float, least_s: float) -> None:
    """Something in between passes one answer on after the other, each `late_s` after the one before."""
    sim = SimulatedLathe(machine)

    class Slow:
        port = sim.connect()

        def __init__(self) -> None:
            self.queue: list[tuple[float, bytes]] = []

        def receive(self, data: bytes) -> None:
            self.port.receive(data)

        def take_output(self) -> bytes:
            if said := self.port.take_output():
                last_s = self.queue[-1][0] if self.queue else 0.0
                self.queue.append((max(last_s, sim.now_s()) + late_s, said))
            due = [said for at_s, said in self.queue if at_s <= sim.now_s()]
            self.queue = self.queue[len(due) :]
            return b"".join(due)

    with pytest.raises(LinkError) as told:
        PmacClient(MemoryLink(Slow(), sim), sim).connect()
    assert codes(told.value) == ["link.late"]
    assert float(told.value.problems[0].value.strip("> s")) >= least_s


# How far ahead of a slow line bytes are handed to it. A character is ten bits.

STOP_WITHIN_S = 0.020


class Line:
    """A serial line: a character leaves when the one before has left."""

    def __init__(self, baud_rate: int) -> None:
        self.character_s = 10.0 / baud_rate
        self.clear_at_s = 0.0

    def take(self, count: int, now_s: float) -> None:
        self.clear_at_s = max(self.clear_at_s, now_s) + count * self.character_s


@given(
    st.sampled_from([600, 9600, 19_200, 38_400, 76_800, 115_200]),
    st.lists(st.tuples(st.integers(1, 300), st.floats(0.0, 0.1)), min_size=1, max_size=30),
)
def test_a_stop_at_any_time_is_on_the_wire_within_20_ms(baud_rate: int, lines: list[tuple[int, float]]) -> None:
    pace, line, now_s = LinePace(baud_rate), Line(baud_rate), 0.0
    for length, pause_s in lines:
        left = length
        while left:
            count = min(pace.room(now_s), left)
            if count:
                pace.record_sent_bytes(count, now_s)
                line.take(count, now_s)
                left -= count
            assert line.clear_at_s + line.character_s - now_s <= max(STOP_WITHIN_S, 2.01 * line.character_s)
            now_s += pace.wait_s(now_s) if left else pause_s


@pytest.mark.parametrize(("baud_rate", "ahead"), [(9600, 9), (38_400, 38), (115_200, 115), (300, 1)])
def test_what_may_wait_is_10_ms_of_the_line_and_one_character_at_least(baud_rate: int, ahead: int) -> None:
    assert LinePace(baud_rate).queue_room_bytes == ahead
    assert LinePace(baud_rate).room(5.0) == ahead


def test_a_long_text_takes_as_long_as_the_line_and_no_longer() -> None:
    """9600 baud are 960 characters a second."""
    pace, now_s, left = LinePace(9600), 0.0, 960
    while left:
        count = min(pace.room(now_s), left)
        if count:
            pace.record_sent_bytes(count, now_s)
        left -= count
        now_s += pace.wait_s(now_s)
    assert now_s == pytest.approx(1.0, abs=0.011)


def test_a_line_that_rested_does_not_save_up_for_later() -> None:
    pace = LinePace(9600)
    pace.record_sent_bytes(9, 0.0)
    assert pace.room(0.001) == 0
    assert pace.room(1000.0) == 9
