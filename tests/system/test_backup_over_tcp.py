"""Backup, restore to a fresh controller, backup: the same text, user buffer included, over real sockets."""

from __future__ import annotations

import json
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from drivers.clock import RealClock
from drivers.commissioning.backup import backup_text, read_backup
from drivers.commissioning.configuration import ControllerConfiguration
from drivers.commissioning.downloading import differing, plan_download, send
from drivers.commissioning.reading import read_configuration, whole_card
from drivers.commissioning.restoring import refuse_other_memory, restore, restore_lines
from drivers.commissioning.user_buffer import read_words
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.lathe.stop import StoppedError
from drivers.link.address import EthernetAddress, TcpAddress, parse_address
from drivers.link.base import StopWay
from drivers.link.ethernet import EthernetLink
from drivers.link.opening import TcpLink
from drivers.pmac.client import PmacClient
from drivers.pmac.program_text import read_program
from drivers.simulator.hosts.connection import HostConnection
from drivers.simulator.machine import SimulatedLathe
from profiles.store import list_machines
from tests.preloaded import completed
from tests.signed_profile import signed_copy
from tests.system.lathe_sites import Site, build, compact
from tests.system.patient_card import PacedLink, PacedServer, PatientCard, patient_card, served
from tests.system.run_over_link import order

if TYPE_CHECKING:
    from tests.system.conftest import Serve, Served

pytestmark = pytest.mark.system

LAST = {"pmac": 0x9FFF, "turbo": 0x107FF}
"""Where the memory for buffers ends, by the manuals."""

WORDS = 40
DATE = "2026-03-01T12:00:00+00:00"


@contextmanager
def connected(serve: Serve, family: str) -> Iterator[PmacClient]:
    with serve("--tcp", "127.0.0.1:0", "--dialect", family) as served:
        host, port = served.tcp
        with closing(TcpLink(TcpAddress(host=host, port=port))) as link:
            client = PmacClient(link, RealClock())
            client.connect()
            yield client


def read(client: PmacClient) -> ControllerConfiguration:
    """Everything but most of what takes time: the settings and variables of the factory."""
    extent = replace(
        whole_card(client.dialect, values=False),
        settings=(range(200),),
        pointers=(range(50),),
        plcs=(1,),
        programs=(1, 2),
    )
    found = read_configuration(client, client.dialect, extent)
    return replace(
        found, values={}, user_words=read_words(client, found.user_buffer) if found.user_buffer else None
    )


@pytest.mark.parametrize("family", LAST)
def test_backup_restore_backup_is_identical_with_a_user_buffer(serve: Serve, family: str) -> None:
    first = LAST[family] - WORDS + 1
    with connected(serve, family) as client:
        lines = (f"DEFINE UBUFFER {WORDS}", f"WX:${first:X},1,$FFFFFF", f"WY:${first + WORDS - 1:X},$ABCDEF")
        for line in (*lines, "OPEN PROG1 CLEAR", "INC X10", "CLOSE"):
            client.request(line, lines=0)
        text = backup_text(read(client), DATE)
    assert f"\nDEFINE UBUFFER {WORDS}\n" in text
    backup = read_backup(text, "file")
    with connected(serve, family) as client:
        now = read(client)
        refuse_other_memory(backup, now, "here")
        restore(client, client.dialect, restore_lines(text, backup, now))
        assert backup_text(read(client), DATE) == text


# Programs of a file, sent to a served controller over a real socket, and listed again.


TEXT = "OPEN PROG 51 CLEAR\ninc x 5\ndwe 20\nCLOSE\nOPEN PLC 5 CLEAR\nP51 = 2\nCLOSE\n"


@pytest.mark.parametrize("family", ["pmac", "turbo"])
def test_a_program_and_a_plc_arrive_over_a_socket(serve: Serve, family: str) -> None:
    buffers = read_program(TEXT).source.buffers
    with serve("--tcp", "127.0.0.1:0", "--dialect", family) as served:
        host, port = served.tcp
        with closing(TcpLink(TcpAddress(host=host, port=port))) as link:
            client = PmacClient(link, RealClock())
            client.connect()
            changes = plan_download(client, client.dialect, buffers)
            send(client, client.dialect, changes, "text", lambda sent, of: None)
            assert differing(client, changes) == []
            assert [line.strip() for line in client.question("LIST PROG51")] == ["INCX5", "DWE20", "RET"]
            assert [line.strip() for line in client.question("LIST PLC5")] == ["P51=2", "RET"]


# Stops on a connection of their own, to the simulator's Ethernet board: while it is there, and without it.


def jogs_until(site: Site, way: StopWay) -> None:
    """Jog the carriage until a stop would go this way; stop it, and see it at rest with its drives on."""

    def see(snapshot: Snapshot) -> None:
        moved = snapshot.carriage.position > start + 500.0
        if moved and site.stop.way is way and site.stop.reason is None:
            site.stop.stop("operator")

    start = site.lathe.snapshot().carriage.position
    site.seen.append(see)
    with pytest.raises(StoppedError, match="operator"):
        site.lathe.jog_to(AxisName.CARRIAGE, start + 9000.0)
    site.seen.clear()
    rest = site.lathe.wait_for_rest()
    assert site.stop.proven and rest.loops_closed
    assert start + 500.0 < rest.carriage.position < start + 4000.0
    site.stop.release()


def drops(server: PacedServer, link: EthernetLink) -> None:
    """The board ends the connection for stops, as one does that is short of memory."""
    assert link._stops is not None
    name = link._stops._connection._socket.getsockname()
    (host,) = [
        each
        for each in server.hosts
        if isinstance(each, HostConnection) and each._transport.get_extra_info("peername") == name
    ]
    server.loop.call_soon_threadsafe(host._transport.abort)


