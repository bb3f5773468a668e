"""A card with one host, and nothing between them but bytes: those of its line, or of the Ethernet board."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from drivers.pmac.axes import read_definitions
from drivers.pmac.dialect import PMAC, Dialect
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.listing import stored_line
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.settings import settings_with
from drivers.simulator.card.controller import SimulatedController
from drivers.simulator.card.coordinate import CoordinateSystem
from drivers.simulator.card.motor import Motor
from drivers.simulator.hosts.ethernet import Board, EthernetSession
from drivers.simulator.hosts.port import Port
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile

ACK, BELL, STX, LF, CR = b"\x06", b"\x07", b"\x02", b"\n", b"\r"
CYCLE_S = 0.005
"""A little more than one background cycle of the bundled machine."""


@dataclass(frozen=True, kw_only=True)
class Wire:
    """I3=2 and I6=1 unless a test sets them otherwise."""

    sim: SimulatedLathe
    port: Port

    @property
    def card(self) -> SimulatedController:
        return self.sim.controller

    def raw(self, data: str | bytes) -> bytes:
        """Send bytes and return what the card says at once; time passes only over a SAVE."""
        self.port.receive(data.encode("latin-1") if isinstance(data, str) else data)
        self._attend()
        while self.card.saving:
            self.sim.wait(CYCLE_S)
            self._attend()
        return self.port.take_output()

    def _attend(self) -> None:
        while not self.port.idle or self.port.ready:
            self.sim.attend(self.port)
            if not self.port.ready:
                break

    def ask(self, line: str) -> list[str]:
        """Return the lines of data that a line answers."""
        said = self.raw(line + "\r")
        assert said.endswith(ACK), (line, said)
        data = said[:-1].decode("ascii")
        assert not data or data.endswith("\r")
        return data.split("\r")[:-1]

    def listed(self, buffer: str) -> list[str]:
        """Return the lines of a buffer (`PROG 1`) in full, whatever I9 is, without the end of every listing."""
        form = self.card.variables.i(9)
        self.card.variables.set(VariableKind.I, 9, 3.0)
        lines = self.ask(f"LIST {buffer}")
        self.card.variables.set(VariableKind.I, 9, form)
        assert lines[-1] == "RETURN"
        return lines[:-1]

    def tell(self, *lines: str) -> None:
        """Send lines that answer nothing."""
        for line in lines:
            assert self.ask(line) == [], line

    def refusal(self, line: str) -> int:
        """Return the number of the error that a line is answered with, and with nothing else."""
        said = self.raw(line + "\r")
        assert len(said) == 8, (line, said)
        assert said.startswith(BELL + b"ERR"), (line, said)
        assert said.endswith(CR), (line, said)
        return int(said[4:7])

    def settle(self, timeout_s: float = 60.0) -> None:
        """Let time pass until nothing moves any more."""
        end = self.sim.now_s() + timeout_s
        while self.sim.now_s() < end:
            self.sim.wait(0.02)
            systems = self.card.systems.values()
            if not any(motor.jogging for motor in self.card.motors.values()) and not any(
                system.moving or system.running for system in systems
            ):
                return
        raise AssertionError(f"still moving after {timeout_s} s")


def wire(machine: MachineProfile, dialect: Dialect | None = None, saved: Path | None = None) -> Wire:
    sim = SimulatedLathe(machine, dialect=dialect, saved=saved)
    made = Wire(sim=sim, port=sim.connect())
    made.raw("I3=2 I6=1\r")
    return made


# A client of the Ethernet board that knows nothing but bytes.

DOWN, UP = 0x40, 0xC0


@dataclass(frozen=True, kw_only=True)
class BoardWire:
    """One connection; a host of the ASCII line may stand beside it."""

    sim: SimulatedLathe
    session: EthernetSession

    def raw(self, sent: bytes, most_cycles: int = 2000) -> list[bytes]:
        """Send bytes and return the replies, each as it is sent. Time passes only where the card wants it to."""
        self.session.receive(sent)
        replies = self.session.turn()
        for _ in range(most_cycles):
            if not self.session.busy:
                if replies:
                    return replies
                self.sim.wait(CYCLE_S)
            replies += self.session.turn()
        return replies

    def ask(
        self, kind: int, code: int, data: bytes = b"", *, value: int = 0, index: int = 0, length: int = 0
    ) -> bytes:
        """Send one request, as its header is printed, and return its one reply."""
        header = struct.pack(">BBHHH", kind, code, value, index, length or len(data))
        (reply,) = self.raw(header + data)
        return reply

    def response(self, line: bytes) -> bytes:
        """GETRESPONSE."""
        return self.ask(DOWN, 0xBF, line)

    def fetched(self, most: int = 1400) -> bytes:
        """GETBUFFER."""
        return self.ask(UP, 0xC5, length=most)

    def settle(self, timeout_s: float = 60.0) -> None:
        """Let time pass until nothing moves any more."""
        end = self.sim.now_s() + timeout_s
        while self.sim.now_s() < end:
            self.sim.wait(0.02)
            controller = self.sim.controller
            if not any(motor.jogging for motor in controller.motors.values()) and not any(
                system.moving or system.running for system in controller.systems.values()
            ):
                return
        raise AssertionError(f"still moving after {timeout_s} s")


def wire_board(machine: MachineProfile, dialect: Dialect | None = None) -> BoardWire:
    """As the factory has set the handshake."""
    sim = SimulatedLathe(machine, dialect=dialect)
    sim.controller.variables.replace_i({**sim.controller.variables.settings(), 3: 1, 4: 0, 6: 3})
    return BoardWire(sim=sim, session=EthernetSession(sim, sim.connect(), Board()))


CYCLE_MS = 3_713_707 / 8_388_608
"""The factory's servo cycle."""

