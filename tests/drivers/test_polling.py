"""Whoever only asks changes nothing: the same motion, number by number, with and without clients."""

from __future__ import annotations

import pytest

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.simulator.hosts.port import Port
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from tests.drivers.conftest import Recorder

BLENDED = (
    "LINEAR INC TA20 TS5 TM37 P1=0",
    "WHILE(P1<12)",
    "P1=P1+1",
    "X(10*SIN(P1*30)) Y(P1*7) Z-3",
    "ENDWHILE",
    "DWELL30",
)
EVERYTHING = (
    *BLENDED,
    "RAPID Z100",
    "SPLINE1 TA30 X5 Y80",
    "X-5 Y80",
    "LINEAR PVT40 X3:0",
    "HOME3",
    "LINEAR X20",
)

QUESTIONS = (
    b"#1P#2V ? ?? ???\r",
    b"#3PVF I130..135\r",
    b"&1%P1 Q1 M1 LIST PROG 1\r",
    b"#2?#1?&1??\r",
    b"\x02\x03\x06\x07\x10\x16",
    b"PC PE SIZE no such word\r",
)


Tracks = tuple[list[list[float]], list[list[float]]]


def told(machine: MachineProfile, dialect: Dialect, clients: int, program: tuple[str, ...]) -> Tracks:
    """Run a program; return what the motors were told, and where they were, while so many clients poll."""
    sim = SimulatedLathe(machine, dialect=dialect)
    host = sim.connect()
    polling: list[Port] = [sim.connect() for _ in range(clients)]
    recorders = []
    for motor in (1, 2, 3):
        true_position = sim.controller.motors[motor]
        true_position.axis = Recorder(true_position.axis)
        recorders.append(true_position.axis)

    def say(line: str) -> None:
        host.receive(line.encode("ascii") + b"\r")
        sim.wait(0.01)
        assert b"\x07" not in host.take_output(), line

    say("I3=2 I6=1 I119=0 I219=0 I319=0")
    say("#1J/ #2J/ #3J/")
    for line in ("OPEN PROG 1 CLEAR", *program, "CLOSE"):
        say(line)
    say("&1B1R")
    for tick in range(120):
        for place, port in enumerate(polling):
            port.receive(QUESTIONS[(tick + place) % len(QUESTIONS)])
            if place % 2:
                sim.attend(port)
            port.take_output()
        if tick == 20:
            say("&1H")
        elif tick == 60:
            say("&1R")
        elif tick == 80:
            say("&1%70")
        sim.wait(0.01)
    assert not sim.controller.systems[1].motion.runtime_error
    return [recorder.commands for recorder in recorders], [recorder.positions for recorder in recorders]


@pytest.mark.parametrize("dialect", [PMAC, TURBO], ids=lambda dialect: dialect.name)
def test_a_trajectory_is_the_same_bit_by_bit_with_four_clients_at_100_hz(
    machine: MachineProfile, dialect: Dialect
) -> None:
    alone, polled = (told(machine, dialect, clients, EVERYTHING) for clients in (0, 4))
    assert any(max(track) - min(track) > 100 for track in alone[0])
    assert polled == alone


def test_both_families_move_alike(machine: MachineProfile) -> None:
    """The same settings at the places that each family has for them make the same motion."""
    assert told(machine, TURBO, 0, BLENDED) == told(machine, PMAC, 0, BLENDED)
