"""The log of the program; a bounded server for clients that nobody trusts; signals at any moment."""

from __future__ import annotations

import asyncio
import gc
import logging
import os
import re
import signal
import socket
import stat
import threading
import warnings
from argparse import Namespace
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from pytest import MonkeyPatch

from console.cli.logged_commands import carried_out
from console.cli.measured import records
from console.session import program_log
from console.session.bounded_server import BoundedServer, ProtocolFactory
from console.session.errors import Interrupted
from console.session.program_log import FILE, FOLDER, note
from console.session.signals import Interruption
from console.session.station.machine_connection import guard, leave
from drivers.errors import RefusedError
from drivers.lathe.console_role import NOBODY, ConsoleRole
from drivers.lathe.snapshot import Snapshot
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.reserved import OWNER
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from profiles.problem import ProblemError
from profiles.store import load_machine
from tests.console.commands import Console, real
from tests.console.consoles import MACHINE, STOPS, OneConsole, console_of
from tests.drivers.commissioned import Commissioned

LINE = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z (INFO|WARNING|ERROR) +\d+ .*")


def lines(data: Path) -> list[str]:
    return (data / FOLDER / FILE).read_text(encoding="utf-8").splitlines()


def test_a_command_that_works_a_machine_is_in_it_with_its_end(console: Console, tmp_path: Path) -> None:
    assert console("run", "no-such-job", "--sim", "--data", str(tmp_path)).code == 1
    begin, refused, end = lines(tmp_path)
    assert all(LINE.fullmatch(line) for line in (begin, refused, end))
    assert begin.endswith(f" begin  run no-such-job --sim --data {tmp_path}")
    assert "WARNING" in refused and "job.unknown" in refused
    assert re.search(r" INFO +\d+ end  exit code 1  trilobe \d", end)


def test_reading_leaves_nothing_and_no_folder_is_made(console: Console, tmp_path: Path) -> None:
    assert console("jobs", "--data", str(tmp_path)).code == 0
    assert os.listdir(tmp_path) == []
    assert console("run", "no-such-job", "--sim", "--data", str(tmp_path / "new")).code == 1
    assert not (tmp_path / "new").exists()


def test_a_fault_is_in_it_with_its_traceback(console: Console, tmp_path: Path, monkeypatch: MonkeyPatch) -> None:
    def broken(*_: object) -> int:
        raise RuntimeError("one\x1b[2J\ntwo")

    monkeypatch.setattr(records, "main", broken)
    said = console("records", "list", "--data", str(tmp_path))
    assert said.code == 1 and "Traceback" not in said.err
    text = (tmp_path / FOLDER / FILE).read_text(encoding="utf-8")
    assert "Traceback (most recent call last)" in text and "RuntimeError: one" in text and "\x1b" not in text
    assert [line for line in text.splitlines() if not LINE.fullmatch(line) and not line.startswith("    ")] == []


@pytest.mark.parametrize(("command", "logged"), [("jobs", ""), ("ship", "end  BrokenPipeError, exit code 1")])
def test_a_reader_that_has_gone_as_behind_head_is_no_fault(command: str, logged: str, tmp_path: Path) -> None:
    def unread() -> int:
        raise BrokenPipeError

    with pytest.raises(BrokenPipeError):
        carried_out(unread, Namespace(command=command, data=tmp_path), [command])
    log = tmp_path / FOLDER / FILE
    text = log.read_text(encoding="utf-8") if log.exists() else ""
    assert logged in text and "fault" not in text and "Traceback" not in text


@pytest.mark.rings
def test_no_password_of_a_shop_is_in_it(console: Console, tmp_path: Path, monkeypatch: MonkeyPatch) -> None:
    """Nor where the program fails; wrong usage is not logged."""
    log, data = tmp_path / FOLDER / FILE, ("--data", str(tmp_path))

    def broken(*_: object) -> int:
        raise RuntimeError("broken")

    assert console("ship", "--sho", "password=geheim", "--once", *data).code != 0
    assert not log.exists() or "geheim" not in log.read_text(encoding="utf-8")
    for given in (("--shop", "host=x password=geheim"), ("--shop=postgresql://a:geheim@x/shop",)):
        assert console("ship", *given, "--once", *data).code != 0
    monkeypatch.setattr(records, "main", broken)
    console("records", "list", "--shop", "password=geheim", *data)
    text = log.read_text(encoding="utf-8")
    assert "geheim" not in text and text.count("begin  ship") == 2 and "fault" in text


