"""A line that moves is carried out once the controller has said its checksum: a bad cable moves nothing."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.errors import DriverError, LinkError, RefusedError
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.lathe import Lathe
from drivers.lathe.ownership import Ownership
from drivers.lathe.snapshot import AxisName
from drivers.lathe.stop import ABORT_ALL, KILL_ALL, StopPath, StoppedError
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.exchange import CHECKSUM_TIMEOUT_S
from drivers.pmac.framing import (
    ASK,
    ChecksumForm,
    FaultKind,
    LineCheck,
    checksum,
    form_of,
    format_reply,
    unmistakable,
)
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from tests.system.lathe_sites import compact

FAMILIES = ("pmac", "turbo")
every_family = pytest.mark.parametrize("family", FAMILIES)

MOTION = re.compile(rb"#\d(?:J|HM)|B\d+R")
"""What is in each line that moves or energises, and in no other."""

Damage = Callable[[bytes], bytes]


@cache
def machine_of(family: str) -> MachineProfile:
    return compact(family)


class SerialLine(MemoryLink):
    """A line that nothing checks. `damage` is what becomes of each piece of a line that moves something."""

    checks_bytes = False

    def __init__(self, sim: SimulatedLathe) -> None:
        super().__init__(sim.connect(), sim)
        self.sent: list[bytes] = []
        self.damage: Damage = lambda data: data
        self.said: Damage = lambda data: data

    def send(self, data: bytes) -> None:
        self.sent.append(data)
        super().send(self.damage(data))

    def receive(self, timeout_s: float) -> bytes:
        return self.said(super().receive(timeout_s))


@dataclass(frozen=True, kw_only=True)
class Bench:
    """A lathe at such a line, its drives on."""

    sim: SimulatedLathe
    line: SerialLine
    client: PmacClient
    stop: StopPath
    lathe: Lathe

    @property
    def commanded(self) -> list[float]:
        return [self.sim.controller.motors[number].desired for number in (1, 2, 3)]

    @contextmanager
    def unmoved(self) -> Iterator[None]:
        """Make sure that nothing moves in the block, nor in the time behind it."""
        before = self.commanded
        yield
        self.sim.wait(0.3)
        assert self.commanded == before
        assert not any(system.running for system in self.sim.controller.systems.values())


def bench(family: str, *, drives: bool = True) -> Bench:
    sim = SimulatedLathe(machine_of(family))
    line = SerialLine(sim)
    client, stop = PmacClient(line, sim), StopPath(line)
    heartbeat = Heartbeat(client, sim, machine_of(family))
    lathe = Lathe(client, machine_of(family), sim, stop, None, heartbeat, Ownership(client))
    lathe.connect()
    lathe.claim()
    lathe.verify()
    if drives:
        lathe.enable()
        client.download(["OPEN PROG 77 CLEAR", "DWELL 2000", "CLOSE"])
    line.sent.clear()
    return Bench(sim=sim, line=line, client=client, stop=stop, lathe=lathe)


HANDLERS: dict[str, Callable[[Bench], None]] = {
    "jog": lambda made: made.lathe.jog_to(AxisName.TOOL, -500.0),
    "home": lambda made: made.lathe.home(),
    "drives on": lambda made: made.lathe.enable(),
    "start": lambda made: made.lathe.program.start(77, 0.0),
}
every_order = pytest.mark.parametrize("order", list(HANDLERS))


def codes(error: pytest.ExceptionInfo[DriverError]) -> list[str]:
    return [problem.code for problem in error.value.problems]


def once(made: Bench, damage: Damage) -> list[bytes]:
    """Damage the first line that moves, and nothing behind it; return where that line is kept as it was sent."""
    met: list[bytes] = []

    def damaged(data: bytes) -> bytes:
        if met or not MOTION.search(data):
            return data
        met.append(data)
        return damage(data)

    made.line.damage = damaged
    return met


def changed(place: float, how: str, code: int) -> Damage:
    """One character of a line is another, or one more, or missing: that at this share of its length."""

    def damaged(data: bytes) -> bytes:
        text = data.rstrip(ASK + b"\r")
        at = min(int(place * len(text)), len(text) - 1)
        # Another one, and not the same again.
        other = bytes((code + (how == "another" and text[at] == code),))
        behind = data[at:] if how == "one more" else data[at + 1 :]
        return data[:at] + (b"" if how == "missing" else other) + behind

    return damaged


def text_of(met: list[bytes]) -> str:
    return met[0].rstrip(ASK).decode("ascii").rstrip()


@cache
def kept(family: str) -> Bench:
    """One lathe for many lines that move nothing."""
    return bench(family)


@pytest.mark.parametrize(("family", "order"), [*(("pmac", order) for order in HANDLERS), ("turbo", "jog")])
@settings(max_examples=25)
@given(
    place=st.floats(0.0, 1.0),
    how=st.sampled_from(["another", "one more", "missing"]),
    code=st.integers(0x20, 0x7D),
)
def test_a_line_with_one_wrong_character_moves_nothing_and_is_named(
    family: str, order: str, place: float, how: str, code: int
) -> None:
    made = kept(family)
    met = once(made, changed(place, how, code))
    with made.unmoved(), pytest.raises(RefusedError) as told:
        HANDLERS[order](made)
    assert codes(told) == ["link.line_differs"]
    assert told.value.problems[0].key == text_of(met)
    assert made.stop.reason is None
    # Nothing of it lies there any more, and nothing of it is sent again.
    assert made.client.query("P1") == ("0",)


@every_family
@every_order
def test_a_line_that_arrives_as_it_was_sent_is_carried_out_once(family: str, order: str) -> None:
    made = bench(family)
    HANDLERS[order](made)
    places = [place for place, data in enumerate(made.line.sent) if MOTION.search(data)]
    assert len(places) == (1 if order in ("jog", "start") else 3)
    for place in places:
        assert made.line.sent[place].endswith(ASK)
        assert made.line.sent[place + 1] == b"\r"


@every_family
def test_an_inserted_digit_is_told_with_both_checksums(family: str) -> None:
    made = bench(family)
    met = once(made, lambda data: data.replace(b"J=", b"J=2"))
    with made.unmoved(), pytest.raises(RefusedError) as told:
        made.lathe.jog_to(AxisName.TOOL, -500.0)
    sent = checksum(met[0])
    assert (told.value.problems[0].value, told.value.problems[0].limit) == (str((sent + 0x32) % 256), str(sent))
    assert made.client.faults.count(FaultKind.DIFFERS) == 1
    made.lathe.jog_to(AxisName.TOOL, -500.0)
    assert made.sim.controller.motors[1].desired == pytest.approx(-500.0)


@every_family
@pytest.mark.parametrize("said", [6, 7])
def test_a_wrong_checksum_that_looks_like_an_answer_is_a_wrong_checksum(family: str, said: int) -> None:
    """ACK is 6 and BEL is 7; a line that was not ended has the same one when it is asked again."""
    made = bench(family)

    def damaged(data: bytes) -> bytes:
        more = (said - checksum(data)) % 256
        return data.replace(b"J=", b"J=" + bytes((more,) if more >= 0x20 else (0x7F, more + 0x81)))

    once(made, damaged)
    with made.unmoved(), pytest.raises(RefusedError) as told:
        made.lathe.jog_to(AxisName.TOOL, -500.0)
    assert codes(told) == ["link.line_differs"]
    assert told.value.problems[0].value == str(said)
    assert made.stop.reason is None


@every_family
@pytest.mark.parametrize("stop", [ABORT_ALL, KILL_ALL])
def test_a_stop_between_a_line_and_its_end_leaves_the_line_without_an_end(family: str, stop: bytes) -> None:
    """It is sent while the checksum is waited for; what was begun is erased before anything else goes out."""
    made = bench(family)
    pressed: list[bytes] = []

    def pressing(data: bytes) -> bytes:
        if data and made.line.sent and MOTION.search(made.line.sent[-1]) and not pressed:
            pressed.append(stop)
            (made.stop.kill if stop == KILL_ALL else made.stop.stop)("test")
        return data

    made.line.said = pressing
    with made.unmoved():
        with pytest.raises(StoppedError):
            made.lathe.jog_to(AxisName.TOOL, -500.0)
        assert pressed and made.line.sent[-2:] == [made.line.sent[-2], b"\x18"]
        made.lathe.wait_for_rest()
    assert b"\r" not in made.line.sent[: made.line.sent.index(b"\x18")][-1]


@every_family
@pytest.mark.parametrize("lost", ["all", "the question"])
def test_a_checksum_that_does_not_come_leaves_the_line_without_an_end(family: str, lost: str) -> None:
    made = bench(family)
    met = once(made, lambda data: b"" if lost == "all" else data.rstrip(ASK))
    began_s = made.sim.now_s()
    with made.unmoved(), pytest.raises(RefusedError) as told:
        made.lathe.jog_to(AxisName.TOOL, -500.0)
    # A control-N alone is answered, too: of an empty line.
    assert codes(told) == ["link.line_unproven"]
    assert told.value.problems[0].key == text_of(met)
    assert made.sim.now_s() - began_s < CHECKSUM_TIMEOUT_S + 1.5
    made.lathe.jog_to(AxisName.TOOL, -500.0)


@every_family
def test_nothing_is_sent_behind_a_line_that_cannot_be_erased(family: str) -> None:
    """The line hears nothing from the damaged line on: whatever came later would be its end."""
    made = bench(family)

    def deaf(data: bytes) -> bytes:
        return b"" if b"\x18" in data else data

    once(made, lambda data: data.replace(b"J=", b"J=2"))
    first = made.line.damage
    made.line.damage = lambda data: deaf(first(data))
    with made.unmoved():
        with pytest.raises(LinkError) as told:
            made.lathe.jog_to(AxisName.TOOL, -500.0)
        assert codes(told) == ["link.line_differs", "link.not_in_step"]
        made.stop.stop("test")
        for _ in range(2):
            with pytest.raises(LinkError):
                made.lathe.snapshot()
        made.line.damage = lambda data: data
        made.lathe.snapshot()


@every_family
@pytest.mark.parametrize("end", [b"\x1d", b""])
def test_an_end_of_a_line_that_does_not_arrive_is_no_end_for_the_next_one(family: str, end: bytes) -> None:
    """With its CR lost the line waits at the controller, and so would anything that came behind it be its end."""
    made = bench(family)
    left = [b"line", b"end", b"erasing"]

    def without_end(data: bytes) -> bytes:
        if left[:1] == [b"line"] and MOTION.search(data):
            left.pop(0)
        elif left[:1] == [b"end"] and data == b"\r":
            left.pop(0)
            return end
        elif left[:1] == [b"erasing"] and data == b"\x18":
            left.pop(0)
            return b""
        return data

    made.line.damage = without_end
    with made.unmoved():
        with pytest.raises(LinkError) as told:
            made.lathe.jog_to(AxisName.TOOL, -500.0)
        assert codes(told)[0] == "link.silent"
        assert left == []
        made.stop.stop("test")
        made.lathe.snapshot()


@every_family
@pytest.mark.parametrize("at", [b"-", b" #", b"#"])
def test_a_character_that_arrives_as_the_end_of_its_line_stops_the_machine(family: str, at: bytes) -> None:
    """One bit makes a CR of a minus sign: `J=` alone is a jog to where the last one was to go."""
    made = bench(family)
    once(made, lambda data: data.replace(at, b"\r" + at[1:], 1))
    with pytest.raises(LinkError) as told:
        made.lathe.jog_to(AxisName.TOOL, -500.0)
    assert codes(told) == ["link.line_in_part"]
    assert not isinstance(told.value, RefusedError)
    assert made.lathe.wait_for_rest().at_rest


@every_family
def test_a_character_that_starts_a_program_by_itself_stops_the_machine(family: str) -> None:
    """One bit makes a control-R of a 2: every program runs, whatever the line was."""
    made = bench(family)
    made.client.request("&1B77")
    once(made, lambda data: data.replace(b"J=-2", b"J=-\x12"))
    with pytest.raises(LinkError) as told:
        made.lathe.jog_to(AxisName.TOOL, -250.0)
    assert codes(told) == ["link.line_in_part"]
    assert made.stop.reason == "link.line_in_part"


@every_family
def test_a_controller_that_says_no_checksum_is_worked_without_and_known_for_it(family: str) -> None:
    sim = SimulatedLathe(machine_of(family))

    class Old(SerialLine):
        def send(self, data: bytes) -> None:
            super().send(data.replace(ASK, b""))

    line = Old(sim)
    client, stop = PmacClient(line, sim), StopPath(line)
    lathe = Lathe(client, machine_of(family), sim, stop)
    lathe.connect()
    assert client.line_check is LineCheck.NOBODY
    assert client.query("P1") == ("0",)
    lathe.verify()
    lathe.enable()
    lathe.jog_to(AxisName.TOOL, -500.0)
    assert not any(ASK in data for data in line.sent[10:])


def test_who_checks_a_line_is_told_by_the_link_and_by_the_controller() -> None:
    assert bench("pmac", drives=False).client.line_check is LineCheck.CONTROLLER
    sim = SimulatedLathe(machine_of("pmac"))
    client = PmacClient(MemoryLink(sim.connect(), sim), sim)
    client.connect()
    assert client.line_check is LineCheck.NETWORK


@pytest.mark.parametrize(("before", "behind"), [(b"", b""), (b"", b"\r"), (b"", b"\r\x06"), (b"\n", b"\r\n")])
@pytest.mark.parametrize("digits", [False, True])
def test_every_way_to_word_a_checksum_is_learned_from_one(digits: bool, before: bytes, behind: bytes) -> None:
    form = ChecksumForm(digits=digits, before=before, after=behind)
    assert form_of(form.answer(b"P1001"), b"P1001") == form
    assert form.answer(b"J+") == before + (b"117" if digits else b"u") + behind


@pytest.mark.parametrize("said", [b"", b"\x07ERR003\r", b"P1001\x0e", b"\x13", b"19\r", b"x\x12"])
def test_what_is_no_checksum_is_none(said: bytes) -> None:
    assert form_of(said, b"P1001") is None


@pytest.mark.parametrize("digits", [False, True])
def test_a_controller_that_words_its_checksums_otherwise_is_understood(digits: bool) -> None:
    """Digits, an end of line and an acknowledgement: nothing of a line is carried out by what it says so."""
    sim = SimulatedLathe(machine_of("pmac"))
    line = SerialLine(sim)

    def worded(data: bytes) -> bytes:
        if not data or not line.sent[-1].endswith(ASK):
            return data
        (value,) = data
        return (b"%d" % value if digits else data) + b"\r\x06"

    line.said = worded
    client, stop = PmacClient(line, sim), StopPath(line)
    lathe = Lathe(client, machine_of("pmac"), sim, stop)
    lathe.connect()
    assert client.line_check is LineCheck.CONTROLLER
    lathe.verify()
    lathe.enable()
    lathe.jog_to(AxisName.TOOL, -500.0)
    made = Bench(sim=sim, line=line, client=client, stop=stop, lathe=lathe)
    once(made, lambda data: data.replace(b"J=", b"J=2"))
    with made.unmoved(), pytest.raises(RefusedError):
        lathe.jog_to(AxisName.TOOL, 500.0)


@given(st.text(st.sampled_from("#123J=-05 B&R"), min_size=1).map(str.encode))
def test_no_checksum_can_be_taken_for_anything_else_that_is_said(line: bytes) -> None:
    whole = unmistakable(line)
    assert whole.rstrip() == line.rstrip()
    assert checksum(whole) not in (0, 2, 6, 7, 10, 13)


def test_a_checksum_is_shown_as_a_number_and_one_like_an_ack_is_avoided() -> None:
    line = b"#3J=900000"
    assert checksum(line) == 6
    assert unmistakable(line) == line + b" "
    assert [format_reply(each) for each in (b"u", b"117\r", b"7", b"\x06\0")] == ["117", "117", "55", "6 0"]
