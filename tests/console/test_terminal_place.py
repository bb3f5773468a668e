"""Where a terminal is: what SSH tells of it, and what a console signs, so that the others know (rule R4)."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import pytest

from console.session.station.owning import Owning
from console.session.terminal_place import UNKNOWN, remote_client, signed_host
from console.text.catalogue import load
from console.tui.frame import observing
from drivers.lathe.ownership import BYTES
from drivers.lathe.standing import BY_SSH
from drivers.simulator.machine import SimulatedLathe
from profiles.store import load_machine
from tests.console.consoles import MACHINE, station_of
from tests.console.test_who_controls import looks


@pytest.mark.parametrize(
    ("environment", "client"),
    [
        ({}, ""),
        ({"SSH_CONNECTION": "192.168.1.7 51234 192.168.1.2 22"}, "192.168.1.7"),
        ({"SSH_CLIENT": "192.168.1.7 51234 22", "SSH_TTY": "/dev/pts/3"}, "192.168.1.7"),
        ({"SSH_CONNECTION": "fe80::1%eth0 51234 fe80::2%eth0 22"}, "fe80::1"),
        ({"SSH_CONNECTION": "::ffff:10.0.0.9 51234 ::ffff:10.0.0.1 22"}, "10.0.0.9"),
        # From the computer itself: whoever sits there, sits there.
        ({"SSH_CONNECTION": "127.0.0.1 51234 127.0.0.1 22", "SSH_TTY": "/dev/pts/3"}, ""),
        ({"SSH_CONNECTION": "::1 51234 ::1 22"}, ""),
        ({"SSH_CONNECTION": "::ffff:127.0.0.1 51234 ::ffff:127.0.0.1 22"}, ""),
        ({"SSH_TTY": "/dev/pts/3"}, UNKNOWN),
        ({"SSH_CONNECTION": "nonsense"}, UNKNOWN),
    ],
)
def test_a_terminal_is_here_or_where_ssh_comes_from(environment: dict[str, str], client: str) -> None:
    assert remote_client(environment) == client


def test_what_is_signed_fits_and_tells_ssh_from_a_computer() -> None:
    assert signed_host("", "lathe2") == "lathe2"
    assert signed_host("192.168.100.107", "lathe2") == "192.168.100.107"
    assert signed_host("2001:db8:85a3::8a2e:370:7334", "lathe2") == signed_host(UNKNOWN, "lathe2") == BY_SSH
    assert len("192.168.100.107") <= BYTES


@pytest.mark.parametrize(
    ("client", "shown"),
    [
        ("192.168.100.107", "kim from 192.168.100.107 by SSH has control"),
        (UNKNOWN, "kim from ? by SSH has control"),
    ],
)
def test_an_observer_is_shown_where_the_terminal_in_control_comes_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, client: str, shown: str
) -> None:
    begin = Owning.__init__

    def far(self: Owning, *given: object, **named: object) -> None:
        begin(self, *given, **(named | ({"client": client} if named.get("name") == "kim" else {})))  # type: ignore[arg-type]

    monkeypatch.setattr(Owning, "__init__", far)
    sim = SimulatedLathe(load_machine(MACHINE).machine)
    station_of(sim, tmp_path / "here", name="kim")
    lee = station_of(sim, tmp_path / "there", name="lee")
    looks(lee)
    assert shown in observing(load("en"), lee.state, datetime.now(UTC))
