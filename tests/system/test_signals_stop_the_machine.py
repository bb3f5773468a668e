"""A real console process, stopped in the middle of a cut: the machine rests, the console leaves cleanly."""

from __future__ import annotations

import fcntl
import mmap
import os
import pty
import re
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

import pytest

import profiles.store
from console.session.program_log import FILE, FOLDER
from drivers.lathe.console_role import NOBODY
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.reserved import OWNER
from drivers.simulator.machine import SimulatedLathe
from profiles.store import load_machine
from tests.compact import save_compact
from tests.console.floor import LOGGED
from tests.preloaded import Preloaded
from tests.signed_profile import signed_copy
from tests.system.patient_card import PatientCard, patient_card
from tests.system.run_over_link import Order, order

pytestmark = pytest.mark.system

LONG_CUT_MM_PER_REV = "0.002"


@pytest.fixture
def long_job(tmp_path: Path) -> Path:
    """A cut of some minutes of machine time, so that a signal always comes in the middle."""
    text = (profiles.store.BUNDLED_JOBS / "lee-2001-experiment-1.toml").read_text(encoding="utf-8")
    path = tmp_path / "long.toml"
    path.write_text(text.replace("feed_mm_per_rev = 0.05", f"feed_mm_per_rev = {LONG_CUT_MM_PER_REV}"))
    return path


def command(job: Path, data: Path) -> list[str]:
    words = ("run", str(job), "--sim", "--strategy", "none", "--data", str(data), *save_compact(data))
    return [sys.executable, "-m", "console", *words]


def last_event(data: Path) -> tuple[str, str]:
    database = sqlite3.connect(data / "records.sqlite3")
    found = database.execute("SELECT kind, data FROM events ORDER BY number DESC").fetchall()
    database.close()
    kind, content = next((kind, data) for kind, data in found if kind not in LOGGED)
    return kind, content


