"""A simulated card with ideal motors and no host: what its motors are told, servo cycle by servo cycle."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

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
