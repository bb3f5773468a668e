"""`console retract` on a lathe at a socket: the tool out, tables that were left off, nothing without consent."""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from console.text.catalogue import load
from drivers.clock import RealClock
from drivers.link.address import TcpAddress
from drivers.link.opening import TcpLink
from drivers.pmac.client import PmacClient
from drivers.pmac.programs.cam import correction_register
from drivers.pmac.reserved import LOST, OWNER
from profiles.problem import Problem
from tests.preloaded import completed
from tests.system.run_over_link import Order, order

if TYPE_CHECKING:
    from tests.system.conftest import Serve

pytestmark = pytest.mark.system

A_CUT = 2
"""What the controller has ended when the host of a cut fell silent."""

IN_COUNTS = 20000
"""4 mm from where the tool was switched on, towards the work."""

SETTLES_COUNTS = 50.0
"""What a tool still creeps after a jog: its servo is soft."""


@pytest.fixture
def lathe(serve: Serve, tmp_path: Path) -> Iterator[tuple[Order, str, PmacClient]]:
    """A lathe whose host was lost in a cut on a cam, as another host leaves and sees it."""
    made = order(tmp_path, 1.0)
    with serve("--tcp", "127.0.0.1:0", "--machine", str(made.machine_file), "--plant", "ideal") as served:
        host, port = served.tcp
        with closing(TcpLink(TcpAddress(host=host, port=port))) as link:
            client = PmacClient(link, RealClock())
            client.connect()
            for line in ("#1J/#2J/#3J/", "#1HMZ#2HMZ#3HMZ", f"#1J={IN_COUNTS}"):
                client.request(line)
            while client.numbers("#1P", again=True)[0] < IN_COUNTS - 10.0:
                time.sleep(0.05)  # the lathe of this test runs in real time
            for line in ("I51=1", f"P{LOST}={A_CUT}"):
                client.request(line)
            yield made, f"tcp:{host}:{port}", client


def retract(made: Order, address: str, *more: str) -> subprocess.CompletedProcess[str]:
    words = ("retract", "--machine", str(made.machine_file), "--data", str(made.data), "--link", address, *more)
    return completed(words, 60.0)


def test_with_consent_the_tool_is_retracted_the_table_switched_off_and_a_tool_that_is_out_stays(
    lathe: tuple[Order, str, PmacClient],
) -> None:
    """Beyond its home there is only the end of its travel; a lathe that another console controls is left alone."""
    made, address, client = lathe
    before = client.numbers("#1P", "I51", f"P{LOST}", f"P{OWNER}")
    done = retract(made, address)
    assert done.returncode == 1 and "--yes" in done.stderr
    assert client.numbers("#1P", "I51", f"P{LOST}", f"P{OWNER}") == pytest.approx(before, abs=SETTLES_COUNTS)

    client.request(f"P{OWNER}=77")
    done = retract(made, address, "--yes")
    assert done.returncode == 1 and "77" in done.stderr
    assert client.numbers("I51", f"P{LOST}", f"P{OWNER}") == (1.0, float(A_CUT), 77.0)
    client.request(f"P{OWNER}=0")

    (at,) = client.numbers("#1P")
    done = retract(made, address, "--yes", "--json")
    assert done.returncode == 0, done.stderr
    assert "host fell silent: check tool and part" in done.stderr
    found = json.loads(done.stdout)
    assert found["ended_by_controller"] and found["tables_switched_off"]
    tool, *others = client.numbers("#1P", "I51", f"P{LOST}", f"P{OWNER}")
    machine = made.machine.tool
    out = max(at - machine.retract_mm * machine.counts_per_mm, 0.0)
    assert tool == pytest.approx(out, abs=SETTLES_COUNTS)
    assert others == [0.0, 0.0, 0.0], "tables, loss and owner"

    for line in ("#1J/", "#1J=0"):
        client.request(line)
    while abs(client.numbers("#1P", again=True)[0]) > 10.0:
        time.sleep(0.05)
    done = retract(made, address, "--yes", "--json")
    assert done.returncode == 0, done.stderr
    assert client.numbers("#1P", "I51") == pytest.approx((0.0, 0.0), abs=SETTLES_COUNTS)


@pytest.mark.parametrize("language", ["en", "ko"])
def test_the_alarm_of_a_silent_host_names_this_command(language: str) -> None:
    """What it acknowledges, the test above reads in the controller."""
    told = load(language).problem(Problem(code="heartbeat.lost", key=f"P{LOST}", value="program", limit="0"))
    assert "console retract" in told and "F2" in told


def test_axes_without_zeros_are_not_moved(lathe: tuple[Order, str, PmacClient]) -> None:
    """Nobody knows where a table would be at its zero, or how far the tool is from the end of its travel."""
    made, address, client = lathe
    client.request("#3HM")
    client.request("#3K")
    before = client.numbers("#1P", "I51")
    done = retract(made, address, "--yes")
    assert done.returncode == 1 and "home first" in done.stderr
    assert client.numbers("#1P", "I51") == pytest.approx(before, abs=SETTLES_COUNTS)


def test_without_a_home_the_command_clears_what_a_table_adds_and_nothing_moves(
    lathe: tuple[Order, str, PmacClient],
) -> None:
    """Somebody has aborted the homing of the tool, and its register is not 0: nothing else leads out."""
    made, address, client = lathe
    refused = retract(made, address, "--yes", "--clear-tables")
    assert refused.returncode == 1 and "F8" in refused.stderr, "with a home it is not needed"
    register = correction_register(made.machine)
    for line in ("#1HM", "#1K", "I51=0", f"{register}=3200"):
        client.request(line)
    dead_end = retract(made, address, "--yes")
    assert dead_end.returncode == 1 and "console retract --clear-tables" in dead_end.stderr
    (before,) = client.numbers("#1P")
    done = retract(made, address, "--yes", "--clear-tables", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["tables_cleared"]
    tool, *others = client.numbers("#1P", "I51", register, f"P{OWNER}")
    assert others == [0.0, 0.0, 0.0] and tool == pytest.approx(before, abs=1.0)


def test_without_a_home_a_table_that_adds_nothing_is_switched_off_as_by_f8(
    lathe: tuple[Order, str, PmacClient],
) -> None:
    """The drives are disabled: nothing moves, and nothing is asked of a home that nobody has."""
    made, address, client = lathe
    for line in ("I51=0", "#1HM", "#1K#2K#3K", "I51=1"):
        client.request(line)
    (before,) = client.numbers("#1P")
    done = retract(made, address, "--yes", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["tables_cleared"]
    tool, *others = client.numbers("#1P", "I51", f"P{OWNER}")
    assert others == [0.0, 0.0] and tool == pytest.approx(before, abs=SETTLES_COUNTS)
