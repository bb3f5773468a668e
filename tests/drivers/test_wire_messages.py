"""What programs say unasked: SEND, CMD, their errors, and I62 and I64."""

from __future__ import annotations

import pytest

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from profiles.machine import MachineProfile
from tests.drivers.wire_card import Wire, wire


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    dialect: Dialect = request.param
    made = wire(machine, dialect)
    made.tell("#1J/ #2J/ #3J/")
    return made


def run(card: Wire, *lines: str, seconds: float = 0.1) -> bytes:
    """Run a program and return what the host hears while it runs."""
    card.tell("OPEN PROG1 CLEAR", *lines, "CLOSE", "&1B1R")
    card.sim.wait(seconds)
    return card.port.take_output()


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ("I62=0 I64=0", b"Hello; you\r"),
        ("I62=1 I64=0", b"Hello; you"),
        ("I62=0 I64=1", b"\x02Hello; you\r"),
        ("I62=1 I64=1", b"\x02Hello; you"),
    ],
)
def test_send_tells_a_text_without_an_acknowledgement(card: Wire, settings: str, said: bytes) -> None:
    card.tell(settings)
    assert run(card, 'SEND"Hello; you"') == said


@pytest.mark.parametrize(("i3", "said"), [(0, b"Hi\r"), (1, b"\nHi\r"), (2, b"Hi\r"), (3, b"\nHi\r")])
def test_send_follows_the_handshake_but_for_the_acknowledgement(card: Wire, i3: int, said: bytes) -> None:
    card.tell("OPEN PROG1 CLEAR", "DWELL20", 'SEND"Hi"', "CLOSE", "&1B1R")
    card.raw(f"I3={i3}\r")
    card.sim.wait(0.1)
    assert card.port.take_output() == said


def test_every_host_hears_a_message(card: Wire) -> None:
    other = card.sim.connect()
    assert run(card, 'SENDP"one"', 'SEND"two"') == b"one\rtwo\r"
    assert other.take_output() == b"one\rtwo\r"


def test_a_message_comes_between_two_replies_and_never_inside_one(card: Wire) -> None:
    card.tell("OPEN PROG1 CLEAR", "WHILE(P1<20)", "P1=P1+1", 'SEND"*"', "DWELL7", "ENDWHILE", "CLOSE", "&1B1R")
    said = b""
    for _ in range(60):
        card.port.receive(b"Q1..3\r")
        card.sim.wait(0.005)
        said += card.port.take_output()
    assert said.count(b"*\r") == 20
    assert said.replace(b"*\r", b"") == b"0\r0\r0\r\x06" * 60


def test_cmd_executes_a_command_in_the_background_with_addresses_of_its_own(card: Wire) -> None:
    """Motor 2 was addressed by the host; the command jogs motor 1's neighbour 3 and then asks #1."""
    card.tell("#2")
    assert run(card, 'CMD"#3J=100"', 'CMD"P5=7"', 'CMD"#1P"') == b""
    card.settle()
    assert card.ask("P5 # #3P") == ["7", "2", "100"]


def test_cmd_with_a_port_tells_its_answer_without_an_acknowledgement(card: Wire) -> None:
    card.tell("P5=25 P6=50")
    assert run(card, 'CMDS"P5..6"', 'CMD"P5"') == b"25\r50\r"


@pytest.mark.parametrize(("i6", "said"), [(0, b"\x07"), (1, b"\x07ERR003\r"), (2, b""), (3, b"\x07\rERR003\r")])
def test_an_error_of_a_program_is_told_unless_i6_is_2(card: Wire, i6: int, said: bytes) -> None:
    card.tell("OPEN PROG1 CLEAR", "DWELL20", 'CMD"UUU"', "CLOSE", "&1B1R")
    card.raw(f"I6={i6}\r")
    card.sim.wait(0.1)
    assert card.port.take_output() == said


def test_cmd_with_a_control_character(card: Wire) -> None:
    run(card, "CMD^K", "DWELL10")
    assert not any(motor.enabled for motor in card.card.motors.values())


def test_a_program_starts_another_coordinate_system(card: Wire) -> None:
    card.tell("#3->0", "&2 #3->Z", "OPEN PROG2 CLEAR", "INC TA10 TS0 TM50 Z30", "CLOSE")
    run(card, 'CMD"&2B2R"', "DWELL10")
    card.settle()
    assert card.ask("#3P") == ["30"]


def test_a_flood_of_messages_does_not_stop_the_card(card: Wire) -> None:
    card.tell("OPEN PROG1 CLEAR", "WHILE(1=1)", 'SEND"0123456789"', 'CMDS"P1..3"', "ENDWHILE", "CLOSE", "&1B1R")
    card.sim.wait(1.0)
    assert card.raw("\x01\x18P1\r").endswith(b"0\r\x06")


@pytest.mark.parametrize("stop", [b"\x01", b"\x0b"], ids=["control-A", "control-K"])
def test_a_stop_forgets_the_commands_that_wait(card: Wire, stop: bytes) -> None:
    """More than a background cycle has room for, and a jog behind them."""
    card.tell("OPEN PROG1 CLEAR", *['CMD"P1=P1+1"'] * 60, 'CMD"#3J+"', "CLOSE", "P1=0", "&1B1R")
    card.sim.wait(0.01)
    assert 0 < float(card.ask("P1")[0]) < 60
    card.raw(stop)
    card.sim.wait(0.5)
    assert float(card.ask("P1")[0]) < 60
    assert not card.card.motors[3].jogging
    assert card.card.motors[3].velocity == 0.0
