"""Link addresses, as an operator writes them."""

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

BY_PATH = "/dev/serial/by-path/pci-0000:00:14.0-usb-0:1:1.0-port0"

hosts = st.one_of(
    st.from_regex(r"[a-z]([a-z0-9-]{0,20}[a-z0-9])?(\.[a-z]{2,5})?", fullmatch=True),
    st.ip_addresses().map(str),
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
    [
        ("serial:/dev/ttyUSB0?baud=38400", "serial:/dev/ttyUSB0"),
        ("ethernet:lathe:1025", "ethernet:lathe"),
    ],
)
def test_what_is_usual_need_not_be_written(text: str, shortest: str) -> None:
    assert str(parse_address(text)) == shortest


@given(addresses)
def test_what_is_written_is_read_back(address: LinkAddress) -> None:
    assert parse_address(str(address)) == address


def test_a_listener_may_leave_its_port_open_and_a_link_may_not() -> None:
    assert parse_host_port("127.0.0.1:0") == TcpAddress(host="127.0.0.1", port=0)
    with pytest.raises(LinkError) as refused:
        parse_address("tcp:127.0.0.1:0")
    assert "1 <= PORT" in refused.value.problems[0].limit


def test_a_speed_behind_a_colon_is_refused_with_the_way_to_write_it() -> None:
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
