"""SAVE: how long it takes, what is kept, and what a reset brings back."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from drivers.errors import ControllerError, LinkTimeoutError
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.saving import LONGEST_SAVE_S, SAVE_S, SAVE_TIMEOUT_S, saves
from drivers.simulator.hosts.ethernet import Board, EthernetSession
from drivers.simulator.hosts.port import Port
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from profiles.problem import ProfileError
from tests.drivers.wire_card import CYCLE_S, DOWN, Wire, wire, wire_board

BOTH = pytest.mark.parametrize("dialect", [PMAC, TURBO], ids=lambda dialect: dialect.name)


def say(card: Wire, line: bytes) -> bytes:
    """Send a line, and return what comes within the next background cycle."""
    card.port.receive(line + b"\r")
    card.sim.wait(2 * CYCLE_S)
    return card.port.take_output()


def test_the_seconds_are_within_what_manuals_and_clients_say() -> None:
    assert 3.0 < SAVE_S < 6.0, "twice the patience of a public client, once is not enough"
    assert SAVE_S < LONGEST_SAVE_S < SAVE_TIMEOUT_S


@BOTH
def test_for_its_seconds_the_card_answers_nobody(machine: MachineProfile, dialect: Dialect) -> None:
    card = wire(machine, dialect)
    other = card.sim.connect()
    assert say(card, b"SAVE P1") == b""
    began_s = card.sim.now_s()
    other.receive(b"P2\r\x10")
    card.sim.wait(SAVE_S - 0.1)
    assert card.port.take_output() + other.take_output() == b""
    card.sim.wait(0.2)
    assert card.port.take_output() == b"0\r\x06"
    first, second = other.take_output().split(b"\r", 1)
    assert len(first.split()) == 8, "a control character comes before the lines"
    assert second == b"0\r\x06"
    assert 0.0 < card.sim.now_s() - began_s - SAVE_S < 0.2


def counted(card: Wire, number: int) -> float:
    return card.card.variables.get(VariableKind.P, number)


def test_servo_and_plc_0_continue_and_the_background_waits(machine: MachineProfile) -> None:
    card = wire(machine)
    card.tell("I5=3")
    for number in (0, 1):
        card.tell(f"OPEN PLC {number} CLEAR", f"P{number}=P{number}+1", "CLOSE", f"ENABLE PLC {number}")
    card.tell("#1J+")
    card.sim.wait(0.1)
    assert say(card, b"SAVE") == b""
    motor = card.card.motors[1]
    scans, interrupts, place = counted(card, 1), counted(card, 0), motor.position
    card.sim.wait(1.0)
    assert counted(card, 1) == scans
    assert counted(card, 0) > interrupts + 500
    assert abs(motor.position - place) > 1000.0
    card.sim.wait(SAVE_S)
    assert counted(card, 1) > scans


def test_a_stop_that_comes_meanwhile_waits_too(machine: MachineProfile) -> None:
    """The manuals: not while the machine is in operation."""
    card = wire(machine)
    card.tell("#1J+")
    assert say(card, b"SAVE") == b""
    card.port.receive(b"\x01")
    card.sim.wait(SAVE_S - 0.1)
    assert card.card.motors[1].velocity != 0.0
    card.sim.wait(2.0)
    assert card.card.motors[1].velocity == 0.0


def test_what_cannot_be_written_is_refused_at_once(machine: MachineProfile, tmp_path: Path) -> None:
    card = wire(machine, saved=tmp_path / "missing" / "saved.json")
    assert card.raw(b"SAVE\r") == b"\x07ERR006\r"


def test_a_client_of_the_board_gets_one_nul_and_no_acknowledgement_afterwards(machine: MachineProfile) -> None:
    board = wire_board(machine)
    assert board.response(b"I3=2 I6=1") == b"\x06"
    other = EthernetSession(board.sim, board.sim.connect(), Board())
    assert board.response(b"P1=7 SAVE") == b"\x00"
    assert board.response(b"P1") == b"7\r\x06"
    assert other.turn() == []


def test_a_client_of_the_board_that_polls_gets_nul_and_then_its_answer(machine: MachineProfile) -> None:
    board = wire_board(machine)
    assert board.response(b"I3=2 I6=1") == b"\x06"
    begun_s = board.sim.now_s()
    assert board.ask(DOWN, 0xB0, b"P1=7 SAVE") == b"@"
    board.sim.wait(0.1)
    assert [board.fetched() for _ in range(3)] == [b"\x00"] * 3
    assert board.sim.now_s() - begun_s < 1.0
    assert board.response(b"P1") == b"7\r\x06"
    assert board.sim.now_s() - begun_s > 3.0


@dataclass(kw_only=True)
class BoardLine:
    """The end of a line at a board: over a SAVE it says NUL, at once or when the card is there again."""

    port: Port
    at_once: bool
    sent: bytes = b""
    _said: list[bytes] = field(default_factory=list)

    def receive(self, data: bytes) -> None:
        self.sent += data
        if b"SAVE" in data and self.at_once:
            self._said.append(b"\0")
        self.port.receive(data)

    def take_output(self) -> bytes:
        said = self.port.take_output()
        if said == b"\x06" and self.sent.endswith(b"SAVE\r"):
            said = b"" if self.at_once else b"\0"
        return self._said.pop(0) if self._said else said


@BOTH
@pytest.mark.parametrize("at_once", [False, True], ids=["after it", "at once"])
def test_a_nul_is_no_failure(machine: MachineProfile, dialect: Dialect, at_once: bool) -> None:
    sim = SimulatedLathe(machine, dialect=dialect)
    line = BoardLine(port=sim.connect(), at_once=at_once)
    client = PmacClient(MemoryLink(line, sim), sim)
    client.connect()
    faults = client.faults.total
    assert client.request("SAVE") == ()
    assert client.in_step
    assert client.faults.total == faults
    assert client.request("P1=3") == ()
    assert client.query("P1") == ("3",)
    assert line.sent.count(b"SAVE") == 1


@BOTH
def test_a_client_of_the_line_waits_for_the_acknowledgement(machine: MachineProfile, dialect: Dialect) -> None:
    sim = SimulatedLathe(machine, dialect=dialect)
    client = PmacClient(MemoryLink(sim.connect(), sim), sim)
    client.connect()
    began_s = sim.now_s()
    assert client.request("SAVE", timeout_s=2.0) == ()
    assert SAVE_S <= sim.now_s() - began_s < SAVE_S + 0.1
    assert client.faults.total == 0


def test_a_refusal_and_a_card_that_stays_away_are_told(machine: MachineProfile) -> None:
    sim = SimulatedLathe(machine)
    line = BoardLine(port=sim.connect(), at_once=True)
    client = PmacClient(MemoryLink(line, sim), sim)
    client.connect()
    line.at_once = False
    with pytest.raises(ControllerError):
        client.request("SAVE XYZ=")
    line.at_once = True
    sim.lines.hung = True
    with pytest.raises(LinkTimeoutError) as lost:
        client.request("SAVE")
    assert lost.value.problems[0].code == "link.not_in_step"


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("SAVE", True),
        ("p1=1 sa ve", True),
        ('CMD"SAVE"', False),
        ("P1 ; SAVE", False),
        ("SAVED", False),
        ("V", False),
    ],
)
def test_which_lines_save(line: str, expected: bool) -> None:
    assert saves(line) is expected


# SAVE, $$$ and $$$***: what is kept, what comes back, and what is on the disk.

SPEAK = "I3=2 I4=0 I6=1\r"


def reset(card: Wire, word: str = "$$$") -> None:
    card.raw(f"{word}\r")
    card.raw(f"\x18{SPEAK}")


def set_up(card: Wire) -> None:
    card.tell("I116=77.125", "M5->X:$700,4,8,S", "#3->0", "&2 #3->0.5A-7", "OPEN PLC 4 CLEAR", "P1=P1+1", "CLOSE")
    card.tell("OPEN PROG 5 CLEAR", "WHILE(P1<3)", "X(SIN(P1)/3) F1.1", "ENDWHILE", "CLOSE")


def check(card: Wire) -> None:
    assert card.ask("I116 M5-> LIST PLC 4 &2#3->&1") == ["77.125", "X:$700,4,8,S", "P1=P1+1", "RET", "0.5A-7"]
    assert card.listed("PROG 5") == ["WHILE(P1<3)", "X(SIN(P1)/3)F1.1", "ENDWHILE"]


def test_what_was_saved_comes_back_with_a_reset(card: Wire) -> None:
    set_up(card)
    card.tell(
        "SAVE", "I116=1", "M5->*", "&2 UNDEFINE", "DELETE PROG 5", "DELETE PLC 4", "OPEN PROG 6 CLEAR", "CLOSE"
    )
    reset(card)
    check(card)
    assert card.refusal("LIST PROG 6") == 3


def test_without_save_a_reset_brings_the_settings_of_the_machine(card: Wire) -> None:
    before = card.ask("I116 #1->")
    card.tell("I116=77", "#1->7X")
    reset(card)
    assert card.ask("I116 #1->") == before


def test_a_reset_sets_handshake_and_errors_back(card: Wire) -> None:
    """The machine's profile has I3=2 and I6=1; what was saved here is I3=0 and I6=0."""
    card.raw("I3=0 I6=0\rSAVE\rI3=2 I6=1\r")
    assert card.raw("$$$\r") == b""
    assert card.raw("UUU\rP1\r") == b"\x070\r"


