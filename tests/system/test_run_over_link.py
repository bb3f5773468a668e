"""`console run` on a machine behind a link: it cuts and leaves the machine off, or does not touch it."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from drivers.clock import RealClock
from drivers.lathe.ownership import OWNER_ITEM
from drivers.lathe.standing import NOBODY
from drivers.link.address import TcpAddress
from drivers.link.opening import open_link
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import PMAC
from drivers.pmac.status import decode
from drivers.simulator.machine import SimulatedLathe
from tests.system.patient_card import patient_card
from tests.system.run_over_link import Order, order
from tests.terminal import Terminal

if TYPE_CHECKING:
    from tests.system.conftest import Serve, Served

pytestmark = [pytest.mark.system, pytest.mark.long]

TIMEOUT_S = 40.0
SHORT_MM = 0.5
"""10 turns."""


@pytest.fixture(scope="module")
def served(serve: Serve, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    made = order(tmp_path_factory.mktemp("served"), SHORT_MM)
    with serve("--tcp", "127.0.0.1:0", "--machine", str(made.machine_file)) as running:
        yield running


@pytest.fixture
def made(tmp_path: Path) -> Order:
    return order(tmp_path, SHORT_MM)


def link_to(served: Served) -> str:
    host, port = served.tcp
    return f"tcp:{host}:{port}"


def is_untouched(served: Served) -> None:
    """Drives off, every axis where it was switched on, and nobody's."""
    host, port = served.tcp
    client = PmacClient(open_link(TcpAddress(host=host, port=port)), RealClock())
    client.connect()
    assert client.numbers(OWNER_ITEM, "#1P", "#2P", "#3P") == (NOBODY, 0.0, 0.0, 0.0)
    for motor in client.query("#1?", "#2?", "#3?"):
        assert "amplifier_enabled" not in decode(motor, PMAC.motor_bits)
    client.link.close()


def console(*words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "console", *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, stdin=subprocess.DEVNULL)


def test_a_part_is_cut_and_the_machine_is_left_off_and_nobodys(made: Order) -> None:
    with patient_card(SimulatedLathe(made.machine)) as card:
        made.prove_stops(card.console)
        with made.running(card.console) as process:
            out, err = process.communicate(timeout=TIMEOUT_S)
        assert process.returncode == 0, err
        said = json.loads(out)
        assert (said["simulated"], said["strategy"], said["collisions"]) == (False, "pvt", [])
        assert [said[key] for key in ("before", "after", "improvement_percent", "within_tolerance")] == [None] * 4
        assert said["telemetry_samples"] > 10
        motors = [card.lathe.controller.motors[number] for number in (1, 2, 3)]
        assert not any(motor.amplifier_enabled or motor.jogging for motor in motors)
        assert motors[2].position > 10_000.0, "the carriage has gone to the part"
        with card.watcher() as client:
            assert client.numbers(OWNER_ITEM, "P1003", "P1004") == (NOBODY, 0.0, 0.0)


def test_without_a_stop_record_nothing_is_moved(served: Served, made: Order) -> None:
    words = made.command(link_to(served), "--yes")[3:]
    done = console(*words)
    (cut_with,) = done.stdout.splitlines()
    assert (done.returncode, cut_with.partition(",")[0]) == (1, words[words.index("--strategy") + 1])
    assert "--prove" in done.stderr.splitlines()[-1]
    is_untouched(served)


def test_without_agreement_and_without_anybody_to_ask_nothing_is_moved(served: Served, made: Order) -> None:
    made.prove_stops(link_to(served))
    done = console(*made.command(link_to(served))[3:])
    assert (done.returncode, done.stdout) == (1, "")
    assert "--yes" in done.stderr.splitlines()[-1]
    is_untouched(served)


@pytest.mark.parametrize(("typed", "told"), [("lee-2001-lathe", "--prove"), ("yes", "name")])
def test_the_name_of_the_machine_is_what_agrees(served: Served, made: Order, typed: str, told: str) -> None:
    """Behind the name comes what else is missing, here the stop record; behind anything else, nothing."""
    with Terminal(made.command(link_to(served)), columns=160) as terminal:
        terminal.wait_for(r"lee-2001-lathe.*: ?$", TIMEOUT_S)
        terminal.type(f"{typed}\r")
        assert terminal.wait_exit(TIMEOUT_S) == 1
        assert told in " ".join(terminal.text.rstrip().splitlines()[-2:])  # the last message, which may be wrapped
    is_untouched(served)


def test_nobody_says_where_the_machine_is() -> None:
    with Terminal([sys.executable, "-m", "console", "--machine", "lee-2001-lathe"], columns=160) as terminal:
        assert terminal.wait_exit(TIMEOUT_S) == 1
        assert "no address is known for the controller of lee-2001-lathe: add --link ADDRESS" in terminal.text


@pytest.mark.parametrize("command", [(), ("run", "lee-2001-experiment-1")])
def test_a_simulated_machine_has_no_address(command: tuple[str, ...]) -> None:
    done = console(*command, "--sim", "--link", "tcp:127.0.0.1:1")
    assert (done.returncode, done.stdout, len(done.stderr.splitlines())) == (2, "", 1)
    assert "choose one" in done.stderr
