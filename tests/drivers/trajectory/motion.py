"""Requests made into motion without a program, and motion looked at: what the tests of the move modes share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import pytest

from drivers.pmac.axes import axis_positions, read_definitions
from drivers.pmac.dialect import PMAC, Dialect
from drivers.pmac.execution.run import ProgramRun
from drivers.pmac.requests import (
    CircleRequest,
    EndOfProgram,
    LinearRequest,
    PvtRequest,
    RapidRequest,
    Request,
    SplineRequest,
)
from drivers.pmac.trajectory.pieces import Piece, position_at, velocity_at
from drivers.pmac.trajectory.planned_pieces import PlannedPieces
from drivers.pmac.trajectory.planner import MotionPlanner
from drivers.pmac.variables import VariableStore

INTERRUPT_MS = 3 * 3_713_707 / 8_388_608
"""I8 = 2: every third servo cycle of the factory's I10."""


class Script:
    """Stands for a program: gives requests, one after the other, then the end."""

    def __init__(self, requests: Iterable[Request]) -> None:
        self._requests = iter(requests)
        self.given = 0

    def advance(self) -> Request:
        self.given += 1
        return next(self._requests, EndOfProgram())


@dataclass(frozen=True)
class Motion:
    """Pieces one after the other, looked at by their time."""

    pieces: tuple[Piece, ...]

    @property
    def duration_ms(self) -> float:
        return sum(piece.duration_ms for piece in self.pieces)

    @property
    def starts_ms(self) -> list[float]:
        starts, elapsed = [], 0.0
        for piece in self.pieces:
            starts.append(elapsed)
            elapsed += piece.duration_ms
        return starts

    def at(self, t_ms: float, motor: int = 0) -> float:
        piece, inside = self._piece(t_ms)
        return position_at(piece.cubics[motor], inside)

    def velocity(self, t_ms: float, motor: int = 0) -> float:
        piece, inside = self._piece(t_ms)
        return velocity_at(piece.cubics[motor], inside)

    def peak_velocity(self, motor: int = 0) -> float:
        """Greatest speed: at the ends of pieces, or where the acceleration passes zero inside."""
        found = [0.0]
        for piece in self.pieces:
            _, _, c2, c3 = piece.cubics[motor]
            instants = [0.0, piece.duration_ms]
            if c3 and 0.0 < -c2 / (3 * c3) < piece.duration_ms:
                instants.append(-c2 / (3 * c3))
            found += [abs(velocity_at(piece.cubics[motor], t)) for t in instants]
        return max(found)

    def end(self, motor: int = 0) -> float:
        last = self.pieces[-1]
        return position_at(last.cubics[motor], last.duration_ms)

    def _piece(self, t_ms: float) -> tuple[Piece, float]:
        begin = 0.0
        for piece in self.pieces:
            if t_ms <= begin + piece.duration_ms:
                return piece, t_ms - begin
            begin += piece.duration_ms
        return self.pieces[-1], t_ms - begin + self.pieces[-1].duration_ms


def planner_for(
    requests: Iterable[Request],
    definitions: Sequence[str] = ("#1->X",),
    settings: Mapping[int, float] | None = None,
    start: Mapping[int, float] | None = None,
    dialect: Dialect = PMAC,
) -> MotionPlanner:
    """A planner over a script; no Ix16 and Ix17 but those in `settings`, TA 10 and TS 0 in Ix87 and Ix88."""
    read = read_definitions(definitions)
    free = {100 * d.motor + n: 0.0 for d in read for n in (16, 17)}
    blend = {dialect.system_index(1, 87): 10.0, dialect.system_index(1, 88): 0.0}
    variables = VariableStore({**dialect.factory, **free, **blend, **(settings or {})}, dialect)
    position = tuple((start or {}).get(d.motor, d.offset) for d in read)
    return MotionPlanner(cast(ProgramRun, Script(requests)), read, variables, position)


def plans(planner: MotionPlanner) -> list[PlannedPieces]:
    """Everything up to the end; events are taken as done, nothing moved by them."""
    done = []
    while True:
        planned = planner.plan()
        done.append(planned)
        if planned.finished:
            return done


def motion(
    requests: Iterable[Request],
    definitions: Sequence[str] = ("#1->X",),
    settings: Mapping[int, float] | None = None,
    start: Mapping[int, float] | None = None,
    dialect: Dialect = PMAC,
) -> Motion:
    planner = planner_for(requests, definitions, settings, start, dialect)
    return Motion(tuple(piece for planned in plans(planner) for piece in planned.pieces))


def where(definitions: Sequence[str], counts: Sequence[float]) -> dict[str, float]:
    """Axis positions of motors, in the order of their definitions."""
    read = read_definitions(definitions)
    return axis_positions({d.motor: d for d in read}, {d.motor: c for d, c in zip(read, counts, strict=True)})


def assert_smooth(
    pieces: Sequence[Piece], start: Sequence[float], stroke: float, *, velocity: bool = True
) -> None:
    """No jump of position and, unless told otherwise, none of velocity; at rest before and after."""
    motors = range(len(start))
    position, speed = list(start), [0.0 for _ in start]
    for piece in pieces:
        assert piece.duration_ms > 0.0
        for m in motors:
            assert position_at(piece.cubics[m], 0.0) == pytest.approx(position[m], abs=1e-9 * stroke)
            if velocity:
                assert velocity_at(piece.cubics[m], 0.0) == pytest.approx(speed[m], abs=1e-8 * stroke)
            position[m] = position_at(piece.cubics[m], piece.duration_ms)
            speed[m] = velocity_at(piece.cubics[m], piece.duration_ms)
    if velocity:
        assert speed == pytest.approx([0.0 for _ in start], abs=1e-8 * stroke)


def linear(ta: float = 10.0, ts: float = 0.0, tm: float = 10.0, **targets: float) -> LinearRequest:
    return LinearRequest(line=0, targets=targets, ta_ms=ta, ts_ms=ts, tm_ms=tm)


def rapid(**targets: float) -> RapidRequest:
    return RapidRequest(line=0, targets=targets, moving=frozenset(targets))


def splined(ms: float, *, uniform: bool = True, **targets: float) -> SplineRequest:
    return SplineRequest(line=0, targets=targets, duration_ms=ms, uniform=uniform)


def pvt(ms: float, velocity: float = 0.0, **targets: float) -> PvtRequest:
    """A segment that ends with one velocity of all its axes, user units a ms."""
    velocities = dict.fromkeys(targets, velocity)
    return PvtRequest(line=0, targets=targets, velocities=velocities, duration_ms=ms)


def circle(
    targets: Mapping[str, float],
    center: Mapping[str, float] | None = None,
    radius: float | None = None,
    *,
    clockwise: bool = True,
    normal: tuple[float, float, float] = (0.0, 0.0, -1.0),
    ta: float = 10.0,
    ts: float = 0.0,
    tm: float | None = 100.0,
    speed: float = 1.0,
) -> CircleRequest:
    return CircleRequest(
        line=0,
        targets=targets,
        clockwise=clockwise,
        normal=normal,
        center=center,
        radius=radius,
        ta_ms=ta,
        ts_ms=ts,
        tm_ms=tm,
        speed_per_ms=speed,
    )
