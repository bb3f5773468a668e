"""Addresses of serial lines, as an operator writes them, and links that cannot be opened."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import LinkError
from drivers.link.address import SerialAddress, TcpAddress, parse_address
from drivers.link.serial import SerialLink

BY_PATH = "/dev/serial/by-path/pci-0000:00:14.0-usb-0:1:1.0-port0"


@pytest.mark.parametrize(
    ("text", "device", "baud_rate"),
    [
        ("serial:/dev/ttyUSB0", "/dev/ttyUSB0", 38_400),
        ("serial:/dev/ttyUSB0:38400", "/dev/ttyUSB0", 38_400),
        ("serial:/dev/ttyS1:9600", "/dev/ttyS1", 9600),
        ("serial:/dev/pts/7", "/dev/pts/7", 38_400),
        (f"serial:{BY_PATH}", BY_PATH, 38_400),
        (f"serial:{BY_PATH}:115200", BY_PATH, 115_200),
    ],
)
def test_a_serial_address_is_read(text: str, device: str, baud_rate: int) -> None:
    assert parse_address(text) == SerialAddress(device=device, baud_rate=baud_rate)


def test_a_serial_address_is_written_as_short_as_it_can_be() -> None:
    assert str(SerialAddress(device="/dev/ttyUSB0")) == "serial:/dev/ttyUSB0"
    assert str(SerialAddress(device="/dev/ttyUSB0", baud_rate=9600)) == "serial:/dev/ttyUSB0:9600"


@given(
    st.text(st.characters(codec="ascii", exclude_characters=" /", categories=["L", "N", "P", "S"]), min_size=1),
    st.integers(1, 4_000_000),
)
def test_what_is_written_is_read_back(name: str, baud_rate: int) -> None:
    address = SerialAddress(device=f"/dev/{name.rstrip(':')}x", baud_rate=baud_rate)
    assert parse_address(str(address)) == address


def test_a_tcp_address_is_still_one() -> None:
    assert parse_address("tcp:lathe:1025") == TcpAddress(host="lathe", port=1025)


@pytest.mark.parametrize(
    "text",
    [
        "serial",
        "serial:",
        "serial:ttyUSB0",
        "serial:COM3",
        "serial:/",
        "serial:/dev/",
        "serial:/dev/ttyUSB0:",
        "serial:/dev/ttyUSB0::9600",
        "serial:/dev/ttyUSB0:0",
        "serial:/dev/ttyUSB0:4000001",
        "serial:/dev/ttyUSB0:" + "9" * 5000,
        "serial:/dev/tty USB0",
        "serial:/dev/tty\x1bUSB0",
        "serial::9600",
        "tcp:host:" + "9" * 5000,
        "usb:/dev/ttyUSB0",
    ],
)
def test_a_text_that_is_no_serial_address_is_refused(text: str) -> None:
    with pytest.raises(LinkError) as refused:
        parse_address(text)
    assert refused.value.problems[0].code == "link.bad_address"


def test_a_device_that_is_missing_or_no_serial_line_is_told_with_its_reason(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    reasons = {}
    for name in ("missing", "file", "."):
        with pytest.raises(LinkError) as refused:
            SerialLink(SerialAddress(device=str(tmp_path / name)))
        (problem,) = refused.value.problems
        assert (problem.code, problem.where) == ("link.no_device", f"serial:{tmp_path / name}")
        reasons[name] = problem.value
    assert reasons["missing"] == "No such file or directory"
    assert reasons["."] == "Is a directory"
    assert "ioctl" in reasons["file"]
