"""Addresses of links, and the replies that lines may have."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import LinkError
from drivers.link.address import (
    EthernetAddress,
    LinkAddress,
    SerialAddress,
    SimulatedAddress,
    TcpAddress,
    parse_address,
    parse_host_port,
)
from drivers.pmac.expected_replies import ExpectedReplies, expected_replies, number_of, opens_buffer
from profiles.machine import MachineProfile
from tests.drivers.wire_card import Wire, wire

QUESTIONS = (
    ("P1", 1),
    ("p1 q2 M3 I4", 4),
    ("P1..3", 3),
    ("P1,3,2", 3),
    ("I10 P1..20", 21),
    ("#1P F ? #2P F ? #3P F ? &1??", 10),
    ("I65???&1??%#1?PVF m190 p99", 10),
    ("#1PVF", 3),
    ("#1->", 1),
    ("#1-> #1?", 2),
    ("M0..9->", 10),
    ("VERSION TYPE", 2),
    ("VER", 1),
    ("#1", 0),
    ("", 0),
)
COMMANDS = (
    ("P1=25 P2=50", 0),
    ("I3=2 I4=0 I6=1 I64=1 P1001=7 P1001", 1),
    ("P1=3 P4", 1),
    ("P1= -0.5", 0),
    ("P1=$F0", 0),
    ("I20..24=0", 0),
    ("I130=*", 0),
    ("M5->Y:$FFC2,8", 0),
    ("M5->*", 0),
    ("#1J/ #2J/ #3J/", 0),
    ("#1J=100", 0),
    ("#1J:-300", 0),
    ("#1J+", 0),
    ("#1J-", 0),
    ("#1J/", 0),
    ("K", 0),
    ("%100", 0),
    ("DEFINE GATHER 100", 0),
    ("DELETE GATHER", 0),
    ("DISABLE PLC 1..3", 0),
    ("OPEN PROG 1 CLEAR", 0),
    ("CLOSE", 0),
)
UNCERTAIN = ("UUU", "P1=P2+3", "P1=3&1", "J=100^50", "X10", "#1->X", "SAVE", "$$$", "LIST PROG 1 #1J+")


@pytest.fixture(scope="module")
def asked(machine: MachineProfile) -> Wire:
    return wire(machine)


@pytest.mark.parametrize(("line", "lines"), QUESTIONS)
def test_a_question_has_the_lines_of_the_card_and_changes_nothing(card: Wire, line: str, lines: int) -> None:
    assert expected_replies(line) == ExpectedReplies(lines, reads_only=True)
    assert len(card.ask(line)) == lines


@pytest.mark.parametrize(("line", "lines"), COMMANDS)
def test_a_command_has_the_lines_of_the_card_and_is_no_question(card: Wire, line: str, lines: int) -> None:
    assert expected_replies(line) == ExpectedReplies(lines, reads_only=False)
    assert len(card.ask(line)) == lines


@pytest.mark.parametrize("line", UNCERTAIN)
def test_of_what_is_not_certain_nothing_is_said(line: str) -> None:
    assert expected_replies(line) == ExpectedReplies(None, reads_only=False)


@pytest.mark.parametrize(
    "line", ["P1,5", "LIST PROG 3", "LIST PROG1,0,5", "LIST PLC 20", "LIST GATHER 0,256", "#1LIST COMP"]
)
def test_what_lists_may_have_any_length_and_may_be_asked_again(line: str) -> None:
    assert expected_replies(line) == ExpectedReplies(None, reads_only=True)


MOVES = st.sampled_from(
    ["#1J+", "#2J/", "&1R", "&1B3R", "#1HM", "A", "K", "#1J=5", "P1=2", "M26=1", "I5111=677", "S"]
)


@given(
    st.lists(st.sampled_from([line for line, _ in QUESTIONS]), max_size=3),
    MOVES,
    st.lists(st.sampled_from([line for line, _ in QUESTIONS]), max_size=3),
    st.sampled_from(["", " "]),
)
def test_a_line_with_a_command_anywhere_in_it_is_never_asked_twice(
    before: list[str], move: str, after: list[str], gap: str
) -> None:
    assert not expected_replies(gap.join([*before, move, *after])).reads_only


PIECES: tuple[str, ...] = (
    "P",
    "V",
    "F",
    "R",
    "S",
    "J",
    "A",
    "K",
    "H",
    "PE",
    "?",
    "??",
    "#1",
    "&1",
    "%",
    "P1",
    "Q2",
    "I3",
    "M4",
    "..",
    ",",
)
PIECES += (
    "5",
    "=",
    "->",
    "-",
    "+",
    "/",
    " ",
    "LIST",
    "PROG",
    "PC",
    "COMP",
    "VER",
    "TYPE",
    "RX",
    "$10",
    "X",
    "B",
    "100",
)


def state_of(card: Wire) -> object:
    controller = card.card
    moving = [motor.jogging or motor.enabled for motor in controller.motors.values()]
    running = [(system.running, system.program_number) for system in controller.systems.values()]
    variables = controller.variables
    return moving, running, dict(variables.settings()), dict(variables.pointers), controller.open_buffer


@given(line=st.lists(st.sampled_from(PIECES), max_size=6).map("".join))
def test_what_is_called_a_question_changes_nothing_and_has_as_many_lines(asked: Wire, line: str) -> None:
    expected = expected_replies(line)
    if not expected.reads_only:
        return
    before = state_of(asked)
    said = asked.raw(line + "\r")
    assert state_of(asked) == before
    if expected.lines is not None and said.endswith(b"\x06"):
        assert said.count(b"\r") == expected.lines


@pytest.mark.parametrize(
    ("line", "opens"),
    [
        ("OPEN PROG 1 CLEAR", True),
        ("openplc3", True),
        ("CLOSE OPEN PROG1", True),
        ("CLOSE", False),
        ("X10 CLS", False),
        ("OPEN PROG 1 CLEAR CLOSE", False),
        ('SEND"OPEN PROG"', None),
        ("P1=3", None),
    ],
)
def test_whether_a_buffer_is_open_behind_a_line(line: str, opens: bool | None) -> None:
    assert opens_buffer(line) is opens


@pytest.mark.parametrize(
    ("text", "number"),
    [("25", 25), (" -0.5 ", -0.5), ("$C000", 49152), ("I125=49152", 49152), ("I125=$C000", 49152)],
)
def test_a_variable_is_read_in_each_form_of_the_report(text: str, number: float) -> None:
    assert number_of(text) == number


# Link addresses, as an operator writes them.

BY_PATH = "/dev/serial/by-path/pci-0000:00:14.0-usb-0:1:1.0-port0"

hosts = st.one_of(
    st.from_regex(r"[a-z]([a-z0-9-]{0,20}[a-z0-9])?(\.[a-z]{2,5})?", fullmatch=True), st.ip_addresses().map(str)
)
ports = st.integers(1, 65_535)
names = st.text(st.characters(codec="ascii", exclude_characters=" /", categories=["L", "N", "P", "S"]), min_size=1)
devices = names.filter(lambda name: not name.endswith(":")).map(lambda name: f"/dev/{name}")
addresses = st.one_of(
    st.builds(TcpAddress, host=hosts, port=ports),
    st.builds(EthernetAddress, host=hosts, port=ports, reserves_stop=st.booleans()),
    st.builds(SerialAddress, device=devices, baud_rate=st.integers(1, 4_000_000)),
    st.builds(SimulatedAddress),
)


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("serial:/dev/ttyUSB0", SerialAddress(device="/dev/ttyUSB0", baud_rate=38_400)),
        ("serial:/dev/ttyS1?baud=9600", SerialAddress(device="/dev/ttyS1", baud_rate=9600)),
        ("serial:/dev/pts/7", SerialAddress(device="/dev/pts/7")),
        (f"serial:{BY_PATH}", SerialAddress(device=BY_PATH)),
        (f"serial:{BY_PATH}?baud=115200", SerialAddress(device=BY_PATH, baud_rate=115_200)),
        ("tcp:lathe:1025", TcpAddress(host="lathe", port=1025)),
        ("tcp:[::1]:1025", TcpAddress(host="::1", port=1025)),
        ("ethernet:192.6.94.5", EthernetAddress(host="192.6.94.5", port=1025)),
        ("ethernet:lathe:1026", EthernetAddress(host="lathe", port=1026)),
        ("ethernet:[fe80::1]", EthernetAddress(host="fe80::1", port=1025)),
        ("ethernet:lathe?stop=reserved", EthernetAddress(host="lathe", reserves_stop=True)),
        ("ethernet:[fe80::1]:9?stop=reserved", EthernetAddress(host="fe80::1", port=9, reserves_stop=True)),
        ("sim:", SimulatedAddress()),
    ],
)
def test_an_address_is_read_and_written(text: str, address: LinkAddress) -> None:
    assert parse_address(text) == address
    assert str(address) == text


@pytest.mark.parametrize(
    ("text", "shortest"),
    [("serial:/dev/ttyUSB0?baud=38400", "serial:/dev/ttyUSB0"), ("ethernet:lathe:1025", "ethernet:lathe")],
)
def test_what_is_usual_need_not_be_written(text: str, shortest: str) -> None:
    assert str(parse_address(text)) == shortest


@given(addresses)
def test_what_is_written_is_read_back(address: LinkAddress) -> None:
    assert parse_address(str(address)) == address


def test_ports_and_speeds_are_refused_where_a_link_has_none() -> None:
    assert parse_host_port("127.0.0.1:0") == TcpAddress(host="127.0.0.1", port=0)
    with pytest.raises(LinkError) as refused:
        parse_address("tcp:127.0.0.1:0")
    assert "1 <= PORT" in refused.value.problems[0].limit
    with pytest.raises(LinkError) as refused:
        parse_address("serial:/dev/ttyS1:9600")
    (problem,) = refused.value.problems
    assert (problem.code, problem.value) == ("link.bad_address", "serial:/dev/ttyS1:9600")
    assert "serial:/dev/NAME[?baud=RATE]" in problem.limit


@pytest.mark.parametrize(
    "text",
    [
        "",
        "sim",
        "sim:lathe",
        "serial",
        "serial:",
        "serial:ttyUSB0",
        "serial:COM3",
        "serial:/",
        "serial:/dev/",
        "serial:/dev/ttyUSB0:",
        "serial:/dev/ttyUSB0?",
        "serial:/dev/ttyUSB0?baud",
        "serial:/dev/ttyUSB0?baud=",
        "serial:/dev/ttyUSB0?baud=0",
        "serial:/dev/ttyUSB0?baud=-9600",
        "serial:/dev/ttyUSB0?baud=4000001",
        "serial:/dev/ttyUSB0?baud=9600&parity=odd",
        "serial:/dev/ttyUSB0?rate=9600",
        "serial:/dev/ttyUSB0?baud=" + "9" * 5000,
        "serial:/dev/tty USB0",
        "serial:/dev/tty\x1bUSB0",
        "serial:?baud=9600",
        "tcp",
        "tcp:",
        "tcp:host",
        "tcp:host:",
        "tcp::1",
        "tcp:a b:1",
        "tcp:::1:5",
        "tcp:host:65536",
        "tcp:h:-1",
        "tcp:host:" + "9" * 5000,
        "ethernet:",
        "ethernet::1025",
        "ethernet:host:0",
        "ethernet:fe80::1",
        "ethernet:a/b",
        "ethernet:host?",
        "ethernet:host?stop",
        "ethernet:host?stop=",
        "ethernet:host?stop=direct",
        "ethernet:host?stop=Reserved",
        "ethernet:host?stop=reserved:1025",
        "ethernet:host?stop=reserved?stop=reserved",
        "ethernet:host?stop=reserved&baud=9600",
        "ethernet:?stop=reserved",
        "tcp:host:1025?stop=reserved",
        "serial:/dev/ttyUSB0?stop=reserved",
        "usb:/dev/ttyUSB0",
        "udp:host:1",
    ],
)
def test_a_text_that_is_no_address_is_refused(text: str) -> None:
    with pytest.raises(LinkError) as refused:
        parse_address(text)
    assert refused.value.problems[0].code == "link.bad_address"


def test_a_simulated_lathe_differs_from_its_profile_unless_another_is_asked_for() -> None:
    """A lathe that is as its profile says would make every first part round."""
    assert parse_address("sim:") == SimulatedAddress(plant="realistic")
