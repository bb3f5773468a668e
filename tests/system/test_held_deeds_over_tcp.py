"""What another host changes for the whole feed, and puts back before its end, is never called good.

`console simulator` is a process with a port, `console run` cuts over it as another one, and another host has a
connection of its own: it sees by the carriage how far the cut is."""

from __future__ import annotations

import json
import os
import re
import select
import socket
import subprocess
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from functools import cache
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING

import pytest

from benchmarks.held_deeds import OTHER, Change, changes_of
from drivers.clock import RealClock
from drivers.cutting.planning import CutPlan, Strategy, plan_cut
from drivers.link.address import TcpAddress
from drivers.link.opening import open_link
from drivers.pmac.client import PmacClient
from drivers.simulator.machine import SimulatedLathe
from tests.system.patient_card import PatientCard, patient_card
from tests.system.run_over_link import Order, order

if TYPE_CHECKING:
    from tests.system.conftest import Serve

pytestmark = pytest.mark.system

CUT_MM = 1.5
DEEDS = 20
LEAST_CHANGE = 0.2  # of the value: what is hardly another one is for the benchmark
TIMEOUT_S = 60.0
BEGUN_MM = 0.1  # behind the start, where the axes were checked last
LEFT_MM = 0.2  # before the end of the feed: 0.24 s


@pytest.fixture
def made(tmp_path: Path) -> Order:
    return order(tmp_path, CUT_MM)


@cache
def drawn(made: Order) -> tuple[CutPlan, list[Change]]:
    """The cut, and so many of the settings that the profile states and of the constants of its program."""
    plan = plan_cut(made.job, made.machine, Strategy.PVT)
    named = [
        each for each in changes_of(made.machine, plan).single if each.name[0] in "IP" and each.weight > OTHER
    ]
    stated = [each for each in named if abs(each.other - each.there) > LEAST_CHANGE * abs(each.there)]
    of_each = {each.name: each for each in Random(2001).sample(stated, len(stated))}
    return plan, list(of_each.values())[:DEEDS]


@contextmanager
def another_host(host: str, port: int) -> Iterator[PmacClient]:
    with closing(open_link(TcpAddress(host=host, port=port))) as link:
        client = PmacClient(link, RealClock())
        client.connect()
        yield client


def sees(client: PmacClient, reached: Callable[[float], bool], process: subprocess.Popen[str]) -> bool:
    """Look at the carriage until it is somewhere; False where the console has ended before."""
    end_s = time.monotonic() + TIMEOUT_S
    while process.poll() is None and time.monotonic() < end_s:
        if reached(client.numbers("#3P")[0]):
            return True
        time.sleep(0.01)
    return False


@pytest.mark.first(1)
@pytest.mark.parametrize("number", range(DEEDS))
def test_what_was_changed_for_the_whole_feed_is_not_called_good(number: int, made: Order, serve: Serve) -> None:
    plan, changes = drawn(made)
    change, per_mm = changes[number], made.machine.carriage.counts_per_mm
    begun = plan.carriage_start + BEGUN_MM * per_mm
    end = plan.carriage_start + plan.setup.whole_turns * plan.setup.carriage_per_turn - LEFT_MM * per_mm
    with serve("--tcp", "127.0.0.1:0", "--machine", str(made.machine_file)) as served:
        host, port = served.tcp
        with another_host(host, port) as client, made.proven(f"tcp:{host}:{port}") as process:
            assert sees(client, lambda z: z > begun, process), process.communicate(timeout=TIMEOUT_S)
            client.request(change.line(0.0, 1.0), TIMEOUT_S)
            sees(client, lambda z: z > end, process)
            client.request(change.line(1.0, 0.0), TIMEOUT_S)
            out, err = process.communicate(timeout=TIMEOUT_S)
        assert process.returncode == 1, (change, out, err)
        codes = [each["code"] for each in json.loads(out)["errors"]]
        assert any(code.startswith("cut.") for code in codes), (change, codes)  # and no line or lease was lost


# One digit that changes between a real serial device and the controller: a cut that nothing has moved for.


ENDS_WITHIN_S = 40.0
CHUNK = 4096
JOG = re.compile(rb'(?<!")#\dJ=-?(?=\d)')


class BadCable:
    """The bytes of a serial device, to and from a card; the first jog to a position arrives with a digit more.

    `positions` is where the axes were commanded to be then.
    """

    def __init__(self, card: PatientCard) -> None:
        self._card = card
        self.positions: list[float] = []
        self.jogs: list[bytes] = []
        self._held = b""
        self._line, self._device = os.openpty()
        tty.setraw(self._device)
        self.address = f"serial:{os.ttyname(self._device)}?baud=4000000"
        self._ended = threading.Event()

    def carry(self) -> None:
        """Carry bytes both ways until `end`."""
        host, _, port = self._card.console.removeprefix("tcp:").rpartition(":")
        with closing(socket.create_connection((host, int(port)))) as card:
            while not self._ended.is_set():
                readable, _, _ = select.select([self._line, card.fileno()], [], [], 0.05)
                if self._line in readable:
                    card.sendall(self._damaged(os.read(self._line, CHUNK)))
                if card.fileno() in readable:
                    os.write(self._line, card.recv(CHUNK))

    def end(self) -> None:
        self._ended.set()

    def close(self) -> None:
        os.close(self._line)
        os.close(self._device)

    def _damaged(self, data: bytes) -> bytes:
        """A line is looked at whole, up to the control character behind it."""
        data, self._held = self._held + data, b""
        if data[-1] >= 0x20:
            data, self._held = b"", data
        self.jogs += JOG.findall(data)
        if self.positions or not self.jogs:
            return data
        motors = self._card.lathe.controller.motors
        self.positions = [motors[number].desired for number in (1, 2, 3)]
        return JOG.sub(rb"\g<0>2", data, count=1)


@contextmanager
def bad_cable(card: PatientCard) -> Iterator[BadCable]:
    cable = BadCable(card)
    carrying = threading.Thread(target=cable.carry, name="bad cable")
    carrying.start()
    try:
        yield cable
    finally:
        cable.end()
        carrying.join(ENDS_WITHIN_S)
        cable.close()


@pytest.fixture
def short_order(tmp_path: Path) -> Order:
    return order(tmp_path, 0.5)


def test_a_digit_too_many_in_a_jog_ends_the_run_and_moves_nothing(short_order: Order) -> None:
    with patient_card(SimulatedLathe(short_order.machine)) as card, bad_cable(card) as cable:
        with short_order.proven(cable.address) as process:
            _, told = process.communicate(timeout=ENDS_WITHIN_S)
        assert process.returncode == 1
        motors = card.lathe.controller.motors
        assert cable.positions, "no jog was ever sent"
        assert cable.jogs == [b"#3J="], "another axis was jogged"
        assert motors[3].desired == pytest.approx(cable.positions[2], abs=0.5)
        # The others hold their places until they are disabled; one that settles then rests some counts off.
        assert [motors[number].desired for number in (1, 2)] == pytest.approx(cable.positions[:2], abs=20.0)
        assert not any(motors[number].amplifier_enabled for number in (1, 2, 3))
    assert "reached the controller corrupted" in told, told
    assert len(cable.jogs) == 1, "it was sent again"
