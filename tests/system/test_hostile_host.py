"""Another host on the line while `console run` cuts: what it changed, held or ended is never called good.

The console is a process; the other host is a plain socket that sends lines, or a second console that looks on. The
machine and the job are files of one operator. Times are those of the card.
"""

from __future__ import annotations

import json
import re
import socket
import sqlite3
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from drivers.link.address import TcpAddress, parse_address
from drivers.simulator.machine import SimulatedLathe
from profiles.store import load_job
from tests.signed_profile import signed
from tests.system.lathe_sites import compact_text
from tests.system.patient_card import PatientCard, patient_card
from tests.system.run_over_link import Order
from tests.terminal import Terminal

pytestmark = [pytest.mark.system, pytest.mark.long]

MACHINE, JOB = "shed-lathe", "bearing-ring"
CUT_MM = 1.0
"""20 turns, and 10 clear of the part."""

TOOL, CARRIAGE = 1, 3
ENDS_WITHIN_S = 40.0
REACTS_WITHIN_S = 1.5
DEEPEST_UM = -30.0
"""The lobe of the job is 40 um peak to peak; a tool that is stopped on its way comes to rest some further on."""

STOPS = (b"\x01", b"\x0b")
EARLY = r"the cut ended early, at turn (\d+) of (\d+)"


@dataclass(frozen=True, kw_only=True)
class OwnOrder(Order):
    """Named as an operator names them, in his data folder."""

    def command(self, address: str, *more: str) -> list[str]:
        words = ("run", JOB, "--machine", MACHINE, "--data", str(self.data), "--link", address)
        return [sys.executable, "-m", "console", *words, "--strategy", "pvt", *more]


@pytest.fixture(scope="module")
def order(tmp_path_factory: pytest.TempPathFactory) -> Order:
    data = tmp_path_factory.mktemp("data")
    job, machine = data / "jobs" / f"{JOB}.toml", data / "machines" / f"{MACHINE}.toml"
    for path in (job, machine):
        path.parent.mkdir()
    text = load_job("lee-2001-experiment-1").path.read_text(encoding="utf-8")
    for key, value in (("name", f'"{JOB}"'), ("cut_length_mm", CUT_MM), ("lobe_error_um_pp", 40.0)):
        text, found = re.subn(rf"(?m)^{key} = \S+", f"{key} = {value}", text)
        assert found == 1, key
    job.write_text(text, encoding="utf-8")
    machine.write_text(signed(compact_text("pmac")).replace('"lee-2001-lathe"', f'"{MACHINE}"'), encoding="utf-8")
    return OwnOrder(job_file=job, machine_file=machine, data=data)


@dataclass(frozen=True, kw_only=True)
class Shed:
    """The lathe with a blank in its chuck, the console that cuts it, and another host."""

    card: PatientCard
    order: Order
    process: subprocess.Popen[str]

    def in_the_part(self) -> bool:
        job, machine = self.order.job, self.order.machine
        face_mm = machine.carriage.jaw_face_mm - job.overhang_mm
        at_mm = self.card.lathe.controller.motors[CARRIAGE].position / machine.carriage.counts_per_mm
        return self.card.lathe.controller.systems[1].running and at_mm > face_mm + 0.3 * CUT_MM

    def sees(self, reached: Callable[[], bool]) -> None:
        """Let time run until something is so; a console that has ended before says why."""
        self.card.sees(lambda: reached() or self.process.poll() is not None)
        assert self.process.poll() is None, self.ended()

    def jogs_to_the_part(self) -> bool:
        carriage = self.card.lathe.controller.motors[CARRIAGE]
        return carriage.home_complete and carriage.position > 3000.0

    def another_host_sends(self, said: str) -> float:
        """Send lines over a socket of its own; return when, in the time of the card."""
        with stranger(self.card.server.address) as line:
            at_s = self.card.lathe.now_s()
            line.sendall(said.encode())
            line.settimeout(ENDS_WITHIN_S)
            line.recv(1)
        return at_s

    def ended(self) -> tuple[int, str, str]:
        out, err = self.process.communicate(timeout=ENDS_WITHIN_S)
        return self.process.returncode, out, err

    def stopped_s(self, since_s: float) -> float:
        """When the console has sent its first stop since then."""
        said = self.card.words.said
        return min(at_s for at_s, data in said if at_s >= since_s and any(stop in data for stop in STOPS))

    @property
    def deepest_um(self) -> float:
        return float(self.card.lathe.measure_clamped().deviation_um.min())


@contextmanager
def stranger(address: str) -> Iterator[socket.socket]:
    at = parse_address(address)
    assert isinstance(at, TcpAddress)
    with closing(socket.create_connection((at.host, at.port))) as line:
        yield line


@contextmanager
def opened(order: Order, through: Callable[[str], str] = str) -> Iterator[Shed]:
    lathe = SimulatedLathe(order.machine)
    lathe.mount(order.job)
    with patient_card(lathe) as card, order.proven(through(card.console)) as process:
        yield Shed(card=card, order=order, process=process)