def test_variables_keep_their_values_through_a_reset(card: Wire) -> None:
    card.tell("P1=1", "Q2=2", "M3=3")
    reset(card)
    assert card.ask("P1 Q2 M3") == ["1", "2", "3"]


def test_the_factory_knows_nothing_of_what_was_saved(card: Wire) -> None:
    set_up(card)
    card.tell("SAVE")
    reset(card, "$$$***")
    assert card.ask("I116 M5-> #3->") == ["32", "*", "0"]
    assert card.refusal("LIST PROG 5") == 3
    assert card.refusal("LIST PLC 4") == 3
    reset(card)
    check(card)


def test_a_saved_file_outlives_the_process(machine: MachineProfile, tmp_path: Path) -> None:
    path = tmp_path / "saved.json"
    first = wire(machine, saved=path)
    set_up(first)
    assert not path.exists()
    first.tell("PASSWORD=secret", "SAVE")
    second = wire(machine, saved=path)
    assert second.refusal("LIST PLC 4") == 2
    second.tell("PASSWORD=secret")
    check(second)
    assert second.card.programs == first.card.programs
    assert second.ask("I0..1023") == first.ask("I0..1023")
    assert [entry.name for entry in tmp_path.iterdir()] == ["saved.json"]


def test_saved_settings_decide_which_loops_are_closed_at_a_reset(card: Wire) -> None:
    """Ix80 (Software Reference): bit 0 closes the loop at power-up and reset."""
    card.tell("I180=1 I280=1 I380=0", "SAVE", "I180=0 I280=0 I380=1")
    reset(card)
    assert [card.card.motors[number].enabled for number in (1, 2, 3)] == [True, True, False]
    assert card.card.motors[1].amplifier_enabled