def test_it_rotates_and_keeps_so_many(tmp_path: Path, monkeypatch: MonkeyPatch) -> None:
    monkeypatch.setattr(program_log, "MOST_BYTES", 500)
    for number in range(60):
        note(tmp_path, f"line {number:04d}")
    names = sorted(os.listdir(tmp_path / FOLDER))
    assert names == ["lock", FILE, *(f"{FILE}.{number}" for number in range(1, 6))]
    assert all((tmp_path / FOLDER / name).stat().st_size <= 500 for name in names)
    assert lines(tmp_path)[-1].endswith("line 0059")
    assert {stat.S_IMODE((tmp_path / FOLDER / name).stat().st_mode) for name in names} == {0o600}


def test_processes_write_whole_lines_beside_each_other(tmp_path: Path, monkeypatch: MonkeyPatch) -> None:
    monkeypatch.setattr(program_log, "WAIT_S", 30.0)  # a busy computer loses none here
    children = []
    for _ in range(4):
        if (pid := os.fork()) == 0:
            for number in range(25):
                note(tmp_path, f"{number} " + "x" * 200, level=logging.WARNING)
            os._exit(0)
        children.append(pid)
    for pid in children:
        os.waitpid(pid, 0)
    found = lines(tmp_path)
    assert len(found) == 100 and all(LINE.fullmatch(line) for line in found)


@pytest.mark.parametrize("in_the_way", [FOLDER, f"{FOLDER}/{FILE}/folder"])
def test_what_cannot_be_written_is_no_fault(in_the_way: str, tmp_path: Path, console: Console) -> None:
    path = tmp_path / in_the_way
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("")
    said = console("run", "no-such-job", "--sim", "--data", str(tmp_path))
    assert said.code == 1 and said.err.count("\n") == 1


TIMES = 5