@pytest.mark.parametrize(
    "number",
    [signal.SIGINT, *(pytest.param(other, marks=pytest.mark.long) for other in (signal.SIGTERM, signal.SIGHUP))],
)
def test_a_signal_in_mid_cut_stops_the_machine_and_is_told(
    long_job: Path, tmp_path: Path, number: signal.Signals
) -> None:
    with Preloaded(
        command(long_job, tmp_path), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if "  cut" in line:
                break
        process.send_signal(number)
        out, err = process.communicate(timeout=30)
    assert process.returncode == 1
    assert "measure" not in out
    # So thin a chip may chatter: that was said before.
    first, *others = (line for line in err.splitlines() if ": warning: " not in line)
    assert number.name in first
    assert "at rest" in first
    # A second line where the tool had come to the part by then.
    assert all("tool is still" in line for line in others)
    kind, content = last_event(tmp_path)
    assert kind == "ended"
    assert number.name in content
    log = (tmp_path / FOLDER / FILE).read_text(encoding="utf-8")
    assert f"end  {number.name}, exit code 1" in log.splitlines()[-1]


@contextmanager
def full_pipe() -> Iterator[tuple[BinaryIO, int]]:
    """A pipe that takes nothing more until it is read: who writes to it waits there."""
    read, write = os.pipe()
    fcntl.fcntl(write, fcntl.F_SETPIPE_SZ, mmap.PAGESIZE)
    os.set_blocking(write, False)
    with suppress(BlockingIOError):
        while True:
            os.write(write, bytes(mmap.PAGESIZE))
    os.set_blocking(write, True)
    with open(read, "rb") as reading:
        yield reading, write


def wait_for_a_run(data: Path) -> None:
    """Wait until a run is in the record: its first output comes next."""
    file, until_s = data / "records.sqlite3", time.monotonic() + 30.0
    while time.monotonic() < until_s:
        with suppress(sqlite3.Error), closing(sqlite3.connect(f"file:{file}?mode=ro", uri=True)) as database:
            if database.execute("SELECT count(*) FROM runs").fetchone()[0]:
                return
        time.sleep(0.01)
    raise TimeoutError("no run was recorded")


def test_a_signal_before_anything_moves_ends_with_one_line(tmp_path: Path) -> None:
    """Its first lines do not get out before the signal has come, so that it has not moved anything by then."""
    job = profiles.store.BUNDLED_JOBS / "lee-2001-experiment-1.toml"
    with (
        full_pipe() as (out, write),
        Preloaded(command(job, tmp_path), stdout=write, stderr=subprocess.PIPE, text=True) as process,
    ):
        os.close(write)
        wait_for_a_run(tmp_path)
        process.send_signal(signal.SIGTERM)
        said = out.read().replace(b"\0", b"")
        _, err = process.communicate(timeout=30)
    assert process.returncode == 1
    assert b"  cut" not in said
    assert err.count("\n") == 1
    assert "Traceback" not in err


def test_a_terminal_that_is_closed_stops_the_machine(long_job: Path, tmp_path: Path) -> None:
    pid, terminal = pty.fork()
    if pid == 0:
        arguments = command(long_job, tmp_path)
        os.execv(arguments[0], arguments)
    seen = b""
    while b"  cut" not in seen:
        seen += os.read(terminal, 4096)
    os.close(terminal)
    _, status = os.waitpid(pid, 0)
    assert os.waitstatus_to_exitcode(status) == 1
    kind, content = last_event(tmp_path)
    assert kind == "ended"
    # The signal and the failing output race; either one stops the machine.
    assert "SIGHUP" in content or "output closed" in content


def test_a_reader_that_goes_away_stops_the_machine(long_job: Path, tmp_path: Path) -> None:
    """`console run ... | head`: nobody can see the machine any more."""
    with Preloaded(
        command(long_job, tmp_path), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.readline()
        process.stdout.close()
        err = process.stderr.read()
        assert process.wait(timeout=30) == 1
    assert "output closed" in err
    assert "at rest" in err
    assert "Traceback" not in err


# A console that is ended while another one works the machine: nothing that it sends touches what moves there.


ANOTHER = 4711
SPINDLE, CARRIAGE = 2, 3
ENDS_WITHIN_S = 20.0
STOPS = re.compile(rb"[\x01\x0b]")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Order:
    return order(tmp_path_factory.mktemp("beside"), 4.0)


def proven(made: Order, address: str) -> list[str]:
    """The words of a run on a machine whose stops were proven over this link."""
    made.prove_stops(address)
    return made.command(address, "--yes")[3:]


@pytest.fixture
def lathe(made: Order) -> SimulatedLathe:
    return SimulatedLathe(made.machine)


def turned_by_another(lathe: SimulatedLathe) -> None:
    """Let the spindle turn, as somebody's order."""
    client = PmacClient(MemoryLink(lathe.connect(), lathe), lathe)
    client.connect()
    client.request("#1J/#2J/#3J/")
    client.request(f"#2J+ P{OWNER}={ANOTHER}")


def is_another_s_and_turns(card: PatientCard) -> bool:
    spindle = card.lathe.controller.motors[SPINDLE]
    return spindle.jogging and spindle.amplifier_enabled and owner(card.lathe) == ANOTHER


def owner(lathe: SimulatedLathe) -> int:
    return int(lathe.controller.variables.get(VariableKind.P, OWNER))


def heard(card: PatientCard) -> bytes:
    return b"".join(data for _, data in card.words.said)


@contextmanager
def console(*words: str, unheard: tuple[PatientCard, bytes] | None = None) -> Iterator[subprocess.Popen[str]]:
    """Start the console, with a word of it that the card will not hear."""
    if unheard is not None and unheard[1]:
        unheard[0].will_not_hear(unheard[1])
    command = [sys.executable, "-m", "console", *words]
    with Preloaded(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            if process.poll() is None:
                process.kill()


def ended(card: PatientCard, process: subprocess.Popen[str], number: signal.Signals) -> str:
    """Send the signal, let time run on, and return what was said; the exit code is that of a failure."""
    process.send_signal(number)
    card.run_on()
    _, err = process.communicate(timeout=ENDS_WITHIN_S)
    assert process.returncode == 1
    assert "Traceback" not in err
    return err


PHASES = {
    "before it connects": b"",
    "while it connects": b"VERSION TYPE",
    "while it asks whose the machine is": b"P1000",
}


@pytest.mark.parametrize(
    ("phase", "number"), zip(PHASES, (signal.SIGHUP, signal.SIGINT, signal.SIGTERM), strict=True), ids=str
)
def test_a_run_that_ends_before_it_has_the_machine_stops_nobody(
    lathe: SimulatedLathe, made: Order, phase: str, number: signal.Signals
) -> None:
    turned_by_another(lathe)
    with (
        patient_card(lathe) as card,
        console(*proven(made, card.console), unheard=(card, PHASES[phase])) as process,
    ):
        assert process.stderr is not None
        process.stderr.readline()  # what the cut rests on: the signals are in hand by then
        if PHASES[phase]:
            card.until_it_is_said()
        err = ended(card, process, number)
        assert STOPS.search(heard(card)) is None, err
        assert is_another_s_and_turns(card)
        assert f"ended by {number.name}; this command was not moving anything" in err


def test_a_run_that_is_refused_stops_nobody_either(lathe: SimulatedLathe, made: Order) -> None:
    turned_by_another(lathe)
    with patient_card(lathe) as card, console(*proven(made, card.console)) as process:
        _out, err = process.communicate(timeout=ENDS_WITHIN_S)
        assert (process.returncode, f"number {ANOTHER}" in err) == (1, True)
        assert STOPS.search(heard(card)) is None
        assert is_another_s_and_turns(card)


def test_an_identification_that_ends_before_it_has_the_machine_stops_nobody(tmp_path: Path) -> None:
    machine = signed_copy("lee-2001-lathe", tmp_path)
    lathe = SimulatedLathe(load_machine(str(machine)).machine)
    turned_by_another(lathe)
    words = ("identify", "--machine", str(machine), "--data", str(tmp_path), "--yes")
    with patient_card(lathe) as card, console(*words, "--link", card.console, unheard=(card, b"P1000")) as process:
        card.until_it_is_said()
        ended(card, process, signal.SIGINT)
        assert STOPS.search(heard(card)) is None
        assert is_another_s_and_turns(card)


def test_a_signal_in_the_middle_of_the_claim_is_a_stop_as_soon_as_it_is_answered(
    lathe: SimulatedLathe, made: Order
) -> None:
    with patient_card(lathe) as card, console(*proven(made, card.console), unheard=(card, b"P1000=")) as process:
        card.until_it_is_said()
        err = ended(card, process, signal.SIGTERM)
        assert "stopped (SIGTERM); the machine is at rest" in err
        assert owner(card.lathe) == NOBODY
        assert b"OPEN" not in heard(card), "nothing was loaded"


def test_a_run_that_has_the_machine_stops_what_it_moves(lathe: SimulatedLathe, made: Order) -> None:
    with patient_card(lathe) as card, console(*proven(made, card.console)) as process:
        card.until(lambda: lathe.controller.motors[CARRIAGE].jogging)
        err = ended(card, process, signal.SIGTERM)
        assert "stopped (SIGTERM); the machine is at rest" in err
        assert STOPS.search(heard(card)) is not None
        assert not any(motor.amplifier_enabled for motor in lathe.controller.motors.values())
        assert owner(card.lathe) == NOBODY