def test_saved_settings_decide_which_loops_a_new_process_closes(machine: MachineProfile, tmp_path: Path) -> None:
    path = tmp_path / "saved.json"
    wire(machine, saved=path).tell("I180=1 I280=1", "SAVE")
    again = wire(machine, saved=path)
    assert [again.card.motors[number].enabled for number in (1, 2, 3)] == [True, True, False]
    again.tell("#1J=100")
    again.settle()
    assert again.ask("#1P") == ["100"]


def test_saved_gains_hold_in_a_new_process(machine: MachineProfile, tmp_path: Path) -> None:
    path = tmp_path / "saved.json"
    first = wire(machine, saved=path)
    first.tell("I130=0", "SAVE")
    second = wire(machine, saved=path)
    for card in (first, second):
        card.tell("#1J/", "#1J=100")
        card.sim.wait(1.0)
    assert first.ask("#1P") == second.ask("#1P") == ["0"]


def test_the_axes_that_were_saved_can_be_moved(machine: MachineProfile, tmp_path: Path) -> None:
    path = tmp_path / "saved.json"
    first = wire(machine, saved=path)
    first.tell("#2->0", "#2->10Y", "SAVE")
    second = wire(machine, saved=path)
    second.tell("#1J/ #2J/ #3J/", "OPEN PROG1 CLEAR", "TA10 TS0 TM100 INC Y5", "CLOSE", "B1R")
    second.settle()
    assert second.ask("#2P") == ["50"]


@pytest.mark.parametrize(
    "content", [b"", b"{", b"[]", b"\xff", b'{"family": "pmac"}', b'{"family": "turbo", "settings": {}}', b"null"]
)
def test_a_file_of_something_else_is_left_alone(machine: MachineProfile, tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "saved.json"
    path.write_bytes(content)
    with pytest.raises(ProfileError) as refused:
        wire(machine, saved=path)
    assert refused.value.problems[0].code == "file.unreadable"
    assert path.read_bytes() == content


def test_a_file_with_a_line_that_is_no_program_is_refused(machine: MachineProfile, tmp_path: Path) -> None:
    path = tmp_path / "saved.json"
    card = wire(machine, saved=path)
    card.tell("SAVE")
    table = json.loads(path.read_bytes())
    table["programs"] = {"1": ["X<3"]}
    path.write_text(json.dumps(table), encoding="ascii")
    with pytest.raises(ProfileError):
        wire(machine, saved=path)


def test_a_file_of_another_family_is_refused(machine: MachineProfile, tmp_path: Path) -> None:
    path = tmp_path / "saved.json"
    wire(machine, TURBO, path).tell("SAVE")
    with pytest.raises(ProfileError) as refused:
        wire(machine, PMAC, path)
    assert "turbo" in str(refused.value.problems[0].value)
    assert wire(machine, TURBO, path).ask("I8191") == ["$0"]


def test_a_save_that_cannot_be_written_changes_nothing(machine: MachineProfile, tmp_path: Path) -> None:
    folder = tmp_path / "gone"
    card = wire(machine, saved=folder / "saved.json")
    card.tell("I116=55")
    assert card.refusal("SAVE") == 6
    reset(card)
    assert card.ask("I116") == ["500"]