def test_a_jog_is_stopped_on_the_connection_for_stops_and_without_it() -> None:
    machine = compact("turbo")
    with served(SimulatedLathe(machine), "ethernet") as server:
        address = parse_address(f"{server.address}?stop=reserved")
        assert isinstance(address, EthernetAddress)
        with closing(EthernetLink(address)) as link:
            site = build(PacedLink(link, server), server, machine)
            site.lathe.connect()
            site.lathe.claim()
            assert site.lathe.verify() == ()
            site.lathe.enable()
            site.lathe.home()
            jogs_until(site, StopWay.RESERVED)
            drops(server, link)
            jogs_until(site, StopWay.LOST)
            assert site.client.faults.total == 0


# A controller that falls silent in mid-cut, and a supervisor that kills the console ten seconds after SIGTERM.


AT_ONCE_S = 8.0
"""Until the first line: two looks that are not answered, on a computer that is busy."""

SUPERVISOR_S = 10.0


def stops(card: PatientCard) -> int:
    return sum(data.count(b"\x0b") for _, data in card.words.said)


def test_it_is_said_at_once_what_is_tried_and_a_sigterm_ends_it_in_time(tmp_path: Path) -> None:
    made = order(tmp_path, 4.0)
    lathe = SimulatedLathe(made.machine)
    with patient_card(lathe) as card, made.proven(card.console) as process:
        assert process.stderr is not None
        card.until(lambda: lathe.controller.systems[1].running)
        with card.hanging():
            card.run_on()
            silent_s = time.monotonic()
            said: list[str] = []
            for line in process.stderr:
                said.append(line)
                if "stopping" in line:
                    break
            assert "stopping" in said[-1]
            assert time.monotonic() - silent_s < AT_ONCE_S
            said.append(process.stderr.readline())
            assert "standstill not confirmed" in said[-1] and "no answer for" in said[-1]
            process.send_signal(signal.SIGTERM)
            came_s, count = time.monotonic(), stops(card)
            seconds = 0
            for line in process.stderr:
                said.append(line)
                seconds += "standstill not confirmed" in line
            process.wait()
            took_s = time.monotonic() - came_s
            assert took_s < SUPERVISOR_S
            assert process.returncode == 1
            assert seconds >= 4, "each second"
            assert stops(card) - count > 3.0 * took_s, "the stop goes on being sent"
            assert process.stdout is not None and json.loads(process.stdout.read())["exit_code"] == 1
            assert "press the emergency stop" in said[-1]


# `console doctor` and `console controller` over real links to a simulator that is a process of its own.


TIMEOUT_S = 50

every_machine = pytest.mark.parametrize("machine", [entry.name for entry in list_machines()])


def run(*words: str) -> subprocess.CompletedProcess[str]:
    return completed(words, TIMEOUT_S)


def addresses(served: Served) -> list[str]:
    hosts = {"tcp": served.tcp, "ethernet": served.ethernet}
    return [f"serial:{served.device}", *(f"{kind}:{host}:{port}" for kind, (host, port) in hosts.items())]


@every_machine
def test_a_fresh_simulator_of_a_bundled_machine_is_green(machine: str) -> None:
    done = run("doctor", "--machine", machine, "--link", "sim:", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    said = json.loads(done.stdout)
    assert said["simulated"] is True
    assert {check["outcome"] for check in said["checks"]} == {"holds", "noted"}


@pytest.mark.long
def test_every_link_leads_to_the_same_verdict(serve: Serve, tmp_path: Path) -> None:
    listeners = ("--tcp", "127.0.0.1:0", "--ethernet", "127.0.0.1:0", "--pty")
    machine = str(signed_copy("turbo-ethernet-lathe", tmp_path))
    with serve(*listeners, "--machine", machine) as served:
        found, lines = [], []
        for address in addresses(served):
            done = run("doctor", "--machine", machine, "--link", address, "--json")
            assert (done.returncode, done.stderr) == (0, ""), address
            said = json.loads(done.stdout)
            assert (said["simulated"], said["address"]) == (False, address)
            lines += [check["code"] for check in said["checks"] if check["code"].endswith("_checksums")]
            found.append([check for check in said["checks"] if check["code"] not in lines])
        # The serial line, and what may lie behind a terminal server, are checked by nothing but the controller.
        assert lines == ["line_checksums", "line_checksums", "network_checksums"]
        assert found[0] == found[1] == found[2]
        done = run("doctor", "--machine", machine, "--link", f"{address}?stop=reserved", "--json")
        assert (done.returncode, done.stderr) == (0, "")
        said = json.loads(done.stdout)
        (own,) = [check for check in said["checks"] if check not in found[2] and check["code"] not in lines]
        assert (said["address"], own["code"]) == (f"{address}?stop=reserved", "stop_connection")
        backup = str(tmp_path / "card.pmac")
        assert (
            run("controller", "backup", backup, "--machine", machine, "--link", addresses(served)[2]).returncode
            == 0
        )
        assert (
            run("controller", "diff", backup, "--machine", machine, "--link", addresses(served)[1]).returncode == 0
        )


def test_a_profile_that_is_signed_for_the_simulator_is_red_on_a_real_link(serve: Serve) -> None:
    with serve("--pty") as served:
        done = run("doctor", "--link", f"serial:{served.device}", "--json")
    failed = [check["code"] for check in json.loads(done.stdout)["checks"] if check["outcome"] == "fails"]
    assert (done.returncode, failed) == (1, ["signed_for_simulator"])


def test_nobody_there_is_one_line() -> None:
    done = run("doctor", "--link", "serial:/dev/there-is-none")
    assert (done.returncode, done.stdout, len(done.stderr.splitlines())) == (1, "", 1)