BLOCK = 11
"""Servo cycles of a background cycle, as on the bundled lathe."""

SETTINGS = {
    **{f"I{motor}{number}": value for motor in (1, 2) for number, value in {"00": 1, "16": 0, "17": 0}.items()},
    **{f"I{motor}{number}": value for motor in (1, 2) for number, value in {"19": 0, "20": 10, "21": 0}.items()},
    **{f"I{motor}{number}": value for motor in (1, 2) for number, value in {"15": 1, "22": 50, "23": 5}.items()},
    "I194": 8_388_607,
    "I195": 8_388_607,
}
"""Two motors without limits of speed; jogs take 10 ms to reach 50 counts/ms; the time base follows at once."""


class IdealCard:
    """Motors 1 and 2 are X and Y of coordinate system 1, one count a unit, in closed loop at 0."""

    def __init__(self, dialect: Dialect = PMAC, /, **settings: float) -> None:
        definitions = read_definitions(("#1->X", "#2->Y"))
        variables = settings_with({**SETTINGS, **settings}, dialect)
        self.controller = SimulatedController(variables, {}, definitions, CYCLE_MS, dialect)
        self.track: dict[int, list[float]] = {1: [], 2: []}
        for motor in (1, 2):
            self.controller.motors[motor].jog_speed(0)
        self.wait(10)

    @property
    def system(self) -> CoordinateSystem:
        return self.controller.systems[1]

    def motor(self, number: int = 1) -> Motor:
        return self.controller.motors[number]

    @property
    def x(self) -> float:
        return self.motor(1).desired

    def set(self, **values: float) -> None:
        for name, value in values.items():
            self.controller.variables.set(VariableKind(name[0]), int(name[1:]), value)

    def get(self, name: str) -> float:
        return self.controller.variables.get(VariableKind(name[0]), int(name[1:]))

    def program(self, *lines: str, number: int = 1) -> None:
        """Store a program; it is what the next R runs."""
        self.store(*lines, number=number)
        self.system.point(number)

    def store(self, *lines: str, number: int) -> None:
        self.controller.programs[number] = [stored_line(line) for line in lines]

    def wait(self, ms: float) -> None:
        """Advance by whole background cycles."""
        for _ in range(round(ms / (BLOCK * CYCLE_MS) + 0.5)):
            self.block()

    def block(self) -> None:
        origins = {number: self.motor(number).axis.origin for number in self.track}
        tracks = self.controller.run_block(BLOCK)
        for number, kept in self.track.items():
            kept.extend(position - origins[number] for position in tracks.get(number, ()))
        self.controller.background()

    def settle(self, timeout_ms: float = 20_000.0) -> None:
        end = self.controller.now_ms + timeout_ms
        while self.controller.now_ms < end:
            self.block()
            moving = any(system.running or system.moving for system in self.controller.systems.values())
            if not moving and not any(motor.jogging for motor in self.controller.motors.values()):
                return
        raise AssertionError(f"still moving after {timeout_ms} ms")

    def run(self, *lines: str) -> np.ndarray:
        """Run a program to its end; return the positions of motor 1 since R."""
        self.program(*lines)
        return self.record(self.system.run, self.settle)

    def record(self, *acts: Callable[[], object], motor: int = 1) -> np.ndarray:
        """Return the positions of a motor, one servo cycle apart, from before `acts` to the end of the last."""
        start = len(self.track[motor])
        for act in acts:
            act()
        return np.array(self.track[motor][start - 1 :])


def said(of: object, *names: str) -> list[str]:
    """Return those of the named conditions of a motor or a coordinate system that hold."""
    return [name for name in names if getattr(of, name)]


def refused(act: Callable[[], object]) -> int:
    """Return the number of the refusal."""
    with pytest.raises(PmacError) as refusal:
        act()
    return int(refusal.value.code)


def moving_time_ms(track: np.ndarray) -> float:
    """Return the time from the first to the last change."""
    changes = np.flatnonzero(np.diff(track))
    return float(changes[-1] - changes[0] + 1) * CYCLE_MS


def stops(track: np.ndarray) -> list[float]:
    """Return where a motion comes to rest on its way, be it for an instant: below a fiftieth of its top speed."""
    speed = np.abs(np.diff(track))
    changes = np.flatnonzero(speed)
    inside = speed[changes[0] : changes[-1] + 1]
    slow = np.flatnonzero(inside < inside.max() / 50) + changes[0]
    groups = np.split(slow, np.flatnonzero(np.diff(slow) > 1) + 1)
    middle = [group for group in groups if len(group) and changes[0] + 30 < group[0] < changes[-1] - 30]
    return [float(track[group].mean() + track[group + 1].mean()) / 2 for group in middle]


def rests(track: np.ndarray) -> list[tuple[float, float]]:
    """Return the position and the length in ms of every rest between two motions."""
    still = np.diff(track) == 0.0
    edges = np.flatnonzero(np.diff(still.astype(int)))
    spans = [(first, last) for first, last in pairwise(edges) if still[first + 1]]
    return [(float(track[first + 1]), float(last - first) * CYCLE_MS) for first, last in spans]