async def talk(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    while True:
        writer.write(b"x\n")
        await writer.drain()
        await asyncio.sleep(0.01)


def served(path: Path) -> BoundedServer:
    async def listen(made: ProtocolFactory, _: ExitStack) -> tuple[asyncio.Server, str]:
        return await asyncio.get_running_loop().create_unix_server(made, path), str(path)

    return BoundedServer("test", listen, talk, most_clients=4, longest_line=100, unread_bytes=0)


def connect_until(over: threading.Event, path: Path, opened: list[socket.socket]) -> None:
    """Connect as fast as it goes, to its end and beyond."""
    while not over.is_set():
        opened.append(socket.socket(socket.AF_UNIX))
        opened[-1].settimeout(0.2)
        try:
            opened[-1].connect(str(path))
        except OSError:
            return


def test_who_connects_while_it_ends_is_dropped_and_nothing_stays_open(tmp_path: Path) -> None:
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", ResourceWarning)
        for number in range(TIMES):
            path, over, opened = tmp_path / str(number), threading.Event(), list[socket.socket]()
            server = served(path)
            server.start("here")
            crowd = threading.Thread(target=connect_until, args=(over, path, opened))
            crowd.start()
            while len(opened) < 20 and crowd.is_alive():
                over.wait(0.001)
            assert len(opened) >= 20
            server.close()
            over.set()
            crowd.join()
            for each in opened:
                each.close()
        gc.collect()
    messages = [str(each.message) for each in told]
    assert [each for each in messages if "database" not in each] == []  # those are of tests before this one


ANOTHER = 4711
MOST = 60
"""More than what a claim and a release hand to the link."""


@pytest.fixture(scope="module")
def machine() -> MachineProfile:
    return load_machine(MACHINE).machine


class _Moments:
    """The signal comes at the n-th time that the link is used, before or behind what is done with it."""

    def __init__(self, console: OneConsole, at: int, come: Callable[[], object]) -> None:
        self.over = False
        self._left, self._come = at, come
        link = console.client.link
        for name in ("send", "receive"):
            setattr(link, name, self._watched(getattr(link, name)))

    def _watched(self, real: Callable[..., Any]) -> Callable[..., Any]:
        def use(*words: object) -> object:
            self._pass()
            done = real(*words)
            self._pass()
            return done

        return use

    def _pass(self) -> None:
        self._left -= 1
        if self._left == 0:
            self.over = True
            self._come()


def works(console: OneConsole, interruption: Interruption) -> None:
    """What `console run` does with the machine, up to the point where something would move."""
    guard(interruption, console.lathe, console.sim.now_s)
    try:
        console.owning.claim()
        console.lathe.stop.check()
    finally:
        leave(console.lathe, console.owning)


@pytest.mark.parametrize("holder", [NOBODY, ANOTHER])
def test_no_signal_is_lost_or_stops_another(machine: MachineProfile, tmp_path: Path, holder: int) -> None:
    sim, endings = SimulatedLathe(machine), set()
    for at in range(1, MOST):
        console = console_of(sim, machine, tmp_path / "here", locking=False)
        console.client.request(f"P1000={holder}")
        console.hear()
        interruption = Interruption()
        sent: list[tuple[ConsoleRole, bytes]] = []
        urgent = console.client.link.send_urgent

        def stops(data: bytes, console: OneConsole = console, sent: Any = sent, urgent: Any = urgent) -> None:
            assert console.lathe.ownership is not None
            sent.append((console.lathe.ownership.standing, data))
            urgent(data)

        console.client.link.send_urgent = stops  # type: ignore[method-assign]
        moments = _Moments(console, at, partial(interruption.end, "SIGTERM"))
        try:
            works(console, interruption)
        except Interrupted:
            endings.add("at once")
        except RefusedError:
            endings.add("refused")
            assert holder == ANOTHER
        except ProblemError as error:
            assert error.problems[0].code == "machine.stopped", error
            endings.add("stopped")
        else:
            endings.add("in the release")
        if not moments.over:
            break
        assert {standing for standing, _ in sent} <= {ConsoleRole.OWNER}
        assert holder == NOBODY or not sent
        assert int(sim.controller.variables.get(VariableKind.P, OWNER)) == holder, at
    else:
        raise AssertionError("a claim has more moments than that")
    assert endings >= ({"at once", "stopped", "in the release"} if holder == NOBODY else {"at once", "refused"})


def test_what_was_ours_and_still_moves_is_stopped(machine: MachineProfile, tmp_path: Path) -> None:
    sim = SimulatedLathe(machine)
    console = console_of(sim, machine, tmp_path, locking=False)
    interruption = Interruption()
    guard(interruption, console.lathe, console.sim.now_s)
    console.owning.claim()
    console.lathe.verify()
    console.lathe.enable()

    def ousted(snapshot: Snapshot) -> None:
        if said or not snapshot.moving:
            return
        assert console.lathe.ownership is not None
        console.lathe.ownership.see(ANOTHER)
        console.hear()
        interruption.end("SIGINT")
        said.append(console.hear())

    said: list[bytes] = []
    console.looks.append(ousted)
    with pytest.raises(ProblemError) as ended:
        console.lathe.home()
    assert ended.value.problems[0].code in ("machine.stopped", "owner.ousted")
    assert set(said[0]) & set(STOPS)


def test_who_was_pushed_aside_at_rest_ends_without_a_word(machine: MachineProfile, tmp_path: Path) -> None:
    sim = SimulatedLathe(machine)
    first, second = (console_of(sim, machine, tmp_path / name, locking=False) for name in ("here", "there"))
    interruption = Interruption()
    guard(interruption, first.lathe, sim.now_s)
    first.owning.claim()
    second.owning.take_control()
    first.lathe.snapshot()
    first.hear()
    with pytest.raises(Interrupted):
        interruption.end("output closed")
    leave(first.lathe, first.owning)
    assert first.hear() == b""


def test_what_must_not_end_half_done_ends_behind_it() -> None:
    interruption, done = Interruption(), []
    with pytest.raises(Interrupted, match="SIGTERM"), interruption.holding():
        interruption.end("SIGTERM")
        done.append(True)
    assert done


@pytest.fixture
def at_a_line(card: Commissioned, monkeypatch: MonkeyPatch) -> Iterator[Callable[[bytes], None]]:
    """Let SIGTERM come when the card is sent a certain piece of text for the first time."""
    send = card.link.send
    waits: list[bytes] = []

    def heard(data: bytes) -> None:
        send(data)
        if waits and waits[0] in data:
            waits.clear()
            os.kill(os.getpid(), signal.SIGTERM)

    monkeypatch.setattr(card.link, "send", heard)
    yield waits.append
    assert not waits, "it was never sent"


def test_doctor_that_ends_while_it_asks_whose_the_machine_is_stops_nobody(
    console: Console, card: Commissioned, monkeypatch: MonkeyPatch, at_a_line: Callable[[bytes], None]
) -> None:
    real(card, monkeypatch)
    card.tell(f"P1000={ANOTHER}")
    at_a_line(b"P1000\r")
    card.line.heard = b""
    said = console("doctor", "--prove", "--yes")
    assert (said.code, "SIGTERM" in said.err) == (1, True)
    assert not set(card.line.heard) & set(STOPS)


def test_an_apply_is_not_left_half_done_and_gives_the_machine_back(
    console: Console, card: Commissioned, at_a_line: Callable[[bytes], None]
) -> None:
    card.tell("I130=600", "I131=600")
    at_a_line(b"I130=528")
    said = console("controller", "apply", "--yes")
    assert (said.code, "SIGTERM" in said.err) == (1, True)
    assert card.client.numbers("I130", "I131", "P1000") == (528.0, 4905.0, 0.0)
