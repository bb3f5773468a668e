"""One digit that changes between a real serial device and the controller: a cut that nothing has moved for."""

from __future__ import annotations

import os
import re
import select
import socket
import threading
import tty
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from drivers.simulator.machine import SimulatedLathe
from tests.system.patient_card import PatientCard, patient_card
from tests.system.run_over_link import Order, order

pytestmark = pytest.mark.system

TIMEOUT_S = 40.0
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
        carrying.join(TIMEOUT_S)
        cable.close()


@pytest.fixture
def made(tmp_path: Path) -> Order:
    return order(tmp_path, 0.5)


def test_a_digit_too_many_in_a_jog_ends_the_run_and_moves_nothing(made: Order) -> None:
    with patient_card(SimulatedLathe(made.machine)) as card, bad_cable(card) as cable:
        with made.proven(cable.address) as process:
            _, told = process.communicate(timeout=TIMEOUT_S)
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