@pytest.fixture
def shed(order: Order) -> Iterator[Shed]:
    with opened(order) as made:
        yield made


def is_not_called_good(shed: Shed) -> str:
    """It fails, prints no result, and keeps none; the last run of the record says why."""
    code, out, err = shed.ended()
    assert code == 1 and set(json.loads(out)) == {"schema", "exit_code", "errors"}, err
    with closing(sqlite3.connect(shed.order.data / "records.sqlite3")) as kept:
        (run,) = kept.execute("SELECT run_id FROM runs ORDER BY rowid DESC LIMIT 1").fetchone()
        events = dict(kept.execute("SELECT kind, data FROM events WHERE run_id = ?", (run,)).fetchall())
    assert "result" not in events
    assert json.loads(events["ended"])["reason"]
    return err


def is_untouched(shed: Shed) -> None:
    """The blank is as it was clamped, the depth of cut further out than the part is to be."""
    left_um = 1000.0 * shed.order.job.depth_of_cut_mm
    assert np.allclose(shed.card.lathe.measure_clamped().deviation_um, left_um)


def ended_at_a_turn(err: str) -> bool:
    early = re.search(EARLY, err)
    return early is not None and 0 < int(early[1]) < int(early[2])


def test_a_cut_that_another_host_ends_is_told_with_its_turn_and_never_called_done(shed: Shed) -> None:
    """What else it may do to a cut is tried in one process: tests/console/test_cuts_of_others.py."""
    shed.sees(shed.in_the_part)
    shed.another_host_sends("M26=1\r")
    err = is_not_called_good(shed)
    assert "another host, not this console, requested the end of the program (M26)" in err and ended_at_a_turn(err)
    assert shed.deepest_um > DEEPEST_UM


def test_a_controller_that_is_reset_in_a_cut_is_stopped(shed: Shed) -> None:
    """The spindle runs out long behind it: nobody waits for that here."""
    shed.sees(shed.in_the_part)
    at_s = shed.another_host_sends("$$$\r")
    shed.card.sees(lambda: any(each > at_s and set(data) & {1, 11} for each, data in shed.card.words.said))
    assert shed.stopped_s(at_s) - at_s < REACTS_WITHIN_S


def test_what_is_changed_while_the_axes_go_to_their_places_never_runs(shed: Shed) -> None:
    """A program, and a constant of it that nobody would have missed."""
    shed.sees(shed.jogs_to_the_part)
    shed.another_host_sends("P11=P11+500\rOPEN PROG 1 CLEAR\rX0 Z0\rCLOSE\rP99\r")
    assert re.search("P11 in the controller|PROG 1", is_not_called_good(shed))
    is_untouched(shed)
    assert not any(b"B1R" in data for _, data in shed.card.words.said)


def test_a_digit_that_is_turned_on_the_wire_is_found_before_anything_moves(order: Order) -> None:
    with turning(b"P11=", b"P11=9") as through, opened(order, through) as shed:
        assert "P11 in the controller" in is_not_called_good(shed)
        assert all(motor.position == 0.0 for motor in shed.card.lathe.controller.motors.values())
        is_untouched(shed)


def test_a_cut_that_another_console_stops_is_told_with_its_number(shed: Shed, tmp_path: Path) -> None:
    """It looks on from the home search on; Space is the only key that it is given."""
    words = [
        "--machine",
        str(shed.order.machine_file),
        "--data",
        str(tmp_path),
        "--link",
        shed.card.server.address,
    ]
    shed.sees(lambda: shed.card.lathe.controller.motors[TOOL].home_complete)
    with Terminal([sys.executable, "-m", "console", *words], columns=100, rows=30) as screen:
        screen.wait_for("Observing", ENDS_WITHIN_S)
        shed.sees(shed.in_the_part)
        screen.press("space")
        err = is_not_called_good(shed)
    assert re.search(r"console \d+, which is observing, stopped the cut", err) and ended_at_a_turn(err)
    assert shed.deepest_um > DEEPEST_UM


@contextmanager
def turning(right: bytes, wrong: bytes) -> Iterator[Callable[[str], str]]:
    """A wire that has one fault: what begins rightly arrives wrong. Takes an address, gives its own."""
    with socket.create_server(("127.0.0.1", 0)) as near:
        threads: list[threading.Thread] = []

        def carry(source: socket.socket, target: socket.socket, turned: bool) -> None:
            with suppress(OSError):
                while data := source.recv(65536):
                    target.sendall(data.replace(right, wrong) if turned else data)
                target.shutdown(socket.SHUT_WR)

        def serve(address: str) -> None:
            with suppress(OSError), near.accept()[0] as host, stranger(address) as card:
                back = threading.Thread(target=carry, args=(card, host, False))
                back.start()
                carry(host, card, turned=True)
                back.join(ENDS_WITHIN_S)

        def through(address: str) -> str:
            threads.append(threading.Thread(target=serve, args=(address,)))
            threads[0].start()
            return f"tcp:127.0.0.1:{near.getsockname()[1]}"

        yield through
        for thread in threads:
            thread.join(ENDS_WITHIN_S)
